"""The transpose of `rays_compiled`: gradients of a raster by rays to samples, on several threads.

Rays are traced again and stored, some tiles at a time. Then the rays that meet a row of views are added to it,
in the order of tiles. One thread adds a ray between two rows of views to both, so threads work on every other
row at the same time. The order of all sums depends on the raster only, and so do the bytes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.engines import ray_loops as kernels
from vcc.engines import ray_tables as tables
from vcc.engines.rays_compiled import TILE, given, working_arrays
from vcc.plan.rays.model import Rays

KEPT = 2**19
"""Number of rays stored at a time: some 50 MiB."""
TILES = 16
"""Number of tiles traced at a time."""
IN_DOUBLE = 2**22
"""Largest number of values of a light field for sums in double precision (32 MiB): the fewer samples there are,
the more rays meet each of them."""


def scattered(
    core: Rays,
    shape: tuple[int, ...],
    raster: NDArray[Any],
    beside: int,
    threads: int,
    progress: Progress | None = None,
) -> NDArray[np.float32]:
    """The derivative of a weighted sum of the raster's values, from one round of rays, to each sample.

    Products with weights are in single precision, as in `rays_compiled.traced`. Sums are in single precision if
    the light field has more than `IN_DOUBLE` values.

    Args:
        core: the rays to trace.
        shape: of the samples, (v, u, t, s[, channels]).
        raster: the weights, (rows, columns, channels).
        beside: 0 for the blocks of points of the first round, 1 for the blocks next to them.
        threads: number of threads; the bytes do not depend on it.
        progress: called with (done, total) in pixels.
    """
    weights = np.ascontiguousarray(raster * (core.scale / core.samples), dtype=np.float32).reshape(-1)
    kind = np.float64 if math.prod(shape) <= IN_DOUBLE else np.float32
    grown = tables.Grown(
        np.zeros(math.prod(shape), dtype=kind),
        core.views,
        raster.shape[2],
        np.ascontiguousarray(core.motion),
        bool(core.between_views),
    )
    with Workers(threads) as pool:
        kept = _Kept(core, beside, pool)
        step = 2 if grown.between else 1
        for done in kept.rounds():
            for first in range(step):
                spread = partial(kernels.spread_row, grown, weights, kept.ordered, kept.begin)
                list(pool.map(spread, range(first, core.views[0], step)))
            tell(progress, done, math.prod(core.raster_shape))
    return grown.values.reshape(shape).astype(np.float32, copy=False)


class _Kept:
    """Where rays meet the light field, some tiles at a time.

    Args:
        core: the rays to trace.
        beside: see `scattered`.
        pool: the threads.

    Attributes:
        ordered: (tiles, rays, 6), see `vcc.engines.ray_tables.Found`.
        begin: (tiles, views + 1), likewise.
    """

    def __init__(self, core: Rays, beside: int, pool: Workers) -> None:
        look = tables.Look(
            core.views,
            core.index_from_ray.matrix[:4].copy(),
            np.ascontiguousarray(core.motion),
            bool(core.between_views),
        )
        self._find = partial(kernels.find_tile, look, *given(core, beside), pool.ended)
        self._pool, self._core = pool, core
        most = core.samples * core.most_cells  # largest number of rays of one pixel
        tiles = max(min(TILES, KEPT // most), 1)
        room = max(KEPT // tiles, most)
        self.ordered = np.empty((tiles, room, 6))
        self.begin = np.zeros((tiles, core.views[0] * core.views[1] + 1), dtype=np.int64)
        self._places, self._views = np.empty((tiles, room, 6)), np.empty((tiles, room), dtype=np.int32)

    def rounds(self) -> Iterator[int]:
        """Trace pixels until the buffers are full, repeatedly; yield the number of pixels traced so far."""
        rows, columns = self._core.raster_shape
        tiles = [
            tables.Tile(r, r + TILE, c, c + TILE) for r in range(0, rows, TILE) for c in range(0, columns, TILE)
        ]
        coming, done = iter(tiles), 0
        begun: list[tuple[int, tables.Tile]] = []  # (next pixel of the tile, tile)
        while begun := begun + [(0, tile) for tile in islice(coming, len(self.ordered) - len(begun))]:
            reached = list(self._pool.map(self._traced, range(len(begun)), begun))
            self.begin[len(begun) :] = 0
            done += sum(reached) - sum(start for start, _ in begun)
            yield done
            tiles_of = zip(reached, begun, strict=True)
            begun = [
                (next_one, tile) for next_one, (_, tile) in tiles_of if next_one < _pixels(tile, rows, columns)
            ]

    def _traced(self, slot: int, part: tuple[int, tables.Tile]) -> int:
        found = tables.Found(self._places[slot], self._views[slot], self.ordered[slot], self.begin[slot])
        return int(self._find(*part, found, working_arrays()))


def _pixels(tile: tables.Tile, rows: int, columns: int) -> int:
    return (min(tile.end_row, rows) - tile.first_row) * (min(tile.end_column, columns) - tile.first_column)
