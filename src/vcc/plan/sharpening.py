"""Compensation of the loss of sharpness by interpolation, with one small filter.

A sample's light is spread by a tent one step wide, which reduces a cosine of ν cycles a step to sinc²(ν); a sample
that is a mean over its cell has lost sinc(ν) before. Every sample of a light field has the same loss, so one
filter of the finished image compensates it. With x = πν and s = sin² x,

    (x / sin x)ⁿ = 1 + n/6 s + (11n/180 + n²/72) s² + …,

and s is (minus a quarter of) a second difference. Two terms make a filter of five weights. The remaining error
is of sixth order, and the gain ends at 1.8 (n = 3), where the full inverse would go to 3.9: noise and the
ringing of hard edges stay small.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TENT = 2
"""Powers of sinc lost by linear interpolation."""
BOX = 1
"""Powers of sinc lost by samples that fill their cells uniformly."""
MEAN = 1
"""Powers of sinc lost by a mean over a cell."""
FREQUENCIES = 96
"""Frequencies at which a filter is fitted, from 0 to half a cycle a pixel."""
OF_SERIES = 2
"""Weights on each side of a filter of two terms of the series; a fitted filter has more."""
DETAIL = 0.05
"""Cycles a pixel: filters are fitted with equal weight below, and with less weight above, as 1/ν²."""


def gain(losses: float, frequency: Array) -> Array:
    """The gain that compensates a loss of sincⁿ for a cosine, to fourth order.

    Args:
        losses: n, powers of sinc.
        frequency: cycles a step of the samples.
    """
    s = np.sin(np.pi * frequency) ** 2
    return np.asarray(1 + losses / 6 * s + (11 * losses / 180 + losses**2 / 72) * s * s)


def symmetric(wanted: Callable[[Array], Array], half: int) -> Array:
    """The symmetric filter of 2·half + 1 weights whose gain is nearest to the target; its sum is 1.

    Args:
        wanted: target gain as a function of cycles a step, 1 at 0.
        half: weights on each side of the middle.
    """
    if half == 0:
        return np.ones(1)
    frequency = (np.arange(FREQUENCIES) + 0.5) / FREQUENCIES / 2
    order = np.arange(1, half + 1)
    # Gain 1 + Σ hₘ (2 cos 2πmν − 2): uniform light is unchanged.
    basis = 2 * np.cos(2 * np.pi * frequency[:, None] * order) - 2
    weight = 1 / np.maximum(frequency, DETAIL) ** 2
    side = np.linalg.lstsq(basis * weight[:, None], (wanted(frequency) - 1) * weight, rcond=1e-10)[0]
    return np.concatenate([side[::-1], [1 - 2 * side.sum()], side])


def filter_half_width(losses: float, step: float, spline: bool = False) -> int:
    """Number of weights on each side of the middle of a filter of `along_axis`, from the series or fitted."""
    size = abs(step)
    if size < 1e-3 or losses < 1e-9:
        return 0
    if spline:
        return math.ceil(2 * size - 1e-9) + 3
    return math.ceil(2 * size - 1e-9) + 2 if size > 1 else OF_SERIES


def along_axis(losses: float, step: float, spline: bool = False, beside: int | None = None) -> Array:
    """The filter of a finished image along one axis.

    Args:
        losses: powers of sinc that its samples have lost.
        step: pixels from one sample to the next, of any sign.
        spline: whether footprints are cubic B-splines, which filter samples by [1, 4, 1]/6, rather than tents.
        beside: weights on each side of the middle; None: as many as needed (`filter_half_width`).

    Returns:
        An odd number of weights of sum 1; a single one if nothing is lost.
    """
    size = abs(step)
    half = filter_half_width(losses, step, spline) if beside is None else beside
    if half == 0:
        return np.ones(1)
    if spline:

        def undone(frequency: Array) -> Array:
            return 3 / (2 + np.cos(2 * np.pi * size * frequency)) * gain(losses - TENT, size * frequency)

        # The inverse of the spline decays by 0.27 from sample to sample; with two, the error is 7 % at the
        # highest frequencies.
        return symmetric(undone, half)
    if half != OF_SERIES:  # weights between pixels need a longer filter
        return symmetric(lambda frequency: gain(losses, size * frequency), half)
    # The series in s for a step of one pixel; from x² = size²·(s + s²/3 + …).
    first = losses / 6 * size**2
    second = losses / 18 * size**2 + (losses / 180 + losses**2 / 72) * size**4
    # s = (2 − e − 1/e)/4 and s² = (6 − 4(e + 1/e) + e² + 1/e²)/16 with e a shift by one pixel
    near, far = -first / 4 - second / 4, second / 16
    return np.array([far, near, 1 - 2 * (near + far), near, far])


def across_plane(losses: list[tuple[float, Array]], half: int) -> Array:
    """The filter (rows, columns) of an image with losses by sincs along arbitrary directions.

    Args:
        losses: (power of sinc, vector in pixels over which the light was spread); a negative power stands for
            light that was spread less than it should be.
        half: weights on each side of the middle.
    """

    def wanted(fx: Array, fy: Array) -> Array:
        total = np.ones(fx.size)
        for power, (x, y) in losses:
            total = total * (gain(power, fx * x + fy * y) if power > 0 else np.sinc(fx * x + fy * y) ** -power)
        return total

    return symmetric_plane(wanted, (half, half))


def symmetric_plane(wanted: Callable[[Array, Array], Array], beside: tuple[int, int]) -> Array:
    """The two-dimensional filter, symmetric about its middle, whose gain is nearest to the target; its sum is 1.

    Args:
        wanted: target gain as a function of cycles a step along (x, y), 1 at 0.
        beside: weights on each side of the middle along (x, y).

    Returns:
        (rows, columns).
    """
    wide, high = beside
    number = 24 * math.ceil(max(beside) / 6)
    frequency = (np.arange(number) + 0.5) / number - 0.5
    fx, fy = (axis.ravel() for axis in np.meshgrid(frequency, frequency[number // 2 :]))
    places = [(n, m) for m in range(high + 1) for n in range(-wide, wide + 1) if m > 0 or n > 0]
    column, row = np.array(places).T
    basis = 2 * np.cos(2 * np.pi * (fx[:, None] * column + fy[:, None] * row)) - 2
    weight = 1 / np.maximum(np.hypot(fx, fy), DETAIL) ** 2
    side = np.linalg.lstsq(basis * weight[:, None], (wanted(fx, fy) - 1) * weight, rcond=1e-10)[0]
    kernel = np.zeros((2 * high + 1, 2 * wide + 1))
    kernel[high + row, wide + column] = kernel[high - row, wide - column] = side
    kernel[high, wide] = 1 - 2 * side.sum()
    return kernel
