"""The ray kernel for the GPU: a thread traces all rays of a pixel, with the functions of the CPU kernel.

These functions take packets of rays; here a packet has one ray. Aiming, steps and drawing are exactly those of
`vcc.engines.ray_aims` and `vcc.engines.ray_steps`; only the lookup in the light field differs, without vector
instructions. A thread adds the results of its rays in order: threads do not wait for each other, and every run
gives the same bytes.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from vcc.engines import ray_aims, ray_lookup, ray_steps
from vcc.engines.cuda_arrays import cuda, device, float32, float64, int64
from vcc.engines.ray_tables import Drawn, Packet, Samples

FLUSHED = 256
"""Rays summed in single precision, as many as in a packet on the CPU; these sums are added in double precision."""
CELLS = 256
"""Largest number of cells through which a pixel is traced, as on the CPU."""

_at_pixel = device(ray_aims.at_pixel)
_through_window = device(ray_aims.through_window)
_through_cell = device(ray_aims.through_cell)
_take_steps = device(ray_steps.take_steps)
_to_indices = device(ray_lookup.to_indices)
_add_view = device(ray_lookup.add_view)
_views_of_ray = device(ray_lookup.views_of_ray)
_dark_from = device(ray_lookup.dark_from)
_may_find_light = device(ray_lookup.may_find_light)


@cache
def trace(channels: int, by_cell: bool) -> Any:
    """The kernel that traces rays of a camera, for light fields with this number of channels.

    Args:
        channels: values per sample.
        by_cell: whether rays are aimed through the cells of an array.
    """

    @cuda.jit
    def kernel(field, sensor, points, aim, steps, pictures, tallies):  # type: ignore[no-untyped-def]
        """As `vcc.engines.ray_loops.add_pixels`, with its arguments, for all pixels.

        pictures: (2, rows, columns, channels): the sums of the two halves of a pixel's rays.
        tallies: (rows, columns), number of rays.
        """
        x0, y0 = cuda.grid(2)
        wide, high = cuda.gridsize(2)
        table, samples, _, seed = points
        cells = aim.cells
        there = Samples(field.samples.values, field.samples.views, channels)
        x, y, s = cuda.local.array(1, float64), cuda.local.array(1, float64), cuda.local.array(1, float64)
        t, share = cuda.local.array(1, float64), cuda.local.array(1, float64)
        rays = Packet(x, y, s, t, share)
        flipped, images = cuda.local.array(4, int64), cuda.local.array((2, 5), float64)
        near = cuda.local.array((CELLS if by_cell else 1, 2), int64)
        found, total = cuda.local.array(channels, float32), cuda.local.array(channels, float64)
        for row in range(y0, sensor.rows, high):
            for column in range(x0, sensor.columns, wide):
                pixel, middle = row * sensor.columns + column, ray_aims.middle_of(sensor, row, column)
                first = ray_aims.first_point(points, pixel)
                seen = ray_aims.cells_at(by_cell, cells, middle, sensor.sensitive, near)
                sent = int64(0)
                for half in range(2):
                    for c in range(channels):
                        total[c] = 0
                        found[c] = 0
                    for q in range(seen):
                        ray_aims.turn_to(by_cell, cells, seed, pixel, near, q, images, flipped)
                        begin = half * (samples // 2)
                        for p in range(begin, begin + samples // 2):
                            drawn = Drawn(table, first + p, 1, flipped)
                            _at_pixel(drawn, middle, sensor.sensitive, rays)
                            if by_cell:
                                _through_cell(drawn, images, cells, rays)
                            else:
                                _through_window(drawn, aim.window, rays)
                            if share[0] > 0:
                                sent += 1
                                _take_steps(steps, drawn, rays)
                                look_up(field, there, rays, found)
                            if p % FLUSHED == FLUSHED - 1 or p == begin + samples // 2 - 1:
                                for c in range(channels):
                                    total[c] += found[c]
                                    found[c] = 0
                    for c in range(channels):
                        pictures[half, row, column, c] = total[c] * field.scale / samples
                tallies[row, column] = sent

    return kernel


@cuda.jit(device=True)
def look_up(field, samples, rays, found):  # type: ignore[no-untyped-def]
    """Add a ray's interpolated sample to ``found`` (channels); `vcc.engines.ray_lookup.add_rays` for one ray."""
    _, _, index_from_ray, motion, between = field
    _, views, channels = samples
    nv, nu, nt, ns = views
    weight = rays.share[0]
    if weight == 0:
        return
    _to_indices(index_from_ray, rays, 1)
    i, j, k, l = rays.x[0], rays.y[0], rays.s[0], rays.t[0]
    if not _may_find_light(i, j, k, l, views, _dark_from(motion)):
        return
    picture = nt * ns * channels
    i0, j0, fi, fj = _views_of_ray(i, j, nu, nv, between)
    if not between:
        _add_view(samples, (j0 * nu + i0) * picture, k, l, float32(weight), found)
        return
    for dj in range(2):
        for di in range(2):
            w = weight * (fj if dj == 1 else 1.0 - fj) * (fi if di == 1 else 1.0 - fi)
            if w == 0.0:
                continue
            away_i, away_j = i - (i0 + di), j - (j0 + dj)
            view_k = k + motion[0, 0] * away_i + motion[0, 1] * away_j
            view_l = l + motion[1, 0] * away_i + motion[1, 1] * away_j
            base = ((j0 + dj) * nu + i0 + di) * picture
            _add_view(samples, base, view_k, view_l, float32(w), found)


@cuda.jit
def put_together(halves):  # type: ignore[no-untyped-def]
    """Replace two halves, (2, numbers), by their sum and twice their difference."""
    for n in range(cuda.grid(1), halves.shape[1], cuda.gridsize(1)):
        one, two = halves[0, n], halves[1, n]
        halves[0, n] = one + two
        halves[1, n] = float32(2) * (one - two)


@cuda.jit
def count(tallies, of_columns):  # type: ignore[no-untyped-def]
    """The number of rays of each column of pixels: neighbouring threads read neighbouring pixels."""
    for column in range(cuda.grid(1), tallies.shape[1], cuda.gridsize(1)):
        total = int64(0)
        for row in range(tallies.shape[0]):
            total += tallies[row, column]
        of_columns[column] = total
