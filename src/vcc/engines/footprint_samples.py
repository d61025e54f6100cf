"""The samples of a view for compiled loops of footprints: subdivided into finer ones, and seen through masks."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.workers import Workers
from vcc.engines import footprint_tables as tables
from vcc.engines import numba_kernels as kernels
from vcc.engines.compiled import read_as
from vcc.engines.vector_sums import LANES, SHORTEST, aligned_buffer
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.shares import REACH, TIE, Division, Taps, taps

MASK_LINES = 64
"""Lines of a mask that a thread samples at a time."""
FEW_LINES = 2**17
"""Values of lines below which sampling them takes less time than handing them to threads."""


class FineGrid:
    """The samples of a view after subdivision: their number, the index of the first, and how they are computed.

    Args:
        core: the footprints.
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
        """The arguments by which kernels subdivide samples, into rows of ``pitch`` values."""
        assert self.divided_as is not None
        down, across = self.divided_as
        shares = down.shares.astype(np.float32), across.shares.astype(np.float32)
        return tables.FineSamples(down.first, shares[0], across.first, shares[1], pitch)

    @property
    @cached
    def matrices(self) -> tuple[NDArray[np.float64], ...]:
        """The subdivision of rows and of columns as matrices, made once for all views."""
        assert self.divided_as is not None
        return tuple(part.matrix(n) for part, n in zip(self.divided_as, self.samples, strict=True))

    def divided(self, view: NDArray[Any]) -> NDArray[np.float32]:
        """A view (t, s, channels) with its samples subdivided, for plans without separable rows and columns."""
        if self.divided_as is None:
            return np.ascontiguousarray(view, dtype=np.float32)
        down, across = self.matrices
        fine = np.einsum("at,bs,tsc->abc", down, across, view.astype(np.float32), optimize=True)
        return np.ascontiguousarray(fine, dtype=np.float32)


def taps_along(core: Footprints, fine: FineGrid) -> tuple[Taps, Taps]:
    """The rows of samples that each row of the raster sums, and the same for columns, if they are separable."""
    rows, columns = core.raster_shape
    start_y = core.y[:, 0] + core.row_step * fine.first_row
    start_x = core.x[0] + core.column_step * fine.first_column
    row_step, column_step = core.row_step / core.refine, core.column_step / core.refine
    return (
        taps(core.interpolation, start_y, row_step, fine.rows, rows, core.opening),
        taps(core.interpolation, start_x, column_step, fine.columns, columns, core.opening),
    )


class MaskPiece(NamedTuple):
    """Some rows of a mask's texture, sampled for a group of taps.

    Args:
        mask: number of the mask.
        start: the first row.
        stop: after the last row.
        columns: texture column of each column of samples.
        to: line for the first row.
    """

    mask: int
    start: int
    stop: int
    columns: NDArray[np.float64]
    to: int


class MaskColumns:
    """The masks of a plan with separable rows and columns, sampled for each column of view taps.

    Args:
        core: the footprints with the masks.
        fine: the subdivision of its samples.
        repeated: number of equal values in a line for one sample.
        shared: number of channels to which a value applies.
        pool: threads that sample the masks.
    """

    def __init__(self, core: Footprints, fine: FineGrid, repeated: int, shared: int, pool: Workers) -> None:
        self.core, self.fine, self.repeated, self.shared, self.pool = core, fine, repeated, shared, pool
        self.textures = [mask.texture.astype(np.float32, copy=False) for mask in core.masks]
        self.rows = np.array([len(mask.texture) for mask in core.masks], dtype=np.int64)
        self.row_step = np.array([mask.step[1, 1] / core.refine for mask in core.masks], dtype=np.float64)
        self.lines = np.zeros((0, 0), dtype=np.float32)
        self.pieces: list[MaskPiece] = []

    def at(self, a: int, pitch: int, again: bool = True) -> tables.MaskLines | None:
        """The masks' lines for the taps of column ``a``, at the columns of their samples; see the kernels.

        Most taps of a column sample a mask at the same columns; taps of cut cells do not. Each group of taps
        with equal columns gets the lines that it needs.

        Args:
            a: column of view taps.
            pitch: least number of values in a line.
            again: whether to overwrite the lines of the call before; otherwise they stay valid.
        """
        core, fine = self.core, self.fine
        if not core.masks:
            return None
        used = np.flatnonzero(core.weights[:, a])
        begin = np.zeros((len(core.masks), len(core.view_rows)), dtype=np.int64)
        row = np.zeros(begin.shape)
        total = 0
        self.pieces = []
        for number, mask in enumerate(core.masks):
            step = self.row_step[number]
            row[number] = mask.row[:, a] + mask.step[1, 1] * fine.first_row
            ends = np.sort([row[number], row[number] + step * (fine.rows - 1)], axis=0)
            places, group = np.unique(np.round(mask.column[used, a], 7), return_inverse=True)
            for one in range(len(places)):
                taps = used[group == one]
                # Include three lines around each row of samples, whichever way rounding goes.
                low = max(math.floor(ends[0, taps].min() - 0.5 - TIE), 0)
                high = min(math.floor(ends[1, taps].max() + 0.5 + TIE) + 2, len(mask.texture))
                if low >= high:  # entirely beyond the mask's border, where it is dark
                    continue
                begin[number, taps] = total - low
                first = mask.column[taps[0], a]
                columns = first + mask.step[0, 0] * (fine.first_column + np.arange(fine.columns) / core.refine)
                self.pieces += [
                    MaskPiece(number, n, min(n + MASK_LINES, high), columns, total + n - low)
                    for n in range(low, high, MASK_LINES)
                ]
                total += high - low
        line = pitch // self.shared
        if self.lines.shape[0] < total or not again:
            self.lines = aligned_buffer(total, line)
            self.lines[:] = 0  # zero beyond the samples' last column

        def sample(piece: MaskPiece) -> None:
            texture = self.textures[piece.mask][piece.start : piece.stop]
            out = self.lines[piece.to : piece.to + len(texture)]
            kernels.sample_mask_columns(texture, piece.columns, self.repeated, out)

        list((map if total * line < FEW_LINES else self.pool.map)(sample, self.pieces))
        return tables.MaskLines(self.lines, begin, self.rows, row, self.row_step, self.shared)


