"""Measures of the error of images."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

LEAST = 1e-20
"""Mean squared errors below this are rounding errors: 200 dB for a peak of 1."""


def psnr(picture: NDArray[np.floating], truth: NDArray[np.floating], peak: float | None = None) -> float:
    """The peak signal-to-noise ratio of an image in linear light, decibels.

    Args:
        picture: any shape.
        truth: the same shape.
        peak: in their unit; None for the brightest value of the truth.
    """
    return decibels(float(np.mean((picture - truth) ** 2)), float(truth.max()) if peak is None else peak)


def decibels(mean_square: float, peak: float = 1.0) -> float:
    """The peak signal-to-noise ratio of a mean squared error, for errors that are averaged in other ways."""
    return -10 * math.log10(max(mean_square, LEAST) / peak**2)
