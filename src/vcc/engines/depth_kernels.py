"""The compiled loop that renders a scene from between its views: rays marched through disparity maps.

A point at pixel (k, l) of a view with disparity d is at (k + d·a, l + e(d)·b) of the view that is a columns and
b rows of views before it. So a pixel of an image in between is found in a view by following this line, from the
nearest disparity to the farthest, until it meets the view's disparity map: the first surface hides all others.
If the line passes from a far object behind a near one, the view does not show the point.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import ordered_loop
from vcc.engines.interpolation import around, bilinear

TILE = 8
"""Side, in pixels, of the squares whose ranges of disparities bound the marches."""
MET = 0.1
"""In pixels per view: a march meets a map if they differ by less."""
TIE = 1e-6
"""In pixels: places that differ by less from the middle between two pixels are in the middle."""
SAME_SURFACE = 2
"""Largest difference, in tears, between pixels two apart that show one surface."""
HALVINGS = 6
"""Number of bisections of a step of at most a pixel, to find the two pixels around a tear."""


@ordered_loop
def _surface(nearness, x, y, tear):  # type: ignore[no-untyped-def]
    """A map between its pixels: linear, or the nearest pixel's value at a tear; clamped to the border."""
    c, d, fx = around(x, nearness.shape[1])
    r, q, fy = around(y, nearness.shape[0])
    p00, p01, p10, p11 = nearness[r, c], nearness[r, d], nearness[q, c], nearness[q, d]
    if max(max(p00, p01), max(p10, p11)) - min(min(p00, p01), min(p10, p11)) > tear:
        # In the middle between two pixels, use the nearer surface: mirrored maps then give mirrored results.
        upper = p00 if fx < 0.5 - TIE else (p01 if fx > 0.5 + TIE else max(p00, p01))
        lower = p10 if fx < 0.5 - TIE else (p11 if fx > 0.5 + TIE else max(p10, p11))
        return upper if fy < 0.5 - TIE else (lower if fy > 0.5 + TIE else max(upper, lower))
    return bilinear(p00, p01, p10, p11, fx, fy)


@ordered_loop
def _taps(f):  # type: ignore[no-untyped-def]
    """Weights of samples −1, 0, 1 and 2 for the place f between 0 and 1 (Keys 1981, a = −½), float32."""
    half, one, two = np.float32(0.5), np.float32(1), np.float32(2)
    f2 = f * f
    f3 = f2 * f
    return (
        half * (two * f2 - f3 - f),
        half * (np.float32(3) * f3 - np.float32(5) * f2) + one,
        half * (np.float32(4) * f2 - np.float32(3) * f3 + f),
        half * (f3 - f2),
    )


@ordered_loop
def _add_colour(view, x, y, weight, out):  # type: ignore[no-untyped-def]
    """Add a view's value between its pixels, by cubic interpolation; clamped to the border."""
    rows, columns, channels = view.shape
    x = min(max(x, 0.0), columns - 1.0)
    y = min(max(y, 0.0), rows - 1.0)
    c, r = int(x), int(y)
    across, down = _taps(np.float32(x - c)), _taps(np.float32(y - r))
    if channels == 3 and 1 <= c < columns - 2 and 1 <= r < rows - 2:
        red = green = blue = np.float32(0)
        for n in range(4):
            for m in range(4):
                share = down[n] * across[m]
                red += share * np.float32(view[r + n - 1, c + m - 1, 0])
                green += share * np.float32(view[r + n - 1, c + m - 1, 1])
                blue += share * np.float32(view[r + n - 1, c + m - 1, 2])
        out[0] += weight * red
        out[1] += weight * green
        out[2] += weight * blue
        return
    for channel in range(channels):
        total = 0.0
        for n in range(4):
            row = min(max(r + n - 1, 0), rows - 1)
            for m in range(4):
                total += down[n] * across[m] * view[row, min(max(c + m - 1, 0), columns - 1), channel]
        out[channel] += weight * total


