"""Where the rays of a pixel start, and how they are aimed: at the window of a stop, or through cells of an array.

Also the backward pass, to the parameters of the sensor, the window and the cells; `vcc.plan.rays.aim_backwards`
explains these derivatives.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import ray_back, ray_inlined, ray_inner
from vcc.engines.ray_steps import cell_of, centre_of
from vcc.plan.rays.points import DIGITS

DIGITS_ABOVE, DIGITS_BELOW = np.float32(2.0**DIGITS), 2.0**-DIGITS
"""Factors from a point to its digits as an integer, and back."""


@ray_inner
def hashed(number, seed):  # type: ignore[no-untyped-def]
    """See `vcc.plan.rays.points.hashed`."""
    h = np.uint32(number & 0xFFFFFFFF) ^ np.uint32((seed * 0x9E3779B1) & 0xFFFFFFFF)
    h = np.uint32(np.uint32(h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B))
    h = np.uint32(np.uint32(h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35))
    return np.uint32(h ^ (h >> np.uint32(16)))


@ray_inlined
def first_point(points, pixel):  # type: ignore[no-untyped-def]
    """Where the points of a pixel begin in their table; see `vcc.plan.rays.model.Rays.block`."""
    table, samples, beside, seed = points
    return ((np.int64(hashed(pixel, seed)) * (table.shape[1] // samples) >> 32) ^ beside) * samples


@ray_inlined
def middle_of(sensor, row, column):  # type: ignore[no-untyped-def]
    """The position (x, y) of the centre of a pixel."""
    return sensor.first[0] + column * sensor.pitch[0], sensor.first[1] + row * sensor.pitch[1]


@ray_inlined
def unit(point, flipped):  # type: ignore[no-untyped-def]
    """A number 0 … 1 of `DIGITS` binary digits, some of them flipped; see `vcc.plan.rays.model.Rays._moved`."""
    return (np.float64(np.int32(point * DIGITS_ABOVE) ^ flipped) + 0.5) * DIGITS_BELOW


@ray_inner
def at_pixel(drawn, middle, sensitive, rays):  # type: ignore[no-untyped-def]
    """Set the positions of a packet's rays on the sensitive area of a pixel."""
    points, start, n, flipped = drawn
    x, y = rays.x, rays.y
    (middle_x, middle_y), (wide, high) = middle, sensitive
    across, down = np.int32(flipped[0]), np.int32(flipped[1])
    for p in range(n):
        x[p] = middle_x + (unit(points[0, start + p], across) - 0.5) * wide
        y[p] = middle_y + (unit(points[1, start + p], down) - 0.5) * high


@ray_inner
def kind_of(kinds, row, column):  # type: ignore[no-untyped-def]
    """(power, δs, δt) of a cell; no divisions if there is one kind, the usual case."""
    rows, columns = kinds.shape[0], kinds.shape[1]
    one = rows * columns == 1
    r, c = (0, 0) if one else (row % rows, column % columns)
    return kinds[r, c, 0], kinds[r, c, 1], kinds[r, c, 2]


@ray_inlined
def set_image(image, cells, axis, centre, power, slope):  # type: ignore[no-untyped-def]
    """Set the numbers from which `through_cell` computes the stop's image seen through a cell, along one axis."""
    gain = cells.beyond[axis] + power * cells.beyond_from_slope[axis]
    if abs(gain) < 1e-12:
        gain = 1e-12
    from_slope = cells.beyond_from_slope[axis] * (power * centre + slope)
    rest = cells.middle[axis] - cells.beyond_offset[axis] + from_slope
    image[0] = rest / gain
    image[1] = -cells.beyond_from_sensor[axis] / gain
    image[2] = cells.half[axis] / abs(gain)
    image[3] = centre
    image[4] = cells.cell_half[axis]


