"""Compiled loops of the fast engine for several masks on one light field: samples are read once for all masks.

The sum of a pixel is split into parts that each mask weighs differently: one part per view if weights of views
differ, or one part per line of a texture. The parts are summed first, without the masks, as `numba_kernels` sums
rows. Then each mask weighs them, and its row of sums is mixed across.
"""

from __future__ import annotations

import numpy as np

from vcc.engines.compiled import fast_inlined, fast_loop
from vcc.engines.footprint_tables import Entries, EntryMasks
from vcc.engines.interpolation import three_around
from vcc.engines.numba_kernels import masks_at, mix_columns, rows_of, sort_by_range
from vcc.engines.vector_sums import (
    EIGHT,
    LANES,
    ROWS,
    part_masked_whole_rows,
    part_whole_rows,
    sum_masked_whole_rows,
    sum_masked_whole_rows_of_threes,
    sum_whole_rows,
)
from vcc.engines.vector_weights import MASKS, weigh_parted_rows, weigh_rows

SPAN = 576
"""Approximate number of values of rows of samples to sum at a time: with lines of masks they stay in the cache."""


@fast_loop
def add_column_of_views(samples, a, footprints, weights, masks, band, tiles):  # type: ignore[no-untyped-def]
    """Add column a of view taps to a band of several rasters, each with its own weights of taps.

    samples: `Samples`. footprints: `Footprints`; their weights are 0 for taps that no raster uses. weights:
    (rasters, padded with zeros to a multiple of four; rows of taps) float32. masks: `MaskLines`, or None. tiles:
    (rasters, rows / 8, columns · channels, 8).
    """
    looked_at, rows, (first_column, column_shares) = footprints
    values, begin, further, pitch, channels = samples
    used = np.flatnonzero(looked_at[:, a])
    count = used.size
    # Eight rows of sums for each view, one view after the other; and each raster's weights of them, in fours.
    of_views = np.empty((count * EIGHT, min(2 * SPAN, pitch)), np.float32)
    line = of_views.shape[1]
    order, ends, places = np.arange(count), np.zeros(10, np.int64), np.empty(count, np.int64)
    ends[3:] = count
    shares = np.empty((len(weights) // ROWS, count, ROWS), np.float32)
    for n in range(len(weights)):
        for i in range(count):
            shares[n // ROWS, i, n % ROWS] = weights[n, used[i]]
    sums = np.empty((len(weights), EIGHT * pitch), np.float32)
    turned = np.zeros((pitch + column_shares.shape[2] * channels) * EIGHT, np.float32)
    flat = of_views.reshape(-1)
    for start in range(band.start, band.stop, EIGHT):
        for part in range(max(pitch // SPAN, 1)):
            low, high = _span(part, pitch)
            for i in range(count):
                place = begin[used[i]] + further[a] + low
                _sum_view(values, place, pitch, high - low, used[i], rows, masks, low, start, band.stop,
                          of_views, i * EIGHT * line)  # fmt: skip
            for y in range(EIGHT):
                for i in range(count):
                    places[i] = (i * EIGHT + y) * line
                for four in range(len(shares)):
                    entries = Entries(order, ends, places, shares[four])
                    to = (ROWS * four * EIGHT + y) * pitch + low
                    sum_whole_rows(flat, entries, None, sums, to, high - low)
        for n in range(len(tiles)):
            tile = tiles[n, start // EIGHT : start // EIGHT + 1]
            mix_columns(sums[n].reshape(EIGHT, pitch), first_column[a], column_shares[a], channels, turned, tile)


@fast_inlined
def _span(part, pitch):  # type: ignore[no-untyped-def]
    """(first, after the last) of the values of a row that are summed together; the last span is longer."""
    return part * SPAN, pitch if part + 1 >= pitch // SPAN else (part + 1) * SPAN


@fast_inlined
def _moved(weighed, entry, values):  # type: ignore[no-untyped-def]
    """Move the lookup of masks along their lines by this number of values."""
    for mask in range(weighed.places.shape[1]):
        for n in range(3):
            weighed.places[entry, mask, n] += values


@fast_loop
def _sum_view(  # type: ignore[no-untyped-def]
    values, begin, pitch, length, b, gathered, masks, low, start, stop, sums, to
):
    """Add view tap b's share of raster rows start + r, r = 0 … 7, to rows r of the sums, from row ``to`` on.

    ``length`` values of each row of samples; ``begin`` is the position of value ``low`` of row 0. gathered:
    `Rows`. masks: `MaskLines`, or None.
    """
    reach = gathered.reach
    repeat = 1
    if masks is not None:  # resolved at compile time
        repeat, count = masks.repeat, masks.row_step.size
        weighed = EntryMasks(
            masks.lines, np.empty((reach, count, 3), np.int64), np.empty((reach, count, 3), np.float32)
        )
    order, places, ranges = np.empty(reach, np.int64), np.empty(reach, np.int64), np.empty(reach, np.int64)
    share, ends = np.empty((reach, ROWS), np.float32), np.empty(10, np.int64)
    lowest, highest = np.empty(reach, np.int64), np.empty(reach, np.int64)
    entries = Entries(order, ends, places, share)
    for y in range(start, start + EIGHT, ROWS):
        listed = 0
        if y < stop:
            top, listed = rows_of(b, y, stop, np.float32(1), gathered, share, 0, lowest, highest)
            for entry in range(listed):
                places[entry] = begin + (top + entry) * pitch
                r = lowest[entry]
                ranges[entry] = -1 if r < 0 else r * ROWS - r * (r + 1) // 2 + highest[entry]
                if masks is not None:  # resolved at compile time
                    if masks_at(masks, b, top + entry, entry, weighed):
                        _moved(weighed, entry, low // repeat)
                    else:
                        ranges[entry] = -1
        sort_by_range(ranges, listed, ends, order)
        if masks is None:
            sum_whole_rows(values, entries, None, sums, to + (y - start) * sums.shape[1], length)
        elif repeat == 3:
            sum_masked_whole_rows_of_threes(
                values, entries, weighed, sums, to + (y - start) * sums.shape[1], length
            )
        else:
            sum_masked_whole_rows(values, entries, weighed, sums, to + (y - start) * sums.shape[1], length)


@fast_loop
def add_column_of_textures(samples, a, footprints, met, masks, band, tiles):  # type: ignore[no-untyped-def]
    """Add column a of view taps to a band of several rasters, which differ in the texture of a mask.

    samples: `Samples`. footprints: `Footprints`. met: `ManyLines`. masks: the other masks, `MaskLines`, or None.
    tiles: (rasters, rows / 8, columns · channels, 8).
    """
    weights, rows, (first_column, column_shares) = footprints
    values, begin, further, pitch, channels = samples
    first, shares = rows.first, rows.shares
    textures, height, line = met.lines.shape
    threes = met.repeat == 3
    room = begin.size * shares.shape[2]
    if masks is not None:  # resolved at compile time
        others = masks.row_step.size
        weighed = EntryMasks(
            masks.lines, np.empty((room, others, 3), np.int64), np.empty((room, others, 3), np.float32)
        )
    order, places, ranges = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64)
    share, ends = np.empty((room, ROWS), np.float32), np.empty(10, np.int64)
    entries = Entries(order, ends, places, share)
    line_of, three = np.empty(room, np.int64), np.empty((room, 3), np.float32)
    parts = np.empty((height + ROWS, min(2 * SPAN, pitch) + 3 * LANES), np.float32)
    sums = np.empty((textures, EIGHT * pitch), np.float32)
    flat_parts, flat_sums, flat_lines = parts.reshape(-1), sums.reshape(-1), met.lines.reshape(-1)
    part, plane = parts.shape[1], height * line
    turned = np.zeros((pitch + column_shares.shape[2] * channels) * EIGHT, np.float32)
    rows_and_spans = EIGHT * max(pitch // SPAN, 1)
    for start in range(band.start, band.stop, EIGHT):
        sums[:] = 0
        for step in range(rows_and_spans):
            y, (begins, stops) = start + step % EIGHT, _span(step // EIGHT, pitch)
            if y >= band.stop:
                continue
            length = stops - begins
            for group in range(met.ends.size - 1):
                listed, low, high = 0, height, -1
                for b in met.taps[met.ends[group] : met.ends[group + 1]]:
                    for t in range(shares.shape[2]):
                        l = first[b, y] + t
                        light = weights[b, a] * shares[b, y, t]
                        place = met.row[b] + met.row_step * l
                        if light == 0 or not (place > -1.5 and place < met.rows + 0.5):
                            continue
                        if masks is not None:
                            if not masks_at(masks, b, l, listed, weighed):
                                continue
                            _moved(weighed, listed, begins // masks.repeat)
                        r, above, level, below = three_around(place)
                        three[listed, 0] = light * above if r > 0 else 0
                        three[listed, 1] = light * level if 0 <= r < met.rows else 0
                        three[listed, 2] = light * below if r < met.rows - 1 else 0
                        places[listed] = begin[b] + further[a] + l * pitch + begins
                        line_of[listed] = met.begin[b] + r - 1
                        low = min(low, met.begin[b] + max(r - 1, 0))
                        high = max(high, met.begin[b] + min(r + 1, met.rows - 1))
                        listed += 1
                if listed == 0:
                    continue
                count = high - low + 1
                for four in range(0, count, ROWS):
                    _reach(line_of, three, listed, low + four, entries, ranges)
                    to = four * part
                    if masks is None:
                        if threes:
                            part_whole_rows(values, entries, None, parts, to, length)
                        else:
                            sum_whole_rows(values, entries, None, parts, to, length)
                    elif threes:
                        part_masked_whole_rows(values, entries, weighed, parts, to, length)
                    else:
                        sum_masked_whole_rows(values, entries, weighed, parts, to, length)
                for four in range(0, textures, MASKS):
                    at = (four * height + low) * line + begins // met.repeat
                    to = (four * EIGHT + y - start) * pitch + begins
                    if threes:
                        weigh_parted_rows(flat_parts, part, count, flat_lines, at, line, plane,
                                          flat_sums, to, EIGHT * pitch, length)  # fmt: skip
                    else:
                        weigh_rows(flat_parts, part, count, flat_lines, at, line, plane,
                                   flat_sums, to, EIGHT * pitch, length)  # fmt: skip
        for n in range(len(tiles)):
            tile = tiles[n, start // EIGHT : start // EIGHT + 1]
            mix_columns(sums[n].reshape(EIGHT, pitch), first_column[a], column_shares[a], channels, turned, tile)


@fast_inlined
def _reach(line_of, three, listed, low, entries, ranges):  # type: ignore[no-untyped-def]
    """List the rows of samples that reach any of four lines from ``low`` on, sorted by range of lines."""
    order, ends, _, share = entries
    for entry in range(listed):
        ranges[entry] = -1
        off = line_of[entry] - low
        if off <= -3 or off >= ROWS:
            continue
        top, bottom = -1, -1
        for r in range(ROWS):
            here = three[entry, r - off] if 0 <= r - off < 3 else np.float32(0)
            share[entry, r] = here
            if here != 0:
                top, bottom = r if top < 0 else top, r
        if top >= 0:
            # Ranges are numbered 00 01 02 03 11 12 13 22 23 33.
            ranges[entry] = top * ROWS - top * (top + 1) // 2 + bottom
    sort_by_range(ranges, listed, ends, order)


@fast_loop
def mix_piece(values, taken, numbers, pictures, rows, columns):  # type: ignore[no-untyped-def]
    """pictures[n, top + y, left + x] = Σ_k numbers[n, taken[k]] · values[k, y · (right − left) + x].

    values: (few, values) float32, at least one run of values, zeros behind the last. taken: (few,) int64.
    numbers: (pictures, numbers) float32. pictures: (pictures, rows, values of a row) float32. rows: (top,
    bottom). columns: (left, right), in values.
    """
    (top, bottom), (left, right) = rows, columns
    few, length = values.shape
    wide, count = right - left, len(numbers)
    order, ends, places = np.arange(few), np.zeros(10, np.int64), np.arange(few) * length
    ends[3:] = few
    share, sums = np.empty((few, ROWS), np.float32), np.empty((ROWS, length), np.float32)
    entries, flat = Entries(order, ends, places, share), values.reshape(-1)
    for four in range(0, count, ROWS):
        for r in range(ROWS):
            line = numbers[min(four + r, count - 1)]
            for k in range(few):
                share[k, r] = line[taken[k]]
        sum_whole_rows(flat, entries, None, sums, 0, length)
        for r in range(min(ROWS, count - four)):
            for y in range(bottom - top):
                to, here = pictures[four + r, top + y], sums[r, y * wide : (y + 1) * wide]
                for x in range(wide):
                    to[left + x] = here[x]
