"""Cut a light field that is not in memory into blocks that fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.fields.grid import Block, Grid
from vcc.plan.model import Plan
from vcc.run.executors import TOGETHER

SUMS = 3
"""Partial sums in memory at a time: one per factor of 8 in the number of blocks, enough for 512 blocks."""
SHARES = 64
"""Smallest number of blocks with footprints, to keep many workers busy, if the blocks are not too small."""
READING, VIEWS = 1 / 8, 3
"""Share of the memory for views while several are read at once; and copies of each view during reading: it is
read, unpacked and converted before it is stored in the block."""
WORTH = 2**24
"""Bytes of samples below which a separate block is not worth its overhead."""


@dataclass(frozen=True)
class Blocks:
    """How a light field is cut so that each block fits the memory.

    Args:
        rows: rows of views that are used: the first, and the one after the last.
        columns: columns of views, likewise.
        pixel_rows: rows of pixels of a view.
        pixel_columns: columns of pixels of a view.
        rows_each: rows of views in a block.
        columns_each: columns of views in a block; fewer than all only if a row of views does not fit.
        pixel_rows_each: rows of pixels in a block; fewer than all only if a view does not fit.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    pixel_rows: int
    pixel_columns: int
    rows_each: int
    columns_each: int
    pixel_rows_each: int

    @classmethod
    def one(cls, grid: Grid) -> Blocks:
        """The whole light field as one block."""
        nv, nu, nt, ns = grid.shape[:4]
        return cls((0, nv), (0, nu), nt, ns, nv, nu, nt)

    @classmethod
    def by_column(cls, grid: Grid) -> Blocks:
        """One block per column of views."""
        nv, nu, nt, ns = grid.shape[:4]
        return cls((0, nv), (0, nu), nt, ns, nv, 1, nt)

    def __iter__(self) -> Iterator[Block]:
        for rows in _parts(*self.rows, self.rows_each):
            for columns in _parts(*self.columns, self.columns_each):
                for pixel_rows in _parts(0, self.pixel_rows, self.pixel_rows_each):
                    yield Block(rows, columns, pixel_rows, (0, self.pixel_columns))

    @property
    def words(self) -> str:
        """The number and the size of the blocks, as text."""
        count = sum(1 for _ in self)
        if self.pixel_rows_each < self.pixel_rows and (self.rows_each, self.columns_each) != (1, 1):
            return f"{count} blocks of up to {self.pixel_rows_each} rows of pixels of all views"
        if self.pixel_rows_each < self.pixel_rows:
            return f"{count} blocks of {self.pixel_rows_each} rows of pixels of a view"
        views = f"{self.rows_each}×{self.columns_each} views"
        return f"one block of {views}" if count == 1 else f"{count} blocks of up to {views}"


def _parts(first: int, stop: int, each: int) -> Iterator[tuple[int, int]]:
    """(first, stop) cut evenly into parts of at most ``each``."""
    count = math.ceil((stop - first) / each)
    for n in range(count):
        yield first + (stop - first) * n // count, first + (stop - first) * (n + 1) // count


@dataclass(frozen=True)
class Need:
    """Memory that a block needs.

    Args:
        fixed: bytes independent of the block size: sums, a block's raster, and the engine's memory.
        view: bytes of a view as stored in the block.
        times: how many copies of a block's samples are in memory.
        border: dark views along each axis of a block, both sides together.
        raster: bytes of a block's raster, in double precision.
        by_rays: whether all rays are traced for each block.
        readers: how many views are read at a time.
        bands: the largest number of bands of pixel rows for which most rays need only one band.
    """

    fixed: int
    view: float
    times: float
    border: int
    raster: int
    by_rays: bool
    readers: int = 1
    bands: int = 1

    @classmethod
    def of(cls, plan: Plan, grid: Grid, engine_memory: int, copies: bool) -> Need:
        """Memory that the blocks of a plan need.

        Args:
            plan: the plan.
            grid: of the light field.
            engine_memory: bytes that the engine reports.
            copies: whether the engine converts its input, as NumPy engines do.
        """
        kept = plan.kept_as(grid.kind)[0].itemsize
        pixels = math.prod(plan.core.raster_shape) * (grid.channels or 1)
        grown = math.prod(plan.shape(grid.shape)[2:]) * kept
        times = 1 + 16 / kept if copies else 1.0
        border = max(2 * plan.core.border + sum(beside) for beside in plan.halo[:2])
        raster = (16 if plan.by_rays else 8) * pixels
        single = 4 * pixels if plan.by_rays else 0
        return cls((1 + SUMS) * raster + single + engine_memory, grown, times, border, raster, plan.by_rays)

    def with_sums(self) -> Need:
        """With memory for block results that wait to be summed, as when an executor runs the blocks."""
        return replace(self, fixed=self.fixed + TOGETHER * self.raster)

    def with_readers(self, threads: int, limit: float) -> Need:
        """With several threads that read views, as many as fit a limit in bytes."""
        return replace(self, readers=max(min(threads, int(READING * limit / (VIEWS * self.view))), 1))

    @property
    def reading(self) -> float:
        """Bytes needed while views are read."""
        return VIEWS * self.view * self.readers

    @property
    def least_for_views(self) -> int:
        """The smallest memory in bytes for blocks of whole views."""
        return math.ceil(self.fixed + 8 * self.view)


