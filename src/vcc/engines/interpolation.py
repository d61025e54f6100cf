"""Looking up a grid by quadratic B-splines (`vcc.base.lookup.three_around`), for compiled kernels.

Inlined before compiling: an array that is handed on has its references counted, by all threads at once.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import compiled

_inlined = compiled(inline="always")


@_inlined
def three_around(place):  # type: ignore[no-untyped-def]
    """The point nearest to a place, and what the one before it, it and the one after it count, float32."""
    middle = np.int64(math.floor(place + 0.5))
    off = np.float32(place - middle)
    half = np.float32(0.5)
    return (
        middle,
        half * (half - off) * (half - off),
        np.float32(0.75) - off * off,
        half * (half + off) * (half + off),
    )


@_inlined
def slopes_around(place):  # type: ignore[no-untyped-def]
    """By how much what three points around a place count grows with the place, float32.

    A point that counts nothing does not grow: so points outside the grid are known by what they count.
    """
    off, half = np.float32(place - np.floor(place + 0.5)), np.float32(0.5)
    return off - half, np.float32(-2) * off, off + half


@_inlined
def dark_outside(values, row, column):  # type: ignore[no-untyped-def]
    """An array (rows, columns) at a place between its points, with zeros around it."""
    rows, columns = values.shape
    total = np.float32(0)
    if -1.5 < row < rows + 0.5 and -1.5 < column < columns + 0.5:
        r, above, level, below = three_around(row)
        c, before, at, after = three_around(column)
        if 0 < r < rows - 1 and 0 < c < columns - 1:
            total = (
                above * (before * values[r - 1, c - 1] + at * values[r - 1, c] + after * values[r - 1, c + 1])
                + level * (before * values[r, c - 1] + at * values[r, c] + after * values[r, c + 1])
                + below * (before * values[r + 1, c - 1] + at * values[r + 1, c] + after * values[r + 1, c + 1])
            )
        else:
            for m, down in enumerate((above, level, below)):
                for n, across in enumerate((before, at, after)):
                    if 0 <= r + m - 1 < rows and 0 <= c + n - 1 < columns:
                        total += down * across * values[r + m - 1, c + n - 1]
    return total


# --- linearly between the points of a grid, for all compiled kernels but `ray_lookup.add_view` ---
#
# Inlined before compiling: an array that is handed on has its references counted, by all threads at once.


@_inlined
def around(place, size):  # type: ignore[no-untyped-def]
    """(first point, next point, way from the one to the other) of a place on points 0 … size − 1; ends go on."""
    place = min(max(place, 0.0), size - 1.0)
    first = min(int(place), max(size - 2, 0))
    return first, min(first + 1, size - 1), place - first


@_inlined
def bilinear(above, above_next, below, below_next, right, down):  # type: ignore[no-untyped-def]
    """What lies between four points, 0 … 1 of the way to the right and down."""
    upper = above * (1 - right) + above_next * right
    lower = below * (1 - right) + below_next * right
    return upper * (1 - down) + lower * down
