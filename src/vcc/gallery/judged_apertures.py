"""Apertures evaluated by how well their blur can be removed: the expected error R(K), and measured errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import expected_deblurring_error, natural_image_power
from vcc.gallery import flat_target
from vcc.optics import Mask
from vcc.recover import wiener

Array = NDArray[np.float64]

BLUR = 13
"""Pixels across the opening: one per cell of the codes of 13×13."""
NOISES = (0.0001, 0.001, 0.002, 0.005, 0.008, 0.01, 0.02, 0.03, 0.05, 0.1)
"""Standard deviations, shares of white through the whole opening."""
SHOWN = 0.005
"""The noise of the pictures shown, and of a search."""
CONTRAST, MEAN = 0.2, 0.5
"""Standard deviation and mean of the images' pixels."""
DIFFERENT = 1.05
"""Errors whose ratio is smaller count as equal when orders are compared."""


@dataclass(frozen=True, eq=False)
class Judged:
    """An aperture with its expected and measured errors.

    Args:
        name: as text.
        mask: in the opening.
        kernel: its image of a point; the sum is the transmission.
        expected: R(K) per pixel, at each noise.
        drawn: mean squared error of deblurred images drawn from the prior, likewise.
        real: that of the deblurred view, likewise.
        foretold: the expected value of ``real``, from the view's own spectrum, likewise.
        picture: the view deblurred at the noise `SHOWN`.
    """

    name: str
    mask: Mask
    kernel: Array
    expected: Array
    drawn: Array
    real: Array
    foretold: Array
    picture: Array


def judge(name: str, mask: Mask, real: Array, drawn: Array, noises: tuple[float, ...] = NOISES) -> Judged:
    """Compute the expected errors of an aperture, and measure those of deblurred recordings."""
    kernel = flat_target.kernel(mask, BLUR)
    power = natural_image_power((real.shape[0], real.shape[1]), CONTRAST, MEAN)
    expected = [expected_deblurring_error(kernel, noise, power) / power.size for noise in noises]
    errors: list[list[float]] = []
    shown = np.zeros_like(real)
    for seed, target in enumerate((drawn, real)):
        # Half the contrast with half the noise is equivalent, and no value is below black.
        recording = 2 * flat_target.recorded(mask, MEAN + (target - MEAN) / 2, BLUR) - MEAN * kernel.sum()
        draws = np.random.default_rng((1, seed)).standard_normal(target.shape)  # the same for all apertures
        errors.append([])
        for noise in noises:
            picture = deblurred(recording + noise * draws, kernel, noise)
            errors[-1].append(float(np.mean((picture - target) ** 2)))
            if noise == SHOWN:
                shown = picture
    foretold = [foretold_error(kernel, noise, real) for noise in noises]
    measured = np.array(errors)
    return Judged(name, mask, kernel, np.array(expected), measured[0], measured[1], np.array(foretold), shown)


def deblurred(recording: Array, kernel: Array, noise: float) -> Array:
    """A recording deblurred by the Wiener filter with the prior of R(K); the kernel sums to the transmission."""
    passed = float(kernel.sum())
    power = natural_image_power((recording.shape[0], recording.shape[1]), CONTRAST, MEAN)
    strength = math.sqrt(power[0, 1]) / recording.shape[1]  # P = c/f², here at one period over the picture
    found = wiener(recording / passed, kernel / passed, noise / passed, contrast=strength, borders="periodic")
    return found.picture


def foretold_error(kernel: Array, noise: float, picture: Array) -> float:
    """The expected mean squared error of this picture after this filter, averaged over the noise.

    The filter W loses |1 − K·W|²·|F|² of the picture, and passes σ²·|W|² of the noise. If |F|² is the prior's
    P, the sum is R(K).
    """
    prior = natural_image_power((picture.shape[0], picture.shape[1]), CONTRAST, MEAN)
    prior[0, 0] = np.inf  # the filter keeps the mean
    own = np.abs(np.fft.fft2(picture)) ** 2 / picture.size
    passed = np.abs(np.fft.fft2(kernel, s=picture.shape)) ** 2
    left = 1 / (passed * prior / noise**2 + 1)
    return float(np.mean(left**2 * own + noise**2 * (1 - left) ** 2 / np.maximum(passed, 1e-300)))


def picture_of_the_prior(shape: tuple[int, int], seed: int = 0) -> Array:
    """A random image whose expected power is that of the prior, 1/f²."""
    power = natural_image_power(shape, CONTRAST, MEAN)
    power[0, 0] = 0
    white = np.random.default_rng((2, seed)).standard_normal(shape)  # independent of all noise
    return np.asarray(MEAN + np.fft.ifft2(np.fft.fft2(white) * np.sqrt(power)).real)


def with_contrast(picture: Array) -> Array:
    """The picture with the mean and standard deviation of the prior, clipped to `MEAN` ± 1."""
    spread = max(float(picture.std()), 1e-6)
    return np.asarray(np.clip(MEAN + (picture - picture.mean()) * (CONTRAST / spread), MEAN - 1, MEAN + 1))


def pairs_in_order(expected: Array, measured: Array) -> tuple[int, int]:
    """The number of pairs of apertures measured in the expected order, and the number of pairs.

    Args:
        expected: errors, (apertures, noises); pairs that differ by less than `DIFFERENT` are not counted.
        measured: likewise.
    """
    right = count = 0
    for first in range(len(expected)):
        for second in range(first):
            ratio = expected[first] / expected[second]
            counted = np.maximum(ratio, 1 / ratio) >= DIFFERENT
            agree = (ratio > 1) == (measured[first] > measured[second])
            right += int((agree & counted).sum())
            count += int(counted.sum())
    return right, count


def rank_correlations(expected: Array, measured: Array) -> list[float]:
    """Spearman's correlation at each noise; errors are (apertures, noises)."""
    from scipy.stats import spearmanr

    return [float(spearmanr(*both)[0]) for both in zip(expected.T, measured.T, strict=True)]
