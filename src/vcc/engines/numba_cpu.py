"""The fast engine: the plan's sum in compiled loops over contiguous rows, on two or more CPU threads.

All views of one column are first summed row by row in the columns of the samples, where memory is
contiguous and every byte is converted where it is used; then the sum is resampled across once per column of
views instead of once per view. Threads take bands of the picture's rows, so none waits for another and the
result does not depend on how many there are. No 4-D intermediate is made: memory is a few bands of rows.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.engines import numba_kernels as kernels
from vcc.engines.smear import finish
from vcc.plan.footprint import REACH, Division, taps
from vcc.plan.model import Plan

Progress = Callable[[int, int], None]

BAND = 32
"""Rows of the picture that a thread works on at once: their sums stay in the second-level cache."""
MASKED_BAND = 64
"""Likewise with masks: more rows, so that rows weighted for the band's ends are seldom made twice."""


def run(plan: Plan, values: NDArray[Any], progress: Progress | None = None) -> NDArray[Any]:
    """The picture of samples (v, u, t, s[, channels]) by a plan, float32; see `vcc.engines.run_plan`."""
    channels = values.shape[4] if values.ndim == 5 else 1
    rows, columns = plan.raster_shape
    raster = np.zeros((rows, columns, channels), dtype=np.float32)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        alike = all(np.ptp(m.column, axis=0).max() < 1e-6 > np.ptp(m.row, axis=1).max() for m in plan.masks)
        if plan.separable and alike:
            separable = _Separable(plan, channels)
            separable.add(values, raster.reshape(rows, -1), pool, progress)
            if separable.mirrored:
                raster = raster[:, ::-1]
        else:
            _add_sheared(plan, values, raster, pool, progress)
    picture = finish(plan, raster)
    return picture if values.ndim == 5 else picture[..., 0]


@dataclass(frozen=True)
class _Block:
    """Samples that lie in memory row by row, and the view taps that read them.

    Args:
        samples: (v, u, t, columns × channels), C-contiguous.
        tap_rows: which rows of taps read it.
        tap_columns: which columns of taps.
        view_rows: the row of ``samples`` that each row of taps reads.
        view_columns: the column of ``samples`` that each column of taps reads.
    """

    samples: NDArray[Any]
    tap_rows: NDArray[np.int64]
    tap_columns: NDArray[np.int64]
    view_rows: NDArray[np.int64]
    view_columns: NDArray[np.int64]


class _FineGrid:
    """The samples of a view after division: how many, the index of the first, and how they are made."""

    def __init__(self, plan: Plan, channels: int) -> None:
        self.samples = self.rows, self.columns = plan.samples
        self.first_row = self.first_column = 0.0
        self.divided_as: tuple[Division, Division] | None = None
        nothing = (np.zeros(0, dtype=np.int64), np.zeros((0, 3), dtype=np.float32))
        self.tables = (*nothing, *nothing, channels)
        if plan.refine > 1:
            down, across = (plan.division(n) for n in plan.samples)
            self.rows, self.columns = len(down.first), len(across.first)
            self.first_row, self.first_column = down.start, across.start
            self.divided_as = down, across
            self.tables = (down.first, _in_threes(down.shares), across.first, _in_threes(across.shares), channels)

    @cached_property
    def matrices(self) -> tuple[NDArray[np.float64], ...]:
        """The division of rows and of columns as matrices, made once for all views."""
        assert self.divided_as is not None
        return tuple(part.matrix(n) for part, n in zip(self.divided_as, self.samples, strict=True))

    def divided(self, view: NDArray[Any]) -> NDArray[np.float32]:
        """A view (t, s, channels) with its samples divided, for plans in which rows and columns do not part."""
        if self.divided_as is None:
            return np.ascontiguousarray(view, dtype=np.float32)
        down, across = self.matrices
        fine = np.einsum("at,bs,tsc->abc", down, across, view.astype(np.float32), optimize=True)
        return np.ascontiguousarray(fine, dtype=np.float32)


