"""Means of patterns are linear in the values of their cells; `mean_back` is the transpose of that map.

Oracle: the means themselves, ⟨w, mean(values + change) − mean(values)⟩ = ⟨mean_back(w), change⟩, exact because
the map is linear.
"""

from __future__ import annotations

import numpy as np
import pytest

from vcc.base.units import mm
from vcc.plan.footprints.means import Boxes, choose_mean, mean_back, mean_over
from vcc.shapes.mean_back import holds
from vcc.shapes.patterns import Bounded, Cells, Circle, CosineSum, as_pattern
from vcc.shapes.stacked_patterns import Product, Shifted, in_one_plane

OTHER = Cells(np.random.default_rng(5).random((4, 3)), 5 * mm, 7 * mm, (0.3 * mm, -0.4 * mm))

PATTERNS = {
    "cells": lambda cells: cells,
    "shifted": lambda cells: Shifted(cells, (1 * mm, -0.6 * mm)),
    "bounded": lambda cells: Bounded(cells, 4 * mm, 9 * mm),
    "behind a round stop": lambda cells: in_one_plane(
        [(Circle(5 * mm), (0.0, 0.0)), (cells, (0.2 * mm, 0.1 * mm))]
    ),
    "with other cells": lambda cells: Product((OTHER, Shifted(cells, (0.5 * mm, 0.0)))),
    "with other cells, a sheet and a stop": lambda cells: Product(
        (OTHER, Bounded(cells, 4.5 * mm, 4 * mm), Shifted(Circle(5 * mm), (0.4 * mm, 0.0)))
    ),
    "with a function": lambda cells: Product(
        (as_pattern(lambda x, y: 0.5 + 0.5 * np.cos(x * 900 + y * 700)), cells)
    ),
    "with cosines": lambda cells: Product((CosineSum(3 * mm), cells)),
}
PLACES = {
    "a grid": (np.linspace(-4, 4, 9)[None, :] * mm, np.linspace(-3, 5, 7)[:, None] * mm),
    "places": tuple(np.random.default_rng(2).uniform(-4, 4, (2, 5, 6)) * mm),
    "two far apart": (np.array([-2.0, 2.1]) * mm, np.array([1.0, -1.3]) * mm),
}


@pytest.mark.parametrize("size", [(1.7 * mm, 0.9 * mm), (0.25 * mm, 0.3 * mm), (12 * mm, 9 * mm)])
@pytest.mark.parametrize("where", PLACES)
@pytest.mark.parametrize("name", PATTERNS)
def test_it_is_the_transpose_of_the_mean(name, where, size):
    generator = np.random.default_rng(1)
    x, y = PLACES[where]
    values = generator.uniform(0.2, 0.8, (5, 6))
    change = generator.uniform(-0.1, 0.1, values.shape)
    cells = Cells(values, 6 * mm, 5 * mm)
    pattern = PATTERNS[name](cells)
    weights = generator.standard_normal(np.broadcast_shapes(x.shape, y.shape))
    changed = PATTERNS[name](Cells(values + change, 6 * mm, 5 * mm))
    boxes = Boxes(x, y, *size)
    chosen = choose_mean(pattern, boxes)
    difference = mean_over(changed, boxes, chosen) - mean_over(pattern, boxes, chosen)
    back = mean_back(pattern, boxes, chosen, weights, cells)
    assert back.shape == values.shape
    assert np.sum(weights * difference) == pytest.approx(np.sum(back * change), rel=1e-9, abs=1e-12)


def test_places_without_any_size_read_the_cell_that_holds_them():
    cells = Cells(np.random.default_rng(1).random((5, 6)), 6 * mm, 5 * mm)
    x, y = np.array([0.5, -1.5]) * mm, np.array([1.0, -2.0]) * mm
    back = mean_back(cells, Boxes(x, y, 0.0, 0.0), None, np.array([2.0, 3.0]), cells)
    wanted = np.zeros((5, 6))
    wanted[3, 3], wanted[0, 1] = 2, 3
    np.testing.assert_allclose(back, wanted, atol=1e-12)


def test_what_holds_the_cells_is_told_by_identity():
    cells = Cells(np.ones((2, 2)), 1 * mm)
    assert holds(PATTERNS["with other cells, a sheet and a stop"](cells), cells)
    assert not holds(PATTERNS["cells"](Cells(np.ones((2, 2)), 1 * mm)), cells)
    assert not holds(None, cells)
