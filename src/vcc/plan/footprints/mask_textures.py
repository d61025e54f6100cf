"""Masks as textures of what samples average of them, and how well textures show it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcc.plan.footprints.model import MaskLookup
from vcc.plan.footprints.planes import Plane, tap_origin
from vcc.plan.sharpening import TENT, gain, symmetric
from vcc.shapes.patterns import Pattern

Array = NDArray[np.float64]

TEXTURE_POINTS_PER_FOOTPRINT = 3
"""Weights are looked up linearly between texture points this fine; what that takes is given back beforehand."""
LARGEST_TEXTURE = 4096
"""Points a side of a mask texture: 64 MiB."""
POINTS_AT_ONCE = 2**20
"""Points of a texture that are averaged at once, in float64: 8 MiB."""
DIVIDED = 4
"""Samples before the first and after the last at which finer ones may stand."""
TEXTURE_FILTER = 5
"""Weights on each side of a texture's filter, beside those that the box of a sample takes."""


def mask_lookup(
    plane: Plane,
    index: Array,
    shift: Array,
    motion: Array,
    samples: tuple[int, int],
    divide: int,
    fine: int,
    over_samples: bool = True,
) -> MaskLookup:
    """The mask averaged over a sample's footprint, as a texture, and where each sample reads it.

    Args:
        plane: the mask.
        index: of the views, (rows of taps, columns of taps, 2).
        shift: of the taps from them, in views.
        motion: see `tap_origin`.
        samples: (rows, columns) of a view.
        divide: parts of a view's cell, each way.
        fine: parts of a sample, each way.
        over_samples: whether to average over the sample's cell besides that of the view: samples that are points
            meet the mask in a point.
    """
    place = tap_origin(plane.at_index, plane.offset, index, shift, motion)
    view_part = np.abs(plane.view_step(motion)).sum(axis=1) / divide
    sample_part = np.abs(plane.sample_step).sum(axis=1) / fine * over_samples
    footprint = np.hypot(view_part, sample_part)
    bound = np.array(plane.pattern.size) / 2 + footprint
    low, high = _region(place, plane.sample_step, samples, bound)
    spacing = _spacing(footprint, np.minimum(2 * bound, high - low))
    # Points lie on one lattice, whatever part of the mask is needed: pieces of a light field read the same.
    first, last = np.floor(low / spacing) - 1, np.ceil(high / spacing) + 1
    last = np.maximum(last, first + 2)
    start = first * spacing
    return MaskLookup(
        texture=_texture(plane.pattern, (first, last), spacing, (view_part, sample_part)),
        column=(place[..., 0] - start[0]) / spacing[0],
        row=(place[..., 1] - start[1]) / spacing[1],
        step=_cleaned(plane.sample_step / spacing[:, None], samples),
        label=plane.label,
    )


def _region(place: Array, step: Array, samples: tuple[int, int], bound: Array) -> tuple[Array, Array]:
    """The lowest and the highest (x, y) at which samples, and finer ones around them, read within ± bound.

    Args:
        place: of sample (0, 0) of each tap, (..., 2).
        step: 2×2, from sample to sample.
        samples: (rows, columns) of a view.
        bound: half the size (x, y) of what there is to read.
    """
    rows, columns = samples
    ends = [[k, l] for k in (-DIVIDED, columns - 1 + DIVIDED) for l in (-DIVIDED, rows - 1 + DIVIDED)]
    corners = place.reshape(-1, 2)[:, None] + np.array(ends) @ step.T
    return np.maximum(corners.min(axis=(0, 1)), -bound), np.minimum(corners.max(axis=(0, 1)), bound)


def _spacing(footprint: Array, extent: Array) -> Array:
    """Distance between texture points along (x, y): a share of the footprint, doubled until the texture fits."""
    spacing = np.where(footprint > 0, footprint / TEXTURE_POINTS_PER_FOOTPRINT, np.maximum(extent, 1e-9) / 1024)
    too_many = np.maximum(extent / spacing / (LARGEST_TEXTURE - 4), 1.0)
    return np.asarray(spacing * 2 ** np.ceil(np.log2(too_many)))


def _texture(
    pattern: Pattern, ends: tuple[Array, Array], spacing: Array, boxes: tuple[Array, Array]
) -> NDArray[np.float32]:
    """Means of a pattern over two boxes, one after the other, at points of a lattice: (rows, columns).

    The wider box is taken by the pattern's own means, the other by a filter of the texture.

    Args:
        pattern: of the mask.
        ends: numbers (x, y) of the first and of the last point.
        spacing: (x, y) of the points, metres.
        boxes: their sizes (x, y), metres.
    """
    wide, narrow = np.maximum(*boxes), np.minimum(*boxes)
    filters = [_filter(float(width)) for width in narrow / spacing]
    x, y = (
        np.arange(first - len(weights) // 2, last + len(weights) // 2 + 1) * apart
        for first, last, weights, apart in zip(*ends, filters, spacing, strict=True)
    )
    means = np.empty((y.size, x.size), dtype=np.float32)
    for some in np.array_split(np.arange(y.size), -(-means.size // POINTS_AT_ONCE)):
        means[some] = pattern.mean(x[None, :], y[some, None], float(wide[0]), float(wide[1]))
    return _filtered(means, filters)


def _filter(box: float) -> Array:
    """The filter of a texture along one axis: a mean over a box, and what looking it up linearly takes.

    Args:
        box: its width in points of the texture.
    """
    return symmetric(
        lambda frequency: np.sinc(box * frequency) * gain(TENT, frequency), TEXTURE_FILTER + math.ceil(box / 2)
    )


def _filtered(means: NDArray[np.float32], filters: list[Array]) -> NDArray[np.float32]:
    """Means (rows, columns) filtered along columns and rows, without the margin that this takes."""
    from scipy.ndimage import convolve1d

    (across, down) = filters
    down_done = convolve1d(means, down, axis=0, mode="constant")[len(down) // 2 : len(means) - len(down) // 2]
    wide = convolve1d(down_done, across, axis=1, mode="constant")
    return np.ascontiguousarray(wide[:, len(across) // 2 : wide.shape[1] - len(across) // 2])


def texture_error(texture: NDArray[np.float32]) -> float:
    """By how much what is looked up between points of a texture errs, root mean square over all places.

    Textures make up for what linear interpolation takes, on average over places: of a curvature c, in points, what
    is looked up a of the way between two points errs by c/12 − c·a(1 − a)/2, whose root mean square is c/√720. The
    curvature is taken where the truth is known, at every second point between its neighbours.

    Args:
        texture: (rows, columns).

    Returns:
        A share of the largest value.
    """
    largest = float(texture.max(initial=0.0))
    if largest == 0:
        return 0.0
    squares = 0.0
    for along in (texture, texture.T):
        inner = along[:, : 1 + (along.shape[1] - 1) // 2 * 2]
        if inner.shape[1] >= 3:
            off = inner[:, 1:-1:2] - (inner[:, :-2:2] + inner[:, 2::2]) / 2  # half of the curvature
            squares += float(np.mean(np.square(off, dtype=np.float64)))
    return math.sqrt(squares) * 2 / math.sqrt(720) / largest


def _cleaned(step: Array, samples: tuple[int, int]) -> Array:
    """Steps across the texture, in points from sample to sample, without what is rounding over a whole view."""
    return np.where(np.abs(step) * max(samples) < 1e-6, 0.0, step)
