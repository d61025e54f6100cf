"""Compiled loops of the fast engine: plain functions of arrays that can be read and timed separately.

They are compiled once for each type of samples and cached on disk (`vcc.engines.compiled`). They release the
GIL; the threads are Python threads.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import fast_inlined, fast_loop
from vcc.engines.footprint_tables import Entries, EntryMasks, Lines
from vcc.engines.interpolation import dark_outside, three_around
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
"""Views summed at once. More would be more concurrent streams of memory than the processor prefetches."""


@fast_loop
def sum_rows(lines, used, weights, gathered, masks, band, sums):  # type: ignore[no-untyped-def]
    """sums[y − band.start] += the rows of all views of one column that fall on raster row y, times their masks.

    lines: `Lines`. used: the taps to add; weights: (taps,). gathered: `Rows`. masks: `MaskLines`, or None.

    Four raster rows are summed at a time, so that each sample is converted and weighed once for all four. The
    loop over the raster follows the memory order of the samples (a real image is inverted, so their rows run in
    opposite directions). The next rows are prefetched explicitly: processors do not prefetch many short runs.
    """
    samples, begin, pitch, jump = lines
    first, reach, advance = gathered.first, gathered.reach, gathered.advance
    start, stop = band
    group = min(VIEWS, used.size)
    room = group * reach
    repeat = 1
    if masks is not None:  # resolved at compile time: less to compile without masks
        repeat, count = masks.repeat, masks.row_step.size
        weighed = EntryMasks(
            masks.lines, np.empty((room, count, 3), np.int64), np.empty((room, count, 3), np.float32)
        )
    order, places, ranges = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64)
    share = np.empty((room, ROWS), np.float32)
    ends, highest, lowest = np.empty(10, np.int64), np.empty(reach, np.int64), np.empty(reach, np.int64)
    next_rows, first_rows = np.empty(group * max(advance, reach), np.int64), np.empty(group * reach, np.int64)
    per_line = 64 // samples.itemsize
    run = RUN if repeat == 1 else RUN_OF_THREES
    tiles = (stop - start + ROWS - 1) // ROWS
    entries = Entries(order, ends, places, share)
    for begin_group in range(0, used.size, group):
        views = used[begin_group : begin_group + group]
        downwards = first[views[0], stop - 1] >= first[views[0], start]
        first_count = 0
        for step in range(tiles):
            y = start + ROWS * (step if downwards else tiles - 1 - step)
            listed, next_count = 0, 0
            for b in views:
                top, rows = rows_of(b, y, stop, weights[b], gathered, share, listed, lowest, highest)
                for q in range(rows):
                    entry, l = listed + q, top + q
                    places[entry] = begin[b] + l * pitch
                    # Ranges are numbered 00 01 02 03 11 12 13 22 23 33; −1 adds nothing.
                    low = lowest[q]
                    ranges[entry] = -1 if low < 0 else low * ROWS - low * (low + 1) // 2 + highest[q]
                    if masks is not None:  # noqa: SIM102  (a separate condition is resolved at compile time)
                        if not masks_at(masks, b, l, entry, weighed):
                            ranges[entry] = -1
                listed += rows
                for l in range(top + rows, top + rows + advance):
                    next_rows[next_count] = begin[b] + l * pitch
                    next_count += 1
                if step == 0:
                    for l in range(top, top + rows):
                        first_rows[first_count] = begin[b] + l * pitch + jump
                        first_count += 1
            sort_by_range(ranges, listed, ends, order)
            following, following_count = (next_rows, next_count) if step < tiles - 1 else (first_rows, first_count)
            for x in range(0, pitch, run):
                for near in range((x + per_line - 1) // per_line * per_line, min(x + run, pitch), per_line):
                    for n in range(following_count):
                        fetch(samples, following[n] + near)
                here = min(x, pitch - run)
                if masks is None:
                    add_rows(samples, entries, None, here, x - here, sums, y - start)
                elif repeat == 3:
                    add_masked_rows_of_threes(samples, entries, weighed, here, x - here, sums, y - start)
                else:
                    add_masked_rows(samples, entries, weighed, here, x - here, sums, y - start)


@fast_inlined
def rows_of(b, y, stop, weight, gathered, share, entry, lowest, highest):  # type: ignore[no-untyped-def]
    """List the rows of samples of tap b that fall on four raster rows from y on: returns (first row, count).

    Row ``first + q`` has the shares ``share[entry + q]`` there, and reaches raster rows y + lowest[q] … y +
    highest[q]; lowest[q] is −1 if it reaches none.
    """
    first, shares = gathered.first, gathered.shares
    rows = min(ROWS, stop - y)
    top = first[b, y]
    for r in range(1, rows):
        top = min(top, first[b, y + r])
    count = 0
    lowest[:] = -1
    for r in range(rows):
        for t in range(shares.shape[2]):
            if shares[b, y + r, t] != 0:
                q = first[b, y + r] - top + t
                if lowest[q] < 0:
                    lowest[q] = r
                    share[entry + q] = 0
                    count = max(count, q + 1)
                highest[q] = r
                share[entry + q, r] = weight * shares[b, y + r, t]
    return top, count


@fast_inlined
def masks_at(masks, b, l, entry, weighed):  # type: ignore[no-untyped-def]
    """Look up three lines of each mask around row l of the samples of tap b; False if the row is dark.

    masks: `MaskLines`. weighed: `EntryMasks`, filled for this entry.
    """
    lines, begin, rows, row, row_step, _ = masks
    _, places, shares = weighed
    line = lines.shape[1]
    for mask in range(row_step.size):
        place = row[mask, b] + row_step[mask] * l
        if not (place > -1.5 and place < rows[mask] + 0.5):
            return False
        r, above, here, below = three_around(place)
        last = rows[mask] - 1
        # Dark outside the texture: a weight of zero on any existing row.
        shares[entry, mask, 0] = above if r > 0 else 0
        shares[entry, mask, 1] = here if 0 <= r <= last else 0
        shares[entry, mask, 2] = below if r < last else 0
        places[entry, mask, 0] = (begin[mask, b] + max(r - 1, 0)) * line
        places[entry, mask, 1] = (begin[mask, b] + min(max(r, 0), last)) * line
        places[entry, mask, 2] = (begin[mask, b] + min(r + 1, last)) * line
    return True


@fast_inlined
def sort_by_range(ranges, entries, ends, order):  # type: ignore[no-untyped-def]
    """Sort the entries by range; ``ends`` is the number of entries in each range and all earlier ones."""
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


@fast_loop
def add_columns(samples, columns, footprints, masks, band, tiles):  # type: ignore[no-untyped-def]
    """Add columns of view taps, one after the other, to a band of raster rows.

    samples: `Samples`. columns: (first, end). footprints: `Footprints`. masks: `MaskLines`, or None. tiles: the
    raster, (rows / 8, columns · channels, 8).
    """
    weights, rows, (first_column, column_shares) = footprints
    values, begin, further, pitch, channels = samples
    sums, turned = _room(band, pitch, column_shares.shape[2], channels)
    for a in range(columns[0], columns[1]):
        used = np.flatnonzero(weights[:, a])
        if used.size > 0:
            sums[:] = 0
            jump = further[a + 1] - further[a] if a + 1 < further.size else 0
            lines = Lines(values, begin + further[a], pitch, jump)
            sum_rows(lines, used, weights[:, a], rows, masks, band, sums)
            mix_columns(sums, first_column[a], column_shares[a], channels, turned, tiles[band.start // EIGHT :])


@fast_loop
def add_divided_column(samples, a, footprints, fine, masks, band, tiles):  # type: ignore[no-untyped-def]
    """As `add_columns` for column a, whose samples are subdivided view by view; fine: `FineSamples`.

    ``footprints`` and ``masks`` refer to the finer samples.
    """
    weights, rows, (first_column, column_shares) = footprints
    begin, channels = samples.begin, samples.channels
    sums, turned = _room(band, fine.pitch, column_shares.shape[2], channels)
    sums[:] = 0
    divided = np.zeros((0, fine.pitch), np.float32)
    here = np.zeros(begin.size, np.int64)
    for b in np.flatnonzero(weights[:, a]):
        low, high = _rows_needed(rows, b, band, fine.first_row.size)
        if high <= low:
            continue
        if high - low > len(divided):
            divided = np.zeros((high - low, fine.pitch), np.float32)
        divide(samples, begin[b] + samples.further[a], fine, low, high, divided)
        here[b] = -low * fine.pitch
        lines = Lines(divided.reshape(-1), here, fine.pitch, 0)
        sum_rows(lines, np.array([b]), weights[:, a], rows, masks, band, sums)
    mix_columns(sums, first_column[a], column_shares[a], channels, turned, tiles[band.start // EIGHT :])


@fast_inlined
def _rows_needed(gathered, b, band, low):  # type: ignore[no-untyped-def]
    """(first, after the last) row of samples of tap b that falls on a band; first is ``low`` if there is none."""
    # Not a literal 0: Numba would compile functions called with it twice, for literals and for numbers.
    first, shares, high = gathered.first, gathered.shares, np.int64(0)
    for y in range(band.start, band.stop):
        for t in range(shares.shape[2]):
            if shares[b, y, t] != 0:
                low, high = min(low, first[b, y] + t), max(high, first[b, y] + t + 1)
    return low, high


@fast_inlined
def _room(band, pitch, width, channels):  # type: ignore[no-untyped-def]
    """Buffers: the sums of a band's rows (not zeroed), and eight transposed rows, zero beyond the last sample."""
    rows = band.stop - band.start
    sums = np.empty(((rows + EIGHT - 1) // EIGHT * EIGHT, pitch), np.float32)
    return sums, np.zeros(((pitch + width * channels) * EIGHT), np.float32)


@fast_loop
def divide(samples, begin, fine, low, high, divided):  # type: ignore[no-untyped-def]
    """divided[l − low] = row l of a view's finer samples, for low ≤ l < high; begin: where the view begins."""
    values, _, _, pitch, channels = samples
    first_row, row_shares, first_column, column_shares, _ = fine
    source = np.zeros(pitch + column_shares.shape[1] * channels, np.float32)  # zero beyond a row's last sample
    for l in range(low, high):
        source[:pitch] = 0
        for t in range(row_shares.shape[1]):
            if row_shares[l, t] != 0:
                start = begin + (first_row[l] + t) * pitch
                line, share = values[start : start + pitch], row_shares[l, t]
                for x in range(pitch):
                    source[x] += share * np.float32(line[x])
        divided[l - low] = 0
        add_along_row(source, first_column, column_shares, channels, 0, divided[l - low])


@fast_inlined
def add_along_row(source, first, shares, channels, start, out):  # type: ignore[no-untyped-def]
    """out[start + k · channels + c] += Σ shares[k, t] · source[(first[k] + t) · channels + c] over t."""
    for k in range(first.size):
        at, to = np.uint64(first[k] * channels), start + k * channels
        if channels == 3:
            red, green, blue = np.float32(0), np.float32(0), np.float32(0)
            for t in range(shares.shape[1]):
                share = shares[k, t]
                red += share * source[at]
                green += share * source[at + np.uint64(1)]
                blue += share * source[at + np.uint64(2)]
                at += np.uint64(3)
            out[to] += red
            out[to + 1] += green
            out[to + 2] += blue
        else:
            for c in range(channels):
                total = np.float32(0)
                for t in range(shares.shape[1]):
                    total += shares[k, t] * source[at + np.uint64(t * channels + c)]
                out[to + c] += total


@fast_inlined
def columns_around(column, columns):  # type: ignore[no-untyped-def]
    """The three columns around each place, (3, places), and their weights there, float32.

    Outside the ``columns`` it is dark: weights of zero on existing columns.
    """
    points, counts = np.empty((3, column.size), np.uint64), np.empty((3, column.size), np.float32)
    last = columns - 1
    for k in range(column.size):
        c, before, at, after = three_around(min(max(column[k], -2.0), columns + 1.0))
        for n, count in enumerate((before, at, after)):
            points[n, k] = min(max(c + n - 1, 0), last)
            counts[n, k] = count if 0 <= c + n - 1 <= last else 0
    return points, counts


@fast_loop
def sample_mask_columns(texture, column, repeat, out):  # type: ignore[no-untyped-def]
    """out[r, k · repeat + c] = texture[r] at column[k], by quadratic B-splines, zero outside."""
    points, counts = columns_around(column, texture.shape[1])
    left, here, right = points[0], points[1], points[2]
    before, at, after = counts[0], counts[1], counts[2]
    for r in range(len(texture)):
        line, to = texture[r], out[r]
        if repeat == 1:
            for k in range(column.size):
                to[k] = before[k] * line[left[k]] + at[k] * line[here[k]] + after[k] * line[right[k]]
        else:
            for k in range(column.size):
                value = before[k] * line[left[k]] + at[k] * line[here[k]] + after[k] * line[right[k]]
                for n in range(repeat):
                    to[k * repeat + n] = value


@fast_loop
def mix_columns(sums, first, shares, channels, turned, tiles):  # type: ignore[no-untyped-def]
    """tiles[i, x · channels + c, y] += Σ share · sums[8i + y, k · channels + c] over samples k that reach x.

    sums: (rows, pitch), a multiple of 8 rows. Eight rows are transposed, so that the same vector code mixes them
    whatever the first sample of a column. turned: buffer for them, zero beyond the last sample. first:
    (columns,). shares: (columns, width).
    """
    step, pitch = EIGHT * channels, sums.shape[1]
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


@fast_loop
def turned(raster, tile, tiles):  # type: ignore[no-untyped-def]
    """tiles[tile, x, y] = raster[8 · tile + y, x]: eight rows transposed, zero beyond the last."""
    start = EIGHT * tile
    for y in range(min(EIGHT, raster.shape[0] - start)):
        for x in range(raster.shape[1]):
            tiles[tile, x, y] = raster[start + y, x]


@fast_loop
def raster_of(tiles, channels, mirrored, band, raster):  # type: ignore[no-untyped-def]
    """Copy a band's rows of the raster, (rows, columns · channels), from tiles in the layout of `mix_columns`."""
    start, stop = band
    columns = raster.shape[1] // channels
    for tile in range(start // EIGHT, (stop + EIGHT - 1) // EIGHT):
        rows = min(EIGHT, stop - EIGHT * tile)
        for x in range(columns):
            to = (columns - 1 - x if mirrored else x) * channels
            for n in range(channels):
                for y in range(rows):
                    raster[EIGHT * tile + y, to + n] = tiles[tile, x * channels + n, y]


@fast_loop
def filter_rows(raster, finish, band, picture):  # type: ignore[no-untyped-def]
    """A band's rows of the image: the raster convolved down and across, cropped by its guard, times transmission.

    raster: (rows, columns · channels), dark beyond its border. finish: `Finish`. picture: (rows, columns ·
    channels), the raster without its guard.
    """
    down, across, channels, guard, transmission = finish
    rows, n = raster.shape
    wide = picture.shape[1]
    reach_down, reach = down.size // 2, channels * (across.size // 2)
    line = np.zeros(n + 2 * reach, np.float32)
    middle = line[reach : reach + n]
    for y in range(band.start, band.stop):
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


@fast_inlined
def _cumulative(interpolation, a):  # type: ignore[no-untyped-def]
    """Φ of `vcc.plan.footprints.shares`; interpolation 1 is linear, 2 cubic, 3 spline, 4 box."""
    r = abs(a)
    if interpolation == 4:
        half = min(r, 0.5)
    elif interpolation == 1:
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


@fast_inlined
def share_at(footprint, offset, size):  # type: ignore[no-untyped-def]
    """Share of a sample's light on a pixel at distance ``offset``; ``size`` is the distance of the samples."""
    interpolation, _, opening = footprint
    if interpolation == 0:
        reach = max(size, 1.0) / 2
        return 1.0 / max(size, 1.0) if -reach - 1e-9 <= offset < reach - 1e-9 else 0.0
    upper = _cumulative(interpolation, (offset + opening / 2) / size)
    return (upper - _cumulative(interpolation, (offset - opening / 2) / size)) / opening


@fast_inlined
def farthest(footprint, size):  # type: ignore[no-untyped-def]
    """Largest distance from a pixel, in pixels, at which a sample contributes to it."""
    return 1e-6 + (max(size, 1.0) / 2 if footprint.interpolation == 0 else footprint.reach * size + 0.5)


@fast_inlined
def around(middle, reach, count):  # type: ignore[no-untyped-def]
    """(first, after the last) of the numbers 0 … count − 1 that are at most ``reach`` from a place."""
    return max(np.int64(math.ceil(middle - reach)), 0), min(np.int64(math.floor(middle + reach)) + 1, count)


@fast_inlined
def place_on_mask(place, step, mask, k, l):  # type: ignore[no-untyped-def]
    """(row, column) on a mask of sample (k, l). place: `View.masks`. step: `Textures.step`."""
    column = place[mask, 0] + step[mask, 0, 0] * k + step[mask, 0, 1] * l
    return place[mask, 1] + step[mask, 1, 0] * k + step[mask, 1, 1] * l, column


@fast_loop
def weigh_samples(view, grid, masks, band):  # type: ignore[no-untyped-def]
    """Multiply a band of rows of a view's samples by the masks, in place, if rows and columns are sheared.

    view: `View`. grid: `Grid`. masks: `Textures`.
    """
    textures, size, mask_step = masks
    samples, place = view.samples, view.masks
    for m in range(band.start, band.stop):
        l = grid.first_l + m / grid.refine
        for n in range(samples.shape[1]):
            k = grid.first_k + n / grid.refine
            weight = np.float32(1)
            for mask in range(place.shape[0]):
                row, column = place_on_mask(place, mask_step, mask, k, l)
                weight *= dark_outside(textures[mask, : size[mask, 0], : size[mask, 1]], row, column)
            for c in range(samples.shape[2]):
                samples[m, n, c] *= weight


@fast_loop
def sheared_view(view, grid, footprint, band, raster):  # type: ignore[no-untyped-def]
    """Add one view to a band's raster rows, (rows, columns, channels), if rows and columns of samples are sheared.

    view: `View`. grid: `Grid`. footprint: `Footprint`.
    """
    samples, weight, x0, y0, _ = view
    step, shear, coarse_row_step, coarse_column_step, refine, first_k, first_l = grid
    nt, ns, channels = samples.shape
    row_step, column_step = coarse_row_step / refine, coarse_column_step / refine
    height, width = abs(row_step), abs(column_step)
    reach_y, reach_x = farthest(footprint, height), farthest(footprint, width)
    line = np.empty((ns, channels))
    for y in range(band.start, band.stop):
        line[:] = 0
        lit = False
        for n in range(ns):
            k = first_k + n / refine
            y_start = y0 + step[1, 0] * k + coarse_row_step * first_l
            middle = (y - y_start) / row_step
            low, high = around(middle, reach_y / height, nt)
            for m in range(low, high):
                share = weight * share_at(footprint, y - y_start - row_step * m, height)
                if share != 0:
                    lit = True
                    for c in range(channels):
                        line[n, c] += share * samples[m, n, c]
        if not lit:
            continue
        for n in range(ns):
            x = x0 + shear * (y - y0) + coarse_column_step * (first_k + n / refine)
            low, high = around(x, reach_x, raster.shape[1])
            for pixel in range(low, high):
                share = share_at(footprint, pixel - x, width)
                for c in range(channels):
                    raster[y, pixel, c] += share * line[n, c]
