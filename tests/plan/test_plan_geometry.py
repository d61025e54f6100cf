"""The geometry behind plans' choices: cells of views and samples on planes and on the sensor, the space between
views, missing light. Oracles are corners listed one by one, closed forms and many random places."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import convolve

import vcc
from vcc.base.affine import Affine
from vcc.base.units import mm
from vcc.engines import reference
from vcc.plan.correlation import correlated
from vcc.plan.coverage import AskedLight, Missing, _cut
from vcc.plan.following import Follow
from vcc.plan.footprints.around import Sharpened
from vcc.plan.footprints.batch import Looks
from vcc.plan.footprints.cells import Geometry, SampleDivision, parts_of_sheared
from vcc.plan.footprints.detail import detail_lost, details_lost
from vcc.plan.footprints.mask_textures import MaskMet
from vcc.plan.footprints.means import _raster
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.planes import Plane, along_axes, cell_tiles, depends_on_view_only, tap_origin
from vcc.plan.footprints.taps import CellDivision, Taps
from vcc.plan.footprints.words import cautions_of
from vcc.plan.how import How, cores
from vcc.plan.model import Plan
from vcc.plan.operators import AlongAxes, BlurViews, DarkBorder, SharpenViews
from vcc.plan.parallax_rule import index_motions
from vcc.plan.rays.textures import Points
from vcc.plan.sharpening import symmetric, symmetric_plane
from vcc.shapes.patterns import FEWEST_PER_CELL, RASTER_LIMIT, Cells, Circle, Open, as_pattern

RANDOM = np.random.default_rng(12)
STILL = np.zeros((2, 2))


def plane_of(at_index, offset=(0.0, 0.0), pattern=None):
    return Plane(pattern or Open(), "plane", (0.0, 0.0), np.asarray(at_index, float), np.asarray(offset, float))


# --- correlations ---


@pytest.mark.parametrize(
    "lags", [(range(-3, 4), range(-2, 3)), (range(-9, 10), range(-8, 9)), (range(3), range(1, 4))]
)
def test_correlations_are_sums_of_products_at_each_lag(lags):
    one, other = RANDOM.standard_normal((5, 6, 2)), RANDOM.standard_normal((7, 4, 2))
    wanted = np.zeros((len(lags[0]), len(lags[1])))
    for (a, m), (b, n) in itertools.product(enumerate(lags[0]), enumerate(lags[1])):
        for r, c in np.ndindex(5, 6):
            if 0 <= r - m < 7 and 0 <= c - n < 4:
                wanted[a, b] += one[r, c] @ other[r - m, c - n]
    np.testing.assert_allclose(correlated(one, other, *lags), wanted, atol=1e-12)


# --- between views ---


def test_a_point_of_the_scene_is_seen_along_its_motion():
    """Of rays from a point at the distance Z, s − u/Z is the same, whatever the frame."""
    frame = Affine.from_parts(np.eye(4) + 0.3 * RANDOM.uniform(-1, 1, (4, 4)), RANDOM.uniform(-1, 1, 4))
    vergences = np.array([0.0, 0.7, -1.3])
    motions = index_motions(frame, vergences)
    for inverse, motion in zip(vergences, motions, strict=True):
        index, view = RANDOM.uniform(-3, 3, (2, 4)), RANDOM.uniform(-3, 3, 2)
        other = np.concatenate([view, index[0, 2:] - motion @ (view - index[0, :2])])
        one, another = frame(index[0]), frame(other)
        np.testing.assert_allclose(
            one[2:] - inverse * one[:2], another[2:] - inverse * another[:2], rtol=1e-9, atol=1e-12
        )
    tiny = Affine.from_parts(1e-13 * frame.linear, np.zeros(4))  # in whatever units
    np.testing.assert_allclose(index_motions(tiny, vergences), motions, rtol=1e-9)
    flat = index_motions(Affine(np.diag([1.0, 1, 0, 0, 1])), np.array([0.0]))
    assert not flat.any()


def gaps_of(views, scene_gap, **options):
    """A plan for a scene whose views' pictures lie so many pixels apart, samples being one pixel wide."""
    z = 52 * mm
    camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(z=z, shape=(12, 12), pitch=0.01 * z))
    field = vcc.LightField.from_views(np.ones((*views, 12, 12), np.float32), 1 * mm, 0.01, 1.3, (-1.0, 1.0))
    in_focus = field.disparity_of(1 / (1 / (50 * mm) - 1 / z))
    at = [field.disparity_of(distance) for distance in (1.0, 2.0)]  # linear in 1/Z
    inverse = 1 + (in_focus + scene_gap - at[0]) * (0.5 - 1) / (at[1] - at[0])
    return camera.compile(field, scene_distance=1 / inverse, **options)


def test_gaps_of_more_than_a_pixel_are_filled_along_the_axes_that_have_views():
    for gap in (0.98, 1.02, 3.0):
        both = gaps_of((3, 3), gap)
        assert both.smear == (pytest.approx((gap, gap), rel=1e-6) if gap > 1 else (0.0, 0.0))
        assert both.expected_ghosting == pytest.approx(0.0 if gap > 1 else gap, abs=1e-9)
        none = gaps_of((3, 3), gap, between_views="none")
        assert (none.smear, none.expected_ghosting) == ((0.0, 0.0), pytest.approx(gap))
    assert gaps_of((1, 3), 2.0).smear == (0.0, pytest.approx(2.0))
    assert gaps_of((3, 1), 2.0).smear == (pytest.approx(2.0), 0.0)
    single = gaps_of((1, 1), 2.0)
    assert (single.smear, single.expected_ghosting) == ((0.0, 0.0), 0.0)


