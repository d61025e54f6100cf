"""Arrays, biprisms and pyramids against closed forms, by single rays through a camera.

The closed forms are lines drawn by hand (a ray through the middle of a lens is not bent) and the thin-lens
equation. Rays are traced in float64 through at most three elements: 1e-12 of the largest number only allows for
rounding.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.plot.tracing import trace

EXACT = 1e-12

PITCH, LENSLET = 125 * um, 500 * um
MAIN_DISTANCE = 60 * mm


def landed(elements: list[vcc.Element], sensor_z: float, rays: np.ndarray) -> np.ndarray:
    """(x, y) where rays, given at the entrance plane, meet the sensor: (rays, 2)."""
    camera = vcc.Camera(elements, vcc.Sensor(sensor_z, (1, 1), 1 * mm))
    return trace(camera, rays).positions[:, -1]


def through(start: np.ndarray, there: np.ndarray, distance: float) -> np.ndarray:
    """Rays at z = 0 from places there to places in the plane at ``distance``, (..., 4)."""
    start, there = np.broadcast_arrays(start, there)
    return np.concatenate([start, (there - start) / distance], axis=-1)


def centres(layout: str, rotation: float, middle: np.ndarray) -> np.ndarray:
    """Centres of the 11×11 lenslets around one at ``middle``, by hand: (121, 2)."""
    cells = np.array(list(itertools.product(range(-5, 6), repeat=2)), dtype=float)
    down, across = cells.T
    if layout == "hexagonal":
        across, down = across + 0.5 * (down % 2), down * math.sqrt(0.75)
    cosine, sine = math.cos(rotation), math.sin(rotation)
    return middle + PITCH * np.stack([cosine * across - sine * down, sine * across + cosine * down], axis=-1)


# --- plenoptic 1.0: each lenslet images the main lens ---

SETUPS = pytest.mark.parametrize(
    ("layout", "rotation", "offset", "decentre"),
    [
        ("square", 0.0, (0.0, 0.0), (0.0, 0.0)),
        ("square", 0.02, (30 * um, -50 * um), (1 * mm, -0.4 * mm)),
        ("hexagonal", 0.0, (0.0, 0.0), (0.0, 0.0)),
        ("hexagonal", 0.3, (30 * um, -50 * um), (1 * mm, -0.4 * mm)),
    ],
)
MAIN = vcc.Lens(focal_length=50 * mm)


@SETUPS
def test_rays_through_the_middles_of_lens_and_lenslet_land_at_the_micro_images_centres(
    layout, rotation, offset, decentre
):
    array = vcc.LensArray(PITCH, LENSLET, layout, rotation, offset, z=MAIN_DISTANCE, decentre=decentre)
    lenslets = centres(layout, rotation, np.array(offset) + decentre)
    hits = landed([MAIN, array], MAIN_DISTANCE + LENSLET, through(np.zeros(2), lenslets, MAIN_DISTANCE))
    # Straight on from the middle of the main lens: similar triangles.
    np.testing.assert_allclose(hits, lenslets * (1 + LENSLET / MAIN_DISTANCE), atol=EXACT * MAIN_DISTANCE)
    lattice = array.micro_images(MAIN_DISTANCE, LENSLET)
    assert lattice.pitch == pytest.approx(PITCH * (1 + LENSLET / MAIN_DISTANCE), rel=EXACT)
    row, column = np.array(list(itertools.product(range(-5, 6), repeat=2))).T
    np.testing.assert_allclose(np.stack(lattice.centre_of(row, column), axis=-1), hits, atol=EXACT * MAIN_DISTANCE)


@SETUPS
def test_where_the_main_lens_is_sharp_rays_from_its_middle_meet_wherever_they_cross_the_lenslet(
    layout, rotation, offset, decentre
):
    array = vcc.LensArray(PITCH, LENSLET, layout, rotation, offset, z=MAIN_DISTANCE, decentre=decentre)
    lenslets = centres(layout, rotation, np.array(offset) + decentre)
    image_distance = 1 / (1 / LENSLET - 1 / MAIN_DISTANCE)
    within = np.random.default_rng(0).uniform(-0.33, 0.33, (30, 2)) * PITCH  # inside a square turned anyhow
    crossed = (lenslets[:, None] + within).reshape(-1, 2)
    hits = landed([MAIN, array], MAIN_DISTANCE + image_distance, through(np.zeros(2), crossed, MAIN_DISTANCE))
    expected = np.repeat(lenslets * (1 + image_distance / MAIN_DISTANCE), 30, axis=0)
    np.testing.assert_allclose(hits, expected, atol=EXACT * MAIN_DISTANCE)
    # One focal length behind, they miss it by f·(place in the lenslet)/d: a micro-image's rim is that soft.
    hits = landed([MAIN, array], MAIN_DISTANCE + LENSLET, through(np.zeros(2), crossed, MAIN_DISTANCE))
    chief = np.repeat(lenslets * (1 + LENSLET / MAIN_DISTANCE), 30, axis=0)
    blur = np.tile(within, (len(lenslets), 1)) * LENSLET / MAIN_DISTANCE
    np.testing.assert_allclose(hits, chief + blur, atol=EXACT * MAIN_DISTANCE)


@pytest.mark.parametrize("layout", ["square", "hexagonal"])
def test_micro_images_just_touch_when_the_f_numbers_match(layout):
    array = vcc.LensArray(PITCH, LENSLET, layout, z=MAIN_DISTANCE)
    (f_number,) = array.f_numbers
    assert f_number == pytest.approx(4.0, rel=EXACT)
    row = np.stack([np.arange(-5, 6) * PITCH, np.zeros(11)], axis=-1)

    def edges(aperture: float) -> tuple[np.ndarray, np.ndarray]:
        """x of the left and right edges of the row's micro-images."""
        rim = np.array([aperture / 2, 0.0])
        rays = np.concatenate([through(side * rim, row, MAIN_DISTANCE) for side in (1, -1)])
        rays[:, 2:] += rays[:, :2] / MAIN.focal_length  # as they come to the main lens, which takes it off
        x = landed([MAIN, array], MAIN_DISTANCE + LENSLET, rays)[:, 0]
        return x[:11], x[11:]

    matching = (MAIN_DISTANCE + LENSLET) / f_number  # the main lens as seen from the sensor: N = (d + f)/D
    left, right = edges(matching)
    np.testing.assert_allclose(right - left, matching * LENSLET / MAIN_DISTANCE, rtol=1e-9)
    np.testing.assert_allclose(right[:-1], left[1:], atol=EXACT * MAIN_DISTANCE)
    # Other apertures leave a gap, or overlap, of what their micro-images are smaller or larger.
    for aperture in (0.9 * matching, 1.1 * matching):
        left, right = edges(aperture)
        gap = (matching - aperture) * LENSLET / MAIN_DISTANCE
        np.testing.assert_allclose(left[1:] - right[:-1], gap, atol=EXACT * MAIN_DISTANCE)


