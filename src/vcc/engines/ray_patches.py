"""Which parts of the views the rays of some pixels look at, where all that they meet is affine.

A plain lens sends the rays of each pixel to all views, but in each of them to a few samples only, which
neighbouring pixels share. Looked up in the views as they lie in memory, almost every ray waits for a line of
memory of its own. Here what a tile of pixels looks at is copied next to one another, where it stays in the cache,
and is filtered on its way there: no filtered copy of the light field is made.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.plan.rays.model import Rays
from vcc.plan.rays.steps import Disc, Move, Rectangle
from vcc.plan.rays.windows import Window

Array = NDArray[np.float64]

TILES = 64, 48, 32, 24, 16, 8
"""Pixels a side of the tiles that are tried."""
CACHE = 2**22
"""Bytes of what a tile looks at, at most: as much as caches hold for each thread."""
MOST = 3
"""How many times each sample is filtered, at most, where tiles look at the same ones."""
MARGIN = 1e-6
"""Pixels by which parts are larger than rays reach, which rounding cannot exceed."""


@dataclass(frozen=True, eq=False)
class Patches:
    """What tiles of pixels look at.

    Args:
        tile: pixels a side.
        rows: (tiles down, v), the first row that a row of tiles looks at in each row of views.
        columns: (tiles across, u), likewise the first column.
        size: rows and columns of each part.
    """

    tile: int
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    size: tuple[int, int]


def patches_of(core: Rays, sample_bytes: int) -> Patches | None:
    """The parts of views that tiles of pixels look at; None where that is not known, or not worth it.

    Args:
        core: what is traced.
        sample_bytes: of a sample, all channels.
    """
    index = _index_from_sensor(core)
    if index is None or not core.between_views or not isinstance(core.aim, Window) or core.aim.slope_from_scatter:
        return None
    nv, nu, nt, ns = core.views
    for tile in TILES:
        across, down = (_along(core, index, axis, tile) for axis in (0, 1))
        if across is None or down is None:
            return None
        (columns, wide), (rows, high) = across, down
        if nv * nu * high * wide * sample_bytes <= CACHE:
            filtered = len(rows) * len(columns) * high * wide
            return Patches(tile, rows, columns, (high, wide)) if filtered <= MOST * nt * ns else None
    return None


def _index_from_sensor(core: Rays) -> Array | None:
    """Indices from rays at the sensor, 5×5; None where that is no affine map, or x and y mix in it."""
    total = Affine.identity()
    for step in core.steps:
        if isinstance(step, Move):
            total = step.before_from_behind @ total
        elif not isinstance(step, Disc | Rectangle):
            return None
    matrix = (core.index_from_ray @ total).matrix
    mixed = np.r_[matrix[[0, 0, 2, 2], [1, 3, 1, 3]], matrix[[1, 1, 3, 3], [0, 2, 0, 2]]]
    if mixed.any() or core.motion[0, 1] or core.motion[1, 0]:
        return None
    return matrix


def _along(core: Rays, index: Array, axis: int, tile: int) -> tuple[NDArray[np.int64], int] | None:
    """The first pixel along an axis that each tile looks at in each view, (tiles, views); how many it looks at."""
    views, pixels = core.views[1 - axis], core.views[3 - axis]
    sensor = core.raster_shape[1 - axis]
    view_from_place, view_from_slope, view_offset = index[axis, [axis, 2 + axis, 4]]
    from_place, from_slope, offset = index[2 + axis, [axis, 2 + axis, 4]]
    if view_from_slope == 0 or views < 2:
        return None
    first = np.arange(0, sensor, tile)
    last = np.minimum(first + tile, sensor) - 1
    half = core.sensitive[axis] / 2
    places = core.first_pixel[axis] + core.pitch[axis] * np.stack([first, last], axis=-1)
    low, high = np.sort(places, axis=-1).T
    places = np.stack([low - half, high + half], axis=-1)  # (tiles, 2)
    # A view is looked at by rays that pass it within a view on either side, beyond the outermost by half of one.
    view = np.arange(views)
    passed = np.clip(np.stack([view - 1.0, view + 1.0]), -0.5, views - 0.5)  # (2, views)
    # At place x and view index i the slope is (i − a·x − c)/b: pixel indices are linear in x and i.
    per_view = from_slope / view_from_slope
    from_x = from_place - per_view * view_from_place
    at = (
        from_x * places[:, :, None, None]
        + per_view * (passed - view_offset)
        + offset
        + core.motion[axis, axis] * (passed - view)
    ).reshape(len(first), 4, views)
    start = np.clip(np.floor(at.min(axis=1) - MARGIN), 0, pixels - 1).astype(np.int64)
    stop = np.clip(np.floor(at.max(axis=1) + MARGIN) + 2, 1, pixels).astype(np.int64)
    size = int(max((stop - start).max(), 1))
    return np.ascontiguousarray(np.minimum(start, pixels - size)), size
