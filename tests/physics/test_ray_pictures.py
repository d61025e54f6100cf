"""Images by rays: plates, biprisms, the size of the sampling error, and light fields of every form.

Oracles: prisms and lenses, which fold into matrices; the tracer of `ray_oracle`; closed forms for the image of a
point through a biprism; images with very many rays, for the error with few.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad

import vcc
from tests.physics.brute_force import Layer, Scene, ThinLensCamera, cosines, psnr, round_stop, views
from tests.physics.ray_oracle import Bench, Thin, agree, cells, cosine_sheet, disc, lens, normal, square
from tests.physics.two_planes import TwoPlanes
from vcc.base.errors import ResultWarning
from vcc.base.units import m, mm
from vcc.shapes.kernels import Gaussian
from vcc.shapes.patterns import Circle, CosineSum
from vcc.shapes.surfaces import Axicon, Cubic, PathMap

F, FOCUS = 50 * mm, 1 * m
D = 1 / (1 / F - 1 / FOCUS)
VIEWS, SPACING, SLOPE, PIXELS, DISPARITY = 16, 1 * mm, 1e-3, 96, 0.5
DIAMETER = 12 * mm
PICTURE = vcc.Sensor(z=D, shape=(14, 16), pitch=2.4 * D * SLOPE)
LENS = vcc.Lens(focal_length=F, diameter=DIAMETER)
ROUND = Thin(0.0, bend=lens(F), share=disc(DIAMETER))
LIGHT_FIELD_ERROR = 10 ** (-60 / 20)
ENGINES = ["numba", "reference", "array_api"]


PLANES = TwoPlanes(VIEWS, SPACING, SLOPE, PIXELS, DISPARITY, FOCUS)
SCENE = PLANES.scene


@cache
def white() -> vcc.LightField:
    """Radiance 1 everywhere."""
    return vcc.LightField.from_views(np.ones((4, 4, 8, 8), np.float32), 5 * mm, 40e-3, FOCUS)


def rays(elements, lf=None, sensor=PICTURE, **options) -> vcc.Image:
    lf = PLANES.light_field if lf is None else lf
    return vcc.Camera(elements, sensor).capture(lf, method="rays", **options)


def compare(image: vcc.Image, truth: np.ndarray, noise: float, floor: float = LIGHT_FIELD_ERROR) -> float:
    return agree(image.values, image.sampling_error, truth, noise, floor)


def test_the_light_field_holds_the_scene():
    """How far interpolating its samples is from the scene: exact quadrature."""
    truth = ThinLensCamera(F, round_stop(DIAMETER, 16, 32), D, PICTURE.shape, PICTURE.pitch).picture(SCENE)
    reached = psnr(rays([LENS], samples=8192).values, truth)
    print(f"light field {reached:.1f} dB")
    assert 10 ** (-reached / 20) <= LIGHT_FIELD_ERROR


# -- plates


def sheet(path, points: int = 33, width: float = 16 * mm) -> PathMap:
    """Optical paths of a function in the middles of cells."""
    place = ((np.arange(points) + 0.5) / points - 0.5) * width
    return PathMap(path(place[None, :], place[:, None]), width)


TILT = (4e-3, -7e-3)
FLAT = {
    "slope function": vcc.PhasePlate(surface=lambda x, y: (np.full(x.shape, TILT[0]), np.full(x.shape, TILT[1]))),
    "path map": vcc.PhasePlate(surface=sheet(lambda x, y: TILT[0] * x + TILT[1] * y)),
}
ROUNDED = {
    "slope function": vcc.PhasePlate(surface=lambda x, y: (-x / 0.4, -y / 0.4)),
    "path map": vcc.PhasePlate(surface=sheet(lambda x, y: -(x**2 + y**2) / 0.8)),
}
PLACES = {
    "at the lens": ([LENS], 0.0),
    "before a stop": ([LENS, vcc.Mask(pattern=Circle(4 * mm), z=0.5 * D)], 0.2 * D),
}


@pytest.mark.parametrize("kind", FLAT)
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("shape", ["prism", "lens"])
def test_a_plate_of_constant_or_linear_slope_is_a_prism_or_a_lens(shape, place, kind):
    others, z = PLACES[place]
    plate = (FLAT if shape == "prism" else ROUNDED)[kind]
    folded = vcc.Prism(deflection=TILT, z=z) if shape == "prism" else vcc.Lens(focal_length=0.4, z=z)
    # The stop that rays are aimed at stands behind the plate or beside it: both pictures have the same rays.
    by_plate = rays([*others, replace(plate, z=z)], seed=3).values
    by_matrix = rays([*others, folded], seed=3).values
    worst = np.abs(by_plate - by_matrix).max() / by_matrix.max()
    print(f"{worst:.1e}")
    assert worst < 1e-6
    assert np.abs(by_matrix - rays(others, seed=3).values).max() > 0.05 * by_matrix.max()  # it does something


def test_a_plate_through_rays_is_the_lens_through_footprints():
    # A square stop, on borders between cells of views, which footprints take exactly.
    stop = vcc.Mask(pattern=np.ones((1, 1)), width=DIAMETER)
    bare = [vcc.Lens(focal_length=F), stop]
    image = rays([*bare, replace(ROUNDED["path map"], z=0.3 * D)], samples=8192)
    exact = vcc.Camera([*bare, vcc.Lens(focal_length=0.4, z=0.3 * D)], PICTURE).capture(
        PLANES.light_field, interpolation="cubic"
    )
    reached = psnr(image.values, exact.values)
    print(f"{reached:.1f} dB")
    assert reached >= 55  # both are that near to the scene


def cubic(strength: float):
    return lambda x, y: (3 * strength * x**2, 3 * strength * y**2)


def cone(slope: float):
    """Towards the axis by the same slope everywhere."""

    def bend(x, y):
        r = np.maximum(np.hypot(x, y), 1e-30)
        return -slope * x / r, -slope * y / r

    return bend


STOP = vcc.Mask(pattern=np.ones((1, 1)), width=11 * mm)
PLATES = {
    "cubic at a square stop": (
        [vcc.Lens(focal_length=F), STOP, vcc.PhasePlate(surface=Cubic(90.0))],
        [Thin(0.0, bend=lens(F), share=square(11 * mm)), Thin(0.0, bend=cubic(90.0))],
        11 * mm / 2,
    ),
    "cubic half-way, decentred, before a mask": (
        [
            LENS,
            vcc.PhasePlate(surface=Cubic(-300.0), diameter=9 * mm, z=0.4 * D, decentre=(0.8 * mm, -0.5 * mm)),
            vcc.Mask(pattern=CosineSum((4 * mm, 4 * mm), 1, 0.7), z=0.7 * D),
        ],
        [
            ROUND,
            Thin(
                0.4 * D,
                bend=lambda x, y: cubic(-300.0)(x - 0.8 * mm, y + 0.5 * mm),
                share=disc(9 * mm, 0.8 * mm, -0.5 * mm),
            ),
            Thin(0.7 * D, share=cosine_sheet(4 * mm, 0.7)),
        ],
        # Rays miss the lens by what the plate bends, 3·300·(4.5 mm)² of 0.4 D at most.
        DIAMETER / 2 + 3 * 300 * (4.5 * mm) ** 2 * 0.4 * D,
    ),
    "axicon half-way": (
        [LENS, vcc.PhasePlate(surface=Axicon(8e-3), diameter=10 * mm, z=0.5 * D)],
        [ROUND, Thin(0.5 * D, bend=cone(8e-3), share=disc(10 * mm))],
        DIAMETER / 2 + 8e-3 * 0.5 * D,
    ),
    "pyramid and biprism": (
        [LENS, vcc.Pyramid(sides=4, deflection=6e-3, rotation=0.3), vcc.Biprism(deflection=-4e-3, z=0.3 * D)],
        [
            ROUND,
            Thin(0.0, bend=lambda x, y: tuple(-6e-3 * n for n in sector(x, y, 0.3))),
            Thin(0.3 * D, bend=lambda x, y: (4e-3 * np.sign(x), 0 * y)),
        ],
        DIAMETER / 2 + 4e-3 * 0.3 * D,
    ),
}


def sector(x, y, turn):
    """The middle direction of the quarter of the plane that holds a place."""
    angle = np.rint((np.arctan2(y, x) - turn) / (np.pi / 2)) * np.pi / 2 + turn
    return np.cos(angle), np.sin(angle)


@pytest.mark.parametrize("case", PLATES)
def test_plates_and_facets_match_brute_force(case):
    elements, thins, half = PLATES[case]
    sensor = replace(PICTURE, shape=(11, 12))
    image = rays(elements, sensor=sensor, samples=8192)
    bench = Bench(thins, D, sensor.shape, sensor.pitch, (0.0, half, half))
    compare(image, *bench.measured(SCENE, 56))


def test_two_holes_in_one_plane_both_count():
    # Without names both are called "mask at z = 0 mm". The smaller one stands on the rim of the larger.
    small, large = vcc.Mask(pattern=Circle(2 * mm), decentre=(3 * mm, 4 * mm)), vcc.Mask(pattern=Circle(10 * mm))
    sensor = replace(PICTURE, shape=(3, 3), pitch=0.5 * D * SLOPE)
    image = rays([vcc.Lens(focal_length=F), small, large], white(), sensor, samples=16384)
    # Two discs of radii r and R whose middles are R apart: the lens between two arcs.
    r, big = 1 * mm, 5 * mm
    half, other = np.arccos(r / (2 * big)), np.arccos(1 - r**2 / (2 * big**2))
    area = r**2 * (half - np.sin(2 * half) / 2) + big**2 * (other - np.sin(2 * other) / 2)
    # Each ray counts or not: known to 4 standard deviations of the estimate, and that to a factor of 2.
    np.testing.assert_allclose(image.values, area / D**2, rtol=0, atol=8 * image.sampling_error)
    assert image.sampling_error < 2e-3 * area / D**2


# -- biprisms


class Point:
    """A small round spot on a plane at a distance."""

    def __init__(self, distance: float) -> None:
        self.sigma = 2.5 * SLOPE * distance

    def __call__(self, x, y):
        return np.exp(-(x**2 + y**2) / (2 * self.sigma**2))


@cache
def point(distance: float, z: float = 0.0) -> vcc.LightField:
    """A point on the axis, ``distance`` before the entrance plane."""
    samples = views(Scene([Layer(distance, Point(distance))]), (14, 14, 92, 92), SPACING, SLOPE, FOCUS)
    disparity = (1 / distance - 1 / FOCUS) * SPACING / SLOPE
    return vcc.LightField.from_views(
        samples.astype(np.float32),
        SPACING,
        SLOPE,
        FOCUS,
        disparity_range=(disparity, disparity),
        sample="point",
    )


def apart(image: np.ndarray, sensor: vcc.Sensor, turn: float = 0.0) -> np.ndarray:
    """(x, y) from the centroid of the light on one side of the line through the middle to that on the other."""
    x, y = np.meshgrid(sensor.column_places, sensor.row_places)
    side = x * np.cos(turn) + y * np.sin(turn)
    centroids = []
    for half in (side < 0, side > 0):
        light = image.astype(np.float64) * half
        centroids.append(np.array([(light * x).sum(), (light * y).sum()]) / light.sum())
    return centroids[1] - centroids[0]


DELTA = 12e-3
SPLIT = vcc.Sensor(z=D, shape=(60, 60), pitch=D * SLOPE)


@pytest.mark.parametrize("distance", [0.6, 1.0, 3.0])
def test_a_biprism_at_the_lens_shows_a_point_twice(distance):
    # Each half of the lens shows the point δ·d to its side, at every depth.
    sensor = replace(SPLIT, z=1 / (1 / F - 1 / distance))
    image = rays([LENS, vcc.Biprism(deflection=DELTA)], point(distance), sensor, samples=512)
    separation = apart(image.values, sensor)
    expected = 2 * DELTA * sensor.z
    print(f"{distance} m: {(separation[0] - expected) / sensor.pitch:+.4f} pixel")
    # Spots end 4.8σ from the line between them: 1e-6 of their light is on the wrong side, 12 pixels off.
    assert separation == pytest.approx([expected, 0.0], abs=0.005 * sensor.pitch)


@pytest.mark.parametrize("distance", [0.7, 1.0, 1.6])
def test_out_of_focus_each_half_of_the_lens_adds_its_own_shift(distance):
    # From a place a of the lens light lands at a·(1 + d/Z − d/f) ∓ δ·d; half of a square lens has its centroid
    # at a quarter of the side.
    side = 10 * mm
    stop = vcc.Mask(pattern=np.ones((1, 1)), width=side)
    image = rays(
        [vcc.Lens(focal_length=F), stop, vcc.Biprism(deflection=DELTA)], point(distance), SPLIT, samples=1024
    )
    expected = 2 * (DELTA * D - side / 4 * (1 + D / distance - D / F))
    separation = apart(image.values, SPLIT)
    print(f"{distance} m: {(separation[0] - expected) / SPLIT.pitch:+.4f} pixel")
    # Seen out of focus, the spot is wider: 1e-4 of its light is on the wrong side.
    assert separation == pytest.approx([expected, 0.0], abs=0.01 * SPLIT.pitch)


def shown(distance: float, z: float) -> float:
    """How far from the middle a facet of a biprism and a lens at z behind it show a Gaussian spot, on average.

    Seen through a facet, a place X at Z stands δ·Z to the side. Light from it passes the part of the lens beyond
    the shadow of the edge between the facets, which is z·(δ + X/Z) on the other side of the middle: more of the
    light comes from the outer half of the spot. The sensor, d behind the lens, shows it sharp, d/(Z + z) as large.
    """
    radius, d, sigma = 9 * mm / 2, 1 / (1 / F - 1 / (distance + z)), Point(distance).sigma

    def share(place: float) -> float:
        c = z * (DELTA + place / distance)
        return np.pi * radius**2 / 2 + c * np.sqrt(radius**2 - c**2) + radius**2 * np.arcsin(c / radius)

    def over_spot(value) -> float:
        return quad(lambda w: value(w * sigma) * share(w * sigma) * np.exp(-(w**2) / 2), -6, 6)[0]

    return (DELTA * distance + over_spot(lambda place: place) / over_spot(lambda place: 1.0)) * d / (distance + z)


@pytest.mark.parametrize(("distance", "turn"), [(0.6, 0.0), (1.4, -1.2)])
def test_a_biprism_before_the_lens_shows_a_point_twice(distance, turn):
    z = 20 * mm
    sensor = replace(SPLIT, z=z + 1 / (1 / F - 1 / (distance + z)))
    elements = [vcc.Biprism(deflection=DELTA, rotation=turn), vcc.Lens(focal_length=F, diameter=9 * mm, z=z)]
    image = rays(elements, point(distance), sensor, samples=2048)
    expected = 2 * shown(distance, z)
    separation = apart(image.values, sensor, turn)
    off = (separation - expected * np.array([np.cos(turn), np.sin(turn)])) / sensor.pitch
    print(f"{distance} m: {off} pixel")
    # What a spot's own size adds is 0.066 pixel, and interpolated from samples it is a tent's 1/6 sample² wider
    # than its 6.25: 0.002 pixel. Pixels cut the border between the spots, where 1e-5 of their light is.
    assert (
        0.05
        < expected / sensor.pitch - 2 * DELTA * distance * (sensor.z - z) / (distance + z) / sensor.pitch
        < 0.08
    )
    assert np.abs(off).max() < 0.01


# -- the sampling error

NOISY = {
    "diffuser and mask": [
        LENS,
        vcc.Diffuser(kernel=Gaussian(6e-3), z=0.3 * D),
        vcc.Mask(pattern=CosineSum((3 * mm, 3 * mm)), z=0.7 * D),
    ],
    "cells": [
        LENS,
        vcc.Mask(pattern=np.random.default_rng(0).integers(0, 2, (9, 9)) * 1.0, width=10 * mm, z=0.5 * D),
    ],
    "lens array": [LENS, vcc.LensArray(pitch=0.5 * mm, focal_length=2.5 * mm, z=D - 2.5 * mm)],
}


@cache
def settled(case: str) -> np.ndarray:
    """Two pictures of very many rays, their mean, in double precision."""
    both = [rays(NOISY[case], samples=16384, seed=seed).values.astype(np.float64) for seed in (100, 101)]
    return (both[0] + both[1]) / 2


@pytest.mark.parametrize("case", NOISY)
def test_the_sampling_error_is_foretold_within_a_factor_of_two(case):
    errors = {}
    for samples in (64, 1024):
        images = [rays(NOISY[case], samples=samples, seed=seed) for seed in range(6)]
        true = np.sqrt(np.mean([(image.values - settled(case)) ** 2 for image in images]))
        foretold = np.sqrt(np.mean([image.sampling_error**2 for image in images]))
        errors[samples] = true
        print(f"{samples} rays: error {true / settled(case).max():.1e}, foretold × {true / foretold:.2f}")
        assert 0.5 <= true / foretold <= 2
        for image in images:
            error = np.sqrt(np.mean((image.values - settled(case)) ** 2))
            # One picture alone: pixels that share points of the sequence err together, so it may stray further.
            assert 0.2 <= error / image.sampling_error <= 3
    # At random, a sixteenth of the variance: 4 times. Evenly spread points do better.
    assert errors[64] > 4 * errors[1024]


def test_samples_are_doubled_until_the_tolerance_is_reached():
    for tolerance in (1e-2, 3e-3):
        image = rays(NOISY["cells"], tolerance=tolerance, samples=16)
        mean = image.values.mean()
        assert image.sampling_error <= tolerance * mean
        assert np.sqrt(np.mean((image.values - settled("cells")) ** 2)) <= 2 * tolerance * mean


def test_a_tolerance_out_of_reach_is_said():
    sensor = replace(PICTURE, shape=(2, 2))
    with pytest.warns(ResultWarning, match="the maximum; the tolerance"):
        rays(NOISY["cells"], sensor=sensor, tolerance=1e-9, samples=32768)


@pytest.mark.parametrize("case", NOISY)
def test_a_seed_fixes_every_bit_whatever_the_number_of_threads(case):
    sensor = replace(PICTURE, shape=(45, 40), pitch=1.2 * D * SLOPE)  # several tiles
    pictures = []
    for threads in (1, 2, 5):
        image = rays(NOISY[case], sensor=sensor, samples=32, seed=7, threads=threads)
        pictures.append((image.values.tobytes(), image.sampling_error, image.missing_rays))
    assert pictures[0] == pictures[1] == pictures[2]


@pytest.mark.parametrize("case", NOISY)
def test_another_seed_gives_another_picture_within_the_error(case):
    one, other = (rays(NOISY[case], samples=256, seed=seed) for seed in (0, 12345))
    difference = np.sqrt(np.mean((one.values - other.values) ** 2))
    assert 0 < difference <= 2 * np.hypot(one.sampling_error, other.sampling_error)


def test_seeds_are_as_large_as_anyone_likes():
    sensor = replace(PICTURE, shape=(4, 4))
    camera = [LENS, vcc.Biprism(deflection=4e-3)]
    for seed in (2**32 + 1, 2**70 + 5):
        pictures = [rays(camera, sensor=sensor, samples=16, seed=seed, engine=engine).values for engine in ENGINES]
        for picture in pictures:
            np.testing.assert_allclose(picture, pictures[0], rtol=1e-5)
        assert not np.array_equal(pictures[0], rays(camera, sensor=sensor, samples=16, seed=1).values)


def test_engines_agree_with_very_many_samples():
    # Single precision holds 1e-5 however many rays a pixel has, if they are not all added up in it.
    sensor = replace(PICTURE, shape=(4, 4))
    camera = [LENS, vcc.Biprism(deflection=4e-3)]
    expected = rays(camera, sensor=sensor, samples=32768, engine="reference").values
    for engine in ("numba", "array_api"):
        image = rays(camera, sensor=sensor, samples=32768, engine=engine)
        np.testing.assert_allclose(image.values, expected, rtol=1e-5)


# -- the sensor


def test_a_quarter_of_each_pixel_is_the_mean_over_the_smaller_square():
    code = np.random.default_rng(2).integers(0, 2, (40, 40)) * 1.0
    elements = [LENS, vcc.Biprism(deflection=3e-3), vcc.Mask(pattern=code, width=8 * mm, z=0.93 * D)]
    thins = [
        ROUND,
        Thin(0.0, bend=lambda x, y: (-3e-3 * np.sign(x), 0 * y)),
        Thin(0.93 * D, share=cells(code, 8 * mm)),
    ]
    sensor = replace(PICTURE, shape=(14, 14), pitch=3.4 * D * SLOPE, fill_factor=0.25)
    image = rays(elements, sensor=sensor, samples=8192)
    bench = Bench(thins, D, sensor.shape, sensor.pitch, (0.0, DIAMETER / 2, DIAMETER / 2), side=0.5)
    truth, noise = bench.measured(SCENE, 80)
    reached = compare(image, truth, noise)
    # Cells of 0.2 mm, seen by pixels of 0.18 mm: the whole pixel's mean is another picture.
    whole = rays(elements, sensor=replace(sensor, fill_factor=1.0), samples=2048)
    assert psnr(whole.values, truth) < reached - 6


# -- light fields of every form


@cache
def plane(*shape: int) -> vcc.LightField:
    """A plane where the views converge: in that, a view's cell holds what the view shows, moved."""
    texture = cosines(5, np.array([26.0, 40.0]) * SLOPE * FOCUS)
    spacing = (12 * mm / shape[0], 12 * mm / shape[1])
    nv, nu, nt, ns = shape
    u = ((np.arange(nu) - (nu - 1) / 2) * spacing[1])[None, :, None, None]
    v = ((np.arange(nv) - (nv - 1) / 2) * spacing[0])[:, None, None, None]
    s = u / FOCUS - ((np.arange(ns) - (ns - 1) / 2) * SLOPE)[None, None, None, :]
    t = v / FOCUS - ((np.arange(nt) - (nt - 1) / 2) * SLOPE)[None, None, :, None]
    samples = Scene([Layer(FOCUS, texture)]).radiance(u, v, s, t).astype(np.float32)
    return vcc.LightField.from_views(samples, spacing, SLOPE, FOCUS, disparity_range=(0.0, 0.0), sample="point")


