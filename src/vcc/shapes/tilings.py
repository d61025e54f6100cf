"""Axis-parallel rectangles that tile the plane like the parallelograms of a lattice."""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ALIKE = 1e-6
"""Coverings whose spreads differ by a smaller share are equally compact."""
ROUNDING = 1e-9
"""Share of a cell's area below which a second rectangle counts as rounding."""


class Tile(NamedTuple):
    """A rectangle of a cell: its middle relative to the cell's, its size, and its weight in the cell's mean."""

    x: float
    y: float
    width: float
    height: float
    share: float


def tiles_of(step: Array) -> tuple[Tile, ...]:
    """Rectangles, weighted, whose copies at all points of a lattice cover the plane uniformly.

    Two vectors (a, b) and (−c, d) of the lattice, none of a, b, c, d below 0, have cells of area a·d + b·c: a
    rectangle of a×d and one of c×b side by side, as squares on the sides of a right-angled triangle tile the plane
    (the Pythagorean tiling). So means over cells of any lattice can be computed from means over rectangles, and
    their sum over the plane is exact. The smaller rectangle may be on either side of the larger one: both sides
    are used, with half the weight, so that cameras and their mirror images are treated alike.

    Args:
        step: 2×2, the vectors of the lattice as columns, linearly independent.
    """
    coverings = _coverings(_reduced(np.asarray(step, dtype=np.float64)))
    spreads = np.array([_spread(tiles) for tiles in coverings])
    best = [
        tiles for tiles, spread in zip(coverings, spreads, strict=True) if spread <= spreads.min() * (1 + ALIKE)
    ]
    weights: dict[tuple[float, float, float, float], float] = {}  # of squares rotated by 45 degrees, all
    for tile in (tile for tiles in best for tile in tiles):
        place = next((one for one in weights if np.allclose(one, tile[:4], atol=ALIKE * tile.width)), tile[:4])
        weights[place] = weights.get(place, 0.0) + tile.share / len(best)
    return tuple(Tile(*place, share) for place, share in weights.items())


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
    """The coverings by all pairs of short vectors of a lattice with the orientation that `tiles_of` requires."""
    found: list[tuple[Tile, ...]] = []
    for mixed in product((-1.0, 0.0, 1.0), repeat=4):
        change = np.array(mixed).reshape(2, 2)
        if abs(round(np.linalg.det(change))) != 1:
            continue
        (a, c), (b, d) = step @ change  # vectors (a, b) and (c, d)
        rounding = ROUNDING * a * d
        if a <= 0 or d <= 0 or b * c > rounding:
            continue
        if b * c >= -rounding:
            found.append((Tile(0.0, 0.0, float(a), float(d), 1.0),))
            continue
        area = a * d - b * c
        large = Tile(0.0, 0.0, float(a), float(d), float(a * d / area))
        # To the right and below, flush with a corner; (c, d) is the vector between them.
        beside = np.array([a + abs(c), math.copysign(1, b) * (abs(b) - d)]) / 2
        below = np.array([math.copysign(1, b) * (a - abs(c)), d + abs(b)]) / 2
        for x, y in (beside, below):
            half = [
                Tile(float(s * x), float(s * y), float(abs(c)), float(abs(b)), float(-b * c / area / 2))
                for s in (-1, 1)
            ]
            found.append((large, *half))
    return found


def _spread(tiles: tuple[Tile, ...]) -> float:
    """The mean square distance from the middle: the smaller, the more compact."""
    return sum(tile.share * (tile.x**2 + tile.y**2 + (tile.width**2 + tile.height**2) / 12) for tile in tiles)
