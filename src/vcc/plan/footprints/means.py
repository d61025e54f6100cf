"""Means of patterns over rectangles that follow the rectangles and the patterns smoothly.

A pattern without a closed-form mean is sampled on a raster. If the raster were chosen for each camera, its
points would move with the rectangles, and hard edges would jump from point to point. If parameters follow a
camera, the raster is therefore chosen once and stays fixed on the pattern; means of the raster values are exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.lookup import smooth, three_around
from vcc.base.values import content
from vcc.plan.following import NONE_KEPT, Parts, plan_again
from vcc.shapes.lattice import CellApertures
from vcc.shapes.mean_back import OnSheet, cells_back, tiles_back
from vcc.shapes.patterns import (
    FEWEST_PER_CELL,
    RASTER_LIMIT,
    RASTER_PER_CELL,
    Bounded,
    Cells,
    Pattern,
    Raster,
    is_grid,
    overlap_share,
    points_between,
)
from vcc.shapes.stacked_patterns import Product, Shifted

Array = NDArray[np.float64]

ROOM = 0.25
"""Margin of a raster on each side, as a share of the region covered, in addition to one rectangle."""


class Boxes(NamedTuple):
    """Rectangles: their centres in metres (arrays that broadcast) and their common size."""

    x: Array
    y: Array
    width: float
    height: float


@dataclass(frozen=True, eq=False, repr=False)
class MeanChoice(Brief):
    """How the mean of a pattern without a closed form is computed.

    Args:
        rasters: (across, down) on which the pattern is sampled; None: each rectangle is sampled in parts.
        factors: if several patterns are multiplied, how the mean of each is computed.
    """

    rasters: tuple[Raster, Raster] | None
    factors: tuple[MeanChoice | None, ...] = ()


def choose_mean(pattern: Pattern, boxes: Boxes) -> MeanChoice | None:
    """Choose how a pattern's mean over rectangles is computed so that it follows them; None: by its own `mean`."""
    if isinstance(pattern, Shifted):
        return choose_mean(pattern.pattern, _from_middle(pattern, boxes))
    if isinstance(pattern, Bounded) or (isinstance(pattern, Product) and len(pattern.factors) == 1):
        return choose_mean(pattern.pattern if isinstance(pattern, Bounded) else pattern.factors[0], boxes)
    if isinstance(pattern, Product) and pattern.factors:
        rasters = _rasters(pattern, boxes)
        within = parts_of(boxes)[0] if rasters is None else points_of(rasters)
        return MeanChoice(rasters, tuple(_choose_factor(factor, within) for factor in pattern.factors))
    return None if _closed(pattern) or isinstance(pattern, Product) else MeanChoice(_rasters(pattern, boxes))


def _choose_factor(factor: Pattern, within: Boxes) -> MeanChoice | None:
    return choose_mean(factor, within) if _closed(_plain(factor)) else None


def mean_over(pattern: Pattern, boxes: Boxes, chosen: MeanChoice | None, parts: Parts = NONE_KEPT) -> Array:
    """A pattern's mean over rectangles; see `vcc.shapes.patterns.Pattern.mean`.

    Args:
        pattern: any.
        boxes: the rectangles.
        chosen: how the mean is computed (`choose_mean`).
        parts: cached parts of nearby plans.

    Raises:
        InputError: rectangles beyond the chosen raster.
    """
    if chosen is None:
        return pattern.mean(*boxes)
    x, y, width, height = boxes
    if isinstance(pattern, Shifted):
        return mean_over(pattern.pattern, _from_middle(pattern, boxes), chosen, parts)
    if isinstance(pattern, Bounded):
        share_x = overlap_share(x, max(width, pattern.width * 1e-5), pattern.width)
        share_y = overlap_share(y, max(height, pattern.height * 1e-5), pattern.height)
        return mean_over(pattern.pattern, boxes, chosen, parts) * share_x * share_y
    if isinstance(pattern, Product) and len(pattern.factors) == 1:
        return mean_over(pattern.factors[0], boxes, chosen, parts)
    check_within(pattern, boxes, chosen)
    if chosen.rasters is None:
        return np.asarray(
            np.mean(np.broadcast_arrays(*(_values(pattern, each, chosen) for each in parts_of(boxes))), axis=0)
        )
    rasters = chosen.rasters
    found = parts.part(
        "values on a raster",
        lambda: (content(pattern), content(rasters)),
        lambda: _values(pattern, points_of(rasters), chosen),
    )
    return _of_raster(found, rasters, boxes)


def _values(pattern: Pattern, points: Boxes, chosen: MeanChoice) -> Array:
    """Values of a pattern at points for rectangles; for a product, the product of the factors' means."""
    if isinstance(pattern, Product):
        pairs = zip(pattern.factors, chosen.factors, strict=True)
        means = (mean_or_value(factor, points, its) for factor, its in pairs)
        return np.clip(math.prod(means, start=np.ones(1)), 0.0, 1.0)
    return np.asarray(pattern(points.x, points.y), float)


