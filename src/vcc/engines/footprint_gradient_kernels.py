"""Compiled loops from the weights of a raster to gradients of footprints: places, steps, weights, masks.

They process a column of view taps and a span of columns of samples at a time. The raster's weights are first
mixed into the columns of the samples. Then each row of samples is read once, while the few rows of weights on
which it falls and the lines of masks around it are in the first-level cache. Sums along a row are in single
precision, all others in double, always in the same order.
"""

from __future__ import annotations

import numpy as np

from vcc.engines.compiled import fast_inlined, fast_loop
from vcc.engines.footprint_tables import EntryMasks
from vcc.engines.interpolation import slopes_around
from vcc.engines.numba_kernels import around, columns_around, divide, farthest, masks_at, place_on_mask, share_at
from vcc.engines.vector_rows import (
    first_four_rows,
    four_dots,
    last_four_rows,
    last_four_rows_of_threes,
    more_four_rows,
    only_four_rows,
    only_four_rows_of_threes,
    to_three_rows,
    weigh_ones,
    weigh_threes,
)
from vcc.engines.vector_sums import EIGHT, fetch, mix_eight

DIVIDED = 32
"""Rows of finer samples that are made at a time."""
AHEAD = 2
"""Rows of samples between the row being read and the row being prefetched."""


@fast_loop
def mix(tiles, gathered, span, channels, mixed):  # type: ignore[no-untyped-def]
    """mixed[s, y, (k − start) · channels + c] = Σ share · raster[y, x · channels + c] over x that sample k
    reaches.

    tiles: the raster, from `footprint_columns.in_tiles`. gathered: `Gathered`. span: `Span`. mixed: (kinds, rows,
    values); a multiple of eight rows, and more. It is zero in columns of samples that an earlier span has or that
    do not exist, and in the further rows.
    """
    first, shares = gathered
    step = np.int64(EIGHT * channels)
    eight = np.empty(EIGHT, np.float32)
    stop = min(span.stop, first.size)
    mixed[:, :, : (span.fresh - span.start) * channels] = 0
    mixed[:, :, (stop - span.start) * channels :] = 0
    mixed[:, EIGHT * len(tiles) :] = 0
    for kind in range(len(shares)):
        for tile in range(len(tiles)):
            line = tiles[tile].reshape(-1)
            out = mixed[kind, EIGHT * tile : EIGHT * (tile + 1)]
            for k in range(span.fresh, stop):
                for c in range(channels):
                    eight[:] = 0
                    mix_eight(line, step * first[k] + EIGHT * c, step, shares[kind], k, eight, 0)
                    for y in range(EIGHT):
                        out[y, (k - span.start) * channels + c] = eight[y]


@fast_loop
def add_gradients(samples, a, used, fine, tables, masks, sought, channels, span, totals):  # type: ignore[no-untyped-def]
    """Add the gradients from the samples in a span of columns, for a column of view taps.

    Args:
        samples: `Samples`.
        a: the column of view taps.
        used: the taps in it to process.
        fine: `FineSamples`, or None.
        tables: the raster from `mix`, `Reached`, `Pairs`, and the weight of each tap in gradients of lines of
        masks.
        masks: `MaskLines` of any number of masks, a value for each column of samples.
        sought: `Sought`.
        channels: values per sample.
        span: `Span`.
        totals: (taps, sums) the sums over the samples of each tap.
    """
    mixed, reached, pairs, weights = tables
    values = (span.stop - span.start) * channels
    divided = np.zeros((DIVIDED if fine is not None else 0, values), np.float32)
    # All taps that fall on some rows of the raster come before the next rows: the weights stay in the cache.
    for part in range(reached.parts.shape[0]):
        for b in used:
            first, last = reached.parts[part, b, 0], reached.parts[part, b, 1]
            begin = samples.begin[b] + samples.further[a]
            if fine is None:
                begin += span.start * channels
                add_rows(samples.values, begin, samples.pitch, b, first, last, mixed, reached, pairs,
                         weights[b], masks, sought, channels, span, totals)  # fmt: skip
            else:
                for low in range(first, last, DIVIDED):
                    high = min(low + DIVIDED, last)
                    divide(samples, begin, fine, low, high, divided)
                    add_rows(divided.reshape(-1), -low * values, values, b, low, high, mixed, reached, pairs,
                             weights[b], masks, sought, channels, span, totals)  # fmt: skip


