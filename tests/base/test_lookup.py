"""Values between grid points against planes, which bilinear interpolation gives exactly, and against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from vcc.base.lookup import bilinear, smooth, smooth_back, three_around


def test_a_plane_is_exact_between_points_and_held_beyond_the_edges():
    row, column = np.mgrid[:4, :5]
    plane = 1.0 + 2 * row + 3 * column
    y, x = np.array([-1.0, 0.0, 0.25, 2.9, 3.0, 7.0]), np.array([-0.5, 0.0, 3.75, 1.1, 4.0, 9.0])
    expected = 1 + 2 * np.clip(y, 0, 3) + 3 * np.clip(x, 0, 4)
    np.testing.assert_allclose(bilinear(plane, y, x), expected, rtol=1e-14)
    np.testing.assert_allclose(bilinear(plane, y[:, None], x)[2, 3], 1 + 2 * 0.25 + 3 * 1.1, rtol=1e-14)
    np.testing.assert_allclose(bilinear(plane, 0.5, np.inf), 1 + 2 * 0.5 + 3 * 4, rtol=1e-14)


@pytest.mark.parametrize("shape", [(6, 7), (1, 7), (6, 1), (1, 1)])
def test_several_numbers_at_a_point_are_looked_up_alike(shape: tuple[int, int]):
    random = np.random.default_rng(3)
    values = random.random((*shape, 2))
    y, x = (random.uniform(-2, size + 1, (5, 40)) for size in shape)
    expected = [map_coordinates(values[..., n], [y, x], order=1, mode="nearest") for n in range(2)]
    np.testing.assert_allclose(bilinear(values, y, x), np.stack(expected, axis=-1), atol=1e-14)


@pytest.mark.parametrize("shape", [(6, 7), (1, 7), (2, 2), (1, 1)])
def test_quadratic_splines_are_scipys_and_dark_outside(shape: tuple[int, int]):
    random = np.random.default_rng(4)
    values = random.random(shape)
    y, x = (random.uniform(-3, size + 2, 400) for size in shape)
    expected = map_coordinates(values, [y, x], order=2, mode="grid-constant", prefilter=False)
    np.testing.assert_allclose(smooth(values, y, x), expected, atol=1e-14)
    assert smooth(values, np.inf, 0.0) == smooth(values, 0.0, -1e300) == 0


def test_the_slopes_of_splines_are_those_between_places_nearby():
    place = np.random.default_rng(5).uniform(-2.5, 7.5, 300)
    (_, more, _), (_, less, _), (_, _, slopes) = (three_around(place + by, 6) for by in (1e-6, -1e-6, 0.0))
    same = np.floor(place + 0.5 + 1e-6) == np.floor(place + 0.5 - 1e-6)
    np.testing.assert_allclose(((more - less) / 2e-6)[:, same], slopes[:, same], atol=1e-9)


def test_splines_backwards():
    random = np.random.default_rng(6)
    values, weights = random.random((5, 6)), random.normal(size=(30, 40))
    row, column = random.uniform(-2, 6, (30, 1)), random.uniform(-2, 7, (1, 40))
    of_values, of_row, of_column = smooth_back(values, row, column, weights)
    other = random.random((5, 6))
    np.testing.assert_allclose((of_values * other).sum(), (weights * smooth(other, row, column)).sum(), rtol=1e-13)
    for found, by in ((of_row, (1e-6, 0)), (of_column, (0, 1e-6))):
        over, under = (smooth(values, row + sign * by[0], column + sign * by[1]) for sign in (1, -1))
        np.testing.assert_allclose(found, weights * (over - under) / 2e-6, atol=1e-5)
