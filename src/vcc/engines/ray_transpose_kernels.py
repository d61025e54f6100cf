"""The compiled kernels that trace rays as `vcc.engines.ray_kernels` does, and hand to samples what they carry.

Rays of neighbouring pixels meet the same samples, so they are first traced and put in the order of the views that
they meet, and then each row of views is handed what is its own, by one thread: nobody waits for another, the
samples of a view that are in use stay in the first-level cache, and every sum is taken in one order.
"""

from __future__ import annotations

import math

import numpy as np

from vcc.engines.compiled import compiled
from vcc.engines.ray_kernels import (
    PACKET,
    aim_rays,
    cells_at,
    corners_in_four_views,
    dark_from,
    first_point,
    may_find_light,
    middle_of,
    room,
    take_steps,
    to_indices,
    turn_to,
    views_of_ray,
    weights_in_four_views,
)
from vcc.engines.ray_tables import Drawn
from vcc.engines.vector_gather import spread_views_of_1, spread_views_of_3, spread_views_of_4

_compiled = compiled(borrowing=True, fastmath={"contract", "nsz"})
_inlined = compiled(borrowing=True, fastmath={"contract", "nsz"}, inline="always")
_allocating = compiled(fastmath={"contract", "nsz"})


@_inlined
def keep_rays(look, rays, n, pixel, found, filled):  # type: ignore[no-untyped-def]
    """Keep where those of n rays that meet the light field do; returns how many are kept now.

    Which do is said by `ray_kernels.add_rays`. Places are replaced by indices.
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


@_compiled
def put_in_order(found, filled):  # type: ignore[no-untyped-def]
    """Put the places that are kept in the order of their views."""
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
    for view in range(len(begin) - 1, 0, -1):  # each begins where the one before it ended
        begin[view] = begin[view - 1]
    begin[0] = 0


@_allocating
def find_tile(look, sensor, points, aim, steps, ended, start, tile, found):  # type: ignore[no-untyped-def]
    """Trace the pixels of a tile from its pixel ``start`` on, as long as there is room to keep what they meet.

    Returns:
        The number, in the tile, of the first pixel that was not traced: as many as there are once all were. After
        ``ended[0]`` is true it means nothing.
    """
    return find_pixels(look, sensor, points, aim, steps, ended, start, tile, found, room())


@_compiled
def find_pixels(look, sensor, points, aim, steps, ended, start, tile, found, within):  # type: ignore[no-untyped-def]
    """As `find_tile`, within what `vcc.engines.ray_kernels.room` gives."""
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


@_compiled
def spread_view(grown, base, k, l, weight, weights, pixel):  # type: ignore[no-untyped-def]
    """Add to a view's samples around (k, l) what they add to a pixel; the transpose of `ray_kernels.add_view`."""
    values, (_, _, rows, columns), channels, _, _ = grown
    k0, l0 = math.floor(k), math.floor(l)
    fk, fl = k - k0, l - l0
    c, r = int(k0), int(l0)
    for dr in range(2):
        for dc in range(2):
            if c + dc >= 0 and c + dc < columns and r + dr >= 0 and r + dr < rows:
                w = np.float32(weight * (fl if dr else 1.0 - fl) * (fk if dc else 1.0 - fk))
                at = base + ((r + dr) * columns + c + dc) * channels
                for channel in range(channels):
                    values[at + channel] += w * weights[pixel + channel]


@_compiled
def spread_row(grown, weights, ordered, begin, row):  # type: ignore[no-untyped-def]
    """Hand to samples what the rays carry whose first view is in a row of views.

    That are samples of this row of views and, where rays lie between views, of the next one.

    Args:
        grown: `vcc.engines.ray_tables.Grown`.
        weights: of the pixels' values, flat, float32.
        ordered: (tiles, rays, 6), what was found in some tiles, whose order is that of sums.
        begin: (tiles, views + 1), where each view's begin; see `vcc.engines.ray_tables.Found`.
        row: of views.
    """
    values, (nv, nu, nt, ns), channels, motion, between = grown
    # As in `ray_kernels.add_rays`.
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
                    k0, l0 = k + motion[0, 0] * (i - column), l + motion[1, 1] * (j - row)
                    k1, l1 = k0 - motion[0, 0], l0 - motion[1, 1]
                    kf0, kf1, lf0, lf1 = math.floor(k0), math.floor(k1), math.floor(l0), math.floor(l1)
                    inside = (
                        min(kf0, kf1) >= 0
                        and max(kf0, kf1) < ns - 1
                        and min(lf0, lf1) >= 0
                        and max(lf0, lf1) < nt - 1
                    )
                    if inside:
                        c0, c1 = int(kf0) * channels, int(kf1) * channels
                        r0, r1 = int(lf0) * line, int(lf1) * line
                        parts = (k0 - kf0, k1 - kf1), (l0 - lf0, l1 - lf1)
                        corners = corners_in_four_views(base, (c0, c1), (r0, r1), picture, row_of_views)
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
