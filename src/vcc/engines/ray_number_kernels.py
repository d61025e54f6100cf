"""The compiled kernel that takes packets of rays back along their way, and adds up what they say of numbers.

A packet is traced as `vcc.engines.ray_kernels` does, and what its rays were before each step is kept. What they
find in the light field, times the weights of their pixel, gives cotangents of their shares and places; these go
back step by step, and each step adds up what they say of its numbers. The derivatives are those of
`vcc.plan.rays.backwards` and `vcc.plan.rays.aim_backwards`, which explain them. Rays that a hard edge stops say
nothing; those that a mask weighs with zero do.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import compiled
from vcc.engines.interpolation import around
from vcc.engines.ray_kernels import (
    DIGITS_BELOW,
    PACKET,
    aim_rays,
    cell_of,
    cells_at,
    corner,
    dark_from,
    first_point,
    kind_of,
    may_find_light,
    middle_of,
    mixed,
    room,
    take_steps,
    to_indices,
    turn_to,
    unit,
    views_of_ray,
)
from vcc.engines.ray_tables import Drawn, Packet, Steps

_compiled = compiled(borrowing=True, fastmath={"contract", "nsz", "reassoc"})
_inlined = compiled(borrowing=True, fastmath={"contract", "nsz", "reassoc"}, inline="always")
_allocating = compiled(fastmath={"contract", "nsz", "reassoc"})


@_inlined
def packet_of(numbers):  # type: ignore[no-untyped-def]
    """Rays by name, of numbers (5, rays)."""
    return Packet(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4])


@_compiled
def step_on(steps, number, drawn, before, behind, lit):  # type: ignore[no-untyped-def]
    """Take a packet (5, rays) through one step; ``lit`` becomes 0 for rays that a hard edge stops."""
    codes, whole, real, shares, slopes = steps
    n, code, a, f = drawn.rays, codes[number], whole[number], real[number]
    for q in range(5):
        for p in range(n):
            behind[q, p] = before[q, p]
    # Told apart from a share of zero by a share of one.
    hole = code == 3 or code == 11 or code == 6 or code == 7
    if hole:
        for p in range(n):
            behind[4, p] = 1.0
    elif code == 8:
        for p in range(n):
            column, row = math.floor((before[0, p] - f[0]) * f[2]), math.floor((before[1, p] - f[1]) * f[3])
            lit[p] *= (column >= 0) & (column < a[1]) & (row >= 0) & (row < a[0])
    one = Steps(codes[number : number + 1], whole[number : number + 1], real[number : number + 1], shares, slopes)
    take_steps(one, drawn, packet_of(behind))
    if hole:
        for p in range(n):
            lit[p] *= behind[4, p]
            behind[4, p] *= before[4, p]


@_compiled
def moved_back(m, n, before, bar, own):  # type: ignore[no-untyped-def]
    """Cotangents of places and slopes back through an affine map, 4×5; of its own they are added to ``own``."""
    for q in range(4):
        s0 = s1 = s2 = s3 = s4 = 0.0
        for p in range(n):
            g = bar[q, p]
            s0 += g * before[0, p]
            s1 += g * before[1, p]
            s2 += g * before[2, p]
            s3 += g * before[3, p]
            s4 += g
        at = 5 * q
        own[at] += s0
        own[at + 1] += s1
        own[at + 2] += s2
        own[at + 3] += s3
        own[at + 4] += s4
    for p in range(n):
        x, y, s, t = bar[0, p], bar[1, p], bar[2, p], bar[3, p]
        bar[0, p] = m[0] * x + m[5] * y + m[10] * s + m[15] * t
        bar[1, p] = m[1] * x + m[6] * y + m[11] * s + m[16] * t
        bar[2, p] = m[2] * x + m[7] * y + m[12] * s + m[17] * t
        bar[3, p] = m[3] * x + m[8] * y + m[13] * s + m[18] * t


@_compiled
def texture_back(table, sizes, real, rays, values, out, own):  # type: ignore[no-untyped-def]
    """What numbers that a packet looks up in a texture say of its places, and, added up, of the texture.

    Args:
        table: of all textures.
        sizes: (rays, rows, columns, start in the table, numbers a point).
        real: see `vcc.plan.rays.steps.Texture.real`.
        rays: (x, y, cotangents of x, of y), to the latter of which is added.
        values: cotangents of the numbers found, (numbers a point or fewer, rays).
        out: like the table, or empty.
        own: four sums: of start and spacing, but for factors.
    """
    n, rows, columns, start, width = sizes
    x, y, gx, gy = rays
    s0 = s1 = s2 = s3 = 0.0
    for p in range(n):
        across, below = (x[p] - real[0]) * real[2], (y[p] - real[1]) * real[3]
        c, c1, right = around(across, columns)
        r, r1, down = around(below, rows)
        p00, p01 = start + (r * columns + c) * width, start + (r * columns + c1) * width
        p10, p11 = start + (r1 * columns + c) * width, start + (r1 * columns + c1) * width
        to_x = to_y = 0.0
        for number in range(len(values)):
            value = values[number, p]
            upper, upper_next = table[p00 + number], table[p01 + number]
            lower, lower_next = table[p10 + number], table[p11 + number]
            to_x += value * ((upper_next - upper) * (1.0 - down) + (lower_next - lower) * down)
            to_y += value * ((lower - upper) * (1.0 - right) + (lower_next - upper_next) * right)
            if len(out) > 0:
                out[p00 + number] += value * (1.0 - down) * (1.0 - right)
                out[p01 + number] += value * (1.0 - down) * right
                out[p10 + number] += value * down * (1.0 - right)
                out[p11 + number] += value * down * right
        # Beyond its ends a texture is even.
        to_x = to_x * real[2] if across >= 0.0 and across <= columns - 1.0 else 0.0
        to_y = to_y * real[3] if below >= 0.0 and below <= rows - 1.0 else 0.0
        gx[p] += to_x
        gy[p] += to_y
        s0 += to_x
        s1 += to_y
        s2 += to_x * across
        s3 += to_y * below
    own[0] += s0
    own[1] += s1
    own[2] += s2
    own[3] += s3


@_compiled
def step_back(steps, number, drawn, before, bar, found, sums):  # type: ignore[no-untyped-def]
    """Cotangents ``bar`` (5, rays) of a packet behind a step become those before it.

    ``sums``: (steps, matrices, shares, slopes, points) of `vcc.engines.ray_tables.Told`, to which is added what
    they say of the step's numbers. ``found``: room for two numbers a ray.
    """
    codes, whole, real, shares, slopes = steps
    points, first, n, _ = drawn
    of_steps, matrices, out_shares, out_slopes, out_points = sums
    code, a, f, own = codes[number], whole[number], real[number], of_steps[number]
    x, y, share = before[0], before[1], before[4]
    gx, gy, gs, gt, gw = bar[0], bar[1], bar[2], bar[3], bar[4]
    if code == 0 or code == 1:
        moved_back(matrices[number], n, before, bar, own)
    elif code == 2:
        s0 = s1 = s2 = s3 = 0.0
        for p in range(n):
            row, column, centre_x, centre_y = cell_of(a[0], f, x[p], y[p])
            at = a[3] + ((row % a[1]) * a[2] + column % a[2]) * 3
            across, down = slopes[at] * gs[p], slopes[at] * gt[p]
            if len(out_slopes) > 0:
                out_slopes[at] += gs[p] * (x[p] - centre_x) + gt[p] * (y[p] - centre_y)
                out_slopes[at + 1] -= gs[p]
                out_slopes[at + 2] -= gt[p]
            gx[p] += across
            gy[p] += down
            centre_x, centre_y = centre_x - f[2], centre_y - f[3]
            s0 -= across * centre_x + down * centre_y
            s1 -= down * centre_x - across * centre_y
            s2 -= across
            s3 -= down
        own[0] += s0
        own[1] += s1
        own[2] += s2
        own[3] += s3
    elif code == 4:
        for p in range(n):
            dx, dy = x[p] - f[0], y[p] - f[1]
            best, at = -np.inf, a[1]
            for facet in range(a[0]):
                outward = dx * slopes[a[1] + 4 * facet] + dy * slopes[a[1] + 4 * facet + 1]
                if outward > best:
                    best, at = outward, a[1] + 4 * facet
            if len(out_slopes) > 0:
                out_slopes[at + 2] -= gs[p]
                out_slopes[at + 3] -= gt[p]
    elif code == 5:
        for p in range(n):
            found[0, p], found[1, p] = -gs[p], -gt[p]
        texture_back(slopes, (n, a[0], a[1], a[2], 2), f, (x, y, gx, gy), found, out_slopes, own)
    elif code == 8:
        for p in range(n):
            column, row = math.floor((x[p] - f[0]) * f[2]), math.floor((y[p] - f[1]) * f[3])
            c, r = int(min(max(column, 0), a[1] - 1)), int(min(max(row, 0), a[0] - 1))
            at = a[2] + r * a[1] + c
            if len(out_shares) > 0:
                out_shares[at] += gw[p] * share[p]  # of rays beside all cells gw is 0
            gw[p] *= shares[at]
    elif code == 9:
        for p in range(n):
            found[0, p] = gw[p] * share[p]
            gw[p] *= mixed(shares, a[2], 1, 0, corner(x[p], y[p], a[0], a[1], f))
        texture_back(shares, (n, a[0], a[1], a[2], 1), f, (x, y, gx, gy), found[:1], out_shares, own)
    elif code == 12:
        for p in range(n):
            cosines_x, steep_x = cosines(f[2], f[0], f[4], a[0], x[p])
            cosines_y, steep_y = cosines(f[3], f[1], f[4], a[0], y[p])
            turned_x, turned_y = gw[p] * share[p] * steep_x * cosines_y, gw[p] * share[p] * cosines_x * steep_y
            own[0] += turned_x
            own[1] += turned_y
            own[2] += turned_x * (x[p] - f[0])
            own[3] += turned_y * (y[p] - f[1])
            gx[p] += f[2] * turned_x
            gy[p] += f[3] * turned_y
            gw[p] *= cosines_x * cosines_y
    elif code == 10:
        for p in range(n):
            kernel = 0
            if a[3] > 0:
                at = corner(x[p], y[p], a[3], a[4], f)
                picked = points[a[2], first + p]
                while kernel < a[1] - 1 and picked >= mixed(shares, a[5], a[1], kernel, at):
                    kernel += 1
            column = a[0] + 2 * kernel
            stretch = 1.0
            if a[6] > 0:
                stretch = mixed(shares, a[8], 1, 0, corner(x[p], y[p], a[6], a[7], f[4:]))
            found[0, p] = -(gs[p] * points[column, first + p] + gt[p] * points[column + 1, first + p])
            if len(out_points) > 0:
                out_points[column, first + p] -= stretch * gs[p]
                out_points[column + 1, first + p] -= stretch * gt[p]
        if a[6] > 0:
            texture_back(shares, (n, a[6], a[7], a[8], 1), f[4:], (x, y, gx, gy), found[:1], out_shares, own)


@_compiled
def cosines(frequency, middle, phase, harmonics, place):  # type: ignore[no-untyped-def]
    """(½ + Σ cos(nθ)/2h, its derivative to θ) of a mask of cosines along one axis; (1, 0) along one without."""
    if not frequency > 0.0:
        return 1.0, 0.0
    angle = frequency * (place - middle) + phase
    cosine, sine = math.cos(angle), math.sin(angle)
    before_c, now_c, before_s, now_s = 1.0, cosine, 0.0, sine
    total, steep = now_c, now_s
    for n in range(2, harmonics + 1):
        before_c, now_c = now_c, 2 * cosine * now_c - before_c
        before_s, now_s = now_s, 2 * cosine * now_s - before_s
        total += now_c
        steep += n * now_s
    return 0.5 + total / (2 * harmonics), -steep / (2 * harmonics)


@_compiled
def window_back(drawn, window, rays, bar, own, of_scatter, out_points):  # type: ignore[no-untyped-def]
    """What slopes and weights of rays through a window say of places, of what was drawn, and of its numbers."""
    points, start, n, flipped = drawn
    _, from_sensor, _, _, disc, scatter = window
    turn = 2.0 * math.pi * DIGITS_BELOW * flipped[2]
    cosine, sine = math.cos(turn), math.sin(turn)
    across, down = np.int32(flipped[2]), np.int32(flipped[3])
    for q in range(2):
        s0 = s1 = s2 = s3 = s4 = 0.0
        for p in range(n):
            g = bar[2 + q, p]
            a, b = np.float64(points[2, start + p]), np.float64(points[3, start + p])
            if disc:
                a, b = cosine * a - sine * b, sine * a + cosine * b
            else:
                a, b = 2.0 * unit(points[2, start + p], across) - 1.0, 2.0 * unit(points[3, start + p], down) - 1.0
            s0 += g * a
            s1 += g * b
            s2 += g * rays[0, p]
            s3 += g * rays[1, p]
            s4 += g
        own[5 * q] += s0
        own[5 * q + 1] += s1
        own[5 * q + 2] += s2
        own[5 * q + 3] += s3
        own[5 * q + 4] += s4
    weight = 0.0
    for p in range(n):
        weight += bar[4, p]
        bar[0, p] += from_sensor[0, 0] * bar[2, p] + from_sensor[1, 0] * bar[3, p]
        bar[1, p] += from_sensor[0, 1] * bar[2, p] + from_sensor[1, 1] * bar[3, p]
    own[10] += weight
    for term in range(len(scatter)):
        column = int(scatter[term, 0])
        f0, f1, g0, g1 = scatter[term, 1], scatter[term, 2], scatter[term, 3], scatter[term, 4]
        for p in range(n):
            s, t = bar[2, p], bar[3, p]
            a, b = points[column, start + p], points[column + 1, start + p]
            of_scatter[term, 0] += s * a
            of_scatter[term, 1] += s * b
            of_scatter[term, 2] += t * a
            of_scatter[term, 3] += t * b
            if len(out_points) > 0:
                out_points[column, start + p] += f0 * s + g0 * t
                out_points[column + 1, start + p] += f1 * s + g1 * t


@_compiled
def cell_back(drawn, images, cells, cell, rays, bar, of_cells):  # type: ignore[no-untyped-def]
    """What slopes and weights of rays through a cell say of places, of the stop's image there and of the cell.

    Line by line what `vcc.plan.rays.aim_backwards` says of `CellWindows.aimed`. Sums: of cotangents of an image's
    middle, of these times the place, of its half size, of the cell's centre. ``of_cells``: (cells, kinds, borders)
    of `vcc.engines.ray_tables.Told`, and room for the sums, (2, 4).
    """
    points, start, n, flipped = drawn
    middle, along, half, centre, reach = images[0, 0], images[0, 1], images[0, 2], images[0, 3], images[0, 4]
    middle_y, along_y, half_y, centre_y = images[1, 0], images[1, 1], images[1, 2], images[1, 3]
    radius, borders, disc = cells.opening_radius, cells.borders, cells.disc
    across, down = np.int32(flipped[2]), np.int32(flipped[3])
    per_x, per_y = 1 / cells.place_from_slope[0], 1 / cells.place_from_slope[1]
    per_area = abs(per_x * per_y)
    from_x, from_y = cells.place_from_sensor
    own, kinds, of_borders, sums = of_cells
    s0 = s1 = s2 = s8 = s9 = s10 = s18 = x0 = x1 = x2 = x3 = y0 = y1 = y2 = y3 = 0.0
    for p in range(n):
        x, y = rays[0, p], rays[1, p]
        if rays[4, p] == 0.0:
            continue
        image, image_y = middle + along * x, middle_y + along_y * y
        low, high = max(image - half, centre - reach), min(image + half, centre + reach)
        wide, u = high - low, unit(points[2, start + p], across)
        a = low + wide * u
        off = (a - image) / half
        root = math.sqrt(max(1.0 - off * off, 0.0)) if disc else 1.0
        away = a - centre
        # 0: the image's end; −1: the round opening's; else a strip's.
        top, bottom, by_top, by_bottom = image_y - half_y * root, image_y + half_y * root, 0, 0
        for strip in range(len(borders)):
            border, tall = centre_y + borders[strip, 0] * away, borders[strip, 1]
            if border - tall > top:
                top, by_top = border - tall, strip + 1
            if border + tall < bottom:
                bottom, by_bottom = border + tall, strip + 1
        chord = 0.0
        if radius < np.inf:
            chord = math.sqrt(max(radius * radius - away * away, 0.0))
            if centre_y - chord > top:
                top, by_top = centre_y - chord, -1
            if centre_y + chord < bottom:
                bottom, by_bottom = centre_y + chord, -1
        tall, v = bottom - top, unit(points[3, start + p], down)
        a_bar, b_bar, area_bar = bar[2, p] * per_x, bar[3, p] * per_y, bar[4, p] * per_area
        s0 -= x * a_bar
        s8 -= y * b_bar
        s1 -= rays[2, p] * a_bar + rays[4, p] * bar[4, p] * per_x
        s9 -= rays[3, p] * b_bar + rays[4, p] * bar[4, p] * per_y
        s2 -= a_bar
        s10 -= b_bar
        bar[0, p] -= from_x * a_bar
        bar[1, p] -= from_y * b_bar
        bottom_bar = area_bar * wide + b_bar * v
        top_bar = b_bar - bottom_bar
        image_bar = chord_bar = cell_bar = away_bar = 0.0
        for side in range(2):
            by, end_bar, sign = (by_top, top_bar, -1.0) if side == 0 else (by_bottom, bottom_bar, 1.0)
            if by == 0:
                image_bar += end_bar
                chord_bar += sign * end_bar
            elif by > 0:
                cell_bar += end_bar
                away_bar += borders[by - 1, 0] * end_bar
                of_borders[by - 1, 0] += away * end_bar
                of_borders[by - 1, 1] += sign * end_bar
            else:
                cell_bar += end_bar
                if chord > 0.0:
                    away_bar -= away / chord * sign * end_bar
                    own[19] += radius / chord * sign * end_bar
        y0 += image_bar
        y1 += image_bar * y
        y2 += chord_bar * root
        y3 += cell_bar
        bar[1, p] += image_bar * along_y
        off_bar = 0.0
        if disc and root > 0.0:
            off_bar = -chord_bar * half_y * off / root / half
        a_bar += off_bar + away_bar
        right_bar = area_bar * tall + a_bar * u
        left_bar = a_bar - right_bar
        image_bar, half_bar, cell_bar = -off_bar, -off_bar * off, -away_bar
        if image - half >= centre - reach:
            image_bar += left_bar
            half_bar -= left_bar
        else:
            cell_bar += left_bar
            s18 -= left_bar
        if image + half <= centre + reach:
            image_bar += right_bar
            half_bar += right_bar
        else:
            cell_bar += right_bar
            s18 += right_bar
        x0 += image_bar
        x1 += image_bar * x
        x2 += half_bar
        x3 += cell_bar
        bar[0, p] += image_bar * along
    own[0] += s0
    own[1] += s1
    own[2] += s2
    own[8] += s8
    own[9] += s9
    own[10] += s10
    own[18] += s18
    sums[0, 0], sums[0, 1], sums[0, 2], sums[0, 3] = x0, x1, x2, x3
    sums[1, 0], sums[1, 1], sums[1, 2], sums[1, 3] = y0, y1, y2, y3
    image_back(images, cells, cell, sums, own, kinds)


@_compiled
def image_back(images, cells, cell, sums, own, kinds):  # type: ignore[no-untyped-def]
    """What the sums of `cell_back` say of the numbers by which `set_image` finds a cell's image."""
    power, slope_x, slope_y = kind_of(cells.kinds, cell[0], cell[1])
    kind = kinds[cell[0] % kinds.shape[0], cell[1] % kinds.shape[1]]
    for axis in range(2):
        slope = slope_x if axis == 0 else slope_y
        from_slope, centre = cells.beyond_from_slope[axis], images[axis, 3]
        gain = cells.beyond[axis] + power * from_slope
        kept = abs(gain) >= 1e-12
        if not kept:
            gain = 1e-12
        middle_bar, of_place, half_bar = sums[axis, 0], sums[axis, 1], sums[axis, 2]
        both = middle_bar * images[axis, 0] + of_place * images[axis, 1] + half_bar * images[axis, 2]
        gain_bar = -both / gain if kept else 0.0
        per_gain = middle_bar / gain
        at = 8 * axis
        own[at + 3] += gain_bar
        own[at + 4] -= of_place / gain
        own[at + 5] += gain_bar * power + per_gain * (power * centre + slope)
        own[at + 6] -= per_gain
        own[at + 7] += per_gain
        own[16 + axis] += half_bar / abs(gain)
        kind[0] += from_slope * (gain_bar + per_gain * centre)
        kind[1 + axis] += from_slope * per_gain
        sums[axis, 3] += from_slope * power * per_gain
    x, y = images[0, 3] - cells.turn[2], images[1, 3] - cells.turn[3]
    own[20] += sums[0, 3] * x + sums[1, 3] * y
    own[21] += sums[1, 3] * x - sums[0, 3] * y
    own[22] += sums[0, 3]
    own[23] += sums[1, 3]


