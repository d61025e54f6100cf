"""Look up rays in the light field, the transpose of this, and its derivative.

A ray falls between four views, and in each view between four samples. These and their weights are defined once,
for all three functions and for the GPU.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import ray_back, ray_inlined, ray_inner, ray_loop
from vcc.engines.vector_gather import LANES, add_views_of_1, add_views_of_3, add_views_of_4


@ray_inner
def to_indices(m, rays, n):  # type: ignore[no-untyped-def]
    """Replace the positions and slopes of n rays by their indices (i, j, k, l), by a 4×5 matrix."""
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


@ray_inlined
def views_of_ray(i, j, nu, nv, between):  # type: ignore[no-untyped-def]
    """The first of the views around a ray, (i0, j0), and the fraction of the way to the next ones, (fi, fj).

    If views are not interpolated: the nearest view, and 0.
    """
    ci, cj = min(max(i, 0.0), nu - 1.0), min(max(j, 0.0), nv - 1.0)
    if between:
        i0, j0 = min(int(ci), max(nu - 2, 0)), min(int(cj), max(nv - 2, 0))
        return i0, j0, ci - i0, cj - j0
    return int(ci + 0.5), int(cj + 0.5), 0.0, 0.0


@ray_inlined
def dark_from(motion):  # type: ignore[no-untyped-def]
    """How far outside the views, in samples (k, l), all views around a ray are dark."""
    return 1.0 + 1.5 * (abs(motion[0, 0]) + abs(motion[0, 1])), 1.0 + 1.5 * (abs(motion[1, 0]) + abs(motion[1, 1]))


@ray_inlined
def may_find_light(i, j, k, l, views, dark):  # type: ignore[no-untyped-def]
    """Whether a ray meets the grid of views, and falls on their pixels or less than ``dark`` outside them."""
    nv, nu, nt, ns = views
    if not (i >= -0.5 and i <= nu - 0.5 and j >= -0.5 and j <= nv - 0.5):
        return False
    return k > -dark[0] and k < ns - 1 + dark[0] and l > -dark[1] and l < nt - 1 + dark[1]


@ray_inlined
def places_in_four_views(motion, away_i, away_j, k, l):  # type: ignore[no-untyped-def]
    """Where a ray falls on four views, if the axes are separable, from its place relative to the first of them.

    Returns:
        The columns of samples to the left of it, in the left views and in the right ones; the rows above it, in
        the upper views and in the lower ones; fractions of a sample beyond both, see `weights_in_four_views`.
    """
    k0, l0 = k + motion[0, 0] * away_i, l + motion[1, 1] * away_j
    k1, l1 = k0 - motion[0, 0], l0 - motion[1, 1]
    kf0, kf1, lf0, lf1 = math.floor(k0), math.floor(k1), math.floor(l0), math.floor(l1)
    return (int(kf0), int(kf1)), (int(lf0), int(lf1)), ((k0 - kf0, k1 - kf1), (l0 - lf0, l1 - lf1))


@ray_inlined
def corners_in_four_views(base, across, down, picture, row_of_views):  # type: ignore[no-untyped-def]
    """Where the first of the samples around a ray begins in each of the four views around it.

    Args:
        base: where the first view begins.
        across: offset of its column in a row of samples, in the left views and in the right ones.
        down: offset of its row, in the upper views and in the lower ones.
        picture: values from a view to the next one in its row.
        row_of_views: values from a row of views to the next.
    """
    (c0, c1), (r0, r1) = across, down
    upper = base + r0 + c0, base + picture + r0 + c1
    lower = base + row_of_views + r1 + c0, base + row_of_views + picture + r1 + c1
    return upper[0], upper[1], lower[0], lower[1]


@ray_inlined
def weights_in_four_views(weight, fi, fj, parts):  # type: ignore[no-untyped-def]
    """Weights of two rows and two columns of samples in each of four views, if the axes are separable.

    Args:
        weight: of the ray.
        fi: fraction of the way to the right views, 0 to 1.
        fj: fraction of the way to the lower views.
        parts: fractions of a sample beyond the first: columns (left views, right), rows (upper, lower).

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


@ray_inner
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


@ray_inlined
def add_rays(field, begin, rays, n, second, sums):  # type: ignore[no-untyped-def]
    """Look up n rays of a packet in the light field and add the results to sums (half, `LANES` or channels).

    The packet holds indices, from `to_indices`. Rays from ``second`` on belong to the second half.
    """
    samples, _, _, motion, between = field
    values, (nv, nu, high, wide), channels = samples
    first_rows, first_columns, nt, ns = begin
    x, y, s, t, share = rays
    # If x and y are separable, the pixels read in four views are two columns and two rows.
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
        i0, j0, fi, fj = views_of_ray(i, j, nu, nv, between)  # motion is zero if views are not interpolated
        if vectors:
            (c0, c1), (r0, r1), parts = places_in_four_views(motion, i - i0, j - j0, k, l)
            c0, c1 = c0 - first_columns[i0], c1 - first_columns[i0 + 1]
            r0, r1 = r0 - first_rows[j0], r1 - first_rows[j0 + 1]
            inside = min(c0, c1) >= 0 and max(c0, c1) < wide - 1 and min(r0, r1) >= 0 and max(r0, r1) < high - 1
            c0, c1, r0, r1 = c0 * channels, c1 * channels, r0 * line, r1 * line
            base = j0 * row_of_views + i0 * picture
            if inside and base + row_of_views + picture + max(r0, r1) + line + max(c0, c1) <= last:
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