# --- several focal lengths ---


@pytest.mark.parametrize(
    ("layout", "focal_lengths"),
    [("hexagonal", (400 * um, 500 * um, 650 * um)), ("square", (400 * um, 700 * um))],
)
def test_each_kind_of_lenslet_focuses_at_its_own_distance(layout, focal_lengths):
    array = vcc.LensArray(PITCH, focal_lengths, layout, z=10 * mm)
    lenslets = centres(layout, 0.0, np.zeros(2))
    slope = np.array([0.01, -0.02])
    edge = np.array([0.4 * PITCH, 0.0])
    seen = set()
    for sharp in focal_lengths:
        rays = [
            np.concatenate([lenslets + side * edge - 10 * mm * slope, np.tile(slope, (121, 1))], axis=-1)
            for side in (1, -1)
        ]
        right, left = (landed([array], 10 * mm + sharp, bundle) for bundle in rays)
        width, middle = right - left, (right + left) / 2
        # Parallel light comes to a point f behind, displaced by f·slope; at f' it is 0.8·p·(1 − f'/f) wide.
        widths = 0.8 * PITCH * (1 - sharp / np.array(focal_lengths))
        kind = np.abs(width[:, :1] - widths).argmin(axis=1)
        np.testing.assert_allclose(width[:, 0], widths[kind], atol=EXACT * 10 * mm)
        np.testing.assert_allclose(width[:, 1], 0, atol=EXACT * 10 * mm)
        np.testing.assert_allclose(middle, lenslets + sharp * slope, atol=EXACT * 10 * mm)
        seen.add(tuple(kind))
    (kinds,) = seen  # the same lenslets each time
    table = np.array(kinds).reshape(11, 11)
    assert table[5, 5] == 0  # the first focal length stands in the middle
    assert (table[:, 1:] != table[:, :-1]).all()
    assert (table[1:] != table[:-1]).all()


