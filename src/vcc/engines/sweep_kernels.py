"""Costs of a plane sweep, by compiled loops; see `vcc.fields.plane_sweep`.

Several threads process planes concurrently. One thread computes each plane's cost, so the result does not depend
on the number of threads.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.engines.compiled import compiled
from vcc.fields.cross import Arm, Array, cubic_weights
from vcc.plan.how import cores

FASTMATH = {"contract", "nsz", "reassoc"}
_compiled, _with_memory = compiled(borrowing=True, fastmath=FASTMATH), compiled(fastmath=FASTMATH)
TRUNCATION = 0.02
"""Fraction of full scale, on the square-root scale: larger differences count as no match, whatever their size."""
CONTRAST = 0.02
"""Fraction of full scale, likewise: contrast above which the guide shows a border."""
RISE = 0.033
"""Cost per row or column of views if the disparity changes by a pixel per view between neighbouring pixels."""
JUMP = 0.04
"""Largest cost of a border, likewise. It is lower where the guide shows a border."""
ALIKE = 1e-6
"""Fraction of full scale: costs without texture differ by rounding only."""
ON_SURFACE, SAME_SURFACE = 3, 0.15
"""Disparities that differ by less (in pixels per view) are averaged over this many pixels on each side."""
BAND = 32
"""Rows or columns of pixels that one thread processes at a time."""
STEP_AT_BORDER = 0.1
"""Step of the guide between neighbouring pixels at which a border costs half, on the scale of `TRUNCATION`."""
AROUND = 3
"""Side, in pixels, of the window over which differences are averaged before choosing the better half of views."""


def costs(
    cross: Sequence[tuple[Arm, Array]],
    tried: Sequence[NDArray[np.float64]],
    guide: Array,
    window: int,
    progress: Progress | None = None,
) -> Array:
    """Differences between views and the middle one, averaged over a window that follows borders, (planes, t, s).

    Args:
        cross: rows of views, each with its middle view (levels, channels, t, s), blurred as by interpolation at
            fractions of a pixel 0 … ½.
        tried: disparities along each row of views and along the other axis, pixels per view, (planes, 2).
        guide: the middle view, (t, s); the window follows its borders.
        window: side of the window, pixels, an odd number.
        progress: called with (done, total).
    """
    found = np.empty((len(tried[0]), *guide.shape), np.float32)
    mean, square = np.empty_like(guide), np.empty_like(guide)
    sums = np.empty(guide.shape[1])
    _box(guide, window, mean, sums)
    _box(guide * guide, window, square, sums)
    variance = square - mean * mean + np.float32(CONTRAST**2)

    def plane(n: int) -> None:
        total = np.zeros_like(guide)
        for (arm, soft), along in zip(cross, tried, strict=True):
            total += _disagreement(arm, soft, float(along[n, 0]), float(along[n, 1]))
        a, b, sums = np.empty_like(guide), np.empty_like(guide), np.empty(guide.shape[1])
        _box(total, window, b, sums)
        _box(guide * total, window, a, sums)
        a[:] = (a - mean * b) / variance
        b -= a * mean
        smooth = np.empty_like(guide)
        _box(a, window, smooth, sums)
        np.multiply(smooth, guide, out=found[n])
        _box(b, window, smooth, sums)
        found[n] += smooth

    with Workers(cores()) as pool:
        for done, _ in enumerate(pool.map(plane, range(len(found))), start=1):
            tell(progress, done, len(found))
    return found


def smoothest(costs: Array, guide: Array, step: float, arms: int) -> NDArray[np.int32]:
    """The plane of each pixel for smooth surfaces, (t, s); the middle plane if all costs are equal.

    The least costs of paths of disparities that end in each plane are summed over four directions, along rows
    and columns (Hirschmüller 2008): a pixel with little texture takes the surface around it.

    Args:
        costs: (planes, t, s).
        guide: (t, s), see `costs`.
        step: between neighbouring planes, pixels per view.
        arms: number of rows and columns of views in the sum of costs.
    """
    planes, rows, columns = costs.shape
    rise, jump = np.float32(RISE * step * arms), np.float32(JUMP * arms)
    sums = np.empty((rows, columns, planes), np.float32)
    best = np.empty((rows, columns), np.int32)
    with Workers(cores()) as pool:
        bands = range(0, rows, BAND)
        list(pool.map(lambda y: _along_rows(costs, guide, rise, jump, sums, y, min(y + BAND, rows)), bands))
        bands = range(0, columns, BAND)
        down = (costs, guide, rise, jump, sums)
        list(pool.map(lambda x: _along_columns(*down, x, min(x + BAND, columns), best), bands))
    return best


def means_of_surfaces(disparity: Array, weights: Array) -> Array:
    """Weighted means of disparities over the same surface; all (t, s). Disparities of weight 0 are unchanged."""
    found = np.empty_like(disparity)
    with Workers(cores()) as pool:
        rows = len(disparity)
        bands = range(0, rows, BAND)
        list(pool.map(lambda y: _mean_of_surface(disparity, weights, found, y, min(y + BAND, rows)), bands))
    return found


def _disagreement(arm: Arm, soft: Array, disparity: float, disparity_aside: float) -> Array:
    """Difference of the better half of a row of views from the compared one at a disparity, (t, s)."""
    views, across = arm.views, arm.axis == 2
    best = np.full(views.shape[2:], np.inf, np.float32)
    around, sums = np.empty_like(best), np.empty(views.shape[-1])
    steps = arm.places
    for side in (np.flatnonzero(steps[:, 0] < 0), np.flatnonzero(steps[:, 0] > 0)):
        if not len(side):
            continue
        total = np.zeros_like(best)
        for n in side:
            view, aside = views[n], -disparity_aside * steps[n, 1]
            if aside:
                view = np.empty_like(view)
                _move(views[n], *_taps(aside), not across, view)
            shift = -disparity * steps[n, 0]
            whole, weights = _taps(shift)
            # Interpolation blurs noise, most between pixels: without equal blur of the compared view, disparities
            # that fall there seem to fit better.
            alike = soft[round(2 * (len(soft) - 1) * abs(shift - round(shift)))]
            _add_difference(view, alike, whole, weights, across, total)
        total /= np.float32(len(side) * views.shape[1])
        _box(total, AROUND, around, sums)
        np.minimum(best, around, out=best)
    return best


def _taps(shift: float) -> tuple[int, Array]:
    """Whole pixels of a shift, and the weights of the four pixels around the rest."""
    whole = math.floor(shift)
    return whole, np.array(cubic_weights(shift - whole), np.float32)


@_compiled
def _move(view, whole, weights, across, moved):  # type: ignore[no-untyped-def]
    """A view shifted by ``whole`` pixels and interpolated along one axis; borders repeated."""
    channels, rows, columns = view.shape
    w0, w1, w2, w3 = weights[0], weights[1], weights[2], weights[3]
    for c in range(channels):
        for y in range(rows):
            q = y + whole
            r0, r1 = min(max(q - 1, 0), rows - 1), min(max(q, 0), rows - 1)
            r2, r3 = min(max(q + 1, 0), rows - 1), min(max(q + 2, 0), rows - 1)
            for x in range(columns):
                if across:
                    p = x + whole
                    value = w0 * view[c, y, min(max(p - 1, 0), columns - 1)]
                    value += w1 * view[c, y, min(max(p, 0), columns - 1)]
                    value += w2 * view[c, y, min(max(p + 1, 0), columns - 1)]
                    value += w3 * view[c, y, min(max(p + 2, 0), columns - 1)]
                else:
                    value = w0 * view[c, r0, x] + w1 * view[c, r1, x]
                    value += w2 * view[c, r2, x] + w3 * view[c, r3, x]
                moved[c, y, x] = value


@_compiled
def _add_difference(view, alike, whole, weights, across, total):  # type: ignore[no-untyped-def]
    """Add |view shifted by ``whole`` pixels and interpolated − alike|, truncated, over channels."""
    channels, rows, columns = view.shape
    w0, w1, w2, w3 = weights[0], weights[1], weights[2], weights[3]
    most = np.float32(TRUNCATION)
    for y in range(rows):
        for c in range(channels):
            if across:
                first = min(max(1 - whole, 0), columns)
                last = max(min(columns - whole - 2, columns), first)
                for n in range(columns - (last - first)):  # at the view's borders, the last pixel is repeated
                    x = n if n < first else n + last - first
                    p = x + whole
                    value = w0 * view[c, y, min(max(p - 1, 0), columns - 1)]
                    value += w1 * view[c, y, min(max(p, 0), columns - 1)]
                    value += w2 * view[c, y, min(max(p + 1, 0), columns - 1)]
                    value += w3 * view[c, y, min(max(p + 2, 0), columns - 1)]
                    total[y, x] += min(abs(value - alike[c, y, x]), most)
                for n in range(last - first):
                    x, p = first + n, first + whole - 1 + n
                    value = w0 * view[c, y, p] + w1 * view[c, y, p + 1]
                    value += w2 * view[c, y, p + 2] + w3 * view[c, y, p + 3]
                    total[y, x] += min(abs(value - alike[c, y, x]), most)
            else:
                p = y + whole
                r0, r1 = min(max(p - 1, 0), rows - 1), min(max(p, 0), rows - 1)
                r2, r3 = min(max(p + 1, 0), rows - 1), min(max(p + 2, 0), rows - 1)
                for x in range(columns):
                    value = w0 * view[c, r0, x] + w1 * view[c, r1, x]
                    value += w2 * view[c, r2, x] + w3 * view[c, r3, x]
                    total[y, x] += min(abs(value - alike[c, y, x]), most)


@_compiled
def _box(values, window, out, sums):  # type: ignore[no-untyped-def]
    """The mean over a window, an odd number of pixels a side; borders repeated.

    ``sums``: of columns, in double precision, so that adding and subtracting a value leaves no error.
    """
    rows, columns = values.shape
    half = window // 2
    scale = 1.0 / (window * window)
    for x in range(columns):
        sums[x] = 0.0
    for n in range(-half, half + 1):
        y = min(max(n, 0), rows - 1)
        for x in range(columns):
            sums[x] += values[y, x]
    for y in range(rows):
        total = 0.0
        for n in range(-half, half + 1):
            total += sums[min(max(n, 0), columns - 1)]
        for x in range(columns):
            out[y, x] = total * scale
            total += sums[min(x + half + 1, columns - 1)] - sums[max(x - half, 0)]
        if y + 1 < rows:
            to, gone = min(y + half + 1, rows - 1), max(y - half, 0)
            for x in range(columns):
                sums[x] += np.float64(values[to, x]) - values[gone, x]


@_with_memory
def _walk(before, cost, border, rise, jump, after):  # type: ignore[no-untyped-def]
    """Costs of paths one pixel further, relative to the least cost of the paths so far; all (planes,)."""
    planes = len(cost)
    least = before[0]
    for n in range(1, planes):
        least = min(least, before[n])
    most = least + max(jump / (np.float32(1) + border / np.float32(STEP_AT_BORDER)), np.float32(2) * rise)
    path = before[0]
    for n in range(planes):
        path = min(path + rise, before[n])
        after[n] = min(path, most)
    path = after[planes - 1]
    for n in range(planes - 1, -1, -1):
        path = min(path + rise, after[n])
        after[n] = path
    for n in range(planes):
        after[n] += cost[n] - least


@_with_memory
def _along_rows(costs, guide, rise, jump, sums, first, last):  # type: ignore[no-untyped-def]
    """Fill rows of the sums with the costs of paths from the left and from the right."""
    planes, _, columns = costs.shape
    cost = np.empty((columns, planes), np.float32)
    before, after = np.empty((2, planes), np.float32)
    for y in range(first, last):
        for n in range(planes):
            for x in range(columns):
                cost[x, n] = costs[n, y, x]
        before[:] = cost[0]
        sums[y, 0] = cost[0]
        for x in range(1, columns):
            _walk(before, cost[x], abs(guide[y, x] - guide[y, x - 1]), rise, jump, after)
            for n in range(planes):
                sums[y, x, n] = after[n]
                before[n] = after[n]
        before[:] = cost[columns - 1]
        sums[y, columns - 1] += cost[columns - 1]
        for x in range(columns - 2, -1, -1):
            _walk(before, cost[x], abs(guide[y, x] - guide[y, x + 1]), rise, jump, after)
            for n in range(planes):
                sums[y, x, n] += after[n]
                before[n] = after[n]


@_with_memory
def _along_columns(costs, guide, rise, jump, sums, first, last, best):  # type: ignore[no-untyped-def]
    """Add the costs of paths from above and from below to columns of the sums, and find the minimum."""
    planes, rows, _ = costs.shape
    width = last - first
    cost, before = np.empty((width, planes), np.float32), np.empty((width, planes), np.float32)
    after = np.empty(planes, np.float32)
    for turn in range(2):
        for step in range(rows):
            y = step if turn == 0 else rows - 1 - step
            for n in range(planes):
                for x in range(width):
                    cost[x, n] = costs[n, y, first + x]
            for x in range(width):
                if step == 0:
                    after[:] = cost[x]
                else:
                    border = abs(guide[y, first + x] - guide[y - 1 if turn == 0 else y + 1, first + x])
                    _walk(before[x], cost[x], border, rise, jump, after)
                total = sums[y, first + x]
                for n in range(planes):
                    total[n] += after[n]
                    before[x, n] = after[n]
                if turn == 1:
                    n, highest = 0, total[0]
                    for m in range(1, planes):
                        highest = max(highest, total[m])
                        n = m if total[m] < total[n] else n
                    alike = highest - total[n] < ALIKE
                    best[y, first + x] = planes // 2 if alike else n  # the middle plane, as far from both ends


@_compiled
def _mean_of_surface(disparity, weights, found, first, last):  # type: ignore[no-untyped-def]
    """Fill rows of `means_of_surfaces`."""
    rows, columns = disparity.shape
    for y in range(first, last):
        for x in range(columns):
            here, total, weight = disparity[y, x], np.float32(0), np.float32(0)
            for r in range(max(y - ON_SURFACE, 0), min(y + ON_SURFACE + 1, rows)):
                for c in range(max(x - ON_SURFACE, 0), min(x + ON_SURFACE + 1, columns)):
                    if abs(disparity[r, c] - here) < SAME_SURFACE:
                        total += weights[r, c] * (disparity[r, c] - here)
                        weight += weights[r, c]
            found[y, x] = here + total / weight if weights[y, x] > 0 else here