@_compiled
def field_back(field, weights, n, index, lit, bar, to_motion, to_scale):  # type: ignore[no-untyped-def]
    """Fill cotangents ``bar`` (5, rays) of indices and shares of rays, by what they find in the light field."""
    (values, views, channels), _, _, motion, between = field
    nv, nu, nt, ns = views
    line, picture = ns * channels, nt * ns * channels
    m00, m01, m10, m11 = motion[0, 0], motion[0, 1], motion[1, 0], motion[1, 1]
    dark = dark_from(motion)
    along_i, along_j = (min(nu, 2), min(nv, 2)) if between else (1, 1)
    t00 = t01 = t10 = t11 = total = 0.0
    for p in range(n):
        i, j, k, l, share = index[0, p], index[1, p], index[2, p], index[3, p], index[4, p]
        for q in range(5):
            bar[q, p] = 0.0
        if lit[p] == 0.0 or not may_find_light(i, j, k, l, views, dark):
            continue
        i0, j0, fi, fj = views_of_ray(i, j, nu, nv, between)
        value = of_i = of_j = of_k = of_l = 0.0
        for dj in range(along_j):
            wj, sj, away_j = (fj, 1.0, j - j0 - 1) if dj else (1.0 - fj, -1.0, j - j0)
            for di in range(along_i):
                wi, si, away_i = (fi, 1.0, i - i0 - 1) if di else (1.0 - fi, -1.0, i - i0)
                view_k, view_l = k, l
                if between:
                    view_k, view_l = k + m00 * away_i + m01 * away_j, l + m10 * away_i + m11 * away_j
                k0, l0 = math.floor(view_k), math.floor(view_l)
                fk, fl = view_k - k0, view_l - l0
                c, r = int(k0), int(l0)
                at = ((j0 + dj) * nu + i0 + di) * picture + r * line + c * channels
                u00 = u01 = u10 = u11 = 0.0
                if c >= 0 and c < ns - 1 and r >= 0 and r < nt - 1:
                    for channel in range(channels):
                        g, here = weights[channel], np.uint64(at + channel)
                        u00 += g * values[here]
                        u01 += g * values[here + np.uint64(channels)]
                        u10 += g * values[here + np.uint64(line)]
                        u11 += g * values[here + np.uint64(line + channels)]
                else:
                    left, right = c >= 0 and c < ns, c >= -1 and c < ns - 1
                    up, down = r >= 0 and r < nt, r >= -1 and r < nt - 1
                    for channel in range(channels):
                        g, here = weights[channel], at + channel
                        u00 += g * values[here] if up and left else 0.0
                        u01 += g * values[here + channels] if up and right else 0.0
                        u10 += g * values[here + line] if down and left else 0.0
                        u11 += g * values[here + line + channels] if down and right else 0.0
                upper, lower = u00 + (u01 - u00) * fk, u10 + (u11 - u10) * fk
                found, w = upper + (lower - upper) * fl, wi * wj
                to_k = w * ((u01 - u00) * (1.0 - fl) + (u11 - u10) * fl)
                to_l = w * (lower - upper)
                value += w * found
                of_i += si * wj * found
                of_j += wi * sj * found
                of_k += to_k
                of_l += to_l
                t00 += share * to_k * away_i
                t01 += share * to_k * away_j
                t10 += share * to_l * away_i
                t11 += share * to_l * away_j
        # Beyond the outermost views, and where there is one, weights are even.
        of_i = of_i if along_i == 2 and i >= 0.0 and i <= nu - 1.0 else 0.0
        of_j = of_j if along_j == 2 and j >= 0.0 and j <= nv - 1.0 else 0.0
        if between:
            of_i, of_j = of_i + m00 * of_k + m10 * of_l, of_j + m01 * of_k + m11 * of_l
        bar[0, p], bar[1, p], bar[2, p], bar[3, p] = share * of_i, share * of_j, share * of_k, share * of_l
        bar[4, p] = value
        total += share * value
    if between:
        to_motion[0] += t00
        to_motion[1] += t01
        to_motion[2] += t10
        to_motion[3] += t11
    to_scale[0] += total


