"""Lenslets: where micro-images are by tracing single rays, and views of recordings that vary linearly, exactly.

A recording that grows by so much a pixel across and down is read without error by any linear interpolation: a
pixel of a view that stands at P, of the view δ beside the micro-images' centres, must be the recording's value at
P + δ.
"""

from __future__ import annotations

import itertools
import math
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

import vcc
from vcc.base.errors import InputError, ResultWarning
from vcc.base.units import mm, um
from vcc.recover.lenslet_grid import LensletGrid
from vcc.recover.plenoptic import decode_plenoptic, find_lenslets

SHAPE = (64, 83)
COLOURS = np.array([[0.5, 0.004, 0.003], [0.6, -0.003, 0.002], [0.4, 0.001, 0.0045]])
"""Of each channel: at pixel (0, 0), and how much more a column and a row on."""


def linear(x, y):
    """(…, channels)."""
    return COLOURS[:, 0] + np.multiply.outer(x, COLOURS[:, 1]) + np.multiply.outer(y, COLOURS[:, 2])


def recording(shape=SHAPE) -> np.ndarray:
    y, x = np.indices(shape)
    return linear(x, y)


def lattice(layout: str, pitch: float, rotation: float, stretched: float = 1.0) -> LensletGrid:
    angle = rotation + (math.pi / 3 if layout == "hexagonal" else math.pi / 2)
    steps = [(pitch * math.cos(a), pitch * stretched * math.sin(a)) for a in (rotation, angle)]
    return LensletGrid(layout, (37.3, 30.2), tuple(steps))


def centres_of(grid: LensletGrid, shape: tuple[int, int], margin: float) -> np.ndarray:
    """All that are inside, by trying many steps."""
    found = [
        np.array(grid.origin) + a * np.array(grid.steps[0]) + b * np.array(grid.steps[1])
        for a, b in itertools.product(range(-60, 61), repeat=2)
    ]
    inside = [
        p for p in found if (p >= margin - 1e-9).all() and (p <= np.array(shape[::-1]) - 1 - margin + 1e-9).all()
    ]
    return np.array(inside)


@pytest.mark.parametrize("layout", ["square", "hexagonal"])
@pytest.mark.parametrize("rotation", [0.0, 0.2, -0.4])
def test_all_micro_images_inside_are_listed(layout, rotation):
    grid = lattice(layout, 7.0, rotation)
    assert grid.pitch == pytest.approx(7.0)
    assert grid.rotation == pytest.approx(rotation)
    for margin in (0.0, 3.5):
        found = grid.pixel_from_steps(grid.within(SHAPE, margin))
        expected = centres_of(grid, SHAPE, margin)
        assert len(found) == len(expected)
        assert np.abs(found[:, None] - expected).sum(axis=-1).min(axis=0).max() < 1e-9
    place = np.array([50.0, 12.0])
    off = np.linalg.norm(centres_of(grid, SHAPE, 0) - place, axis=1).min()
    # On lattices turned by steps of equal length the nearest in steps is the nearest, or next to it.
    assert np.linalg.norm(grid.nearest_to(place) - place) <= off + 7 / 2
    np.testing.assert_allclose(grid.index_of(grid.centre_of([3, 4], [-2, 5])), [[3, -2], [4, 5]], atol=1e-12)


