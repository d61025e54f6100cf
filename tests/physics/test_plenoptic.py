"""Plenoptic cameras: positions of micro-images, when they touch, their light, and brute force for the rest.

Oracles: closed forms for a square aperture; the tracer of `ray_oracle`, which finds the lenslet at a place by
testing those nearby.

An array of pitch p at d behind the main lens, the sensor b behind the array. From a sensor point x, a lenslet
centred at c shows the place c + (c − x)·d/b of the main lens, for every place on the lenslet if 1/f = 1/b + 1/d
(the lenslets then image the aperture sharply). So the aperture's image is w = a·b/d wide around c·(1 + b/d),
each lenslet fills p²/b² of solid angle, and the irradiance of a white scene is p²/b² times the number of
micro-images that cover a point.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import vcc
from tests.physics.brute_force import Layer, Scene, ThinLensCamera, psnr, round_stop, views
from tests.physics.ray_oracle import (
    Bench,
    Thin,
    agree,
    cells,
    disc,
    grown,
    lens,
    nearest_centre,
    normal,
    round_hat,
    square,
)
from tests.physics.two_planes import TwoPlanes
from vcc.base.units import m, mm, um
from vcc.shapes.kernels import Gaussian, TopHat

F, FOCUS = 50 * mm, 1 * m
D = 1 / (1 / F - 1 / FOCUS)
VIEWS, SPACING, SLOPE, PIXELS, DISPARITY = 16, 0.75 * mm, 1e-3, 88, 0.4
DIAMETER = 9 * mm
LENS = vcc.Lens(focal_length=F, diameter=DIAMETER)
ROUND = Thin(0.0, bend=lens(F), share=disc(DIAMETER))
LIGHT_FIELD_ERROR = 10 ** (-60 / 20)

P, B = 0.5 * mm, 2.5 * mm
SHARP = 1 / (1 / B + 1 / D)
"""Focal length with which lenslets image the main lens."""
GROWTH = 1 + B / D


PLANES = TwoPlanes(VIEWS, SPACING, SLOPE, PIXELS, DISPARITY, FOCUS)
SCENE = PLANES.scene


@cache
def white() -> vcc.LightField:
    """Radiance 1 everywhere, in views that hold all rays that these cameras ask for."""
    return vcc.LightField.from_views(np.ones((4, 4, 8, 8), np.float32), 5 * mm, 40e-3, FOCUS)


def stop(side: float) -> vcc.Mask:
    return vcc.Mask(pattern=np.ones((1, 1)), width=side, name="stop")


# -- closed forms


@pytest.mark.parametrize("layout", ["square", "hexagonal"])
@pytest.mark.parametrize("rotation", [0.0, 0.12])
def test_micro_images_stand_where_the_closed_form_says(layout, rotation):
    # An aperture of 60 % of the matching one leaves gaps; the sensor's pitch divides nothing evenly.
    offset = (0.19 * mm, -0.06 * mm)
    array = vcc.LensArray(
        pitch=P, focal_length=B, layout=layout, rotation=rotation, offset=offset, z=D, fill_factor=0.9
    )
    sensor = vcc.Sensor(z=D + B, shape=(60, 60), pitch=37 * um)
    side = 0.6 * P * GROWTH * D / B
    camera = vcc.Camera([vcc.Lens(focal_length=F), stop(side), array], sensor)
    image = camera.capture(white(), samples=512).values.astype(np.float64)

    x, y = np.meshgrid(sensor.column_places, sensor.row_places)
    centres = []
    height = np.sqrt(3) / 2 if layout == "hexagonal" else 1.0
    for row in range(-9, 10):
        for column in range(-9, 10):
            across = (column + (0.5 * (row % 2) if layout == "hexagonal" else 0.0)) * P
            down = row * height * P
            centres.append(
                (
                    (np.cos(rotation) * across - np.sin(rotation) * down + offset[0]) * GROWTH,
                    (np.sin(rotation) * across + np.cos(rotation) * down + offset[1]) * GROWTH,
                )
            )
    owner = np.argmin([(x - a) ** 2 + (y - b) ** 2 for a, b in centres], axis=0)
    border = 30 * sensor.pitch - 0.5 * P * GROWTH
    off, dark = [], 0
    for n, (a, b) in enumerate(centres):
        mine = owner == n
        if max(abs(a), abs(b)) > border:
            continue
        light = image * mine
        off.append((np.array([(light * x).sum(), (light * y).sum()]) / light.sum() - (a, b)) / sensor.pitch)
        dark += (light[mine] == 0).sum()
    worst = np.abs(off).max()
    print(f"{len(off)} micro-images, worst {worst:.4f} pixel, {dark} dark pixels between")
    assert len(off) >= 9
    assert dark > 50  # they are separate
    # A border that cuts a pixel at a share g adds g(1 − g)/2 ≤ 1/8 pixel² to the first moment, of an image of
    # 8.5 pixels: 0.015 at most for one border, and two borders pull against each other.
    assert worst < 0.02


def covered(places: np.ndarray, pitch: float, aperture: float) -> np.ndarray:
    """Mean number of micro-images that cover each pixel along one axis; lenslet 0 stands on the axis."""
    wide = aperture * B / D
    total = np.zeros(places.size)
    for n in range(-8, 9):
        low = np.maximum(places - pitch / 2, n * P * GROWTH - wide / 2)
        high = np.minimum(places + pitch / 2, n * P * GROWTH + wide / 2)
        total += np.maximum(high - low, 0) / pitch
    return total


@pytest.mark.parametrize("size", [0.9, 1.0, 1.1])
@pytest.mark.parametrize("fill_factor", [None, 0.5])
def test_micro_images_just_touch_when_f_numbers_match(size, fill_factor):
    matching = P * GROWTH * D / B
    array = vcc.LensArray(pitch=P, focal_length=SHARP, z=D, fill_factor=fill_factor)
    sensor = vcc.Sensor(z=D + B, shape=(48, 52), pitch=41 * um)
    image = vcc.Camera([vcc.Lens(focal_length=F), stop(size * matching), array], sensor).capture(
        white(), samples=256 if fill_factor is None else 4096
    )
    along = covered(sensor.column_places, sensor.pitch, size * matching)
    down = covered(sensor.row_places, sensor.pitch, size * matching)
    share = (fill_factor or 1.0) * P**2 / B**2
    expected = share * down[:, None] * along[None, :]
    error = np.sqrt(np.mean((image.values - expected) ** 2)) / expected.max()
    print(f"{size}: {error:.1e} of the largest")
    if fill_factor is None:
        # Pixels that a border cuts are sampled; the estimate from halves covers them (twice its value at most).
        assert error <= max(2 * image.sampling_error / expected.max(), 1e-6)
    # With gaps every pixel is: half of 4096 rays count, 1.6 % more or less if they were random. Evenly spread
    # ones do better by far.
    assert error < 4e-3
    if size == 1.0:
        assert expected.min() == pytest.approx(share, rel=1e-9)  # neither gap nor overlap
        # The mean over whole micro-images is what the aperture alone gives, a²/(d + b)².
        assert share == pytest.approx((fill_factor or 1.0) * matching**2 / (D + B) ** 2, rel=1e-12)
    if size == 0.9:
        assert image.values.min() == 0  # dark between
    if size == 1.1:
        assert image.values.max() == pytest.approx(4 * share, rel=5e-3)  # four meet in the corners


class Spot:
    """A round Gaussian spot on the plane in focus, 0.2 mm on the sensor."""

    def __call__(self, x, y):
        return np.exp(-(x**2 + y**2) / (2 * (0.2 * mm * FOCUS / D) ** 2))


@pytest.mark.parametrize("layout", ["square", "hexagonal"])
def test_an_array_without_gaps_keeps_all_light(layout):
    samples = views(Scene([Layer(FOCUS, Spot())]), (16, 16, PIXELS, PIXELS), SPACING, SLOPE, FOCUS).astype(
        np.float32
    )
    lf = vcc.LightField.from_views(samples, SPACING, SLOPE, FOCUS, disparity_range=(0.0, 0.0), sample="point")
    sensor = vcc.Sensor(z=D + B, shape=(50, 50), pitch=60 * um)
    array = vcc.LensArray(pitch=P, focal_length=SHARP, z=D, layout=layout, offset=(0.11 * mm, 0.23 * mm))
    images = [vcc.Camera([LENS, *more], sensor).capture(lf, method="rays", samples=2048) for more in ([], [array])]
    totals = [image.values.sum(dtype=np.float64) for image in images]
    noise = np.hypot(*(image.sampling_error for image in images)) * np.sqrt(images[0].values.size)
    print(f"{totals[1] / totals[0] - 1:.1e}, noise {noise / totals[0]:.1e}")
    assert noise < 2e-3 * totals[0]
    assert totals[1] == pytest.approx(totals[0], abs=4 * noise)
    # 2πσ² on the sensor, each point lit by the round stop under πD²/4d²; the spot is 4 samples to σ.
    total = 2 * np.pi * (0.2 * mm) ** 2 * np.pi * DIAMETER**2 / 4 / D**2
    assert totals[1] * sensor.sensitive_area == pytest.approx(total, abs=4 * noise * sensor.sensitive_area)


# -- brute force


def test_the_light_field_holds_the_scene():
    """How far interpolating its samples is from the scene, without an array: exact quadrature."""
    sensor = vcc.Sensor(z=D + B, shape=(24, 24), pitch=75 * um)
    truth = ThinLensCamera(F, round_stop(DIAMETER, 16, 32), D + B, sensor.shape, sensor.pitch).picture(SCENE)
    image = vcc.Camera([LENS], sensor).capture(PLANES.light_field, method="rays", samples=8192)
    reached = psnr(image.values, truth)
    print(f"light field {reached:.1f} dB")
    assert 10 ** (-reached / 20) <= LIGHT_FIELD_ERROR


def lenslets(pitch, focal_lengths, *, kind=None, share=None, turn=0.0, hexagonal=False, offset=(0.0, 0.0), at=0.0):
    """An array written out: deflection from the nearest centre, and openings by what ``share`` says."""
    nearest = nearest_centre(pitch, hexagonal, turn, offset)
    powers = 1 / np.atleast_1d(focal_lengths)

    def bend(x, y):
        a, b, row, column = nearest(x, y)
        power = powers[0] if kind is None else powers[kind(row, column).astype(int)]
        return -(x - a) * power, -(y - b) * power

    def open_share(x, y):
        a, b, _, _ = nearest(x, y)
        dx, dy = x - a, y - b
        return share(np.cos(turn) * dx + np.sin(turn) * dy, np.cos(turn) * dy - np.sin(turn) * dx)

    return Thin(at, bend=bend, share=None if share is None else open_share)


def checkerboard(row, column):
    return (row + column) % 2


def three_kinds(row, column):
    # Rising along a row; above and below so that all neighbours differ, of which there is one way.
    return (column - row // 2 + 2 * row) % 3


B2 = 4 * mm
A2 = 8 * mm
DISC = np.sqrt(0.6 * np.sqrt(3) / 2 / np.pi) * P
"""Radius of a disc that has 0.6 of a hexagon's area, √3/2 p²."""
CASES = {
    "plenoptic 1.0": (
        vcc.LensArray(pitch=P, focal_length=B, z=D, offset=(0.1 * mm, 0.2 * mm)),
        lenslets(P, B, offset=(0.1 * mm, 0.2 * mm), at=D),
        B,
        P / np.sqrt(2),
    ),
    "plenoptic 2.0": (
        vcc.LensArray(pitch=P, focal_length=1 / (1 / A2 + 1 / B2), z=D + A2),
        lenslets(P, 1 / (1 / A2 + 1 / B2), at=D + A2),
        B2,
        P / np.sqrt(2),
    ),
    "hexagonal, discs": (
        vcc.LensArray(pitch=P, focal_length=B, z=D, layout="hexagonal", circular=True, fill_factor=0.6),
        lenslets(
            P,
            B,
            hexagonal=True,
            share=disc(2 * DISC),
            at=D,
        ),
        B,
        DISC,
    ),
    "rotated, square openings": (
        vcc.LensArray(pitch=P, focal_length=B, z=D, rotation=0.4, fill_factor=0.64),
        lenslets(P, B, turn=0.4, share=square(0.8 * P), at=D),
        B,
        0.8 * P / np.sqrt(2),
    ),
    "hexagonal, rotated, three focal lengths": (
        vcc.LensArray(pitch=P, focal_length=(2.2 * mm, 2.8 * mm, 4 * mm), z=D, layout="hexagonal", rotation=-0.3),
        lenslets(P, [2.2 * mm, 2.8 * mm, 4 * mm], kind=three_kinds, hexagonal=True, turn=-0.3, at=D),
        B,
        P / np.sqrt(3),
    ),
    "two focal lengths, decentred": (
        vcc.LensArray(pitch=P, focal_length=(2 * mm, -6 * mm), z=D, decentre=(0.07 * mm, -0.12 * mm)),
        lenslets(P, [2 * mm, -6 * mm], kind=checkerboard, offset=(0.07 * mm, -0.12 * mm), at=D),
        B,
        P / np.sqrt(2),
    ),
}