@pytest.mark.parametrize("views_there", [(1, 1), (1, 12), (12, 1), (2, 3)], ids=str)
@pytest.mark.parametrize("between_views", ["auto", "none"])
def test_few_views_stand_for_the_whole_aperture(views_there, between_views):
    lf = plane(*views_there, PIXELS, PIXELS)
    elements = [LENS, vcc.Biprism(deflection=5e-3, rotation=0.4), vcc.Diffuser(kernel=Gaussian(4e-3), z=0.4 * D)]
    image = rays(elements, lf, samples=8192, between_views=between_views)
    thins = [
        ROUND,
        Thin(0.0, bend=lambda x, y: tuple(-5e-3 * np.sign(x * np.cos(0.4) + y * np.sin(0.4)) * n for n in TURNED)),
        Thin(0.4 * D, scatter=normal(4e-3)),
    ]
    half = DIAMETER / 2 + 16e-3 * 0.4 * D
    bench = Bench(thins, D, PICTURE.shape, PICTURE.pitch, (0.0, half, half))
    scene = Scene([Layer(FOCUS, cosines(5, np.array([26.0, 40.0]) * SLOPE * FOCUS))])
    # Between views all is in place; within a view linear interpolation takes (π/26)²/3 of a cosine of 0.1.
    truth, noise = _traced(bench, scene)
    compare(image, truth, noise)


