"""Compiled loops of the fast engine. Each is a plain function of arrays, so that it can be read and timed alone.

Compiled once for each type of samples and cached on disk. They release the interpreter's lock; the threads
are Python's own.
"""

from __future__ import annotations

import numba
import numpy as np

# Sums may be reordered so that they vectorise; NaN and infinity keep their meaning.
_FAST = {"contract", "reassoc", "nsz"}
_compiled = numba.njit(nogil=True, cache=True, fastmath=_FAST, error_model="numpy")
_inlined = numba.njit(nogil=True, cache=True, fastmath=_FAST, error_model="numpy", inline="always")


@_compiled
def sum_rows(values, view_rows, column, weights, first, shares, start, stop, sums):  # type: ignore[no-untyped-def]
    """sums[y − start] = the rows of all views of one column that fall on raster row y.

    values: (v, u, t, n), n = columns × channels; view_rows, weights: (taps,); first: (taps, rows);
    shares: (taps, rows, width), width a multiple of 3, zero where a pixel gathers fewer rows.

    Four views are added at a time, row after row: one pass over the line of sums then serves twelve rows of
    samples, and each view is read as one run of memory.
    """
    last, n = values.shape[2] - 1, values.shape[3]
    used = np.flatnonzero(weights)
    place = np.empty((4, 3), np.int64)
    share = np.empty((4, 3), np.float32)
    j = np.empty(4, np.int64)
    for group in range(0, used.size, 4):
        for t in range(0, shares.shape[2], 3):
            for y in range(start, stop):
                line = sums[y - start]
                if group == 0 and t == 0:
                    line[:n] = 0  # here rather than all at once: the line stays in the nearest cache
                for g in range(4):
                    b = used[min(group + g, used.size - 1)]
                    weight = weights[b] if group + g < used.size else np.float32(0)
                    j[g] = view_rows[b]
                    for tap in range(3):
                        place[g, tap] = min(first[b, y] + t + tap, last)  # beyond the last row the share is zero
                        share[g, tap] = weight * shares[b, y, t + tap]
                r0, r1, r2 = (
                    values[j[0], column, place[0, 0]],
                    values[j[0], column, place[0, 1]],
                    values[j[0], column, place[0, 2]],
                )
                s0, s1, s2 = (
                    values[j[1], column, place[1, 0]],
                    values[j[1], column, place[1, 1]],
                    values[j[1], column, place[1, 2]],
                )
                t0, t1, t2 = (
                    values[j[2], column, place[2, 0]],
                    values[j[2], column, place[2, 1]],
                    values[j[2], column, place[2, 2]],
                )
                u0, u1, u2 = (
                    values[j[3], column, place[3, 0]],
                    values[j[3], column, place[3, 1]],
                    values[j[3], column, place[3, 2]],
                )
                a0, a1, a2 = share[0, 0], share[0, 1], share[0, 2]
                b0, b1, b2 = share[1, 0], share[1, 1], share[1, 2]
                c0, c1, c2 = share[2, 0], share[2, 1], share[2, 2]
                d0, d1, d2 = share[3, 0], share[3, 1], share[3, 2]
                for x in range(n):
                    line[x] += (
                        (a0 * np.float32(r0[x]) + a1 * np.float32(r1[x]) + a2 * np.float32(r2[x]))
                        + (b0 * np.float32(s0[x]) + b1 * np.float32(s1[x]) + b2 * np.float32(s2[x]))
                    ) + (
                        (c0 * np.float32(t0[x]) + c1 * np.float32(t1[x]) + c2 * np.float32(t2[x]))
                        + (d0 * np.float32(u0[x]) + d1 * np.float32(u1[x]) + d2 * np.float32(u2[x]))
                    )