def compare(image: vcc.Image, truth: np.ndarray, noise: float, floor: float = LIGHT_FIELD_ERROR) -> float:
    return agree(image.values, image.sampling_error, truth, noise, floor)


@pytest.mark.parametrize("case", CASES)
def test_pictures_through_arrays_match_brute_force(case):
    array, thin, gap, reach = CASES[case]
    sensor = vcc.Sensor(z=array.z + gap, shape=(8, 9), pitch=67 * um, decentre=(0.13 * mm, -0.08 * mm))
    image = vcc.Camera([LENS, array], sensor).capture(PLANES.light_field, samples=8192)
    # A sensor point sees the main lens by rays of slope (x_lens − x)/z plus what a lenslet adds, at most
    # how far it is clear from its centre over the shortest focal length.
    steepest = DIAMETER / 2 / array.z + reach / min(np.abs(array.focal_lengths))
    bench = Bench(
        [ROUND, thin], sensor.z, sensor.shape, sensor.pitch, (array.z, steepest * gap, steepest * gap),
        follow=1 / (1 + gap / array.z), decentre=sensor.decentre,
    )  # fmt: skip
    compare(image, *bench.measured(SCENE, 144))


# -- awkward cameras

CODE = np.array([[1, 0, 1, 1, 0], [0, 1, 1, 0, 1], [1, 1, 0, 1, 0], [0, 1, 0, 1, 1], [1, 0, 1, 0, 1]], float)


