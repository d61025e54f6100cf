"""Rectangles along the axes that tile the plane as a lattice's parallelograms do."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Of a cell's area: a second rectangle below it is rounding."""


class Tile(NamedTuple):
    """A rectangle of a cell: its middle from that of the cell, its size, and its share of the cell's area."""

    x: float
    y: float
    width: float
    height: float
    share: float


def tiles_of(step: Array) -> tuple[Tile, ...]:
    """One rectangle, or two, whose copies at all points of a lattice cover the plane once.

    Two vectors (a, b) and (−c, d) of the lattice, none of a, b, c, d below 0, have cells of area a·d + b·c: a
    rectangle of a×d and one of c×b side by side, as squares on the sides of a right-angled triangle tile the plane
    (the Pythagorean tiling). So means over cells of any lattice can be had from means over rectangles, and their sum
    over the plane is exact. Their common middle is that of the cell.

    Args:
        step: 2×2, the vectors of the lattice as columns, linearly independent.
    """
    return min(_coverings(_reduced(np.asarray(step, dtype=np.float64))), key=_spread)


def _reduced(step: Array) -> Array:
    """Two short vectors of the same lattice (Lagrange's reduction)."""
    one, other = step.T
    while True:
        if one @ one > other @ other:
            one, other = other, one
        times = np.rint(one @ other / (one @ one))
        if times == 0:
            return np.stack([one, other], axis=1)
        other = other - times * one


def _coverings(step: Array) -> list[tuple[Tile, ...]]:
    """The coverings by all pairs of short vectors of a lattice that lie as `tiles_of` wants them."""
    found = []
    for mixed in product((-1.0, 0.0, 1.0), repeat=4):
        change = np.array(mixed).reshape(2, 2)
        if abs(round(np.linalg.det(change))) != 1:
            continue
        (a, c), (b, d) = step @ change  # vectors (a, b) and (c, d)
        rounding = ROUNDING * a * d
        if a <= 0 or d <= 0 or b * c > rounding:
            continue
        if b * c >= -rounding:
            corners = [(0.0, 0.0, a, d)]
        elif b > 0:
            corners = [(0.0, 0.0, a, d), (a, 0.0, -c, b)]
        else:  # the mirror image
            corners = [(0.0, -d, a, d), (a, b, c, -b)]
        found.append(_about_their_middle(np.array(corners)))
    return found


def _about_their_middle(corners: Array) -> tuple[Tile, ...]:
    """Tiles from rows of (left, top, width, height)."""
    size = corners[:, 2:]
    share = size.prod(axis=1) / size.prod(axis=1).sum()
    middle = corners[:, :2] + size / 2
    middle = middle - share @ middle
    return tuple(Tile(*map(float, row)) for row in np.column_stack([middle, size, share]))


def _spread(tiles: tuple[Tile, ...]) -> float:
    """The mean square distance from the middle: the smaller, the more compact."""
    return sum(tile.share * (tile.x**2 + tile.y**2 + (tile.width**2 + tile.height**2) / 12) for tile in tiles)
