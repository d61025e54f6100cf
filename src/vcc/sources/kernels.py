"""The compiled loop that computes views from prefiltered textures."""

from __future__ import annotations

import numpy as np

from vcc.engines.compiled import fast_loop


@fast_loop
def views_of_row(rasters, down, across, row, scale, top, out):  # type: ignore[no-untyped-def]
    """Fill one row of views: out[i, l, k, c], planes nearest first.

    rasters: (planes, rows, phases, 4, columns), red, green and blue multiplied by opacity, and opacity; column
        m of a plane is stored as phase m % phases at m // phases, so that a view reads contiguous numbers.
    down, across: position of pixel 0 of each row and column of views in the raster, as (point, weight of the
        next point), shape (planes, views) each. row: row of views.
    scale, top: a value v is stored as v · scale, clipped at top; rounded if out has integers (½ is added, the
        conversion truncates).
    """
    planes, _, phases, _, width = rasters.shape
    (row_point, row_share), (column_point, column_share) = down, across
    views, rows, columns, _ = out.shape
    blended = np.empty((planes, phases, 4, width), np.float32)
    line = np.empty((3, columns), np.float32)
    through = np.empty(columns, np.float32)
    rounding = np.float32(0.5) if top < np.inf else np.float32(0)
    one = np.float32(1)
    for l in range(rows):
        for p in range(planes):
            w, first = row_share[p, row], row_point[p, row]
            above = rasters[p, first + phases * l].reshape(-1)
            below = rasters[p, first + phases * l + 1].reshape(-1)
            target = blended[p].reshape(-1)
            for x in range(target.size):
                target[x] = above[x] + w * (below[x] - above[x])
        for i in range(views):
            line[:] = 0
            through[:] = 1
            for p in range(planes):
                w = column_share[p, i]
                start_a, a = divmod(column_point[p, i], phases)
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
