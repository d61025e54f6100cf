"""Several patterns in one plane: light passes the product of their transmissions, place by place.

The mean of a product is not the product of the means: a checkerboard and its negative together transmit nothing,
but each of them transmits half of the light. So patterns in one plane are multiplied before they are averaged.
Patterns made of rectangles are multiplied exactly, rectangle by rectangle; the others on a fine raster.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial, reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.lookup import bilinear
from vcc.shapes.lattice import CellApertures
from vcc.shapes.patterns import (
    FEWEST_PER_CELL,
    Bounded,
    Cells,
    Circle,
    FunctionPattern,
    Open,
    Pattern,
    Polygon,
    is_grid,
    mean_by_raster,
    overlaps,
)

Array = NDArray[np.float64]

OVERLAPPING = 8
"""How often rectangles must cover the rows of tiles, on average, for an integral of all tiles to be faster."""


@dataclass(frozen=True, eq=False)
class Shifted(Pattern):
    """A pattern with its middle at another place.

    Args:
        pattern: to shift.
        middle: place (x, y) of its middle, metres.
    """

    pattern: Pattern
    middle: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) around the origin outside which nothing passes, metres."""
        width, height = self.pattern.size
        return width + 2 * abs(self.middle[0]), height + 2 * abs(self.middle[1])

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The pattern's transmission at places relative to its middle."""
        return self.pattern(np.asarray(x, float) - self.middle[0], np.asarray(y, float) - self.middle[1])

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """The pattern's mean over rectangles relative to its middle."""
        x, y = np.asarray(x, float) - self.middle[0], np.asarray(y, float) - self.middle[1]
        return self.pattern.mean(x, y, width, height)


@dataclass(frozen=True, eq=False, repr=False)
class Tiles(Brief, Pattern):
    """Uniform rectangles of any sizes side by side, opaque outside: a product of `Cells`.

    Args:
        columns: x of the rectangles' borders, rising, metres, (n + 1,).
        rows: y of their borders, rising, metres, (m + 1,).
        values: transmission of each, (m, n).
    """

    columns: Array
    rows: Array
    values: Array

    @classmethod
    def of(cls, cells: Cells) -> Tiles:
        """An array of cells, converted."""
        rows, columns = cells.values.shape
        width, height = cells.width, float(cells.height or 0.0)
        x, y = cells.middle
        return cls(
            x + width * (np.arange(columns + 1) / columns - 0.5),
            y + height * (np.arange(rows + 1) / rows - 0.5),
            cells.values,
        )

    @classmethod
    def sheet(cls, width: float, height: float) -> Tiles:
        """A clear rectangle around the origin, metres."""
        return cls(np.array([-width, width]) / 2, np.array([-height, height]) / 2, np.ones((1, 1)))

    def moved(self, x: float, y: float) -> Tiles:
        """The same rectangles, moved by (x, y)."""
        return Tiles(self.columns + x, self.rows + y, self.values)

    def times(self, other: Tiles) -> Tiles:
        """The product of both, exactly."""
        columns, rows = _common(self.columns, other.columns), _common(self.rows, other.rows)
        if columns.size < 2 or rows.size < 2:  # they do not overlap: nothing passes
            return Tiles(self.columns[[0, -1]], self.rows[[0, -1]], np.zeros((1, 1)))
        x, y = (columns[1:] + columns[:-1]) / 2, (rows[1:] + rows[:-1]) / 2
        return Tiles(columns, rows, self(x[None, :], y[:, None]) * other(x[None, :], y[:, None]))

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) around the origin outside which nothing passes, metres."""
        return 2 * float(np.abs(self.columns).max()), 2 * float(np.abs(self.rows).max())

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The value of the rectangle at each place, zero outside."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        column = np.searchsorted(self.columns, x, side="right") - 1
        row = np.searchsorted(self.rows, y, side="right") - 1
        rows, columns = self.values.shape
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        return np.where(inside, self.values[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)], 0.0)

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """Mean transmission over rectangles, exact (differences of the integral)."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        width = max(width, float(np.ptp(self.columns)) * 1e-5)
        height = max(height, float(np.ptp(self.rows)) * 1e-5)
        left, right = (numbers_of_borders(self.columns, x + side * width / 2) for side in (-1, 1))
        top, bottom = (numbers_of_borders(self.rows, y + side * height / 2) for side in (-1, 1))
        if is_grid(x, y) and not self._worth_an_integral(top, bottom):
            down = overlaps(top.reshape(-1), bottom.reshape(-1), len(self.rows) - 1) * np.diff(self.rows)
            across = overlaps(left.reshape(-1), right.reshape(-1), len(self.columns) - 1) * np.diff(self.columns)
            content = (across @ (down @ self.values).T).T
        elif is_grid(x, y):  # along one axis after the other
            across = _between(self._integral, right, axis=1) - _between(self._integral, left, axis=1)
            content = _between(across, bottom, axis=0) - _between(across, top, axis=0)
        else:
            at = partial(bilinear, self._integral)
            content = at(bottom, right) - at(bottom, left) - at(top, right) + at(top, left)
        return np.asarray(np.clip(content / (width * height), 0.0, None))

    @property
    @cached
    def _integral(self) -> Array:
        """The integral over (−∞, x] × (−∞, y] at the borders, m²."""
        total = np.zeros((len(self.rows), len(self.columns)))
        area = np.diff(self.rows)[:, None] * np.diff(self.columns)[None, :]
        np.multiply(self.values, area, out=total[1:, 1:])
        total.cumsum(0, out=total)
        return total.cumsum(1, out=total)

    def _worth_an_integral(self, first: Array, last: Array) -> bool:
        """Whether rectangles, given by first and last row, overlap so much that an integral is faster."""
        return float(np.sum(last - first + 1)) > OVERLAPPING * len(self.rows)


