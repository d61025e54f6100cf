"""Costs of a plane sweep, by compiled loops; see `vcc.fields.plane_sweep`.

Several threads try planes at once. One thread computes each plane's cost, so that the result does not depend on
the number of threads.
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

_compiled = compiled(borrowing=True, fastmath={"contract", "nsz", "reassoc"})
TRUNCATION = 0.02
"""Of full scale, on the square-root scale: a difference that is no match, whatever its size."""
CONTRAST = 0.02
"""Of full scale, likewise: contrast from which on the guide shows a border."""
AROUND = 3
"""Pixels a side over which differences are averaged before the better half of the views is chosen."""


def costs(
    cross: Sequence[tuple[Arm, Array]],
    tried: Sequence[NDArray[np.float64]],
    guide: Array,
    window: int,
    progress: Progress | None = None,
) -> Array:
    """How much views disagree with the middle one, gathered over a window that follows borders, (planes, t, s).

    Args:
        cross: rows of views, each with its middle view (levels, channels, t, s) as soft as interpolation by
            fractions of a pixel 0 … ½ makes it.
        tried: disparities along each row of views, pixels per view.
        guide: the middle view, (t, s), of which the window follows the borders.
        window: its side, pixels, an odd number.
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
            total += _disagreement(arm, soft, float(along[n]))
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


def _disagreement(arm: Arm, soft: Array, disparity: float) -> Array:
    """How much the better half of a row of views differs from its middle one at a disparity, (t, s)."""
    views, middle = arm.views, arm.middle
    best = np.full(views.shape[2:], np.inf, np.float32)
    around, sums = np.empty_like(best), np.empty(views.shape[-1])
    for side in (range(middle), range(middle + 1, len(views))):
        if not side:
            continue
        total = np.zeros_like(best)
        for n in side:
            shift = -disparity * (n - middle)
            whole = math.floor(shift)
            weights = np.array(cubic_weights(shift - whole), np.float32)
            # Interpolation softens noise, most so between pixels: unless the middle view is as soft, disparities
            # that fall there seem to fit better.
            alike = soft[round(2 * (len(soft) - 1) * abs(shift - round(shift)))]
            _add_difference(views[n], alike, whole, weights, arm.axis == 2, total)
        total /= np.float32(len(side) * views.shape[1])
        _box(total, AROUND, around, sums)
        np.minimum(best, around, out=best)
    return best


@_compiled
def _add_difference(view, alike, whole, weights, across, total):  # type: ignore[no-untyped-def]
    """Add |view read so many pixels further on − alike|, truncated, over channels."""
    channels, rows, columns = view.shape
    w0, w1, w2, w3 = weights[0], weights[1], weights[2], weights[3]
    most = np.float32(TRUNCATION)
    for y in range(rows):
        for c in range(channels):
            if across:
                first = min(max(1 - whole, 0), columns)
                last = max(min(columns - whole - 2, columns), first)
                for n in range(columns - (last - first)):  # beyond the view's borders, these go on
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

    ``sums``: of columns, double, so that what is added and taken away again leaves nothing.
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
