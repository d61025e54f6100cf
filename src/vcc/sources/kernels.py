"""The compiled loop that computes a view from prefiltered textures."""

from __future__ import annotations

import numpy as np

from vcc.engines.compiled import fast_loop


@fast_loop
def draw_view(rasters, first, share, scale, top, out):  # type: ignore[no-untyped-def]
    """Draw a view: out[l, k, c], planes nearest first.

    rasters: (planes, rows, phases, 4, columns), red, green and blue multiplied by opacity, and opacity; column
        m of a plane is stored as phase m % phases at m // phases, so that a view reads contiguous numbers.
    first, share: position of pixel 0 in the raster, as a point and the weight of the next point: (planes, 2),
        along rows and columns.
    scale, top: a value v is stored as v · scale, clipped at top; rounded if out has integers (½ is added, the
        conversion truncates).
    """
    planes, _, phases, _, _ = rasters.shape
    rows, columns, _ = out.shape
    light = np.empty((4, columns), np.float32)  # red, green, blue, opacity of a plane
    line = np.empty((3, columns), np.float32)
    through = np.empty(columns, np.float32)
    rounding = np.float32(0.5) if top < np.inf else np.float32(0)
    one = np.float32(1)
    for l in range(rows):
        line[:] = 0
        through[:] = 1
        for p in range(planes):
            down, across = share[p, 0], share[p, 1]
            point = first[p, 0] + phases * l
            start_a, a = divmod(first[p, 1], phases)
            b, start_b = (a + 1, start_a) if a + 1 < phases else (0, start_a + 1)
            for c in range(4):
                above_a, below_a = rasters[p, point, a, c], rasters[p, point + 1, a, c]
                above_b, below_b = rasters[p, point, b, c], rasters[p, point + 1, b, c]
                for k in range(columns):
                    left = above_a[start_a + k] + down * (below_a[start_a + k] - above_a[start_a + k])
                    right = above_b[start_b + k] + down * (below_b[start_b + k] - above_b[start_b + k])
                    light[c, k] = left + across * (right - left)
            for c in range(3):
                for k in range(columns):
                    line[c, k] += through[k] * light[c, k]
            for k in range(columns):
                through[k] *= one - light[3, k]
        target = out[l]
        for k in range(columns):
            for c in range(3):
                target[k, c] = min(max(line[c, k], np.float32(0)) * scale + rounding, top)