@pytest.mark.parametrize(
    ("layout", "rotation", "stretched"),
    [
        ("square", 0.0, 1.0),
        ("square", 0.11, 1.0),
        ("hexagonal", 0.0, 1.0),
        ("hexagonal", 0.3, 1.0),
        ("square", 0.0, 1.2),
    ],
)
@pytest.mark.parametrize("inverted", [True, False])
def test_a_recording_that_varies_linearly_is_read_exactly(layout, rotation, stretched, inverted):
    grid, views, apart = lattice(layout, 7.3, rotation, stretched), (3, 5), 1.3
    told = []
    found = decode_plenoptic(
        recording(), grid, views=views, view_step=apart, inverted=inverted, progress=lambda *n: told.append(n)
    )
    step = 7.3 * math.sqrt(stretched) * (math.sqrt(math.sqrt(3) / 2) if layout == "hexagonal" else 1)
    furthest = 2 * apart
    margin = furthest + (0.0 if (layout, rotation, stretched) == ("square", 0, 1) else grid.pitch)
    axes = []
    for middle, size in zip(grid.nearest_to([(SHAPE[1] - 1) / 2, (SHAPE[0] - 1) / 2]), SHAPE[::-1], strict=True):
        places = middle + step * np.arange(-60, 61)
        axes.append(places[(places >= margin - 1e-5) & (places <= size - 1 - margin + 1e-5)])
    across, down = axes
    assert found.shape == (*views, len(down), len(across), 3)
    assert min(found.shape[2:4]) >= 3
    turn = -1 if inverted else 1
    for row, column in np.ndindex(*views):
        beside = turn * apart * (column - 2), turn * apart * (row - 1)
        x, y = np.meshgrid(across + beside[0], down + beside[1])
        expected = linear(x, y)[::turn, ::turn]
        np.testing.assert_allclose(found.values[row, column], expected, atol=2e-6)
    assert told == [(n + 1, 15) for n in range(15)]
    # Without a camera, views are a millimetre apart and converge on infinity, pictures as wide as they are away.
    assert found.frame.isclose(vcc.LightField.from_views(found.values, 1 * mm, 1 / max(found.shape[2:4])).frame)


def test_steps_between_pixels_can_be_chosen():
    grid = lattice("square", 7.3, 0.0)
    one = decode_plenoptic(recording()[..., 0], grid, views=1, step=3.65)
    whole = decode_plenoptic(recording()[..., 0], grid, views=1)
    assert whole.shape[2:] == (len(set(centres_of(grid, SHAPE, 0)[:, 1].round(6))), 12)
    assert one.channels is None
    x = np.diff(one.values[0, 0], axis=1)
    np.testing.assert_allclose(x, -3.65 * COLOURS[0, 1], atol=1e-6)
    with pytest.raises(InputError, match="step must be greater than 0"):
        decode_plenoptic(recording(), grid, step=0)


@pytest.mark.parametrize(
    ("pitch", "options", "counts"),
    [
        (9.0, {}, (9, 9)),
        (8.0, {}, (7, 7)),
        (9.0, {"view_step": 2.0}, (5, 5)),
        (9.0, {"view_step": 0.5}, (17, 17)),
        (9.0, {"views": 1}, (1, 1)),
        (9.0, {"views": [2, 4]}, (2, 4)),
        (9.0, {"views": 10}, (10, 10)),  # the outermost half a pixel into the border: a place that lenslets share
        (9.0, {"views": 11}, None),
        (9.0, {"view_step": 0.0}, None),
        (3.0, {}, (3, 3)),
        (2.9, {}, None),
        (2.9, {"views": 1}, (1, 1)),
    ],
)
def test_micro_images_hold_so_many_views(pitch, options, counts):
    grid = lattice("square", pitch, 0.0)
    if counts is None:
        with pytest.raises(InputError):
            decode_plenoptic(recording(), grid, **options)
    else:
        assert decode_plenoptic(recording(), grid, **options).shape[:2] == counts


def test_pixels_that_are_not_square_hold_other_views_across_and_down():
    grid = LensletGrid("square", (37.3, 30.2), ((9.0, 0.0), (0.0, 5.0)))
    assert decode_plenoptic(recording(), grid).shape[:2] == (5, 9)
    with pytest.raises(
        InputError, match=r"7 views 1\.0 pixels apart do not fit into micro-images of 5\.00 pixels"
    ):
        decode_plenoptic(recording(), grid, views=(7, 3))
    assert decode_plenoptic(recording(), grid, views=(3, 7)).shape[:2] == (3, 7)


# -- white and dark