def plate(alpha: float, cross: float):
    """Slopes of a cubic plate and of a saddle."""
    return lambda x, y: (3 * alpha * x**2 + cross * y, 3 * alpha * y**2 + cross * x)


def array_before_the_lens():
    z = 12 * mm
    far = z + 1 / (1 / F - 1 / (FOCUS + z))
    return (
        [
            vcc.LensArray(pitch=3 * mm, focal_length=600 * mm, rotation=0.3, offset=(0.4 * mm, 0.9 * mm)),
            vcc.Lens(focal_length=F, diameter=7 * mm, z=z),
        ],
        [
            lenslets(3 * mm, 600 * mm, turn=0.3, offset=(0.4 * mm, 0.9 * mm)),
            Thin(z, bend=lens(F), share=disc(7 * mm)),
        ],
        far,
        ((z, 3.5 * mm, 3.5 * mm), 0.0),
    )


SLOPES = DIAMETER / 2 / D + 1.2 * mm / D
"""Of rays through the main lens to any place on these sensors."""


def two_arrays():
    gap, way = 1.5 * mm, 1 * mm
    steepest = SLOPES + 0.25 * mm / B + 0.2 * mm / (4 * mm)
    return (
        [
            LENS,
            vcc.LensArray(pitch=P, focal_length=B, z=D),
            vcc.LensArray(pitch=0.4 * mm, focal_length=-4 * mm, z=D + gap),
        ],
        [ROUND, lenslets(P, B, at=D), lenslets(0.4 * mm, -4 * mm, at=D + gap)],
        D + gap + way,
        ((D + gap, steepest * way, steepest * way), 1.0),
    )


