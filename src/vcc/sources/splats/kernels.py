"""The compiled loops that draw Gaussian splats: projection to a view, and tiles blended front to back.

The projection linearises perspective at each centre (EWA splatting, Zwicker et al. 2001; Kerbl et al. 2023):
Σ' = J W Σ Wᵀ Jᵀ. All views of a planar array look in the same direction, so W Σ Wᵀ and the order of depth are the
same for all of them, and computed once.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import fast_loop

TILE = 16
"""Pixels a side of a tile. A row of a tile is one or two vectors of the processor."""
LANES = 8
LEAST_ALPHA = 1 / 255
"""A splat is not drawn where its opacity is lower: as in the code release of Kerbl et al. 2023."""
MOST_ALPHA = 0.99
"""Maximum opacity of a splat, likewise."""
DARK = 1e-4
"""Transmittance below which splats behind are not drawn."""
BEYOND = 0.15
"""Share of the width of a view, beyond each border, up to which perspective is linearised at a splat's place."""

RECORD = 15
"""Numbers of a projected splat: column, row, the inverse covariance (xx, xy, yy), opacity, logarithm of the least
share of it that is drawn, red, green, blue, depth, its slope along columns and rows, half width, half height."""


@fast_loop
def placed(positions, sizes, rotations, order, matrix, out):  # type: ignore[no-untyped-def]
    """Splats in the coordinates of the array, in order of depth.

    positions, sizes, rotations: see `Splats`. order: (splats,) indices. matrix: (4, 4), array from scene.
    out: (splats, 9) float64: x, y, depth = −z, and the covariance xx, xy, xd, yy, yd, dd.
    """
    m = np.empty((3, 3))
    a = np.empty((3, 3))
    for n in range(len(order)):
        i = order[n]
        w, x, y, z = rotations[i, 0], rotations[i, 1], rotations[i, 2], rotations[i, 3]
        m[0, 0], m[0, 1], m[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
        m[1, 0], m[1, 1], m[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
        m[2, 0], m[2, 1], m[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
        for r in range(3):
            sign = -1.0 if r == 2 else 1.0  # depth = −z
            place = matrix[r, 3]
            for c in range(3):
                place += matrix[r, c] * positions[i, c]
                a[r, c] = 0.0
                for k in range(3):
                    a[r, c] += matrix[r, k] * m[k, c]
                a[r, c] *= sign * sizes[i, c]
            out[n, r] = sign * place
        k = 3
        for r in range(3):
            for c in range(r, 3):
                out[n, k] = a[r, 0] * a[c, 0] + a[r, 1] * a[c, 1] + a[r, 2] * a[c, 2]
                k += 1


@fast_loop
def project(first, last, scene, view, low_pass, out, bounds):  # type: ignore[no-untyped-def]
    """Project splats first to last; a splat that is not drawn gets a last row before its first.

    scene: (placed (splats, 9), order, opacities, harmonics (splats, coefficients, 3), scene from array
        (3, 3), near).
    view: (x, y, left, top, columns per tangent, rows per tangent, columns, rows), see `ViewCamera`.
    low_pass: (variance added to both axes, square pixels; whether opacity is lowered so that the sum of a splat
        stays). out: (splats, RECORD) float32. bounds: (splats, 4) int16, first and last row and column of tiles.
    """
    geometry, order, opacities, harmonics, turn, near = scene
    x0, y0, left, top, fx, fy, columns, rows = view
    added, compensated = low_pass
    across, down = columns / fx, rows / fy
    coefficients = harmonics.shape[1]
    for n in range(first, last):
        bounds[n, 0], bounds[n, 1] = 0, -1
        depth = geometry[n, 2]
        if not depth > near:
            continue
        x, y = geometry[n, 0] - x0, geometry[n, 1] - y0
        a, b = x / depth, y / depth
        column, row = (a - left) * fx - 0.5, (b - top) * fy - 0.5
        a = min(max(a, left - BEYOND * across), left + (1 + BEYOND) * across)
        b = min(max(b, top - BEYOND * down), top + (1 + BEYOND) * down)
        sxx, sxy, sxd = geometry[n, 3], geometry[n, 4], geometry[n, 5]
        syy, syd, sdd = geometry[n, 6], geometry[n, 7], geometry[n, 8]
        p, q = fx / depth, fy / depth
        xd, yd = p * (sxd - a * sdd), q * (syd - b * sdd)
        xx = p * p * (sxx - a * (2 * sxd - a * sdd))
        yy = q * q * (syy - b * (2 * syd - b * sdd))
        xy = p * q * (sxy - a * syd - b * sxd + a * b * sdd)
        sharp = max(xx * yy - xy * xy, 0.0)
        xx += added
        yy += added
        area = xx * yy - xy * xy
        if not (area > 0 and area < math.inf):
            continue
        opacity = float(opacities[order[n]])
        if compensated:
            opacity *= math.sqrt(sharp / area)
        if not opacity >= LEAST_ALPHA:
            continue
        least = math.log(LEAST_ALPHA / opacity)
        half_width, half_height = math.sqrt(-2 * least * xx), math.sqrt(-2 * least * yy)
        above, below = max((row - half_height) / TILE, 0.0), min((row + half_height) / TILE, (rows - 1) / TILE)
        start, end = (
            max((column - half_width) / TILE, 0.0),
            min((column + half_width) / TILE, (columns - 1) / TILE),
        )
        if not (above <= below and start <= end):
            continue
        bounds[n, 0], bounds[n, 1], bounds[n, 2], bounds[n, 3] = int(above), int(below), int(start), int(end)
        record = out[n]
        record[0], record[1] = column, row
        record[2], record[3], record[4] = yy / area, -xy / area, xx / area
        record[5], record[6] = opacity, least
        record[10] = depth
        record[11], record[12] = (yy * xd - xy * yd) / area, (xx * yd - xy * xd) / area
        record[13], record[14] = half_width, half_height
        length = math.sqrt(x * x + y * y + depth * depth)
        u, v, w = x / length, y / length, -depth / length
        dx = turn[0, 0] * u + turn[0, 1] * v + turn[0, 2] * w
        dy = turn[1, 0] * u + turn[1, 1] * v + turn[1, 2] * w
        dz = turn[2, 0] * u + turn[2, 1] * v + turn[2, 2] * w
        colour(harmonics[order[n]], coefficients, dx, dy, dz, record)


@fast_loop
def colour(c, coefficients, x, y, z, record):  # type: ignore[no-untyped-def]
    """The colour of a splat seen along the unit vector (x, y, z): real spherical harmonics up to degree 3.

    Signs and order are those of Kerbl et al. 2023: degree 1 is −y, z, −x.
    """
    for k in range(3):
        value = 0.28209479177387814 * c[0, k]
        if coefficients > 1:
            value += 0.4886025119029199 * (-y * c[1, k] + z * c[2, k] - x * c[3, k])
        if coefficients > 4:
            value += 1.0925484305920792 * (x * y * c[4, k] - y * z * c[5, k] - x * z * c[7, k])
            value += 0.31539156525252005 * (2 * z * z - x * x - y * y) * c[6, k]
            value += 0.5462742152960396 * (x * x - y * y) * c[8, k]
        if coefficients > 9:
            value -= 0.5900435899266435 * (y * (3 * x * x - y * y) * c[9, k] + x * (x * x - 3 * y * y) * c[15, k])
            value += 2.890611442640554 * x * y * z * c[10, k]
            value -= 0.4570457994644658 * (4 * z * z - x * x - y * y) * (y * c[11, k] + x * c[13, k])
            value += 0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y) * c[12, k]
            value += 1.445305721320277 * z * (x * x - y * y) * c[14, k]
        record[7 + k] = max(value + 0.5, 0.0)


@fast_loop
def blend(first, last, records, bounds, background, image, depths, with_depth, ended):  # type: ignore[no-untyped-def]
    """Draw the rows of tiles first to last of an image.

    records, bounds: of `project`, in order of depth. background: (3,). image: (rows, columns, 4), red, green, blue
        and transmittance. depths: (rows, columns), depth at which the transmittance falls below ½, infinite if it
        does not; (0, 0) unless with_depth. ended: see `Workers`.
    """
    rows, columns = image.shape[:2]
    across = (columns + TILE - 1) // TILE
    tiles = (last - first) * across
    counts = np.zeros(tiles + 1, np.int64)
    for stage in range(2):
        if stage == 1:
            for tile in range(tiles):
                counts[tile + 1] += counts[tile]
            lists = np.empty(counts[tiles], np.int32)
            place = counts[:tiles].copy()
        for n in range(len(records)):
            above, below = max(bounds[n, 0], first), min(bounds[n, 1], last - 1)
            if above > below:
                continue
            start, end = bounds[n, 2], bounds[n, 3]
            for r in range(above - first, below - first + 1):
                for c in range(start, end + 1):
                    if stage == 0:
                        counts[r * across + c + 1] += 1
                    else:
                        lists[place[r * across + c]] = n
                        place[r * across + c] += 1
    light = np.empty((TILE, 4, TILE), np.float32)  # red, green, blue, transmittance
    median = np.empty((TILE, TILE), np.float32)
    alpha = np.empty(TILE, np.float32)
    for tile in range(tiles):
        if ended[0]:
            return
        y0, x0 = (first + tile // across) * TILE, tile % across * TILE
        light[:, :3] = 0
        light[:, 3] = 1
        median[:] = np.inf
        for k in range(counts[tile], counts[tile + 1]):
            s = records[lists[k]]
            draw(s, x0, y0, light, median, alpha, with_depth)
            if (k - counts[tile]) % 16 == 15 and light[:, 3].max() < DARK:
                break
        for y in range(min(TILE, rows - y0)):
            for x in range(min(TILE, columns - x0)):
                through = light[y, 3, x]
                for c in range(3):
                    image[y0 + y, x0 + x, c] = light[y, c, x] + through * background[c]
                image[y0 + y, x0 + x, 3] = through
                if with_depth:
                    depths[y0 + y, x0 + x] = median[y, x]


@fast_loop
def draw(s, x0, y0, light, median, alpha, with_depth):  # type: ignore[no-untyped-def]
    """Blend one splat into a tile whose first pixel is (y0, x0)."""
    column, row = s[0] - np.float32(x0), s[1] - np.float32(y0)
    xx, xy, yy = s[2], s[3], s[4]
    opacity, least = s[5], s[6]
    red, green, blue = s[7], s[8], s[9]
    top = max(math.ceil(row - s[14]), 0)
    bottom = min(math.floor(row + s[14]), TILE - 1)
    start = max(math.ceil(column - s[13]), 0) // LANES * LANES
    end = min(math.floor(column + s[13]), TILE - 1) + 1
    half, one, most = np.float32(0.5), np.float32(1), np.float32(MOST_ALPHA)
    for y in range(top, bottom + 1):
        dy = np.float32(y) - row
        line = light[y]
        level, slant = -half * yy * dy * dy, xy * dy
        for x8 in range(start, end, LANES):
            for x in range(x8, x8 + LANES):
                dx = np.float32(x) - column
                power = level - dx * (half * xx * dx + slant)
                a = min(opacity * small_exp(max(power, np.float32(-6))), most)
                alpha[x] = a if power >= least else np.float32(0)
            if with_depth:
                for x in range(x8, x8 + LANES):
                    through = line[3, x]
                    if through > half and through * (one - alpha[x]) <= half:
                        depth = s[10] + s[11] * (np.float32(x) - column) + s[12] * dy
                        median[y, x] = min(max(depth, half * s[10]), s[10] / half)
            for x in range(x8, x8 + LANES):
                through = line[3, x]
                share = through * alpha[x]
                line[0, x] += share * red
                line[1, x] += share * green
                line[2, x] += share * blue
                line[3, x] = through - share


@fast_loop
def small_exp(x):  # type: ignore[no-untyped-def]
    """exp(x) for −6 ≤ x ≤ 0 with a relative error below 2e-6, without branches, so that it runs in vectors.

    exp(x/8) by its Chebyshev interpolant of degree 6, squared three times.
    """
    t = x * np.float32(0.125)
    p = np.float32(0.0009587715030647814)
    p = p * t + np.float32(0.007918287999927998)
    p = p * t + np.float32(0.04146113991737366)
    p = p * t + np.float32(0.16661366820335388)
    p = p * t + np.float32(0.4999934434890747)
    p = p * t + np.float32(0.9999997019767761)
    p = p * t + np.float32(1.0)
    p *= p
    p *= p
    return p * p
