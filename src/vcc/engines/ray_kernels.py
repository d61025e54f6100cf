"""The compiled kernel that traces packets of rays from the sensor to the light field and adds up what they find.

One kernel serves every camera: what a ray meets comes as a list of numbers (`vcc.plan.rays.steps`), read step by
step for a packet of rays at a time, so that reading the list costs nothing and the arithmetic runs on several
rays at once. A packet holds the rays of one pixel. Its stages are functions of their own, compiled once for all
kernels that trace rays and for all types of samples: inlined in each, they took three times as long to compile.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import compiled
from vcc.engines.interpolation import around, bilinear
from vcc.engines.ray_tables import Drawn, Packet
from vcc.engines.vector_gather import LANES, add_views_of_1, add_views_of_3, add_views_of_4
from vcc.plan.rays.points import DIGITS

PACKET = 256
"""Rays at a time: six numbers each, which stay in the first-level cache."""

DIGITS_ABOVE, DIGITS_BELOW = np.float32(2.0**DIGITS), 2.0**-DIGITS
"""What takes a point to its digits as a whole number, and back."""

_compiled = compiled(borrowing=True, fastmath={"contract", "nsz"})
_inlined = compiled(borrowing=True, fastmath={"contract", "nsz"}, inline="always")
_inner = compiled(borrowing=True, no_cpython_wrapper=True, fastmath={"contract", "nsz"})
"""Of what compiled code alone calls: no way for Python to call it is compiled."""
_allocating = compiled(fastmath={"contract", "nsz"})


@_inner
def cell_of(layout, turn, x, y):  # type: ignore[no-untyped-def]
    """(row, column, centre x, centre y) of the cell that holds a place; turn as `steps._lattice_numbers`."""
    cosine, sine, offset_x, offset_y, pitch, height = turn[0], turn[1], turn[2], turn[3], turn[4], turn[5]
    dx, dy = x - offset_x, y - offset_y
    across = (cosine * dx + sine * dy) * (1 / pitch)
    down = (cosine * dy - sine * dx) * (1 / height)
    if layout == 0:
        row, column = math.floor(down + 0.5), math.floor(across + 0.5)
        shifted = column
    else:
        even_row, even_column = 2 * math.floor(down / 2 + 0.5), math.floor(across + 0.5)
        odd_row, odd_column = 2 * math.floor(down / 2) + 1, math.floor(across)
        to_even = (across - even_column) ** 2 + 0.75 * (down - even_row) ** 2
        to_odd = (across - odd_column - 0.5) ** 2 + 0.75 * (down - odd_row) ** 2
        if to_even <= to_odd:
            row, column = even_row, even_column
            shifted = column
        else:
            row, column = odd_row, odd_column
            shifted = column + 0.5
    shifted, down = shifted * pitch, row * height
    return (
        np.int64(row),
        np.int64(column),
        cosine * shifted - sine * down + offset_x,
        sine * shifted + cosine * down + offset_y,
    )


@_inner
def centre_of(layout, turn, row, column):  # type: ignore[no-untyped-def]
    """(x, y) of the centre of a cell."""
    shifted = column * turn[4]
    if layout == 1 and row & 1:
        shifted += 0.5 * turn[4]
    down = row * turn[5]
    return turn[0] * shifted - turn[1] * down + turn[2], turn[1] * shifted + turn[0] * down + turn[3]


@_inner
def corner(x, y, rows, columns, real):  # type: ignore[no-untyped-def]
    """(columns, row, next row, column, next column, way down, way to the right) of a place on a texture."""
    c, c1, right = around((x - real[0]) * real[2], columns)
    r, r1, down = around((y - real[1]) * real[3], rows)
    return columns, r, r1, c, c1, down, right


@_inner
def mixed(table, start, width, number, at):  # type: ignore[no-untyped-def]
    """One of ``width`` numbers of the texture that begins at ``start``, at a place that `corner` found."""
    columns, r, r1, c, c1, down, right = at
    above, below, start = r * columns, r1 * columns, start + number
    return bilinear(
        table[start + (above + c) * width],
        table[start + (above + c1) * width],
        table[start + (below + c) * width],
        table[start + (below + c1) * width],
        right,
        down,
    )


@_inlined
def part_affinely(f, n, x, y, s, t):  # type: ignore[no-untyped-def]
    """Step 0: an affine map along x, and one along y."""
    f0, f1, f2, f3, f4, f5 = f[0], f[1], f[2], f[3], f[4], f[5]
    for p in range(n):
        xp, sp = x[p], s[p]
        x[p] = f0 * xp + f1 * sp + f2
        s[p] = f3 * xp + f4 * sp + f5
    f0, f1, f2, f3, f4, f5 = f[6], f[7], f[8], f[9], f[10], f[11]
    for p in range(n):
        yp, tp = y[p], t[p]
        y[p] = f0 * yp + f1 * tp + f2
        t[p] = f3 * yp + f4 * tp + f5


@_inlined
def within_disc(f, n, x, y, share):  # type: ignore[no-untyped-def]
    """Step 6: dark outside a disc."""
    f0, f1, f2 = f[0], f[1], f[2]
    for p in range(n):
        dx, dy = x[p] - f0, y[p] - f1
        share[p] = share[p] if dx * dx + dy * dy <= f2 else 0.0


@_inlined
def within_rectangle(f, n, x, y, share):  # type: ignore[no-untyped-def]
    """Step 7: dark outside a rectangle."""
    f0, f1, f2, f3 = f[0], f[1], f[2], f[3]
    for p in range(n):
        share[p] = share[p] if (abs(x[p] - f0) <= f2) & (abs(y[p] - f1) <= f3) else 0.0


FEW = frozenset({0, 6, 7})
"""Codes of the steps of a plain lens: affine along x and y apart, a round rim, a rectangular one."""


@_inner
def take_few_steps(steps, drawn, rays):  # type: ignore[no-untyped-def]
    """As `take_steps`, where all steps are among `FEW`, which take a tenth of the time to compile."""
    codes, _, real, _, _ = steps
    n = drawn.rays
    x, y, s, t, share = rays
    for step in range(len(codes)):
        code, f = codes[step], real[step]
        if code == 0:
            part_affinely(f, n, x, y, s, t)
        elif code == 6:
            within_disc(f, n, x, y, share)
        else:
            within_rectangle(f, n, x, y, share)


@_inner
def take_steps(steps, drawn, rays):  # type: ignore[no-untyped-def]
    """Take a packet of rays through all steps.

    Numbers of a step are read before its loop, so that loops without branches run on several rays at once.
    """
    codes, whole, real, shares, slopes = steps
    points, first, n, _ = drawn
    x, y, s, t, share = rays
    for step in range(len(codes)):
        code, a, f = codes[step], whole[step], real[step]
        if code == 0:
            part_affinely(f, n, x, y, s, t)
        elif code == 1:
            for p in range(n):
                xp, yp, sp, tp = x[p], y[p], s[p], t[p]
                x[p] = f[0] * xp + f[1] * yp + f[2] * sp + f[3] * tp + f[4]
                y[p] = f[5] * xp + f[6] * yp + f[7] * sp + f[8] * tp + f[9]
                s[p] = f[10] * xp + f[11] * yp + f[12] * sp + f[13] * tp + f[14]
                t[p] = f[15] * xp + f[16] * yp + f[17] * sp + f[18] * tp + f[19]
        elif code == 2 and a[0] == 0 and a[1] * a[2] == 1:
            # The usual array, square and all alike: no branches.
            power, slope_x, slope_y = slopes[a[3]], slopes[a[3] + 1], slopes[a[3] + 2]
            cosine, sine, offset_x, offset_y, pitch = f[0], f[1], f[2], f[3], f[4]
            per_pitch = 1 / pitch
            for p in range(n):
                dx, dy = x[p] - offset_x, y[p] - offset_y
                across, down = (cosine * dx + sine * dy) * per_pitch, (cosine * dy - sine * dx) * per_pitch
                across, down = math.floor(across + 0.5) * pitch, math.floor(down + 0.5) * pitch
                s[p] += power * (dx - (cosine * across - sine * down)) - slope_x
                t[p] += power * (dy - (sine * across + cosine * down)) - slope_y
        elif code == 2:
            for p in range(n):
                row, column, centre_x, centre_y = cell_of(a[0], f, x[p], y[p])
                at = a[3] + ((row % a[1]) * a[2] + column % a[2]) * 3
                s[p] += slopes[at] * (x[p] - centre_x) - slopes[at + 1]
                t[p] += slopes[at] * (y[p] - centre_y) - slopes[at + 2]
        elif code == 3:
            for p in range(n):
                _, _, centre_x, centre_y = cell_of(a[0], f, x[p], y[p])
                dx, dy = x[p] - centre_x, y[p] - centre_y
                across, down = abs(f[0] * dx + f[1] * dy), abs(f[0] * dy - f[1] * dx)
                if a[1] == 1:
                    inside = across * across + down * down <= f[6] * f[6]
                elif a[0] == 0:
                    inside = max(across, down) <= f[6]
                else:
                    inside = max(across, across / 2 + 0.5 * math.sqrt(3.0) * down) <= f[6]
                share[p] *= inside
        elif code == 11:
            for p in range(n):
                row, column, _, _ = cell_of(a[0], f, x[p], y[p])
                share[p] *= (row >= 0) & (row < a[1]) & (column >= 0) & (column < a[2])
        elif code == 4:
            for p in range(n):
                dx, dy = x[p] - f[0], y[p] - f[1]
                best, at = -np.inf, a[1]
                for facet in range(a[0]):
                    outward = dx * slopes[a[1] + 4 * facet] + dy * slopes[a[1] + 4 * facet + 1]
                    if outward > best:
                        best, at = outward, a[1] + 4 * facet
                s[p] -= slopes[at + 2]
                t[p] -= slopes[at + 3]
        elif code == 5:
            for p in range(n):
                at = corner(x[p], y[p], a[0], a[1], f)
                s[p] -= mixed(slopes, a[2], 2, 0, at)
                t[p] -= mixed(slopes, a[2], 2, 1, at)
        elif code == 6:
            within_disc(f, n, x, y, share)
        elif code == 7:
            within_rectangle(f, n, x, y, share)
        elif code == 8:
            for p in range(n):
                column, row = math.floor((x[p] - f[0]) * f[2]), math.floor((y[p] - f[1]) * f[3])
                inside = (column >= 0) & (column < a[1]) & (row >= 0) & (row < a[0])
                c, r = int(min(max(column, 0), a[1] - 1)), int(min(max(row, 0), a[0] - 1))
                share[p] *= shares[a[2] + r * a[1] + c] * inside
        elif code == 9:
            for p in range(n):
                at = corner(x[p], y[p], a[0], a[1], f)
                share[p] *= mixed(shares, a[2], 1, 0, at)
        elif code == 12:
            for p in range(n):
                for axis in range(2):
                    if f[2 + axis] > 0:
                        place = x[p] if axis == 0 else y[p]
                        first_cosine = math.cos(f[2 + axis] * (place - f[axis]) + f[4])
                        # cos((n + 1)θ) = 2·cos(θ)·cos(nθ) − cos((n − 1)θ)
                        before, now, total = 1.0, first_cosine, first_cosine
                        for _ in range(a[0] - 1):
                            before, now = now, 2 * first_cosine * now - before
                            total += now
                        share[p] *= 0.5 + total / (2 * a[0])
        else:
            for p in range(n):
                kernel = 0
                if a[3] > 0:
                    at = corner(x[p], y[p], a[3], a[4], f)
                    picked = points[a[2], first + p]
                    while kernel < a[1] - 1 and picked >= mixed(shares, a[5], a[1], kernel, at):
                        kernel += 1
                stretch = 1.0
                if a[6] > 0:
                    at = corner(x[p], y[p], a[6], a[7], f[4:])
                    stretch = mixed(shares, a[8], 1, 0, at)
                s[p] -= stretch * points[a[0] + 2 * kernel, first + p]
                t[p] -= stretch * points[a[0] + 2 * kernel + 1, first + p]


@_inner
def add_view(samples, base, k, l, weight, found):  # type: ignore[no-untyped-def]
    """Add a view's value at pixel (k, l), interpolated linearly and dark outside, times a weight.

    ``base`` is where the view's samples begin.
    """
    values, (_, _, rows, columns), channels = samples
    k0, l0 = math.floor(k), math.floor(l)
    fk, fl = np.float32(k - k0), np.float32(l - l0)
    one = np.float32(1)
    c, r = int(k0), int(l0)
    if c >= 0 and c < columns - 1 and r >= 0 and r < rows - 1:
        at = np.uint64(base + (r * columns + c) * channels)
        right, below = np.uint64(channels), np.uint64(columns * channels)
        w0, w1 = weight * (one - fl), weight * fl
        w00, w01, w10, w11 = w0 * (one - fk), w0 * fk, w1 * (one - fk), w1 * fk
        if channels == 3:
            one64, two64 = np.uint64(1), np.uint64(2)
            b, d, e = at + right, at + below, at + below + right
            found[0] += w00 * values[at] + w01 * values[b] + w10 * values[d] + w11 * values[e]
            found[1] += (
                w00 * values[at + one64]
                + w01 * values[b + one64]
                + w10 * values[d + one64]
                + w11 * values[e + one64]
            )
            found[2] += (
                w00 * values[at + two64]
                + w01 * values[b + two64]
                + w10 * values[d + two64]
                + w11 * values[e + two64]
            )
            return
        for channel in range(channels):
            p = at + np.uint64(channel)
            found[channel] += (
                w00 * values[p]
                + w01 * values[p + right]
                + w10 * values[p + below]
                + w11 * values[p + below + right]
            )
        return
    for dr in range(2):
        for dc in range(2):
            if c + dc >= 0 and c + dc < columns and r + dr >= 0 and r + dr < rows:
                w = weight * (fl if dr else one - fl) * (fk if dc else one - fk)
                for channel in range(channels):
                    found[channel] += w * values[base + ((r + dr) * columns + c + dc) * channels + channel]


@_inlined
def corners_in_four_views(base, across, down, picture, row_of_views):  # type: ignore[no-untyped-def]
    """Where the first of the samples around a ray stands in each of the four views that it lies between.

    Args:
        base: where the first view begins.
        across: where its column begins in a row of samples, in the left views and in the right ones.
        down: where its row begins, in the upper views and in the lower ones.
        picture: values from a view to the next one in its row.
        row_of_views: values from a row of views to the next.
    """
    (c0, c1), (r0, r1) = across, down
    upper = base + r0 + c0, base + picture + r0 + c1
    lower = base + row_of_views + r1 + c0, base + row_of_views + picture + r1 + c1
    return upper[0], upper[1], lower[0], lower[1]


@_inlined
def weights_in_four_views(weight, fi, fj, parts):  # type: ignore[no-untyped-def]
    """What two rows and two columns of samples in each of four views count for a ray, where its axes part.

    Args:
        weight: of the ray.
        fi: how near it is to the right views, 0 to 1.
        fj: to the lower ones.
        parts: of a sample by which it lies beyond the first: columns (left views, right), rows (upper, lower).

    Returns:
        Rows (two of the upper views, two of the lower) and columns (two of the left, two of the right), float32.
    """
    one = np.float32(1)
    (fk0, fk1), (fl0, fl1) = parts
    fi, fj = np.float32(fi), np.float32(fj)
    lower = np.float32(weight) * fj
    upper = np.float32(weight) - lower
    above, below = upper * np.float32(fl0), lower * np.float32(fl1)
    left, right = (one - fi) * np.float32(fk0), fi * np.float32(fk1)
    return (upper - above, above, lower - below, below), (one - fi - left, left, fi - right, right)


@_inlined
def views_of_ray(i, j, nu, nv, between):  # type: ignore[no-untyped-def]
    """The first of the views that a ray lies between, (i0, j0), and how near it is to the next ones, (fi, fj).

    Where views are not interpolated, the one that it lies in, and 0.
    """
    ci, cj = min(max(i, 0.0), nu - 1.0), min(max(j, 0.0), nv - 1.0)
    if between:
        i0, j0 = min(int(ci), max(nu - 2, 0)), min(int(cj), max(nv - 2, 0))
        return i0, j0, ci - i0, cj - j0
    return int(ci + 0.5), int(cj + 0.5), 0.0, 0.0


@_inlined
def dark_from(motion):  # type: ignore[no-untyped-def]
    """How far outside the pictures, in samples (k, l), all views that a ray is between are dark."""
    return 1.0 + 1.5 * (abs(motion[0, 0]) + abs(motion[0, 1])), 1.0 + 1.5 * (abs(motion[1, 0]) + abs(motion[1, 1]))


@_inlined
def may_find_light(i, j, k, l, views, dark):  # type: ignore[no-untyped-def]
    """Whether a ray meets the grid of views, and their pictures or what is less than ``dark`` beside them."""
    nv, nu, nt, ns = views
    if not (i >= -0.5 and i <= nu - 0.5 and j >= -0.5 and j <= nv - 0.5):
        return False
    return k > -dark[0] and k < ns - 1 + dark[0] and l > -dark[1] and l < nt - 1 + dark[1]


@_inlined
def add_rays(field, begin, rays, n, second, sums):  # type: ignore[no-untyped-def]
    """Look a packet of n rays up in the light field and add what they carry to sums (half, `LANES` or channels).

    Rays from ``second`` on belong to the second half. Places are replaced by indices.
    """
    samples, _, index_from_ray, motion, between = field
    values, (nv, nu, high, wide), channels = samples
    first_rows, first_columns, nt, ns = begin
    x, y, s, t, share = rays
    to_indices(index_from_ray, rays, n)
    # Where x and y do not mix, the pixels looked at in four views are two columns and two rows.
    parted = between and motion[0, 1] == 0.0 and motion[1, 0] == 0.0 and nu > 1 and nv > 1
    vectors = parted and (channels == 1 or channels == 3 or channels == 4)
    line, picture, row_of_views = wide * channels, high * wide * channels, nu * high * wide * channels
    last = len(values) - LANES
    views, dark = (nv, nu, nt, ns), dark_from(motion)
    for p in range(n):
        weight = share[p]
        if weight == 0.0:
            continue
        half = 1 if p >= second else 0
        i, j, k, l = x[p], y[p], s[p], t[p]
        if not may_find_light(i, j, k, l, views, dark):
            continue
        i0, j0, fi, fj = views_of_ray(i, j, nu, nv, between)  # without motion where they are not interpolated
        if vectors:
            k0, l0 = k + motion[0, 0] * (i - i0), l + motion[1, 1] * (j - j0)
            k1, l1 = k0 - motion[0, 0], l0 - motion[1, 1]
            kf0, kf1, lf0, lf1 = math.floor(k0), math.floor(k1), math.floor(l0), math.floor(l1)
            c0, c1 = int(kf0) - first_columns[i0], int(kf1) - first_columns[i0 + 1]
            r0, r1 = int(lf0) - first_rows[j0], int(lf1) - first_rows[j0 + 1]
            inside = min(c0, c1) >= 0 and max(c0, c1) < wide - 1 and min(r0, r1) >= 0 and max(r0, r1) < high - 1
            c0, c1, r0, r1 = c0 * channels, c1 * channels, r0 * line, r1 * line
            base = j0 * row_of_views + i0 * picture
            if inside and base + row_of_views + picture + max(r0, r1) + line + max(c0, c1) <= last:
                parts = (k0 - kf0, k1 - kf1), (l0 - lf0, l1 - lf1)
                corners = corners_in_four_views(base, (c0, c1), (r0, r1), picture, row_of_views)
                rows, columns = weights_in_four_views(weight, fi, fj, parts)
                at = half * sums.shape[1]
                if channels == 3:
                    add_views_of_3(values, corners, line, rows, columns, sums, at)
                elif channels == 1:
                    add_views_of_1(values, corners, line, rows, columns, sums, at)
                else:
                    add_views_of_4(values, corners, line, rows, columns, sums, at)
                continue
        for dj in range(2):
            wj = weight * (fj if dj else 1.0 - fj)
            if wj == 0.0:
                continue
            for di in range(2):
                w = wj * (fi if di else 1.0 - fi)
                if w == 0.0:
                    continue
                away_i, away_j = i - (i0 + di), j - (j0 + dj)
                view_k = k + motion[0, 0] * away_i + motion[0, 1] * away_j - first_columns[i0 + di]
                view_l = l + motion[1, 0] * away_i + motion[1, 1] * away_j - first_rows[j0 + dj]
                base = (j0 + dj) * row_of_views + (i0 + di) * picture
                add_view(samples, base, view_k, view_l, np.float32(w), sums[half])


@_inner
def to_indices(m, rays, n):  # type: ignore[no-untyped-def]
    """Replace the places and slopes of n rays by their indices (i, j, k, l), by a 4×5 matrix."""
    x, y, s, t, _ = rays
    if m[0, 1] == m[0, 3] == m[1, 0] == m[1, 2] == m[2, 1] == m[2, 3] == m[3, 0] == m[3, 2] == 0.0:
        a, b, c, d, e, f = m[0, 0], m[0, 2], m[0, 4], m[2, 0], m[2, 2], m[2, 4]
        for p in range(n):
            xp, sp = x[p], s[p]
            x[p] = a * xp + b * sp + c
            s[p] = d * xp + e * sp + f
        a, b, c, d, e, f = m[1, 1], m[1, 3], m[1, 4], m[3, 1], m[3, 3], m[3, 4]
        for p in range(n):
            yp, tp = y[p], t[p]
            y[p] = a * yp + b * tp + c
            t[p] = d * yp + e * tp + f
        return
    for p in range(n):
        xp, yp, sp, tp = x[p], y[p], s[p], t[p]
        x[p] = m[0, 0] * xp + m[0, 1] * yp + m[0, 2] * sp + m[0, 3] * tp + m[0, 4]
        y[p] = m[1, 0] * xp + m[1, 1] * yp + m[1, 2] * sp + m[1, 3] * tp + m[1, 4]
        s[p] = m[2, 0] * xp + m[2, 1] * yp + m[2, 2] * sp + m[2, 3] * tp + m[2, 4]
        t[p] = m[3, 0] * xp + m[3, 1] * yp + m[3, 2] * sp + m[3, 3] * tp + m[3, 4]


@_inner
def hashed(number, seed):  # type: ignore[no-untyped-def]
    """See `vcc.plan.rays.points.hashed`."""
    h = np.uint32(number & 0xFFFFFFFF) ^ np.uint32((seed * 0x9E3779B1) & 0xFFFFFFFF)
    h = np.uint32(np.uint32(h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B))
    h = np.uint32(np.uint32(h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35))
    return np.uint32(h ^ (h >> np.uint32(16)))


@_inlined
def set_image(image, cells, axis, centre, power, slope):  # type: ignore[no-untyped-def]
    """Numbers by which `through_cell` finds the stop's image seen through a cell, along one axis, and the cell."""
    gain = cells.beyond[axis] + power * cells.beyond_from_slope[axis]
    if abs(gain) < 1e-12:
        gain = 1e-12
    from_slope = cells.beyond_from_slope[axis] * (power * centre + slope)
    rest = cells.middle[axis] - cells.beyond_offset[axis] + from_slope
    image[0] = rest / gain
    image[1] = -cells.beyond_from_sensor[axis] / gain
    image[2] = cells.half[axis] / abs(gain)
    image[3] = centre
    image[4] = cells.cell_half[axis]


