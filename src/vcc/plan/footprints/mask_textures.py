"""Masks as textures of what samples average of them, and how well textures show it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcc.plan.footprints.model import MaskLookup
from vcc.plan.footprints.planes import Plane, tap_origin
from vcc.plan.sharpening import symmetric
from vcc.shapes.patterns import Pattern

Array = NDArray[np.float64]

TEXTURE_POINTS_PER_FOOTPRINT = 3
"""Weights are quadratic B-splines of texture points this fine; what those take is given back beforehand."""
LARGEST_TEXTURE = 4096
"""Points a side of a mask texture: 64 MiB."""
POINTS_AT_ONCE = 2**20
"""Points of a texture that are averaged at once, in float64: 8 MiB."""
DIVIDED = 4
"""Samples before the first and after the last at which finer ones may stand."""
GIVEN_BACK = np.polynomial.polynomial.polypow([1, 1 / 6, 3 / 40, 5 / 112, 35 / 1152], 3)[:5]
"""The gain of a texture's filter in powers of sin² πν: a power of arcsin's series, see `_given_back`."""
TEXTURE_FILTER = 5
"""Weights on each side of a texture's filter, beside those that the box of a sample takes."""
AROUND = 2
"""Points of a texture around what is looked up: those of splines, and what the filter leaves beside an edge."""


def mask_lookup(
    plane: Plane,
    index: Array,
    shift: Array,
    motion: Array,
    samples: tuple[int, int],
    divide: int,
    fine: int,
    over_samples: bool = True,
    exact: bool = False,
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
        exact: whether the texture stays in double precision.
    """
    place = tap_origin(plane.at_index, plane.offset, index, shift, motion)
    view_part = np.abs(plane.view_step(motion)).sum(axis=1) / divide
    sample_part = np.abs(plane.sample_step).sum(axis=1) / fine * over_samples
    footprint = np.hypot(view_part, sample_part)
    bound = np.array(plane.pattern.size) / 2 + footprint
    low, high = _region(place, plane.sample_step, samples, bound)
    spacing = _spacing(footprint, np.minimum(2 * bound, high - low))
    # Points lie on one lattice, whatever part of the mask is needed: pieces of a light field read the same.
    first, last = np.floor(low / spacing) - AROUND, np.ceil(high / spacing) + AROUND
    last = np.maximum(last, first + 2)
    start = first * spacing
    return MaskLookup(
        texture=_texture(
            plane.pattern, (first, last), spacing, (view_part, sample_part), np.float64 if exact else np.float32
        ),
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
    pattern: Pattern,
    ends: tuple[Array, Array],
    spacing: Array,
    boxes: tuple[Array, Array],
    kind: type[np.floating],
) -> NDArray[np.floating]:
    """Means of a pattern over two boxes, one after the other, at points of a lattice: (rows, columns).

    The wider box is taken by the pattern's own means, the other by a filter of the texture.

    Args:
        pattern: of the mask.
        ends: numbers (x, y) of the first and of the last point.
        spacing: (x, y) of the points, metres.
        boxes: their sizes (x, y), metres.
        kind: of the texture's numbers.
    """
    wide, narrow = np.maximum(*boxes), np.minimum(*boxes)
    filters = [_filter(float(width)) for width in narrow / spacing]
    x, y = (
        np.arange(first - len(weights) // 2, last + len(weights) // 2 + 1) * apart
        for first, last, weights, apart in zip(*ends, filters, spacing, strict=True)
    )
    means = np.empty((y.size, x.size), dtype=kind)
    for some in np.array_split(np.arange(y.size), -(-means.size // POINTS_AT_ONCE)):
        means[some] = pattern.mean(x[None, :], y[some, None], float(wide[0]), float(wide[1]))
    return _filtered(means, filters)


def _filter(box: float) -> Array:
    """The filter of a texture along one axis: a mean over a box, and what looking it up by splines takes.

    Args:
        box: its width in points of the texture.
    """
    return symmetric(
        lambda frequency: np.sinc(box * frequency) * _given_back(frequency), TEXTURE_FILTER + math.ceil(box / 2)
    )


def _given_back(frequency: Array) -> Array:
    """The gain before a look-up by quadratic B-splines.

    Of a cosine of ν cycles a point these leave sinc³(ν). With s = sin² πν, what gives it back is (arcsin(√s)/√s)³,
    of whose series `GIVEN_BACK` has the first terms: they lack less than splines add at other frequencies.

    Args:
        frequency: ν.
    """
    return np.asarray(np.polynomial.polynomial.polyval(np.sin(np.pi * frequency) ** 2, GIVEN_BACK))


def _filtered(means: NDArray[np.floating], filters: list[Array]) -> NDArray[np.floating]:
    """Means (rows, columns) filtered along columns and rows, without the margin that this takes."""
    from scipy.ndimage import convolve1d

    (across, down) = filters
    down_done = convolve1d(means, down, axis=0, mode="constant")[len(down) // 2 : len(means) - len(down) // 2]
    wide = convolve1d(down_done, across, axis=1, mode="constant")
    return np.ascontiguousarray(wide[:, len(across) // 2 : wide.shape[1] - len(across) // 2])


def texture_error(texture: NDArray[np.floating]) -> float:
    """By how much what is looked up between points of a texture errs, root mean square over all places.

    Splines whose losses are given back follow parabolas. Where the third derivative is d, in points, what is
    looked up f beside a point errs by d·f(¼ − f²)/6, root mean square |d|/√30240: the leading term, too low by a
    tenth where a period has nine points, by a third where it has five. The derivative is taken from four points
    each, two points on from one to the next.

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
        if along.shape[1] >= 4:
            a, b, c, d = (along[:, n : along.shape[1] - 3 + n : 2] for n in range(4))
            squares += float(np.mean(np.square(d - a - 3 * (c - b), dtype=np.float64)))
    return math.sqrt(squares / 30240) / largest


def _cleaned(step: Array, samples: tuple[int, int]) -> Array:
    """Steps across the texture, in points from sample to sample, without what is rounding over a whole view."""
    return np.where(np.abs(step) * max(samples) < 1e-6, 0.0, step)
