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

from vcc.base.describe import Brief
from vcc.plan.rays.model import Rays
from vcc.plan.rays.reach import Reach

TILES = 64, 48, 32, 24, 16, 8
"""Pixels a side of the tiles that are tried."""
CACHE = 2**22
"""Bytes of what a tile looks at, at most: as much as caches hold for each thread."""
MOST = 3
"""How many times each sample is filtered, at most, where tiles look at the same ones."""


@dataclass(frozen=True, eq=False, repr=False)
class Patches(Brief):
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
    reach, (nv, nu, nt, ns) = core.reach, core.views
    if reach is None or not core.between_views:
        return None
    for tile in TILES:
        across, down = (_along(reach, axis, tile, core.views) for axis in (0, 1))
        if across is None or down is None:
            return None
        (columns, wide), (rows, high) = across, down
        if nv * nu * high * wide * sample_bytes <= CACHE:
            filtered = len(rows) * len(columns) * high * wide
            return Patches(tile, rows, columns, (high, wide)) if filtered <= MOST * nt * ns else None
    return None


def rows_that_look(core: Rays, tile: int) -> list[int]:
    """The first rows of the rows of tiles from which rays may look at any row of the views' pixels.

    A band of a light field that is read in parts is looked at from a part of the sensor.

    Args:
        core: what is traced.
        tile: pixels a side.
    """
    first = np.arange(0, core.raster_shape[0], tile)
    if core.reach is not None:
        last = np.minimum(first + tile, core.raster_shape[0]) - 1
        found = core.reach.samples(1, first, last, core.views[0])
        if found is not None:
            low, high = found[0].min(axis=1), found[1].max(axis=1)
            first = first[(high > -1) & (low < core.views[2])]
    return [int(row) for row in first]


def _along(reach: Reach, axis: int, tile: int, shape: tuple[int, ...]) -> tuple[NDArray[np.int64], int] | None:
    """The first pixel along an axis that each tile looks at in each view, (tiles, views); how many it looks at."""
    pixels, sensor = shape[3 - axis], reach.raster_shape[1 - axis]
    first = np.arange(0, sensor, tile)
    found = reach.samples(axis, first, np.minimum(first + tile, sensor) - 1, shape[1 - axis])
    if found is None:
        return None
    start, last = (np.clip(np.floor(ends), -2, pixels).astype(np.int64) for ends in found)
    start, stop = np.clip(start, 0, pixels - 1), np.clip(last + 2, 1, pixels)
    size = int(max((stop - start).max(), 1))
    return np.ascontiguousarray(np.minimum(start, pixels - size)), size