@_compiled
def pixel_back(drawn, place, bar, own):  # type: ignore[no-untyped-def]
    """What places of a pixel's rays on the sensor say of its first pixel, pitch and sensitive area."""
    points, start, n, flipped = drawn
    for q in range(2):
        digits, number = np.int32(flipped[q]), place[1 - q]
        total = of_area = 0.0
        for p in range(n):
            total += bar[q, p]
            of_area += bar[q, p] * (unit(points[q, start + p], digits) - 0.5)
        own[q] += total
        own[2 + q] += total * number
        own[4 + q] += of_area


@_inlined
def lit_by(share, n, lit):  # type: ignore[no-untyped-def]
    """Set ``lit`` to 1 for rays that carry light, else to 0; returns how many do."""
    number = 0
    for p in range(n):
        carries = share[p] > 0.0
        lit[p] = 1.0 if carries else 0.0
        number += carries
    return number


@_inlined
def packet_back(field, drawn, aim, images, cell, steps, place, weights, ways, told):  # type: ignore[no-untyped-def]
    """Trace a packet of rays, which ``ways[0][0]`` holds at the sensor, and go back with what they find.

    ``ways``: (what rays are before each step and behind all, and their indices (steps + 2, 5, rays); which are not
    stopped; cotangents (5, rays); room for two numbers a ray, and for the sums of `cell_back`).
    """
    kept, lit, bar, found, sums = ways
    n, number = drawn.rays, len(steps.codes)
    if lit_by(kept[0, 4], n, lit) > 0:
        for step in range(number):
            step_on(steps, step, drawn, kept[step], kept[step + 1], lit)
        for q in range(5):
            for p in range(n):
                kept[number + 1, q, p] = kept[number, q, p]
        to_indices(field.index_from_ray, packet_of(kept[number + 1]), n)
        field_back(field, weights[place[0], place[1]], n, kept[number + 1], lit, bar, told.motion, told.scale)
        moved_back(field.index_from_ray.reshape(-1), n, kept[number], bar, told.indices)
        of_steps = told.steps, told.matrices, told.shares, told.slopes, told.points
        for step in range(number - 1, -1, -1):
            step_back(steps, step, drawn, kept[step], bar, found, of_steps)
        if aim.by_cell:
            of_cells = told.cells, told.kinds, told.borders, sums
            cell_back(drawn, images, aim.cells, cell, kept[0], bar, of_cells)
        else:
            window_back(drawn, aim.window, kept[0], bar, told.window, told.scatter, told.points)
        pixel_back(drawn, place, bar, told.sensor)


