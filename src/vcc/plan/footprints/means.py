"""Means of patterns over rectangles, as numbers that follow the rectangles and the patterns smoothly.

A pattern without a mean in closed form is looked at on a raster. Made anew for each camera, its points would move
with the rectangles, and what is hard in a pattern would jump from point to point. Where decisions are kept, the
raster is: its points stand still on the pattern, and means are exact for what they show.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.lookup import smooth, three_around
from vcc.base.values import content
from vcc.plan.decisions import Decisions, plan_again
from vcc.shapes.lattice import CellApertures
from vcc.shapes.patterns import (
    FEWEST_PER_CELL,
    LONGEST_RASTER,
    RASTER_LIMIT,
    RASTER_PER_CELL,
    Bounded,
    Pattern,
    Raster,
    is_grid,
    overlap_share,
)
from vcc.shapes.sheets import Product, Shifted

Array = NDArray[np.float64]

ROOM = 0.25
"""By how much of what they cover rasters reach beyond it on each side, besides a rectangle."""


class Boxes(NamedTuple):
    """Rectangles side by side: their centres, metres, arrays that broadcast, and the size of each."""

    x: Array
    y: Array
    width: float
    height: float


def mean_over(
    pattern: Pattern, x: ArrayLike, y: ArrayLike, width: float, height: float, decisions: Decisions
) -> Array:
    """A pattern's mean over rectangles; see `vcc.shapes.patterns.Pattern.mean`.

    Args:
        pattern: any.
        x: centres, metres.
        y: centres, metres.
        width: of every rectangle, metres.
        height: of every rectangle, metres.
        decisions: where these are kept, the raster is too.

    Raises:
        InputError: rectangles beyond the raster that was kept.
    """
    if not decisions.lasting:
        return pattern.mean(x, y, width, height)
    return _mean(pattern, Boxes(np.asarray(x, float), np.asarray(y, float), width, height), decisions)


def _mean(pattern: Pattern, boxes: Boxes, decisions: Decisions) -> Array:
    x, y, width, height = boxes
    if isinstance(pattern, Shifted):
        return _mean(pattern.pattern, boxes._replace(x=x - pattern.middle[0], y=y - pattern.middle[1]), decisions)
    if isinstance(pattern, Bounded):
        share_x = overlap_share(x, max(width, pattern.width * 1e-5), pattern.width)
        share_y = overlap_share(y, max(height, pattern.height * 1e-5), pattern.height)
        return _mean(pattern.pattern, boxes, decisions) * share_x * share_y
    if isinstance(pattern, Product) and len(pattern.factors) != 1:
        return _mean_of_product(pattern, boxes, decisions)
    if isinstance(pattern, Product):
        return _mean(pattern.factors[0], boxes, decisions)
    if _closed(pattern):
        return pattern.mean(*boxes)
    rasters = kept_rasters(pattern, boxes, decisions)
    if rasters is None:
        return _in_each(lambda parts: pattern(parts.x, parts.y), boxes)
    across, down = rasters
    found = decisions.made(
        "values of its raster",
        lambda: (content(pattern), content(rasters)),
        lambda: np.asarray(pattern(across.places[None, :], down.places[:, None]), float),
    )
    return _of_raster(found, rasters, boxes)


def _closed(pattern: Pattern) -> bool:
    """Whether a pattern's mean follows rectangles smoothly by itself."""
    if isinstance(pattern, CellApertures) and pattern.lattice.rotation:
        return False
    return type(pattern).mean is not Pattern.mean


def _mean_of_product(product: Product, boxes: Boxes, decisions: Decisions) -> Array:
    """What several patterns let pass together: on a raster whose points hold the products of their means."""
    if not product.factors:
        return np.ones(np.broadcast_shapes(boxes.x.shape, boxes.y.shape))

    def together(parts: Boxes) -> Array:
        means = (mean_or_value(factor, parts, decisions) for factor in product.factors)
        return np.clip(math.prod(means, start=np.ones(1)), 0.0, 1.0)

    rasters = kept_rasters(product, boxes, decisions)
    if rasters is None:
        return _in_each(together, boxes)
    across, down = rasters
    points = Boxes(across.places[None, :], down.places[:, None], across.step, down.step)
    found = decisions.made(
        "values of its raster", lambda: (content(product), content(rasters)), lambda: together(points)
    )
    return _of_raster(found, rasters, boxes)