@pytest.mark.parametrize(
    ("error", "finer", "spilt", "fine", "ghosts", "words"),
    [
        (5e-3, 1, 5e-3, 1, 3.0, []),
        (5.1e-3, 1, 0, 1, 0, ["vary within parts.*0.5%.*refine=2"]),
        (6e-3, 4, 0, 1, 0, ["refine=8, or more views"]),
        (6e-3, 8, 0, 1, 0, ["Pass more views"]),
        (0, 1, 5.1e-3, 2, 0, ["near the sensor.*refine=4, or finer samples"]),
        (0, 1, 0.02, 8, 0, ["2.0%.*Pass finer samples"]),
        (0, 1, 0, 1, 3.1, ["stay 3.1 pixels apart"]),
    ],
)
def test_what_is_said_with_a_picture(error, finer, spilt, fine, ghosts, words):
    division = CellDivision(1, False, finer, error=error)
    said = cautions_of(division, SampleDivision(fine, spilt, True), ghosts, 2.0)
    assert len(said) == len(words)
    for caution, pattern in zip(said, words, strict=True):
        assert re.search(pattern, caution)


# --- planes ---


def test_where_taps_fall_on_a_plane():
    """View and sample by the plane's own map; a shift by a part of a view moves along the scene's motion too."""
    at_index, offset, motion = (
        RANDOM.standard_normal((2, 4)),
        RANDOM.standard_normal(2),
        RANDOM.standard_normal((2, 2)),
    )
    index, shift = RANDOM.standard_normal((3, 4, 2)), RANDOM.standard_normal((3, 4, 2))
    found = tap_origin(at_index, offset, index, shift, motion)
    plane = plane_of(at_index, offset)
    for place in np.ndindex(3, 4):
        moved = np.concatenate([index[place] + shift[place], -motion @ shift[place]])
        np.testing.assert_allclose(found[place], at_index @ moved + offset, atol=1e-12)
    np.testing.assert_allclose(
        plane.view_step(motion) @ [2, 3], at_index @ [2, 3, *(-motion @ [2, 3])], atol=1e-12
    )
    np.testing.assert_allclose(plane.middle_of_view((8, 9)), at_index @ [0, 0, 4, 3.5] + offset, atol=1e-12)
    np.testing.assert_array_equal(plane.sample_step, at_index[:, 2:])


def test_rectangles_that_stand_for_cells():
    for step in (np.diag([2.0, -3.0]), np.array([[0.0, 2.0], [-3.0, 0.0]])):
        (tile,) = cell_tiles(step)
        assert (tile.x, tile.y, tile.share) == (0, 0, 1)
        assert (tile.width, tile.height) == (2, 3)
    (line,) = cell_tiles(np.array([[1.0, 2.0], [3.0, 6.0]]))  # a cell without any area
    assert (line.width, line.height) == (3, 9)
    tiles = cell_tiles(np.array([[1.0, -0.4], [0.3, 0.9]]))
    assert len(tiles) > 1
    assert sum(tile.share for tile in tiles) == pytest.approx(1)
    # Of all cells they cover the plane evenly: looked at in some places, cells around listed one by one.
    step, places = np.array([[1.0, -0.4], [0.3, 0.9]]), RANDOM.uniform(-0.5, 0.5, (50, 2))
    density = np.zeros(50)
    for n, m in itertools.product(range(-5, 6), repeat=2):
        for tile in tiles:
            away = np.abs(places - step @ [n, m] - [tile.x, tile.y])
            inside = (away < np.array([tile.width, tile.height]) / 2).all(axis=1)
            density += inside * tile.share / (tile.width * tile.height)
    np.testing.assert_allclose(density, 1 / 1.02, rtol=1e-9)
    assert along_axes(np.array([[1.0, 0.9e-9], [0.9e-9, 1.0]]))
    assert not along_axes(np.array([[1.0, 1.1e-9], [0.0, 1.0]]))


def test_boxes_of_taps_lie_around_their_places():
    at_index = np.array([[1.0, 0.0, 1e-9, 0.0], [0.0, 2.0, 0.0, 2e-9]])
    plane = plane_of(at_index, (0.3, -0.2))
    taps = Taps.of((3, 4), CellDivision(2, False))
    ((boxes, share),) = plane.boxes(taps.index, taps.shift, STILL, (8, 9), 2)
    assert (share, boxes.width, boxes.height) == (1, 0.5, 1.0)
    assert (boxes.x.shape, boxes.y.shape) == ((1, 8), (6, 1))
    np.testing.assert_allclose(boxes.x[0], 0.3 + np.arange(8) / 2 - 0.25, atol=1e-7)
    np.testing.assert_allclose(boxes.y[:, 0], -0.2 + 2 * (np.arange(6) / 2 - 0.25), atol=1e-7)


def test_boxes_of_turned_cells_are_the_rectangles_that_stand_for_them():
    step = np.array([[1.0, -0.4], [0.3, 0.9]])
    plane = plane_of(np.hstack([step, np.zeros((2, 2))]), (0.3, -0.2))
    taps, tiles = Taps.of((3, 4), CellDivision(1, False)), cell_tiles(step)
    made = plane.boxes(taps.index, taps.shift, STILL, (8, 9))
    assert len(made) == len(tiles) > 1
    for (boxes, share), tile in zip(made, tiles, strict=True):
        place = np.stack([boxes.x - tile.x, boxes.y - tile.y], -1)
        np.testing.assert_allclose(place, taps.index @ step.T + plane.offset, atol=1e-12)
        assert (share, boxes.width, boxes.height) == (tile.share, tile.width, tile.height)


def test_planes_tell_views_apart_only_where_samples_hardly_move_on_them():
    """Over 9 columns and 8 rows of samples, by a millionth of a cell of 1 mm × 2 mm."""
    for place, count, cell in (((0, 2), 9, 1 * mm), ((0, 3), 8, 1 * mm), ((1, 2), 9, 2 * mm), ((1, 3), 8, 2 * mm)):
        for factor, wanted in ((0.99, True), (1.01, False)):
            at_index = np.diag([1 * mm, 2 * mm, 0, 0])[:2]
            at_index[place] = -factor * 1e-6 * cell / count
            assert depends_on_view_only(plane_of(at_index), (8, 9), STILL) is wanted


