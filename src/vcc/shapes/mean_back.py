"""What each cell of a mask adds to weighted means of a pattern that it is a part of.

A pattern's mean over a rectangle is linear in the values of each array of cells in it, whatever it is multiplied
with on its sheet. Here is the transpose of that linear map: from weights of the means to weights of the cells. It
is what a mask's cells are learned by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.shapes.patterns import (
    FEWEST_PER_CELL,
    RASTER_LIMIT,
    Bounded,
    Cells,
    Open,
    Pattern,
    Raster,
    is_grid,
    overlap_share,
    raster,
)
from vcc.shapes.sheets import Product, Shifted, Tiles, product_of_means

Array = NDArray[np.float64]


def holds(pattern: Pattern | None, cells: Cells) -> bool:
    """Whether an array of cells, this very object, is a part of a pattern."""
    if isinstance(pattern, Product):
        return any(holds(part, cells) for part in pattern.patterns)
    return holds(pattern.pattern, cells) if isinstance(pattern, Bounded | Shifted) else pattern is cells


def mean_back(
    pattern: Pattern, cells: Cells, places: tuple[Array, Array], size: Sequence[float], weights: Array
) -> Array:
    """What each value of an array of cells adds to Σ weights · pattern.mean(x, y, width, height).

    Args:
        pattern: of which ``cells`` is a part, once.
        cells: the very object.
        places: (x, y), centres of the rectangles, metres, that broadcast against each other.
        size: (width, height) of every rectangle, metres.
        weights: of the shape that the places broadcast to.

    Returns:
        (rows, columns) of the cells.
    """
    x, y = (np.asarray(place, dtype=np.float64) for place in places)
    if isinstance(pattern, Cells):
        whole = Tiles.of(pattern)
        return _tiles_back(whole, (x, y), size, weights)
    if isinstance(pattern, Shifted):
        return mean_back(pattern.pattern, cells, (x - pattern.middle[0], y - pattern.middle[1]), size, weights)
    if isinstance(pattern, Bounded):
        shares = [
            overlap_share(place, max(length, sheet * 1e-5), sheet)
            for place, length, sheet in zip((x, y), size, (pattern.width, pattern.height), strict=True)
        ]
        return mean_back(pattern.pattern, cells, (x, y), size, weights * shares[0] * shares[1])
    assert isinstance(pattern, Product)
    return _product_back(pattern, cells, (x, y), size, weights)


def _product_back(
    product: Product, cells: Cells, places: tuple[Array, Array], size: Sequence[float], weights: Array
) -> Array:
    """As `mean_back`, of patterns on one sheet: rectangles exactly, what else there is on a raster of points."""
    own = Tiles.of(cells).moved(*_middle(product, cells))
    rest = Product((_without(product, cells),)).factors
    others = tuple(factor for factor in rest if not isinstance(factor, Tiles))
    sheets = [factor for factor in rest if isinstance(factor, Tiles)]
    tiles = own.times(sheets[0]) if sheets else own
    if not others:
        back = _tiles_back(tiles, places, size, weights)
    else:
        back = np.zeros(tiles.values.shape)
        for points, point, density in _points(product, places, size, weights):
            around = product_of_means(others, *points, *point)
            back += _tiles_back(tiles, points, point, density * around)
    return _of_cells(back, tiles, own, sheets)


def _points(
    product: Product, places: tuple[Array, Array], size: Sequence[float], weights: Array
) -> list[tuple[tuple[Array, Array], tuple[float, float], Array]]:
    """Where `Product.mean` looks, over how much (width, height), and what each place counts: its raster's points.

    Where even the coarsest raster would be too large, points in each rectangle.
    """
    rasters = [raster(*each, FEWEST_PER_CELL) for each in zip(places, size, product.size, strict=True)]
    across, down = rasters
    if across is None or down is None or across.places.size * down.places.size > RASTER_LIMIT**2:
        steps = (np.arange(FEWEST_PER_CELL) + 0.5) / FEWEST_PER_CELL - 0.5
        part = size[0] / FEWEST_PER_CELL, size[1] / FEWEST_PER_CELL
        share = weights / FEWEST_PER_CELL**2
        return [((places[0] + a * size[0], places[1] + b * size[1]), part, share) for a in steps for b in steps]
    density = _tiles_back(_empty(across, down), places, size, weights)
    return [((across.places[None, :], down.places[:, None]), (across.step, down.step), density)]


def _empty(across: Raster, down: Raster) -> Tiles:
    """The cells of a raster, of which only the borders count."""
    columns, rows = (np.linspace(each.low, each.high, each.places.size + 1) for each in (across, down))
    return Tiles(
        np.asarray(columns, np.float64),
        np.asarray(rows, np.float64),
        np.zeros((down.places.size, across.places.size)),
    )


def _middle(pattern: Pattern, cells: Cells) -> tuple[float, float]:
    """Where the origin of an array of cells stands on the sheet of a pattern that it is a part of, metres."""
    if isinstance(pattern, Product):
        return _middle(next(part for part in pattern.patterns if holds(part, cells)), cells)
    if isinstance(pattern, Bounded):
        return _middle(pattern.pattern, cells)
    if isinstance(pattern, Shifted):
        x, y = _middle(pattern.pattern, cells)
        return x + pattern.middle[0], y + pattern.middle[1]
    return (0.0, 0.0)


def _without(pattern: Pattern, cells: Cells) -> Pattern:
    """The pattern with an open sheet in the place of an array of cells."""
    if isinstance(pattern, Product):
        return Product(tuple(_without(part, cells) for part in pattern.patterns))
    if isinstance(pattern, Bounded | Shifted):
        return replace(pattern, pattern=_without(pattern.pattern, cells))
    return Open() if pattern is cells else pattern


def _tiles_back(tiles: Tiles, places: tuple[Array, Array], size: Sequence[float], weights: Array) -> Array:
    """What each of some rectangles side by side adds to weighted means: (rows, columns) of them."""
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
    """Share of each interval around a centre that each piece between borders fills: sparse (intervals, pieces)."""
    from scipy.sparse import csr_array

    low, high, pieces = centres - length / 2, centres + length / 2, len(borders) - 1
    first = np.searchsorted(borders, low, side="right") - 1
    last = np.searchsorted(borders, high, side="left")
    index = first[:, None] + np.arange(max(int((last - first).max(initial=1)), 1))
    inside = (index >= 0) & (index < pieces)
    piece = np.clip(index, 0, pieces - 1)
    share = np.minimum(borders[piece + 1], high[:, None]) - np.maximum(borders[piece], low[:, None])
    keep = inside & (share > 0)
    row = np.broadcast_to(np.arange(len(centres))[:, None], index.shape)
    return csr_array((share[keep] / length, (row[keep], index[keep])), shape=(len(centres), pieces))


def _of_cells(back: Array, tiles: Tiles, own: Tiles, sheets: list[Tiles]) -> Array:
    """Weights of rectangles that cells and sheets multiply to, as weights of the cells."""
    if not sheets:
        return back
    x, y = ((borders[1:] + borders[:-1]) / 2 for borders in (tiles.columns, tiles.rows))
    row, column = (
        np.searchsorted(borders, at, side="right") - 1 for borders, at in ((own.rows, y), (own.columns, x))
    )
    rows, columns = own.values.shape
    inside = ((row >= 0) & (row < rows))[:, None] & ((column >= 0) & (column < columns))[None, :]
    shares = np.where(inside, back * sheets[0](x[None, :], y[:, None]), 0.0)
    total = np.zeros((rows, columns))
    np.add.at(total, (np.clip(row, 0, rows - 1)[:, None], np.clip(column, 0, columns - 1)[None, :]), shares)
    return total
