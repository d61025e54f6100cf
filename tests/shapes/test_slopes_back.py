"""Slopes that are linear in many numbers of their surface; `slopes_back` is the transpose of that map.

Oracle: the slopes themselves, of a changed surface less those of the surface.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from vcc.base.units import mm, nm
from vcc.shapes.height_maps import HeightMap, PathMap
from vcc.shapes.surface import Surface
from vcc.shapes.zernike import Zernike

SHEETS = {
    "as large as the places": (8 * mm, np.linspace(-4, 4, 33) * mm, np.linspace(-3, 3, 25) * mm),
    "smaller than the places": (3 * mm, np.linspace(-4, 4, 40) * mm, np.linspace(-3, 3, 31) * mm),
    "larger, off the middle": (20 * mm, np.linspace(1, 4, 12) * mm, np.linspace(-3, -1, 7) * mm),
}


def assert_transposed(one: Surface, change: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> None:
    x, y = columns[None, :], rows[:, None]
    weights = np.random.default_rng(5).standard_normal((2, y.size, x.size))
    known = np.asarray(getattr(one, one.linear_in))
    given = known + change
    other = dataclasses.replace(one, **{one.linear_in: given if known.ndim > 1 else tuple(given)})
    difference = np.array(other.slopes(x, y)) - np.array(one.slopes(x, y))
    back = one.slopes_back(x, y, (weights[0], weights[1]))
    assert back.shape == known.shape
    assert np.sum(weights * difference) == pytest.approx(np.sum(back * change), rel=1e-9, abs=1e-14)


@pytest.mark.parametrize("where", SHEETS)
@pytest.mark.parametrize("cells", [(4, 4), (9, 12)])
def test_paths_and_heights_on_a_sheet(cells, where):
    width, columns, rows = SHEETS[where]
    paths, change = np.random.default_rng(3).standard_normal((2, *cells)) * 1e-5
    assert_transposed(PathMap(paths, width), change, columns, rows)
    assert_transposed(HeightMap(paths, width, refractive_index=1.7), change, columns, rows)


@pytest.mark.parametrize("where", SHEETS)
def test_zernike_coefficients_those_of_0_too(where):
    width, columns, rows = SHEETS[where]
    coefficients, change = np.random.default_rng(4).standard_normal((2, 28)) * 200 * nm
    coefficients[[0, 3, 11, 27]] = 0
    assert_transposed(Zernike(tuple(coefficients), width), change, columns, rows)


def test_other_surfaces_say_that_they_have_none():
    class Flat(Surface):
        def path(self, x, y):
            return x * 0

        def slopes(self, x, y):
            return x * 0, y * 0

    assert Flat().linear_in is None
    with pytest.raises(NotImplementedError, match="Flat"):
        Flat().slopes_back(np.zeros((1, 1)), np.zeros((1, 1)), (np.zeros((1, 1)), np.zeros((1, 1))))