def diffuser_before_an_array():
    steepest = SLOPES + 4 * 4e-3 + 0.25 * mm / B
    return (
        [LENS, vcc.Diffuser(kernel=Gaussian(4e-3), z=D - 6 * mm), vcc.LensArray(pitch=P, focal_length=B, z=D)],
        [ROUND, Thin(D - 6 * mm, scatter=normal(4e-3)), lenslets(P, B, at=D)],
        D + B,
        ((D, steepest * B, steepest * B), 1.0),
    )


def diffusers_mask_and_array():
    """Two diffusers, one of them coded, around a mask that stands off the axis, then lenslets."""
    sigma = np.array([[0.0, 3e-3, 1e-3], [2e-3, 4e-3, 0.0]])
    sheet, code, middle = 12 * mm, 8 * mm, (0.7 * mm, -0.4 * mm)
    width, one, holes = grown(sigma, sheet), normal(1.0), cells(CODE, code)

    def scatter(xi, eta, zeta, x, y):
        s, t = one(xi, eta)
        here = width(x, y)
        return s * here, t * here

    steepest = SLOPES + 4 * 4e-3 + 6e-3 + 0.25 * mm / B
    return (
        [
            LENS,
            vcc.CodedDiffuser(Gaussian(1.0), width=sheet, widths=sigma, z=0.3 * D),
            vcc.Mask(pattern=CODE, width=code, z=0.5 * D, decentre=middle),
            vcc.Diffuser(kernel=TopHat(12e-3), z=0.8 * D),
            vcc.LensArray(pitch=P, focal_length=B, z=D),
        ],
        [
            ROUND,
            Thin(
                0.3 * D,
                share=lambda x, y: ((np.abs(x) <= sheet / 2) & (np.abs(y) <= sheet / 3)).astype(float),
                scatter=scatter,
            ),
            Thin(0.5 * D, share=lambda x, y: holes(x - middle[0], y - middle[1])),
            Thin(0.8 * D, scatter=round_hat(12e-3)),
            lenslets(P, B, at=D),
        ],
        D + B,
        ((D, steepest * B, steepest * B), 1.0),
    )


