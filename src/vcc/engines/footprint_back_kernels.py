"""Compiled loops from the weights of a raster back to samples. All of them gather, so threads never wait.

The transpose of `vcc.engines.numba_kernels`: the raster is mixed across once for each column of view taps, into
the columns of its samples. Each row of samples is then a sum of a few of these rows, computed in place.
"""

from __future__ import annotations

import numpy as np

from vcc.engines.compiled import fast_inlined, fast_loop
from vcc.engines.footprint_tables import EntryMasks
from vcc.engines.interpolation import dark_outside
from vcc.engines.numba_kernels import add_along_row, around, farthest, masks_at, place_on_mask, share_at
from vcc.engines.vector_sums import EIGHT, mix_eight

# --- separable rows and columns ---


@fast_loop
def mix_back(tiles, spread, a, channels, band, mixed):  # type: ignore[no-untyped-def]
    """mixed[8i + y, k · channels + c] = Σ share · tiles[i, x · channels + c, y] over the x that sample k falls on.

    tiles: the raster, transposed in tiles of eight rows, with zeros beyond its last column. spread: `Spread` of
    the columns of samples in each column of view taps. a: the column of view taps. band: of the tiles.
    """
    first, shares = spread.first[a], spread.shares[a]
    step, n = EIGHT * channels, mixed.shape[1]
    eight = np.empty(EIGHT * n, np.float32)
    for tile in range(band.start, band.stop):
        source = tiles[tile].reshape(-1)
        eight[:] = 0
        for k in range(first.size):
            for c in range(channels):
                mix_eight(source, step * first[k] + EIGHT * c, step, shares, k, eight, step * k + EIGHT * c)
        for y in range(min(EIGHT, len(mixed) - EIGHT * tile)):
            line = mixed[EIGHT * tile + y]
            for x in range(n):
                line[x] = eight[EIGHT * x + y]