def cut(used: NDArray[np.bool_], grid: Grid, need: Need, limit: float) -> Blocks:
    """The largest blocks within a memory limit.

    Args:
        used: which views are used, (v, u).
        grid: of the light field.
        need: memory of the blocks.
        limit: bytes.

    Raises:
        InputError: a limit that does not fit a single row of pixels.
    """
    nt = grid.shape[2]
    of, high, wide = _of_views(used, grid)
    view, border = need.view, need.border
    spare = max(limit - need.fixed - need.reading, 0.0) / need.times
    if spare >= view * high * wide:  # a single block has no neighbours and needs no border
        return of(high, wide, nt)
    rows_each = int(spare // (view * (wide + border))) - border
    if rows_each >= 1:
        return of(min(rows_each, high), wide, nt)
    columns_each = int(spare // (view * (1 + border))) - border
    if columns_each >= 1:
        return of(1, min(columns_each, wide), nt)
    pixel_row = view / nt * (VIEWS + need.times * (1 + border) ** 2)
    pixel_rows_each = int(max(limit - need.fixed, 0.0) // pixel_row)
    if pixel_rows_each >= 1:
        return of(1, 1, min(pixel_rows_each, nt))
    least = need.fixed + pixel_row
    raise InputError(
        f"memory_limit={math.ceil(limit)} bytes is too little: this image needs {math.ceil(least / 1e6)} MB "
        f"even with the smallest blocks, and about {math.ceil(need.least_for_views / 1e6)} MB to be efficient"
    )


def cut_evenly(used: NDArray[np.bool_], grid: Grid, need: Need, limit: float) -> Blocks:
    """The blocks of `cut`; with footprints smaller ones, so that many workers can run at once.

    The blocks do not depend on the number of workers, so images are identical to the byte. With rays, blocks are
    as large as possible, since each block traces all rays; or they are bands of pixel rows of all views, if it is
    known which rays use each band.

    Args:
        used: as for `cut`.
        grid: as for `cut`.
        need: as for `cut`.
        limit: bytes per block.

    Raises:
        InputError: as `cut`.
    """
    if need.by_rays:
        return _in_bands(used, grid, need, limit) or cut(used, grid, need, limit)
    views = int(used.sum())
    # The raster, a block's result, should be small compared with its samples.
    each = max(views * need.view / SHARES, WORTH, 8.0 * need.raster, need.view)
    return cut(used, grid, need, min(limit, need.fixed + need.reading + need.times * each))


def _in_bands(used: NDArray[np.bool_], grid: Grid, need: Need, limit: float) -> Blocks | None:
    """The largest bands of pixel rows of all views that fit; None if all views fit, or if too many are needed."""
    nt = grid.shape[2]
    of, high, wide = _of_views(used, grid)
    total, spare = high * wide * need.view, (limit - need.fixed - need.reading) / need.times
    if spare <= 0:
        return None
    each = int(spare / total * nt)
    if not 1 <= each < nt or math.ceil(nt / each) > need.bands:
        return None
    return of(high, wide, each)


def _of_views(used: NDArray[np.bool_], grid: Grid) -> tuple[Callable[[int, int, int], Blocks], int, int]:
    """A function that makes blocks of the used views by size; the numbers of rows and of columns of views."""
    rows, columns = _span(used.any(axis=1)), _span(used.any(axis=0))
    return partial(Blocks, rows, columns, *grid.shape[2:4]), rows[1] - rows[0], columns[1] - columns[0]


def _span(used: Any) -> tuple[int, int]:
    """The index of the first used entry, and the one after the last."""
    found = np.flatnonzero(used)
    return int(found[0]), int(found[-1]) + 1