@fast_loop
def add_rows(  # type: ignore[no-untyped-def]
    values, start, pitch, b, low, high, mixed, reached, pairs, weight, masks, sought, channels, span, totals
):
    """As `add_gradients`, for rows low ≤ l < high of tap b; ``start`` is the position of row 0."""
    n = span.stop - span.start
    wide = n * channels
    looks, sums = sought.texture.any() or sought.place.any(), pairs.row.size
    # Flat arrays and offsets instead of tuples: references to parts of tuples would be counted in every row, by
    # all threads at once.
    firsts, shares, plain, index = reached.first, reached.shares, reached.plain.reshape(-1), reached.indices
    row_kind, column_kind, total_of = pairs.row, pairs.column, pairs.total
    counts, index_k = reached.counts, span.indices
    texture, place, places = sought.texture, sought.place, sought.places
    lines, to_lines, slopes = masks.lines.reshape(-1), sought.lines.reshape(-1), sought.slopes.reshape(-1)
    planes, plane = mixed.reshape(-1), mixed.shape[1] * wide
    count, width = masks.row_step.size, shares.shape[3]
    met = EntryMasks(masks.lines, np.empty((1, count, 3), np.int64), np.empty((1, count, 3), np.float32))
    line, share = met.places, met.shares
    mask_row, mask_row_step = masks.row, masks.row_step
    product, seen, rest, lit = (
        np.empty(wide, np.float32),
        np.empty(wide, np.float32),
        np.empty(n, np.float32),
        np.ones(n, np.float32),
    )
    through, dots = np.empty(max(count, 1) * n, np.float32), np.empty(width, np.float32)
    per_line = 64 // values.itemsize
    for l in range(low, high):
        at = start + l * pitch
        for x in range(at + AHEAD * pitch, at + AHEAD * pitch + wide, per_line):
            fetch(values, x)
        rows = counts[b, l]
        if rows == 0 or not masks_at(masks, b, l, 0, met):
            continue
        y = firsts[b, l] * wide
        if count > 1 or sums > 0:
            for mask in range(count):
                _through(lines, line, share, mask, span.start, n, through)
        if looks:
            _seen(planes, y, wide, plain, (b * firsts.shape[1] + l) * width, rows, values, at, channels, seen)
            for mask in range(count):
                if texture[mask] or place[mask]:
                    _without(seen, through, mask, count, n, rest)
                    if texture[mask]:
                        _to_lines(rest, weight, line, share, mask, span.to, n, to_lines)
                    if place[mask]:
                        steep = _steep(mask_row[mask, b] + mask_row_step[mask] * l, share, mask)
                        _to_places(rest, lines, slopes, line, share, steep, b, mask, span.start, n, index_k,
                                   index[l], places)  # fmt: skip
        if sums > 0:
            _lit(through, count, n, lit)
            _weighed(values, at, lit, channels, n, product)
            column = -1
            for pair in range(sums):
                if column_kind[pair] != column:
                    column = column_kind[pair]
                    for t in range(0, rows, 4):
                        dots[t], dots[t + 1], dots[t + 2], dots[t + 3] = four_dots(
                            product, planes, column * plane + y + t * wide, wide, wide
                        )
                total = 0.0
                for t in range(rows):
                    total += shares[b, l, row_kind[pair], t] * dots[t]
                totals[b, total_of[pair]] += total


@fast_inlined
def _through(lines, line, share, mask, start, n, out):  # type: ignore[no-untyped-def]
    """out[mask · n + k]: the weights of a mask along a row of samples."""
    first, second, third = _places(line, mask, start)
    above, level, below = share[0, mask, 0], share[0, mask, 1], share[0, mask, 2]
    to = np.uint64(mask * n)
    for k in range(np.uint64(n)):
        out[to + k] = above * lines[first + k] + level * lines[second + k] + below * lines[third + k]


@fast_inlined
def _places(line, mask, start):  # type: ignore[no-untyped-def]
    """Where a span begins in three lines of a mask."""
    return (
        np.uint64(line[0, mask, 0] + start),
        np.uint64(line[0, mask, 1] + start),
        np.uint64(line[0, mask, 2] + start),
    )


@fast_inlined
def _steep(place, share, mask):  # type: ignore[no-untyped-def]
    """Derivatives of the weights of three lines of a mask to the place in the mask."""
    zero = np.float32(0)
    first, second, third = slopes_around(place)
    return (
        first if share[0, mask, 0] != 0 else zero,
        second if share[0, mask, 1] != 0 else zero,
        third if share[0, mask, 2] != 0 else zero,
    )