@fast_loop
def add_rows_back(mixed, readers, spread, masks, fine, across, rows, height, gradient):  # type: ignore[no-untyped-def]
    """Add the gradients of a column of view taps to rows of samples of some views, ``height`` rows at a time.

    mixed: the raster in the columns of the samples, from `mix_back`. readers: `Readers`. spread: `Spread` of the
    rows of samples in each row of taps. masks: `MaskLines` of any number of masks, a value for each column of
    samples. rows: `Band`. gradient: float32, flat.

    If samples are subdivided, mixed, spread and masks refer to the finer samples. fine: `FineSamples`, without
    columns if they are not. across: `Spread` of the columns of samples over those of the finer samples.
    """
    taps, ends, begin, weights, columns, channels = readers
    first_row, row_shares, divided = fine.first_row, fine.row_shares, fine.first_column.size > 0
    n, count = mixed.shape[1], masks.row_step.size
    lines = EntryMasks(masks.lines, np.empty((1, count, 3), np.int64), np.empty((1, count, 3), np.float32))
    through, seen, line = np.empty(n // channels, np.float32), np.empty(n, np.float32), np.empty(n, np.float32)
    sums = np.empty((height, n + across.shares.shape[1] * channels) if divided else (0, 0), np.float32)
    for start in range(rows.start, rows.stop, height):
        stop = min(start + height, rows.stop)
        for view in range(begin.size):
            sums[:] = 0
            for l in range(first_row.size):
                if first_row[l] >= stop or first_row[l] + row_shares.shape[1] <= start:
                    continue
                at = begin[view] + l * n
                to = line if divided else gradient[at : at + n]
                if divided:
                    line[:] = 0
                for q in range(ends[view], ends[view + 1]):
                    b = taps[q]
                    first, shares = spread.first[b, l], spread.shares[b, l]
                    low, high = _not_zero(shares)
                    if low == high or not masks_at(masks, b, l, 0, lines):
                        continue
                    _add_rows(mixed, first, low, high, shares, weights[b], count > 0, seen if count > 0 else to)
                    if count > 0:
                        _mask_row(lines, through)
                        _add_weighed(seen, through, channels, to)
                if divided:
                    _give_rows(line, first_row[l], row_shares[l], start, sums[: stop - start])
            if divided:
                _give_columns(
                    sums[: stop - start], across, channels, begin[view] + start * columns * channels, gradient
                )


@fast_inlined
def _not_zero(shares):  # type: ignore[no-untyped-def]
    """(first, after the last) of the nonzero shares; equal if there are none."""
    low, stop = 0, shares.size
    while stop > 0 and shares[stop - 1] == 0:
        stop -= 1
    while low < stop and shares[low] == 0:
        low += 1
    return low, stop


@fast_inlined
def _add_rows(mixed, first, low, stop, shares, weight, anew, to):  # type: ignore[no-untyped-def]
    """to += Σ weight · shares[m] · mixed[first + m], three at a time; set to zero first if ``anew``."""
    n = to.size
    if anew:
        to[:] = 0
    for m in range(low, stop, 3):
        one, a = mixed[first + m], weight * shares[m]
        if m + 2 < stop:
            two, b = mixed[first + m + 1], weight * shares[m + 1]
            three, c = mixed[first + m + 2], weight * shares[m + 2]
            for x in range(n):
                to[x] += a * one[x] + b * two[x] + c * three[x]
        elif m + 1 < stop:
            two, b = mixed[first + m + 1], weight * shares[m + 1]
            for x in range(n):
                to[x] += a * one[x] + b * two[x]
        else:
            for x in range(n):
                to[x] += a * one[x]


@fast_inlined
def _mask_row(weighed, row):  # type: ignore[no-untyped-def]
    """The product of the masks' weights at a row of samples, from the lines of `masks_at`."""
    lines, places, shares = weighed
    flat, n = lines.reshape(-1), row.size
    for mask in range(places.shape[1]):
        above, here, below = places[0, mask, 0], places[0, mask, 1], places[0, mask, 2]
        a, b, c = shares[0, mask, 0], shares[0, mask, 1], shares[0, mask, 2]
        one, two, three = flat[above : above + n], flat[here : here + n], flat[below : below + n]
        if mask == 0:
            for k in range(n):
                row[k] = a * one[k] + b * two[k] + c * three[k]
        else:
            for k in range(n):
                row[k] *= a * one[k] + b * two[k] + c * three[k]


@fast_inlined
def _add_weighed(seen, row, channels, to):  # type: ignore[no-untyped-def]
    """to[k · channels + c] += row[k] · seen[k · channels + c]"""
    if channels == 1:
        for k in range(row.size):
            to[k] += row[k] * seen[k]
    elif channels == 3:
        for k in range(np.uint64(row.size)):
            weight, at = row[k], k * np.uint64(3)
            to[at] += weight * seen[at]
            to[at + np.uint64(1)] += weight * seen[at + np.uint64(1)]
            to[at + np.uint64(2)] += weight * seen[at + np.uint64(2)]
    else:
        for k in range(row.size):
            for c in range(channels):
                to[k * channels + c] += row[k] * seen[k * channels + c]


# --- subdivided samples ---


@fast_inlined
def _give_rows(line, first, shares, start, sums):  # type: ignore[no-untyped-def]
    """Add a row of finer samples to the rows of samples, from ``start`` on, that it is made from."""
    for t in range(shares.size):
        l = first + t - start
        if 0 <= l < len(sums) and shares[t] != 0:
            to, share = sums[l], shares[t]
            for x in range(line.size):
                to[x] += share * line[x]


@fast_inlined
def _give_columns(sums, across, channels, begin, gradient):  # type: ignore[no-untyped-def]
    """gradient[begin + …] += rows of finer samples, each summed into the columns of samples that it is made from.

    across: `Spread` of the columns of samples over those of finer samples; sums are zero beyond the last of
    these.
    """
    first, shares = across
    for line in range(len(sums)):
        add_along_row(sums[line], first, shares, channels, begin + line * first.size * channels, gradient)


# --- sheared rows and columns ---


@fast_loop
def mix_sheared_back(raster, view, grid, footprint, columns, band, mixed):  # type: ignore[no-untyped-def]
    """mixed[y, k, c] = Σ share · raster[y, x, c] over the x that column k of a view's samples falls on in row y.

    raster: (rows, columns, channels). view: `View`, whose samples are not used. grid: `Grid`. footprint:
    `Footprint`. columns: number of columns of samples, after subdivision.
    """
    width = abs(grid.column_step / grid.refine)
    reach = farthest(footprint, width)
    for y in range(band.start, band.stop):
        for n in range(columns):
            x = view.x + grid.shear * (y - view.y) + grid.column_step * (grid.first_k + n / grid.refine)
            for c in range(raster.shape[2]):
                mixed[y, n, c] = 0
            low, high = around(x, reach, raster.shape[1])
            for pixel in range(low, high):
                share = share_at(footprint, pixel - x, width)
                for c in range(raster.shape[2]):
                    mixed[y, n, c] += share * raster[y, pixel, c]


@fast_loop
def add_sheared_back(mixed, view, grid, footprint, masks, fine, across, rows, gradient):  # type: ignore[no-untyped-def]
    """Add the gradients of a view tap to some rows of samples, if rows and columns of samples are sheared.

    mixed: from `mix_sheared_back`. view, grid, footprint: see there. masks: `Textures`. fine, across, rows: see
    `add_rows_back`. gradient: of the view, flat.
    """
    _, columns, channels = mixed.shape
    first_row, row_shares, divided = fine.first_row, fine.row_shares, fine.first_column.size > 0
    line = np.empty((columns, channels), np.float32)
    flat = line.reshape(-1)
    high, wide = (rows.stop - rows.start, flat.size + across.shares.shape[1] * channels) if divided else (0, 0)
    sums = np.zeros((high, wide), np.float32)
    for l in range(first_row.size):
        if first_row[l] < rows.stop and first_row[l] + row_shares.shape[1] > rows.start:
            _sheared_row(mixed, view, grid, footprint, masks, l, line)
            if divided:
                _give_rows(flat, first_row[l], row_shares[l], rows.start, sums)
            else:
                to = gradient[l * flat.size : (l + 1) * flat.size]
                for x in range(flat.size):
                    to[x] += flat[x]
    if divided:
        _give_columns(sums, across, channels, rows.start * across.first.size * channels, gradient)


@fast_inlined
def _sheared_row(mixed, view, grid, footprint, masks, m, line):  # type: ignore[no-untyped-def]
    """line[k, c] = gradient of sample k of row m of a view tap; arguments as for `add_sheared_back`."""
    _, weight, _, y0, place = view
    textures, size, mask_step = masks
    row_step = grid.row_step / grid.refine
    height = abs(row_step)
    reach = farthest(footprint, height)
    l = grid.first_l + m / grid.refine
    line[:] = 0
    for n in range(line.shape[0]):
        k = grid.first_k + n / grid.refine
        y = y0 + grid.step[1, 0] * k + grid.row_step * grid.first_l + row_step * m
        low, high = around(y, reach, mixed.shape[0])
        through = weight if low < high else 0.0
        for mask in range(place.shape[0]):
            if through != 0:
                row, column = place_on_mask(place, mask_step, mask, k, l)
                texture = textures[mask, : size[mask, 0], : size[mask, 1]]
                through *= dark_outside(texture, row, column)
        if through != 0:
            for pixel in range(low, high):
                share = through * share_at(footprint, pixel - y, height)
                for c in range(line.shape[1]):
                    line[n, c] += share * mixed[pixel, n, c]
