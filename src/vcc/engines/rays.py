"""Trace rays plainly, on arrays of any library, with gradients.

`vcc.plan.rays.model.Rays.looked_up` of the core traces them; it defines the correct result.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from array_api_compat import array_namespace, device
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.progress import Progress, tell
from vcc.fields.sampled import to_dtype
from vcc.plan.protocol import Partial
from vcc.plan.rays.model import Rays

Array = NDArray[np.float64]

RAYS_AT_ONCE = 2**17
"""Number of rays traced at once in NumPy; they need some tens of MiB."""


def traced(core: Rays, values: Any, double: bool, beside: int, progress: Progress | None = None) -> Partial:
    """The raster from one round of rays. Places and weights are NumPy arrays, samples arrays of any library.

    Args:
        core: the rays to trace.
        values: samples (v, u, t, s[, channels]).
        double: sum in double precision whatever the type of the samples.
        beside: 0 for the blocks of points of the first round, 1 for the blocks next to them.
        progress: called with (done, total) in pixels.
    """
    xp = array_namespace(values)
    channels = values.shape[4] if values.ndim == 5 else 1
    working = xp.float64 if double or to_dtype(values) == np.float64 else xp.float32
    samples = xp.reshape(xp.astype(values, working), (-1, channels))
    rows, columns = core.raster_shape
    halves: tuple[list[Any], list[Any]] = [], []
    rays = 0
    for pixel in pieces(core, RAYS_AT_ONCE):
        index, share = core.looked_up(pixel, core.block(pixel) ^ beside)
        inside = core.inside(index)
        rays += int(np.count_nonzero(share))
        found = _found(core, xp, samples, index, share * inside, working)  # (pixels, cells, samples, channels)
        half = core.samples // 2
        halves[0].append(xp.sum(found[:, :, :half, :], axis=(1, 2)) * core.scale)
        halves[1].append(xp.sum(found[:, :, half:, :], axis=(1, 2)) * core.scale)
        tell(progress, int(pixel[-1]) + 1, rows * columns)
    one, two = (xp.reshape(xp.concat(half, axis=0), (rows, columns, channels)) for half in halves)
    return Partial(one + two, 2 * (one - two), rays, core.samples)


def scattered(
    core: Rays, shape: tuple[int, ...], raster: NDArray[Any], beside: int, progress: Progress | None = None
) -> Array:
    """The transpose of `traced`: the derivative of a weighted raster to each sample, in double precision.

    Args:
        core: the rays to trace.
        shape: of the samples, (v, u, t, s[, channels]).
        raster: the weights, (rows, columns, channels).
        beside: as for `traced`.
        progress: called with (done, total) in pixels.
    """
    rows, columns = core.raster_shape
    channels = raster.shape[2]
    weights = np.reshape(raster, (rows * columns, channels)).astype(np.float64) * core.scale
    samples = np.zeros((channels, math.prod(core.views)))
    for pixel in pieces(core, RAYS_AT_ONCE):
        index, share = core.looked_up(pixel, core.block(pixel) ^ beside)
        inside = core.inside(index)
        for at, weight in _looked_at(core, index, share * inside):
            for channel, line in enumerate(samples):
                carried = weight * weights[pixel, channel][:, None, None]
                np.add.at(line, at.reshape(-1), carried.reshape(-1))
        tell(progress, int(pixel[-1]) + 1, rows * columns)
    return np.ascontiguousarray(samples.T).reshape(shape)


def memory_of_rays(core: Rays) -> int:
    """Estimated bytes that plain tracing needs besides the samples and the raster."""
    rays = min(RAYS_AT_ONCE, core.rays)
    return int(
        core.points.nbytes + core.tables_bytes + 8 * 40 * rays
    )  # places, slopes, indices, looked-up samples


def pieces(core: Rays, rays: int) -> Iterator[NDArray[np.int64]]:
    """Yield the numbers of consecutive pixels, in groups of about ``rays`` rays."""
    at_once = max(rays // (core.samples * core.most_cells), 1)
    total = core.raster_shape[0] * core.raster_shape[1]
    for first in range(0, total, at_once):
        yield np.arange(first, min(first + at_once, total))


def _found(core: Rays, xp: Any, samples: Any, index: Array, share: Array, working: Any) -> Any:
    """Samples interpolated in four dimensions at the places of rays, times the rays' shares."""
    total = None
    for at, weight in _looked_at(core, index, share):
        where = xp.asarray(at.reshape(-1), device=device(samples))
        taken = xp.reshape(xp.take(samples, where, axis=0), (*at.shape, samples.shape[1]))
        found = taken * xp.asarray(weight[..., None], dtype=working, device=device(samples))
        total = found if total is None else total + found
    return total


