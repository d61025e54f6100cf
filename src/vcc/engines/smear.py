"""The last steps of every engine: closing the gaps between views, diffusers, and what lies against the sensor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.plan.footprints.model import Plan


def tent(half_width: float) -> NDArray[np.float64]:
    """A tent of this half width in pixels, averaged over each pixel: an odd number of weights of sum 1."""
    if half_width == 0:
        return np.ones(1)
    reach = math.ceil(half_width + 0.5)
    edges = np.clip((np.arange(-reach, reach + 2) - 0.5) / half_width, -1, 1)
    return np.diff(edges - np.sign(edges) * edges**2 / 2)


def band_matrix(weights: NDArray[np.float64], pixels: int, guard: int) -> NDArray[np.float64]:
    """An odd number of weights as a matrix from raster to sensor pixels along one axis, guard cut off."""
    reach = len(weights) // 2
    matrix = np.zeros((pixels, pixels + 2 * guard))
    for shift, weight in zip(range(-reach, reach + 1), weights, strict=True):
        here = np.arange(pixels)
        there = here + guard - shift
        inside = (there >= 0) & (there < pixels + 2 * guard)
        matrix[here[inside], there[inside]] += weight
    return matrix


def spreading_matrix(weights: NDArray[np.float64], samples: int) -> NDArray[np.float64]:
    """An odd number of weights as a matrix from samples to as many more as they reach, along one axis."""
    matrix = np.zeros((samples + len(weights) - 1, samples))
    for shift, weight in enumerate(weights):
        matrix[np.arange(samples) + shift, np.arange(samples)] = weight
    return matrix


def separable_terms(kernel: NDArray[np.float64]) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """A kernel (rows, columns) as a sum of products of a column and a row, right to `RANK_TOLERANCE`."""
    down, strength, across = np.linalg.svd(kernel)
    return [
        (down[:, n] * strength[n], across[n])
        for n in range(len(strength))
        if strength[n] > RANK_TOLERANCE * strength[0]
    ]


RANK_TOLERANCE = 1e-8


def finishing_terms(plan: Plan) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """The tents between views, the blur and the sharpening of a plan, as `separable_terms`."""
    down, across = tent(plan.smear[0]), tent(plan.smear[1])
    if plan.sharpen is not None:
        down, across = np.convolve(down, plan.sharpen[0]), np.convolve(across, plan.sharpen[1])
    if plan.blur is None:
        return [(down, across)]
    from scipy.signal import convolve

    return separable_terms(convolve(plan.blur, np.outer(down, across)))


LONG = 64
"""Weights from which on a blur is quicker through Fourier transforms."""


def blurred(raster: NDArray[Any], weights: NDArray[np.float64], axis: int) -> NDArray[Any]:
    """The raster (rows, columns, channels) blurred along one axis, dark beyond its border."""
    if len(weights) < LONG:
        from scipy.ndimage import convolve1d

        return np.asarray(convolve1d(raster, weights, axis=axis, mode="constant"))
    from scipy.signal import oaconvolve

    kernel = np.expand_dims(weights, [other for other in range(3) if other != axis])
    return without_rounding(oaconvolve(raster.astype(np.float64), kernel, mode="same", axes=axis))


def without_rounding(wide: NDArray[np.float64]) -> NDArray[np.float64]:
    """What Fourier transforms leave of no light, set to none."""
    return np.where(np.abs(wide) < ROUNDING * np.abs(wide).max(initial=0), 0.0, wide)


ROUNDING = 1e-13
"""Of the largest number: below it lies what Fourier transforms in double precision round to."""


def finish(plan: Plan, raster: NDArray[Any]) -> NDArray[np.float32]:
    """The picture from the raster (rows, columns, channels) of NumPy numbers."""
    if any(plan.smear):
        raster = blurred(blurred(raster, tent(plan.smear[0]), 0), tent(plan.smear[1]), 1)
    if plan.blur is not None:
        from scipy.signal import oaconvolve

        # In double precision: what Fourier transforms round to in the dark would else show.
        wide = oaconvolve(raster.astype(np.float64), plan.blur[:, :, None], mode="same", axes=(0, 1))
        raster = without_rounding(wide)
    if plan.sharpen is not None:
        raster = blurred(blurred(raster, plan.sharpen[0], 0), plan.sharpen[1], 1)
    picture = _part(plan, raster, 0, 0)
    if plan.sensor_transmission is not None:
        picture = picture * plan.sensor_transmission[..., None]
    if plan.sensor_detail is not None:
        for dy, dx in np.ndindex(3, 3):
            picture = picture + plan.sensor_detail[dy, dx, :, :, None] * _part(plan, raster, dy - 1, dx - 1)
    return np.asarray(picture, dtype=np.float32)


def _part(plan: Plan, raster: NDArray[Any], down: int, across: int) -> NDArray[Any]:
    """The sensor's part of the raster, or what lies so many pixels further."""
    rows, columns = plan.sensor_shape
    top, left = plan.guard + down, plan.guard + across
    return raster[top : top + rows, left : left + columns]