@ordered_loop
def _add_colour_beside_tear(view, nearness, x, y, nearer, weight, out):  # type: ignore[no-untyped-def]
    """As `_add_colour` close to other surfaces: pixels nearer than ``nearer`` are left out."""
    rows, columns, channels = view.shape
    x = min(max(x, 0.0), columns - 1.0)
    y = min(max(y, 0.0), rows - 1.0)
    c, r = int(x), int(y)
    alone = True
    for row in range(max(r - 1, 0), min(r + 3, rows)):
        for column in range(max(c - 1, 0), min(c + 3, columns)):
            alone = alone and nearness[row, column] <= nearer
    if alone:
        _add_colour(view, x, y, weight, out)
        return
    across, down = _taps(np.float32(x - c)), _taps(np.float32(y - r))
    # The closest pixel that is not nearer replaces pixels that are.
    own_row, own_column, closest = int(y + 0.5), int(x + 0.5), np.inf
    for row in range(max(r - 1, 0), min(r + 3, rows)):
        for column in range(max(c - 1, 0), min(c + 3, columns)):
            away = (x - column) ** 2 + (y - row) ** 2
            if away < closest and nearness[row, column] <= nearer:
                own_row, own_column, closest = row, column, away
    for n in range(4):
        row = min(max(r + n - 1, 0), rows - 1)
        for m in range(4):
            column = min(max(c + m - 1, 0), columns - 1)
            share = weight * down[n] * across[m]
            hidden = nearness[row, column] > nearer
            row_taken, column_taken = (own_row, own_column) if hidden else (row, column)
            for channel in range(channels):
                out[channel] += share * view[row_taken, column_taken, channel]


@ordered_loop
def _beyond(nearness, march, k, l, w):  # type: ignore[no-untyped-def]
    """How much nearer than w the map is at the place that a march from (k, l) has reached at w."""
    x, y = _place(march.way, k, l, w)
    return _surface(nearness, x, y, march.tear) - w


@ordered_loop
def _place(way, k, l, w):  # type: ignore[no-untyped-def]
    """The place in a view of a point at (k, l) with nearness w; way: `Way`."""
    n0, n1, m0, m1 = way.along_v
    d = way.sign * w
    return k + d * way.columns, l + (n0 + n1 * d) / (m0 + m1 * d) * way.rows


@ordered_loop
def _march(nearness, march, k, l, low, high):  # type: ignore[no-untyped-def]
    """(whether a surface is met, nearness reached by the march, nearness of the surface, nearness beyond a tear).

    The march from pixel (k, l) goes from nearness ``high`` down to ``low``; march: `March`. At a tear no surface
    is met: the march stops on its far side, before its near side.
    """
    if high - low < march.tear:
        # A smooth surface is met once: two fixed-point steps reach it.
        w = 0.5 * (high + low)
        w += _beyond(nearness, march, k, l, w)
        w += _beyond(nearness, march, k, l, w)
        return True, w, w, w
    f0 = _beyond(nearness, march, k, l, high)
    if f0 >= 0:
        return True, high, high, high
    steps = max(1, math.ceil((high - low) * march.reach))
    w0, w1, f1 = high, high, f0
    for n in range(steps):
        w1 = high + (low - high) * (n + 1) / steps
        f1 = _beyond(nearness, march, k, l, w1)
        if f1 >= 0:
            break
        if n < steps - 1:
            w0, f0 = w1, f1
    if f1 < 0:
        return True, w1, w1, w1  # due to rounding: nothing is farther
    # The map is met between the two: soon if it is smooth, never at a tear.
    for n in range(2 + HALVINGS):
        w = w0 + (w1 - w0) * (f0 / (f0 - f1) if n < 2 else 0.5)
        f = _beyond(nearness, march, k, l, w)
        if abs(f) < MET:
            return True, w + f, w + f, w + f
        if f > 0:
            w1, f1 = w, f
        else:
            w0, f0 = w, f
    return False, w0, w0 + f0, w1 + f1


