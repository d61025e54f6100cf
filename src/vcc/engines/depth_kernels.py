"""The compiled loop that looks at a scene from between its views: rays marched through disparity maps.

What is at pixel (k, l) of a view and has the disparity d is at (k + d·a, l + e(d)·b) of the view that is a columns
and b rows of views before it. So a pixel of a picture in between is found in a view by going along that line, from
the nearest disparity to the farthest, until the view's own map of disparities is met: the first surface met hides
all others. Where the line passes from a far thing behind a near one, the view does not show what is there.
"""

from __future__ import annotations

import math

import numba
import numpy as np

_compiled = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})

TILE = 16
"""Pixels a side of the squares whose ranges of disparities bound the marches."""
MET = 0.1
"""Of a pixel per view: a map is met where it and the march differ by less."""
HALVINGS = 6
"""Of a step of at most a pixel, to find which two pixels a tear lies between."""


@_compiled
def _surface(nearness, x, y, tear):  # type: ignore[no-untyped-def]
    """A map between its pixels: linear, but the nearest pixel's where it tears; ends go on."""
    rows, columns = nearness.shape
    x = min(max(x, 0.0), columns - 1.0)
    y = min(max(y, 0.0), rows - 1.0)
    c = min(int(x), max(columns - 2, 0))
    r = min(int(y), max(rows - 2, 0))
    d = min(c + 1, columns - 1)
    q = min(r + 1, rows - 1)
    p00, p01, p10, p11 = nearness[r, c], nearness[r, d], nearness[q, c], nearness[q, d]
    fx, fy = x - c, y - r
    if max(max(p00, p01), max(p10, p11)) - min(min(p00, p01), min(p10, p11)) > tear:
        if fy < 0.5:
            return p00 if fx < 0.5 else p01
        return p10 if fx < 0.5 else p11
    return (p00 * (1 - fx) + p01 * fx) * (1 - fy) + (p10 * (1 - fx) + p11 * fx) * fy


@_compiled
def _taps(f):  # type: ignore[no-untyped-def]
    """Weights of samples −1, 0, 1 and 2 for the place f between 0 and 1 (Keys 1981, a = −½)."""
    return (
        ((-0.5 * f + 1) * f - 0.5) * f,
        (1.5 * f - 2.5) * f * f + 1,
        ((-1.5 * f + 2) * f + 0.5) * f,
        (0.5 * f - 0.5) * f * f,
    )


@_compiled
def _add_colour(view, x, y, weight, out):  # type: ignore[no-untyped-def]
    """Add what a view shows at a place between its pixels, cubic; ends go on."""
    rows, columns, channels = view.shape
    x = min(max(x, 0.0), columns - 1.0)
    y = min(max(y, 0.0), rows - 1.0)
    c, r = int(x), int(y)
    across, down = _taps(x - c), _taps(y - r)
    inside = 1 <= c < columns - 2 and 1 <= r < rows - 2
    for channel in range(channels):
        total = 0.0
        for n in range(4):
            if down[n] == 0:
                continue
            row = r + n - 1 if inside else min(max(r + n - 1, 0), rows - 1)
            if inside:
                line = (
                    across[0] * view[row, c - 1, channel] + across[1] * view[row, c, channel]
                    + across[2] * view[row, c + 1, channel] + across[3] * view[row, c + 2, channel]
                )  # fmt: skip
            else:
                line = 0.0
                for m in range(4):
                    line += across[m] * view[row, min(max(c + m - 1, 0), columns - 1), channel]
            total += down[n] * line
        out[channel] += weight * total


@_compiled
def _along(place, d):  # type: ignore[no-untyped-def]
    """The disparity along v of what has the disparity d along u; see `vcc.plan.depth_rule.Parallax`."""
    return (place[0] + place[1] * d) / (place[2] + place[3] * d)


