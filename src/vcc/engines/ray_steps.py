"""The steps of a packet of rays from the sensor to the light field, and their derivatives.

A step is a code and some numbers (`vcc.plan.rays.steps`). They are read once per packet, so that reading them
costs nothing and the arithmetic vectorises over rays. `take_steps` takes a packet through all steps. `step_back`
goes backward through one step: from the cotangents of the rays behind the step to those of the rays before it
and to the gradients of the step's parameters; `vcc.plan.rays.backwards` explains these derivatives. Rays that a
hard edge stops contribute nothing; rays that a mask weighs with zero contribute. Change a step and its
derivative together.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import ray_back, ray_back_inlined, ray_inlined, ray_inner
from vcc.engines.interpolation import around, bilinear
from vcc.engines.ray_maps import map_back, through_map
from vcc.engines.ray_surfaces import surface_back, through_surface
from vcc.engines.ray_tables import Packet, Steps


@ray_inner
def cell_of(layout, turn, x, y):  # type: ignore[no-untyped-def]
    """(row, column, centre x, centre y) of the cell around a place; ``turn`` as in `steps._lattice_numbers`."""
    cosine, sine, offset_x, offset_y, pitch, height = turn[0], turn[1], turn[2], turn[3], turn[4], turn[5]
    dx, dy = x - offset_x, y - offset_y
    across = (cosine * dx + sine * dy) * (1 / pitch)
    down = (cosine * dy - sine * dx) * (1 / height)
    if layout == 0:
        row, column = math.floor(down + 0.5), math.floor(across + 0.5)
        shifted = column
    else:
        even_row, even_column = 2 * math.floor(down / 2 + 0.5), math.floor(across + 0.5)
        odd_row, odd_column = 2 * math.floor(down / 2) + 1, math.floor(across)
        to_even = (across - even_column) ** 2 + 0.75 * (down - even_row) ** 2
        to_odd = (across - odd_column - 0.5) ** 2 + 0.75 * (down - odd_row) ** 2
        if to_even <= to_odd:
            row, column = even_row, even_column
            shifted = column
        else:
            row, column = odd_row, odd_column
            shifted = column + 0.5
    shifted, down = shifted * pitch, row * height
    return (
        np.int64(row),
        np.int64(column),
        cosine * shifted - sine * down + offset_x,
        sine * shifted + cosine * down + offset_y,
    )


@ray_inner
def centre_of(layout, turn, row, column):  # type: ignore[no-untyped-def]
    """(x, y) of the centre of a cell."""
    shifted = column * turn[4]
    if layout == 1 and row & 1:
        shifted += 0.5 * turn[4]
    down = row * turn[5]
    return turn[0] * shifted - turn[1] * down + turn[2], turn[1] * shifted + turn[0] * down + turn[3]


@ray_inner
def corner(x, y, rows, columns, real):  # type: ignore[no-untyped-def]
    """(columns, row, next row, column, next column, fraction down, fraction right) of a place on a texture."""
    c, c1, right = around((x - real[0]) * real[2], columns)
    r, r1, down = around((y - real[1]) * real[3], rows)
    return columns, r, r1, c, c1, down, right


@ray_inner
def mixed(table, start, width, number, at):  # type: ignore[no-untyped-def]
    """One of ``width`` values per point of the texture at ``start``, interpolated at a place from `corner`."""
    columns, r, r1, c, c1, down, right = at
    above, below, start = r * columns, r1 * columns, start + number
    return bilinear(
        table[start + (above + c) * width],
        table[start + (above + c1) * width],
        table[start + (below + c) * width],
        table[start + (below + c1) * width],
        right,
        down,
    )


@ray_inner
def by_ray(table, a, f, x, y, s, t):  # type: ignore[no-untyped-def]
    """Step 16: the sum of products of a function of place and one of slope."""
    there, towards = corner(x, y, a[0], a[1], f), corner(s, t, a[3], a[4], f[4:])
    total = 0.0
    for k in range(a[6]):
        total += mixed(table, a[2], a[6], k, there) * mixed(table, a[5], a[6], k, towards)
    return total


@ray_inlined
def facet_at(slopes, a, f, x, y):  # type: ignore[no-untyped-def]
    """Step 4: where the numbers (direction, slopes) of the facet at a place begin."""
    dx, dy = x - f[0], y - f[1]
    best, at = -np.inf, a[1]
    for facet in range(a[0]):
        outward = dx * slopes[a[1] + 4 * facet] + dy * slopes[a[1] + 4 * facet + 1]
        if outward > best:
            best, at = outward, a[1] + 4 * facet
    return at


@ray_inlined
def kernel_at(shares, points, a, f, x, y, ray):  # type: ignore[no-untyped-def]
    """Step 10: the column of points of the kernel that is drawn for a ray at a place, and how it is stretched."""
    kernel, stretch = 0, 1.0
    if a[3] > 0:
        at = corner(x, y, a[3], a[4], f)
        picked = points[a[2], ray]
        while kernel < a[1] - 1 and picked >= mixed(shares, a[5], a[1], kernel, at):
            kernel += 1
    if a[6] > 0:
        stretch = mixed(shares, a[8], 1, 0, corner(x, y, a[6], a[7], f[4:]))
    return a[0] + 2 * kernel, stretch


@ray_inlined
def part_affinely(f, n, x, y, s, t):  # type: ignore[no-untyped-def]
    """Step 0: an affine map along x and another along y."""
    f0, f1, f2, f3, f4, f5 = f[0], f[1], f[2], f[3], f[4], f[5]
    for p in range(n):
        xp, sp = x[p], s[p]
        x[p] = f0 * xp + f1 * sp + f2
        s[p] = f3 * xp + f4 * sp + f5
    f0, f1, f2, f3, f4, f5 = f[6], f[7], f[8], f[9], f[10], f[11]
    for p in range(n):
        yp, tp = y[p], t[p]
        y[p] = f0 * yp + f1 * tp + f2
        t[p] = f3 * yp + f4 * tp + f5


@ray_inlined
def within_disc(f, n, x, y, share):  # type: ignore[no-untyped-def]
    """Step 6: dark outside a disc."""
    f0, f1, f2 = f[0], f[1], f[2]
    for p in range(n):
        dx, dy = x[p] - f0, y[p] - f1
        share[p] = share[p] if dx * dx + dy * dy <= f2 else 0.0


@ray_inlined
def within_rectangle(f, n, x, y, share):  # type: ignore[no-untyped-def]
    """Step 7: dark outside a rectangle."""
    f0, f1, f2, f3 = f[0], f[1], f[2], f[3]
    for p in range(n):
        share[p] = share[p] if (abs(x[p] - f0) <= f2) & (abs(y[p] - f1) <= f3) else 0.0


FEW = frozenset({0, 6, 7})
"""Codes of the steps of a plain lens: affine maps along x and y, a round aperture, a rectangular one."""


@ray_inner
def take_few_steps(steps, drawn, rays):  # type: ignore[no-untyped-def]
    """As `take_steps` if all steps are in `FEW`; compiling these takes a tenth of the time."""
    codes, _, real, _, _ = steps
    n = drawn.rays
    x, y, s, t, share = rays
    for step in range(len(codes)):
        code, f = codes[step], real[step]
        if code == 0:
            part_affinely(f, n, x, y, s, t)
        elif code == 6:
            within_disc(f, n, x, y, share)
        else:
            within_rectangle(f, n, x, y, share)


@ray_inner
def take_steps(steps, drawn, rays):  # type: ignore[no-untyped-def]
    """Take a packet of rays through all steps.

    The numbers of a step are read before its loop: loops without branches vectorise over rays.
    """
    codes, whole, real, shares, slopes = steps
    points, first, n, _ = drawn
    x, y, s, t, share = rays
    for step in range(len(codes)):
        code, a, f = codes[step], whole[step], real[step]
        if code == 0:
            part_affinely(f, n, x, y, s, t)
        elif code == 1:
            for p in range(n):
                xp, yp, sp, tp = x[p], y[p], s[p], t[p]
                x[p] = f[0] * xp + f[1] * yp + f[2] * sp + f[3] * tp + f[4]
                y[p] = f[5] * xp + f[6] * yp + f[7] * sp + f[8] * tp + f[9]
                s[p] = f[10] * xp + f[11] * yp + f[12] * sp + f[13] * tp + f[14]
                t[p] = f[15] * xp + f[16] * yp + f[17] * sp + f[18] * tp + f[19]
        elif code == 2 and a[0] == 0 and a[1] * a[2] == 1:
            # The usual array: square cells, all equal, no branches.
            power, slope_x, slope_y = slopes[a[3]], slopes[a[3] + 1], slopes[a[3] + 2]
            cosine, sine, offset_x, offset_y, pitch = f[0], f[1], f[2], f[3], f[4]
            per_pitch = 1 / pitch
            for p in range(n):
                dx, dy = x[p] - offset_x, y[p] - offset_y
                across, down = (cosine * dx + sine * dy) * per_pitch, (cosine * dy - sine * dx) * per_pitch
                across, down = math.floor(across + 0.5) * pitch, math.floor(down + 0.5) * pitch
                s[p] += power * (dx - (cosine * across - sine * down)) - slope_x
                t[p] += power * (dy - (sine * across + cosine * down)) - slope_y
        elif code == 2:
            for p in range(n):
                row, column, centre_x, centre_y = cell_of(a[0], f, x[p], y[p])
                at = a[3] + ((row % a[1]) * a[2] + column % a[2]) * 3
                s[p] += slopes[at] * (x[p] - centre_x) - slopes[at + 1]
                t[p] += slopes[at] * (y[p] - centre_y) - slopes[at + 2]
        elif code == 3:
            for p in range(n):
                _, _, centre_x, centre_y = cell_of(a[0], f, x[p], y[p])
                dx, dy = x[p] - centre_x, y[p] - centre_y
                across, down = abs(f[0] * dx + f[1] * dy), abs(f[0] * dy - f[1] * dx)
                if a[1] == 1:
                    inside = across * across + down * down <= f[6] * f[6]
                elif a[0] == 0:
                    inside = max(across, down) <= f[6]
                else:
                    inside = max(across, across / 2 + 0.5 * math.sqrt(3.0) * down) <= f[6]
                share[p] *= inside
        elif code == 11:
            for p in range(n):
                row, column, _, _ = cell_of(a[0], f, x[p], y[p])
                share[p] *= (row >= 0) & (row < a[1]) & (column >= 0) & (column < a[2])
        elif code == 4:
            for p in range(n):
                at = facet_at(slopes, a, f, x[p], y[p])
                s[p] -= slopes[at + 2]
                t[p] -= slopes[at + 3]
        elif code == 5:
            for p in range(n):
                at = corner(x[p], y[p], a[0], a[1], f)
                s[p] -= mixed(slopes, a[2], 2, 0, at)
                t[p] -= mixed(slopes, a[2], 2, 1, at)
        elif code == 6:
            within_disc(f, n, x, y, share)
        elif code == 7:
            within_rectangle(f, n, x, y, share)
        elif code == 8:
            for p in range(n):
                column, row = math.floor((x[p] - f[0]) * f[2]), math.floor((y[p] - f[1]) * f[3])
                inside = (column >= 0) & (column < a[1]) & (row >= 0) & (row < a[0])
                c, r = int(min(max(column, 0), a[1] - 1)), int(min(max(row, 0), a[0] - 1))
                share[p] *= shares[a[2] + r * a[1] + c] * inside
        elif code == 9:
            for p in range(n):
                at = corner(x[p], y[p], a[0], a[1], f)
                share[p] *= mixed(shares, a[2], 1, 0, at)
        elif code == 12:
            for p in range(n):
                for axis in range(2):
                    if f[2 + axis] > 0:
                        place = x[p] if axis == 0 else y[p]
                        first_cosine = math.cos(f[2 + axis] * (place - f[axis]) + f[4])
                        # cos((n + 1)θ) = 2·cos(θ)·cos(nθ) − cos((n − 1)θ)
                        before, now, total = 1.0, first_cosine, first_cosine
                        for _ in range(a[0] - 1):
                            before, now = now, 2 * first_cosine * now - before
                            total += now
                        share[p] *= 0.5 + total / (2 * a[0])
        elif code == 13:
            through_surface(a, f, n, x, y, s, t, share)
        elif code == 15:
            through_map(a, f, slopes[a[3] :], n, x, y, s, t, share)
        elif code == 16:
            for p in range(n):
                share[p] *= max(by_ray(shares, a, f, x[p], y[p], s[p], t[p]), 0.0)
        elif code == 14:
            for p in range(n):
                per_square = 1.0 / (1.0 + s[p] * s[p] + t[p] * t[p])
                share[p] *= per_square * per_square
        else:
            for p in range(n):
                column, stretch = kernel_at(shares, points, a, f, x[p], y[p], first + p)
                s[p] -= stretch * points[column, first + p]
                t[p] -= stretch * points[column + 1, first + p]


# --- and back ---


@ray_back_inlined
def packet_of(numbers):  # type: ignore[no-untyped-def]
    """A packet of rays from an array (5, rays)."""
    return Packet(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4])


@ray_back
def step_on(steps, number, drawn, before, behind, lit):  # type: ignore[no-untyped-def]
    """Take a packet (5, rays) through one step; ``lit`` becomes 0 for rays that a hard edge stops."""
    codes, whole, real, shares, slopes = steps
    n, code, a, f = drawn.rays, codes[number], whole[number], real[number]
    for q in range(5):
        for p in range(n):
            behind[q, p] = before[q, p]
    # The step runs on shares of one: a share that becomes zero there was stopped, not zero before.
    hole = code == 3 or code == 11 or code == 6 or code == 7 or code == 13 or code == 15
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
            lit[p] *= behind[4, p] > 0.0
            behind[4, p] *= before[4, p]


@ray_back
def moved_back(m, n, before, bar, own):  # type: ignore[no-untyped-def]
    """Take cotangents of places and slopes back through the 4×5 map ``m``; add the map's gradients to ``own``."""
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