def plate_between_array_and_sensor():
    alpha, cross, way = 1.2e4, 20.0, 1.2 * mm
    steepest = SLOPES + 0.25 * mm / B + 3 * alpha * (1.6 * mm) ** 2 + cross * 1.6 * mm
    return (
        [
            LENS,
            vcc.LensArray(pitch=P, focal_length=B, z=D),
            vcc.PhasePlate(surface=plate(alpha, cross), width=4 * mm, z=D + B - way),
        ],
        [ROUND, lenslets(P, B, at=D), Thin(D + B - way, bend=plate(alpha, cross), share=square(4 * mm))],
        D + B,
        ((D + B - way, steepest * way, steepest * way), 1.0),
    )


def all_decentred():
    steepest = SLOPES + 1 * mm / D + 0.25 * mm / B + 0.3 * mm / D
    return (
        [
            replace(LENS, decentre=(0.6 * mm, -0.9 * mm)),
            vcc.LensArray(
                pitch=P, focal_length=B, z=D, decentre=(0.21 * mm, 0.13 * mm), rotation=1.1, width=2.2 * mm
            ),
        ],
        [
            Thin(0.0, bend=lens(F, 0.6 * mm, -0.9 * mm), share=disc(DIAMETER, 0.6 * mm, -0.9 * mm)),
            replace(
                lenslets(P, B, at=D, turn=1.1, offset=(0.21 * mm, 0.13 * mm)),
                share=square(2.2 * mm, 0.21 * mm, 0.13 * mm),
            ),
        ],
        D + B,
        ((D, steepest * B, steepest * B), 1.0),
    )


AWKWARD = {
    "an array at the entrance plane": array_before_the_lens,
    "two arrays in a row": two_arrays,
    "a diffuser before an array": diffuser_before_an_array,
    "two diffusers and a mask before an array": diffusers_mask_and_array,
    "a plate between array and sensor": plate_between_array_and_sensor,
    "all decentred, the array a bounded sheet": all_decentred,
}


@pytest.mark.parametrize("case", AWKWARD)
def test_awkward_cameras_match_brute_force(case):
    elements, thins, z, (aim, follow) = AWKWARD[case]()
    sensor = vcc.Sensor(z=z, shape=(8, 9), pitch=67 * um, decentre=(0.21 * mm, -0.13 * mm))
    image = vcc.Camera(elements, sensor).capture(PLANES.light_field, samples=16384)
    bench = Bench(thins, z, sensor.shape, sensor.pitch, aim, follow, sensor.decentre)
    compare(image, *bench.measured(SCENE, 128))


def test_an_array_at_the_sensor_only_shades_it():
    """Rays end where the lenslets would bend them; gaps are dark."""
    sensor = vcc.Sensor(z=D, shape=(24, 24), pitch=P / 4)
    array = vcc.LensArray(pitch=P, focal_length=B, z=D, offset=(P / 2, P / 2), fill_factor=0.25)
    plain = vcc.Camera([LENS], sensor).capture(PLANES.light_field, method="rays", samples=2048)
    image = vcc.Camera([LENS, array], sensor).capture(PLANES.light_field, samples=16384)
    # Openings of half a pitch are the middle two by two of a lenslet's four by four pixels.
    middle = np.tile([0.0, 1.0, 1.0, 0.0], 6)
    expected = plain.values * middle[:, None] * middle[None, :]
    error = np.sqrt(np.mean((image.values - expected) ** 2))
    assert error <= 2 * np.hypot(image.sampling_error, plain.sampling_error)
    assert error < 2e-3 * expected.max()
    assert (image.values[expected == 0] == 0).all()