@_compiled
def look_from_between(  # type: ignore[no-untyped-def]
    view, nearness, bounds, columns_before, rows_before, reach, sign, along_v, tear, weight, torn_only, first, out,
    seen, far, near,
):  # fmt: skip
    """Rows of the picture from a place between views, as one view shows them.

    view: (t, s, channels). nearness: (t, s), sign · disparity, larger is nearer. bounds: (tiles, tiles, 2), the
    lowest and highest nearness that marches from the pixels of a tile may meet.
    columns_before, rows_before: how many views the view lies before the place. along_v: 4 numbers, see `_along`.
    reach: pixels of the view, at most, that a march goes for each pixel per view of disparity.
    tear: steps of nearness from pixel to pixel that are borders. weight: of what is added.
    torn_only: only pixels of ``seen`` below 0 are looked for, and only what fits their far side, else all.
    first: row of the picture of the first row of out. out: (rows, s, channels), is added to.
    seen: (rows, s), 1 where the view shows what is there, else −1; with ``torn_only`` it stays, and weights are
    added to −1 − … of what was found. far, near: (rows, s), the nearness met, and of tears that of both sides.
    """
    rows, columns = nearness.shape
    for row in range(out.shape[0]):
        l = first + row
        for k in range(columns):
            if torn_only and seen[row, k] > 0:
                continue
            low = bounds[l // TILE, k // TILE, 0]
            high = bounds[l // TILE, k // TILE, 1]
            steps = max(1, math.ceil((high - low) * reach))
            step = (high - low) / steps
            w0 = high
            d = sign * w0
            f0 = _surface(nearness, k + d * columns_before, l + _along(along_v, d) * rows_before, tear) - w0
            w1, f1 = w0, f0
            for n in range(steps):
                if f0 >= 0:
                    break
                w1 = high - (n + 1) * step
                d = sign * w1
                f1 = _surface(nearness, k + d * columns_before, l + _along(along_v, d) * rows_before, tear) - w1
                if f1 >= 0 or n == steps - 1:
                    break
                w0, f0 = w1, f1
            met = f0 >= 0 or f1 < 0
            w = w0 if f0 >= 0 else w1
            if f0 < 0 <= f1:
                # Between the two the map is met: at once where it is smooth, at a tear never.
                for n in range(2 + HALVINGS):
                    w = w0 + (w1 - w0) * (f0 / (f0 - f1) if n < 2 else 0.5)
                    d = sign * w
                    f = _surface(nearness, k + d * columns_before, l + _along(along_v, d) * rows_before, tear) - w
                    if abs(f) < 0.01 * MET:
                        met = True
                        break
                    if f >= 0:
                        w1, f1 = w, f
                    else:
                        w0, f0 = w, f
                    if n > 0 and min(abs(f0), abs(f1)) < MET:
                        met = True
                        w = w0 if -f0 < f1 else w1
                        break
            here, beyond = w, w
            if not met:
                here, beyond = w0 + f0, w1 + f1
                w = w0
            d = sign * w
            x, y = k + d * columns_before, l + _along(along_v, d) * rows_before
            shown = met and -0.5 <= x <= columns - 0.5 and -0.5 <= y <= rows - 0.5
            if torn_only:
                # Of what the other views show, that which lies on the far side of the tear.
                if shown and abs(here - far[row, k]) <= abs(here - near[row, k]):
                    if seen[row, k] == -1:
                        out[row, k, :] = 0
                    seen[row, k] -= weight
                    _add_colour(view, x, y, weight, out[row, k])
                continue
            far[row, k], near[row, k] = here, beyond
            seen[row, k] = 1 if shown else -1
            _add_colour(view, x, y, 1.0, out[row, k])


@_compiled
def tile_ranges(nearness):  # type: ignore[no-untyped-def]
    """(tiles down, tiles across, 2): the lowest and highest nearness in each tile and one pixel around it."""
    rows, columns = nearness.shape
    down, across = -(-rows // TILE), -(-columns // TILE)
    ranges = np.empty((down, across, 2), dtype=np.float32)
    for r in range(down):
        for c in range(across):
            part = nearness[
                max(r * TILE - 1, 0) : min((r + 1) * TILE + 1, rows),
                max(c * TILE - 1, 0) : min((c + 1) * TILE + 1, columns),
            ]
            ranges[r, c, 0] = part.min()
            ranges[r, c, 1] = part.max()
    return ranges


@_compiled
def march_bounds(ranges, columns_before, rows_before, sign, along_v):  # type: ignore[no-untyped-def]
    """The lowest and highest nearness that marches from the pixels of each tile may meet; shape of ``ranges``."""
    down, across, _ = ranges.shape
    bounds = np.empty_like(ranges)
    lowest, highest = ranges[:, :, 0].min(), ranges[:, :, 1].max()
    for r in range(down):
        for c in range(across):
            low, high = lowest, highest
            for _ in range(2):  # what they may meet bounds how far they go
                x0, x1 = sorted_pair(sign * low * columns_before, sign * high * columns_before)
                y0, y1 = sorted_pair(
                    _along(along_v, sign * low) * rows_before, _along(along_v, sign * high) * rows_before
                )
                first_c = min(max(int(math.floor(c + x0 / TILE)), 0), across - 1)
                last_c = min(max(int(math.floor(c + 1 + x1 / TILE)), 0), across - 1)
                first_r = min(max(int(math.floor(r + y0 / TILE)), 0), down - 1)
                last_r = min(max(int(math.floor(r + 1 + y1 / TILE)), 0), down - 1)
                part = ranges[first_r : last_r + 1, first_c : last_c + 1]
                low, high = part[:, :, 0].min(), part[:, :, 1].max()
            bounds[r, c, 0], bounds[r, c, 1] = low, high
    return bounds


@_compiled
def sorted_pair(one, other):  # type: ignore[no-untyped-def]
    """The smaller and the larger of two numbers."""
    return (one, other) if one <= other else (other, one)


@_compiled
def share_out(out, seen):  # type: ignore[no-untyped-def]
    """Divide what several views were added to by their weights; returns how many pixels no view shows."""
    unseen = 0
    for row in range(out.shape[0]):
        for k in range(out.shape[1]):
            if seen[row, k] == -1:
                unseen += 1
            elif seen[row, k] < 0:
                for channel in range(out.shape[2]):
                    out[row, k, channel] /= -1 - seen[row, k]
    return unseen