# --- taps ---


@pytest.mark.parametrize(("parts", "spread"), [(1, False), (2, False), (4, False), (2, True), (4, True)])
def test_all_places_of_the_aperture_get_as_much_light(parts, spread):
    """Places are parts of views' cells; light that is spread comes from two views where there are two."""
    views = 4, 3
    taps = Taps.of(views, CellDivision(parts, spread))
    place = np.round((taps.index + taps.shift) * parts * 2).astype(int)
    light: dict[tuple[int, int], float] = {}
    for where, share in zip(place.reshape(-1, 2).tolist(), taps.shares.ravel(), strict=True):
        light[tuple(where)] = light.get(tuple(where), 0.0) + share
    lit = {where: share for where, share in light.items() if share > 0}
    assert len(lit) == 12 * parts**2
    np.testing.assert_allclose(list(lit.values()), 1 / parts**2, rtol=1e-12)
    if not spread:
        return
    # linearly from the nearer view to the next
    inner = np.abs(taps.index[..., 0] - 1) < 0.5
    rows = np.abs(taps.index[..., 1] - 1.5) < 1
    weight = np.prod(1 - np.abs(taps.shift), axis=-1) / parts**2
    np.testing.assert_allclose(taps.shares[inner & rows], weight[inner & rows], rtol=1e-12)


def test_a_piece_of_a_light_field_has_the_taps_of_the_whole():
    division = CellDivision(4, True)
    whole = Taps.of((4, 3), division)
    piece = Taps.of((2, 3), division, ((True, False), (True, True)))
    np.testing.assert_array_equal(piece.shares, whole.shares[: len(piece.rows)])
    last = Taps.of((2, 3), division, ((False, True), (True, True)))
    np.testing.assert_array_equal(last.shares, whole.shares[-len(last.rows) :])


def test_cells_that_are_divided_further_hold_the_light_of_the_others():
    where = np.zeros((4, 3), dtype=bool)
    where[1, 2] = where[3, 0] = True
    taps = Taps.of((4, 3), CellDivision(1, False, 2, where))
    light = np.zeros((4, 3))
    for (b, row), (a, column) in itertools.product(enumerate(taps.rows), enumerate(taps.columns)):
        light[row, column] += taps.shares[b, a]
        assert taps.index[b, a].tolist() == [column, row]
        if taps.shares[b, a] > 0:
            assert taps.shares[b, a] == (0.25 if where[row, column] else 1)
            assert (np.abs(taps.shift[b, a]) == (0.25 if where[row, column] else 0)).all()
    assert (light == 1).all()
    assert [parts for _, parts in taps.levels()] == [1, 2]
    some = taps.some(np.array([1, 2]), np.array([0, 3]))
    assert some.rows.tolist() == taps.rows[[1, 2]].tolist()
    np.testing.assert_array_equal(some.shares, taps.shares[np.ix_([1, 2], [0, 3])])
    assert CellDivision(1, False, 2, where).like(CellDivision(1, False, 2, where.copy(), 0.5))
    for other in (
        CellDivision(1, False, 4, where),
        CellDivision(1, False, 2, ~where),
        CellDivision(2, False, 2, where),
    ):
        assert not CellDivision(1, False, 2, where).like(other)


# --- cells on planes ---

ON_SENSOR = np.array([[0.7, 0.1, -1.1, 0.2], [-0.2, 0.6, 0.1, 0.9]])
ORIGIN = np.array([6.0, -1.0])
AT_INDEX = np.array([[1.0, 0.2, 0.3, -0.1], [-0.1, 1.2, 0.2, 0.4]])


def geometry(**changed) -> Geometry:
    given: dict[str, Any] = {
        "views": (3, 4), "extent": (3.0, 4.0), "samples": (8, 9), "on_sensor": ON_SENSOR, "origin": ORIGIN,
        "sensor": (6, 7), "margin": 2.0,
    }  # fmt: skip
    return Geometry(**{**given, **changed})


@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("beyond", [((0, 0), (0, 0)), ((2, 1), (0, 3))])
def test_what_of_a_plane_the_samples_of_views_meet(parts, beyond):
    """By the corners of a view's cell with those of its samples, or with those of the sensor."""
    plane, view = plane_of(AT_INDEX, (0.2, -0.3)), np.array([[[1.0, 2.0], [0.5, -1.0]]])
    half = 0.5 / parts
    (above, below), (left, right) = beyond
    all_seen = geometry(margin=1e6, beyond=beyond)
    on_all = geometry(samples=(10**6, 10**6), origin=ORIGIN - ON_SENSOR[:, 2:] @ [5e5, 5e5])
    for n, (i, j) in enumerate(view[0]):
        ends = (i - half, i + half), (j - half, j + half)
        samples = (-0.5 - left, 8.5 + right), (-0.5 - above, 7.5 + below)
        corners = [AT_INDEX @ c + plane.offset for c in itertools.product(*ends, *samples)]
        low, high = all_seen.met(plane, view, parts)
        np.testing.assert_allclose(low[0, n], np.min(corners, axis=0), atol=1e-9)
        np.testing.assert_allclose(high[0, n], np.max(corners, axis=0), atol=1e-9)
        corners = []
        for *cell, x, y in itertools.product(*ends, (-2.5, 8.5), (-2.5, 7.5)):
            sample = np.linalg.solve(ON_SENSOR[:, 2:], [x, y] - on_all.origin - ON_SENSOR[:, :2] @ cell)
            corners.append(AT_INDEX @ [*cell, *sample] + plane.offset)
        low, high = on_all.met(plane, view, parts)
        np.testing.assert_allclose(low[0, n], np.min(corners, axis=0), rtol=1e-6, atol=1e-4)
        np.testing.assert_allclose(high[0, n], np.max(corners, axis=0), rtol=1e-6, atol=1e-4)
    nowhere = geometry(origin=ORIGIN + 1e4)
    low, high = nowhere.met(plane, view)
    np.testing.assert_array_equal(low, high)


