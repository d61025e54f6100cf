"""Compiled loops of the fast engine. Each is a plain function of arrays, so that it can be read and timed alone.

Compiled once for each type of samples and cached on disk. They release the interpreter's lock; the threads
are Python's own.
"""

from __future__ import annotations

import numba
import numpy as np

from vcc.engines.vector_sums import (
    EIGHT,
    ROWS,
    RUN,
    RUN_OF_THREES,
    add_masked_rows,
    add_masked_rows_of_threes,
    add_rows,
    fetch,
    mix_eight,
)

VIEWS = 8
"""Views that are summed at once: more would be more runs of memory at once than a processor foresees."""

# Sums may be reordered so that they vectorise; NaN and infinity keep their meaning.
_FAST = {"contract", "reassoc", "nsz"}
_compiled = numba.njit(nogil=True, cache=True, fastmath=_FAST, error_model="numpy")
_inlined = numba.njit(nogil=True, cache=True, fastmath=_FAST, error_model="numpy", inline="always")


@_compiled
def sum_rows(  # type: ignore[no-untyped-def]
    samples, begin, pitch, used, weights, first, shares, reach, advance, jump, start, stop, masks, repeat, sums,
):  # fmt: skip
    """sums[y − start] += the rows of all views of one column that fall on raster row y, times their masks.

    samples: flat; row l of tap b is samples[begin[b] + l · pitch : … + pitch]. used: the taps that are added;
    weights: (taps,); first: (taps, rows), shares: (taps, rows, width), the rows of samples that a raster row
    gathers. reach: the most rows of samples that four raster rows gather. masks: see `_masks_at`, or None. repeat:
    3 where a weight of a mask counts for three channels, else 1.

    Four raster rows are summed at a time, so that each sample is converted and weighed once for all of them. The
    raster is walked along so that samples are read in the order in which they lie in memory (a real image runs
    against its samples), and what is needed next is asked for beforehand, since many short runs are more than a
    processor foresees by itself. advance: rows of samples that the next four raster rows need anew; jump: from
    here to the samples of the next column of views.
    """
    width, count = shares.shape[2], 0
    if masks is not None:  # told apart when compiled: without masks there is less to compile
        count = masks[4].size
    group = min(VIEWS, used.size)
    room = group * reach
    order, places, ranges = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64)
    share = np.empty((room, ROWS), np.float32)
    mask_places = np.empty((room, count, 2), np.int64)
    mask_shares = np.empty((room, count, 2), np.float32)
    ends, highest, lowest = np.empty(10, np.int64), np.empty(reach, np.int64), np.empty(reach, np.int64)
    next_rows, first_rows = np.empty(group * max(advance, reach), np.int64), np.empty(group * reach, np.int64)
    per_line = 64 // samples.itemsize
    run = RUN if masks is None or repeat == 1 else RUN_OF_THREES
    tiles = (stop - start + ROWS - 1) // ROWS
    for begin_group in range(0, used.size, group):
        views = used[begin_group : begin_group + group]
        downwards = first[views[0], stop - 1] >= first[views[0], start]
        first_count = 0
        for step in range(tiles):
            y = start + ROWS * (step if downwards else tiles - 1 - step)
            entries, next_count = 0, 0
            for b in views:
                top, rows = _rows_of(b, y, stop, weights[b], first, shares, width, share, entries, lowest, highest)
                for q in range(rows):
                    entry, l = entries + q, top + q
                    places[entry] = begin[b] + l * pitch
                    # Ranges are numbered 00 01 02 03 11 12 13 22 23 33; −1: nothing is added.
                    low = lowest[q]
                    ranges[entry] = -1 if low < 0 else low * ROWS - low * (low + 1) // 2 + highest[q]
                    if masks is not None:  # noqa: SIM102  (by itself, so that it can be told apart when compiled)
                        if not _masks_at(masks, b, l, entry, mask_places, mask_shares):
                            ranges[entry] = -1
                entries += rows
                for l in range(top + rows, top + rows + advance):
                    next_rows[next_count] = begin[b] + l * pitch
                    next_count += 1
                if step == 0:
                    for l in range(top, top + rows):
                        first_rows[first_count] = begin[b] + l * pitch + jump
                        first_count += 1
            _sort(ranges, entries, ends, order)
            following, following_count = (next_rows, next_count) if step < tiles - 1 else (first_rows, first_count)
            for x in range(0, pitch, run):
                for near in range((x + per_line - 1) // per_line * per_line, min(x + run, pitch), per_line):
                    for n in range(following_count):
                        fetch(samples, following[n] + near)
                here = min(x, pitch - run)
                if masks is None:
                    add_rows(samples, order, places, share, ends, here, x - here, sums, y - start)
                elif repeat == 3:
                    add_masked_rows_of_threes(
                        samples, order, places, share, ends, here, x - here, sums, y - start,
                        masks[0], mask_places, mask_shares,
                    )  # fmt: skip
                else:
                    add_masked_rows(
                        samples, order, places, share, ends, here, x - here, sums, y - start,
                        masks[0], mask_places, mask_shares,
                    )  # fmt: skip


@_inlined
def _rows_of(b, y, stop, weight, first, shares, width, share, entry, lowest, highest):  # type: ignore[no-untyped-def]
    """List the rows of samples of tap b that fall on four raster rows from y on: the first, and how many.

    Row ``first + q`` counts ``share[entry + q]`` there, and reaches raster rows y + lowest[q] … y + highest[q];
    lowest[q] is −1 if it reaches none.
    """
    rows = min(ROWS, stop - y)
    top = first[b, y]
    for r in range(1, rows):
        top = min(top, first[b, y + r])
    count = 0
    lowest[:] = -1
    for r in range(rows):
        for t in range(width):
            if shares[b, y + r, t] != 0:
                q = first[b, y + r] - top + t
                if lowest[q] < 0:
                    lowest[q] = r
                    share[entry + q] = 0
                    count = max(count, q + 1)
                highest[q] = r
                share[entry + q, r] = weight * shares[b, y + r, t]
    return top, count


@_inlined
def _masks_at(masks, b, l, entry, places, shares):  # type: ignore[no-untyped-def]
    """Look up the masks' lines above and below row l of the samples of tap b; False if it is dark there.

    masks: (lines, begin, rows, row, row_step). lines: flat, masks' weights at the columns of the samples. begin:
    (masks, taps), where in them a mask's row 0 begins, or would begin; rows: (masks,), how many a mask has, each
    ``line`` long; row: (masks, taps), mask row of sample row 0; row_step: (masks,).
    """
    lines, begin, rows, row, row_step = masks
    line = lines.shape[1]
    for mask in range(row_step.size):
        place = row[mask, b] + row_step[mask] * l
        if not (place > -1 and place < rows[mask]):
            return False
        r = int(np.floor(place))
        after = np.float32(place - r)
        # Outside the texture there is no light: a weight of zero on any row that exists.
        shares[entry, mask, 0] = 0 if r < 0 else np.float32(1) - after
        shares[entry, mask, 1] = 0 if r + 1 >= rows[mask] else after
        places[entry, mask, 0] = (begin[mask, b] + max(r, 0)) * line
        places[entry, mask, 1] = (begin[mask, b] + min(r + 1, rows[mask] - 1)) * line
    return True


@_inlined
def _sort(ranges, entries, ends, order):  # type: ignore[no-untyped-def]
    """Order the entries by range; ``ends`` counts those of each range and the ones before it."""
    ends[:] = 0
    for entry in range(entries):
        if ranges[entry] >= 0:
            ends[ranges[entry]] += 1
    total = 0
    for n in range(ends.size):
        here = ends[n]
        ends[n] = total
        total += here
    for entry in range(entries):
        if ranges[entry] >= 0:
            order[ends[ranges[entry]]] = entry
            ends[ranges[entry]] += 1


@_compiled
def add_columns(  # type: ignore[no-untyped-def]
    samples, begin, column_begin, first, end, pitch, weights, first_row, row_shares, reach, advance, masks, repeat,
    first_column, column_shares, channels, start, stop, tiles,
):  # fmt: skip
    """Add the columns of view taps ``first`` … ``end`` to raster rows start … stop, one after the other.

    samples: flat; row l of view tap (b, a) begins at begin[b] + column_begin[a] + l · pitch. weights: (rows of
    taps, columns of taps); first_row: (rows of taps, raster rows), first_column: (columns of taps, raster
    columns), shares with one axis more; tiles: the raster, (rows / 8, columns · channels, 8).
    """
    sums, turned = _room(stop - start, pitch, column_shares.shape[2], channels)
    for a in range(first, end):
        used = np.flatnonzero(weights[:, a])
        if used.size > 0:
            sums[:] = 0
            jump = column_begin[a + 1] - column_begin[a] if a + 1 < column_begin.size else 0
            sum_rows(
                samples, begin + column_begin[a], pitch, used, weights[:, a], first_row, row_shares, reach,
                advance, jump, start, stop, masks, repeat, sums,
            )  # fmt: skip
            mix_columns(sums, pitch, first_column[a], column_shares[a], channels, turned, tiles[start // EIGHT :])


@_compiled
def add_divided_column(  # type: ignore[no-untyped-def]
    samples, begin, sample_pitch, pitch, weights, first_row, row_shares, reach, advance, fine, masks, repeat,
    first_column, column_shares, channels, start, stop, tiles,
):  # fmt: skip
    """As `add_columns` for one column of views, whose samples are divided into finer ones, view by view.

    samples: flat; row l of tap b begins at begin[b] + l · sample_pitch. pitch: values of a row of finer samples;
    fine: (first_row, row_shares, first_column, column_shares), by which they are made.
    """
    fine_first_row, fine_row_shares, fine_first_column, fine_column_shares = fine
    sums, turned = _room(stop - start, pitch, column_shares.shape[1], channels)
    sums[:] = 0
    source = np.zeros(sample_pitch + fine_column_shares.shape[1] * channels, np.float32)
    rows = np.zeros((0, pitch), np.float32)
    here = np.zeros(weights.size, np.int64)
    for b in np.flatnonzero(weights):
        low, high = fine_first_row.size, 0
        for y in range(start, stop):
            for t in range(row_shares.shape[2]):
                if row_shares[b, y, t] != 0:
                    low, high = min(low, first_row[b, y] + t), max(high, first_row[b, y] + t + 1)
        if high <= low:
            continue
        if high - low > len(rows):
            rows = np.zeros((high - low, pitch), np.float32)
        for l in range(low, high):
            _divided_row(
                samples, begin[b] + fine_first_row[l] * sample_pitch, sample_pitch, fine_row_shares[l],
                fine_first_column, fine_column_shares, channels, source, rows[l - low],
            )  # fmt: skip
        here[b] = -low * pitch
        sum_rows(
            rows.reshape(-1), here, pitch, np.array([b]), weights, first_row, row_shares, reach, advance, 0, start,
            stop, masks, repeat, sums,
        )  # fmt: skip
    mix_columns(sums, pitch, first_column, column_shares, channels, turned, tiles[start // EIGHT :])


@_inlined
def _room(rows, pitch, width, channels):  # type: ignore[no-untyped-def]
    """Sums of a band's rows, to be set to zero, and eight of them turned, with zeros beyond the last sample."""
    sums = np.empty(((rows + EIGHT - 1) // EIGHT * EIGHT, pitch), np.float32)
    return sums, np.zeros(((pitch + width * channels) * EIGHT), np.float32)


@_compiled
def _divided_row(  # type: ignore[no-untyped-def]
    samples, begin, pitch, row_shares, first_column, column_shares, channels, source, fine
):
    """fine = one row of finer samples; source is room for a row of the samples, zero beyond the last."""
    source[:pitch] = 0
    for t in range(row_shares.size):
        if row_shares[t] != 0:
            line = samples[begin + t * pitch : begin + (t + 1) * pitch]
            for x in range(pitch):
                source[x] += row_shares[t] * np.float32(line[x])
    for k in range(first_column.size):
        at = np.uint64(first_column[k] * channels)
        if channels == 3:
            red, green, blue = np.float32(0), np.float32(0), np.float32(0)
            for t in range(column_shares.shape[1]):
                share = column_shares[k, t]
                red += share * source[at]
                green += share * source[at + np.uint64(1)]
                blue += share * source[at + np.uint64(2)]
                at += np.uint64(3)
            fine[3 * k], fine[3 * k + 1], fine[3 * k + 2] = red, green, blue
        else:
            for c in range(channels):
                total = np.float32(0)
                for t in range(column_shares.shape[1]):
                    total += column_shares[k, t] * source[at + np.uint64(t * channels + c)]
                fine[k * channels + c] = total


@_compiled
def sample_mask_columns(texture, column, repeat, out):  # type: ignore[no-untyped-def]
    """out[r, k · repeat + c] = texture[r] at column[k], linearly, zero outside."""
    rows, columns = texture.shape
    left, right = np.empty(column.size, np.uint64), np.empty(column.size, np.uint64)
    before, after = np.zeros(column.size, np.float32), np.zeros(column.size, np.float32)
    for k in range(column.size):
        # A border of dark columns around the texture, by weights of zero on columns that exist.
        place = min(max(column[k], -1.0), float(columns))
        c = int(np.floor(place))
        left[k], right[k] = min(max(c, 0), columns - 1), min(max(c + 1, 0), columns - 1)
        before[k] = 1 - (place - c) if 0 <= c < columns else 0
        after[k] = place - c if 0 <= c + 1 < columns else 0
    for r in range(rows):
        line, to = texture[r], out[r]
        if repeat == 1:
            for k in range(column.size):
                to[k] = before[k] * line[left[k]] + after[k] * line[right[k]]
        else:
            for k in range(column.size):
                value = before[k] * line[left[k]] + after[k] * line[right[k]]
                for n in range(repeat):
                    to[k * repeat + n] = value


@_compiled
def mix_columns(sums, pitch, first, shares, channels, turned, tiles):  # type: ignore[no-untyped-def]
    """tiles[i, x · channels + c, y] += Σ share · sums[8i + y, k · channels + c] over samples k that reach x.

    sums: (rows, pitch), a multiple of 8 of them. Eight rows are turned to stand side by side, so that they are
    mixed alike wherever a column's samples begin; turned is the room for it, zero beyond the last sample. first:
    (columns,), shares: (columns, width).
    """
    step = EIGHT * channels
    for tile in range(len(sums) // EIGHT):
        rows = sums[EIGHT * tile : EIGHT * (tile + 1)]
        a, b, c, d, e, f, g, h = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6], rows[7]
        for k in range(pitch):
            turned[8 * k], turned[8 * k + 1], turned[8 * k + 2], turned[8 * k + 3] = a[k], b[k], c[k], d[k]
            turned[8 * k + 4], turned[8 * k + 5], turned[8 * k + 6], turned[8 * k + 7] = e[k], f[k], g[k], h[k]
        out = tiles[tile].reshape(-1)
        for x in range(first.size):
            for n in range(channels):
                mix_eight(turned, step * first[x] + EIGHT * n, step, shares, x, out, step * x + EIGHT * n)


@_compiled
def raster_of(tiles, channels, mirrored, start, stop, raster):  # type: ignore[no-untyped-def]
    """Rows start … stop of the raster, (rows, columns · channels), from its tiles as `mix_columns` has them."""
    columns = raster.shape[1] // channels
    for tile in range(start // EIGHT, (stop + EIGHT - 1) // EIGHT):
        rows = min(EIGHT, stop - EIGHT * tile)
        for x in range(columns):
            to = (columns - 1 - x if mirrored else x) * channels
            for n in range(channels):
                for y in range(rows):
                    raster[EIGHT * tile + y, to + n] = tiles[tile, x * channels + n, y]


@_compiled
def filter_rows(  # type: ignore[no-untyped-def]
    raster, down, across, channels, guard, transmission, start, stop, picture
):
    """Rows start … stop of the picture: the raster convolved down and across, less its guard, times transmission.

    raster: (rows, columns · channels), dark beyond its border; down, across: odd numbers of float32 weights;
    transmission: (rows, columns), or empty; picture: (rows, columns · channels), each side by guard smaller.
    """
    rows, n = raster.shape
    wide = picture.shape[1]
    reach_down, reach = down.size // 2, channels * (across.size // 2)
    line = np.zeros(n + 2 * reach, np.float32)
    middle = line[reach : reach + n]
    for y in range(start, stop):
        middle[:] = 0
        for i in range(down.size):
            source = y + guard + reach_down - i
            if 0 <= source < rows:
                weight, here = down[i], raster[source]
                for x in range(n):
                    middle[x] += weight * here[x]
        out = picture[y]
        out[:] = 0
        for j in range(across.size):
            weight, begin = across[j], channels * (guard + 2 * (across.size // 2) - j)
            here = line[begin : begin + wide]
            for x in range(wide):
                out[x] += weight * here[x]
        if transmission.size > 0:
            for x in range(transmission.shape[1]):
                for c in range(channels):
                    out[x * channels + c] *= np.float32(transmission[y, x])


@_inlined
def _cumulative(interpolation, a):  # type: ignore[no-untyped-def]
    """Φ of `vcc.plan.footprints.shares`; interpolation 1 is linear, 2 cubic, 3 a spline."""
    r = abs(a)
    if interpolation == 1:
        r = min(r, 1.0)
        half = r - r * r / 2
    elif interpolation == 3:
        half = r * (2.0 / 3.0) - r**3 / 3 + r**4 / 8 if r < 1 else 0.5 - (2 - min(r, 2.0)) ** 4 / 24
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