@_compiled
def sum_masked_rows(  # type: ignore[no-untyped-def]
    values, view_rows, column, weights, first, shares, fine, masks, mask_start, mask_rows, row, row_step,
    start, stop, sums,
):  # fmt: skip
    """As `sum_rows`, each sample times its weight from the masks.

    masks: (all rows of all masks, n), already sampled at the columns of the samples; mask_start, mask_rows:
    (masks,), where each mask's rows begin and how many there are; row: (masks, taps), mask row of sample
    row 0; row_step: (masks,).

    fine: (first_row, row_shares, first_column, column_shares, channels) by which samples are divided into
    finer ones, the rows and columns above then being fine ones; empty tables leave samples as they are.

    Rows of weighted samples are made once for each view, then summed by raster row.
    """
    fine_first_row, fine_row_shares, fine_first_column, fine_column_shares, channels = fine
    divided = fine_first_row.size > 0
    last, n = values.shape[2] - 1, values.shape[3]
    if divided:
        last, n = fine_first_row.size - 1, fine_first_column.size * channels
    source = np.zeros(values.shape[3] + fine_column_shares.shape[1] * channels, np.float32)
    samples = np.zeros(n, np.float32)
    used = np.flatnonzero(weights)
    low, high = np.full(weights.size, last + 1), np.zeros(weights.size, np.int64)
    for b in used:
        for y in range(start, stop):
            for t in range(shares.shape[2]):
                if shares[b, y, t] != 0:
                    low[b] = min(low[b], first[b, y] + t)
                    high[b] = max(high[b], first[b, y] + t + 1)
    products = np.zeros((max(int((high - low).max()), 1), n), np.float32)
    for b in used:
        j = view_rows[b]
        for l in range(low[b], high[b]):
            product = products[l - low[b]]
            if divided:
                _divided_row(
                    values, j, column, fine_first_row[l], fine_row_shares[l],
                    fine_first_column, fine_column_shares, channels, source, samples,
                )  # fmt: skip
                _weigh(samples, masks, mask_start, mask_rows, row, row_step, b, l, weights[b], product)
            else:
                whole = values[j, column, l]
                _weigh(whole, masks, mask_start, mask_rows, row, row_step, b, l, weights[b], product)
        for y in range(start, stop):
            line = y - start
            for t in range(0, shares.shape[2], 3):
                a0, a1, a2 = shares[b, y, t], shares[b, y, t + 1], shares[b, y, t + 2]
                if a0 == 0 and a1 == 0 and a2 == 0:
                    continue
                # Where a share is zero, any row will do.
                r0 = min(max(first[b, y] + t, low[b]), high[b] - 1) - low[b]
                r1 = min(max(first[b, y] + t + 1, low[b]), high[b] - 1) - low[b]
                r2 = min(max(first[b, y] + t + 2, low[b]), high[b] - 1) - low[b]
                for x in range(n):
                    sums[line, x] += a0 * products[r0, x] + a1 * products[r1, x] + a2 * products[r2, x]


@_compiled
def _divided_row(  # type: ignore[no-untyped-def]
    values, j, column, first, row_shares, first_column, column_shares, channels, source, samples
):
    """samples = one row of finer samples of a view; source is room for a row of the view itself."""
    n = values.shape[3]
    source[:n] = 0
    for t in range(row_shares.size):
        if row_shares[t] != 0:
            line = values[j, column, first + t]
            for x in range(n):
                source[x] += row_shares[t] * np.float32(line[x])
    samples[:] = 0
    mix_columns(source.reshape(1, -1), first_column, column_shares, (0, 0), channels, samples.reshape(1, -1))


@_inlined
def _weigh(samples, masks, mask_start, mask_rows, row, row_step, b, l, weight, product):  # type: ignore[no-untyped-def]
    """product = weight · samples · masks along one row."""
    if row_step.size == 0:
        for x in range(product.size):
            product[x] = weight * np.float32(samples[x])
    for mask in range(row_step.size):
        place = row[mask, b] + row_step[mask] * l
        if not (place > -1 and place < mask_rows[mask]):
            product[:] = 0
            break
        r = int(np.floor(place))
        after = np.float32(place - r)
        before = np.float32(1) - after
        # Outside the texture there is no light: a weight of zero on any row that exists.
        if r < 0:
            r, before = 0, np.float32(0)
            upper, lower = masks[mask_start[mask]], masks[mask_start[mask]]
        elif r + 1 >= mask_rows[mask]:
            after = np.float32(0)
            upper, lower = masks[mask_start[mask] + r], masks[mask_start[mask] + r]
        else:
            upper, lower = masks[mask_start[mask] + r], masks[mask_start[mask] + r + 1]
        if mask == 0:
            before *= weight
            after *= weight
            for x in range(product.size):
                product[x] = (before * upper[x] + after * lower[x]) * np.float32(samples[x])
        else:
            for x in range(product.size):
                product[x] *= before * upper[x] + after * lower[x]


