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
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.engines import numba_kernels as kernels
from vcc.engines.smear import finish
from vcc.plan.footprint import REACH, Taps, refinement_matrix, taps
from vcc.plan.model import Plan

Progress = Callable[[int, int], None]

BAND = 16
"""Rows of the picture that a thread works on at once: their sums stay in the second-level cache."""
MASKED_BAND = 64
"""Likewise with masks: more rows, so that rows weighted for the band's ends are seldom made twice."""


def run(plan: Plan, values: NDArray[Any], progress: Progress | None = None) -> NDArray[Any]:
    """The picture of samples (v, u, t, s[, channels]) by a plan, float32; see `vcc.engines.run_plan`."""
    channels = values.shape[4] if values.ndim == 5 else 1
    rows, columns = plan.raster_shape
    raster = np.zeros((rows, columns, channels), dtype=np.float32)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        if plan.separable:
            _Separable(plan, channels).add(values, raster.reshape(rows, -1), pool, progress)
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


@dataclass(frozen=True)
class _FineGrid:
    """The samples of a view after refinement: how many, and the index of the first."""

    rows: int
    columns: int
    first_row: float
    first_column: float
    down: NDArray[np.float64] | None
    across: NDArray[np.float64] | None

    @classmethod
    def of(cls, plan: Plan) -> _FineGrid:
        if plan.refine == 1:
            return cls(*plan.samples, 0.0, 0.0, None, None)
        down, first_row = refinement_matrix(plan.interpolation, plan.samples[0], plan.refine)
        across, first_column = refinement_matrix(plan.interpolation, plan.samples[1], plan.refine)
        return cls(len(down), len(across), first_row, first_column, down, across)

    def refined(self, view: NDArray[Any]) -> NDArray[np.float32]:
        """A view (t, s, channels) with its samples divided."""
        if self.down is None or self.across is None:
            return np.ascontiguousarray(view, dtype=np.float32)
        from scipy.sparse import csr_array  # a few weights a row

        t, s, channels = view.shape
        tall = csr_array(self.down.astype(np.float32)) @ view.reshape(t, -1).astype(np.float32)
        turned = np.ascontiguousarray(tall.reshape(-1, s, channels).swapaxes(0, 1))
        wide = csr_array(self.across.astype(np.float32)) @ turned.reshape(s, -1)
        return np.ascontiguousarray(wide.reshape(self.columns, self.rows, channels).swapaxes(0, 1))


def _blocks(plan: Plan, values: NDArray[Any], fine: _FineGrid, by_column: bool) -> Iterator[_Block]:
    """The samples in pieces that kernels can read, without ever copying more than a column of views."""
    nv, nu, nt, ns = values.shape[:4]
    all_rows, all_columns = np.arange(len(plan.view_rows)), np.arange(len(plan.view_columns))
    used = plan.weights != 0
    if plan.refine > 1:
        for b, a in zip(*np.nonzero(used), strict=True):
            view = values[plan.view_rows[b], plan.view_columns[a]].reshape(nt, ns, -1)
            samples = fine.refined(view).reshape(1, 1, fine.rows, -1)
            zero = np.zeros(1, dtype=np.int64)
            yield _Block(samples, all_rows[b : b + 1], all_columns[a : a + 1], zero, zero)
        return
    readable = values.flags.c_contiguous and values.dtype != np.float16
    if readable and not by_column:
        yield _Block(values.reshape(nv, nu, nt, -1), all_rows, all_columns, plan.view_rows, plan.view_columns)
        return
    for a in np.flatnonzero(used.any(axis=0)):
        i = plan.view_columns[a]
        if readable:
            yield _Block(
                values.reshape(nv, nu, nt, -1),
                all_rows,
                all_columns[a : a + 1],
                plan.view_rows,
                np.array([i]),
            )
            continue
        kind = np.float32 if values.dtype == np.float16 else values.dtype  # no half precision in compiled code
        column = np.ascontiguousarray(values[:, i : i + 1], dtype=kind).reshape(nv, 1, nt, -1)
        yield _Block(column, all_rows, all_columns[a : a + 1], plan.view_rows, np.zeros(1, dtype=np.int64))