@ray_inner
def cells_seen(cells, x, y, sensitive, near):  # type: ignore[no-untyped-def]
    """Fill ``near`` with the (row, column) of the cells through which a pixel sees the stop; return the count."""
    beyond, from_sensor, from_slope = cells.beyond, cells.beyond_from_sensor, cells.beyond_from_slope
    offset, middle, half, cell_half = cells.beyond_offset, cells.middle, cells.half, cells.cell_half
    centre_x = (middle[0] - offset[0] - from_sensor[0] * x) / beyond[0]
    centre_y = (middle[1] - offset[1] - from_sensor[1] * y) / beyond[1]
    row, column, _, _ = cell_of(cells.layout, cells.turn, centre_x, centre_y)
    # The position p(a) = gain·a + rest at the stop, over the cell and the pixel, must be inside the stop.
    loose_x, loose_y = abs(from_sensor[0]) * sensitive[0] / 2, abs(from_sensor[1]) * sensitive[1] / 2
    rest_x = from_sensor[0] * x + offset[0] - middle[0]
    rest_y = from_sensor[1] * y + offset[1] - middle[1]
    found = 0
    for r in range(row - cells.reach[0], row + cells.reach[0] + 1):
        for c in range(column - cells.reach[1], column + cells.reach[1] + 1):
            centre_x, centre_y = centre_of(cells.layout, cells.turn, r, c)
            power, slope_x, slope_y = kind_of(cells.kinds, r, c)
            # At its centre the cell's lens does not deflect: there p is beyond·centre + rest.
            gain = abs(beyond[0] + power * from_slope[0])
            off = abs(beyond[0] * centre_x + rest_x - from_slope[0] * slope_x)
            seen = off <= half[0] + (gain * cell_half[0] + loose_x) * (1 + 1e-9)
            gain = abs(beyond[1] + power * from_slope[1])
            off = abs(beyond[1] * centre_y + rest_y - from_slope[1] * slope_y)
            if seen and off <= half[1] + (gain * cell_half[1] + loose_y) * (1 + 1e-9):
                near[found, 0], near[found, 1] = r, c
                found += 1
    return found


@ray_inlined
def cells_at(by_cell, cells, middle, sensitive, near):  # type: ignore[no-untyped-def]
    """Fill ``near`` with the cells that a pixel is traced through; return their number, 1 for a window."""
    seen = 1
    if by_cell:
        seen = cells_seen(cells, middle[0], middle[1], sensitive, near)
    return seen


@ray_inlined
def turn_to(by_cell, cells, seed, pixel, near, q, images, flipped):  # type: ignore[no-untyped-def]
    """Set the digits to flip for a pixel, and the stop's image for cell ``q`` of ``near`` if there are cells."""
    number = np.int64(pixel)
    if by_cell:
        number ^= np.int64(hashed(near[q, 0] * 65537 + near[q, 1], seed))
        centre_x, centre_y = centre_of(cells.layout, cells.turn, near[q, 0], near[q, 1])
        power, slope_x, slope_y = kind_of(cells.kinds, near[q, 0], near[q, 1])
        set_image(images[0], cells, 0, centre_x, power, slope_x)
        set_image(images[1], cells, 1, centre_y, power, slope_y)
    for n in range(4):
        flipped[n] = hashed(number, seed + 1 + n) >> np.uint32(32 - DIGITS)


@ray_inlined
def visible_point(window, x, y, a, b):  # type: ignore[no-untyped-def]
    """A point of the unit disc mapped on the part of the pupil that (x, y) sees, and the factor of its area.

    See `vcc.optics.visible_pupil.VisiblePupil.mapped`.
    """
    table, (axis_x, axis_y), per_step = window.visible, window.axis, window.per_step
    x, y = (x - axis_x) * per_step, (y - axis_y) * per_step
    height = math.sqrt(x * x + y * y)
    cosine, sine = (x / height, y / height) if height > 0.0 else (1.0, 0.0)
    height = min(height, table.shape[0] - 1.0)
    low = min(int(height), table.shape[0] - 2)
    at = height - low
    middle = (1.0 - at) * table[low, 0] + at * table[low + 1, 0]
    half = (1.0 - at) * table[low, 1] + at * table[low + 1, 1]
    across = (1.0 - at) * table[low, 2] + at * table[low + 1, 2]
    along, aside = cosine * a + sine * b, cosine * b - sine * a
    steps = table.shape[1] - 4
    turn = (along / max(abs(along) + abs(aside), 1e-300) + 1.0) * 0.5 * steps
    left = min(int(turn), steps - 1)
    beside = turn - left
    one = (1.0 - beside) * table[low, 3 + left] + beside * table[low, 4 + left]
    other = (1.0 - beside) * table[low + 1, 3 + left] + beside * table[low + 1, 4 + left]
    out = (1.0 - at) * one + at * other
    along, aside = middle + half * out * along, across * out * aside
    return cosine * along - sine * aside, sine * along + cosine * aside, half * across * out * out