def test_darkness_is_told_and_others_stand_in():
    """Where the white image is dark around one lenslet, its neighbours are; where it is all dark, nothing is."""
    grid = lattice("square", 8.0, 0.3)
    y, x = np.indices(SHAPE)
    white = 2.0 + 0.01 * x
    centre = grid.centre_of(2, 1)
    dark = np.hypot(x - centre[0], y - centre[1]) < 3.2
    value = recording()[..., 0]
    spoilt = value * white
    spoilt[dark] = 7.0
    white[dark] = 0.01
    whole = decode_plenoptic(value, grid, views=1).values[0, 0]
    found = decode_plenoptic(spoilt, grid, white=white, views=1).values[0, 0]
    assert (found > 0).all()
    off = np.abs(found - whole)
    # Only pixels of the view less than a step from that lenslet are made of fewer: by one step at most.
    assert 0 < np.count_nonzero(off > 1e-5) <= 9
    assert off.max() < 8 * (0.004 + 0.003) * math.sqrt(2)
    white[:, :40] = 0.01
    with pytest.warns(ResultWarning, match=r"4\d\.\d% of the samples lie where the white image is dark"):
        half = decode_plenoptic(spoilt, grid, white=white, views=1).values[0, 0]
    # Turned: what is on the left of the recording is on the right.
    assert not half[:, -2:].any()
    assert (half[:, :2] > 0).all()


@pytest.mark.filterwarnings("ignore:negative values of the decoded views:vcc.ResultWarning")
def test_the_dark_frame_is_subtracted_and_nothing_is_less_than_dark():
    grid = lattice("square", 8.0, 0.0)
    value = recording()
    dark = np.full(SHAPE, 0.7)
    found = decode_plenoptic(value, grid, dark=dark, views=1).values
    plain = decode_plenoptic(value, grid, views=1).values
    np.testing.assert_allclose(found, np.maximum(plain - 0.7, 0), atol=1e-6)
    assert (found == 0).any()
    assert (found > 0).any()
    # One in colour has a darkness for each channel; of a grey one in a recording in colour, all have the same.
    each = dark[..., None] * [1, 0.5, 0.2]
    np.testing.assert_allclose(
        decode_plenoptic(value, grid, dark=each, views=1).values,
        np.maximum(plain - [0.7, 0.35, 0.14], 0),
        atol=1e-6,
    )
    both = decode_plenoptic(value, grid, dark=each, white=np.full(SHAPE, 1.7), views=1).values
    np.testing.assert_allclose(both, np.maximum(plain - [0.7, 0.35, 0.14], 0) / [1, 1.35, 1.56], atol=1e-6)
    with pytest.raises(InputError, match="the dark frame has 2 channels, and the recording 3"):
        decode_plenoptic(value, grid, dark=each[..., :2], views=1)


@pytest.mark.parametrize("unit", [1e-4, 1.0, 1e5])
def test_white_images_are_in_any_unit(unit):
    grid = lattice("square", 8.0, 0.0)
    value = recording()
    found = decode_plenoptic(value * unit, grid, white=np.full((*SHAPE, 3), unit), views=3)
    np.testing.assert_allclose(found.values, decode_plenoptic(value, grid, views=3).values, rtol=1e-5)


@pytest.mark.parametrize(("level", "dark"), [(2, True), (3, False)])
def test_codes_below_a_hundredth_of_full_scale_are_dark(level, dark):
    grid = lattice("square", 8.0, 0.0)
    white = np.full(SHAPE, level, np.uint8)
    if dark:
        with pytest.raises(InputError, match="white image is dark"):
            decode_plenoptic(recording(), grid, white=white, views=1)
    else:
        decode_plenoptic(recording(), grid, white=white, views=1)


# -- fitted to centres


def test_lattices_are_fitted_to_what_stands_on_them():
    grid = lattice("hexagonal", 9.0, 0.1)
    points = grid.centre_of(*np.indices((4, 4)).reshape(2, -1))
    assert len(points) == 16
    for listed in (points, points.reshape(4, 4, 2), points[::-1]):
        found = LensletGrid.from_centres(listed)
        assert (found.layout, found.residual) == ("hexagonal", pytest.approx(0, abs=1e-9))
        off = found.centre_of(*np.rint(found.index_of(points)).T) - points
        assert np.abs(off).max() < 1e-9
    with pytest.raises(InputError, match="16 micro-images or more"):
        LensletGrid.from_centres(points[:15])
    with pytest.raises(InputError, match="finite"):
        LensletGrid.from_centres(np.where(np.eye(16, 2) > 0, np.nan, points))
    with pytest.raises(InputError, match="16 micro-images or more"):
        LensletGrid.from_centres(np.zeros((16, 3)))


