"""What samples add to weighted sums of a picture by rays: the transpose of `rays_compiled`, on several threads.

Rays are traced once more and kept, some tiles at a time; then those that meet a row of views are handed to it, in
the order of tiles. A ray between two rows of views is handed to both by one thread, so every other row has its
turn at the same time. What is done in which order follows from the picture alone: so do all bytes.
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
from vcc.engines.rays_compiled import TILE, given
from vcc.plan.rays.model import Rays

KEPT = 2**19
"""Rays that are kept at a time: some 50 MiB."""
TILES = 16
"""Tiles that are traced at a time."""
IN_DOUBLE = 2**22
"""Numbers of a light field up to which sums are kept in double precision, which takes 32 MiB: the fewer samples
there are, the more rays each of them meets."""


def scattered(
    core: Rays,
    shape: tuple[int, ...],
    raster: NDArray[Any],
    beside: int,
    threads: int,
    progress: Progress | None = None,
) -> NDArray[np.float32]:
    """What each sample adds to a weighted sum of the raster's values by one round of rays.

    A weight's products are in single precision, as in `rays_compiled.traced`. Sums are, too, where the light field
    has more than `IN_DOUBLE` numbers.

    Args:
        core: what is traced.
        shape: of the samples, (v, u, t, s[, channels]).
        raster: the weights, (rows, columns, channels).
        beside: 0, or 1 for the blocks of points beside those of the first round.
        threads: how many work at once. The bytes are the same.
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
        core: what is traced.
        beside: see `scattered`.
        pool: of the threads.

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
        most = core.samples * core.most_cells  # that one pixel may have
        tiles = max(min(TILES, KEPT // most), 1)
        room = max(KEPT // tiles, most)
        self.ordered = np.empty((tiles, room, 6))
        self.begin = np.zeros((tiles, core.views[0] * core.views[1] + 1), dtype=np.int64)
        self._places, self._views = np.empty((tiles, room, 6)), np.empty((tiles, room), dtype=np.int32)

    def rounds(self) -> Iterator[int]:
        """Trace as many pixels as there is room for, time and again; yields how many were in all."""
        rows, columns = self._core.raster_shape
        tiles = [
            tables.Tile(r, r + TILE, c, c + TILE) for r in range(0, rows, TILE) for c in range(0, columns, TILE)
        ]
        coming, done = iter(tiles), 0
        begun: list[tuple[int, tables.Tile]] = []  # tiles, and which of their pixels is next
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
        return int(self._find(*part, found))


def _pixels(tile: tables.Tile, rows: int, columns: int) -> int:
    return (min(tile.end_row, rows) - tile.first_row) * (min(tile.end_column, columns) - tile.first_column)
