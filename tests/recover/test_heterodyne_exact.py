"""Heterodyne decoding of sums of harmonics through optics that differ along x and y, exact to rounding.

A light field that is a sum of the harmonics that a mask has carriers for, and of few waves on the sensor, is
recorded by sums in closed form: what is decoded is that light field, at the rays that the frame says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

import vcc
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import mm, um
from vcc.optics.faces import Element, Faces
from vcc.recover import band_limited, heterodyne_calibration, true_views
from vcc.recover.heterodyne import HeterodyneGeometry, decode_heterodyne
from vcc.shapes.patterns import CosineSum

HARMONICS, TILES, PHASE = 2, 5, 0.4
ROWS, COLUMNS = 7, 10  # of a view
D, NEAR_MASK = 52 * mm, 50 * mm
LENS, WEDGE = 50 * mm, (0.004, -0.003)


@dataclass(frozen=True)
class Cylinder(Element):
    """Bends light along y alone."""

    focal_length: float = 1.0

    def faces(self) -> Faces:
        linear = np.eye(4)
        linear[3, 1] = -1 / self.focal_length
        return Faces(deflection=Affine.from_parts(linear, np.zeros(4)))


ELEMENTS = (
    vcc.Lens(focal_length=LENS, decentre=(0.3 * mm, -0.2 * mm)),
    vcc.Prism(WEDGE, z=10 * mm),
    Cylinder(z=20 * mm, focal_length=8 * mm),  # along y slopes fall with places on the sensor
)


def arriving(z: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """a, b and c of places a·u + b·s + c at z, each of (x, y), by tracing rays through the elements one by one."""

    def traced(u: np.ndarray, s: np.ndarray) -> np.ndarray:
        s = s - (u - np.array([0.3, -0.2]) * mm) / LENS
        u = u + 10 * mm * s
        s = s + np.array(WEDGE)
        u = u + 10 * mm * s
        s = s - u / np.array([math.inf, 8 * mm])
        return u + (z - 20 * mm) * s

    nothing, one = np.zeros(2), np.ones(2)
    c = traced(nothing, nothing)
    return traced(one, nothing) - c, traced(nothing, one) - c, c


A, B, C = arriving(D)
A_MASK, B_MASK, C_MASK = arriving(NEAR_MASK)
GAMMA = B_MASK / B
BETA = A_MASK - GAMMA * A
PITCHES = np.array([21 * um, 34 * um])  # along x and y
CARRIERS = 1 / (TILES * PITCHES)
PERIODS = np.abs(GAMMA) / CARRIERS
ACROSS = PERIODS / np.abs(BETA)
SIZES = TILES * PITCHES * (COLUMNS, ROWS)
MIDDLE, MASK_OFF = (0.11 * mm, -0.07 * mm), (0.05 * mm, 0.02 * mm)


@cache
def camera(stop: float | None = None, fill_factor: float = 1e-4, harmonics: int = HARMONICS) -> vcc.Camera:
    mask = vcc.Mask(
        CosineSum(tuple(map(float, PERIODS)), harmonics=harmonics, phase=PHASE),
        z=NEAR_MASK,
        decentre=MASK_OFF,
        name="carrier",
    )
    stops = [] if stop is None else [vcc.Mask(np.ones((1, 1)), width=stop * ACROSS[0], height=ACROSS[1])]
    sensor = vcc.Sensor(
        D, (TILES * ROWS, TILES * COLUMNS), tuple(map(float, PITCHES[::-1])), MIDDLE, fill_factor=fill_factor
    )
    return vcc.Camera([*stops, *ELEMENTS, mask], sensor)


WAVES = ((0.1, 1, -2, 3, 1, 0.3), (0.07, -2, 1, -4, 3, 1.0), (0.08, 0, 2, 2, -2, 2.0), (0.06, 2, 0, 0, 0, 0.5))
"""Amplitude, periods across the aperture (u, v) and on the sensor (x, y), phase."""


def radiance(u, v, x, y):
    """Of rays by where they pass the entrance plane and land."""
    total = 0.5
    for amplitude, a, b, c, e, phase in WAVES:
        turns = (
            a * u / ACROSS[0] + b * v / ACROSS[1] + c * (x - MIDDLE[0]) / SIZES[0] + e * (y - MIDDLE[1]) / SIZES[1]
        )
        total = total + amplitude * np.cos(2 * np.pi * turns + phase)
    return total


def cosines(u: np.ndarray, place: np.ndarray, axis: int) -> np.ndarray:
    """What the mask lets through along one axis of rays through u that land at a place."""
    s = (place - A[axis] * u - C[axis]) / B[axis]
    there = A_MASK[axis] * u + B_MASK[axis] * s + C_MASK[axis] - MASK_OFF[axis]
    n = np.arange(1, HARMONICS + 1).reshape(-1, *[1] * np.ndim(there))
    return 0.5 + np.cos(n * (2 * np.pi * there / PERIODS[axis] + PHASE)).sum(axis=0) / (2 * HARMONICS)


def recorded() -> np.ndarray:
    """∫∫ L·T du dv/|b_x·b_y| over one period: of 9 harmonics at most, by 16 places exactly."""
    sensor = camera().sensor
    x, y = sensor.column_places, sensor.row_places[:, None]
    places = (np.arange(16) + 0.5) / 16 - 0.5
    total = np.zeros(sensor.shape)
    for v in places * ACROSS[1]:
        for u in places * ACROSS[0]:
            total += radiance(u, v, x, y) * cosines(u, x, 0) * cosines(v, y, 1)
    return total / 256 * np.prod(ACROSS) / abs(np.prod(B))


def shadow() -> np.ndarray:
    """The mask's through a hole of a thousandth of the period in the middle: radiance 1."""
    sensor = camera().sensor
    both = cosines(0.0, sensor.row_places, 1)[:, None] * cosines(0.0, sensor.column_places, 0)
    return both * 1e-6 * np.prod(ACROSS) / abs(np.prod(B))