@_inner
def kind_of(kinds, row, column):  # type: ignore[no-untyped-def]
    """(power, δs, δt) of a cell; divisions are spared where there is one kind, the usual case."""
    rows, columns = kinds.shape[0], kinds.shape[1]
    one = rows * columns == 1
    r, c = (0, 0) if one else (row % rows, column % columns)
    return kinds[r, c, 0], kinds[r, c, 1], kinds[r, c, 2]


@_inner
def cells_seen(cells, x, y, sensitive, near):  # type: ignore[no-untyped-def]
    """Fill ``near`` with the (row, column) of the cells through which a pixel sees the stop; returns how many."""
    beyond, from_sensor, from_slope = cells.beyond, cells.beyond_from_sensor, cells.beyond_from_slope
    offset, middle, half, cell_half = cells.beyond_offset, cells.middle, cells.half, cells.cell_half
    centre_x = (middle[0] - offset[0] - from_sensor[0] * x) / beyond[0]
    centre_y = (middle[1] - offset[1] - from_sensor[1] * y) / beyond[1]
    row, column, _, _ = cell_of(cells.layout, cells.turn, centre_x, centre_y)
    # The place p(a) = gain·a + rest at the stop, over the cell and the pixel, must meet the stop.
    loose_x, loose_y = abs(from_sensor[0]) * sensitive[0] / 2, abs(from_sensor[1]) * sensitive[1] / 2
    rest_x = from_sensor[0] * x + offset[0] - middle[0]
    rest_y = from_sensor[1] * y + offset[1] - middle[1]
    found = 0
    for r in range(row - cells.reach[0], row + cells.reach[0] + 1):
        for c in range(column - cells.reach[1], column + cells.reach[1] + 1):
            centre_x, centre_y = centre_of(cells.layout, cells.turn, r, c)
            power, slope_x, slope_y = kind_of(cells.kinds, r, c)
            # At the centre the cell's lens does nothing: there p is beyond·centre + rest.
            gain = abs(beyond[0] + power * from_slope[0])
            off = abs(beyond[0] * centre_x + rest_x - from_slope[0] * slope_x)
            seen = off <= half[0] + (gain * cell_half[0] + loose_x) * (1 + 1e-9)
            gain = abs(beyond[1] + power * from_slope[1])
            off = abs(beyond[1] * centre_y + rest_y - from_slope[1] * slope_y)
            if seen and off <= half[1] + (gain * cell_half[1] + loose_y) * (1 + 1e-9):
                near[found, 0], near[found, 1] = r, c
                found += 1
    return found


