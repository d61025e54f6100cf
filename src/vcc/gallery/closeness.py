"""How close pictures are to the true ones, as all cameras of the gallery say it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

LEAST = 1e-20
"""Mean squared errors below this are rounding: 200 dB for a peak of 1."""


def psnr(picture: NDArray[np.floating], truth: NDArray[np.floating], peak: float = 1.0) -> float:
    """The peak signal-to-noise ratio in linear light, decibels.

    Args:
        picture: any shape.
        truth: the same shape.
        peak: in their unit.
    """
    return -10 * math.log10(max(float(np.mean((picture - truth) ** 2)), LEAST) / peak**2)
