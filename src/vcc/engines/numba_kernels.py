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


@_inlined
def _add_three(line, r0, r1, r2, a, b, c):  # type: ignore[no-untyped-def]
    for x in range(line.size):
        line[x] += a * np.float32(r0[x]) + b * np.float32(r1[x]) + c * np.float32(r2[x])


@_inlined
def _add_six(line, r0, r1, r2, a, b, c, s0, s1, s2, d, e, f):  # type: ignore[no-untyped-def]
    for x in range(line.size):
        line[x] += (a * np.float32(r0[x]) + b * np.float32(r1[x]) + c * np.float32(r2[x])) + (
            d * np.float32(s0[x]) + e * np.float32(s1[x]) + f * np.float32(s2[x])
        )


@_compiled
def sum_rows(values, view_rows, column, weights, first, shares, start, stop, sums):  # type: ignore[no-untyped-def]
    """Add to sums[y − start] the rows of all views of one column that fall on raster row y.

    values: (v, u, t, n), n = columns × channels; view_rows, weights: (taps,); first: (taps, rows);
    shares: (taps, rows, width), width a multiple of 3, zero where a pixel gathers fewer rows.
    """
    last = values.shape[2] - 1
    used = np.flatnonzero(weights)
    width = shares.shape[2]
    for y in range(start, stop):
        line = sums[y - start]
        for t in range(0, width, 3):
            n = 0
            while n < used.size:
                b = used[n]
                w = weights[b]
                l0 = min(first[b, y] + t, last)  # beyond the last row the share is zero
                l1 = min(l0 + 1, last)
                l2 = min(l0 + 2, last)
                j = view_rows[b]
                if n + 1 < used.size:
                    b2 = used[n + 1]
                    w2 = weights[b2]
                    m0 = min(first[b2, y] + t, last)
                    m1 = min(m0 + 1, last)
                    m2 = min(m0 + 2, last)
                    j2 = view_rows[b2]
                    _add_six(
                        line,
                        values[j, column, l0],
                        values[j, column, l1],
                        values[j, column, l2],
                        w * shares[b, y, t],
                        w * shares[b, y, t + 1],
                        w * shares[b, y, t + 2],
                        values[j2, column, m0],
                        values[j2, column, m1],
                        values[j2, column, m2],
                        w2 * shares[b2, y, t],
                        w2 * shares[b2, y, t + 1],
                        w2 * shares[b2, y, t + 2],
                    )
                else:
                    _add_three(
                        line,
                        values[j, column, l0],
                        values[j, column, l1],
                        values[j, column, l2],
                        w * shares[b, y, t],
                        w * shares[b, y, t + 1],
                        w * shares[b, y, t + 2],
                    )
                n += 2


@_compiled
def sum_masked_rows(  # type: ignore[no-untyped-def]
    values, view_rows, column, weights, first, count, shares, masks, mask_start, mask_rows, row, row_step,
    start, stop, sums,
):  # fmt: skip
    """As `sum_rows`, each sample times its weight from the masks.

    masks: (all rows of all masks, n), already sampled at the columns of the samples; mask_start, mask_rows:
    (masks,), where each mask's rows begin and how many there are; row: (masks, taps), mask row of sample
    row 0; row_step: (masks,).
    """
    n = values.shape[3]
    product = np.empty(n, np.float32)
    for b in range(weights.size):
        if weights[b] == 0:
            continue
        # Raster rows in the order in which sample rows meet them: both ends of what a row gathers grow.
        flipped = first[b, stop - 1] < first[b, start]
        low, high = values.shape[2], 0
        for y in range(start, stop):
            if count[b, y] > 0:
                low = min(low, first[b, y])
                high = max(high, first[b, y] + count[b, y])
        begin = 0
        for l in range(low, high):  # noqa: E741
            samples = values[view_rows[b], column, l]
            lit = _weighted_row(samples, masks, mask_start, mask_rows, row, row_step, b, l, weights[b], product)
            if not lit:
                continue
            place = begin
            while place < stop - start:
                y = stop - 1 - place if flipped else start + place
                tap = l - first[b, y]
                if count[b, y] == 0 or tap >= count[b, y]:
                    if place == begin:
                        begin += 1
                    place += 1
                    continue
                if tap < 0:
                    break
                share = shares[b, y, tap]
                line = sums[y - start]
                for x in range(n):
                    line[x] += share * product[x]
                place += 1