@ordered_loop
def look_from_between(view, bounds, march, weight, torn_only, found):  # type: ignore[no-untyped-def]
    """Rows of the image from a place between views, rendered from one view.

    Args:
        view: `View`.
        bounds: (tiles, tiles, 2), nearness that marches from the pixels of a tile may meet, see `march_bounds`.
        march: `March`.
        weight: of added values if ``torn_only``; else 1.
        torn_only: process only pixels that are still unseen, and add only values that fit their far side.
        found: `Found`, filled; added to if ``torn_only``.
    """
    samples, nearness, _ = view
    first, out, seen, far, near = found
    rows, columns = nearness.shape
    for row in range(out.shape[0]):
        l = first + row
        for k in range(columns):
            if torn_only and seen[row, k] > 0:
                continue
            low, high = bounds[l // TILE, k // TILE, 0], bounds[l // TILE, k // TILE, 1]
            met, w, here, beyond = _march(nearness, march, k, l, low, high)
            x, y = _place(march.way, k, l, w)
            shown = met and -0.5 <= x <= columns - 0.5 and -0.5 <= y <= rows - 0.5
            nearer = here + SAME_SURFACE * march.tear
            if not torn_only:
                far[row, k], near[row, k] = here, beyond
                seen[row, k] = 1 if shown else -1
                if high - low < march.tear:
                    _add_colour(samples, x, y, np.float32(1), out[row, k])
                else:
                    _add_colour_beside_tear(samples, nearness, x, y, nearer, np.float32(1), out[row, k])
            # From other views, use only values on the far side of the tear.
            elif shown and abs(here - far[row, k]) <= abs(here - near[row, k]):
                if seen[row, k] == -1:
                    out[row, k, :] = 0
                seen[row, k] -= weight
                _add_colour_beside_tear(samples, nearness, x, y, nearer, np.float32(weight), out[row, k])


@ordered_loop
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


@ordered_loop
def march_bounds(ranges, way):  # type: ignore[no-untyped-def]
    """The lowest and highest nearness that marches from the pixels of each tile may meet, like ``ranges``."""
    down, across, _ = ranges.shape
    bounds = np.empty_like(ranges)
    lowest, highest = ranges[:, :, 0].min(), ranges[:, :, 1].max()
    for r in range(down):
        for c in range(across):
            low, high = lowest, highest
            for _ in range(2):  # the nearness that marches may meet bounds how far they go
                (xa, ya), (xb, yb) = _place(way, 0, 0, low), _place(way, 0, 0, high)
                x0, x1, y0, y1 = min(xa, xb), max(xa, xb), min(ya, yb), max(ya, yb)
                first_c = min(max(math.floor(c + x0 / TILE), 0), across - 1)
                last_c = min(max(math.floor(c + 1 + x1 / TILE), 0), across - 1)
                first_r = min(max(math.floor(r + y0 / TILE), 0), down - 1)
                last_r = min(max(math.floor(r + 1 + y1 / TILE), 0), down - 1)
                part = ranges[first_r : last_r + 1, first_c : last_c + 1]
                low, high = part[:, :, 0].min(), part[:, :, 1].max()
            bounds[r, c, 0], bounds[r, c, 1] = low, high
    return bounds


@ordered_loop
def share_out(out, seen):  # type: ignore[no-untyped-def]
    """Divide sums over several views by their weights; return the number of pixels that no view shows."""
    unseen = 0
    for row in range(out.shape[0]):
        for k in range(out.shape[1]):
            if seen[row, k] == -1:
                unseen += 1
            elif seen[row, k] < 0:
                for channel in range(out.shape[2]):
                    out[row, k, channel] /= -1 - seen[row, k]
    return unseen
