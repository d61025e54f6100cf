"""The step of a packet of rays through a lens known by a table of rays, and its derivative.

`vcc.optics.ray_map` defines both; the numbers of the step are those of `vcc.plan.rays.steps.MapRays`.
"""

from __future__ import annotations

import math

from vcc.engines.compiled import ray_back, ray_inner, ray_loop


@ray_inner
def within(a, f, table, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Whether a ray is within the opening, in the units of the map."""
    u = ax * ax + ay * ay
    if not u <= 1.0:
        return False
    away = math.sqrt(u)
    shift = f[4] + u * (f[5] + u * (f[6] + u * f[7]))
    px, py = bx - shift * ax, by - shift * ay
    far = math.sqrt(px * px + py * py)
    cosine = (ax * px + ay * py) / (away * far) if away * far > 0.0 else 0.0
    row = away * (a[1] - 1)
    column = (1.0 - min(max(cosine, -1.0), 1.0)) * 0.5 * (a[2] - 1)
    i, j = min(int(row), a[1] - 2), min(int(column), a[2] - 2)
    p, q, at = row - i, column - j, i * a[2] + j
    low = table[at] + q * (table[at + 1] - table[at])
    high = table[at + a[2]] + q * (table[at + a[2] + 1] - table[at + a[2]])
    return far <= low + p * (high - low)


@ray_loop
def through_map(a, f, table, n, x, y, s, t, share):  # type: ignore[no-untyped-def]
    """Step 15: map a packet; rays outside the opening get the share 0, on the axis."""
    order, start = a[0], a[1] * a[2]
    for p in range(n):
        ax, ay = s[p] / f[1], t[p] / f[1]
        bx, by = (x[p] + f[0] * s[p]) / f[2], (y[p] + f[0] * t[p]) / f[2]
        if not within(a, f, table, ax, ay, bx, by):
            x[p] = y[p] = s[p] = t[p] = share[p] = 0.0
            continue
        u, v, w = ax * ax + ay * ay, ax * bx + ay * by, bx * bx + by * by
        at, of_u = start, 1.0
        place_a = place_b = slope_a = slope_b = 0.0
        for i in range(order + 1):
            of_v = of_u
            for j in range(order + 1 - i):
                term = of_v
                for _ in range(order + 1 - i - j):
                    place_a += table[at] * term
                    place_b += table[at + 1] * term
                    slope_a += table[at + 2] * term
                    slope_b += table[at + 3] * term
                    term *= w
                    at += 4
                of_v *= v
            of_u *= u
        x[p], y[p] = place_a * ax + place_b * bx, place_a * ay + place_b * by
        s[p], t[p] = slope_a * ax + slope_b * bx, slope_a * ay + slope_b * by


@ray_back
def map_back(a, f, table, n, before, bar):  # type: ignore[no-untyped-def]
    """Turn cotangents behind a map into those before it, in place; see `vcc.optics.ray_map.RayMap.pulled`."""
    order, start = a[0], a[1] * a[2]
    for p in range(n):
        ax, ay = before[2, p] / f[1], before[3, p] / f[1]
        bx, by = (before[0, p] + f[0] * before[2, p]) / f[2], (before[1, p] + f[0] * before[3, p]) / f[2]
        if not within(a, f, table, ax, ay, bx, by):
            for q in range(5):
                bar[q, p] = 0.0
            continue
        u, v, w = ax * ax + ay * ay, ax * bx + ay * by, bx * bx + by * by
        # The weights of the four polynomials in the derivative to u, v and w.
        gx, gy, gs, gt = bar[0, p], bar[1, p], bar[2, p], bar[3, p]
        of = (gx * ax + gy * ay, gx * bx + gy * by, gs * ax + gt * ay, gs * bx + gt * by)
        values_a = values_b = values_c = values_d = by_u = by_v = by_w = 0.0
        at, pu, before_u = start, 1.0, 0.0
        for i in range(order + 1):
            pv, before_v = 1.0, 0.0
            for j in range(order + 1 - i):
                pw, before_w = 1.0, 0.0
                for k in range(order + 1 - i - j):
                    term = pu * pv * pw
                    values_a += table[at] * term
                    values_b += table[at + 1] * term
                    values_c += table[at + 2] * term
                    values_d += table[at + 3] * term
                    both = (
                        of[0] * table[at] + of[1] * table[at + 1] + of[2] * table[at + 2] + of[3] * table[at + 3]
                    )
                    by_u += i * both * before_u * pv * pw
                    by_v += j * both * pu * before_v * pw
                    by_w += k * both * pu * pv * before_w
                    before_w = pw
                    pw *= w
                    at += 4
                before_v = pv
                pv *= v
            before_u = pu
            pu *= u
        to_ax = values_a * gx + values_c * gs + 2.0 * by_u * ax + by_v * bx
        to_ay = values_a * gy + values_c * gt + 2.0 * by_u * ay + by_v * by
        to_bx = (values_b * gx + values_d * gs + by_v * ax + 2.0 * by_w * bx) / f[2]
        to_by = (values_b * gy + values_d * gt + by_v * ay + 2.0 * by_w * by) / f[2]
        bar[0, p], bar[1, p] = to_bx, to_by
        bar[2, p], bar[3, p] = to_ax / f[1] + f[0] * to_bx, to_ay / f[1] + f[0] * to_by