@_inlined
def _weighted_row(samples, masks, mask_start, mask_rows, row, row_step, b, l, weight, product):  # type: ignore[no-untyped-def]  # noqa: E741
    """product = weight · samples · masks along one row; False where all is dark."""
    for mask in range(row_step.size):
        place = row[mask, b] + row_step[mask] * l
        if not (place > -1 and place < mask_rows[mask]):
            return False
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
    return True


@_compiled
def sample_mask_columns(texture, column, channels, out):  # type: ignore[no-untyped-def]
    """out[r, k·channels + c] = texture[r] at column[k], linearly, zero outside."""
    rows, columns = texture.shape
    for k in range(column.size):
        place = column[k]
        if not (place > -1 and place < columns):
            out[:, k * channels : (k + 1) * channels] = 0
            continue
        c = int(np.floor(place))
        after = np.float32(place - c)
        before = np.float32(1) - after
        for r in range(rows):
            value = np.float32(0)
            if c >= 0:
                value += before * texture[r, c]
            if c + 1 < columns:
                value += after * texture[r, c + 1]
            for n in range(channels):
                out[r, k * channels + n] = value


@_compiled
def mix_columns(sums, first, count, shares, channels, raster):  # type: ignore[no-untyped-def]
    """raster[y, x·channels + c] += Σ share · sums[y, k·channels + c] over the samples that reach column x."""
    columns = first.size
    for y in range(sums.shape[0]):
        line, out = sums[y], raster[y]
        if channels == 3:
            for x in range(columns):
                red, green, blue = np.float32(0), np.float32(0), np.float32(0)
                k = 3 * first[x]
                for t in range(count[x]):
                    share = shares[x, t]
                    red += share * line[k]
                    green += share * line[k + 1]
                    blue += share * line[k + 2]
                    k += 3
                out[3 * x] += red
                out[3 * x + 1] += green
                out[3 * x + 2] += blue
        else:
            for x in range(columns):
                for t in range(count[x]):
                    k = channels * (first[x] + t)
                    for c in range(channels):
                        out[channels * x + c] += shares[x, t] * line[k + c]


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
def _share(interpolation, offset, size):  # type: ignore[no-untyped-def]
    if interpolation == 0:
        reach = max(size, 1.0) / 2
        return 1.0 / max(size, 1.0) if -reach <= offset < reach else 0.0
    return _cumulative(interpolation, (offset + 0.5) / size) - _cumulative(interpolation, (offset - 0.5) / size)


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
    raster,
):  # fmt: skip
    """Add one view to raster rows start … stop where rows and columns of samples shear on the sensor.

    view: (t, s, channels); textures: (masks, rows, columns), each filling texture_size[mask] of it;
    mask_place: (masks, 2) as (column, row) of sample (0, 0); mask_step: (masks, 2, 2).
    """
    nt, ns, channels = view.shape
    height, width = abs(fine_row_step), abs(fine_column_step)
    reach_y = max(height, 1.0) / 2 if interpolation == 0 else reach * height + 0.5
    reach_x = max(width, 1.0) / 2 if interpolation == 0 else reach * width + 0.5
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
                share = weight * _share(interpolation, y - y_start - fine_row_step * m, height)
                l = first_l + m / refine  # noqa: E741
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
                share = _share(interpolation, pixel - x, width)
                for c in range(channels):
                    raster[y, pixel, c] += share * line[n, c]