def _from_middle(pattern: Shifted, boxes: Boxes) -> Boxes:
    """Rectangles relative to the middle of a shifted pattern."""
    return boxes._replace(x=boxes.x - pattern.middle[0], y=boxes.y - pattern.middle[1])


def _plain(factor: Pattern) -> Pattern:
    return factor.pattern if isinstance(factor, Shifted) else factor


def _closed(pattern: Pattern) -> bool:
    """Whether a pattern's own `mean` follows rectangles smoothly."""
    if isinstance(pattern, CellApertures) and pattern.lattice.rotation:
        return False
    return type(pattern).mean is not Pattern.mean


def parts_of(boxes: Boxes) -> list[Boxes]:
    """The parts of each rectangle; each item of the list holds one part of every rectangle."""
    steps = (np.arange(FEWEST_PER_CELL) + 0.5) / FEWEST_PER_CELL - 0.5
    x, y, width, height = boxes
    part = width / FEWEST_PER_CELL, height / FEWEST_PER_CELL
    return [Boxes(x + a * width, y + b * height, *part) for a in steps for b in steps]


def points_of(rasters: tuple[Raster, Raster]) -> Boxes:
    """The rectangles that the points of a raster stand for."""
    across, down = rasters
    return Boxes(across.places[None, :], down.places[:, None], across.step, down.step)


def mean_or_value(factor: Pattern, points: Boxes, chosen: MeanChoice | None) -> Array:
    """Means over the rectangles of raster points; for patterns without a closed form, values at the points."""
    return mean_over(factor, points, chosen) if _closed(_plain(factor)) else factor(points.x, points.y)


