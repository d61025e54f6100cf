"""The compiled loops over pixels, packets and tiles that trace rays; see `vcc.engines.ray_tables`.

One loop serves every camera: the steps of a ray are a list of numbers, `vcc.engines.ray_steps`. A packet holds
the rays of one pixel, or of several neighbours that have few rays each. Its stages are separate functions,
compiled once for all loops and all types of samples: inlined in each loop, they took three times as long to
compile. Python allocates the arrays that loops work in: a wrapper kernel that did so was optimised with the
whole loop in it a second time.

`add_pixels` sums the samples that the rays of each pixel read. The transpose to samples has two stages, because
rays of neighbouring pixels read the same samples. `find_tile` traces the rays and sorts them by the view that
they read; then one thread per row of views adds the gradients of this row (`spread_row`). Threads do not wait
for each other, the samples of a view stay in the first-level cache, and every sum has a fixed order. For
gradients to parameters, the state of a packet before each step is stored, and `gradients_of_tiles` goes backward
through the steps.
"""

from __future__ import annotations

import numpy as np

from vcc.engines.compiled import ray_back, ray_back_inlined, ray_inlined, ray_inner, ray_loop
from vcc.engines.ray_aims import (
    aim_rays,
    at_pixel,
    cell_back,
    cells_at,
    first_point,
    hashed,
    middle_of,
    pixel_back,
    through_cell,
    through_window,
    turn_to,
    window_back,
)
from vcc.engines.ray_lookup import (
    add_rays,
    corners_in_four_views,
    dark_from,
    field_back,
    may_find_light,
    places_in_four_views,
    spread_view,
    to_indices,
    views_of_ray,
    weights_in_four_views,
)
from vcc.engines.ray_steps import moved_back, packet_of, step_back, step_on, take_few_steps, take_steps
from vcc.engines.ray_tables import Drawn, Packet
from vcc.engines.vector_gather import spread_views_of_1, spread_views_of_3, spread_views_of_4
from vcc.plan.rays.points import DIGITS, FIRST_COLUMNS

PACKET = 256
"""Rays of a packet: their six numbers each stay in the first-level cache."""
TOGETHER = 64
"""Rays up to which pixels share a packet: loops over fewer do not pay for their start."""


@ray_inlined
def part_of(rays, first, n):  # type: ignore[no-untyped-def]
    """n rays of a packet. Loops that begin at 0 need no check for places before the array, so they vectorise."""
    end = first + n
    return Packet(
        rays.x[first:end], rays.y[first:end], rays.s[first:end], rays.t[first:end], rays.share[first:end]
    )


@ray_inner
def add_packet(field, begin, steps, few, rare, drawn, rays, owners, pictures, sums):  # type: ignore[no-untyped-def]
    """Take a packet of rays through the steps, and add the samples that they read to the pixels of the packet.

    Args:
        field: as for `add_pixels`, like the other arguments that are not listed here.
        drawn: all rays of the packet; scattering steps read its points, and then it is of one pixel.
        rays: of the pixels in ``owners``, one after the other, equally many each.
        owners: (pixels, 4): number, row and column of a pixel, and which of its rays begins the second half.
    """
    samples = field.samples
    channels, (sums, totals, tally, _) = samples.channels, sums
    if few is not None:
        take_few_steps(steps, drawn, rays)
    if rare is not None:
        take_steps(steps, drawn, rays)
    to_indices(field.index_from_ray, rays, drawn.rays)
    n = drawn.rays // len(owners)
    factor = field.scale / tally[2]
    # Vector code keeps left and right pixels of the samples in separate lanes: add them.
    apart = channels == 1 or channels == 3 or channels == 4
    for number in range(len(owners)):
        pixel = owners[number, 0]
        if pixel != tally[1]:  # else the pixel has rays in the packet before this one, or through another cell
            totals[:] = 0
            tally[1] = pixel
        add_rays(field, begin, part_of(rays, number * n, n), n, owners[number, 3], sums)
        row, column = owners[number, 1], owners[number, 2]
        for half in range(2):  # single precision within a packet, double across packets
            for lane in range(sums.shape[1]):
                totals[half, lane] += sums[half, lane]
                sums[half, lane] = 0
        for channel in range(channels):
            one, two = totals[0, channel], totals[1, channel]
            if apart:
                one, two = one + totals[0, channels + channel], two + totals[1, channels + channel]
            one, two = one * factor, two * factor
            pictures[0, row, column, channel] = one + two
            pictures[1, row, column, channel] = 2 * (one - two)