def places_of(decoded: vcc.LightField) -> list[np.ndarray]:
    """(u, v, x, y) of the decoded rays."""
    index = np.moveaxis(np.indices(decoded.shape[:4]), 0, -1)[..., [1, 0, 3, 2]]
    u, v, s, t = np.moveaxis(decoded.frame(index.reshape(-1, 4)).reshape(*decoded.shape[:4], 4), -1, 0)
    return [u, v, A[0] * u + B[0] * s + C[0], A[1] * v + B[1] * t + C[1]]


def test_harmonics_come_out_as_they_went_in():
    made = recorded()
    told = []
    decoded = decode_heterodyne(
        np.stack([made, 0.25 * made], axis=-1),
        camera(),
        calibration=shadow(),
        progress=lambda done, total: told.append((done, total)),
    )
    assert decoded.shape == (TILES, TILES, ROWS, COLUMNS, 2)
    u, v, x, y = places_of(decoded)
    truth = radiance(u, v, x, y)
    assert truth.min() > 0.1  # nothing is cut off
    # Pixels a hundredth as wide as they stand apart: sinc is 1 to 4e-5 at the finest, 4/9 of a cycle a pixel.
    np.testing.assert_allclose(decoded.values[..., 0], truth, atol=2e-4)
    np.testing.assert_allclose(decoded.values[..., 1], truth / 4, atol=1e-4)
    # Views stand evenly over a period, one in the middle; pixels evenly over the sensor; both upright.
    np.testing.assert_allclose(u[0, :, 0, 0], (np.arange(5) - 2) * ACROSS[0] / 5, atol=1e-12)
    np.testing.assert_allclose(v[:, 0, 0, 0], (np.arange(5) - 2) * ACROSS[1] / 5, atol=1e-12)
    for places, middle, size, count in (
        (x[0, 0, 0], *(MIDDLE[0], SIZES[0]), 10),
        (y[0, 0, :, 0], *(MIDDLE[1], SIZES[1]), 7),
    ):
        expected = middle + ((np.arange(count) + 0.5) / count - 0.5) * size
        np.testing.assert_allclose(np.sort(places), expected, atol=1e-12)
    s, t = (decoded.frame(each)[n] for n, each in ((2, [0, 0, 1, 0]), (3, [0, 0, 0, 1])))
    first = decoded.frame([0, 0, 0, 0])
    assert s < first[2]  # what is seen at column k + 1 came from further right: s falls
    assert t < first[3]
    assert told == [(1, 3), (2, 3)]


def test_the_geometry_is_told_along_both_axes():
    geometry = HeterodyneGeometry.of(camera(0.9, 1.0))
    assert geometry.carrier == pytest.approx(tuple(CARRIERS), rel=1e-12)
    assert geometry.aperture_period == pytest.approx(tuple(ACROSS), rel=1e-12)
    assert geometry.aperture_sign == tuple(np.sign(BETA * GAMMA))
    assert geometry.aperture == pytest.approx((0.9 * ACROSS[0], ACROSS[1]))
    assert (geometry.views, geometry.shape, geometry.pixels) == (5, (7, 10), (50, 35))
    assert geometry.pixel_pitch == geometry.sensitive == tuple(PITCHES)
    assert HeterodyneGeometry.of(camera()).aperture == (math.inf, math.inf)
    assert HeterodyneGeometry.of(camera()).sensitive == pytest.approx(tuple(PITCHES / 100))
    # ¼·∏ √(Σ over tiles of ⟨1/sinc²⟩/strength²·carrier·pitch), integrals by Simpson's rule
    power = 0.0
    f = np.linspace(-0.5, 0.5, 2001)
    weights = np.where(np.arange(2001) % 2, 4.0, 2.0)
    weights[[0, -1]] = 1
    for n in range(-2, 3):
        mean = (weights / np.sinc((n + f) / TILES) ** 2).sum() / weights.sum()
        power += mean * (4 if n == 0 else 64) / TILES
    assert geometry.noise_amplification == pytest.approx(0.25 * power, rel=1e-4)


