"""Kernels of footprints for the GPU, backward: from the weights of a raster to samples and to masks.

They transpose the forward kernels, and all of them gather: a thread computes the sum of one sample, or of one
point of a mask's texture, from all values that it contributes to. For separable rows and columns, the raster's
weights are mixed across once for each column of view taps, into the columns of its samples (`mix_back`).
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vcc.engines.cuda_arrays import cuda, float32, float64
from vcc.engines.cuda_footprint_kernels import mask_at, passed
from vcc.engines.numba_kernels import around, farthest, share_at


class Readers(NamedTuple):
    """The view taps of a piece, sorted by the views that they read.

    Args:
        rows: int64, rows of taps; those that read the n-th row of views end before ``row_ends[n + 1]``.
        row_ends: (rows of views + 1,) int64.
        columns: int64, columns of taps, likewise; one for each mixed raster.
        column_ends: (columns of views in the piece + 1,) int64.
    """

    rows: NDArray[np.int64]
    row_ends: NDArray[np.int64]
    columns: NDArray[np.int64]
    column_ends: NDArray[np.int64]


class Target(NamedTuple):
    """Where to write samples' gradients: row l of view (v, n-th column of the piece) begins at begin[v] +
    further[n] + l · pitch.

    Args:
        values: flat, float32.
        begin: (rows of views,) int64.
        further: (columns of views in the piece,) int64.
        pitch: values in a row.
    """

    values: NDArray[np.float32]
    begin: NDArray[np.int64]
    further: NDArray[np.int64]
    pitch: int


# --- separable rows and columns ---


@cache
def mix_back(width: int) -> Any:
    """The kernel that mixes a raster's weights across, for samples that fall on ``width`` pixels."""

    @cuda.jit
    def kernel(raster, columns, first, shares, channels, mixed):  # type: ignore[no-untyped-def]
        """mixed[p, y, k · channels + c] = Σ share · raster[y, x · channels + c] over the x that sample k falls on.

        raster: (rows, columns · channels). columns: the column of view taps of each p. first: (columns of taps,
        columns of samples). shares: (columns of taps, columns of samples, width), zero beyond the raster.
        """
        x, y, z = cuda.grid(3)
        wide, high, deep = cuda.gridsize(3)
        last = raster.shape[1] // channels - 1
        for p in range(z, mixed.shape[0], deep):
            a = columns[p]
            for row in range(y, mixed.shape[1], high):
                for to in range(x, mixed.shape[2], wide):
                    k, c = to // channels, to % channels
                    total = float32(0)
                    for t in range(width):
                        total += shares[a, k, t] * raster[row, min(first[a, k] + t, last) * channels + c]
                    mixed[p, row, to] = total

    return kernel