# --- plenoptic 2.0: each lenslet relays the main lens's picture ---


@pytest.mark.parametrize("picture_before", [3 * LENSLET, 10 * LENSLET, -4 * LENSLET])
def test_lenslets_relay_the_main_lens_s_picture(picture_before):
    """Kepler's way with a real picture before the array, Galilei's with one that would lie behind it."""
    relayed = 1 / (1 / LENSLET - 1 / picture_before)
    array = vcc.LensArray(PITCH, LENSLET, "hexagonal", z=MAIN_DISTANCE)
    picture_distance = MAIN_DISTANCE - picture_before
    depth = 1 / (1 / 50e-3 - 1 / picture_distance)
    point = np.array([-0.011, 0.004]) * depth
    picture = -point * picture_distance / depth
    # Rays of the point towards places in lenslets near the picture; the main lens makes them meet in it.
    lenslets = centres("hexagonal", 0.0, np.zeros(2)) + np.round(picture / PITCH)[0] * np.array([PITCH, 0.0])
    within = np.random.default_rng(0).uniform(-0.3, 0.3, (20, 2)) * PITCH
    crossed = (lenslets[:, None] + within).reshape(-1, 2)
    at_lens = picture + (crossed - picture) * picture_distance / -picture_before
    rays = np.concatenate([at_lens, (at_lens - point) / depth], axis=-1)
    hits = landed([MAIN, array], MAIN_DISTANCE + relayed, rays).reshape(len(lenslets), 20, 2)
    # Through the middle of the lenslet, straight on: magnified by −b/a.
    expected = lenslets + (lenslets - picture) * relayed / picture_before
    np.testing.assert_allclose(hits, np.repeat(expected[:, None], 20, axis=1), atol=1e-9 * PITCH)


# --- prism arrays ---


def test_a_lens_prism_array_moves_each_picture_by_its_prism():
    slopes = np.random.default_rng(0).uniform(-0.03, 0.03, (3, 4, 2))
    focal_length, pitch = 80 * mm, 6 * mm
    array = vcc.PrismArray(slopes, pitch, focal_length=focal_length)
    row, column = (index.reshape(-1) for index in np.mgrid[:3, :4])
    middles = np.stack([(column - 1.5) * pitch, (row - 1) * pitch], axis=-1)
    direction = np.array([0.02, -0.01])
    for place in np.random.default_rng(1).uniform(-0.49, 0.49, (10, 2)) * pitch:
        rays = np.concatenate([middles + place, np.tile(direction, (12, 1))], axis=-1)
        expected = middles + focal_length * (direction + slopes[row, column])
        np.testing.assert_allclose(landed([array], focal_length, rays), expected, atol=EXACT * focal_length)


# --- biprism and pyramid ---

DELTA, FOCAL_LENGTH = 0.01, 50 * mm
DEPTHS = (0.2, 0.5, 1.0, 3.0, 20.0)