class _Separable:
    """Tables for plans in which rows and columns part, and the loop over blocks and bands."""

    def __init__(self, plan: Plan, channels: int) -> None:
        self.plan, self.channels = plan, channels
        self.fine = fine = _FineGrid.of(plan)
        rows, columns = plan.raster_shape
        start_y = plan.y[:, 0] + plan.row_step * fine.first_row
        start_x = plan.x[0] + plan.column_step * fine.first_column
        row_step, column_step = plan.row_step / plan.refine, plan.column_step / plan.refine
        self.down = taps(plan.interpolation, start_y, row_step, fine.rows, rows)
        self.across = taps(plan.interpolation, start_x, column_step, fine.columns, columns)
        self.down_shares, self.across_shares = _in_threes(self.down), _in_threes(self.across)
        self.weights = (plan.weights * plan.scale).astype(np.float32)

    def add(
        self,
        values: NDArray[Any],
        raster: NDArray[np.float32],
        pool: ThreadPoolExecutor,
        progress: Progress | None,
    ) -> None:
        """Add all samples to the raster (rows, columns × channels)."""
        masked, total, done = bool(self.plan.masks), self.plan.taps_used, 0
        by_column = masked or progress is not None
        for block in _blocks(self.plan, values, self.fine, by_column):
            masks = self.mask_columns(int(block.tap_columns[0]), pool) if masked else None
            starts = range(0, len(raster), MASKED_BAND if masked else BAND)
            list(pool.map(partial(self.band, block, masks, raster), starts))
            if progress is not None:
                done += int(np.count_nonzero(self.weights[np.ix_(block.tap_rows, block.tap_columns)]))
                progress(done, total)

    def band(
        self, block: _Block, masks: NDArray[np.float32] | None, raster: NDArray[np.float32], start: int
    ) -> None:
        """Add one block's samples to a band of raster rows."""
        stop = min(start + (BAND if masks is None else MASKED_BAND), len(raster))
        rows, columns = block.tap_rows, block.tap_columns
        first_row, row_shares = self.down.first[rows], self.down_shares[rows]
        weights = self.weights[np.ix_(rows, columns)]
        if masks is None:
            kernels.add_band(
                block.samples, block.view_rows, block.view_columns, weights, first_row, row_shares,
                self.across.first[columns], self.across_shares[columns], self.channels, start, stop, raster,
            )  # fmt: skip
            return
        (a,), (view_column,) = columns, block.view_columns
        kernels.add_masked_band(
            block.samples, block.view_rows, view_column, weights[:, 0], first_row, row_shares,
            masks, self.mask_start, self.mask_rows, self.mask_row[:, rows], self.mask_row_step,
            self.across.first[a], self.across_shares[a], self.channels, start, stop, raster,
        )  # fmt: skip

    @property
    def mask_rows(self) -> NDArray[np.int64]:
        """How many rows each mask's texture has."""
        return np.array([len(mask.texture) for mask in self.plan.masks])

    @property
    def mask_start(self) -> NDArray[np.int64]:
        """Where each mask's rows begin when all are stacked."""
        return np.cumsum(self.mask_rows) - self.mask_rows

    @property
    def mask_row_step(self) -> NDArray[np.float64]:
        """Mask rows from one row of samples to the next."""
        return np.array([mask.step[1, 1] / self.plan.refine for mask in self.plan.masks])

    @property
    def mask_row(self) -> NDArray[np.float64]:
        """Mask row of the first row of samples, (masks, rows of taps)."""
        first = self.fine.first_row
        return np.stack([mask.row[:, 0] + mask.step[1, 1] * first for mask in self.plan.masks])

    def mask_columns(self, a: int, pool: ThreadPoolExecutor) -> NDArray[np.float32]:
        """All masks' rows, one mask after another, sampled at the columns of the samples of tap column a."""
        out = np.empty((int(self.mask_rows.sum()), self.fine.columns * self.channels), dtype=np.float32)
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
        return out


def _in_threes(table: Taps) -> NDArray[np.float32]:
    """The shares with zeros added until their number is a multiple of three, as the kernels want them."""
    extra = -table.weights.shape[-1] % 3
    return np.pad(table.weights, [(0, 0)] * (table.weights.ndim - 1) + [(0, extra)])


def _add_sheared(
    plan: Plan,
    values: NDArray[Any],
    raster: NDArray[np.float32],
    pool: ThreadPoolExecutor,
    progress: Progress | None,
) -> None:
    """Add all samples to the raster (rows, columns, channels) where rows and columns do not part."""
    fine = _FineGrid.of(plan)
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
        view = fine.refined(values[plan.view_rows[b], plan.view_columns[a]].reshape(*plan.samples, -1))
        place = np.array([[mask.column[b, a], mask.row[b, a]] for mask in plan.masks]).reshape(-1, 2)

        def band(start: int, view=view, place=place, b=b, a=a) -> None:  # type: ignore[no-untyped-def]
            kernels.sheared_view(
                view, plan.weights[b, a] * plan.scale, code, REACH[plan.interpolation],
                plan.x[b, a], plan.y[b, a], plan.step, plan.shear, row_step, column_step,
                row_step / plan.refine, column_step / plan.refine, fine.first_column, fine.first_row,
                plan.refine, textures, size, place, mask_step, start, min(start + BAND, len(raster)), raster,
            )  # fmt: skip

        list(pool.map(band, range(0, len(raster), BAND)))
    if progress is not None:
        progress(plan.taps_used, plan.taps_used)
