"""A plate's slopes are linear in the known paths of its surface; `paths_back` is the transpose of that map.

Oracle: the slopes themselves, of a changed surface less those of the surface.
"""

from __future__ import annotations

import numpy as np
import pytest

from vcc.base.units import mm
from vcc.shapes.height_maps import HeightMap, PathMap

SHEETS = {
    "as large as the places": (8 * mm, np.linspace(-4, 4, 33) * mm, np.linspace(-3, 3, 25) * mm),
    "smaller than the places": (3 * mm, np.linspace(-4, 4, 40) * mm, np.linspace(-3, 3, 31) * mm),
    "larger, off the middle": (20 * mm, np.linspace(1, 4, 12) * mm, np.linspace(-3, -1, 7) * mm),
}


@pytest.mark.parametrize("where", SHEETS)
@pytest.mark.parametrize("cells", [(4, 4), (9, 12)])
def test_it_is_the_transpose_of_the_slopes(cells, where):
    width, columns, rows = SHEETS[where]
    x, y = columns[None, :], rows[:, None]
    generator = np.random.default_rng(3)
    paths, change = generator.standard_normal((2, *cells)) * 1e-5
    weights = generator.standard_normal((2, y.size, x.size))
    one, other = PathMap(paths, width), PathMap(paths + change, width)
    difference = np.array(other.slopes(x, y)) - np.array(one.slopes(x, y))
    back = one.paths_back(x, y, (weights[0], weights[1]))
    assert np.sum(weights * difference) == pytest.approx(np.sum(back * change), rel=1e-9, abs=1e-14)


def test_glass_has_a_factor():
    assert HeightMap(np.zeros((4, 4)), 1 * mm, refractive_index=1.7).factor == pytest.approx(0.7)