@_inlined
def unit(point, flipped):  # type: ignore[no-untyped-def]
    """A number 0 … 1 of `DIGITS` binary digits, some of them flipped; see `vcc.plan.rays.model.Rays._moved`."""
    return (np.float64(np.int32(point * DIGITS_ABOVE) ^ flipped) + 0.5) * DIGITS_BELOW


@_inner
def at_pixel(drawn, middle, sensitive, rays):  # type: ignore[no-untyped-def]
    """Places of a packet's rays over the sensitive area of a pixel."""
    points, start, n, flipped = drawn
    x, y = rays.x, rays.y
    (middle_x, middle_y), (wide, high) = middle, sensitive
    across, down = np.int32(flipped[0]), np.int32(flipped[1])
    for p in range(n):
        x[p] = middle_x + (unit(points[0, start + p], across) - 0.5) * wide
        y[p] = middle_y + (unit(points[1, start + p], down) - 0.5) * high


@_inner
def through_window(drawn, window, rays):  # type: ignore[no-untyped-def]
    """Slopes and weights of rays towards a `vcc.plan.rays.bounds.windows.Window`, making up for diffusers."""
    points, start, n, flipped = drawn
    from_point, from_sensor, (f4, g4), solid_angle, disc, scatter = window
    x, y, s, t, share = rays
    f0, f1, f2, f3 = from_point[0, 0], from_point[0, 1], from_sensor[0, 0], from_sensor[0, 1]
    g0, g1, g2, g3 = from_point[1, 0], from_point[1, 1], from_sensor[1, 0], from_sensor[1, 1]
    if disc:  # turned
        turn = 2.0 * math.pi * DIGITS_BELOW * flipped[2]
        cosine, sine = math.cos(turn), math.sin(turn)
        f0, f1 = f0 * cosine + f1 * sine, f1 * cosine - f0 * sine
        g0, g1 = g0 * cosine + g1 * sine, g1 * cosine - g0 * sine
    across, down = np.int32(flipped[2]), np.int32(flipped[3])
    for p in range(n):
        a, b = np.float64(points[2, start + p]), np.float64(points[3, start + p])
        if not disc:
            a, b = 2.0 * unit(points[2, start + p], across) - 1.0, 2.0 * unit(points[3, start + p], down) - 1.0
        s[p] = f0 * a + f1 * b + f2 * x[p] + f3 * y[p] + f4
        t[p] = g0 * a + g1 * b + g2 * x[p] + g3 * y[p] + g4
        share[p] = solid_angle
    for term in range(len(scatter)):
        column = int(scatter[term, 0])
        f0, f1, g0, g1 = scatter[term, 1], scatter[term, 2], scatter[term, 3], scatter[term, 4]
        for p in range(n):
            a, b = points[column, start + p], points[column + 1, start + p]
            s[p] += f0 * a + f1 * b
            t[p] += g0 * a + g1 * b