def numbers_of_borders(borders: Array, places: Array) -> Array:
    """Places as fractional numbers of borders, within the first and the last."""
    return np.asarray(np.interp(places, borders, np.arange(len(borders), dtype=np.float64)))


def _between(table: Array, place: Array, axis: int) -> Array:
    """Rows or columns of a table, interpolated linearly at places in numbers of rows or columns."""
    place = place.reshape(-1)
    first = np.minimum(place.astype(int), table.shape[axis] - 2)
    after = np.expand_dims(place - first, 1 - axis)
    return np.asarray(
        np.take(table, first, axis=axis) * (1 - after) + np.take(table, first + 1, axis=axis) * after
    )


def _common(one: Array, other: Array) -> Array:
    """The borders of both within their common range; borders that differ only by rounding become one."""
    low, high = max(one[0], other[0]), min(one[-1], other[-1])
    borders = np.unique(np.concatenate([one, other]))
    borders = borders[(borders >= low) & (borders <= high)]
    apart = np.ones(borders.size, dtype=bool)
    apart[1:] = np.diff(borders) > 1e-9 * (one[-1] - one[0])
    return np.asarray(borders[apart])


@dataclass(frozen=True)
class Product(Pattern):
    """Several patterns on one sheet: light passes the product of their transmissions.

    Args:
        patterns: one or more.

    Raises:
        InputError: no pattern at all.
    """

    patterns: tuple[Pattern, ...]

    def __post_init__(self) -> None:
        if not self.patterns:
            raise InputError("a product of patterns has one or more, not none")

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) of the smallest, metres."""
        width, height = zip(*(pattern.size for pattern in self.patterns), strict=True)
        return min(width), min(height)

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The product of the transmissions."""
        return math.prod((pattern(x, y) for pattern in self.patterns), start=np.asarray(1.0))

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """Mean of the product over rectangles.

        Exact if all patterns are cells or clear sheets, or if all but one are clear. Else on a raster of 16 points
        across a rectangle (4 at least): each point holds the product of the patterns' means around it.
        """
        factors = self.factors
        placed = [(f.pattern, f.middle) if isinstance(f, Shifted) else (f, (0.0, 0.0)) for f in factors]
        factors = tuple(factors[n] for n in not_clear_next_to_others(placed, (Circle, Tiles)))
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if not factors:
            return np.ones(np.broadcast_shapes(x.shape, y.shape))
        if len(factors) == 1:
            return factors[0].mean(x, y, width, height)

        def values(px: Array, py: Array, point: tuple[float, float]) -> Array:
            return np.clip(product_of_means(factors, px, py, *point), 0.0, 1.0)

        found = mean_by_raster(values, self.size, x, y, width, height, FEWEST_PER_CELL)
        if found is None:  # few small rectangles far apart: sample inside each
            steps = (np.arange(FEWEST_PER_CELL) + 0.5) / FEWEST_PER_CELL - 0.5
            part = width / FEWEST_PER_CELL, height / FEWEST_PER_CELL
            inside = [
                product_of_means(factors, x + a * width, y + b * height, *part) for a in steps for b in steps
            ]
            return np.asarray(np.mean(np.broadcast_arrays(*inside), axis=0))
        return found

    @property
    @cached
    def factors(self) -> tuple[Pattern, ...]:
        """The patterns, with those made of rectangles multiplied into one, and without clear ones."""
        # Holes are open or opaque, so that equal ones can be merged: two equal rims in one plane are one.
        simple: list[Pattern] = []
        holes: list[tuple[Pattern, tuple[float, float]]] = []
        for part in _parts(self.patterns, (0.0, 0.0)):
            hole = (part.pattern, part.middle) if isinstance(part, Shifted) else (part, (0.0, 0.0))
            if not isinstance(hole[0], Circle | Polygon):
                simple.append(part)
            elif hole not in holes:
                holes.append(hole)
                simple.append(part)
        tiles = [one for one in simple if isinstance(one, Tiles)]
        rest = tuple(one for one in simple if not isinstance(one, Tiles))
        return (reduce(Tiles.times, tiles), *rest) if tiles else rest


