"""Apertures judged by how well their blur can be undone: expected by R(K), and measured."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import expected_deblurring_error, natural_image_power
from vcc.gallery import flat_target
from vcc.optics import Mask
from vcc.recover import wiener

if TYPE_CHECKING:
    pass

Array = NDArray[np.float64]

BLUR = 13
"""Pixels across the opening: one for each cell of the codes of 13×13."""
NOISES = (0.0001, 0.001, 0.002, 0.005, 0.008, 0.01, 0.02, 0.03, 0.05, 0.1)
"""Standard deviations, shares of white through the whole opening."""
SHOWN = 0.005
"""The noise of the pictures shown, and of a search."""
CONTRAST, MEAN = 0.2, 0.5
"""Standard deviation and mean of the pictures' pixels."""
DIFFERENT = 1.05
"""Errors whose ratio is less than this count as alike when orders are compared."""


@dataclass(frozen=True, eq=False)
class Judged:
    """An aperture, what is expected of it and what it did.

    Args:
        name: in words.
        mask: in the opening.
        kernel: its picture of a point; the sum is the light passed.
        expected: R(K) per pixel, at each noise.
        drawn: mean squared error of deblurred pictures drawn from the prior, likewise.
        real: that of the deblurred view, likewise.
        foretold: what ``real`` should be by the view's own spectrum, likewise.
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
    """What is expected of an aperture, and what recordings through it become."""
    kernel = flat_target.kernel(mask, BLUR)
    power = natural_image_power((real.shape[0], real.shape[1]), CONTRAST, MEAN)
    expected = [expected_deblurring_error(kernel, noise, power) / power.size for noise in noises]
    errors: list[list[float]] = []
    shown = np.zeros_like(real)
    for seed, target in enumerate((drawn, real)):
        # Half the contrast and half the noise: the same, and nothing goes below black.
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
    """By the Wiener filter with the prior of R(K); the kernel sums to the share of light that passes."""
    passed = float(kernel.sum())
    power = natural_image_power((recording.shape[0], recording.shape[1]), CONTRAST, MEAN)
    strength = math.sqrt(power[0, 1]) / recording.shape[1]  # P = c/f², here at one period over the picture
    found = wiener(recording / passed, kernel / passed, noise / passed, contrast=strength, borders="periodic")
    return found.picture


def foretold_error(kernel: Array, noise: float, picture: Array) -> float:
    """The mean squared error that this filter leaves of this picture, in the mean over the noise.

    What the filter W takes of the picture, |1 − K·W|²·|F|², and what it lets through of the noise, σ²·|W|²: with
    |F|² the prior's P, this is R(K).
    """
    prior = natural_image_power((picture.shape[0], picture.shape[1]), CONTRAST, MEAN)
    prior[0, 0] = np.inf  # the filter leaves the mean as it is
    own = np.abs(np.fft.fft2(picture)) ** 2 / picture.size
    passed = np.abs(np.fft.fft2(kernel, s=picture.shape)) ** 2
    left = 1 / (passed * prior / noise**2 + 1)
    return float(np.mean(left**2 * own + noise**2 * (1 - left) ** 2 / np.maximum(passed, 1e-300)))


def picture_of_the_prior(shape: tuple[int, int], seed: int = 0) -> Array:
    """A random picture whose expected power is that of the prior: a cloud, 1/f²."""
    power = natural_image_power(shape, CONTRAST, MEAN)
    power[0, 0] = 0
    white = np.random.default_rng((2, seed)).standard_normal(shape)  # other numbers than any noise's
    return np.asarray(MEAN + np.fft.ifft2(np.fft.fft2(white) * np.sqrt(power)).real)


def with_contrast(picture: Array) -> Array:
    """The picture with the mean and standard deviation of the prior, as far as black and white allow."""
    spread = max(float(picture.std()), 1e-6)
    return np.asarray(np.clip(MEAN + (picture - picture.mean()) * (CONTRAST / spread), MEAN - 1, MEAN + 1))


def pairs_in_order(expected: Array, measured: Array) -> tuple[int, int]:
    """How many pairs of apertures are measured in the expected order, of how many.

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
    """Spearman's, at each noise; errors are (apertures, noises)."""
    from scipy.stats import spearmanr

    return [float(spearmanr(*both)[0]) for both in zip(expected.T, measured.T, strict=True)]