def _of_raster(found: Array, rasters: tuple[Raster, Raster], boxes: Boxes) -> Array:
    """Means over rectangles of the bilinear interpolation of raster values, in closed form.

    The integral of a piecewise linear function up to a place is a quadratic B-spline of the sums up to the borders
    between points. So the means have a continuous slope.
    """
    across, down = rasters
    values = np.broadcast_to(found, (down.places.size, across.places.size))
    sums = np.pad(values, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    points = (boxes.width / across.step) * (boxes.height / down.step)
    (left, right), (top, bottom) = _sides(rasters, boxes)
    if is_grid(boxes.x, boxes.y):  # along one axis after the other
        wide = _up_to(right, sums.shape[1]) - _up_to(left, sums.shape[1])
        high = _up_to(bottom, sums.shape[0]) - _up_to(top, sums.shape[0])
        return np.asarray((high @ sums @ wide.T) / points)
    shape = np.broadcast_shapes(boxes.x.shape, boxes.y.shape)

    def at(row: Array, column: Array) -> Array:
        return smooth(sums, np.broadcast_to(row, shape), np.broadcast_to(column, shape))

    return (at(bottom, right) - at(bottom, left) - at(top, right) + at(top, left)) / points


def of_raster_back(weights: Array, rasters: tuple[Raster, Raster], boxes: Boxes) -> Array:
    """From weights of means over rectangles to weights of the raster values, (rows, columns)."""
    across, down = rasters
    rows, columns = down.places.size + 1, across.places.size + 1
    shape = np.broadcast_shapes(boxes.x.shape, boxes.y.shape)
    (left, right), (top, bottom) = _sides(rasters, boxes)
    weights = np.broadcast_to(weights, shape) / ((boxes.width / across.step) * (boxes.height / down.step))
    if not is_grid(boxes.x, boxes.y):
        left, right, top, bottom = (np.broadcast_to(side, shape) for side in (left, right, top, bottom))
    wide = _up_to(right, columns) - _up_to(left, columns)
    high = _up_to(bottom, rows) - _up_to(top, rows)
    if is_grid(boxes.x, boxes.y):
        sums = high.T @ weights @ wide
    else:
        sums = (high.multiply(weights.reshape(-1, 1)).T @ wide).toarray()
    # Each point counts in the sums up to all borders behind it.
    return np.asarray(sums[::-1, ::-1].cumsum(0).cumsum(1)[::-1, ::-1][1:, 1:])


def _sides(rasters: tuple[Raster, Raster], boxes: Boxes) -> list[list[Array]]:
    """((left, right), (top, bottom)) of rectangles, as numbers of borders between points of rasters."""
    across, down = rasters
    x, y, width, height = boxes
    return [
        [_place(raster, centre + side * length / 2) for side in (-1, 1)]
        for raster, centre, length in ((across, x, width), (down, y, height))
    ]


def _place(raster: Raster, at: Array) -> Array:
    """Places as numbers of borders between raster points, clipped to where splines have all their points."""
    return np.clip((at - raster.low) / raster.step, 1.0, raster.places.size - 1.0)


def _up_to(place: Array, borders: int) -> Any:
    """Weight of each border in the integral up to each place: a sparse matrix (places, borders)."""
    from scipy.sparse import csr_array

    point, counts, _ = three_around(place.reshape(-1), borders)
    rows = np.broadcast_to(np.arange(point.shape[1]), point.shape)
    return csr_array((counts.reshape(-1), (rows.reshape(-1), point.reshape(-1))), shape=(point.shape[1], borders))


# --- rasters ---


def check_within(pattern: Pattern, boxes: Boxes, chosen: MeanChoice) -> None:
    """Check that rectangles lie within the chosen rasters.

    Raises:
        InputError: a rectangle lies outside.
    """
    if chosen.rasters is None:
        return
    x, y, width, height = boxes
    for raster, centre, length, bound in zip(chosen.rasters, (x, y), (width, height), pattern.size, strict=True):
        low, high = max(centre.min() - length / 2, -bound / 2), min(centre.max() + length / 2, bound / 2)
        tolerance = 1e-9 * raster.length
        if low < high and (low < raster.low - tolerance or high > raster.high + tolerance):
            raise plan_again("where a pattern is evaluated")


def _rasters(pattern: Pattern, boxes: Boxes) -> tuple[Raster, Raster] | None:
    across, down = (
        _raster(centre, length, bound)
        for centre, length, bound in (
            (boxes.x, boxes.width, pattern.size[0]),
            (boxes.y, boxes.height, pattern.size[1]),
        )
    )
    if across is None or down is None or across.places.size * down.places.size > RASTER_LIMIT**2:
        return None
    return across, down


def _raster(centre: Array, length: float, bound: float) -> Raster | None:
    """`RASTER_PER_CELL` points across a rectangle, fewer for many rectangles, with a margin around them."""
    room = length + ROOM * float(np.ptp(centre))
    reach = (1 + ROOM) * bound / 2
    low = max(float(centre.min()) - length / 2 - room, -reach)
    high = max(min(float(centre.max()) + length / 2 + room, reach), low)
    across = RASTER_PER_CELL
    while across > FEWEST_PER_CELL and length > 0 and (high - low) / length * across > RASTER_LIMIT:
        across //= 2
    return points_between(low, high, length / across)


# --- transpose of `mean_over`: from weights of a pattern's means to weights of the cells that it is made of ---


def mean_back(pattern: Pattern, boxes: Boxes, chosen: MeanChoice | None, weights: Array, cells: Cells) -> Array:
    """The gradient of Σ weights · mean of a pattern with respect to the values of an array of cells.

    Args:
        pattern: contains the cells exactly once (`vcc.shapes.mean_back.holds`).
        boxes: the rectangles that the pattern is averaged over.
        chosen: how (`choose_mean`).
        weights: of the means, of the shape that the boxes' places broadcast to.
        cells: the same object as in the pattern.

    Returns:
        (rows, columns) of the cells.
    """
    x, y, width, height = boxes
    if isinstance(pattern, Cells):
        return cells_back(cells, (x, y), (width, height), weights)
    if isinstance(pattern, Shifted):
        moved = boxes._replace(x=x - pattern.middle[0], y=y - pattern.middle[1])
        return mean_back(pattern.pattern, moved, chosen, weights, cells)
    if isinstance(pattern, Bounded):
        share_x = overlap_share(x, max(width, pattern.width * 1e-5), pattern.width)
        share_y = overlap_share(y, max(height, pattern.height * 1e-5), pattern.height)
        return mean_back(pattern.pattern, boxes, chosen, weights * share_x * share_y, cells)
    assert isinstance(pattern, Product)
    sheet = OnSheet.of(pattern, cells)
    if not sheet.others:
        return sheet.back(tiles_back(sheet.tiles, (x, y), (width, height), weights))

    assert chosen is not None  # several patterns together have no closed-form mean
    of_factors = {content(factor): its for factor, its in zip(pattern.factors, chosen.factors, strict=True)}

    def back(points: Boxes, share: Array) -> Array:
        factors = [mean_or_value(other, points, of_factors.get(content(other))) for other in sheet.others]
        around = math.prod(factors, start=np.ones(1))
        return tiles_back(sheet.tiles, (points.x, points.y), (points.width, points.height), share * around)

    check_within(pattern, boxes, chosen)
    if chosen.rasters is None:
        parts = parts_of(boxes)
        return sheet.back(np.sum([back(points, weights / len(parts)) for points in parts], axis=0))
    return sheet.back(back(points_of(chosen.rasters), of_raster_back(weights, chosen.rasters, boxes)))