def _looked_at(core: Rays, index: Array, share: Array) -> Iterator[tuple[NDArray[np.int64], Array]]:
    """The samples around each ray: their numbers in memory, and the weight of each in the interpolated value."""
    for view in views_around(core, index):
        for at, inside, (across, down), _ in samples_around(core, view):
            yield at, share * (view.near[0] * view.near[1]) * across * down * inside


@dataclass(frozen=True, eq=False, repr=False)
class ViewAround(Brief):
    """One of the views next to which rays fall.

    Args:
        number: number of the view in memory order.
        near: its weight along (i, j).
        steep: derivatives of these weights.
        away: (2, …), distance of the rays from the view, in views (i, j).
        place: (2, …), position of the rays on its pixels (k, l), with parallax.
    """

    number: NDArray[np.int64]
    near: tuple[Array, Array]
    steep: tuple[Array, Array]
    away: Array
    place: Array


def views_around(core: Rays, index: Array) -> Iterator[ViewAround]:
    """The views around each ray, or the nearest view if views are not interpolated.

    Args:
        core: the rays.
        index: places in the light field, (…, 4).
    """
    nv, nu = core.views[:2]
    i, j, k, l = np.moveaxis(index, -1, 0)
    along_v = _along(j, nv, core.between_views)
    for view_i, near_i, steep_i in _along(i, nu, core.between_views):
        for view_j, near_j, steep_j in along_v:
            away = np.stack([i - view_i, j - view_j])
            moved = np.tensordot(core.motion, away, axes=1) if core.between_views else np.zeros_like(away)
            place = np.clip(np.stack([k, l]) + moved, -1e9, 1e9)
            yield ViewAround(view_j * nu + view_i, (near_i, near_j), (steep_i, steep_j), away, place)


def _along(at: Array, number: int, between: bool) -> list[tuple[NDArray[np.int64], Array, Array]]:
    """The views around rays along one axis: (number, weight, derivative of the weight)."""
    held = np.clip(at, 0, number - 1)
    if not between or number == 1:
        return [((held + 0.5).astype(np.int64), np.ones_like(at), np.zeros_like(at))]
    first = np.minimum(held.astype(np.int64), number - 2)
    inside = np.where((at >= 0) & (at <= number - 1), 1.0, 0.0)
    return [(first, 1 - (held - first), -inside), (first + 1, held - first, inside)]


Weights = tuple[Array, Array]


def samples_around(
    core: Rays, view: ViewAround
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.bool_], Weights, tuple[int, int]]]:
    """The four samples of a view around each ray; samples outside the view are dark.

    Yields:
        The sample's number in memory order; whether it is inside the view; its weights (across, down); and the
        signs of their derivatives.
    """
    _, _, nt, ns = core.views
    first = np.floor(view.place).astype(np.int64)
    part = view.place - first
    for dk in range(2):
        for dl in range(2):
            c, r = first[0] + dk, first[1] + dl
            inside = (c >= 0) & (c < ns) & (r >= 0) & (r < nt)
            at = (view.number * nt + np.clip(r, 0, nt - 1)) * ns + np.clip(c, 0, ns - 1)
            weights = np.abs(1 - dk - part[0]), np.abs(1 - dl - part[1])
            yield at, inside, weights, (2 * dk - 1, 2 * dl - 1)
