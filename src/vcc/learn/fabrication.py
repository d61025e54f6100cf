"""Binary codes that can be made: a number of open cells, no feature that is too small, and symmetry.

Open cells are holes, and closed cells are bars; what surrounds the code is closed. No feature is smaller than
k × k cells if both the holes and the bars equal their morphological opening by a square of k × k cells (Serra,
Image Analysis and Mathematical Morphology, 1982), and no two holes touch at a corner, where a bar has the width 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.cached import cached
from vcc.base.errors import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MIRRORS = {"none": (), "left-right": (1,), "both": (0, 1)}
"""The axes of (rows, columns) that each symmetry reverses."""
MOST_NODES = 60
"""Partial codes that a search extends before it starts again."""
ATTEMPTS = 40
"""Searches; all but the first one start from disturbed scores."""


@dataclass(frozen=True)
class Fabrication:
    """What a code of square cells must keep.

    Args:
        cells: across and down.
        share: of the light: of all cells, as many are open as come nearest to it and symmetry permits.
        feature: side of the smallest hole and of the smallest bar, cells; at 1, all codes fit.
        symmetry: "none", "left-right", or "both": left-right and up-down.

    Raises:
        InputError: numbers out of range, an unknown symmetry, or a share of fewer cells than one feature.
    """

    cells: int
    share: float
    feature: int = 1
    symmetry: str = "none"

    def __post_init__(self) -> None:
        checks.whole_number_between("cells", self.cells, 2, 64)
        checks.whole_number_between("feature", self.feature, 1, self.cells // 2, of="cells")
        checks.above_zero("share of the light", self.share, most=1)
        checks.one_of("symmetry", self.symmetry, MIRRORS)
        if not self.feature**2 <= self.opened < self.cells**2:
            raise InputError(
                f"a share of the light of {self.share:g} opens {self.opened} of {self.cells}×{self.cells} cells: "
                f"give one that opens a feature ({self.feature}×{self.feature}) or more, and not all"
            )

    @property
    @cached
    def orbits(self) -> NDArray[np.intp]:
        """The number of each cell's group of mirror images, (rows, columns), from 0."""
        numbers = np.arange(self.cells**2).reshape(self.cells, self.cells)
        for axis in MIRRORS[self.symmetry]:
            numbers = np.minimum(numbers, np.flip(numbers, axis))
        return np.unique(numbers, return_inverse=True)[1].reshape(numbers.shape)

    @property
    def opened(self) -> int:
        """The number of open cells: off the share by at most half the greatest common divisor of the groups."""
        step = math.gcd(*np.bincount(self.orbits.ravel()).tolist())
        return step * round(self.share * self.cells**2 / step)

    def symmetric(self, values: Array) -> Array:
        """Values (rows, columns), averaged over mirror images."""
        sums = np.bincount(self.orbits.ravel(), values.ravel())
        return np.asarray((sums / np.bincount(self.orbits.ravel()))[self.orbits])

    def nearest(self, scores: Array) -> Mask:
        """A code (rows, columns) that keeps all constraints and opens cells of high scores.

        Holes grow by squares of the smallest feature, with their mirror images: each time the square whose newly
        opened cells have the highest mean score, out of those that leave no bar too small. If the number of open
        cells cannot be reached, the last squares are replaced (depth first), then the scores are disturbed by
        noise, the same in each call. It is no exact maximum.

        Args:
            scores: of the cells, (rows, columns), any finite numbers.

        Raises:
            InputError: scores of another shape or not finite; or no code was found.
        """
        if scores.shape != (self.cells, self.cells) or not np.isfinite(scores).all():
            raise InputError(f"scores have the shape {scores.shape}: {self.cells}×{self.cells} finite numbers")
        random, even = np.random.default_rng(0), self.symmetric(scores)
        for attempt in range(ATTEMPTS):
            noise = attempt / 2 * even.std() * self.symmetric(random.standard_normal(even.shape))
            found = self._searched(even + noise)
            if found is not None:
                return found
        raise InputError(
            f"no code of {self.cells}×{self.cells} cells with {self.opened} open ones and features of "
            f"{self.feature} cells was found (symmetry {self.symmetry}): take another share, an even number of "
            "cells, or a smaller feature"
        )

    def _searched(self, scores: Array) -> Mask | None:
        """A code by depth-first search; None if it takes too long."""
        start = np.zeros(scores.shape, bool)
        trail = [self._extended(start, scores)]
        for _ in range(MOST_NODES):
            if not trail:
                break
            found = next(trail[-1], None)
            if found is None:
                trail.pop()
            elif found.sum() == self.opened:
                return found
            else:
                trail.append(self._extended(found, scores))
        return None

    @property
    @cached
    def _squares(self) -> Mask:
        """All smallest holes with their mirror images, (holes, rows, columns)."""
        places = self.cells - self.feature + 1
        found = np.zeros((places**2, self.cells, self.cells), bool)
        for each, (row, column) in zip(found, product(range(places), repeat=2), strict=True):
            each[row : row + self.feature, column : column + self.feature] = True
        for axis in MIRRORS[self.symmetry]:
            found |= np.flip(found, axis + 1)
        return np.unique(found, axis=0)

    def _extended(self, holes: Mask, scores: Array) -> Iterator[Mask]:
        """The code with one more square, the best one first; without those that open too much."""
        added = self._squares & ~holes
        count = added.sum(axis=(1, 2))
        fits = (count > 0) & (count <= self.opened - holes.sum())
        added, count = added[fits], count[fits]
        wide = added | holes
        fits = self._bars_fit(wide)
        gain = (added[fits] * scores).sum(axis=(1, 2)) / count[fits]
        return iter(wide[fits][np.argsort(-gain, kind="stable")])

    def _bars_fit(self, holes: Mask) -> Mask:
        """Whether codes (codes, rows, columns) have no bar that is too small."""
        if self.feature == 1:
            return np.ones(len(holes), bool)
        bars = np.pad(~holes, ((0, 0), *[(self.feature, self.feature)] * 2), constant_values=True)
        first, right, under, last = (
            holes[:, rows, columns] for rows, columns in product((slice(-1), slice(1, None)), repeat=2)
        )
        corners = (first == last) & (right == under) & (first != right)
        fits: Mask = (_opening(bars, self.feature) == bars).all(axis=(1, 2)) & ~corners.any(axis=(1, 2))
        return fits


def _opening(cells: Mask, side: int) -> Mask:
    """The union of all squares of a side that lie in a set of cells, (…, rows, columns)."""
    inside = cells
    for axis in (-2, -1):
        count = inside.shape[axis] - side + 1
        inside = np.logical_and.reduce([_taken(inside, n, count, axis) for n in range(side)])
    for axis in (-2, -1):
        pads = [(0, 0)] * inside.ndim
        pads[axis] = (side - 1, side - 1)
        wide = np.pad(inside, pads)
        inside = np.logical_or.reduce([_taken(wide, n, cells.shape[axis], axis) for n in range(side)])
    return inside


def _taken(cells: Mask, start: int, count: int, axis: int) -> Mask:
    """Some rows (axis −2) or columns (axis −1)."""
    part = slice(start, start + count)
    return cells[..., part, :] if axis == -2 else cells[..., part]
