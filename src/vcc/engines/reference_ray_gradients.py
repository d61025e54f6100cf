"""Gradients of a raster by rays to the plan's parameters, plainly, in float64. They define the derivative.

    I(x, y) = scale · Σ_rays w · Π T · L(i, j, k, l),

each ray at fixed points of the table. Weights G of the raster give each ray the cotangent scale · Σ_c G_c · L_c
of its share and the cotangent share · scale · Σ_c G_c · ∂L_c/∂(i, j, k, l) of its place in the light field.
These go backward through the steps of the ray (`vcc.plan.rays.backwards`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.progress import Progress, tell
from vcc.engines.rays import ViewAround, pieces, samples_around, views_around
from vcc.plan.parameters import parameters
from vcc.plan.rays import edges
from vcc.plan.rays.aim_backwards import aim_back
from vcc.plan.rays.backwards import Numbers, back, moved_back
from vcc.plan.rays.model import Rays
from vcc.plan.rays.steps import Bundle

Array = NDArray[np.float64]

RAYS_AT_ONCE = 2**15
"""Number of rays whose states are stored at a time: some tens of MiB."""


def ray_gradients(
    core: Rays,
    values: NDArray[Any],
    raster: NDArray[np.floating],
    wanted: Collection[str],
    beside: int = 0,
    threads: int = 1,
    progress: Progress | None = None,
) -> Numbers:
    """The derivative of ⟨raster, raster of the samples⟩ to parameters of the core.

    Args:
        core: the rays to trace.
        values: samples (v, u, t, s[, channels]).
        raster: weights of the raster's values, (rows, columns, channels).
        wanted: names of parameters (`vcc.plan.parameters.numbers` of the core).
        beside: 0 for the blocks of points of the first round, 1 for the blocks next to them.
        threads: not used.
        progress: called with (done, total) in pixels.

    Returns:
        An array for each name, of the parameter's shape.

    Raises:
        InputError: a parameter that only moves a hard edge which rays meet.
    """
    edges.check_no_edge(core, wanted)
    channels = values.shape[4] if values.ndim == 5 else 1
    samples = values.reshape(-1, channels).astype(np.float64)
    found = {name: np.zeros_like(number) for name, number in parameters(core).items() if name in set(wanted)}
    weights = raster.reshape(-1, channels).astype(np.float64)
    for pixel in pieces(core, RAYS_AT_ONCE):
        for name, number in _of_pixels(core, samples, weights[pixel], pixel, core.block(pixel) ^ beside):
            if name in found:
                found[name] = found[name] + number
        tell(progress, int(pixel[-1]) + 1, len(weights))
    return {name: found[name] for name in wanted}


def _of_pixels(
    core: Rays, samples: Array, weights: Array, pixel: NDArray[np.int64], block: NDArray[np.int64]
) -> Iterator[tuple[str, Array]]:
    """Gradients to the parameters from the weights (pixels, channels) of some pixels, by name."""
    rays, cells = core.aimed(pixel, block)
    way = [replace(rays)]
    for step in core.steps:
        step(rays)
        way.append(replace(rays))
    behind, own = _looked_up_back(core, samples, weights, rays)
    yield from own.items()
    for n in reversed(range(len(core.steps))):
        behind, own = back(core.steps[n], way[n], behind)
        yield from ((f"steps[{n}].{name}", number) for name, number in own.items())
    each = replace(behind, share=behind.share / core.samples)  # a pixel is the mean over its rays
    behind, own = aim_back(core.aim, replace(way[0], share=way[0].share * core.samples), cells, each)
    yield from ((f"aim.{name}", number) for name, number in own.items())
    yield from _sensor_back(core, way[0], behind, pixel).items()
    points = np.zeros(core.points.shape)
    number = block[:, None, None] * core.samples + np.arange(core.samples)
    np.add.at(points, np.broadcast_to(number, rays.x.shape), behind.points)
    yield "points", points


def _sensor_back(core: Rays, rays: Bundle, behind: Bundle, pixel: NDArray[np.int64]) -> Numbers:
    """Backward of x = first pixel + column · pitch + place in the pixel · sensitive size, likewise y."""
    row, column = (each[:, None, None] for each in np.divmod(pixel, core.raster_shape[1]))
    both = ((behind.x, column, rays.points[..., 0]), (behind.y, row, rays.points[..., 1]))
    return {
        "first_pixel": np.array([g.sum() for g, _, _ in both]),
        "pitch": np.array([(g * number).sum() for g, number, _ in both]),
        "sensitive": np.array([(g * place).sum() for g, _, place in both]),
    }


@dataclass(repr=False)
class _Found(Brief):
    """Looked-up values of rays times their pixels' weights, and the derivatives.

    Args:
        value: (…).
        to_index: to (i, j, k, l), (…, 4).
        to_motion: 2×2, times ``carried``, summed over all rays.
    """

    value: Array
    to_index: Array
    to_motion: Array


def _looked_up_back(core: Rays, samples: Array, weights: Array, rays: Bundle) -> tuple[Bundle, Numbers]:
    """Cotangents of the rays at the end of their path, and gradients of the lookup's parameters."""
    index = core.index_from_ray(np.stack([rays.x, rays.y, rays.s, rays.t], axis=-1))
    inside = core.inside(index)
    found = _found(core, samples, weights[:, None, None], index, rays.share * inside * core.scale)
    carried = (rays.share * inside * core.scale)[..., None] * found.to_index
    behind, index_from_ray = moved_back(core.index_from_ray.matrix, rays, carried)
    share = inside * core.scale * found.value
    numbers = {
        "index_from_ray": index_from_ray,
        "motion": found.to_motion,
        "scale": np.asarray(np.sum(rays.share * inside * found.value)),
    }
    return replace(behind, share=share, points=np.zeros(rays.points.shape)), numbers


def _found(core: Rays, samples: Array, weights: Array, index: Array, carried: Array) -> _Found:
    """Values and derivatives at the places of rays, interpolated in four dimensions; see `vcc.engines.rays`.

    Args:
        core: the rays.
        samples: (samples, channels).
        weights: of the channels, (pixels, 1, 1, channels).
        index: (…, 4), places in the light field.
        carried: light of each ray.
    """
    value, to_index, to_motion = np.zeros(index.shape[:-1]), np.zeros_like(index), np.zeros((2, 2))
    for view in views_around(core, index):
        (near_i, near_j), (steep_i, steep_j) = view.near, view.steep
        here, to_k, to_l = _in_view(core, samples, weights, view)
        value += near_i * near_j * here
        of_view = near_i * near_j * np.stack([to_k, to_l])
        to_index[..., 0] += steep_i * near_j * here
        to_index[..., 1] += near_i * steep_j * here
        to_index[..., 2] += of_view[0]
        to_index[..., 3] += of_view[1]
        if core.between_views:
            to_index[..., :2] += np.moveaxis(np.tensordot(core.motion.T, of_view, axes=1), 0, -1)
            to_motion += (carried * of_view).reshape(2, -1) @ view.away.reshape(2, -1).T
    return _Found(value, to_index, to_motion)


def _in_view(core: Rays, samples: Array, weights: Array, view: ViewAround) -> tuple[Array, Array, Array]:
    """Values of a view at the places of rays, dark outside, times weights, and the derivatives to (k, l)."""
    value, to_k, to_l = (np.zeros(view.number.shape) for _ in range(3))
    for at, inside, (across, down), (sign_k, sign_l) in samples_around(core, view):
        sample = np.sum(weights * samples[at], axis=-1) * inside
        value += across * down * sample
        to_k += sign_k * down * sample
        to_l += sign_l * across * sample
    return value, to_k, to_l