@pytest.mark.parametrize(("strays", "fits"), [(9, True), (12, False)])
def test_a_tenth_of_the_centres_may_stray(strays, fits):
    grid = lattice("square", 10.0, 0.05)
    index = np.indices((10, 10)).reshape(2, -1)
    points = grid.centre_of(*index)
    # Not the one in the middle, which the search starts from.
    which = np.random.default_rng(2).choice(40, strays, replace=False)
    points[which] += 4.5
    if fits:
        found = LensletGrid.from_centres(points)
        kept = np.delete(points, which, axis=0)
        off = found.centre_of(*np.rint(found.index_of(kept)).T) - kept
        assert np.abs(off).max() < 1e-9
    else:
        with pytest.raises(InputError, match=f"only {100 - strays} of 100 centres fit one square lattice"):
            LensletGrid.from_centres(points)


def test_the_residual_is_the_distance_from_the_lattice():
    """Alternately 0.1 to the left and right of a square lattice: along no line do these grow or shrink."""
    grid = lattice("square", 10.0, 0.0)
    a, b = np.indices((12, 12)).reshape(2, -1)
    points = grid.centre_of(a, b)
    points[:, 0] += 0.1 * (-1.0) ** (a + b)
    found = LensletGrid.from_centres(points)
    assert found.residual == pytest.approx(0.1, rel=1e-3)


# -- by the camera


GAP, ARRAY = 1.1 * mm, 60 * mm


def tilted_camera(layout="hexagonal", shape=(90, 101)) -> vcc.Camera:
    """A lens behind the entrance plane and off the axis, a prism, and lenslets that are turned and off theirs."""
    array = vcc.LensArray(
        0.2 * mm,
        GAP,
        layout=layout,
        rotation=0.07,
        offset=(30 * um, -50 * um),
        z=ARRAY,
        decentre=(0.1 * mm, 0.3 * mm),
    )
    lens = vcc.Lens(40 * mm, z=15 * mm, decentre=(0.5 * mm, -0.4 * mm))
    sensor = vcc.Sensor(ARRAY + GAP, shape, (22 * um, 25 * um), decentre=(0.2 * mm, -0.1 * mm))
    return vcc.Camera([lens, vcc.Prism((0.01, -0.02), z=30 * mm), array], sensor)