@pytest.mark.parametrize(("share", "lost"), [(0.9e-3, True), (1.1e-3, False)])
def test_carriers_are_lost_below_a_thousandth_of_their_strength(share, lost):
    """One cosine, the second along x, with a share of what the mask gives it, ½/(2h) on either side of ½."""
    sensor = camera().sensor

    def along(place, axis, strengths):
        turns = 2 * np.pi * CARRIERS[axis] * (place - MIDDLE[axis])
        return 0.5 + sum(each * np.cos((n + 1) * turns) for n, each in enumerate(strengths)) / (2 * HARMONICS)

    white = along(sensor.row_places, 1, (1, 1))[:, None] * along(sensor.column_places, 0, (1, share))
    if lost:
        with pytest.raises(InputError, match=r"no carrier \((-2|2), -?\d\)"):
            decode_heterodyne(np.ones(sensor.shape), camera(), calibration=white)
    else:
        decode_heterodyne(np.ones(sensor.shape), camera(), calibration=white)


@pytest.mark.filterwarnings("ignore:negative values of the decoded views:vcc.ResultWarning")
@pytest.mark.parametrize(("border", "cut"), [(0.25, (2, 3)), (0.1, (1, 1)), (0.11, (1, 2)), (0.0, (0, 0))])
def test_borders_fade_out_as_raised_cosines_and_are_cut_off(border, cut):
    """Recording and calibration alike: decoding what is already faded out is decoding without a border."""
    made, white = recorded(), shadow()
    fade = 1.0
    for axis, size in enumerate(made.shape):
        away = np.minimum(np.arange(size) + 0.5, size - np.arange(size) - 0.5) / (size * max(border, 1e-9))
        line = np.where(away < 1, np.sin(np.pi / 2 * np.minimum(away, 1)) ** 2, 1)
        fade = fade * (line[:, None] if axis == 0 else line)
    found = decode_heterodyne(made, camera(), calibration=white, border=border)
    by_hand = decode_heterodyne(made * fade, camera(), calibration=white * fade)
    part = by_hand[:, :, cut[0] : ROWS - cut[0], cut[1] : COLUMNS - cut[1]]
    assert found.shape == part.shape
    np.testing.assert_allclose(found.values, part.values, atol=1e-6)
    assert found.frame.isclose(part.frame)


def test_the_traced_calibration_is_the_shadow():
    image = heterodyne_calibration(camera(), samples=16)
    error = (
        np.abs(image.values / 1e-4 - shadow()).max() / shadow().mean()
    )  # the share of a pixel that is sensitive
    other = np.abs(image.values - shadow()).max() / shadow().mean()
    assert min(error, other) < 0.05


def test_a_calibration_by_turned_views_is_refused():
    turned = np.eye(4)
    turned[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
    field = vcc.LightField.from_views(np.ones((3, 3, 8, 8), np.float32), 1 * mm, 1e-3, 1.0)
    with pytest.raises(InputError, match="in rows along the axes"):
        heterodyne_calibration(camera(), light_field=field.transformed(Affine.from_parts(turned, np.zeros(4))))


# -- what cannot be decoded


def with_mask(**changes) -> vcc.Camera:
    made = camera()
    return vcc.Camera([*made.elements[:-1], replace(made.elements[-1], **changes)], made.sensor)


def pattern(x: float = 1.0, y: float = 1.0, harmonics: int = HARMONICS) -> CosineSum:
    return CosineSum((float(PERIODS[0] * x), float(PERIODS[1] * y)), harmonics=harmonics)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: with_mask(pattern=pattern(x=0.99)), "tiles do not fit horizontally"),
        (lambda: with_mask(pattern=pattern(y=0.99)), "tiles do not fit vertically"),
        (lambda: with_mask(pattern=pattern(y=ROWS / 1.9)), "a view needs 2 or more"),
        (lambda: with_mask(pattern=pattern(x=COLUMNS / 1.9)), "a view needs 2 or more"),
        (lambda: with_mask(pattern=CosineSum((math.inf, 1e-4))), "flat along one axis"),
        (lambda: with_mask(pattern=CosineSum((1e-4, math.inf))), "flat along one axis"),
        (lambda: camera(1.001), "wide horizontally"),
        (
            lambda: vcc.Camera([vcc.Diffuser(vcc.kernels.Gaussian(0.01)), *camera().elements], camera().sensor),
            "bends or scatters light in another way",
        ),
        (
            lambda: vcc.Camera([vcc.LensArray(1 * mm, 10 * mm), *camera().elements], camera().sensor),
            "bends or scatters light in another way",
        ),
        (
            lambda: vcc.Camera(
                [*camera().elements[:-1], replace(camera().elements[-1], name="other"), camera().elements[-1]],
                camera().sensor,
            ),
            "this one has 2",
        ),
    ],
)
def test_what_cannot_be_decoded_is_refused(made, words):
    with pytest.raises(InputError, match=words):
        HeterodyneGeometry.of(made())


