"""Several patterns in one plane: their product's mean against closed forms and against a fine sum over points."""

from __future__ import annotations

import numpy as np
import pytest

from vcc.base.units import mm
from vcc.shapes import patterns
from vcc.shapes.patterns import Bounded, Cells, Circle, CosineSum, Open, Polygon, as_pattern
from vcc.shapes.stacked_patterns import Product, Shifted, Tiles, in_one_plane, not_clear_next_to_others

CHECKERS = np.indices((8, 8)).sum(axis=0) % 2.0
GRID = np.linspace(-5 * mm, 5 * mm, 43)[None, :], np.linspace(-4.6 * mm, 5.2 * mm, 37)[:, None]
PLACES = np.random.default_rng(0).uniform(-5 * mm, 5 * mm, (2, 60))


def by_points(pattern, x, y, width, height, points=200):
    """The mean over each rectangle as a plain sum over its points."""
    steps = (np.arange(points) + 0.5) / points - 0.5
    x, y = np.broadcast_arrays(x, y)
    px = x[..., None, None] + width * steps[None, :]
    py = y[..., None, None] + height * steps[:, None]
    return pattern(px, py).mean(axis=(-2, -1))


@pytest.mark.parametrize("places", [GRID, PLACES])
def test_a_checkerboard_and_its_negative_pass_nothing(places):
    both = Product((Cells(CHECKERS, 8 * mm), Cells(1 - CHECKERS, 8 * mm)))
    np.testing.assert_array_equal(both.mean(*places, 0.7 * mm, 0.4 * mm), 0.0)


@pytest.mark.parametrize("places", [GRID, PLACES])
def test_a_checkerboard_twice_is_the_checkerboard(places):
    one = Cells(CHECKERS, 8 * mm)
    np.testing.assert_allclose(
        Product((one, one)).mean(*places, 0.7 * mm, 0.4 * mm), one.mean(*places, 0.7 * mm, 0.4 * mm), atol=1e-12
    )


def test_two_square_roots_of_cells_are_the_cells():
    values = np.random.default_rng(1).random((7, 9))
    root = Cells(np.sqrt(values), 9 * mm)
    expected = Cells(values, 9 * mm).mean(*GRID, 1.1 * mm, 0.9 * mm)
    np.testing.assert_allclose(Product((root, root)).mean(*GRID, 1.1 * mm, 0.9 * mm), expected, atol=1e-12)


def test_cells_of_different_sizes_and_places_multiply_exactly():
    # 200 points a side see an edge to 1/200 of a rectangle; 2 to 4 edges cross one
    rng = np.random.default_rng(2)
    one, other = (
        Cells(rng.random((5, 6)), 7 * mm),
        Cells(rng.random((4, 9)), 6 * mm, 5 * mm, (0.6 * mm, -0.3 * mm)),
    )
    both = Product((one, Shifted(other, (0.2 * mm, 0.1 * mm)), Bounded(Open(), 5 * mm, 6 * mm)))
    x, y = PLACES
    found = both.mean(x, y, 1.3 * mm, 0.8 * mm)
    np.testing.assert_allclose(found, by_points(both, x, y, 1.3 * mm, 0.8 * mm), atol=4 / 200)
    assert np.abs(found - by_points(both, x, y, 1.3 * mm, 0.8 * mm)).mean() < 1 / 400
    np.testing.assert_allclose(both.mean(x[None, :], y[:, None], 1.3 * mm, 0.8 * mm).diagonal(), found, atol=1e-12)


def test_a_hole_over_cells_is_right_to_the_rasters_points():
    # 16×16 points a rectangle: where rim and edge cross one point, a quarter of it at most is wrong. At
    # worst the rim runs along an edge, as it does here at (±3 mm, 0): then 16 of the 256 are.
    both = Product((Circle(6 * mm), Cells(CHECKERS, 8 * mm)))
    places = GRID[0][:, ::3], GRID[1][::3]
    found = both.mean(*places, 0.7 * mm, 0.5 * mm)
    assert np.abs(found - by_points(both, *places, 0.7 * mm, 0.5 * mm)).max() < 16 * 0.25 / 256 + 1 / 200


@pytest.mark.parametrize("middle", [(0.0, 0.0), (0.4 * mm, -0.3 * mm)])
@pytest.mark.parametrize("hole", [Circle(6 * mm), Polygon(5, 6 * mm, 0.2)])
def test_a_hole_twice_is_the_hole(hole, middle):
    once, twice = in_one_plane([(hole, middle)]), in_one_plane([(hole, middle)] * 2)
    np.testing.assert_array_equal(twice.mean(*GRID, 0.7 * mm, 0.5 * mm), once.mean(*GRID, 0.7 * mm, 0.5 * mm))


def test_a_function_twice_is_its_square():
    def slow(x, y):
        return 0.5 + 0.5 * np.cos(2 * np.pi * (x + 0.4 * y) / (3 * mm))

    both = Product((as_pattern(slow), as_pattern(slow)))
    squared = as_pattern(lambda x, y: slow(x, y) ** 2)
    np.testing.assert_allclose(
        both.mean(*GRID, 0.6 * mm, 0.6 * mm), squared.mean(*GRID, 0.6 * mm, 0.6 * mm), rtol=1e-12
    )


def test_cosines_multiply_within_the_rasters_curvature():
    # A mean over 1/16 of a rectangle w stands for a point: cos² misses (2π/P·w/16)²/12 of itself at most.
    period, width = 2 * mm, 0.8 * mm
    one = CosineSum((period, np.inf))
    closed = as_pattern(lambda x, y: (0.5 + 0.5 * np.cos(2 * np.pi * x / period)) ** 2 + 0 * y)
    found = Product((one, one)).mean(*GRID, width, width)
    bound = (2 * np.pi / period * width / 16) ** 2 / 12 * 2
    # Of 80 points the sum itself is off by (2π/P·w/80)²/24 at most, 4e-5.
    assert np.abs(found - by_points(closed, *GRID, width, width, points=80)).max() < bound + 1e-4


def test_what_stands_apart_passes_nothing():
    apart = Product((Shifted(Tiles.sheet(1 * mm, 1 * mm), (3 * mm, 0.0)), Tiles.sheet(1 * mm, 1 * mm)))
    assert not apart.mean(*GRID, 0.5 * mm, 0.5 * mm).any()
    assert not apart(*GRID).any()


def test_a_single_pattern_in_the_middle_of_a_plane_stays_itself():
    hole = Circle(3 * mm)
    assert in_one_plane([(hole, (0.0, 0.0))]) is hole
    moved = in_one_plane([(hole, (1 * mm, 0.0))])
    assert moved.size == (5 * mm, 3 * mm)
    np.testing.assert_array_equal(moved(*GRID), hole(GRID[0] - 1 * mm, GRID[1]))


def test_a_round_hole_that_is_clear_all_over_another_pattern_says_nothing():
    narrow, wide = patterns.Circle(2 * mm), patterns.Circle(20 * mm)
    here, aside, cells = (1 * mm, 0.0), (0.0, 8 * mm), patterns.Cells(np.eye(4), 3 * mm, 3 * mm)
    assert not_clear_next_to_others([(narrow, here), (wide, aside)]) == (0,)
    assert not_clear_next_to_others([(wide, aside), (cells, here)]) == (1,)
    # It cuts a corner; and of two that are one, one stays.
    assert not_clear_next_to_others([(narrow, here), (wide, (0.0, 9.6 * mm))]) == (0, 1)
    assert not_clear_next_to_others([(narrow, here), (narrow, here)]) == (0, 1)