def _parts(patterns: Iterable[Pattern], middle: tuple[float, float]) -> Iterable[Pattern]:
    """The simple patterns whose product these are, at their places on one sheet."""
    x, y = middle
    for pattern in patterns:
        if isinstance(pattern, Open):
            continue
        if isinstance(pattern, Shifted):
            yield from _parts([pattern.pattern], (x + pattern.middle[0], y + pattern.middle[1]))
        elif isinstance(pattern, Product):
            yield from _parts(pattern.patterns, middle)
        elif isinstance(pattern, Bounded):
            yield Tiles.sheet(pattern.width, pattern.height).moved(x, y)
            yield from _parts([pattern.pattern], middle)
        elif isinstance(pattern, Cells):
            yield Tiles.of(pattern).moved(x, y)
        elif isinstance(pattern, Tiles):
            yield pattern.moved(x, y)
        else:
            yield Shifted(pattern, middle) if x or y else pattern


def product_of_means(factors: tuple[Pattern, ...], x: Array, y: Array, width: float, height: float) -> Array:
    """The product of means over small rectangles; functions, whose means need a raster, are taken at a point."""
    total: Array = np.ones(1)
    for factor in factors:
        plain = factor.pattern if isinstance(factor, Shifted) else factor
        pointwise = isinstance(plain, FunctionPattern) or type(plain).mean is Pattern.mean
        total = total * (factor(x, y) if pointwise else factor.mean(x, y, width, height))
    return np.asarray(total)


def clear_over(pattern: Pattern, low: Array, high: Array) -> NDArray[np.bool_]:
    """Whether a pattern is known to transmit all light in rectangles.

    Args:
        pattern: any.
        low: (x, y) of the rectangles' corners, metres relative to the pattern's middle, (..., 2).
        high: (x, y) of the opposite corners.
    """
    clear = np.ones(np.shape(low)[:-1], dtype=np.bool_)
    for part in _parts([pattern], (0.0, 0.0)):
        own, middle = (part.pattern, np.array(part.middle)) if isinstance(part, Shifted) else (part, np.zeros(2))
        if isinstance(own, Circle):
            farthest = np.maximum(np.abs(low - middle), np.abs(high - middle))
            clear &= (farthest**2).sum(axis=-1) <= own.diameter**2 / 4
        elif isinstance(own, Tiles) and (own.values == 1).all():
            first, last = (np.array([own.columns[end], own.rows[end]]) for end in (0, -1))
            clear &= ((first <= low) & (high <= last)).all(axis=-1)
        else:
            return np.zeros_like(clear)
    return clear


def has_edges(pattern: Pattern) -> bool:
    """Whether a pattern is made of areas with hard edges, such as cells and polygons. Bounds do not count."""
    if isinstance(pattern, Product):
        return any(has_edges(factor) for factor in pattern.factors)
    if isinstance(pattern, (Shifted, Bounded)):
        return has_edges(pattern.pattern)
    return isinstance(pattern, (Cells, Circle, Polygon, Tiles, CellApertures))


def dark_over(pattern: Pattern, low: Array, high: Array) -> NDArray[np.bool_]:
    """Whether a pattern is known from its size to transmit no light in rectangles; see `clear_over`."""
    half = np.array(pattern.size) / 2
    return np.asarray(((low >= half) | (high <= -half)).any(axis=-1))


def not_clear_next_to_others(
    patterns: list[tuple[Pattern, tuple[float, float]]], kinds: tuple[type[Pattern], ...] = (Circle,)
) -> tuple[int, ...]:
    """The patterns in one plane that cut off light; a pattern that is clear all over another one does not.

    Args:
        patterns: each with the place (x, y) of its middle, metres.
        kinds: types that may be left out. Round holes by default, because values of cells may be learned.
    """
    kept = list(range(len(patterns)))
    for n, (hole, middle) in enumerate(patterns):
        if not isinstance(hole, kinds):
            continue
        for other in kept:
            pattern, centre = patterns[other]
            from_middle, half = np.subtract(centre, middle), np.array(pattern.size) / 2
            if other != n and clear_over(hole, from_middle - half, from_middle + half):
                kept.remove(n)
                break
    return tuple(kept)


def in_one_plane(patterns: list[tuple[Pattern, tuple[float, float]]]) -> Pattern:
    """The product of patterns at their places in one plane: a pattern about the plane's own origin.

    Args:
        patterns: each with the place (x, y) of its middle, metres.
    """
    placed = tuple(Shifted(pattern, middle) if any(middle) else pattern for pattern, middle in patterns)
    return placed[0] if len(placed) == 1 else Product(placed)