@ray_loop
def add_pixels(field, begin, sensor, points, window, cells, steps, few, rare, ended, pictures, tile, within, sums):  # type: ignore[no-untyped-def]
    """Trace the pixels of a tile into pictures (2, rows, columns, channels); arguments: `vcc.engines.ray_tables`.

    The first picture is the sum over all rays of a pixel, the second the difference of the two halves; both are
    zero before. The kernel returns once ``ended[0]`` is true (cancelled).

    Args:
        field: whole views, or parts of them.
        begin: where the parts begin.
        window: where to aim, or None if there are cells. Branches on None are not compiled.
        cells: the cells to aim through, or None.
        steps: the steps of the rays.
        few: True if all steps are in `FEW`, else None.
        rare: None if all steps are in `FEW`, else True.
        within: as returned by `vcc.engines.rays_compiled.working_arrays`.
        sums: of a pixel in a packet, float32, and of a pixel, (2, lanes) each; (3,): the number of traced rays,
            the pixel of the second sum, and the rays of a pixel; the pixels of a packet, see `add_packet`.
    """
    table, samples, _, seed = points
    rays, near, images, flipped = within
    tally, owners = sums[2], sums[3]
    tally[1], tally[2] = -1, samples
    n = min(PACKET, samples)
    most = max(TOGETHER // n, 1) if len(table) == FIRST_COLUMNS else 1  # diffusers have further columns
    filled = 0
    for row in range(tile.first_row, min(tile.end_row, sensor.rows)):
        for column in range(tile.first_column, min(tile.end_column, sensor.columns)):
            if ended[0]:
                return
            pixel, middle = row * sensor.columns + column, middle_of(sensor, row, column)
            first = first_point(points, pixel)
            seen = 1
            if cells is not None:
                seen = cells_at(True, cells, middle, sensor.sensitive, near)
            for q in range(seen):
                if window is not None:
                    for digit in range(4):
                        flipped[digit] = hashed(pixel, seed + 1 + digit) >> np.uint32(32 - DIGITS)
                if cells is not None:
                    turn_to(True, cells, seed, pixel, near, q, images, flipped)
                for done in range(0, samples, PACKET):
                    at = filled * n
                    drawn, own = Drawn(table, first + done, n, flipped), part_of(rays, at, n)
                    at_pixel(drawn, middle, sensor.sensitive, own)
                    if window is not None:
                        through_window(drawn, window, own)
                    if cells is not None:
                        through_cell(drawn, images, cells, own)
                    sent = 0
                    for p in range(n):
                        sent += own.share[p] > 0.0
                    if sent == 0:
                        continue
                    tally[0] += sent
                    owner = owners[filled]
                    owner[0], owner[1], owner[2], owner[3] = pixel, row, column, samples // 2 - done
                    filled += 1
                    if filled == most:
                        packet = Drawn(table, first + done, at + n, flipped)
                        add_packet(field, begin, steps, few, rare, packet, rays, owners[:filled], pictures, sums)
                        filled = 0
    if filled > 0:
        packet = Drawn(table, 0, filled * n, flipped)
        add_packet(field, begin, steps, few, rare, packet, rays, owners[:filled], pictures, sums)


# --- back to samples ---


@ray_inlined
def keep_rays(look, rays, n, pixel, found, filled):  # type: ignore[no-untyped-def]
    """Store the places of those of n rays that reach the light field; return how many places are stored now.

    The same rays as in `ray_lookup.add_rays`. Places in ``rays`` are replaced by indices.
    """
    all_views, index_from_ray, motion, between = look
    nv, nu, _, _ = all_views
    x, y, s, t, share = rays
    places, views = found.places, found.views
    to_indices(index_from_ray, rays, n)
    dark = dark_from(motion)
    for p in range(n):
        i, j, k, l = x[p], y[p], s[p], t[p]
        if share[p] == 0.0 or not may_find_light(i, j, k, l, all_views, dark):
            continue
        i0, j0, _, _ = views_of_ray(i, j, nu, nv, between)
        places[filled, 0], places[filled, 1], places[filled, 2] = x[p], y[p], k
        places[filled, 3], places[filled, 4], places[filled, 5] = l, share[p], pixel
        views[filled] = j0 * nu + i0
        filled += 1
    return filled


@ray_loop
def put_in_order(found, filled):  # type: ignore[no-untyped-def]
    """Sort the stored places by view."""
    places, views, ordered, begin = found
    begin[:] = 0
    for p in range(filled):
        begin[views[p] + 1] += 1
    for view in range(1, len(begin)):
        begin[view] += begin[view - 1]
    for p in range(filled):
        to, view = begin[views[p]], views[p]
        for n in range(6):
            ordered[to, n] = places[p, n]
        begin[view] += 1
    for view in range(len(begin) - 1, 0, -1):  # each view begins where the one before it ends
        begin[view] = begin[view - 1]
    begin[0] = 0


@ray_loop
def find_tile(look, sensor, points, aim, steps, ended, start, tile, found, within):  # type: ignore[no-untyped-def]
    """Trace the pixels of a tile from its pixel ``start`` on, until the buffers for their places are full.

    ``within``: as returned by `vcc.engines.rays_compiled.working_arrays`.

    Returns:
        The number, in the tile, of the first pixel that was not traced; the number of pixels if all were.
        Undefined once ``ended[0]`` is true.
    """
    table, samples, _, seed = points
    cells = aim.cells
    rays, near, images, flipped = within
    share = rays.share
    columns = min(tile.end_column, sensor.columns) - tile.first_column
    pixels = (min(tile.end_row, sensor.rows) - tile.first_row) * columns
    filled, number = 0, start
    while number < pixels and not ended[0]:
        row, column = tile.first_row + number // columns, tile.first_column + number % columns
        pixel, middle = row * sensor.columns + column, middle_of(sensor, row, column)
        seen = cells_at(aim.by_cell, cells, middle, sensor.sensitive, near)
        if filled + seen * samples > len(found.places):
            break
        first = first_point(points, pixel)
        for q in range(seen):
            turn_to(aim.by_cell, cells, seed, pixel, near, q, images, flipped)
            for done in range(0, samples, PACKET):
                n = min(PACKET, samples - done)
                drawn = Drawn(table, first + done, n, flipped)
                aim_rays(aim, drawn, middle, sensor.sensitive, images, rays)
                sent = 0
                for p in range(n):
                    sent += share[p] > 0.0
                if sent == 0:
                    continue
                take_steps(steps, drawn, rays)
                filled = keep_rays(look, rays, n, pixel, found, filled)
        number += 1
    put_in_order(found, filled)
    return number


@ray_loop
def spread_row(grown, weights, ordered, begin, row):  # type: ignore[no-untyped-def]
    """Add the gradients of the rays whose first view is in a row of views to the samples.

    These are samples of this row of views and, for rays between views, of the next row.

    Args:
        grown: `vcc.engines.ray_tables.Grown`.
        weights: of the pixels' values, flat, float32.
        ordered: (tiles, rays, 6), the sorted places of some tiles; sums follow the order of tiles.
        begin: (tiles, views + 1), where each view begins; see `vcc.engines.ray_tables.Found`.
        row: the row of views.
    """
    values, (nv, nu, nt, ns), channels, motion, between = grown
    # As in `ray_lookup.add_rays`.
    parted = between and motion[0, 1] == 0.0 and motion[1, 0] == 0.0 and nu > 1 and nv > 1
    vectors = parted and (channels == 1 or channels == 3 or channels == 4)
    line, picture, row_of_views = ns * channels, nt * ns * channels, nu * nt * ns * channels
    for tile in range(len(ordered)):
        places = ordered[tile]
        for column in range(nu):
            view = row * nu + column
            base = row * row_of_views + column * picture
            for p in range(begin[tile, view], begin[tile, view + 1]):
                i, j, k, l = places[p, 0], places[p, 1], places[p, 2], places[p, 3]
                weight, pixel = places[p, 4], int(places[p, 5]) * channels
                if not between:
                    spread_view(grown, base, k, l, weight, weights, pixel)
                    continue
                fi, fj = min(max(i, 0.0), nu - 1.0) - column, min(max(j, 0.0), nv - 1.0) - row
                if vectors:
                    (c0, c1), (r0, r1), parts = places_in_four_views(motion, i - column, j - row, k, l)
                    if min(c0, c1) >= 0 and max(c0, c1) < ns - 1 and min(r0, r1) >= 0 and max(r0, r1) < nt - 1:
                        across, down = (c0 * channels, c1 * channels), (r0 * line, r1 * line)
                        corners = corners_in_four_views(base, across, down, picture, row_of_views)
                        rows, columns = weights_in_four_views(weight, fi, fj, parts)
                        if channels == 3:
                            spread_views_of_3(values, corners, line, rows, columns, weights, pixel)
                        elif channels == 1:
                            spread_views_of_1(values, corners, line, rows, columns, weights, pixel)
                        else:
                            spread_views_of_4(values, corners, line, rows, columns, weights, pixel)
                        continue
                for dj in range(2):
                    wj = weight * (fj if dj else 1.0 - fj)
                    if wj == 0.0:
                        continue
                    for di in range(2):
                        w = wj * (fi if di else 1.0 - fi)
                        if w == 0.0:
                            continue
                        away_i, away_j = i - (column + di), j - (row + dj)
                        view_k = k + motion[0, 0] * away_i + motion[0, 1] * away_j
                        view_l = l + motion[1, 0] * away_i + motion[1, 1] * away_j
                        beside = base + dj * row_of_views + di * picture
                        spread_view(grown, beside, view_k, view_l, w, weights, pixel)


# --- back to numbers ---


@ray_back_inlined
def lit_by(share, n, lit):  # type: ignore[no-untyped-def]
    """Set ``lit`` to 1 for rays that carry light, else to 0; return how many do."""
    number = 0
    for p in range(n):
        carries = share[p] > 0.0
        lit[p] = 1.0 if carries else 0.0
        number += carries
    return number


@ray_back_inlined
def packet_back(field, drawn, aim, images, cell, steps, place, weights, ways, gradients):  # type: ignore[no-untyped-def]
    """Trace a packet of rays from the sensor (``ways[0][0]``), and go backward with the samples that they read.

    ``ways``: (state of the rays before each step, behind the last one, and as indices, (steps + 2, 5, rays); 1
    for rays that are not stopped; cotangents (5, rays); a buffer of two numbers per ray; a buffer for
    `cell_back`).
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
        field_back(
            field, weights[place[0], place[1]], n, kept[number + 1], lit, bar, gradients.motion, gradients.scale
        )
        moved_back(field.index_from_ray.reshape(-1), n, kept[number], bar, gradients.indices)
        of_steps = gradients.steps, gradients.matrices, gradients.shares, gradients.slopes, gradients.points
        for step in range(number - 1, -1, -1):
            step_back(steps, step, drawn, kept[step], bar, found, of_steps)
        if aim.by_cell:
            of_cells = gradients.cells, gradients.kinds, gradients.borders, sums
            cell_back(drawn, images, aim.cells, cell, kept[0], bar, of_cells)
        else:
            window_back(drawn, aim.window, kept[0], bar, gradients.window, gradients.scatter, gradients.points)
        pixel_back(drawn, place, bar, gradients.sensor)


@ray_back
def gradients_of_tiles(field, sensor, points, aim, steps, weights, ended, gradients, tiles, within, ways):  # type: ignore[no-untyped-def]
    """Add the gradients of the pixels of some tiles to ``gradients``; arguments: `vcc.engines.ray_tables`.

    ``weights``: of the image, (rows, columns, channels). ``tiles``: (tiles, 4). ``within``: as returned by
    `vcc.engines.rays_compiled.working_arrays`. ``ways``: see `packet_back`. The kernel returns once ``ended[0]``
    is true (cancelled).
    """
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
                        packet_back(
                            field, drawn, aim, images, near[q], steps, (row, column), weights, ways, gradients
                        )
