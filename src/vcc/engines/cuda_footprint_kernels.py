"""Kernels of footprints for the GPU, forward. Every thread computes its own sums: threads do not wait for each
other or add to the same values, and every run gives the same bytes.

Separable rows and columns follow `vcc.engines.numba_kernels`: all views of a column of view taps are summed row
by row in the columns of the samples, four rows of the raster at a time (a sample is read, converted and weighed
once for all four). The sums are then mixed across once for each column. Neighbouring threads read neighbouring
values of a row of samples. Without separable rows and columns, each pixel sums the samples that fall on it.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vcc.engines.cuda_arrays import cuda, float32, int32, uint32
from vcc.engines.interpolation import dark_outside, three_around
from vcc.engines.numba_kernels import around, farthest, share_at

ROWS = 4
"""Number of raster rows that a thread sums together."""
DARK = 3
"""Number of dark lines on each side of a mask: kernels read none beyond them."""


class Quads(NamedTuple):
    """The rows of samples that four consecutive rows of the raster sum.

    Args:
        first: (rows of taps, raster rows / 4) int32, the first row of samples.
        counts: likewise, number of rows.
        shares: flat float32, in the order (rows of taps, raster rows / 4, most, 4), share of each row of samples
            in each of the four raster rows.
    """

    first: NDArray[np.int32]
    counts: NDArray[np.int32]
    shares: NDArray[np.float32]


class Source(NamedTuple):
    """Samples on the GPU: row l of view tap (b, a) begins at begin[b] + further[a] + l · pitch.

    Args:
        values: flat; 32-bit words if bytes are read in fours.
        begin: (rows of taps,) int64.
        further: (columns of taps,) int64.
        pitch: values in a row.
    """

    values: Any
    begin: NDArray[np.int64]
    further: NDArray[np.int64]
    pitch: int


class MaskRows(NamedTuple):
    """Masks for separable rows and columns: rows of their textures at the columns of samples, and lookup tables.

    Args:
        lines: flat float32, line after line; each mask has `DARK` dark lines before its rows and after them.
        width: values in a line: columns of samples.
        begin: (masks, rows of taps, columns of taps) int32: the line of the mask's row 0.
        near: (masks, rows of taps, columns of taps, rows of samples) int32, the mask row nearest to each row of
            samples, at most two rows outside.
        off: likewise float32, distance of the row of samples from it, in mask rows.
    """

    lines: NDArray[np.float32]
    width: int
    begin: NDArray[np.int32]
    near: NDArray[np.int32]
    off: NDArray[np.float32]


class MaskGroups(NamedTuple):
    """View taps that sample a mask at the same columns and share its lines.

    Args:
        mask: (groups,) int32, number of the mask.
        column: (groups,) float64, texture column of the first column of samples.
        begin: (groups,) int64, where the group's lines begin.
    """

    mask: NDArray[np.int32]
    column: NDArray[np.float64]
    begin: NDArray[np.int64]


class Places(NamedTuple):
    """Where sample (0, 0) of each view tap falls, before subdivision.

    Args:
        x: (rows of taps, columns of taps), raster column.
        y: likewise, raster row.
        masks: (masks, rows of taps, columns of taps, 2), mask column and row.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    masks: NDArray[np.float64]


# --- separable rows and columns ---