def test_what_a_place_of_the_sensor_sees_of_a_plane():
    corners = []
    for i, j in itertools.product((-2.0, 2.0), (-1.5, 1.5)):
        sample = np.linalg.solve(ON_SENSOR[:, 2:], -ON_SENSOR[:, :2] @ [i, j])
        corners.append(AT_INDEX @ [i, j, *sample])
    np.testing.assert_allclose(geometry().penumbra(plane_of(AT_INDEX)), np.ptp(corners, axis=0), rtol=1e-9)
    points = ON_SENSOR.copy()
    points[:, 2:] = 0  # a view is one place on the sensor
    found = geometry(on_sensor=points).penumbra(plane_of(AT_INDEX))
    np.testing.assert_allclose(found, np.abs(AT_INDEX[:, :2]) @ [4, 3], rtol=1e-9)


def test_stops_bound_what_a_place_of_the_sensor_sees():
    """A stop at the views, 2 views wide and round, counts as a square of √3 views: of 4 and 3."""
    at_views, corners = np.diag([1.0, 1.0, 0.0, 0.0])[:2], []
    for i, j in itertools.product((-math.sqrt(3) / 2, math.sqrt(3) / 2), repeat=2):
        sample = np.linalg.solve(ON_SENSOR[:, 2:], -ON_SENSOR[:, :2] @ [i, j])
        corners.append(AT_INDEX @ [i, j, *sample])
    plane, stop, wide = (
        plane_of(AT_INDEX),
        plane_of(at_views, (0, 0), Circle(2.0)),
        plane_of(at_views, (0, 0), Circle(9.0)),
    )
    np.testing.assert_allclose(
        geometry(stops=(plane, wide, stop)).penumbra(plane), np.ptp(corners, axis=0), rtol=1e-9
    )
    np.testing.assert_allclose(geometry(stops=(wide,)).penumbra(plane), geometry().penumbra(plane))


def test_views_in_which_a_pattern_varies():
    """A disc that holds some views' cells, cuts others and misses the rest: by places all over each cell."""
    at_index = np.diag([1.0, 1.0, 0.0, 0.0])[:2]
    disc = plane_of(at_index, (-1.5, -1.0), Circle(2.5))
    wide = geometry(margin=1e6)
    part = np.linspace(-0.5, 0.5, 101)
    wanted = np.zeros((3, 4), bool)
    for j, i in np.ndindex(3, 4):
        values = disc.pattern(i - 1.5 + part[None, :], j - 1.0 + part[:, None])
        wanted[j, i] = np.ptp(values) > 0
    np.testing.assert_array_equal(wide.varying([disc]), wanted)
    assert wide.varying([plane_of(at_index)]).sum() == 0
    taps = Taps.of((3, 4), CellDivision(2, False))
    finer = wide.varying_taps(disc, taps)
    for b, a in np.ndindex(finer.shape):
        x, y = np.abs(taps.index[b, a] + taps.shift[b, a] - [1.5, 1.0])
        clear, beside = math.hypot(x + 0.25, y + 0.25) <= 1.25, max(x, y) - 0.25 >= 1.25
        assert finer[b, a] == (not clear and not beside)  # dark is known outside the square around a disc


def test_samples_that_lie_turned_are_divided():
    """A footprint of shifted rows is wider than a sample by 1 + tan² of the angle: 1.3 at 28.7°."""
    for degrees, parts in ((0, 1), (28, 1), (29, 2), (60, 2), (-29, 2)):
        angle = math.radians(degrees)
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        assert parts_of_sheared(1.7 * turn) == parts


# --- elements that vary together ---


def test_places_that_are_looked_at_lie_on_rays_from_the_sensor_through_the_smallest_plane():
    """With one plane at the views and two others, view and pixel of each ray follow, and the last place."""
    first = plane_of(np.diag([1.0, 1.0, 0.0, 0.0])[:2], (0.3, -0.2), Circle(2.0))
    planes = [first, plane_of(AT_INDEX, (0.2, 0.1)), plane_of(0.4 * AT_INDEX[::-1], (-0.1, 0.3))]
    motion = np.array([[0.2, 0.0], [0.1, 0.3]])
    on_sensor = np.column_stack([ON_SENSOR, ORIGIN])
    looks = Looks.of([[each] for each in planes], True, motion, on_sensor, (6, 7), (3.0, 4.0))
    places = [place for (place,) in looks.places]
    middles = [place.mean(axis=(2, 3)) for place in places]
    view = middles[0] - first.offset
    assert (np.abs(middles[0]) <= 1 + 1e-9).all()  # all over the disc's square
    assert (np.abs(middles[0]).max(axis=(0, 1)) > 0.9).all()
    sample = np.linalg.solve(
        AT_INDEX[:, 2:], (middles[1] - planes[1].offset - view @ AT_INDEX[:, :2].T)[..., None]
    )[..., 0]
    pixel = view @ ON_SENSOR[:, :2].T + sample @ ON_SENSOR[:, 2:].T + ORIGIN
    assert (np.ptp(pixel, axis=1) < 1e-9).all()  # many rays of each of some pixels
    assert (pixel >= -0.5 - 1e-9).all()
    assert (pixel <= np.array([6.5, 5.5]) + 1e-9).all()
    last = np.concatenate([view, sample], axis=-1) @ planes[2].at_index.T + planes[2].offset
    np.testing.assert_allclose(middles[2], last, atol=1e-9)
    # points across a cell follow the scene's motion
    part = (np.arange(8) + 0.5) / 8 - 0.5
    for plane, place, middle in zip(planes, places, middles, strict=True):
        for p, q in ((0, 0), (7, 2)):
            moved = np.array([part[q], part[p], *(-motion @ [part[q], part[p]])])
            np.testing.assert_allclose(place[:, :, p, q] - middle, np.zeros_like(middle) + plane.at_index @ moved)
    np.testing.assert_array_equal(looks.values(0), first.pattern(places[0][..., 0], places[0][..., 1]))