@_compiled
def sample_mask_columns(texture, column, channels, out):  # type: ignore[no-untyped-def]
    """out[r, k·channels + c] = texture[r] at column[k], linearly, zero outside."""
    rows, columns = texture.shape
    left = np.empty(column.size, np.int64)
    before = np.zeros(column.size, np.float32)
    after = np.zeros(column.size, np.float32)
    for k in range(column.size):
        # A border of dark columns around the texture, by weights of zero on columns that exist.
        c = int(np.floor(min(max(column[k], -1.0), float(columns))))
        left[k] = min(max(c, 0), max(columns - 2, 0))
        for n in range(2):
            if 0 <= c + n < columns:
                share = np.float32(column[k] - c if n else 1 - (column[k] - c))
                if c + n == left[k]:
                    before[k] = share
                else:
                    after[k] = share
    for r in range(rows):
        line = texture[r]
        for k in range(column.size):
            value = before[k] * line[left[k]] + after[k] * line[min(left[k] + 1, columns - 1)]
            for n in range(channels):
                out[r, k * channels + n] = value


@_compiled
def mix_columns(sums, first, shares, alike, channels, raster):  # type: ignore[no-untyped-def]
    """raster[y, x·channels + c] += Σ share · sums[y, k·channels + c] over the samples that reach column x.

    sums must reach ``width`` samples beyond the last one, with zeros; shares: (columns, width), width a
    multiple of 3. alike: (begin, end), columns with the same shares of successive samples: one contiguous
    sum, where the others are taken one by one.
    """
    begin, end = alike
    for y in range(sums.shape[0]):
        line, out = sums[y], raster[y]
        for t in range(0, shares.shape[1], 3):
            _mix_one_by_one(line, first, shares, t, channels, 0, begin, out)
            _mix_one_by_one(line, first, shares, t, channels, end, first.size, out)
            if end > begin:
                n = channels * (end - begin)
                start = channels * (first[begin] + t)
                near = line[start : start + n]
                mid = line[start + channels : start + channels + n]
                far = line[start + 2 * channels : start + 2 * channels + n]
                here = out[channels * begin : channels * end]
                a, b, c = shares[begin, t], shares[begin, t + 1], shares[begin, t + 2]
                for x in range(n):
                    here[x] += a * near[x] + b * mid[x] + c * far[x]


@_inlined
def _mix_one_by_one(line, first, shares, t, channels, begin, end, out):  # type: ignore[no-untyped-def]
    for x in range(begin, end):
        k = channels * (first[x] + t)
        a, b, c = shares[x, t], shares[x, t + 1], shares[x, t + 2]
        if channels == 3:
            out[3 * x] += a * line[k] + b * line[k + 3] + c * line[k + 6]
            out[3 * x + 1] += a * line[k + 1] + b * line[k + 4] + c * line[k + 7]
            out[3 * x + 2] += a * line[k + 2] + b * line[k + 5] + c * line[k + 8]
        else:
            for n in range(channels):
                out[channels * x + n] += (
                    a * line[k + n] + b * line[k + channels + n] + c * line[k + 2 * channels + n]
                )


@_compiled
def add_band(  # type: ignore[no-untyped-def]
    values, view_rows, view_columns, weights, first_row, row_shares, first_column, column_shares, alike,
    channels, start, stop, raster,
):  # fmt: skip
    """Add all views to raster rows start … stop, column of views by column of views.

    weights: (rows of taps, columns of taps); first_row: (rows of taps, raster rows); first_column: (columns
    of taps, raster columns); shares with one axis more; raster: (rows, columns × channels).
    """
    n = values.shape[3]
    sums = np.zeros((stop - start, n + column_shares.shape[2] * channels), np.float32)
    for a in range(view_columns.size):
        if not weights[:, a].any():
            continue
        sum_rows(
            values,
            view_rows,
            view_columns[a],
            weights[:, a],
            first_row,
            row_shares,
            start,
            stop,
            sums,
        )
        mix_columns(sums, first_column[a], column_shares[a], alike[a], channels, raster[start:stop])


@_compiled
def add_masked_band(  # type: ignore[no-untyped-def]
    values, view_rows, column, weights, first_row, row_shares, fine, masks, mask_start, mask_rows, row, row_step,
    first_column, column_shares, alike, channels, start, stop, raster,
):  # fmt: skip
    """As `add_band` for one column of views, each sample divided as ``fine`` says and weighted by the masks."""
    n = fine[2].size * channels if fine[2].size > 0 else values.shape[3]
    sums = np.zeros((stop - start, n + column_shares.shape[1] * channels), np.float32)
    sum_masked_rows(
        values, view_rows, column, weights, first_row, row_shares, fine, masks, mask_start, mask_rows, row,
        row_step, start, stop, sums,
    )  # fmt: skip
    mix_columns(sums, first_column, column_shares, alike, channels, raster[start:stop])


