"""The step of a packet of rays through one surface of a real lens, and its derivative.

`vcc.optics.refraction` defines both; the numbers of the step are those of `vcc.plan.rays.steps.Refract`.
"""

from __future__ import annotations

import math

from vcc.engines.compiled import ray_back, ray_inlined, ray_inner, ray_loop
from vcc.optics.refraction import NEWTON_STEPS


@ray_inlined
def through_sphere(f, n, x, y, s, t, share):  # type: ignore[no-untyped-def]
    """A sphere or plane with a hard edge: no branches, so that the loop vectorises."""
    distance, c, ratio, edge, passes = f[0], f[1], f[3], f[4] * f[4], f[6]
    for p in range(n):
        # Directions as long as (s, t, 1), so that no root is needed to make them units: `w` is their square.
        l, m = s[p], t[p]
        w = 1.0 + l * l + m * m
        x0, y0 = x[p] + distance * l, y[p] + distance * m
        g = 1.0 - c * (x0 * l + y0 * m)
        height = c * (x0 * x0 + y0 * y0)
        root = g * g - c * height * w
        arriving = math.sqrt(max(root, 0.0))
        pz = height / (g + arriving)
        px, py = x0 + pz * l, y0 + pz * m
        rest = w - ratio * ratio * (w - root)
        bend = math.sqrt(max(rest, 0.0)) - ratio * arriving
        per = 1.0 / (ratio - bend * (c * pz - 1.0))
        l, m = (ratio * l - bend * c * px) * per, (ratio * m - bend * c * py) * per
        lit = (root > 0.0) & (rest > 0.0) & (px * px + py * py <= edge)
        x[p] = px - l * pz if lit else 0.0
        y[p] = py - m * pz if lit else 0.0
        s[p] = l if lit else 0.0
        t[p] = m if lit else 0.0
        share[p] = share[p] * passes if lit else 0.0


@ray_inner
def sag_of(c, conic, a, f, square):  # type: ignore[no-untyped-def]
    """(z, ∂z/∂r², root of the conic) of a surface; ``a``: [.., number of aspheric coefficients]."""
    root = math.sqrt(max(1.0 - (1.0 + conic) * c * c * square, 0.0))
    sag, steep, power = c * square / (1.0 + root), 0.5 * c / root, square
    for n in range(a[1]):
        steep += (n + 2) * f[8 + n] * power
        power *= square
        sag += f[8 + n] * power
    return sag, steep, root


@ray_inner
def met_at(a, f, x, y, s, t):  # type: ignore[no-untyped-def]
    """(far, l, m, n) of a ray: how far along its direction (l, m, n) it meets the surface; NaN: it does not.

    x, y: in the plane of the vertex.
    """
    c, conic = f[1], f[2]
    n = 1.0 / math.sqrt(1.0 + s * s + t * t)
    l, m = s * n, t * n
    g = n - c * (x * l + y * m)
    height = c * (x * x + y * y)
    root = g * g - height * c * (1.0 + conic * n * n)
    if root <= 0.0:
        return math.nan, l, m, n
    far = height / (g + math.sqrt(root))
    if a[1] > 0:
        for _ in range(NEWTON_STEPS):
            square = (x + far * l) ** 2 + (y + far * m) ** 2
            sag, steep, _ = sag_of(c, conic, a, f, square)
            before = far
            far -= (far * n - sag) / (n - 2.0 * steep * (x * l + y * m + far * (l * l + m * m)))
            if far == before:
                break
    return far, l, m, n


@ray_inner
def share_of(a, f, square, arriving, leaving):  # type: ignore[no-untyped-def]
    """The share of light that passes at r² with these cosines."""
    share = f[6]
    if f[5] > 0.0:
        share *= min(max((f[4] - math.sqrt(square)) / f[5] + 0.5, 0.0), 1.0)
    elif square > f[4] * f[4]:
        share = 0.0
    if a[0] == 1:
        across = (f[3] * arriving - leaving) / (f[3] * arriving + leaving)
        along = (f[3] * leaving - arriving) / (f[3] * leaving + arriving)
        share *= 1.0 - 0.5 * (across * across + along * along)
    return share


