"""Interpolate a grid by quadratic B-splines (`vcc.base.lookup.three_around`), for compiled kernels.

The functions are inlined before compiling: references to array arguments would be counted, by all threads at
once.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import compiled

_inlined = compiled(inline="always")


@_inlined
def three_around(place):  # type: ignore[no-untyped-def]
    """The point nearest to a place, and the weights of the points before, at and after it, float32."""
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
    """Derivatives to the place of the weights of the three points around it, float32.

    Callers set derivatives to zero for points outside the grid, whose weight is zero.
    """
    off, half = np.float32(place - np.floor(place + 0.5)), np.float32(0.5)
    return off - half, np.float32(-2) * off, off + half


@_inlined
def dark_outside(values, row, column):  # type: ignore[no-untyped-def]
    """An array (rows, columns) interpolated at a place between its points, zero around the array."""
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


# --- linear interpolation between points of a grid, for all compiled kernels but `ray_lookup.add_view` ---
#
# Inlined before compiling: references to array arguments would be counted, by all threads at once.


@_inlined
def around(place, size):  # type: ignore[no-untyped-def]
    """(first point, next point, fraction between them) of a place on points 0 … size − 1; clamped to the ends."""
    place = min(max(place, 0.0), size - 1.0)
    first = min(int(place), max(size - 2, 0))
    return first, min(first + 1, size - 1), place - first


@_inlined
def bilinear(above, above_next, below, below_next, right, down):  # type: ignore[no-untyped-def]
    """The value between four points, at fractions 0 … 1 to the right and down."""
    upper = above * (1 - right) + above_next * right
    lower = below * (1 - right) + below_next * right
    return upper * (1 - down) + lower * down