def fan(depth: float, height: float = 0.0) -> np.ndarray:
    """Rays at z = 0 of the point (height, 0, −depth): at 400 places from −8 to 8 mm, none at 0."""
    u = (np.arange(400) - 199.5) * 0.04 * mm
    zero = np.zeros_like(u)
    return np.stack([u, zero, (u - height) / depth, zero], axis=-1)


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("to_lens", [0.0, 30 * mm, 120 * mm])
@pytest.mark.parametrize("height", [0.0, 0.002])
def test_before_a_lens_a_biprism_shows_each_point_twice_2_delta_z_apart(depth, to_lens, height):
    """Sharp: the lens images two virtual points, both at the depth of the true one, ±δ·Z beside it."""
    distance = 1 / (1 / FOCAL_LENGTH - 1 / (depth + to_lens))
    camera = [vcc.Biprism(DELTA), vcc.Lens(FOCAL_LENGTH, z=to_lens)]
    rays = fan(depth, height)
    x = landed(camera, to_lens + distance, rays)[:, 0]
    right = rays[:, 0] > 0
    magnification = -distance / (depth + to_lens)
    atol = EXACT * depth
    np.testing.assert_allclose(x[right], magnification * (height + DELTA * depth), atol=atol)
    np.testing.assert_allclose(x[~right], magnification * (height - DELTA * depth), atol=atol)
    separation = 2 * DELTA * depth * distance / (depth + to_lens)
    assert np.ptp(x) == pytest.approx(separation, rel=1e-9)


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("to_lens", [30 * mm, 120 * mm])
def test_the_pictures_of_a_fixed_camera_are_apart_by_the_depth(depth, to_lens):
    """In focus or not, along the rays through the middle of the lens: 2·δ·d·Z/(Z + a)."""
    distance = 52 * mm
    camera = vcc.Camera(
        [vcc.Biprism(DELTA), vcc.Lens(FOCAL_LENGTH, z=to_lens)], vcc.Sensor(to_lens + distance, (1, 1), 1 * mm)
    )
    rays = fan(depth)
    paths = trace(camera, rays)
    assert paths.z[2] == to_lens
    x = []
    for half in (rays[:, 0] > 0, rays[:, 0] < 0):
        at_lens, at_sensor = paths.positions[half, 2, 0], paths.positions[half, 3, 0]
        # Behind one face all is affine in the place on it: two of its rays tell of the one through the middle.
        (a, b), (p, q) = at_lens[[0, -1]], at_sensor[[0, -1]]
        x.append(p - a * (q - p) / (b - a))
    separation = 2 * DELTA * distance * depth / (depth + to_lens)
    assert x[1] - x[0] == pytest.approx(separation, rel=1e-9)
    # The same as two cameras: a baseline of 2·δ·a, converging by 2·δ.
    assert x[1] - x[0] == pytest.approx(distance * (2 * DELTA - 2 * DELTA * to_lens / (depth + to_lens)), rel=1e-9)


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_behind_a_lens_a_biprism_parts_pictures_alike_at_every_depth(depth, share):
    distance = 1 / (1 / FOCAL_LENGTH - 1 / depth)
    biprism = vcc.Biprism(DELTA, z=share * distance)
    x = landed([vcc.Lens(FOCAL_LENGTH), biprism], distance, fan(depth))[:, 0]
    expected = DELTA * distance * (1 - share)
    # All light to the right of the ridge goes to the left of the middle, by δ times the way that is left.
    np.testing.assert_allclose(x[200:], -expected, atol=EXACT * depth)
    np.testing.assert_allclose(x[:200], expected, atol=EXACT * depth)


@pytest.mark.parametrize("sides", [3, 4, 6])
def test_a_pyramid_shows_a_point_as_often_as_it_has_sides_on_a_circle(sides):
    depth = 0.8
    distance = 1 / (1 / FOCAL_LENGTH - 1 / depth)
    at = np.random.default_rng(0).uniform(-5, 5, (3000, 2)) * mm
    middle = np.array([0.004, -0.003])
    camera = [vcc.Pyramid(sides, DELTA, rotation=0.2), vcc.Lens(FOCAL_LENGTH)]
    spots = landed(camera, distance, np.concatenate([at, (at - middle) / depth], axis=-1)) / distance
    around = spots - -middle / depth
    np.testing.assert_allclose(np.hypot(*around.T), DELTA, rtol=1e-9)
    angle = np.arctan2(*-around[:, ::-1].T) - 0.2  # light from a facet lands opposite to it
    turns = angle / (2 * math.pi / sides)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    assert len(np.unique(np.round(turns).astype(int) % sides)) == sides
    towards = np.arctan2(at[:, 1], at[:, 0]) - 0.2 - angle
    # Each ray left through the facet on which it fell: within half a sector of that facet's middle.
    assert (np.abs((towards + math.pi) % (2 * math.pi) - math.pi) <= math.pi / sides + 1e-9).all()