@pytest.mark.parametrize("at_views", [False, True])
def test_what_it_costs_to_take_elements_apart(at_views):
    """Means of products less products of means; at the views what others do linearly to the open part's middle."""
    planes = [plane_of(np.diag([1.0, 1.0, 0.0, 0.0])[:2]), plane_of(AT_INDEX)]
    looks = Looks.of(
        [[planes[0]], [planes[1]]], at_views, STILL, np.column_stack([ON_SENSOR, ORIGIN]), (6, 7), (3.0, 4.0)
    )
    one, other = RANDOM.random((2, 24, 32, 8, 8))
    one[:6], other[3:9] = 0.5, 0.25
    apart = looks.apart([one, other])

    def error(parts):
        each = 8 // parts
        off, light = np.zeros((24, parts, parts)), 0.0
        x = np.arange(each) - (each - 1) / 2
        for p, q in np.ndindex(parts, parts):
            a, b = (v[..., p * each : (p + 1) * each, q * each : (q + 1) * each] for v in (one, other))
            taken = a.mean(axis=(2, 3)) * b.mean(axis=(2, 3))
            if at_views:  # b's plane through its points, at the middle of a's light
                for line in (x, x[:, None]):
                    slope = (b * line).mean(axis=(2, 3)) / np.mean(x**2)
                    taken = taken + slope * (a * line).mean(axis=(2, 3))
            off[:, p, q] = (taken - (a * b).mean(axis=(2, 3))).mean(axis=1)
            light += (a * b).mean() / parts**2
        off = off.mean(axis=(1, 2))
        return max(math.sqrt(np.mean(off**2)), 2 * abs(off.mean())) / light

    assert apart.error(1) == pytest.approx(error(1), rel=1e-9)
    assert apart.error(2) == pytest.approx(error(2), rel=1e-9)
    ratio = min(max(error(2) / error(1), 0.25), 0.5)
    assert apart.error(8) == pytest.approx(error(2) * ratio**2, rel=1e-9)
    assert apart.share == pytest.approx(1 - 9 / 24)
    assert apart.even == (False, False)
    even = looks.apart([np.full_like(one, 0.3), other])
    assert (even.even, even.share) == ((True, False), 0.0)
    assert even.error(1) == pytest.approx(0, abs=1e-12)


def test_detail_of_many_arrays_is_that_of_each():
    arrays = RANDOM.random((67, 6, 5))
    cells = Cells(arrays[0], 5 * mm, 6 * mm)
    known, added = np.array([0.4, 0.7]) * mm, np.array([1.3, 0.9]) * mm
    found = details_lost(cells, arrays, known, added)
    assert found.shape == (67,)
    for n in (0, 40, 66):
        plane = plane_of(AT_INDEX, pattern=replace(cells, values=arrays[n]))
        assert found[n] == pytest.approx(detail_lost(plane, known, added), rel=1e-9)
    assert not details_lost(cells, arrays, known, np.zeros(2)).any()


# --- masks in mid-path ---

WAVES = np.array([[2.1, 1.3], [1.7, -1.9]])


def hills(x, y):
    return 0.5 + 0.2 * sum(np.cos(a * x + b * y + 0.4) for a, b in WAVES)


TURNED = np.array([[1.0, 0.3, 0.25, -0.08], [-0.2, 0.9, 0.1, 0.3]])


@pytest.mark.parametrize(
    ("kept", "over_samples", "finer"),
    [(False, False, 1), (False, True, 2), (True, True, 1)],
)
@pytest.mark.parametrize(
    "at_index", [np.array([[1.0, 0, 0.3, 0], [0, 0.8, 0, -0.25]]), TURNED], ids=["straight", "turned"]
)
def test_samples_look_up_the_mean_of_a_mask_over_what_they_cover(at_index, finer, over_samples, kept):
    """Of a wave the mean over a parallelogram is its value in the middle times a sinc for each side.

    A sample covers the cell of its tap, along the scene's motion, and its own cell where it is a mean over it.
    """
    where = np.zeros((3, 4), dtype=bool)
    where[1, 1:3] = finer > 1
    taps = Taps.of((3, 4), CellDivision(1, False, finer, where))
    plane = plane_of(at_index, (-2.4, -1.6), as_pattern(hills))
    motion = np.array([[0.1, 0.0], [0.0, 0.2]])
    off = 0.05 * RANDOM.uniform(-1, 1, (*taps.shares.shape, 2))
    met = MaskMet.of(plane, taps, off, motion, (6, 7), 2, over_samples)
    lookup, made = met.look_up(met.choices(Follow() if kept else None))
    assert lookup.texture.dtype == (np.float64 if kept else np.float32)
    k, l = RANDOM.uniform(0, 6, 5), RANDOM.uniform(0, 5, 4)
    for mesh, parts in taps.levels():
        sides = [plane.view_step(motion) / parts] + [plane.sample_step / 2] * over_samples
        sides = np.hstack(sides)
        for b, a in itertools.product(mesh[0].ravel(), mesh[1].ravel()):
            start = tap_origin(at_index, plane.offset, taps.index, taps.shift + off, motion)[b, a]
            place = start + np.stack(np.broadcast_arrays(k[None, :], l[:, None]), -1) @ plane.sample_step.T
            wanted = 0.5 + 0.2 * sum(
                np.prod(np.sinc(wave @ sides / (2 * np.pi))) * np.cos(place @ wave + 0.4) for wave in WAVES
            )
            np.testing.assert_allclose(lookup.weights(b, a, k, l), wanted, atol=2e-3)
    low, high = made.seen(0, np.array([3.0]))
    assert low < (3 + made.lattice.first[0]) * made.lattice.spacing[0] < high