@ray_inner
def through_window(drawn, window, rays):  # type: ignore[no-untyped-def]
    """Slopes and weights of rays towards a `vcc.plan.rays.bounds.windows.Window`, with diffusers compensated."""
    points, start, n, flipped = drawn
    from_point, from_sensor, (f4, g4) = window.from_point, window.from_sensor, window.offset
    solid_angle, disc, scatter, visible = window.solid_angle, window.disc, window.scatter, window.visible
    x, y, s, t, share = rays
    f0, f1, f2, f3 = from_point[0, 0], from_point[0, 1], from_sensor[0, 0], from_sensor[0, 1]
    g0, g1, g2, g3 = from_point[1, 0], from_point[1, 1], from_sensor[1, 0], from_sensor[1, 1]
    turn = 2.0 * math.pi * DIGITS_BELOW * flipped[2]
    cosine, sine = math.cos(turn), math.sin(turn)
    if len(visible) > 0:
        for p in range(n):
            a, b = np.float64(points[2, start + p]), np.float64(points[3, start + p])
            a, b = cosine * a - sine * b, sine * a + cosine * b
            a, b, part = visible_point(window, x[p], y[p], a, b)
            share[p] = part * solid_angle
            s[p] = f0 * a + f1 * b + f2 * x[p] + f3 * y[p] + f4
            t[p] = g0 * a + g1 * b + g2 * x[p] + g3 * y[p] + g4
    else:
        if disc:  # rotated
            f0, f1 = f0 * cosine + f1 * sine, f1 * cosine - f0 * sine
            g0, g1 = g0 * cosine + g1 * sine, g1 * cosine - g0 * sine
        across, down = np.int32(flipped[2]), np.int32(flipped[3])
        for p in range(n):
            a, b = np.float64(points[2, start + p]), np.float64(points[3, start + p])
            if not disc:
                a, b = 2.0 * unit(points[2, start + p], across) - 1.0, 2.0 * unit(points[3, start + p], down) - 1.0
            s[p] = f0 * a + f1 * b + f2 * x[p] + f3 * y[p] + f4
            t[p] = g0 * a + g1 * b + g2 * x[p] + g3 * y[p] + g4
            share[p] = solid_angle
    for term in range(len(scatter)):
        column = int(scatter[term, 0])
        f0, f1, g0, g1 = scatter[term, 1], scatter[term, 2], scatter[term, 3], scatter[term, 4]
        for p in range(n):
            a, b = points[column, start + p], points[column + 1, start + p]
            s[p] += f0 * a + f1 * b
            t[p] += g0 * a + g1 * b


