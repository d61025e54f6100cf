"""How a light field that is not in memory is cut into blocks that fit."""

from __future__ import annotations

import math
from collections.abc import Iterator
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
"""Sums of rasters that are there at a time: one for each eightfold number of blocks, 512 of them."""
SHARES = 64
"""Blocks by footprints that there are for many to work on at once, at least where each is still worth it."""
READING, VIEWS = 1 / 8, 3
"""Share of the memory that views may take while several are read at once; and views that one is in memory as then:
it is read, unpacked and converted before it has its place."""
WORTH = 2**24
"""Bytes of samples from which on a block of its own is worth what it costs to ask for."""


@dataclass(frozen=True)
class Blocks:
    """How a light field is cut so that each block fits the memory.

    Args:
        rows: the rows of views that are looked at: the first, and the row after the last.
        columns: likewise.
        pixel_rows: rows of pixels of a view.
        pixel_columns: columns of pixels of a view.
        rows_each: rows of views in a block.
        columns_each: columns of views in a block; fewer than there are only where a row is too large.
        pixel_rows_each: rows of pixels in a block; fewer than there are only where a view is too large.
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
        """All of a light field at once."""
        nv, nu, nt, ns = grid.shape[:4]
        return cls((0, nv), (0, nu), nt, ns, nv, nu, nt)

    @classmethod
    def by_column(cls, grid: Grid) -> Blocks:
        """A column of views at a time."""
        nv, nu, nt, ns = grid.shape[:4]
        return cls((0, nv), (0, nu), nt, ns, nv, 1, nt)

    def __iter__(self) -> Iterator[Block]:
        for rows in _parts(*self.rows, self.rows_each):
            for columns in _parts(*self.columns, self.columns_each):
                for pixel_rows in _parts(0, self.pixel_rows, self.pixel_rows_each):
                    yield Block(rows, columns, pixel_rows, (0, self.pixel_columns))

    @property
    def words(self) -> str:
        """How many blocks there are of what."""
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
    """What a block takes of memory.

    Args:
        fixed: bytes that are taken whatever the blocks are: sums, a block's raster, and what the engine needs.
        view: bytes of a view as it is kept.
        times: how many times a block's samples are in memory.
        border: dark views along each axis of a block, those on both of its sides.
        raster: bytes of a block's raster, in double precision.
        by_rays: whether all rays are traced for each block.
        readers: how many views are read at a time.
        bands: into how many bands of rows of pixels the views may be cut so that most rays are traced for one.
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
        """What a plan's blocks take.

        Args:
            plan: whose parts run.
            grid: of the light field.
            engine_memory: bytes that the engine states.
            copies: whether the engine converts all that it is given, as those in NumPy do.
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
        """With what whoever runs blocks for others keeps beside: the results of blocks that are to be summed."""
        return replace(self, fixed=self.fixed + TOGETHER * self.raster)

    def with_readers(self, threads: int, limit: float) -> Need:
        """With views read by several threads, as many as a limit of bytes has room for."""
        return replace(self, readers=max(min(threads, int(READING * limit / (VIEWS * self.view))), 1))

    @property
    def reading(self) -> float:
        """Bytes that are taken while views are read."""
        return VIEWS * self.view * self.readers

    @property
    def least_for_views(self) -> int:
        """Bytes within which blocks are whole views."""
        return math.ceil(self.fixed + 8 * self.view)


def cut(used: NDArray[np.bool_], grid: Grid, need: Need, limit: float) -> Blocks:
    """The largest blocks that keep to a memory limit.

    Args:
        used: which views are looked at, (v, u).
        grid: of the light field.
        need: what the blocks take.
        limit: bytes.

    Raises:
        InputError: a limit that a single row of pixels does not fit.
    """
    _, _, nt, ns = grid.shape[:4]
    rows, columns = _span(used.any(axis=1)), _span(used.any(axis=0))
    high, wide = rows[1] - rows[0], columns[1] - columns[0]
    of = partial(Blocks, rows, columns, nt, ns)
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
        f"memory_limit={math.ceil(limit)} bytes is too little: this picture takes {math.ceil(least / 1e6)} MB "
        f"however small the blocks are, and about {math.ceil(need.least_for_views / 1e6)} MB to go well"
    )


def cut_evenly(used: NDArray[np.bool_], grid: Grid, need: Need, limit: float) -> Blocks:
    """Blocks to work on: those of `cut`, or by footprints smaller ones, so that many may have work at once.

    How many work does not count: the same blocks are the same picture, byte for byte. By rays blocks are as large
    as may be, since all rays are traced for each; or they are bands of rows of pixels of all views, where it is
    known which rays look at them.

    Args:
        used: as for `cut`.
        grid: as for `cut`.
        need: as for `cut`.
        limit: bytes for each of them.

    Raises:
        InputError: as `cut`.
    """
    if need.by_rays:
        return _in_bands(used, grid, need, limit) or cut(used, grid, need, limit)
    views = int(used.sum())
    # What comes of a block, its raster, is to be little beside it.
    each = max(views * need.view / SHARES, WORTH, 8.0 * need.raster, need.view)
    return cut(used, grid, need, min(limit, need.fixed + need.reading + need.times * each))


def _in_bands(used: NDArray[np.bool_], grid: Grid, need: Need, limit: float) -> Blocks | None:
    """Bands of rows of pixels of all views, as large as fit; None where all fit, or where too many are needed."""
    _, _, nt, ns = grid.shape[:4]
    rows, columns = _span(used.any(axis=1)), _span(used.any(axis=0))
    high, wide = rows[1] - rows[0], columns[1] - columns[0]
    total, spare = high * wide * need.view, (limit - need.fixed - need.reading) / need.times
    if spare <= 0:
        return None
    each = int(spare / total * nt)
    if not 1 <= each < nt or math.ceil(nt / each) > need.bands:
        return None
    return Blocks(rows, columns, nt, ns, high, wide, each)


def _span(used: Any) -> tuple[int, int]:
    """The first of those that are used, and the one after the last."""
    found = np.flatnonzero(used)
    return int(found[0]), int(found[-1]) + 1