# --- light that is missing ---


def test_a_polygon_cut_by_half_planes():
    """Its area against the share of random places that all half-planes hold; none is left where none is."""
    square = np.array([[-1.0, -1, 1, 1], [-1.0, 1, 1, -1]])
    places = np.random.default_rng(0).uniform(-1, 1, (2, 200_000))
    corners, inside = square, np.ones(places.shape[1], bool)
    for angle, end in ((0.3, 0.8), (2.0, 0.5), (4.0, 0.9)):
        along = np.array([math.cos(angle), math.sin(angle), 0.1])
        corners = _cut(corners, along, end)
        inside &= along[:2] @ places + 0.1 <= end
    x, y = corners
    area = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2
    assert area == pytest.approx(4 * inside.mean(), rel=0.01)
    assert _cut(square, np.array([1.0, 0, 0]), np.inf) is square
    assert _cut(square, np.array([1.0, 0, 0]), -2.0).shape == (2, 0)
    np.testing.assert_allclose(_cut(square, np.array([1.0, 0, 0.5]), 0.5)[0], [-1, -1, 0, 0], atol=1e-12)


def missing(elements, sensor=None, views=(7, 7)):
    d = 1 / (1 / 50e-3 - 1)
    field = vcc.LightField.from_views(
        np.ones((*views, 8, 10), np.float32), 1 * mm, 2e-3, 1.0, disparity_range=(0.0, 0.0)
    )
    sensor = sensor or vcc.Sensor(d, (4, 4), d * 1e-3)
    return AskedLight.of(vcc.Camera(elements, sensor), field.grid)


def test_light_outside_the_grid_of_views_is_missing_by_its_share_of_the_stop():
    """Views fill 7 mm × 7 mm; the stops are squares."""
    lens = vcc.Lens(50 * mm)

    def stop(width, height=None, **options):
        return missing([lens, vcc.Mask(np.ones((1, 1)), width, height or width, **options)]).missing

    assert (stop(7 * mm).share, stop(7 * mm).reason) == (0.0, "")
    assert stop(7 * mm * (1 + 1e-9)).share == 0
    assert stop(14 * mm).share == pytest.approx(0.75, abs=2e-3)
    assert stop(14 * mm, 7 * mm).share == pytest.approx(0.5, abs=2e-3)
    assert stop(5 * mm, decentre=(2 * mm, 0.0)).share == pytest.approx(0.2, abs=2e-3)
    assert stop(5 * mm, decentre=(0.0, -2 * mm)).share == pytest.approx(0.2, abs=2e-3)
    assert "75" in stop(14 * mm).reason
    assert "outside the grid of views" in stop(14 * mm).reason
    assert not missing([lens]).missing.share
    # where facets bend rays, next to nothing here, bounds are not known beforehand
    bent = missing([lens, vcc.Biprism(1e-9), vcc.Mask(np.ones((1, 1)), 14 * mm)]).missing
    assert bent.share == pytest.approx(0.75, abs=2e-3)


def test_light_outside_the_views_pictures_is_missing_by_its_share_of_the_sensor():
    """In focus, 8 rows and 10 columns of samples as wide as pixels."""
    d = 1 / (1 / 50e-3 - 1)
    for elements in ([vcc.Lens(50 * mm)], [vcc.Lens(50 * mm, 5 * mm)]):
        for shape, share in (((8, 10), 0.0), ((16, 10), 0.5), ((8, 40), 0.75), ((16, 20), 0.75)):
            found = missing(elements, vcc.Sensor(d, shape, d * 2e-3)).missing
            assert found.share == pytest.approx(share, abs=2e-3)
            assert ("outside the views' pictures" in found.reason) == (share > 0)


def test_what_is_missing_in_words():
    """Of 100 asked for, 80 fall into the views and 60 into their pictures: 20 and 20 are lost."""
    found = Missing.of(np.array([100.0, 80.0, 60.0]), "the stop")
    assert found.share == pytest.approx(0.4)
    assert found.reason == (
        "20.0% of the light that passes the stop lies outside the grid of views; "
        "20.0% lies outside the views' pictures"
    )
    little = Missing.of(np.array([1000.0, 999.5, 999.0]), "")
    assert (little.share, little.reason) == (pytest.approx(1e-3), "")
    assert Missing.of(np.array([1000.0, 998.0, 998.0]), "s").reason.startswith("0.2% of the light")
    assert Missing.of(np.zeros(3), "").share == 0
    assert Missing.of(np.array([0.5, 0.5, 0.25]), "").share == 0.5


def test_what_one_mask_of_many_lacks_is_what_its_camera_lacks():
    """Of cells all over a sheet twice as wide as the grid of views, with a lens that has a rim."""
    code = RANDOM.random((4, 4))

    def asked(values):
        return missing([vcc.Lens(50 * mm, 13 * mm), vcc.Mask(values, 14 * mm, z=1 * mm, decentre=(1 * mm, 0.0))])

    every = asked(np.ones((4, 4)))
    cells = [Cells(values, 14 * mm) for values in (code, np.eye(4))]
    found = every.missing_with(1, cells)
    for values, one in zip((code, np.eye(4)), found, strict=True):
        own = asked(values).missing
        assert one.share == pytest.approx(own.share, abs=2e-3)
        assert own.share > 0.1
    (alone,) = every.missing_with(1, cells[:1])
    assert alone.share == found[0].share