@fast_inlined
def _seen(planes, y, wide, plain, first, rows, values, at, channels, out):  # type: ignore[no-untyped-def]
    """out[k] = Σ values[at + x] · Σ plain[first + t] · planes[y + t · wide + x] over the channels x of sample k.

    Rows are processed in fours. out: with space for all channels.
    """
    for t in range(0, rows, 4):
        four = plain[first + t], plain[first + t + 1], plain[first + t + 2], plain[first + t + 3]
        place = y + t * wide
        if t + 4 < rows:
            if t == 0:
                first_four_rows(planes, place, wide, four, values, at, wide, out)
            else:
                more_four_rows(planes, place, wide, four, values, at, wide, out)
        elif channels == 3:
            if t == 0:
                only_four_rows_of_threes(planes, place, wide, four, values, at, wide, out)
            else:
                last_four_rows_of_threes(planes, place, wide, four, values, at, wide, out)
        elif t == 0:
            only_four_rows(planes, place, wide, four, values, at, wide, out)
        else:
            last_four_rows(planes, place, wide, four, values, at, wide, out)
    if channels != 1 and channels != 3:
        for k in range(wide // channels):
            total = np.float32(0)
            for c in range(channels):
                total += out[k * channels + c]
            out[k] = total


@fast_inlined
def _without(seen, through, mask, count, n, out):  # type: ignore[no-untyped-def]
    """out[k] = seen[k] times the weights of all masks but one."""
    for k in range(np.uint64(n)):
        out[k] = seen[k]
    for other in range(count):
        if other != mask:
            at = np.uint64(other * n)
            for k in range(np.uint64(n)):
                out[k] *= through[at + k]


@fast_inlined
def _lit(through, count, n, out):  # type: ignore[no-untyped-def]
    """out[k]: the product of the weights of all masks; unchanged if there are none."""
    for mask in range(count):
        at = np.uint64(mask * n)
        if mask == 0:
            for k in range(np.uint64(n)):
                out[k] = through[k]
        else:
            for k in range(np.uint64(n)):
                out[k] *= through[at + k]


@fast_inlined
def _weighed(values, at, lit, channels, n, out):  # type: ignore[no-untyped-def]
    """out[k · channels + c] = a sample's value times the weights of all masks."""
    if channels == 1:
        weigh_ones(values, at, lit, n, out)
    elif channels == 3:
        weigh_threes(values, at, lit, n, out)
    else:
        for k in range(n):
            for c in range(channels):
                out[k * channels + c] = lit[k] * np.float32(values[at + k * channels + c])


@fast_inlined
def _to_lines(seen, weight, line, share, mask, start, n, lines):  # type: ignore[no-untyped-def]
    """Add the gradients of a row of samples to the three lines of a mask around it."""
    parts = (
        np.float32(weight * share[0, mask, 0]),
        np.float32(weight * share[0, mask, 1]),
        np.float32(weight * share[0, mask, 2]),
    )
    first, second, third = _places(line, mask, start)
    to_three_rows(seen, parts, (np.int64(first), np.int64(second), np.int64(third)), n, lines)


@fast_inlined
def _to_places(  # type: ignore[no-untyped-def]
    seen, lines, slopes, line, share, steep, b, mask, first_k, n, indices, row, places
):
    """Add the gradients of a row of samples to its place on a mask to the six sums of `Sought`."""
    first, second, third = _places(line, mask, first_k)
    at_first, at_second, at_third = share[0, mask, 0], share[0, mask, 1], share[0, mask, 2]
    to_first, to_second, to_third = steep
    start = np.uint64(first_k)
    across, across_k, down, down_k = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
    for k in range(np.uint64(n)):
        light, index = seen[k], indices[start + k]
        slanted = at_first * slopes[first + k] + at_second * slopes[second + k] + at_third * slopes[third + k]
        sloped = to_first * lines[first + k] + to_second * lines[second + k] + to_third * lines[third + k]
        across += light * slanted
        across_k += light * slanted * index
        down += light * sloped
        down_k += light * sloped * index
    places[b, mask, 0] += across
    places[b, mask, 1] += across_k
    places[b, mask, 2] += np.float64(across) * row
    places[b, mask, 3] += down
    places[b, mask, 4] += down_k
    places[b, mask, 5] += np.float64(down) * row


@fast_loop
def slopes_at_columns(texture, column, out):  # type: ignore[no-untyped-def]
    """out[r, k]: slope of texture[r] at column[k], as interpolated by `numba_kernels.sample_mask_columns`."""
    points, counts = columns_around(column, texture.shape[1])
    left, here, right = points[0], points[1], points[2]
    for k in range(column.size):
        for n, slope in enumerate(slopes_around(column[k])):
            counts[n, k] = slope if counts[n, k] != 0 else 0
    before, at, after = counts[0], counts[1], counts[2]
    for r in range(len(texture)):
        line, to = texture[r], out[r]
        for k in range(column.size):
            to[k] = before[k] * line[left[k]] + at[k] * line[here[k]] + after[k] * line[right[k]]


@fast_loop
def give_back_columns(lines, column, texture):  # type: ignore[no-untyped-def]
    """The transpose of `numba_kernels.sample_mask_columns`, added to a texture, float64."""
    points, counts = columns_around(column, texture.shape[1])
    left, here, right = points[0], points[1], points[2]
    before, at, after = counts[0], counts[1], counts[2]
    for r in range(len(lines)):
        line, to = lines[r], texture[r]
        for k in range(column.size):
            value = line[k]
            to[left[k]] += before[k] * value
            to[here[k]] += at[k] * value
            to[right[k]] += after[k] * value


# --- sheared rows and columns ---

SHEARED = 10
"""Number of sums per tap: see `add_sheared`."""


@fast_loop
def _height(interpolation, a):  # type: ignore[no-untyped-def]
    """φ of `vcc.plan.footprints.shares`; interpolation 1 is linear, 2 cubic, 3 spline, 4 box."""
    r = abs(a)
    if interpolation == 4:
        return 1.0 if -0.5 <= a < 0.5 else 0.0
    if interpolation == 1:
        return max(1 - r, 0.0)
    if interpolation == 3:
        return 2.0 / 3.0 - r * r + r**3 / 2 if r < 1 else max(2 - r, 0.0) ** 3 / 6
    if r < 1:
        return (1.5 * r - 2.5) * r * r + 1
    return ((-0.5 * r + 2.5) * r - 4) * r + 2 if r < 2 else 0.0


@fast_loop
def _slopes(footprint, offset, size):  # type: ignore[no-untyped-def]
    """A share, and its derivatives to the sample's place, the size and the opening (`shares.share_slopes`)."""
    interpolation, _, opening = footprint
    share = share_at(footprint, offset, size)
    if interpolation == 0:
        return share, 0.0, 0.0, 0.0
    a, c = (offset + opening / 2) / size, (offset - opening / 2) / size
    upper, lower = _height(interpolation, a), _height(interpolation, c)
    across = opening * size
    return (
        share,
        (lower - upper) / across,
        (c * lower - a * upper) / across,
        (upper + lower) / (2 * across) - share / opening,
    )


@fast_loop
def add_sheared(view, grid, footprint, masks, raster, band, sums, places, gradient):  # type: ignore[no-untyped-def]
    """Add the gradients of one view from a band of raster rows, if rows and columns of samples are sheared.

    Let f = ΠT·F_y·L, and let the weights G be mixed by F_x or one of its derivatives. Sums of f·G: with the
    share along x; with its derivative to x, alone, times k, times the rows from the view's place; with its
    derivative to the size. Sums with the share along x: with the derivative of F_y to y, alone, times k, times
    l; with the derivative to the size. One sum with the derivatives of both to the opening.

    Args:
        view: `View`.
        grid: `Grid`.
        footprint: `Footprint`.
        masks: `Textures`.
        raster: weights (rows, columns, channels).
        band: `Band`.
        sums: (SHEARED,) sums to add to.
        places: (masks, 6), see `Sought`.
        gradient: of the textures, shaped like them.
    """
    samples, weight, x0, y0, place = view
    textures, size, mask_step = masks
    step, shear, coarse_row_step, coarse_column_step, refine, first_k, first_l = grid
    nt, ns, channels = samples.shape
    row_step, column_step = coarse_row_step / refine, coarse_column_step / refine
    height, width = abs(row_step), abs(column_step)
    reach_y, reach_x = farthest(footprint, height), farthest(footprint, width)
    count = len(place)
    mixed = np.empty((4, channels))
    values, along, down = np.empty(count), np.empty(count), np.empty(count)
    for y in range(band.start, band.stop):
        for n in range(ns):
            k = first_k + n / refine
            y_start = y0 + step[1, 0] * k + coarse_row_step * first_l
            middle = (y - y_start) / row_step
            first, stop = around(middle, reach_y / height, nt)
            x = x0 + shear * (y - y0) + coarse_column_step * k
            left, right = around(x, reach_x, raster.shape[1])
            if first >= stop or left >= right:
                continue
            mixed[:] = 0
            for pixel in range(left, right):
                share, to_x, to_width, to_opening_x = _slopes(footprint, pixel - x, width)
                for c in range(channels):
                    weigh = raster[y, pixel, c]
                    mixed[0, c] += share * weigh
                    mixed[1, c] += to_x * weigh
                    mixed[2, c] += to_width * weigh
                    mixed[3, c] += to_opening_x * weigh
            for m in range(first, stop):
                l = first_l + m / refine
                share, to_y, to_height, to_opening = _slopes(footprint, y - y_start - row_step * m, height)
                light = 1.0
                for mask in range(count):
                    row, column = place_on_mask(place, mask_step, mask, k, l)
                    values[mask], along[mask], down[mask] = _looked_up(
                        textures, mask, size[mask, 0], size[mask, 1], row, column
                    )
                    light *= values[mask]
                seen, to_x, to_width, to_opening_x = 0.0, 0.0, 0.0, 0.0
                for c in range(channels):
                    sample = samples[m, n, c]
                    seen += sample * mixed[0, c]
                    to_x += sample * mixed[1, c]
                    to_width += sample * mixed[2, c]
                    to_opening_x += sample * mixed[3, c]
                sums[0] += light * share * seen
                sums[1] += light * share * to_x
                sums[2] += light * share * to_x * k
                sums[3] += light * share * to_x * (y - y0)
                sums[4] += light * share * to_width
                sums[5] += light * to_y * seen
                sums[6] += light * to_y * seen * k
                sums[7] += light * to_y * seen * l
                sums[8] += light * to_height * seen
                sums[9] += light * (to_opening * seen + share * to_opening_x)
                for mask in range(count):
                    rest = share * seen
                    for other in range(count):
                        if other != mask:
                            rest *= values[other]
                    places[mask, 0] += rest * along[mask]
                    places[mask, 1] += rest * along[mask] * k
                    places[mask, 2] += rest * along[mask] * l
                    places[mask, 3] += rest * down[mask]
                    places[mask, 4] += rest * down[mask] * k
                    places[mask, 5] += rest * down[mask] * l
                    if gradient.size > 0 and rest != 0:
                        row, column = place_on_mask(place, mask_step, mask, k, l)
                        _given_back(gradient, mask, size[mask, 0], size[mask, 1], row, column, weight * rest)


@fast_loop
def _three(place):  # type: ignore[no-untyped-def]
    """As `three_around`, with the derivatives of the weights to the place, in double precision."""
    middle = int(np.floor(place + 0.5))
    off = place - middle
    shares = 0.5 * (0.5 - off) ** 2, 0.75 - off * off, 0.5 * (0.5 + off) ** 2
    return middle, shares, (off - 0.5, -2 * off, off + 0.5)


@fast_inlined
def _looked_up(textures, mask, rows, columns, row, column):  # type: ignore[no-untyped-def]
    """A mask's value at a place, and its slopes along columns and along rows; zero around the mask."""
    value, along, down = 0.0, 0.0, 0.0
    if -1.5 < row < rows + 0.5 and -1.5 < column < columns + 0.5:
        r, by_row, row_slopes = _three(row)
        c, by_column, column_slopes = _three(column)
        for m in range(3):
            for n in range(3):
                if 0 <= r + m - 1 < rows and 0 <= c + n - 1 < columns:
                    point = textures[mask, r + m - 1, c + n - 1]
                    value += by_row[m] * by_column[n] * point
                    along += by_row[m] * column_slopes[n] * point
                    down += row_slopes[m] * by_column[n] * point
    return value, along, down


@fast_inlined
def _given_back(gradient, mask, rows, columns, row, column, light):  # type: ignore[no-untyped-def]
    """Add light to the points of a texture around a place; the transpose of `_looked_up`."""
    if -1.5 < row < rows + 0.5 and -1.5 < column < columns + 0.5:
        r, by_row, _ = _three(row)
        c, by_column, _ = _three(column)
        for m in range(3):
            for n in range(3):
                if 0 <= r + m - 1 < rows and 0 <= c + n - 1 < columns:
                    gradient[mask, r + m - 1, c + n - 1] += by_row[m] * by_column[n] * light