TURNED = (np.cos(0.4), np.sin(0.4))
_kept: dict[str, tuple[np.ndarray, float]] = {}


def _traced(bench: Bench, scene: Scene) -> tuple[np.ndarray, float]:
    if "few views" not in _kept:
        _kept["few views"] = bench.measured(scene, 48)
    return _kept["few views"]


AWKWARD = [
    LENS,
    vcc.Biprism(deflection=5e-3, rotation=0.4),
    vcc.Diffuser(kernel=Gaussian(4e-3), z=0.4 * D),
    vcc.LensArray(pitch=0.5 * mm, focal_length=6 * mm, z=0.96 * D, layout="hexagonal", rotation=0.2),
]
SMALL = replace(PICTURE, shape=(9, 10))


# Channels of every type are held together in tests/engines/test_ray_agreement.py; here both are held to the plain.
@pytest.mark.parametrize(
    ("kind", "channels"),
    [
        *(("float32", channels) for channels in (None, 1, 2, 3, 5)),
        ("uint8", 3),
        ("uint16", None),
        ("float16", 3),
        ("float64", None),
    ],
)
def test_every_type_and_number_of_channels_gives_the_plain_picture(kind, channels):
    whole = PLANES.light_field[4:12, 4:12, 20:76, 20:76]
    factors = np.linspace(0.3, 1.0, channels or 1)
    values = np.asarray(whole.values)[..., None] * factors
    if kind.startswith("uint"):
        values = np.round(values / values.max() * np.iinfo(kind).max).astype(kind)
        plain = values / np.iinfo(kind).max
    else:
        values = values.astype(kind)
        plain = values.astype(np.float64)
    if channels is None:
        values = values[..., 0]
    sensor = replace(SMALL, shape=(6, 7), decentre=(0.3 * mm, -0.2 * mm), pitch=D * SLOPE)
    lens_in = [replace(LENS, diameter=6 * mm), *AWKWARD[1:]]
    lf = replace(whole, values=values)
    image = rays(lens_in, lf, sensor, samples=32)
    assert image.values.dtype == np.float32
    assert image.shape == (*sensor.shape, *([] if channels is None else [channels]))
    slow = {"samples": 32, "engine": "reference"}
    # Made sharper, 8-bit samples are rounded to 1/32 of a level: each is off by 1/64 at most, and so is a pixel,
    # their weighted mean times what it has of radiance 1. Other types are not rounded.
    rounding = 0.0
    if kind == "uint8":
        rounding = rays(lens_in, replace(whole, values=np.ones(whole.shape)), sensor, **slow).values / 64 / 255
    for channel in range(channels or 1):
        alone = rays(lens_in, replace(whole, values=plain[..., channel]), sensor, **slow).values
        here = image.values if channels is None else image.values[..., channel]
        # Engines agree to 1e-5 of the picture.
        engines = 1e-5 * alone.max()
        assert (np.abs(here - alone) <= rounding + engines).all()
        if kind == "uint8":  # engines round alike
            same = values if channels is None else values[..., channel]
            alike = rays(lens_in, replace(whole, values=same), sensor, **slow).values
            np.testing.assert_allclose(here, alike, rtol=0, atol=engines)