def test_two_pixels_of_a_view_and_an_aperture_as_wide_as_its_period_are_enough():
    assert HeterodyneGeometry.of(with_mask(pattern=pattern(y=ROWS / 2))).shape == (2, 10)
    assert HeterodyneGeometry.of(with_mask(pattern=pattern(x=COLUMNS / 2))).shape == (7, 2)
    assert HeterodyneGeometry.of(camera(1.0)).aperture[0] == pytest.approx(ACROSS[0])


# -- what fits the tiles


def test_true_views_of_what_fits_are_the_light_field_itself():
    """In colour: harmonics at the decoded views' places, and of finer waves less, along a straight line."""
    made = camera()
    decoded = decode_heterodyne(recorded(), made, calibration=shadow())
    counts, finer, margin = (6, 8), 4, 16
    # The decoded frame, its pixels a quarter as large, and views as many as fill the period.
    pixels = (ROWS * finer + 2 * margin * finer, COLUMNS * finer + 2 * margin * finer)
    to_decoded = np.diag([5 / counts[1], 5 / counts[0], 1 / finer, 1 / finer])
    offset = np.array(
        [2 - (counts[1] - 1) / 2 * 5 / counts[1], 2 - (counts[0] - 1) / 2 * 5 / counts[0], -margin, -margin]
    )
    offset[2:] += (1 / finer - 1) / 2
    frame = decoded.frame @ Affine.from_parts(to_decoded, offset)
    field = vcc.LightField(np.zeros((*counts, *pixels, 2), np.float32), frame, sample="point")
    u, v, x, y = places_of(field)

    def shown(u, v, x, y, kept):
        total = 0.5
        for amplitude, a, b, c, e, phase in WAVES[:2]:
            turns = a * u / ACROSS[0] + b * v / ACROSS[1] + c * x / SIZES[0] + e * y / SIZES[1]
            share = (1 - abs(c) / (COLUMNS / 2)) * (1 - abs(e) / (ROWS / 2)) if kept else 1
            total = total + amplitude * share * np.cos(2 * np.pi * turns + phase)
        return total

    values = np.stack([shown(u, v, x, y, False), 0.5 * shown(u, v, x, y, False)], axis=-1).astype(np.float32)
    found = true_views(
        field.replaced(values), made, decoded.replaced(np.zeros((*decoded.shape[:4], 2), np.float32))
    )
    assert found.frame.isclose(decoded.frame)
    expected = shown(*places_of(decoded), True)
    # Kernels sinc² end with the pixels, 16 of a view's own away: 2/(π²·8) of each wave each way is left out.
    np.testing.assert_allclose(found.values[..., 0], expected, atol=0.17 * 4 / (np.pi**2 * 8))
    np.testing.assert_allclose(found.values[..., 1], 0.5 * expected, atol=0.17 * 4 / (np.pi**2 * 8))
    # Its recordings' samples lie on the whole sensor and two pixels of a view around, in equal steps.
    parts = list(band_limited(field.replaced(values), made, samples=3, parts=2))
    assert [part.shape for part in parts] == [(6, 8, each, (COLUMNS + 4) * 3, 2) for each in (17, 16)]
    for part, rows in zip(parts, (slice(0, 17), slice(17, 33)), strict=True):
        u, v, x, y = places_of(part)
        steps = SIZES / (COLUMNS, ROWS) / 3
        np.testing.assert_allclose(x[0, 0, 0], MIDDLE[0] + (np.arange(42) - 20.5) * steps[0], atol=1e-12)
        np.testing.assert_allclose(y[0, 0, :, 0], MIDDLE[1] + (np.arange(33)[rows] - 16) * steps[1], atol=1e-12)
        expected = shown(u, v, x, y, True)
        np.testing.assert_allclose(part.values[..., 0], expected, atol=0.17 * 4 / (np.pi**2 * 8))
        np.testing.assert_allclose(part.values[..., 1], 0.5 * expected, atol=0.17 * 4 / (np.pi**2 * 8))