@_allocating
def numbers_of_tiles(field, sensor, points, aim, steps, weights, ended, told, tiles):  # type: ignore[no-untyped-def]
    """What the pixels of tiles say of all numbers, added to ``told``; what is given: `vcc.engines.ray_tables`.

    ``weights``: (rows, columns, channels), of the picture. ``tiles``: (tiles, 4). Once ``ended[0]`` is true,
    nobody wants them, and the kernel returns.
    """
    kept = np.empty((len(steps.codes) + 2, 5, PACKET))
    ways = kept, np.empty(PACKET), np.empty((5, PACKET)), np.empty((2, PACKET)), np.empty((2, 4))
    numbers_within(field, sensor, points, aim, steps, weights, ended, told, tiles, room(), ways)


@_compiled
def numbers_within(field, sensor, points, aim, steps, weights, ended, told, tiles, within, ways):  # type: ignore[no-untyped-def]
    """As `numbers_of_tiles`, within what `vcc.engines.ray_kernels.room` gives, and the ways of `packet_back`."""
    table, samples, _, seed = points
    cells = aim.cells
    _, near, images, flipped = within
    at_sensor = packet_of(ways[0][0])
    for tile in range(len(tiles)):
        for row in range(tiles[tile, 0], min(tiles[tile, 1], sensor.rows)):
            for column in range(tiles[tile, 2], min(tiles[tile, 3], sensor.columns)):
                if ended[0]:
                    return
                pixel, middle = row * sensor.columns + column, middle_of(sensor, row, column)
                first = first_point(points, pixel)
                for q in range(cells_at(aim.by_cell, cells, middle, sensor.sensitive, near)):
                    turn_to(aim.by_cell, cells, seed, pixel, near, q, images, flipped)
                    for done in range(0, samples, PACKET):
                        drawn = Drawn(table, first + done, min(PACKET, samples - done), flipped)
                        aim_rays(aim, drawn, middle, sensor.sensitive, images, at_sensor)
                        packet_back(field, drawn, aim, images, near[q], steps, (row, column), weights, ways, told)