# --- filters that give sharpness back ---


@pytest.mark.parametrize("refine", [1, 2])
@pytest.mark.parametrize("sample", ["point", "mean"])
@pytest.mark.parametrize(
    "step",
    [
        np.diag([0.8, -0.7]),
        np.diag([1.6, 1.5]),
        np.array([[0.8, 0.3], [-0.25, 0.9]]),
        np.array([[0.7, -0.4], [0.5, 0.8]]),
    ],
)
def test_a_bright_sample_is_as_wide_as_what_nobody_gives_back(step, sample, refine):
    """Second moments: the mean over a sensitive area of ¾ pixel, less what the sample's own averaging took.

    Filters are fitted over all frequencies: of second moments that are to be given back they miss up to a tenth.
    """
    taps = 7
    offsets = np.linspace(0, 1, taps, endpoint=False)
    interpolation = "linear" if refine == 1 and step[0, 0] < 1.25 else "spline" if refine == 1 else "linear"
    one = np.ones((1, 1))
    core = Footprints(
        (41, 41), interpolation, 1.0, np.zeros(1, int), np.zeros(1, int), one, 20 * one, 20 * one, step, (1, 1),
        refine=refine, opening=0.75,
    )  # fmt: skip
    made = Sharpened.of(core, sample, Sharpened.choose(core, sample))
    found, places = np.zeros((2, 2)), np.arange(41.0)
    for dx, dy in itertools.product(offsets, offsets):
        moved = replace(made.core, x=core.x + dx, y=core.y + dy)
        raster = reference.run(moved, np.ones((1, 1, 1, 1)), threads=1).values
        if made.along is not None:
            picture = AlongAxes(*made.along, "").apply(raster)[..., 0]
        else:
            picture = convolve(raster[..., 0], made.plane, mode="same")
        light = picture.sum()
        away = places - 20 - dx, places - 20 - dy
        x2, y2 = (picture.sum(axis=axis) @ at**2 / light for axis, at in zip((0, 1), away, strict=True))
        xy = away[1] @ picture @ away[0] / light
        found += np.array([[x2, xy], [xy, y2]]) / taps**2
    wanted = 0.75**2 / 12 * np.eye(2) - (step @ step.T / 12 if sample == "mean" else 0)
    lost = np.abs(step @ step.T).max() * (1 / 4 if sample == "mean" else 1 / 6)
    np.testing.assert_allclose(found, wanted, atol=0.12 * lost)
    reach = max(map(len, made.along)) // 2 if made.along is not None else max(made.plane.shape) // 2
    assert made.reach == reach > 0
    assert Sharpened(core).reach == 0