def no_masks() -> tables.MaskLines:
    """Lines of no mask, for kernels that accept any number of masks."""
    whole, places = np.zeros(0, dtype=np.int64), np.zeros((0, 1))
    lines = np.zeros((0, 1), dtype=np.float32)
    return tables.MaskLines(lines, places.astype(np.int64), whole, places, places[:, 0], 1)


def blocks(
    core: Footprints, values: NDArray[Any], by_column: bool
) -> Iterator[tuple[tables.Samples, tuple[int, int]]]:
    """Yield the samples in pieces that kernels can read; at most one column of views is copied at a time.

    Each piece comes with (first, end) of the columns of view taps that read it.
    """
    nv, nu, nt, ns = values.shape[:4]
    channels = values.shape[4] if values.ndim == 5 else 1
    taps = len(core.view_columns)
    n = ns * channels
    shortest = max(math.ceil(SHORTEST / channels), LANES)
    kind = read_as(values.dtype)
    if values.flags.c_contiguous and values.dtype == kind and ns >= shortest:
        view = nt * n
        flat = values.reshape(-1)
        samples = tables.Samples(flat, core.view_rows * (nu * view), core.view_columns * view, n, channels)
        for a in range(taps) if by_column else (0,):
            yield samples, (a, a + 1) if by_column else (0, taps)
        return
    missing = max(shortest - ns, 0)
    for a in map(int, np.flatnonzero((core.weights != 0).any(axis=0))):
        column = values[:, core.view_columns[a]]
        if missing:
            column = np.pad(column, [(0, 0), (0, 0), (0, missing), *[(0, 0)] * (values.ndim - 4)])
        column = np.ascontiguousarray(column, dtype=kind).reshape(nv, nt, -1)
        pitch = column.shape[2]
        begin, none = core.view_rows * (nt * pitch), np.zeros(taps, dtype=np.int64)
        yield tables.Samples(column.reshape(-1), begin, none, pitch, channels), (a, a + 1)


# --- sheared rows and columns ---


def on_raster(core: Footprints, fine: FineGrid) -> tuple[tables.Grid, tables.Footprint]:
    """The positions of samples on the raster, and the footprint of each sample there."""
    first = fine.first_column, fine.first_row
    grid = tables.Grid(core.step, core.shear, core.row_step, core.column_step, core.refine, *first)
    name = core.interpolation
    return grid, tables.Footprint(list(REACH).index(name), REACH[name], core.opening)


def view_of(
    core: Footprints, b: int, a: int, samples: NDArray[np.float32], weights: NDArray[np.float64]
) -> tables.View:
    """A view tap with its samples, subdivided if required, and its own weight."""
    place = np.array([[mask.column[b, a], mask.row[b, a]] for mask in core.masks]).reshape(-1, 2)
    return tables.View(samples, weights[b, a] * core.scale, core.x[b, a], core.y[b, a], place)


def textures(core: Footprints) -> tables.Textures:
    """The masks' textures in one array."""
    size = np.array([mask.texture.shape for mask in core.masks], dtype=np.int64).reshape(-1, 2)
    values = np.zeros((len(core.masks), *size.max(axis=0, initial=1)), dtype=np.float32)
    for texture, mask in zip(values, core.masks, strict=True):
        texture[: mask.texture.shape[0], : mask.texture.shape[1]] = mask.texture
    return tables.Textures(values, size, np.array([mask.step for mask in core.masks]).reshape(-1, 2, 2))