# --- backward ---


@ray_loop
def spread_view(grown, base, k, l, weight, weights, pixel):  # type: ignore[no-untyped-def]
    """Add a pixel's gradient to a view's samples around (k, l); the transpose of `add_view`."""
    values, (_, _, rows, columns), channels, _, _ = grown
    k0, l0 = math.floor(k), math.floor(l)
    fk, fl = k - k0, l - l0
    c, r = int(k0), int(l0)
    for dr in range(2):
        for dc in range(2):
            if c + dc >= 0 and c + dc < columns and r + dr >= 0 and r + dr < rows:
                w = np.float32(weight * (fl if dr else 1.0 - fl) * (fk if dc else 1.0 - fk))
                at = base + ((r + dr) * columns + c + dc) * channels
                for channel in range(channels):
                    values[at + channel] += w * weights[pixel + channel]


@ray_back
def field_back(field, weights, n, index, lit, bar, to_motion, to_scale):  # type: ignore[no-untyped-def]
    """Fill ``bar`` (5, rays), the cotangents of indices and shares of rays, from the light field."""
    (values, views, channels), _, _, motion, between = field
    nv, nu, nt, ns = views
    line, picture = ns * channels, nt * ns * channels
    m00, m01, m10, m11 = motion[0, 0], motion[0, 1], motion[1, 0], motion[1, 1]
    dark = dark_from(motion)
    along_i, along_j = (min(nu, 2), min(nv, 2)) if between else (1, 1)
    t00 = t01 = t10 = t11 = total = 0.0
    for p in range(n):
        i, j, k, l, share = index[0, p], index[1, p], index[2, p], index[3, p], index[4, p]
        for q in range(5):
            bar[q, p] = 0.0
        if lit[p] == 0.0 or not may_find_light(i, j, k, l, views, dark):
            continue
        i0, j0, fi, fj = views_of_ray(i, j, nu, nv, between)
        value = of_i = of_j = of_k = of_l = 0.0
        for dj in range(along_j):
            wj, sj, away_j = (fj, 1.0, j - j0 - 1) if dj else (1.0 - fj, -1.0, j - j0)
            for di in range(along_i):
                wi, si, away_i = (fi, 1.0, i - i0 - 1) if di else (1.0 - fi, -1.0, i - i0)
                view_k, view_l = k, l
                if between:
                    view_k, view_l = k + m00 * away_i + m01 * away_j, l + m10 * away_i + m11 * away_j
                k0, l0 = math.floor(view_k), math.floor(view_l)
                fk, fl = view_k - k0, view_l - l0
                c, r = int(k0), int(l0)
                at = ((j0 + dj) * nu + i0 + di) * picture + r * line + c * channels
                u00 = u01 = u10 = u11 = 0.0
                if c >= 0 and c < ns - 1 and r >= 0 and r < nt - 1:
                    for channel in range(channels):
                        g, here = weights[channel], np.uint64(at + channel)
                        u00 += g * values[here]
                        u01 += g * values[here + np.uint64(channels)]
                        u10 += g * values[here + np.uint64(line)]
                        u11 += g * values[here + np.uint64(line + channels)]
                else:
                    left, right = c >= 0 and c < ns, c >= -1 and c < ns - 1
                    up, down = r >= 0 and r < nt, r >= -1 and r < nt - 1
                    for channel in range(channels):
                        g, here = weights[channel], at + channel
                        u00 += g * values[here] if up and left else 0.0
                        u01 += g * values[here + channels] if up and right else 0.0
                        u10 += g * values[here + line] if down and left else 0.0
                        u11 += g * values[here + line + channels] if down and right else 0.0
                upper, lower = u00 + (u01 - u00) * fk, u10 + (u11 - u10) * fk
                found, w = upper + (lower - upper) * fl, wi * wj
                to_k = w * ((u01 - u00) * (1.0 - fl) + (u11 - u10) * fl)
                to_l = w * (lower - upper)
                value += w * found
                of_i += si * wj * found
                of_j += wi * sj * found
                of_k += to_k
                of_l += to_l
                t00 += share * to_k * away_i
                t01 += share * to_k * away_j
                t10 += share * to_l * away_i
                t11 += share * to_l * away_j
        # Weights are constant beyond the outermost views and along an axis with one view.
        of_i = of_i if along_i == 2 and i >= 0.0 and i <= nu - 1.0 else 0.0
        of_j = of_j if along_j == 2 and j >= 0.0 and j <= nv - 1.0 else 0.0
        if between:
            of_i, of_j = of_i + m00 * of_k + m10 * of_l, of_j + m01 * of_k + m11 * of_l
        bar[0, p], bar[1, p], bar[2, p], bar[3, p] = share * of_i, share * of_j, share * of_k, share * of_l
        bar[4, p] = value
        total += share * value
    if between:
        to_motion[0] += t00
        to_motion[1] += t01
        to_motion[2] += t10
        to_motion[3] += t11
    to_scale[0] += total
