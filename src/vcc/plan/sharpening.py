"""Giving back what interpolation takes from sharpness, by one small filter.

A sample's light is spread by a tent one step wide, which leaves sinc²(ν) of a cosine of ν cycles a step; a sample
that is a mean over its cell has lost sinc(ν) before. Every sample of a light field loses alike, so one filter of
the finished image compensates the loss. With x = πν and s = sin² x,

    (x / sin x)ⁿ = 1 + n/6 s + (11n/180 + n²/72) s² + …,

and s is (minus a quarter of) a second difference. Two terms make a filter of five weights. What is left is of
sixth order, and the gain ends at 1.8 (n = 3) where the full inverse would go to 3.9: noise and the ringing of hard
edges stay small.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TENT = 2
"""Powers of sinc that linear interpolation costs."""
BOX = 1
"""The same of samples that fill their cells evenly."""
MEAN = 1
"""Powers of sinc that a mean over a cell has cost."""
FREQUENCIES = 96
"""Frequencies at which a filter is fitted, from 0 to half a cycle a pixel."""
OF_SERIES = 2
"""Weights on each side of a filter of two terms of the series; a filter that is fitted has more."""
DETAIL = 0.05
"""Cycles a pixel: below it filters are fitted evenly, above it less closely, as 1/ν²."""


def gain(losses: float, frequency: Array) -> Array:
    """By how much a cosine is raised that has lost sincⁿ, to fourth order.

    Args:
        losses: n, powers of sinc.
        frequency: cycles a step of the samples.
    """
    s = np.sin(np.pi * frequency) ** 2
    return np.asarray(1 + losses / 6 * s + (11 * losses / 180 + losses**2 / 72) * s * s)


def symmetric(wanted: Callable[[Array], Array], half: int) -> Array:
    """The symmetric filter of 2·half + 1 weights whose gain comes nearest to what is wanted; its sum is 1.

    Args:
        wanted: gain as a function of cycles a step, 1 at 0.
        half: weights on each side of the middle.
    """
    if half == 0:
        return np.ones(1)
    frequency = (np.arange(FREQUENCIES) + 0.5) / FREQUENCIES / 2
    order = np.arange(1, half + 1)
    # Gain 1 + Σ hₘ (2 cos 2πmν − 2): even light stays as it is.
    basis = 2 * np.cos(2 * np.pi * frequency[:, None] * order) - 2
    weight = 1 / np.maximum(frequency, DETAIL) ** 2
    side = np.linalg.lstsq(basis * weight[:, None], (wanted(frequency) - 1) * weight, rcond=1e-10)[0]
    return np.concatenate([side[::-1], [1 - 2 * side.sum()], side])


def filter_half_width(losses: float, step: float, spline: bool = False) -> int:
    """How many weights a filter of `along_axis` has on each side of its middle: of a series, or of a fit."""
    size = abs(step)
    if size < 1e-3 or losses < 1e-9:
        return 0
    if spline:
        return math.ceil(2 * size - 1e-9) + 3
    return math.ceil(2 * size - 1e-9) + 2 if size > 1 else OF_SERIES


def along_axis(losses: float, step: float, spline: bool = False, beside: int | None = None) -> Array:
    """The filter of a finished picture along one axis.

    Args:
        losses: powers of sinc that its samples have lost.
        step: pixels from one sample to the next, of any sign.
        spline: whether footprints are cubic B-splines, of which samples see [1, 4, 1]/6, rather than tents.
        beside: weights on each side of the middle; None: as many as it takes (`weights_beside`).

    Returns:
        An odd number of weights of sum 1; a single one where nothing is lost.
    """
    size = abs(step)
    half = filter_half_width(losses, step, spline) if beside is None else beside
    if half == 0:
        return np.ones(1)
    if spline:

        def undone(frequency: Array) -> Array:
            return 3 / (2 + np.cos(2 * np.pi * size * frequency)) * gain(losses - TENT, size * frequency)

        # The spline's own inverse falls to 0.27 from sample to sample; two of them leave 7 % at worst, far up.
        return symmetric(undone, half)
    if half != OF_SERIES:  # weights that lie between pixels take some more of them
        return symmetric(lambda frequency: gain(losses, size * frequency), half)
    # The series in s of a step of one pixel, which x² = size²·(s + s²/3 + …) makes of that in x.
    first = losses / 6 * size**2
    second = losses / 18 * size**2 + (losses / 180 + losses**2 / 72) * size**4
    # s = (2 − e − 1/e)/4 and s² = (6 − 4(e + 1/e) + e² + 1/e²)/16 with e a shift by one pixel
    near, far = -first / 4 - second / 4, second / 16
    return np.array([far, near, 1 - 2 * (near + far), near, far])


def across_plane(losses: list[tuple[float, Array]], half: int) -> Array:
    """The filter (rows, columns) of a picture on which sincs run along any directions.

    Args:
        losses: (power of sinc, vector in pixels over which the light was spread); a negative power stands for
            light that was spread less than it should.
        half: weights on each side of the middle.
    """

    def wanted(fx: Array, fy: Array) -> Array:
        total = np.ones(fx.size)
        for power, (x, y) in losses:
            total = total * (gain(power, fx * x + fy * y) if power > 0 else np.sinc(fx * x + fy * y) ** -power)
        return total

    return symmetric_plane(wanted, (half, half))


def symmetric_plane(wanted: Callable[[Array, Array], Array], beside: tuple[int, int]) -> Array:
    """The filter of a plane, symmetric about its middle, whose gain comes nearest to what is wanted; its sum is 1.

    Args:
        wanted: gain as a function of cycles a step along (x, y), 1 at 0.
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
