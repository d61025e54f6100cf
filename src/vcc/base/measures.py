"""How close a picture is to the true one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

LEAST = 1e-20
"""Mean squared errors below this share of the squared peak are rounding: 200 dB."""


def psnr(picture: NDArray[np.floating], truth: NDArray[np.floating], peak: float | None = None) -> float:
    """The peak signal-to-noise ratio in linear light, decibels; 200 where there is no difference.

    Args:
        picture: any shape.
        truth: the same shape.
        peak: in their unit; None takes the largest value of the truth.
    """
    most = float(truth.max()) if peak is None else peak
    error = np.asarray(picture, dtype=np.float64) - np.asarray(truth, dtype=np.float64)
    return -10 * math.log10(max(float(np.mean(error**2)) / most**2, LEAST))
