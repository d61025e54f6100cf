"""The compiled loop that turns prefiltered textures into views."""

from __future__ import annotations

import numba
import numpy as np

_FAST = {"contract", "reassoc", "nsz"}
_compiled = numba.njit(nogil=True, cache=True, fastmath=_FAST, error_model="numpy")


@_compiled
def views_of_row(  # type: ignore[no-untyped-def]
    rasters, first_row, row_share, first_column, phase, column_share, scale, top, out
):
    """Fill one row of views: out[i, l, k, c], planes nearest first.

    rasters: (planes, rows, phases, 4, columns), opaque-weighted red, green, blue and opacity; raster column m
    of a plane is kept as phase m % phases at m // phases, so that a view reads contiguous numbers.
    first_row, row_share: (planes,), the raster row of pixel row 0 and the share of the row after it;
    first_column, phase, column_share: (planes, views), likewise for each view of the row.
    scale, top: a value v is stored as v · scale, cut at top; rounded where out holds integers (½ is added,
    the conversion truncates).
    """
    planes, _, phases, _, width = rasters.shape
    views, rows, columns, _ = out.shape
    blended = np.empty((planes, phases, 4, width), np.float32)
    line = np.empty((3, columns), np.float32)
    through = np.empty(columns, np.float32)
    rounding = np.float32(0.5) if top < np.inf else np.float32(0)
    one = np.float32(1)
    for l in range(rows):
        for p in range(planes):
            w = row_share[p]
            above = rasters[p, first_row[p] + phases * l].reshape(-1)
            below = rasters[p, first_row[p] + phases * l + 1].reshape(-1)
            target = blended[p].reshape(-1)
            for x in range(target.size):
                target[x] = above[x] + w * (below[x] - above[x])
        for i in range(views):
            line[:] = 0
            through[:] = 1
            for p in range(planes):
                w = column_share[p, i]
                a, start_a = phase[p, i], first_column[p, i]
                b, start_b = (a + 1, start_a) if a + 1 < phases else (0, start_a + 1)
                for c in range(3):
                    left, right, sums = blended[p, a, c], blended[p, b, c], line[c]
                    for k in range(columns):
                        value = left[start_a + k] + w * (right[start_b + k] - left[start_a + k])
                        sums[k] += through[k] * value
                left, right = blended[p, a, 3], blended[p, b, 3]
                for k in range(columns):
                    through[k] *= one - (left[start_a + k] + w * (right[start_b + k] - left[start_a + k]))
            target = out[i, l]
            for k in range(columns):
                for c in range(3):
                    target[k, c] = min(max(line[c, k], np.float32(0)) * scale + rounding, top)
