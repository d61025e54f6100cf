"""Gradients of weighted means of a pattern with respect to the cells of a mask in it.

A pattern's mean over a rectangle is linear in the values of each array of cells in it, for any other factors
on its sheet. This module is the transpose of that linear map, rectangle by rectangle: from weights of the means to
weights of the cells. It is used for learning a mask's cells (`vcc.plan.footprints.means`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.shapes.patterns import Bounded, Cells, Open, Pattern, is_grid, overlaps
from vcc.shapes.stacked_patterns import Product, Shifted, Tiles, numbers_of_borders

Array = NDArray[np.float64]


def is_values(thing: Any, field: str) -> bool:
    """Whether a field of an object holds the values of an array of cells."""
    return isinstance(thing, Cells) and field == "values"


def holds(pattern: Pattern | None, cells: Cells) -> bool:
    """Whether an array of cells (the same object) is a part of a pattern."""
    if isinstance(pattern, Product):
        return any(holds(part, cells) for part in pattern.patterns)
    return holds(pattern.pattern, cells) if isinstance(pattern, Bounded | Shifted) else pattern is cells


def cells_back(cells: Cells, places: tuple[Array, Array], size: Sequence[float], weights: Array) -> Array:
    """The gradient of Σ weights · cells.mean(x, y, width, height) with respect to the values of the cells.

    Args:
        cells: the array.
        places: (x, y), centres of the rectangles, metres, that broadcast against each other.
        size: (width, height) of every rectangle, metres.
        weights: of the shape that the places broadcast to.

    Returns:
        (rows, columns) of the cells.
    """
    return tiles_back(Tiles.of(cells), places, size, weights)


@dataclass(frozen=True, eq=False, repr=False)
class OnSheet(Brief):
    """A product of patterns, with an array of cells separated from the other factors.

    Args:
        tiles: product of the cells and all other rectangles.
        own: the cells at their place.
        sheet: the other rectangles, or None.
        others: all factors that are not made of rectangles.
    """

    tiles: Tiles
    own: Tiles
    sheet: Tiles | None
    others: tuple[Pattern, ...]

    @classmethod
    def of(cls, product: Product, cells: Cells) -> OnSheet:
        """From a product that contains an array of cells (the same object) exactly once."""
        own = Tiles.of(cells).moved(*_middle(product, cells))
        rest = Product((_without(product, cells),)).factors
        sheet = next((factor for factor in rest if isinstance(factor, Tiles)), None)
        others = tuple(factor for factor in rest if not isinstance(factor, Tiles))
        return cls(own if sheet is None else own.times(sheet), own, sheet, others)

    def back(self, weights: Array) -> Array:
        """Convert weights of the rectangles to weights of the cells."""
        if self.sheet is None:
            return weights
        x, y = ((borders[1:] + borders[:-1]) / 2 for borders in (self.tiles.columns, self.tiles.rows))
        row = np.searchsorted(self.own.rows, y, side="right") - 1
        column = np.searchsorted(self.own.columns, x, side="right") - 1
        rows, columns = self.own.values.shape
        inside = ((row >= 0) & (row < rows))[:, None] & ((column >= 0) & (column < columns))[None, :]
        shares = np.where(inside, weights * self.sheet(x[None, :], y[:, None]), 0.0)
        total = np.zeros((rows, columns))
        place = np.clip(row, 0, rows - 1)[:, None], np.clip(column, 0, columns - 1)[None, :]
        np.add.at(total, place, shares)
        return total


def _middle(pattern: Pattern, cells: Cells) -> tuple[float, float]:
    """Place of the origin of an array of cells on the sheet of a pattern that contains it, metres."""
    if isinstance(pattern, Product):
        return _middle(next(part for part in pattern.patterns if holds(part, cells)), cells)
    if isinstance(pattern, Bounded):
        return _middle(pattern.pattern, cells)
    if isinstance(pattern, Shifted):
        x, y = _middle(pattern.pattern, cells)
        return x + pattern.middle[0], y + pattern.middle[1]
    return (0.0, 0.0)


def _without(pattern: Pattern, cells: Cells) -> Pattern:
    """The pattern with an open sheet in place of an array of cells."""
    if isinstance(pattern, Product):
        return Product(tuple(_without(part, cells) for part in pattern.patterns))
    if isinstance(pattern, Bounded | Shifted):
        return replace(pattern, pattern=_without(pattern.pattern, cells))
    return Open() if pattern is cells else pattern


def tiles_back(tiles: Tiles, places: tuple[Array, Array], size: Sequence[float], weights: Array) -> Array:
    """The gradient of weighted means with respect to rectangles side by side: (rows, columns) of them."""
    x, y = places
    width = max(size[0], float(np.ptp(tiles.columns)) * 1e-5)
    height = max(size[1], float(np.ptp(tiles.rows)) * 1e-5)
    if is_grid(x, y):
        across, down = _overlaps(tiles.columns, x.ravel(), width), _overlaps(tiles.rows, y.ravel(), height)
        return np.asarray(down.T @ np.broadcast_to(weights, (y.size, x.size)) @ across)
    x, y, weights = (each.ravel() for each in np.broadcast_arrays(x, y, weights))
    across, down = _overlaps(tiles.columns, x, width), _overlaps(tiles.rows, y, height)
    return np.asarray((down.multiply(weights[:, None]).T @ across).todense())


def _overlaps(borders: Array, centres: Array, length: float) -> Any:
    """Share of each interval around a centre covered by each piece between borders: sparse (intervals, pieces)."""
    first, last = (numbers_of_borders(borders, centres + side * length / 2) for side in (-1, 1))
    return overlaps(first, last, len(borders) - 1) * (np.diff(borders) / length)