@_inlined
def _cumulative(interpolation, a):  # type: ignore[no-untyped-def]
    """Φ of `vcc.plan.footprint`; interpolation 1 is linear, 2 cubic."""
    r = abs(a)
    if interpolation == 1:
        r = min(r, 1.0)
        half = r - r * r / 2
    elif r < 1:
        half = r - r**3 * (5.0 / 6.0) + r**4 * (3.0 / 8.0)
    else:
        r = min(r, 2.0)
        half = 13.0 / 24.0 + (-(r**4) / 8 + r**3 * (5.0 / 6.0) - 2 * r * r + 2 * r) - 17.0 / 24.0
    return 0.5 + half if a >= 0 else 0.5 - half


@_inlined
def _share(interpolation, offset, size, opening):  # type: ignore[no-untyped-def]
    if interpolation == 0:
        reach = max(size, 1.0) / 2
        return 1.0 / max(size, 1.0) if -reach - 1e-9 <= offset < reach - 1e-9 else 0.0
    upper = _cumulative(interpolation, (offset + opening / 2) / size)
    return (upper - _cumulative(interpolation, (offset - opening / 2) / size)) / opening


@_inlined
def _looked_up(texture, row, column):  # type: ignore[no-untyped-def]
    rows, columns = texture.shape
    if not (row > -1 and row < rows and column > -1 and column < columns):
        return 0.0
    r, c = int(np.floor(row)), int(np.floor(column))
    value = 0.0
    for dr in range(2):
        for dc in range(2):
            if 0 <= r + dr < rows and 0 <= c + dc < columns:
                share = (row - r if dr else 1 - (row - r)) * (column - c if dc else 1 - (column - c))
                value += share * texture[r + dr, c + dc]
    return value


@_compiled
def sheared_view(  # type: ignore[no-untyped-def]
    view, weight, interpolation, reach, x0, y0, step, shear, row_step, column_step, fine_row_step,
    fine_column_step, first_k, first_l, refine, textures, texture_size, mask_place, mask_step, start, stop,
    opening, raster,
):  # fmt: skip
    """Add one view to raster rows start … stop where rows and columns of samples shear on the sensor.

    view: (t, s, channels); textures: (masks, rows, columns), each filling texture_size[mask] of it;
    mask_place: (masks, 2) as (column, row) of sample (0, 0); mask_step: (masks, 2, 2).
    """
    nt, ns, channels = view.shape
    height, width = abs(fine_row_step), abs(fine_column_step)
    reach_y = 1e-6 + (max(height, 1.0) / 2 if interpolation == 0 else reach * height + 0.5)
    reach_x = 1e-6 + (max(width, 1.0) / 2 if interpolation == 0 else reach * width + 0.5)
    line = np.empty((ns, channels))
    for y in range(start, stop):
        line[:] = 0
        lit = False
        for n in range(ns):
            k = first_k + n / refine
            y_start = y0 + step[1, 0] * k + row_step * first_l
            middle = (y - y_start) / fine_row_step
            low = max(int(np.ceil(middle - reach_y / height)), 0)
            high = min(int(np.floor(middle + reach_y / height)), nt - 1)
            for m in range(low, high + 1):
                share = weight * _share(interpolation, y - y_start - fine_row_step * m, height, opening)
                l = first_l + m / refine
                for mask in range(mask_place.shape[0]):
                    column = mask_place[mask, 0] + mask_step[mask, 0, 0] * k + mask_step[mask, 0, 1] * l
                    row = mask_place[mask, 1] + mask_step[mask, 1, 0] * k + mask_step[mask, 1, 1] * l
                    texture = textures[mask, : texture_size[mask, 0], : texture_size[mask, 1]]
                    share *= _looked_up(texture, row, column)
                if share != 0:
                    lit = True
                    for c in range(channels):
                        line[n, c] += share * view[m, n, c]
        if not lit:
            continue
        for n in range(ns):
            x = x0 + shear * (y - y0) + column_step * (first_k + n / refine)
            low = max(int(np.ceil(x - reach_x)), 0)
            high = min(int(np.floor(x + reach_x)), raster.shape[1] - 1)
            for pixel in range(low, high + 1):
                share = _share(interpolation, pixel - x, width, opening)
                for c in range(channels):
                    raster[y, pixel, c] += share * line[n, c]