@_inner
def through_cell(drawn, images, cells, rays):  # type: ignore[no-untyped-def]
    """Slopes and weights of rays through what of a cell the stop is seen through; see `CellWindows.aimed`.

    ``images``: (2, 5), see `set_image`. Until the last loop, s holds places across, t and share the ends of what
    is seen there.
    """
    points, start, n, flipped = drawn
    x, y, s, t, share = rays
    middle, along, half, centre, reach = images[0, 0], images[0, 1], images[0, 2], images[0, 3], images[0, 4]
    middle_y, along_y, half_y, centre_y = images[1, 0], images[1, 1], images[1, 2], images[1, 3]
    radius, borders = cells.opening_radius, cells.borders
    across, down = np.int32(flipped[2]), np.int32(flipped[3])
    per_half = cells.disc / half  # of a rectangle all chords are alike
    for p in range(n):
        image = middle + along * x[p]
        low = max(image - half, centre - reach)
        a = low + max(min(image + half, centre + reach) - low, 0.0) * unit(points[2, start + p], across)
        off = (a - image) * per_half
        chord = half_y * math.sqrt(max(1.0 - off * off, 0.0))
        image = middle_y + along_y * y[p]
        s[p], t[p], share[p] = a, image - chord, image + chord
    for strip in range(len(borders)):
        slope, tall = borders[strip, 0], borders[strip, 1]
        for p in range(n):
            border = centre_y + slope * (s[p] - centre)
            t[p], share[p] = max(t[p], border - tall), min(share[p], border + tall)
    if radius < np.inf:
        for p in range(n):
            away = s[p] - centre
            chord = math.sqrt(max(radius * radius - away * away, 0.0))
            t[p], share[p] = max(t[p], centre_y - chord), min(share[p], centre_y + chord)
    per_slope_x, per_slope_y = 1 / cells.place_from_slope[0], 1 / cells.place_from_slope[1]
    weight = abs(per_slope_x * per_slope_y)
    (from_x, from_y), (offset_x, offset_y) = cells.place_from_sensor, cells.offset
    for p in range(n):
        image = middle + along * x[p]
        wide = max(min(image + half, centre + reach) - max(image - half, centre - reach), 0.0)
        tall = max(share[p] - t[p], 0.0)
        b = t[p] + tall * unit(points[3, start + p], down)
        s[p] = (s[p] - from_x * x[p] - offset_x) * per_slope_x
        t[p] = (b - from_y * y[p] - offset_y) * per_slope_y
        share[p] = weight * wide * tall