@ray_inlined
def met_by(a, f, x, y, s, t):  # type: ignore[no-untyped-def]
    """Where a ray meets the surface, with the normal and the cosines there.

    Returns:
        (far, l, m, n) of `met_at`; the point; (r², 2·∂z/∂r², root of the conic); the normal; the cosines of the
        arriving and of the leaving ray, and the square of the latter, not above 0 for total reflection.
    """
    x, y = x + f[0] * s, y + f[0] * t
    far, l, m, along = met_at(a, f, x, y, s, t)
    px, py, pz = x + far * l, y + far * m, far * along
    square = px * px + py * py
    _, steep, root = sag_of(f[1], f[2], a, f, square)
    steep *= 2.0
    nz = 1.0 / math.sqrt(1.0 + steep * steep * square)
    nx, ny = -steep * px * nz, -steep * py * nz
    arriving = l * nx + m * ny + along * nz
    rest = 1.0 - f[3] * f[3] * (1.0 - arriving * arriving)
    leaving = math.sqrt(max(rest, 0.0))
    return (
        (far, l, m, along), (px, py, pz), (square, steep, root), (nx, ny, nz), (arriving, leaving, rest),
    )  # fmt: skip


@ray_loop
def through_surface(a, f, n, x, y, s, t, share):  # type: ignore[no-untyped-def]
    """Step 13: refract a packet by any surface; rays that do not pass get the share 0, on the axis."""
    if a[0] == 0 and a[1] == 0 and f[2] == 0.0 and f[5] == 0.0:
        through_sphere(f, n, x, y, s, t, share)
        return
    ratio = f[3]
    for p in range(n):
        direction, (px, py, pz), shape, (nx, ny, nz), cosines = met_by(a, f, x[p], y[p], s[p], t[p])
        (_, l, m, along), (square, _, _), (arriving, leaving, rest) = direction, shape, cosines
        bend = leaving - ratio * arriving
        on = ratio * along + bend * nz
        l, m = (ratio * l + bend * nx) / on, (ratio * m + bend * ny) / on
        passed = share_of(a, f, square, arriving, leaving)
        if passed > 0.0 and arriving > 0.0 and rest > 0.0 and abs(l) + abs(m) < math.inf:
            x[p], y[p], s[p], t[p] = px - l * pz, py - m * pz, l, m
            share[p] *= passed
        else:
            x[p] = y[p] = s[p] = t[p] = share[p] = 0.0