def traced(ray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place and slope (x, y) at the lenslets of a ray (u, v, s, t), element by element."""
    place, slope = ray[:2].copy(), ray[2:].copy()
    place = place + 15 * mm * slope
    slope = slope - (place - np.array([0.5, -0.4]) * mm) / (40 * mm)
    place = place + 15 * mm * slope
    slope = slope + np.array([0.01, -0.02])
    return place + 30 * mm * slope, slope


def test_micro_images_are_where_rays_through_the_middle_of_the_lens_land():
    camera = tilted_camera()
    grid = LensletGrid.of_camera(camera)
    c, s = math.cos(0.07), math.sin(0.07)
    for a, b in ((0, 0), (1, 0), (0, 1), (-3, 5)):
        across, down = 0.2 * mm * (a + 0.5 * b), 0.2 * mm * math.sqrt(3) / 2 * b
        lenslet = np.array([c * across - s * down, s * across + c * down])
        lenslet += np.array([30, -50]) * um + np.array([0.1, 0.3]) * mm
        # Places are linear in slopes: which one gets there is found from two that do not.
        here, there = (traced(np.array([0, 0, each, each]))[0] for each in (0.0, 1.0))
        slope = (lenslet - here) / (there - here)
        place, leaving = traced(np.array([0, 0, *slope]))
        np.testing.assert_allclose(place, lenslet, atol=1e-12)
        landed = lenslet + GAP * leaving
        pixel = (landed - np.array([0.2, -0.1]) * mm) / (np.array([25, 22]) * um) + np.array([50, 44.5])
        np.testing.assert_allclose(grid.centre_of(a, b), pixel, atol=1e-8)


@pytest.mark.parametrize("layout", ["square", "hexagonal"])
@pytest.mark.parametrize("inverted", [True, False])
def test_the_frame_is_that_of_rays_through_the_lenslets(layout, inverted):
    """Each sample's ray goes from its place of the lens through the lenslet whose micro-image it was read in.

    As the recording is linear, its value tells the place it was read at.
    """
    camera = tilted_camera(layout)
    y, x = np.indices(camera.sensor.shape)
    places = np.stack([0.01 * x + 0.1, 0.01 * y + 0.1, np.ones(x.shape)], axis=-1)
    found = decode_plenoptic(
        places if inverted else places[::-1, ::-1], camera=camera, views=3, view_step=0.8, inverted=inverted
    )
    other = decode_plenoptic(places, camera=camera, views=(3, 3), view_step=0.8)
    np.testing.assert_allclose(found.values, other.values, atol=1e-6)
    assert found.frame.isclose(other.frame, 1e-9)
    pitches = np.array([25, 22]) * um
    for index in ([0, 0, 0, 0], [2, 1, 3, 4], [1, 2, found.shape[3] - 1, 0], [1, 1, 2, 2]):
        lenslet, slope = traced(found.frame(index))
        landed = lenslet + GAP * slope  # a lenslet leaves rays through its middle as they are
        pixel = (landed - np.array([0.2, -0.1]) * mm) / pitches + np.array([50, 44.5])
        column, row, place, down = index
        shown = (np.asarray(found.values)[row, column, down, place, :2] - 0.1) / 0.01
        np.testing.assert_allclose(pixel, shown, atol=2e-3)  # float32 of numbers up to 1


@pytest.mark.parametrize(("factor", "fits"), [(1.019, True), (0.981, True), (1.021, False), (0.979, False)])
def test_grids_of_another_pitch_are_not_of_this_camera(factor, fits):
    camera = tilted_camera("square")
    own = LensletGrid.of_camera(camera)
    grid = replace(own, steps=tuple((factor * x, factor * y) for x, y in own.steps))
    if fits:
        decode_plenoptic(np.ones(camera.sensor.shape), grid, camera=camera, views=1)
    else:
        with pytest.raises(InputError, match="not of this camera"):
            decode_plenoptic(np.ones(camera.sensor.shape), grid, camera=camera, views=1)
    with pytest.raises(InputError, match="not of this camera"):
        decode_plenoptic(
            np.ones(camera.sensor.shape), lattice("hexagonal", own.pitch, 0.0), camera=camera, views=1
        )


def test_arrays_at_an_image_of_the_lens_or_on_the_sensor_are_refused():
    sensor = vcc.Sensor(80 * mm + GAP, (90, 90), 20 * um)
    at_image = [vcc.Lens(20 * mm, z=40 * mm), vcc.LensArray(0.2 * mm, GAP, z=80 * mm)]
    with pytest.raises(InputError, match="image the entrance plane"):
        LensletGrid.of_camera(vcc.Camera(at_image, sensor))
    with pytest.raises(InputError, match="lies on the sensor"):
        LensletGrid.of_camera(vcc.Camera(at_image[1:], vcc.Sensor(80 * mm, (90, 90), 20 * um)))


# -- in white images


def dotted(grid: LensletGrid, shape: tuple[int, int], diameter: float) -> tuple[np.ndarray, np.ndarray]:
    y, x = np.indices(shape)
    centres = centres_of(grid, (shape[0] + 40, shape[1] + 40), -20)
    distance = np.min([np.hypot(x - a, y - b) for a, b in centres], axis=0)
    return np.clip(diameter / 2 - distance + 0.5, 0, 1), centres_of(grid, shape, diameter / 2 + 1)


@pytest.mark.parametrize(
    ("layout", "shape", "rotation"), [("square", (90, 140), 0.0), ("hexagonal", (130, 80), 0.04)]
)
def test_dust_dead_pixels_filters_and_units_do_not_move_the_lattice(layout, shape, rotation):
    """Long pictures either way; a mosaic of unlike filters; a few micro-images half hidden, one too bright."""
    grid = lattice(layout, 10.4, rotation)
    white, centres = dotted(grid, shape, 8.4)
    clean = find_lenslets(white)
    off = clean.centre_of(*np.rint(clean.index_of(centres)).T) - centres
    assert np.abs(off).max() < 0.02
    assert clean.layout == layout
    for unit in (1e-5, 1e4):
        again = find_lenslets(unit * white + 0.0)
        np.testing.assert_allclose(again.origin, clean.origin, atol=1e-3)
        np.testing.assert_allclose(again.steps, clean.steps, atol=1e-5)
    filters = np.tile([[0.6, 1.0], [1.0, 0.4]], (shape[0] // 2, shape[1] // 2))
    through = find_lenslets(white * filters + 0.1, dark=np.full(shape, 0.1), color_filter=True)
    off = through.centre_of(*np.rint(through.index_of(centres)).T) - centres
    assert np.abs(off).max() < 0.05
    dirty = white.copy()
    for a, b in np.rint(centres[[7, 20, 33]]).astype(int):
        dirty[b : b + 6, a - 5 : a + 6] = 0
    dirty[15, 30] = 30.0
    found = find_lenslets(dirty)
    off = found.centre_of(*np.rint(found.index_of(centres)).T) - centres
    assert np.abs(off).max() < 0.04


def test_even_light_between_filters_is_what_they_average():
    from vcc.recover.white_image import evened_out

    filters = np.tile([[0.6, 1.0], [0.8, 0.4]], (5, 6))
    np.testing.assert_allclose(evened_out(filters), 0.7, rtol=1e-12)
    point = np.zeros((7, 8))
    point[3, 4] = 16
    expected = np.zeros((7, 8))
    expected[2:5, 3:6] = np.outer([1, 2, 1], [1, 2, 1])
    np.testing.assert_allclose(evened_out(point), expected, atol=1e-15)


@pytest.mark.parametrize(
    ("layout", "overtones"),
    [("square", ((2, 0), (0, 2))), ("square", ((1, 1), (-1, 1))), ("hexagonal", ((2, 0), (0, 2), (2, 2)))],
)
def test_overtones_are_not_taken_for_the_lattice(layout, overtones):
    """Waves of half the pitch, or along the diagonals, ten times as strong as those of the pitch itself."""
    grid = lattice(layout, 15.0, 0.05)
    y, x = np.indices((150, 170))
    along = np.linalg.inv(np.transpose(grid.steps))
    a, b = (2 * np.pi * ((x - grid.origin[0]) * f[0] + (y - grid.origin[1]) * f[1]) for f in along)
    light = 4 + sum(np.cos(m * a + n * b) for m, n in overtones) + 0.1 * (np.cos(a) + np.cos(b))
    if layout == "hexagonal":
        light = light + 0.1 * np.cos(a + b)
    found = find_lenslets(light)
    assert found.layout == layout
    assert found.pitch == pytest.approx(15.0, rel=1e-3)


def test_light_around_places_is_summed_up_in_round_windows_with_soft_rims():
    """By sums over all pixels, also where a window reaches beyond the picture, whose edges go on there."""
    from vcc.recover.white_image import _centroids

    light = np.random.default_rng(0).random((12, 17))
    places = np.array([[5.3, 4.6], [0.4, 10.8], [15.9, 0.2], [16.0, 11.0]])
    found, mass = _centroids(light, places, 2.7)
    y, x = np.mgrid[-6:20, -6:26]
    shown = light[np.clip(y, 0, 11), np.clip(x, 0, 16)]
    for (a, b), where, total in zip(places, found, mass, strict=True):
        weight = np.clip(2.7 + 0.5 - np.hypot(x - a, y - b), 0, 1) * shown
        assert total == pytest.approx(weight.sum(), rel=1e-12)
        np.testing.assert_allclose(where, [(weight * x).sum() / total, (weight * y).sum() / total], rtol=1e-9)
    assert (_centroids(np.zeros((9, 9)), np.array([[4.2, 4.0]]), 2.0)[0] == [4.2, 4.0]).all()


@pytest.mark.parametrize(
    ("layout", "shape", "rotation"),
    [("square", (90, 141), 0.03), ("hexagonal", (131, 80), -0.05), ("square", (97, 96), 0)],
)
def test_the_spectrum_alone_tells_the_lattice_between_its_bins(layout, shape, rotation):
    """Of waves under a smooth window a parabola finds peaks to some hundredths of a bin; phases are exact then."""
    from vcc.recover.white_image import _from_spectrum

    grid = lattice(layout, 10.37, rotation)
    y, x = np.indices(shape)
    along = np.linalg.inv(np.transpose(grid.steps))
    if layout == "hexagonal":
        along = np.concatenate([along, along[:1] + along[1:]])
    light = 4 + sum(np.cos(2 * np.pi * ((x - grid.origin[0]) * f[0] + (y - grid.origin[1]) * f[1])) for f in along)
    found = _from_spectrum(light)
    assert found.layout == layout
    # Bins of a picture twice as large are 1/(2·80) apart: 1/16 of the frequency, of which a hundredth.
    assert found.pitch == pytest.approx(10.37, rel=6e-4)
    assert found.rotation == pytest.approx(rotation, abs=6e-4)
    np.testing.assert_allclose(found.origin, grid.nearest_to(found.origin), atol=0.1)
    # The lattice starts from the micro-image in the middle.
    assert np.linalg.norm(np.array(found.origin) - (np.array(shape[::-1]) - 1) / 2) < 10.37


@pytest.mark.parametrize(
    ("elements", "words"), [([], "its elements: none"), ([vcc.Lens(0.05)], "its elements: lens")]
)
def test_a_camera_without_lenslets_is_told_by_its_elements(elements, words):
    with pytest.raises(InputError, match=words):
        LensletGrid.of_camera(vcc.Camera(elements, vcc.Sensor(0.05, (9, 9), 1e-5)))


@pytest.mark.parametrize(("size", "order"), [(52, 2), (92, 4)])
def test_vignetting_of_a_polynomial_is_divided_out(size, order):
    """Of second order where there are few micro-images, of fourth where there are 60 or more.

    The light of a micro-image is the mean of the vignetting over its window, which is a polynomial of the same
    order, and differs from that at the middle by half the curvature times r²/4: 0.5 % at a pitch of 10 pixels.
    """
    from vcc.recover.white_image import _evenly_lit

    grid = LensletGrid("square", (10.5, 10.5), ((10.0, 0.0), (0.0, 10.0)))
    y, x = (np.indices((size, size)) - (size - 1) / 2) / ((size - 1) / 2)
    vignetting = 1 - 0.3 * (x * x + y * y) if order == 2 else 1 - 0.25 * (x**4 + 2 * x * x * y * y + y**4)
    index = np.array(list(itertools.product(range((size - 12) // 10), repeat=2)))
    assert (len(index) >= 60) == (order == 4)
    even = _evenly_lit(vignetting, grid, index)[10:-10, 10:-10]
    assert np.ptp(vignetting[10:-10, 10:-10]) > 0.1
    assert np.ptp(even) < 0.02 * even.mean()


def test_what_is_finer_than_lenslets_does_not_hide_them():
    """Pixels that differ by turns, as beneath a colour filter, are brighter in the spectrum than micro-images."""
    from vcc.recover.white_image import _from_spectrum

    y, x = np.indices((90, 100))
    lenslets = 1 + 0.2 * (np.cos(2 * np.pi * x / 9.3) + np.cos(2 * np.pi * y / 9.3))
    found = _from_spectrum(lenslets * (1 + 0.5 * (-1.0) ** (x + y)))
    assert found.pitch == pytest.approx(9.3, rel=0.01)


@pytest.mark.parametrize("level", [1.0, 3.0])
def test_light_that_is_added_to_dark_views_is_reported_with_its_size(level):
    """Noise of standard deviation 1 around m has the mean m·Φ(m) + φ(m) where negative values are 0."""
    grid = LensletGrid("square", (5.0, 5.0), ((10.0, 0.0), (0.0, 10.0)))
    recording = level + np.random.default_rng(0).standard_normal((400, 400))
    added = (level * norm.cdf(level) + norm.pdf(level)) / level - 1
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        views = decode_plenoptic(recording, grid, views=5)
    said = [str(each.message) for each in caught if "negative values" in str(each.message)]
    assert bool(said) == (added > 5e-3)
    # 40² lenslets of 25 pixels: a mean has a standard error of 1/200.
    assert np.asarray(views.values).mean() == pytest.approx(level * (1 + added), abs=4 / 200)
    if said:
        assert float(re.search(r"adds ([\d.]+)%", said[0])[1]) == pytest.approx(100 * added, abs=2)