def test_filters_come_nearest_to_what_is_wanted():
    """Of other weights none errs less, frequencies counting as 1/ν² from a twentieth of a cycle on."""

    def wanted(*frequencies):
        return np.prod(
            [1 + 0.8 * np.sin(np.pi * f) ** 2 + 0.3 * np.sin(np.pi * f) ** 4 for f in frequencies], axis=0
        )

    def err(kernel, frequency):
        orders = [np.arange(n) - n // 2 for n in kernel.shape]
        waves = [np.exp(2j * np.pi * np.outer(f, order)) for f, order in zip(frequency, orders, strict=True)]
        gain = np.einsum("fr,rc,fc->f", waves[0], kernel, waves[1]).real
        return np.sum(((gain - wanted(*frequency)) / np.maximum(np.hypot(*frequency), 0.05) ** 2) ** 2)

    line = (np.arange(96) + 0.5) / 192
    fy, fx = (each.ravel() for each in np.meshgrid(*[(np.arange(24) + 0.5) / 24 - 0.5] * 2, indexing="ij"))
    made = (
        (symmetric(wanted, 2)[None], (0 * line, line)),
        (symmetric_plane(lambda x, y: wanted(x, y), (2, 1)), (fy, fx)),
    )
    for kernel, frequency in made:
        assert kernel.sum() == pytest.approx(1)
        np.testing.assert_allclose(kernel, kernel[::-1, ::-1], atol=1e-12)
        least = err(kernel, frequency)
        for place in np.ndindex(kernel.shape):
            change = np.zeros(kernel.shape)
            change[place] += 1e-4
            change += change[::-1, ::-1]
            change[kernel.shape[0] // 2, kernel.shape[1] // 2] -= change.sum()
            for sign in (-1, 1) if change.any() else ():
                assert err(kernel + sign * change, frequency) > least


def test_rasters_have_as_many_points_as_there_is_room_for():
    """Sixteen across a rectangle, or half of that, or a quarter, as soon as they fit."""
    for side in np.geomspace(1.0, 1e5, 40):
        raster = _raster(np.array([-side / 2, side / 2]), 1.0, np.inf)
        if raster is None:
            continue
        across = round(1 / raster.step)
        covered = side + 1 + 2 * (1 + 0.25 * side)
        options = [n for n in (16, 8, 4, 2, 1) if n >= FEWEST_PER_CELL]
        assert across == next((n for n in options if covered * n <= RASTER_LIMIT), options[-1])
        assert raster.places.size == pytest.approx(covered * across, abs=2)


def test_points_of_textures_are_alike_where_they_are_as_many_and_almost_as_close():
    points = Points(257, (-1.0, -2.0), (0.1, 0.2), 1e-6)
    assert points.like(replace(points, spacing=(0.14, 0.2), start=(0.0, 0.0), error=1.0))
    assert not points.like(replace(points, spacing=(0.1, 0.5)))
    for size in (256, 513):
        assert not points.like(replace(points, size=size))
    low, high = np.array([-1.1, -2.2]), np.array([-1 + 25.7, -2 + 51.4])
    assert points.holds(low + 1e-9, high - 1e-9)
    for axis in (0, 1):
        beyond = np.eye(2)[axis] * 1e-6
        assert not points.holds(low - beyond, high - 1)
        assert not points.holds(low + 1, high + beyond)


# --- what may be chosen, and plans as values ---


@pytest.mark.parametrize(
    "wrong",
    [
        {"scene_distance": 0.0}, {"scene_distance": 1.0, "between_views": "depth"}, {"refine": 0}, {"refine": 9},
        {"refine": 1.5}, {"refine": "all"}, {"samples": 1}, {"samples": 2**16 + 1}, {"tolerance": 0.0},
        {"seed": -1}, {"engine": "gpu"}, {"threads": 0}, {"memory_limit": 0}, {"memory_limit": -1.0},
        {"interpolation": "no"},
    ],
)  # fmt: skip
def test_options_that_do_not_exist_are_refused(wrong):
    with pytest.raises(vcc.InputError, match=next(iter(wrong))):
        How(**wrong)


def test_options_that_do():
    How(scene_distance=math.inf, refine=8, samples=2, seed=0, threads=1, memory_limit=1, tolerance=1e-9)
    How(refine=1, samples=2**16, between_views="depth", engine="cuda", memory_limit=math.inf)
    assert How().rays_a_pixel is None
    assert [How(samples=n).rays_a_pixel for n in (2, 3, 4, 5, 65)] == [2, 4, 4, 8, 128]
    assert How(threads=3).workers == 3
    assert How().workers == cores() >= 1
    assert How.of(None, {"refine": 2}) == How(refine=2)
    assert How.of(How(seed=3), {}) == How(seed=3)
    with pytest.raises(vcc.InputError, match="did you mean samples"):
        How.of(None, {"sample": 3})
    with pytest.raises(vcc.InputError, match=r"how is a vcc\.How"):
        How.of({"seed": 1}, {})


@dataclass(frozen=True, eq=False)
class Looking:
    """A core that looks at some views and pixels."""

    views: np.ndarray
    pixels: np.ndarray
    method: str = "rays"

    def used_views(self, shape):
        assert self.views.shape == tuple(shape[:2])
        return self.views

    def used_pixels(self, shape):
        assert self.pixels.shape[:2] == tuple(shape[:2])
        return self.pixels


def test_views_and_pixels_that_are_looked_at_are_told_without_a_border_that_is_put_around():
    views = np.zeros((4, 6), bool)
    views[1, 3] = views[0, 0] = True
    pixels = np.zeros((4, 6, 2, 2), dtype=int)
    pixels[1, 3] = [[4, 7], [5, 30]]
    border = DarkBorder(((1, 0), (1, 2), (2, 0), (1, 1)))
    sharpen = SharpenViews.of("point")
    plan = Plan((5, 5), (3, 3, 9, 9), Looking(views, pixels), before=(sharpen, border))
    assert plan.shape((3, 3, 9, 9)) == (4, 6, 11, 11)
    assert plan.reach == sharpen.reach == 2
    assert plan.halo == border.halo
    assert np.argwhere(plan.used_views((3, 3, 9, 9))).tolist() == [[0, 2]]
    # rows 4 to 7 are 2 to 5 without the border, and 0 to 7 with what the filter looks at
    assert plan.used_pixels((3, 3, 9, 9))[0, 2].tolist() == [[0, 7], [2, 9]]
    dark = replace(plan, core=Looking(np.zeros((4, 6), bool), pixels))
    assert dark.used_views((3, 3, 9, 9)).all()
    assert plan.kept_as(np.dtype(np.uint8)) == (np.dtype(np.int16), 2.0**-5)
    assert replace(plan, before=()).kept_as(np.dtype(np.float16)) == (np.dtype(np.float32), 1.0)
    assert replace(plan, before=()).reach == 0
    assert replace(plan, before=()).halo == ((0, 0),) * 4


def test_numbers_of_plans_are_put_back_by_their_names():
    blur = BlurViews(RANDOM.random((3, 5)))
    lines = AlongAxes(np.array([0.1, 0.8, 0.1]), np.ones(1), "words", (0.5, 0.25))
    camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(52 * mm, (4, 5), 0.1 * mm))
    field = vcc.LightField.from_views(np.ones((2, 2, 6, 6)), 1 * mm, 0.01)
    plan = replace(camera.compile(field, interpolation="linear"), before=(blur,), after=(lines,))
    numbers = plan.parameters()
    assert {"core.x", "core.scale", "before[0].kernel", "after[0].down", "after[0].half_widths"} <= set(numbers)
    assert plan.smear == (0.5, 0.25)
    changed = plan.with_parameters({name: value + 1 for name, value in numbers.items()})
    for name, value in changed.parameters().items():
        np.testing.assert_allclose(value, numbers[name] + 1, rtol=1e-6, err_msg=name)
    assert plan.with_parameters({}).parameters().keys() == numbers.keys()
    with pytest.raises(KeyError, match="nothing"):
        plan.with_parameters({"core.nothing": 1.0})
    plan.check_fits(camera, field.grid)
    other = vcc.Camera([vcc.Lens(60 * mm)], camera.sensor)
    elsewhere = vcc.LightField.from_views(np.ones((2, 2, 6, 6)), 2 * mm, 0.01).grid
    larger = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(52 * mm, (5, 5), 0.1 * mm))
    more = vcc.LightField.from_views(np.ones((2, 2, 6, 7)), 1 * mm, 0.01).grid
    for camera_given, grid, words in (
        (other, field.grid, "another camera"),
        (camera, elsewhere, "another frame"),
        (larger, field.grid, "sensor of 4×5 pixels"),
        (camera, more, "2×2×6×6 samples, not 4×5 and 2×2×6×7"),
    ):
        with pytest.raises(vcc.InputError, match=words):
            plan.check_fits(camera_given, grid)