@ray_back
def texture_back(table, sizes, real, rays, values, out, own):  # type: ignore[no-untyped-def]
    """Backward of a texture lookup: add gradients to the places of a packet and to the texture.

    Args:
        table: of all textures.
        sizes: (rays, rows, columns, start in the table, values per point).
        real: see `vcc.plan.rays.steps.Texture.real`.
        rays: (x, y, cotangents of x, of y); the cotangents are added to.
        values: cotangents of the looked-up values, (values per point or fewer, rays).
        out: gradients of the texture, shaped like the table; empty if they are not wanted.
        own: four sums for the gradients of the texture's start and spacing, up to factors.
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
        # A texture is constant beyond its ends.
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


@ray_back
def step_back(steps, number, drawn, before, bar, found, sums):  # type: ignore[no-untyped-def]
    """Turn the cotangents ``bar`` (5, rays) of a packet behind a step into those before it, in place.

    ``sums``: (steps, matrices, shares, slopes, points) of `vcc.engines.ray_tables.RayGradients`; gradients of
    the step's parameters are added to them. ``found``: a buffer of two numbers per ray.
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
            at = facet_at(slopes, a, f, x[p], y[p])
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
                out_shares[at] += gw[p] * share[p]  # gw is 0 for rays outside all cells
            gw[p] *= shares[at]
    elif code == 9:
        for p in range(n):
            found[0, p] = gw[p] * share[p]
            gw[p] *= mixed(shares, a[2], 1, 0, corner(x[p], y[p], a[0], a[1], f))
        texture_back(shares, (n, a[0], a[1], a[2], 1), f, (x, y, gx, gy), found[:1], out_shares, own)
    elif code == 16:
        terms, own_slopes = a[6], own[4:]
        for k in range(terms):
            for p in range(n):
                carried = gw[p] * share[p]
                if by_ray(shares, a, f, x[p], y[p], before[2, p], before[3, p]) <= 0.0:
                    carried = 0.0
                found[0, p] = carried * mixed(
                    shares, a[5], terms, k, corner(before[2, p], before[3, p], a[3], a[4], f[4:])
                )
                found[1, p] = carried * mixed(shares, a[2], terms, k, corner(x[p], y[p], a[0], a[1], f))
            to_place, to_slope = (n, a[0], a[1], a[2] + k, terms), (n, a[3], a[4], a[5] + k, terms)
            texture_back(shares, to_place, f, (x, y, gx, gy), found[:1], out_shares, own)
            texture_back(
                shares, to_slope, f[4:], (before[2], before[3], gs, gt), found[1:2], out_shares, own_slopes
            )
        for p in range(n):
            gw[p] *= max(by_ray(shares, a, f, x[p], y[p], before[2, p], before[3, p]), 0.0)
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
    elif code == 13:
        surface_back(a, f, n, before, bar, own)
    elif code == 15:
        map_back(a, f, slopes[a[3] :], n, before, bar)
    elif code == 14:
        for p in range(n):
            per_square = 1.0 / (1.0 + before[2, p] * before[2, p] + before[3, p] * before[3, p])
            steep = -4.0 * gw[p] * share[p] * per_square * per_square * per_square
            gs[p] += steep * before[2, p]
            gt[p] += steep * before[3, p]
            gw[p] *= per_square * per_square
    elif code == 10:
        for p in range(n):
            column, stretch = kernel_at(shares, points, a, f, x[p], y[p], first + p)
            found[0, p] = -(gs[p] * points[column, first + p] + gt[p] * points[column + 1, first + p])
            if len(out_points) > 0:
                out_points[column, first + p] -= stretch * gs[p]
                out_points[column + 1, first + p] -= stretch * gt[p]
        if a[6] > 0:
            texture_back(shares, (n, a[6], a[7], a[8], 1), f[4:], (x, y, gx, gy), found[:1], out_shares, own)


@ray_back
def cosines(frequency, middle, phase, harmonics, place):  # type: ignore[no-untyped-def]
    """(½ + Σ cos(nθ)/2h, its derivative to θ) of a cosine mask along one axis; (1, 0) if it is constant."""
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