def _in_each(values: Callable[[Boxes], Array], boxes: Boxes) -> Array:
    """Means by what parts of each rectangle show, which move with it."""
    return np.asarray(np.mean(np.broadcast_arrays(*(values(parts) for parts in parts_of(boxes))), axis=0))


def parts_of(boxes: Boxes) -> list[Boxes]:
    """Each rectangle's parts, one of each at a time."""
    steps = (np.arange(FEWEST_PER_CELL) + 0.5) / FEWEST_PER_CELL - 0.5
    x, y, width, height = boxes
    part = width / FEWEST_PER_CELL, height / FEWEST_PER_CELL
    return [Boxes(x + a * width, y + b * height, *part) for a in steps for b in steps]


def mean_or_value(factor: Pattern, parts: Boxes, decisions: Decisions) -> Array:
    """Means over the parts that points of a raster stand for; without a closed form, values in their middles."""
    plain = factor.pattern if isinstance(factor, Shifted) else factor
    if _closed(plain):
        return _mean(factor, parts, decisions)
    return factor(parts.x, parts.y)


def _of_raster(found: Array, rasters: tuple[Raster, Raster], boxes: Boxes) -> Array:
    """Means over rectangles of what stands between the points of rasters, bilinear, in closed form.

    Of a function that is linear between points, the integral up to a place is a quadratic B-spline of the sums up
    to the borders between points: means have a continuous slope.
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
    """From weights of means over rectangles to weights of what the points of rasters show, (rows, columns)."""
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
    # Each point counts in all sums up to borders behind it.
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
    """Places as numbers of borders between the points of a raster, held where splines find all that they take."""
    return np.clip((at - raster.low) / raster.step, 1.0, raster.places.size - 1.0)


def _up_to(place: Array, borders: int) -> Any:
    """What each border counts for the integral up to places: a sparse matrix (places, borders)."""
    from scipy.sparse import csr_array

    point, counts, _ = three_around(place.reshape(-1), borders)
    rows = np.broadcast_to(np.arange(point.shape[1]), point.shape)
    return csr_array((counts.reshape(-1), (rows.reshape(-1), point.reshape(-1))), shape=(point.shape[1], borders))


# --- rasters ---


def kept_rasters(pattern: Pattern, boxes: Boxes, decisions: Decisions) -> tuple[Raster, Raster] | None:
    """The rasters (across, down) on which a pattern is looked at, always the same; None: in each rectangle."""
    rasters = decisions.keep("raster", lambda: _rasters(pattern, boxes), lambda one, other: True)
    if rasters is None:
        return None
    x, y, width, height = boxes
    for raster, centre, length, bound in zip(rasters, (x, y), (width, height), pattern.size, strict=True):
        low, high = max(centre.min() - length / 2, -bound / 2), min(centre.max() + length / 2, bound / 2)
        tolerance = 1e-9 * raster.length
        if low < high and (low < raster.low - tolerance or high > raster.high + tolerance):
            raise plan_again("where a pattern is looked at")
    return rasters


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
    """`RASTER_PER_CELL` points across a rectangle, fewer where there are many of them, with room around them."""
    room = length + ROOM * float(np.ptp(centre))
    reach = (1 + ROOM) * bound / 2
    low = max(float(centre.min()) - length / 2 - room, -reach)
    high = max(min(float(centre.max()) + length / 2 + room, reach), low)
    across = RASTER_PER_CELL
    while across > FEWEST_PER_CELL and length > 0 and (high - low) / length * across > RASTER_LIMIT:
        across //= 2
    step = length / across
    if step <= 0 or (high - low) / step > LONGEST_RASTER:
        return None
    first, last = math.floor(low / step), max(math.ceil(high / step), math.floor(low / step) + 1)
    return Raster(np.asarray((np.arange(first, last) + 0.5) * step), first * step, last * step)