@_allocating
def room():  # type: ignore[no-untyped-def]
    """Where rays are traced: (rays, near, images, flipped); see `cells_at` and `turn_to`."""
    rays = Packet(np.empty(PACKET), np.empty(PACKET), np.empty(PACKET), np.empty(PACKET), np.empty(PACKET))
    return rays, np.empty((256, 2), dtype=np.int64), np.empty((2, 5)), np.empty(4, dtype=np.int64)


@_inlined
def first_point(points, pixel):  # type: ignore[no-untyped-def]
    """Where in their table the points begin that a pixel takes; see `vcc.plan.rays.model.Rays.block`."""
    table, samples, beside, seed = points
    return ((np.int64(hashed(pixel, seed)) * (table.shape[1] // samples) >> 32) ^ beside) * samples


@_inlined
def aim_rays(aim, drawn, middle, sensitive, images, rays):  # type: ignore[no-untyped-def]
    """A packet's rays at the sensor, through the window or the cell at which they are aimed."""
    at_pixel(drawn, middle, sensitive, rays)
    if aim.by_cell:
        through_cell(drawn, images, aim.cells, rays)
    else:
        through_window(drawn, aim.window, rays)


@_inlined
def middle_of(sensor, row, column):  # type: ignore[no-untyped-def]
    """The place (x, y) of the middle of a pixel."""
    return sensor.first[0] + column * sensor.pitch[0], sensor.first[1] + row * sensor.pitch[1]


@_inlined
def cells_at(by_cell, cells, middle, sensitive, near):  # type: ignore[no-untyped-def]
    """Fill ``near`` with the cells that a pixel is traced through; returns how many, 1 where there is a window."""
    seen = 1
    if by_cell:
        seen = cells_seen(cells, middle[0], middle[1], sensitive, near)
    return seen


@_inlined
def turn_to(by_cell, cells, seed, pixel, near, q, images, flipped):  # type: ignore[no-untyped-def]
    """Set what is drawn for a pixel, and for its cell ``q`` of those that `cells_at` found, where that is."""
    number = np.int64(pixel)
    if by_cell:
        number ^= np.int64(hashed(near[q, 0] * 65537 + near[q, 1], seed))
        centre_x, centre_y = centre_of(cells.layout, cells.turn, near[q, 0], near[q, 1])
        power, slope_x, slope_y = kind_of(cells.kinds, near[q, 0], near[q, 1])
        set_image(images[0], cells, 0, centre_x, power, slope_x)
        set_image(images[1], cells, 1, centre_y, power, slope_y)
    for n in range(4):
        flipped[n] = hashed(number, seed + 1 + n) >> np.uint32(32 - DIGITS)


@_compiled
def add_pixels(field, begin, sensor, points, window, cells, steps, few, rare, ended, pictures, tile, within, sums):  # type: ignore[no-untyped-def]
    """The pixels of a tile, into pictures (2, rows, columns, channels); what is given: `vcc.engines.ray_tables`.

    The first picture is what all of a pixel's rays find, the second what its two halves differ by. Once
    ``ended[0]`` is true, nobody wants them, and the kernel returns. It is called from Python as it is:
    a kernel around it that made the arrays took a third of the time to compile.

    Args:
        field: of whole views or of parts of them.
        begin: where these parts begin.
        window: where to aim, or None where there are cells: what is None is not compiled.
        cells: through which to aim, or None.
        steps: what rays meet.
        few: True where all steps are among `FEW`, else None.
        rare: the other way round.
        within: as what `room` makes.
        sums: of a packet, float32, and of a pixel, (2, lanes) each; and how many rays were traced, (1,).
    """
    table, samples, _, seed = points
    channels = field.samples.channels
    rays, near, images, flipped = within
    share = rays.share
    sums, totals, tally = sums
    for row in range(tile.first_row, min(tile.end_row, sensor.rows)):
        for column in range(tile.first_column, min(tile.end_column, sensor.columns)):
            if ended[0]:
                return
            pixel, middle = row * sensor.columns + column, middle_of(sensor, row, column)
            first = first_point(points, pixel)
            totals[:] = 0
            seen = 1
            if cells is not None:
                seen = cells_at(True, cells, middle, sensor.sensitive, near)
            for q in range(seen):
                if window is not None:
                    for number in range(4):
                        flipped[number] = hashed(pixel, seed + 1 + number) >> np.uint32(32 - DIGITS)
                if cells is not None:
                    turn_to(True, cells, seed, pixel, near, q, images, flipped)
                for done in range(0, samples, PACKET):
                    n = min(PACKET, samples - done)
                    drawn = Drawn(table, first + done, n, flipped)
                    at_pixel(drawn, middle, sensor.sensitive, rays)
                    if window is not None:
                        through_window(drawn, window, rays)
                    if cells is not None:
                        through_cell(drawn, images, cells, rays)
                    sent = 0
                    for p in range(n):
                        sent += share[p] > 0.0
                    if sent == 0:
                        continue
                    tally[0] += sent
                    if few is not None:
                        take_few_steps(steps, drawn, rays)
                    if rare is not None:
                        take_steps(steps, drawn, rays)
                    add_rays(field, begin, rays, n, samples // 2 - done, sums)
                    for half in range(2):  # a packet in single precision, the packets in double
                        for lane in range(sums.shape[1]):
                            totals[half, lane] += sums[half, lane]
                            sums[half, lane] = 0
            # Where vectors left them apart, the right pixels' channels are added to the left ones'.
            apart = channels == 1 or channels == 3 or channels == 4
            for channel in range(channels):
                one, two = totals[0, channel], totals[1, channel]
                if apart:
                    one, two = one + totals[0, channels + channel], two + totals[1, channels + channel]
                one, two = one * field.scale / samples, two * field.scale / samples
                pictures[0, row, column, channel] = one + two
                pictures[1, row, column, channel] = 2 * (one - two)
