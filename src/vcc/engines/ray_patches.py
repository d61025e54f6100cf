"""The parts of the views that rays of a tile of pixels read, if all steps of the rays are affine.

A plain lens sends the rays of each pixel to all views, but to a few samples in each view, which neighbouring
pixels share. If rays read the views in place, almost every ray waits for its own cache line. Instead, the parts
that a tile of pixels reads are copied next to each other, where they stay in the cache. They are filtered while
they are copied: no filtered copy of the light field is made.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.plan.rays.model import Rays
from vcc.plan.rays.reach import Reach

TILES = 64, 48, 32, 24, 16, 8
"""Sides, in pixels, of the tiles that are tried."""
CACHE = 2**22
"""Largest size, in bytes, of the parts that a tile reads: the cache of one thread."""
MOST = 3
"""Largest number of times that each sample is filtered because several tiles read it."""


@dataclass(frozen=True, eq=False, repr=False)
class Patches(Brief):
    """The parts of views that tiles of pixels read.

    Args:
        tile: side of a tile in pixels.
        rows: (tiles down, v), the first row that a row of tiles reads in each row of views.
        columns: (tiles across, u), the first column that a column of tiles reads in each column of views.
        size: rows and columns of each part.
    """

    tile: int
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    size: tuple[int, int]


def patches_of(core: Rays, sample_bytes: int) -> Patches | None:
    """The parts of views that tiles of pixels read; None if they are unknown or copying them does not pay.

    Args:
        core: the rays to trace.
        sample_bytes: bytes of a sample, all channels.
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
    """The first rows of the rows of tiles from which rays may reach any row of the views' pixels.

    If a band of a light field is read from disk, only a part of the sensor sees it.

    Args:
        core: the rays to trace.
        tile: side of a tile in pixels.
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
    """The first pixel along an axis that each tile reads in each view, (tiles, views), and their number."""
    pixels, sensor = shape[3 - axis], reach.raster_shape[1 - axis]
    first = np.arange(0, sensor, tile)
    found = reach.samples(axis, first, np.minimum(first + tile, sensor) - 1, shape[1 - axis])
    if found is None:
        return None
    start, last = (np.clip(np.floor(ends), -2, pixels).astype(np.int64) for ends in found)
    start, stop = np.clip(start, 0, pixels - 1), np.clip(last + 2, 1, pixels)
    size = int(max((stop - start).max(), 1))
    return np.ascontiguousarray(np.minimum(start, pixels - size)), size