@ray_inner
def through_cell(drawn, images, cells, rays):  # type: ignore[no-untyped-def]
    """Slopes and weights of rays through the part of a cell that sees the stop; see `CellWindows.aimed`.

    ``images``: (2, 5), see `set_image`. Until the last loop, s holds positions across, t and share the ends of
    the visible part there.
    """
    points, start, n, flipped = drawn
    x, y, s, t, share = rays
    middle, along, half, centre, reach = images[0, 0], images[0, 1], images[0, 2], images[0, 3], images[0, 4]
    middle_y, along_y, half_y, centre_y = images[1, 0], images[1, 1], images[1, 2], images[1, 3]
    radius, borders = cells.opening_radius, cells.borders
    across, down = np.int32(flipped[2]), np.int32(flipped[3])
    per_half = cells.disc / half  # all chords of a rectangle are equal
    for p in range(n):
        image = middle + along * x[p]
        low = max(image - half, centre - reach)
        a = low + max(min(image + half, centre + reach) - low, 0.0) * unit(points[2, start + p], across)
        off = (a - image) * per_half
        chord = half_y * math.sqrt(max(1.0 - off * off, 0.0))
        image = middle_y + along_y * y[p]
        s[p], t[p], share[p] = a, image - chord, image + chord
    for strip in range(len(borders)):
        slope, tall = borders[strip, 0], borders[strip, 1]
        for p in range(n):
            border = centre_y + slope * (s[p] - centre)
            t[p], share[p] = max(t[p], border - tall), min(share[p], border + tall)
    if radius < np.inf:
        for p in range(n):
            away = s[p] - centre
            chord = math.sqrt(max(radius * radius - away * away, 0.0))
            t[p], share[p] = max(t[p], centre_y - chord), min(share[p], centre_y + chord)
    per_slope_x, per_slope_y = 1 / cells.place_from_slope[0], 1 / cells.place_from_slope[1]
    weight = abs(per_slope_x * per_slope_y)
    (from_x, from_y), (offset_x, offset_y) = cells.place_from_sensor, cells.offset
    for p in range(n):
        image = middle + along * x[p]
        wide = max(min(image + half, centre + reach) - max(image - half, centre - reach), 0.0)
        tall = max(share[p] - t[p], 0.0)
        b = t[p] + tall * unit(points[3, start + p], down)
        s[p] = (s[p] - from_x * x[p] - offset_x) * per_slope_x
        t[p] = (b - from_y * y[p] - offset_y) * per_slope_y
        share[p] = weight * wide * tall


@ray_inlined
def aim_rays(aim, drawn, middle, sensitive, images, rays):  # type: ignore[no-untyped-def]
    """Start a packet's rays at the sensor and aim them at the window or through the cell."""
    at_pixel(drawn, middle, sensitive, rays)
    if aim.by_cell:
        through_cell(drawn, images, aim.cells, rays)
    else:
        through_window(drawn, aim.window, rays)


# --- backward ---


@ray_back
def pixel_back(drawn, place, bar, own):  # type: ignore[no-untyped-def]
    """Gradients of the rays' positions on the sensor to its first pixel, pitch and sensitive area."""
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


@ray_back
def window_back(drawn, window, rays, bar, own, of_scatter, out_points):  # type: ignore[no-untyped-def]
    """Gradients of slopes and weights through a window to positions, drawn points and its parameters."""
    points, start, n, flipped = drawn
    from_sensor, disc, scatter = window.from_sensor, window.disc, window.scatter
    narrowed = len(window.visible) > 0
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
                if narrowed:
                    a, b, _ = visible_point(window, rays[0, p], rays[1, p], a, b)
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
        # The share of the visible part, 1 without one: what the ray starts with.
        weight += bar[4, p] * rays[4, p] / window.solid_angle
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


@ray_back
def cell_back(drawn, images, cells, cell, rays, bar, of_cells):  # type: ignore[no-untyped-def]
    """Gradients of slopes and weights through a cell to positions, to the stop's image there and to the cell.

    Follows `vcc.plan.rays.aim_backwards` for `CellWindows.aimed` line by line. Sums: of cotangents of an image's
    middle, of these times the position, of its half size, of the cell's centre. ``of_cells``: (cells, kinds,
    borders) of `vcc.engines.ray_tables.RayGradients`, and a buffer for the sums, (2, 4).
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
        # Which border ends the chord. 0: the image; −1: the round opening; else a strip.
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


@ray_back
def image_back(images, cells, cell, sums, own, kinds):  # type: ignore[no-untyped-def]
    """Gradients from the sums of `cell_back` to the numbers from which `set_image` computes a cell's image."""
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
