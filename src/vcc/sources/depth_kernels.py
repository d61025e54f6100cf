"""The compiled loops that draw surfaces over an image's pixels as seen by another pinhole."""

from __future__ import annotations

import numpy as np

from vcc.engines.compiled import compiled

_compiled = compiled()


@_compiled
def draw_surface(surface, pinhole, nearest, out):  # type: ignore[no-untyped-def]
    """Draw a surface of pixels into an image with a depth test.

    surface, pinhole: see `vcc.sources.depth_map`.
    nearest: (rows, columns) of the image, vergence of the visible surface, below 0 for none. out: colours.
    """
    quads, vergence, colour, cover = surface
    across, down, offset, scale, place = pinhole
    rows, columns = vergence.shape
    high, wide = nearest.shape
    channels = colour.shape[2]
    h = np.empty(4)
    g = np.empty(4)
    weight = np.empty(3)
    for r in range(rows - 1):
        for c in range(columns - 1):
            if not quads[r, c]:
                continue
            for n in range(4):
                w = vergence[r + n // 2, c + n % 2]
                h[n] = offset[0] + scale[0] * (across[c + n % 2] - place[0] * w)
                g[n] = offset[1] + scale[1] * (down[r + n // 2] - place[1] * w)
            first_column = max(int(np.ceil(h.min() - 1e-9)), 0)
            last_column = min(int(np.floor(h.max() + 1e-9)), wide - 1)
            first_row = max(int(np.ceil(g.min() - 1e-9)), 0)
            last_row = min(int(np.floor(g.max() + 1e-9)), high - 1)
            if first_column > last_column or first_row > last_row:
                continue
            for half in range(2):
                a, b, d = (0, 1, 2) if half == 0 else (3, 2, 1)
                area = (h[b] - h[a]) * (g[d] - g[a]) - (h[d] - h[a]) * (g[b] - g[a])
                if area <= 0:
                    continue  # seen from behind: hidden by a nearer surface
                for y in range(first_row, last_row + 1):
                    for x in range(first_column, last_column + 1):
                        weight[1] = ((x - h[a]) * (g[d] - g[a]) - (h[d] - h[a]) * (y - g[a])) / area
                        weight[2] = ((h[b] - h[a]) * (y - g[a]) - (x - h[a]) * (g[b] - g[a])) / area
                        weight[0] = 1 - weight[1] - weight[2]
                        # slightly larger than the triangle, so that no sample falls between two
                        if weight[0] < -1e-9 or weight[1] < -1e-9 or weight[2] < -1e-9:
                            continue
                        w = 0.0
                        covered = 0.0
                        for n in range(3):
                            corner = a if n == 0 else (b if n == 1 else d)
                            w += weight[n] * vergence[r + corner // 2, c + corner % 2]
                            covered += weight[n] * cover[r + corner // 2, c + corner % 2]
                        if covered < 0.5 or w <= nearest[y, x]:
                            continue
                        nearest[y, x] = w
                        for m in range(channels):
                            value = 0.0
                            for n in range(3):
                                corner = a if n == 0 else (b if n == 1 else d)
                                value += weight[n] * colour[r + corner // 2, c + corner % 2, m]
                            out[y, x, m] = value


@_compiled
def fill_gaps(nearest, out):  # type: ignore[no-untyped-def]
    """Fill empty samples from the nearest samples of their row, using the farther surface of the two sides.

    The last channel, the known fraction of a sample, becomes 0 there. Returns the number of empty rows.
    """
    high, wide = nearest.shape
    empty = 0
    for y in range(high):
        x = 0
        while x < wide:
            if nearest[y, x] >= 0:
                x += 1
                continue
            end = x
            while end < wide and nearest[y, end] < 0:
                end += 1
            if x == 0 and end == wide:
                empty += 1
                break
            from_left = end == wide or (x > 0 and nearest[y, x - 1] <= nearest[y, end])
            source = x - 1 if from_left else end
            for column in range(x, end):
                out[y, column] = out[y, source]
                out[y, column, -1] = 0
            x = end
    return empty