def _blocks(plan: Plan, values: NDArray[Any], by_column: bool) -> Iterator[_Block]:
    """The samples in pieces that kernels can read, without ever copying more than a column of views."""
    nv, nu, nt = values.shape[:3]
    all_rows, all_columns = np.arange(len(plan.view_rows)), np.arange(len(plan.view_columns))
    readable = values.flags.c_contiguous and values.dtype != np.float16
    if readable and not by_column:
        yield _Block(values.reshape(nv, nu, nt, -1), all_rows, all_columns, plan.view_rows, plan.view_columns)
        return
    for a in np.flatnonzero((plan.weights != 0).any(axis=0)):
        i = plan.view_columns[a : a + 1]
        if readable:
            yield _Block(values.reshape(nv, nu, nt, -1), all_rows, all_columns[a : a + 1], plan.view_rows, i)
            continue
        kind = np.float32 if values.dtype == np.float16 else values.dtype  # no half precision in compiled code
        column = np.ascontiguousarray(values[:, i[0] : i[0] + 1], dtype=kind).reshape(nv, 1, nt, -1)
        yield _Block(column, all_rows, all_columns[a : a + 1], plan.view_rows, np.zeros(1, dtype=np.int64))


class _Separable:
    """Tables for plans in which rows and columns part, and the loop over blocks and bands."""

    def __init__(self, plan: Plan, channels: int) -> None:
        self.plan, self.channels = plan, channels
        self.fine = fine = _FineGrid(plan, channels)
        rows, columns = plan.raster_shape
        start_y = plan.y[:, 0] + plan.row_step * fine.first_row
        start_x = plan.x[0] + plan.column_step * fine.first_column
        row_step, column_step = plan.row_step / plan.refine, plan.column_step / plan.refine
        self.down = taps(plan.interpolation, start_y, row_step, fine.rows, rows, plan.opening)
        self.across = taps(plan.interpolation, start_x, column_step, fine.columns, columns, plan.opening)
        # A real image runs against its samples: the raster is then filled in mirror writing, so that samples
        # and pixels are read and written in the same direction.
        self.mirrored = column_step < 0
        if self.mirrored:
            self.across = self.across.mirrored()
        self.down_shares, self.across_shares = _in_threes(self.down.weights), _in_threes(self.across.weights)
        self.alike = _alike(self.across.first, self.across_shares)
        self.masked = bool(plan.masks) or plan.refine > 1
        # Finer samples make more rows for the same band of the raster.
        self.band_rows = max(MASKED_BAND // plan.refine, 8) if self.masked else BAND
        self.weights = (plan.weights * plan.scale).astype(np.float32)
        # Masks' textures one after another: how many rows each has, where they begin, and which mask row the
        # first row of samples of each tap row looks up, and the step from there.
        self.mask_rows = np.array([len(mask.texture) for mask in plan.masks], dtype=np.int64)
        self.mask_start = np.cumsum(self.mask_rows) - self.mask_rows
        row = [mask.row[:, 0] + mask.step[1, 1] * fine.first_row for mask in plan.masks]
        self.mask_row = np.array(row).reshape(-1, len(plan.view_rows))
        self.mask_row_step = np.array([mask.step[1, 1] / plan.refine for mask in plan.masks], dtype=np.float64)

    def add(
        self,
        values: NDArray[Any],
        raster: NDArray[np.float32],
        pool: ThreadPoolExecutor,
        progress: Progress | None,
    ) -> None:
        """Add all samples to the raster (rows, columns × channels)."""
        masked, total, done = self.masked, self.plan.taps_used, 0
        by_column = masked or progress is not None
        width = self.fine.columns * self.channels
        room = np.empty((int(self.mask_rows.sum()), width), dtype=np.float32) if masked else None
        for block in _blocks(self.plan, values, by_column):
            if room is not None:
                self.sample_mask_columns(int(block.tap_columns[0]), pool, room)
            starts = range(0, len(raster), self.band_rows)
            list(pool.map(partial(self.band, block, room, raster), starts))
            if progress is not None:
                done += int(np.count_nonzero(self.weights[np.ix_(block.tap_rows, block.tap_columns)]))
                progress(done, total)

    def band(
        self, block: _Block, masks: NDArray[np.float32] | None, raster: NDArray[np.float32], start: int
    ) -> None:
        """Add one block's samples to a band of raster rows."""
        stop = min(start + self.band_rows, len(raster))
        rows, columns = block.tap_rows, block.tap_columns
        first_row, row_shares = self.down.first[rows], self.down_shares[rows]
        weights = self.weights[np.ix_(rows, columns)]
        if masks is None:
            kernels.add_band(
                block.samples, block.view_rows, block.view_columns, weights, first_row, row_shares,
                self.across.first[columns], self.across_shares[columns], self.alike[columns], self.channels,
                start, stop, raster,
            )  # fmt: skip
            return
        (a,), (view_column,) = columns, block.view_columns
        kernels.add_masked_band(
            block.samples, block.view_rows, view_column, weights[:, 0], first_row, row_shares, self.fine.tables,
            masks, self.mask_start, self.mask_rows, self.mask_row[:, rows], self.mask_row_step,
            self.across.first[a], self.across_shares[a], self.alike[a], self.channels, start, stop, raster,
        )  # fmt: skip

    def sample_mask_columns(self, a: int, pool: ThreadPoolExecutor, out: NDArray[np.float32]) -> None:
        """Fill ``out`` with all masks' rows, one mask after another, at the samples' columns of tap column a."""
        index = self.fine.first_column + np.arange(self.fine.columns) / self.plan.refine

        def sample(mask_and_start: tuple[int, int]) -> None:
            number, begin = mask_and_start
            mask = self.plan.masks[number]
            place = mask.column[0, a] + mask.step[0, 0] * index
            end = min(begin + 100, len(mask.texture))
            offset = self.mask_start[number]
            kernels.sample_mask_columns(
                mask.texture[begin:end], place, self.channels, out[offset + begin : offset + end]
            )

        pieces = [(n, begin) for n in range(len(self.plan.masks)) for begin in range(0, self.mask_rows[n], 100)]
        list(pool.map(sample, pieces))


def _in_threes(shares: NDArray[Any]) -> NDArray[np.float32]:
    """Shares (…, width) with zeros added until their number is a multiple of three, as the kernels want them."""
    extra = -shares.shape[-1] % 3
    padded = np.pad(shares, [(0, 0)] * (shares.ndim - 1) + [(0, extra)])
    return np.ascontiguousarray(padded, dtype=np.float32)


def _alike(first: NDArray[np.int64], shares: NDArray[np.float32]) -> NDArray[np.int64]:
    """(begin, end) of the columns around the middle that gather successive samples with the same shares.

    They are all but the borders where a sample is as large as a pixel, a common choice; else there are none.
    """
    columns = first.shape[1]
    column, middle = np.arange(columns), columns // 2
    place = first - column
    same = (place == place[:, middle : middle + 1]) & (np.abs(shares - shares[:, middle : middle + 1]) < 1e-6).all(
        axis=-1
    )
    begin = np.where(~same & (column < middle), column, -1).max(axis=1) + 1
    end = np.where(~same & (column > middle), column, columns).min(axis=1)
    return np.stack([begin, end], axis=1)


def _add_sheared(
    plan: Plan,
    values: NDArray[Any],
    raster: NDArray[np.float32],
    pool: ThreadPoolExecutor,
    progress: Progress | None,
) -> None:
    """Add all samples to the raster (rows, columns, channels) where rows and columns do not part."""
    fine = _FineGrid(plan, 1)
    size = np.array([mask.texture.shape for mask in plan.masks], dtype=np.int64).reshape(-1, 2)
    textures = np.zeros((len(plan.masks), *size.max(axis=0, initial=1)), dtype=np.float32)
    for texture, mask in zip(textures, plan.masks, strict=True):
        texture[: mask.texture.shape[0], : mask.texture.shape[1]] = mask.texture
    mask_step = np.array([mask.step for mask in plan.masks]).reshape(-1, 2, 2)
    row_step, column_step = plan.row_step, plan.column_step
    code = list(REACH).index(plan.interpolation)
    for done, (b, a) in enumerate(zip(*np.nonzero(plan.weights), strict=True)):
        if progress is not None:
            progress(done, plan.taps_used)
        view = fine.divided(values[plan.view_rows[b], plan.view_columns[a]].reshape(*plan.samples, -1))
        place = np.array([[mask.column[b, a], mask.row[b, a]] for mask in plan.masks]).reshape(-1, 2)

        def band(start: int, view=view, place=place, b=b, a=a) -> None:  # type: ignore[no-untyped-def]
            kernels.sheared_view(
                view, plan.weights[b, a] * plan.scale, code, REACH[plan.interpolation],
                plan.x[b, a], plan.y[b, a], plan.step, plan.shear, row_step, column_step,
                row_step / plan.refine, column_step / plan.refine, fine.first_column, fine.first_row,
                plan.refine, textures, size, place, mask_step, start, min(start + BAND, len(raster)), plan.opening,
                raster,
            )  # fmt: skip

        list(pool.map(band, range(0, len(raster), BAND)))
    if progress is not None:
        progress(plan.taps_used, plan.taps_used)