@cache
def rows_back(values_each: int, masked: bool, width: int) -> Any:
    """The kernel that sums, for each sample, the rows of the mixed raster on which it falls.

    Args:
        values_each: neighbouring values of a row that a thread computes: the channels of a sample if masks weigh
            it, else one.
        masked: whether there are masks.
        width: rows of the raster that a row of samples falls on.
    """

    @cuda.jit
    def kernel(mixed, weights, scale, first, shares, masks, readers, target):  # type: ignore[no-untyped-def]
        """Gradient of each sample of each view: Σ over the taps that read it of weight · masks · Σ share · mixed.

        mixed: see `mix_back`. weights: (rows of taps, columns of taps). first: (rows of taps, rows of samples).
        shares: (rows of taps, rows of samples, width). masks: `MaskRows`. readers: `Readers`. target: `Target`.
        """
        x, y, z = cuda.grid(3)
        wide, high, deep = cuda.gridsize(3)
        total = cuda.local.array(values_each, float32)
        rows, views = readers.row_ends.size - 1, readers.column_ends.size - 1
        last = mixed.shape[1] - 1
        for view in range(z, rows * views, deep):
            v, i = view // views, view % views
            for l in range(y, first.shape[1], high):
                for k in range(x, target.pitch // values_each, wide):
                    for n in range(values_each):
                        total[n] = 0
                    for p in range(readers.column_ends[i], readers.column_ends[i + 1]):
                        a = readers.columns[p]
                        for q in range(readers.row_ends[v], readers.row_ends[v + 1]):
                            b = readers.rows[q]
                            through = scale * weights[b, a]
                            if through == 0:
                                continue
                            if masked:
                                for m in range(masks.begin.shape[0]):
                                    through *= mask_at(masks, m, b, a, l, k)
                            for t in range(width):
                                # Beyond the raster shares are zero.
                                share, row = through * shares[b, l, t], min(first[b, l] + t, last)
                                for n in range(values_each):
                                    total[n] += share * mixed[p, row, k * values_each + n]
                    at = target.begin[v] + target.further[i] + l * target.pitch + k * values_each
                    for n in range(values_each):
                        target.values[at + n] = total[n]

    return kernel


@cache
def met_in_rows(channels: int) -> Any:
    """The kernel of products of samples with the raster's weights on their footprints."""

    @cuda.jit
    def kernel(source, mixed, first, shares, places, grid, masks, left_out, start, products):  # type: ignore[no-untyped-def]
        """products[p, b, l, k] = masks but one · Σ_c sample · Σ share · mixed[p], of view tap (b, start + p).

        source: `Source`. mixed, first, shares: see `rows_back`. places, grid, masks: see `gather`.
        """
        x, y, z = cuda.grid(3)
        wide, high, deep = cuda.gridsize(3)
        part = cuda.local.array(channels, float32)
        columns, taps, rows, samples = products.shape
        last = mixed.shape[1] - 1
        for tap in range(z, columns * taps, deep):
            p, b = tap // taps, tap % taps
            for l in range(y, rows, high):
                for k in range(x, samples, wide):
                    for c in range(channels):
                        part[c] = 0
                    for t in range(shares.shape[2]):
                        share = shares[b, l, t]
                        if share != 0:
                            row = min(first[b, l] + t, last)
                            for c in range(channels):
                                part[c] += share * mixed[p, row, k * channels + c]
                    at = source.begin[b] + source.further[start + p] + l * source.pitch + k * channels
                    whole = float32(0)
                    for c in range(channels):
                        whole += part[c] * float32(source.values[at + c])
                    at_k, at_l = grid.first_k + k / grid.refine, grid.first_l + l / grid.refine
                    through = passed(masks, places, b, start + p, at_k, at_l, left_out)
                    products[p, b, l, k] = whole * through

    return kernel


# --- sheared rows and columns ---


@cuda.jit(device=True)
def meet(raster, places, grid, footprint, b, a, m, n, part):  # type: ignore[no-untyped-def]
    """part[c] = Σ share · raster[y, x, c] over the pixels that sample (n, m) of view tap (b, a) falls on."""
    step_y, step_x = grid.row_step / grid.refine, grid.column_step / grid.refine
    tall, broad = abs(step_y), abs(step_x)
    reach_y, reach_x = farthest(footprint, tall), farthest(footprint, broad)
    for c in range(part.size):
        part[c] = 0
    k = grid.first_k + n / grid.refine
    place = places.y[b, a] + grid.step[1, 0] * k + grid.row_step * grid.first_l + step_y * m
    top, bottom = around(place, reach_y, raster.shape[0])
    for y in range(top, bottom):
        down = share_at(footprint, y - place, tall)
        if down == 0:
            continue
        middle = places.x[b, a] + grid.shear * (y - places.y[b, a]) + grid.column_step * k
        low, end = around(middle, reach_x, raster.shape[1])
        for x in range(low, end):
            share = float32(down * share_at(footprint, x - middle, broad))
            for c in range(part.size):
                part[c] += share * raster[y, x, c]


@cache
def sheared_back(channels: int) -> Any:
    """As `rows_back`, for sheared rows and columns."""

    @cuda.jit
    def kernel(raster, weights, scale, places, grid, footprint, masks, rows, readers, target):  # type: ignore[no-untyped-def]
        """raster: (rows, columns, channels). places, grid, footprint, masks: see `gather`. rows: of samples."""
        x, y, z = cuda.grid(3)
        wide, high, deep = cuda.gridsize(3)
        total = cuda.local.array(channels, float32)
        part = cuda.local.array(channels, float32)
        rows_of_views, views = readers.row_ends.size - 1, readers.column_ends.size - 1
        for view in range(z, rows_of_views * views, deep):
            v, i = view // views, view % views
            for m in range(y, rows, high):
                for n in range(x, target.pitch // channels, wide):
                    for c in range(channels):
                        total[c] = 0
                    for p in range(readers.column_ends[i], readers.column_ends[i + 1]):
                        a = readers.columns[p]
                        for q in range(readers.row_ends[v], readers.row_ends[v + 1]):
                            b = readers.rows[q]
                            if weights[b, a] == 0:
                                continue
                            k, l = grid.first_k + n / grid.refine, grid.first_l + m / grid.refine
                            through = scale * weights[b, a] * passed(masks, places, b, a, k, l, -1)
                            if through == 0:
                                continue
                            meet(raster, places, grid, footprint, b, a, m, n, part)
                            for c in range(channels):
                                total[c] += through * part[c]
                    at = target.begin[v] + target.further[i] + m * target.pitch + n * channels
                    for c in range(channels):
                        target.values[at + c] = total[c]

    return kernel


@cache
def met_sheared(channels: int) -> Any:
    """As `met_in_rows`, for sheared rows and columns."""

    @cuda.jit
    def kernel(source, raster, places, grid, footprint, masks, left_out, start, products):  # type: ignore[no-untyped-def]
        """products[p, b, m, n]: see `met_in_rows`; raster: (rows, columns, channels)."""
        x, y, z = cuda.grid(3)
        wide, high, deep = cuda.gridsize(3)
        part = cuda.local.array(channels, float32)
        columns, taps, rows, samples = products.shape
        for tap in range(z, columns * taps, deep):
            p, b = tap // taps, tap % taps
            for m in range(y, rows, high):
                for n in range(x, samples, wide):
                    meet(raster, places, grid, footprint, b, start + p, m, n, part)
                    at = source.begin[b] + source.further[start + p] + m * source.pitch + n * channels
                    whole = float32(0)
                    for c in range(channels):
                        whole += part[c] * float32(source.values[at + c])
                    k, l = grid.first_k + n / grid.refine, grid.first_l + m / grid.refine
                    products[p, b, m, n] = whole * passed(masks, places, b, start + p, k, l, left_out)

    return kernel


# --- subdivided samples ---


@cuda.jit
def give_back(fine, down, across, channels, target):  # type: ignore[no-untyped-def]
    """Sum the gradients of finer samples into the samples of a view: the transpose of `divide`.

    fine: (columns of views, rows of views, finer rows, finer columns · channels). down, across: (first, shares) of
    finer rows and columns by sample. target: `Target`.
    """
    x, y, z = cuda.grid(3)
    wide, high, deep = cuda.gridsize(3)
    (first_row, row_shares), (first_column, column_shares) = down, across
    views, rows = fine.shape[0], fine.shape[1]
    last_row, last_column = fine.shape[2] - 1, fine.shape[3] // channels - 1
    for view in range(z, views * rows, deep):
        n, v = view // rows, view % rows
        for l in range(y, first_row.size, high):
            for to in range(x, target.pitch, wide):
                k, c = to // channels, to % channels
                total = float32(0)
                for t in range(row_shares.shape[1]):
                    row, share = min(first_row[l] + t, last_row), row_shares[l, t]
                    if share != 0:
                        for s in range(column_shares.shape[1]):
                            at = min(first_column[k] + s, last_column) * channels + c
                            total += share * column_shares[k, s] * fine[n, v, row, at]
                target.values[target.begin[v] + target.further[n] + l * target.pitch + to] = total


# --- parameters ---


@cuda.jit
def sum_lines(products, lines):  # type: ignore[no-untyped-def]
    """lines[p, b, l] = Σ_k products[p, b, l, k]."""
    y, z = cuda.grid(2)
    high, deep = cuda.gridsize(2)
    columns, taps, rows, samples = products.shape
    for tap in range(z, columns * taps, deep):
        p, b = tap // taps, tap % taps
        for l in range(y, rows, high):
            total = float64(0)
            for k in range(samples):
                total += products[p, b, l, k]
            lines[p, b, l] = total


@cuda.jit(device=True)
def within(rest, step, point, reach, count):  # type: ignore[no-untyped-def]
    """(first, after the last) n of 0 … count − 1 for which rest + step · n is at most ``reach`` from a point."""
    if abs(step) < 1e-12:
        return np.int64(0), count if abs(rest - point) <= reach else np.int64(0)
    return around((point - rest) / step, reach / abs(step), count)


@cuda.jit(device=True)
def counted(place, point):  # type: ignore[no-untyped-def]
    """Weight of a point of a line at a place on the line, see `vcc.base.lookup.three_around`."""
    middle = math.floor(place + 0.5)
    off, away = place - middle, point - middle
    if away == 0:
        return 0.75 - off * off
    if away == 1:
        return 0.5 * (0.5 + off) * (0.5 + off)
    if away == -1:
        return 0.5 * (0.5 - off) * (0.5 - off)
    return 0.0


@cuda.jit
def texture_back(products, weights, places, grid, step, m, start, texture):  # type: ignore[no-untyped-def]
    """texture[i, r, c] += Σ over taps (b, start + p), b = i, i + parts, …, of weight · products · weight of
    point (r, c).

    products: (columns of taps, rows of taps, rows of samples, columns of samples). step: (masks, 2, 2).
    texture: (parts, rows, columns), sums that are added up afterwards.
    """
    x, y, z = cuda.grid(3)
    wide, high, deep = cuda.gridsize(3)
    columns, taps, rows, samples = products.shape
    parts = texture.shape[0]
    along_k, along_l = step[m, 0, 0], step[m, 0, 1]  # columns of the texture
    down_k, down_l = step[m, 1, 0], step[m, 1, 1]
    # Largest distance of a row of samples from its middle, along rows and columns of the texture.
    half = (samples - 1) / grid.refine / 2
    loose, reach = abs(down_k) * half, 1.5 + 1e-6
    for i in range(z, parts, deep):
        for r in range(y, texture.shape[1], high):
            for c in range(x, texture.shape[2], wide):
                total = float64(0)
                for p in range(columns):
                    a = start + p
                    for b in range(i, taps, parts):
                        if weights[b, a] == 0:
                            continue
                        column = places.masks[m, b, a, 0] + along_k * grid.first_k + along_l * grid.first_l
                        row = places.masks[m, b, a, 1] + down_k * grid.first_k + down_l * grid.first_l
                        one = float64(0)
                        top, bottom = within(row + down_k * half, down_l / grid.refine, r, reach + loose, rows)
                        for l in range(top, bottom):
                            column_l = column + along_l * l / grid.refine
                            row_l = row + down_l * l / grid.refine
                            low, end = within(column_l, along_k / grid.refine, c, reach, samples)
                            for k in range(low, end):
                                count = counted(column_l + along_k * k / grid.refine, c)
                                count *= counted(row_l + down_k * k / grid.refine, r)
                                if count != 0:
                                    one += count * products[p, b, l, k]
                        total += weights[b, a] * one
                texture[i, r, c] += total
