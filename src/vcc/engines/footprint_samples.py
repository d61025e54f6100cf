"""The samples of a view as compiled loops of footprints meet them: divided into finer ones, and through masks."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.workers import Workers
from vcc.engines import footprint_tables as tables
from vcc.engines import numba_kernels as kernels
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.shares import TIE, Division

MASK_LINES = 64
"""Lines of a mask that a thread samples at once."""


class FineGrid:
    """The samples of a view after division: how many, the index of the first, and how they are made.

    Args:
        core: what says how.
    """

    def __init__(self, core: Footprints) -> None:
        self.samples = core.samples
        self.rows, self.columns = core.samples
        self.first_row = self.first_column = 0.0
        self.divided_as: tuple[Division, Division] | None = None
        if core.refine > 1:
            down, across = (core.division(n) for n in core.samples)
            self.rows, self.columns = len(down.first), len(across.first)
            self.first_row, self.first_column = down.start, across.start
            self.divided_as = down, across

    def tables(self, pitch: int) -> tables.FineSamples:
        """How kernels divide samples, into rows of so many values."""
        assert self.divided_as is not None
        down, across = self.divided_as
        shares = down.shares.astype(np.float32), across.shares.astype(np.float32)
        return tables.FineSamples(down.first, shares[0], across.first, shares[1], pitch)

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


class MaskColumns:
    """The masks of a plan in which rows and columns part, as each column of view taps meets them.

    Args:
        core: whose masks they are.
        fine: how its samples are divided.
        repeated: how many values of a line stand for one sample, all the same.
        shared: for how many channels a value counts.
        pool: whose threads look them up.
    """

    def __init__(self, core: Footprints, fine: FineGrid, repeated: int, shared: int, pool: Workers) -> None:
        self.core, self.fine, self.repeated, self.shared, self.pool = core, fine, repeated, shared, pool
        self.rows = np.array([len(mask.texture) for mask in core.masks], dtype=np.int64)
        self.row_step = np.array([mask.step[1, 1] / core.refine for mask in core.masks], dtype=np.float64)
        self.lines = np.zeros((0, 0), dtype=np.float32)

    def at(self, a: int, pitch: int) -> tables.MaskLines | None:
        """The masks' lines that taps of column ``a`` look up, at the columns of their samples; see the kernels.

        Most taps of a column look a mask up in the same columns, those of cut cells elsewhere: each group of taps
        that agree gets the lines that it needs. They hold until the next column's are made.

        Args:
            a: column of view taps.
            pitch: values in a line, at least.
        """
        core, fine = self.core, self.fine
        if not core.masks:
            return None
        used = np.flatnonzero(core.weights[:, a])
        begin = np.zeros((len(core.masks), len(core.view_rows)), dtype=np.int64)
        row = np.zeros(begin.shape)
        total = 0
        pieces: list[tuple[NDArray[np.float32], NDArray[np.float64], int]] = []
        for number, mask in enumerate(core.masks):
            step = self.row_step[number]
            row[number] = mask.row[:, a] + mask.step[1, 1] * fine.first_row
            ends = np.sort([row[number], row[number] + step * (fine.rows - 1)], axis=0)
            texture = mask.texture.astype(np.float32, copy=False)
            places, group = np.unique(np.round(mask.column[used, a], 7), return_inverse=True)
            for one in range(len(places)):
                taps = used[group == one]
                # With the three lines around each row of samples, wherever rounding puts it.
                low = max(math.floor(ends[0, taps].min() - 0.5 - TIE), 0)
                high = min(math.floor(ends[1, taps].max() + 0.5 + TIE) + 2, len(texture))
                if low >= high:  # all of it lies beyond the mask's border, where it is dark
                    continue
                begin[number, taps] = total - low
                first = mask.column[taps[0], a]
                columns = first + mask.step[0, 0] * (fine.first_column + np.arange(fine.columns) / core.refine)
                pieces += [
                    (texture[n : min(n + MASK_LINES, high)], columns, total + n - low)
                    for n in range(low, high, MASK_LINES)
                ]
                total += high - low
        line = pitch // self.shared
        if self.lines.shape[0] < total:
            self.lines = np.zeros((total, line), dtype=np.float32)  # and zero beyond the samples' last column

        def sample(piece: tuple[NDArray[np.float32], NDArray[np.float64], int]) -> None:
            texture, columns, to = piece
            kernels.sample_mask_columns(texture, columns, self.repeated, self.lines[to : to + len(texture)])

        list(self.pool.map(sample, pieces))
        return tables.MaskLines(self.lines, begin, self.rows, row, self.row_step, self.shared)


def textures(core: Footprints) -> tables.Textures:
    """The masks' textures in one array, for plans in which rows and columns do not part."""
    size = np.array([mask.texture.shape for mask in core.masks], dtype=np.int64).reshape(-1, 2)
    values = np.zeros((len(core.masks), *size.max(axis=0, initial=1)), dtype=np.float32)
    for texture, mask in zip(values, core.masks, strict=True):
        texture[: mask.texture.shape[0], : mask.texture.shape[1]] = mask.texture
    return tables.Textures(values, size, np.array([mask.step for mask in core.masks]).reshape(-1, 2, 2))