@cache
def sum_rows(values_each: int, words: bool, masked: bool, batch: int) -> Any:
    """The kernel that sums views row by row, for rows of samples of one layout.

    Args:
        values_each: neighbouring values of a row that a thread sums: the channels of a sample if masks weigh it,
            or the bytes of a word.
        words: whether samples are bytes that are read as 32-bit words, four at a time.
        masked: whether there are masks.
        batch: rows of samples loaded before the first is used, because of the latency of memory.
    """

    @cuda.jit
    def kernel(source, weights, quads, masks, start, rows, sums):  # type: ignore[no-untyped-def]
        """sums[a − start, y, n] = Σ over views b and rows l of weight · share · masks · samples.

        source: `Source`. weights: (rows of taps, columns of taps). quads: `Quads`, as many shares as a multiple of
        ``batch``. masks: `MaskRows`. start: the first column of view taps. rows: of samples in a view. sums:
        (columns of taps, raster rows, values in a row); raster rows a multiple of four.
        """
        x, y, z = cuda.grid(3)
        wide, high, deep = cuda.gridsize(3)
        total = cuda.local.array((ROWS, values_each), float32)
        asked = cuda.local.array(batch, uint32)
        values = cuda.local.array((batch, values_each), float32)
        pitch = uint32(source.pitch // 4 if words else source.pitch)
        most = quads.shares.size // (quads.first.size * ROWS)
        for column in range(z, sums.shape[0], deep):
            a = start + column
            for quad in range(y, quads.first.shape[1], high):
                for k in range(x, source.pitch // values_each, wide):
                    for r in range(ROWS):
                        for n in range(values_each):
                            total[r, n] = 0
                    for b in range(weights.shape[0]):
                        weight = weights[b, a]
                        if weight == 0:
                            continue
                        begin = np.uint64(source.begin[b] + source.further[a] + k * values_each)
                        if words:
                            begin = begin >> np.uint64(2)
                        first = quads.first[b, quad]
                        for t in range(0, quads.counts[b, quad], batch):
                            shares = np.uint64(((b * quads.first.shape[1] + quad) * most + t) * ROWS)
                            for j in range(batch):
                                # Beyond the counted rows shares are zero: read any existing row.
                                l = uint32(min(first + t + j, rows - 1))
                                at = begin + np.uint64(l * pitch)
                                if words:
                                    asked[j] = source.values[at]
                                else:
                                    for n in range(values_each):
                                        values[j, n] = float32(source.values[at + np.uint64(n)])
                            for j in range(batch):
                                through = weight
                                if masked:
                                    l = min(first + t + j, rows - 1)
                                    for m in range(masks.begin.shape[0]):
                                        through *= mask_at(masks, m, b, a, l, k)
                                for n in range(values_each):
                                    if words:
                                        value = float32(uint32((asked[j] >> uint32(8 * n)) & uint32(255)))
                                    else:
                                        value = values[j, n]
                                    value = value * through
                                    for r in range(ROWS):
                                        total[r, n] += quads.shares[shares + np.uint64(ROWS * j + r)] * value
                    for r in range(ROWS):
                        for n in range(values_each):
                            sums[column, ROWS * quad + r, k * values_each + n] = total[r, n]

    return kernel


@cuda.jit(device=True)
def mask_at(masks, m, b, a, l, k):  # type: ignore[no-untyped-def]
    """Transmission of mask m at sample (k, l) of view tap (b, a); see `vcc.engines.interpolation.three_around`."""
    width = uint32(masks.width)
    line, off, half = uint32(masks.begin[m, b, a] + masks.near[m, b, a, l]), masks.off[m, b, a, l], float32(0.5)
    at = np.uint64(line * width) + np.uint64(k)
    through = half * (half - off) * (half - off) * masks.lines[at - np.uint64(width)]
    through += (float32(0.75) - off * off) * masks.lines[at]
    return through + half * (half + off) * (half + off) * masks.lines[at + np.uint64(width)]


@cuda.jit
def mask_places(row, step, rows, near, off):  # type: ignore[no-untyped-def]
    """`MaskRows.near` and ``off`` from the mask rows of sample row 0, (masks, rows of taps, columns of taps).

    step: (masks,), mask rows from one row of samples to the next. rows: (masks,), number of rows of each mask.
    """
    x, y, z = cuda.grid(3)
    wide, high, deep = cuda.gridsize(3)
    masks, taps, columns, samples = near.shape
    for tap in range(z, masks * taps, deep):
        m, b = tap // taps, tap % taps
        for a in range(y, columns, high):
            for l in range(x, samples, wide):
                place = min(max(row[m, b, a] + l * step[m], -2.0), rows[m] + 1.0)
                middle = math.floor(place + 0.5)
                near[m, b, a, l], off[m, b, a, l] = int32(middle), float32(place - middle)


@cuda.jit
def mask_lines(masks, groups, refine, width, lines):  # type: ignore[no-untyped-def]
    """Rows of masks' textures at the columns of samples, by quadratic B-splines, dark outside.

    masks: `vcc.engines.footprint_tables.Textures`. groups: `MaskGroups`. lines, width: see `MaskRows`.
    """
    x, y, z = cuda.grid(3)
    wide, high, deep = cuda.gridsize(3)
    textures, size, step = masks
    for group in range(z, groups.mask.size, deep):
        m = groups.mask[group]
        rows, columns, along = size[m, 0], size[m, 1], step[m, 0, 0] / refine
        for line in range(y, rows + 2 * DARK, high):
            r = line - DARK
            for k in range(x, width, wide):
                column = groups.column[group] + along * k
                c, before, at, after = three_around(min(max(column, -2.0), columns + 1.0))
                found = float32(0)
                if 0 <= r < rows:
                    if 0 < c <= columns:
                        found += before * textures[m, r, c - 1]
                    if 0 <= c < columns:
                        found += at * textures[m, r, c]
                    if -1 <= c < columns - 1:
                        found += after * textures[m, r, c + 1]
                lines[(groups.begin[group] + line) * width + k] = found


@cache
def mix_columns(width: int) -> Any:
    """The kernel that mixes sums across, for pixels that sum ``width`` samples."""

    @cuda.jit
    def kernel(sums, first, shares, channels, start, scale, raster):  # type: ignore[no-untyped-def]
        """raster[y, x · channels + c] += scale · Σ share · sums[a − start, y, k · channels + c] over columns a.

        first: (columns of taps, raster columns). shares: (columns of taps, raster columns, width).
        """
        n, y = cuda.grid(2)
        wide, high = cuda.gridsize(2)
        last = sums.shape[2] // channels - 1
        for row in range(y, raster.shape[0], high):
            for to in range(n, raster.shape[1], wide):
                x, c = to // channels, to % channels
                total = float32(0)
                for column in range(sums.shape[0]):
                    k = first[start + column, x]
                    for t in range(width):
                        # Beyond the last sample shares are zero.
                        total += shares[start + column, x, t] * sums[column, row, min(k + t, last) * channels + c]
                raster[row, to] += scale * total

    return kernel


# --- subdivided samples ---


@cuda.jit
def divide(source, used, down, across, channels, start, fine):  # type: ignore[no-untyped-def]
    """fine[a − start, b, l, k · channels + c] = the finer samples of the view that each tap reads.

    source: `Source`. used: (rows of taps, columns of taps), 0 for taps that are left out. down, across: (first,
    shares), see `vcc.plan.footprints.shares.Division`.
    """
    x, y, z = cuda.grid(3)
    wide, high, deep = cuda.gridsize(3)
    (first_row, row_shares), (first_column, column_shares) = down, across
    columns, taps, rows, n = fine.shape
    for tap in range(z, columns * taps, deep):
        column, b = tap // taps, tap % taps
        if used[b, start + column] == 0:
            continue
        begin = source.begin[b] + source.further[start + column]
        for l in range(y, rows, high):
            for to in range(x, n, wide):
                k, c = to // channels, to % channels
                total = float32(0)
                for t in range(row_shares.shape[1]):
                    share = row_shares[l, t]
                    if share != 0:
                        line = begin + (first_row[l] + t) * source.pitch + c
                        for s in range(column_shares.shape[1]):
                            if column_shares[k, s] != 0:
                                at = line + (first_column[k] + s) * channels
                                total += share * column_shares[k, s] * float32(source.values[at])
                fine[column, b, l, to] = total


# --- sheared rows and columns ---


@cache
def gather(channels: int) -> Any:
    """The kernel with which each pixel sums the samples that fall on it, for this number of channels."""

    @cuda.jit
    def kernel(source, weights, places, grid, footprint, masks, size, start, stop, scale, raster):  # type: ignore[no-untyped-def]
        """raster[y, x, c] += scale · Σ over view taps (b, a), a from ``start`` to before ``stop``, and their
        samples.

        source: `Source`. weights: (rows of taps, columns of taps). places: `Places`. grid, footprint, masks: see
        `vcc.engines.footprint_tables`. size: (rows, columns) of the samples of a view, after subdivision.
        """
        x0, y0 = cuda.grid(2)
        wide, high = cuda.gridsize(2)
        total = cuda.local.array(channels, float32)
        step_y, step_x = grid.row_step / grid.refine, grid.column_step / grid.refine
        tall, broad = abs(step_y), abs(step_x)
        reach_y, reach_x = farthest(footprint, tall) / tall, farthest(footprint, broad) / broad
        for y in range(y0, raster.shape[0], high):
            for x in range(x0, raster.shape[1], wide):
                for c in range(channels):
                    total[c] = 0
                for a in range(start, stop):
                    for b in range(weights.shape[0]):
                        weight = weights[b, a]
                        if weight == 0:
                            continue
                        x_start = (
                            places.x[b, a] + grid.shear * (y - places.y[b, a]) + grid.column_step * grid.first_k
                        )
                        middle = (x - x_start) / step_x
                        low, end = around(middle, reach_x, size[1])
                        for n in range(low, end):
                            k = grid.first_k + n / grid.refine
                            across = weight * share_at(footprint, x - x_start - step_x * n, broad)
                            if across == 0:
                                continue
                            y_start = places.y[b, a] + grid.step[1, 0] * k + grid.row_step * grid.first_l
                            middle = (y - y_start) / step_y
                            top, bottom = around(middle, reach_y, size[0])
                            for m in range(top, bottom):
                                share = float32(across * share_at(footprint, y - y_start - step_y * m, tall))
                                if share != 0:
                                    share *= passed(masks, places, b, a, k, grid.first_l + m / grid.refine, -1)
                                    at = source.begin[b] + source.further[a] + m * source.pitch + n * channels
                                    for c in range(channels):
                                        total[c] += share * float32(source.values[at + c])
                for c in range(channels):
                    raster[y, x, c] += scale * total[c]

    return kernel


@cuda.jit(device=True)
def passed(masks, places, b, a, k, l, left_out):  # type: ignore[no-untyped-def]
    """Transmission of all masks but one at sample (k, l) of view tap (b, a); masks: `Textures`."""
    textures, size, step = masks
    through = float32(1)
    for m in range(places.masks.shape[0]):
        if m != left_out:
            column = places.masks[m, b, a, 0] + step[m, 0, 0] * k + step[m, 0, 1] * l
            row = places.masks[m, b, a, 1] + step[m, 1, 0] * k + step[m, 1, 1] * l
            through *= dark_outside(textures[m, : size[m, 0], : size[m, 1]], row, column)
    return through