@ray_back
def surface_back(a, f, n, before, bar, own):  # type: ignore[no-untyped-def]
    """Turn cotangents behind a surface into those before it, in place; add gradients of its numbers to ``own``.

    ``own``: (distance, curvature, conic, ratio, radius, softness, transmission, -, aspheric coefficients …).
    See `vcc.plan.rays.refraction_backwards`, which this follows line by line.
    """
    c, conic, ratio = f[1], f[2], f[3]
    for p in range(n):
        s0, t0 = before[2, p], before[3, p]
        direction, (px, py, pz), shape, (nx, ny, nz), cosines = met_by(a, f, before[0, p], before[1, p], s0, t0)
        (far, l, m, along), (square, steep, root), (arriving, leaving, rest) = direction, shape, cosines
        passed = share_of(a, f, square, arriving, leaving)
        if not (passed > 0.0 and rest > 0.0 and arriving > 0.0):
            for q in range(5):
                bar[q, p] = 0.0
            continue
        bend = leaving - ratio * arriving
        on = ratio * along + bend * nz
        to_s, to_t = (ratio * l + bend * nx) / on, (ratio * m + bend * ny) / on
        # From the plane of the vertex to the point on the surface, and the direction behind it.
        gx, gy = bar[0, p], bar[1, p]
        gs, gt, gz = bar[2, p] - pz * gx, bar[3, p] - pz * gy, -to_s * gx - to_t * gy
        vx, vy, vz = gs / on, gt / on, -(to_s * gs + to_t * gt) / on
        g_bend = vx * nx + vy * ny + vz * nz
        g_nx, g_ny, g_nz = bend * vx, bend * vy, bend * vz
        g_ratio = vx * l + vy * m + vz * along - g_bend * arriving
        g_leaving, g_arriving = g_bend, -ratio * g_bend
        g_l, g_m, g_n = ratio * vx, ratio * vy, ratio * vz
        # The share of light.
        carried = bar[4, p] * before[4, p]
        bar[4, p] *= passed
        own[6] += carried * passed / f[6]
        if f[5] > 0.0:
            away = math.sqrt(square)
            inside = (f[4] - away) / f[5] + 0.5
            if inside < 1.0:
                of_inside = carried * passed / inside / f[5]
                own[4] += of_inside
                own[5] -= of_inside * (f[4] - away) / f[5]
                gx -= of_inside * px / away
                gy -= of_inside * py / away
        if a[0] == 1:
            sum_a, sum_b = ratio * arriving + leaving, ratio * leaving + arriving
            across, down = (ratio * arriving - leaving) / sum_a, (ratio * leaving - arriving) / sum_b
            of_fresnel = -carried * passed / (1.0 - 0.5 * (across * across + down * down))
            g_a, g_b = 2.0 * of_fresnel * across / (sum_a * sum_a), 2.0 * of_fresnel * down / (sum_b * sum_b)
            g_ratio += g_a * arriving * leaving + g_b * leaving * arriving
            g_arriving += g_a * ratio * leaving - g_b * ratio * leaving
            g_leaving += g_b * ratio * arriving - g_a * ratio * arriving
        g_ratio -= g_leaving * ratio * (1.0 - arriving * arriving) / leaving
        g_arriving += g_leaving * ratio * ratio * arriving / leaving
        g_l += g_arriving * nx
        g_m += g_arriving * ny
        g_n += g_arriving * nz
        g_nx += g_arriving * l
        g_ny += g_arriving * m
        g_nz += g_arriving * along
        # The normal, and the slope of the surface.
        radial = g_nx * nx + g_ny * ny + g_nz * nz
        g_nx, g_ny = nz * (g_nx - radial * nx), nz * (g_ny - radial * ny)
        g_steep = -px * g_nx - py * g_ny
        cube = root * root * root
        by_square = 0.5 * (1.0 + conic) * c * c * c / cube
        power = 1.0
        for k in range(a[1]):
            by_square += 2.0 * (k + 2) * (k + 1) * f[8 + k] * power
            power *= square
            own[8 + k] += g_steep * 2.0 * (k + 2) * power
        gx += -steep * g_nx + 2.0 * px * g_steep * by_square
        gy += -steep * g_ny + 2.0 * py * g_steep * by_square
        own[1] += g_steep / cube
        own[2] += g_steep * 0.5 * c * c * c * square / cube
        # The point on the surface.
        g_far = gx * l + gy * m + gz * along
        hit = -g_far / (along - steep * (px * l + py * m))
        zc = c * square / (1.0 + root)
        own[1] -= hit * 0.5 * (square + (1.0 + conic) * zc * zc) / root
        own[2] -= hit * 0.5 * c * zc * zc / root
        power = square
        for k in range(a[1]):
            power *= square
            own[8 + k] -= hit * power
        gx, gy, gz = gx - hit * steep * px, gy - hit * steep * py, gz + hit
        g_l, g_m, g_n = g_l + far * gx, g_m + far * gy, g_n + far * gz
        radial = g_l * l + g_m * m + g_n * along
        g_s, g_t = along * (g_l - l * radial), along * (g_m - m * radial)
        own[0] += gx * s0 + gy * t0
        own[3] += g_ratio
        bar[0, p], bar[1, p] = gx, gy
        bar[2, p], bar[3, p] = g_s + f[0] * gx, g_t + f[0] * gy