@pytest.mark.parametrize("engine", ENGINES)
def test_samples_in_any_order_in_memory_give_the_same_picture(engine):
    whole = PLANES.light_field[4:12, 4:12, 20:76, 20:76]
    values = np.stack(
        [np.asarray(whole.values), np.asarray(whole.values) ** 2, np.asarray(whole.values) / 3], axis=-1
    )
    forms = {
        "in order": values,
        "channels first in memory": np.moveaxis(np.ascontiguousarray(np.moveaxis(values, -1, 0)), 0, -1),
        "views last in memory": np.asfortranarray(values),
        "every second of more": np.repeat(values, 2, axis=3)[:, :, :, ::2],
        "backwards": values[::-1, ::-1, ::-1, ::-1].copy()[::-1, ::-1, ::-1, ::-1],
        "read-only": np.broadcast_to(values, values.shape),
    }
    sensor = replace(SMALL, pitch=D * SLOPE)
    lens_in = [replace(LENS, diameter=6 * mm), *AWKWARD[1:]]
    pictures = {
        name: rays(lens_in, replace(whole, values=form), sensor, samples=16, engine=engine).values
        for name, form in forms.items()
    }
    for name, picture in pictures.items():
        np.testing.assert_array_equal(picture, pictures["in order"], err_msg=name)


def test_a_light_field_turned_about_the_axis_gives_the_picture_turned():
    """Views and pixels exchanged along both axes, in a frame that says so: x and y mix everywhere."""
    whole = PLANES.light_field
    swap = vcc.Affine(
        np.array([[0, 1, 0, 0, 0], [1, 0, 0, 0, 0], [0, 0, 0, 1, 0], [0, 0, 1, 0, 0], [0, 0, 0, 0, 1.0]])
    )
    lf = replace(whole, values=np.asarray(whole.values).transpose(1, 0, 3, 2), frame=whole.frame @ swap)
    for engine in ENGINES:
        image, plain = (rays(AWKWARD, one, SMALL, samples=16, engine=engine).values for one in (lf, whole))
        np.testing.assert_allclose(image, plain, rtol=0, atol=1e-5 * plain.max())
