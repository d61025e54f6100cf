"""The expected deblurring error of aperture patterns: Zhou and Nayar's figure of merit."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.errors import InputError

Array = NDArray[np.float64]


def expected_deblurring_error(kernel: ArrayLike, noise: float, power: ArrayLike) -> float:
    """R(K), the expected squared error of an image after optimal linear deblurring.

    R(K) = Σ σ² / (|K|² + σ²/|F₀|²) over all frequencies (Zhou and Nayar, "What are good apertures for defocus
    deblurring?", ICCP 2009, where it is minimised over K). It is the remaining error of the Wiener filter for
    an image of expected power |F₀|², blurred by K, with white noise of standard deviation σ. Divided by the
    number of frequencies, it is the expected mean squared error of a pixel; smaller is better.

    Args:
        kernel: the blur in pixels, not negative, shape (rows, columns). Its sum is the share of light that the
            aperture passes: to compare patterns at equal exposure, their kernels sum to their transmission.
        noise: σ, in the units of the image.
        power: |F₀|² of images at the frequencies of a discrete transform, shape (rows, columns), zero frequency
            first, as `natural_image_power` returns it: for the unitary transform, so that white noise is σ² at
            each frequency.

    Returns:
        R(K), in squared units of the image, summed over the frequencies.

    Raises:
        InputError: a kernel larger than the image, negative, not finite or dark; a noise that is not
            positive; powers that are negative or not finite.
    """
    blur = np.asarray(kernel, dtype=np.float64)
    prior = checked_power(noise, power)
    if blur.ndim != 2 or not np.isfinite(blur).all() or blur.min(initial=0.0) < 0 or not blur.any():
        raise InputError("a blur kernel is (rows, columns) of finite numbers of 0 or more, not all 0")
    if blur.shape[0] > prior.shape[0] or blur.shape[1] > prior.shape[1]:
        raise InputError(
            f"a blur of {blur.shape[0]}×{blur.shape[1]} pixels is larger than the picture of "
            f"{prior.shape[0]}×{prior.shape[1]}: take a larger picture or a smaller blur"
        )
    transfer = np.abs(np.fft.fft2(blur, s=prior.shape)) ** 2
    # σ²/(|K|² + σ²/|F₀|²), in a form that gives 0 at frequencies without power.
    return float(np.sum(noise**2 * prior / (transfer * prior + noise**2)))


def checked_power(noise: float, power: ArrayLike) -> Array:
    """|F₀|² of images for `expected_deblurring_error`, checked, float64.

    Raises:
        InputError: a noise that is not positive, or powers that are negative or not finite.
    """
    prior = np.asarray(power, dtype=np.float64)
    checks.above_zero("noise", noise, "a standard deviation")
    if prior.ndim != 2 or not np.isfinite(prior).all() or prior.min(initial=0.0) < 0:
        raise InputError("power is (rows, columns) of finite numbers of 0 or more, one for each frequency")
    return prior


def natural_image_power(
    shape: tuple[int, int], standard_deviation: float = 0.2, mean: float = 0.5, exponent: float = 2.0
) -> Array:
    """The expected power |F₀|² of natural images: proportional to 1/frequency² (Field 1987; Zhou and Nayar 2009).

    Args:
        shape: (rows, columns) of the image.
        standard_deviation: of its pixels about their mean.
        mean: of its pixels.
        exponent: of the frequency in cycles per pixel.

    Returns:
        Shape (rows, columns), zero frequency first, for the unitary transform: the mean over all frequencies,
        without the power of the mean, is ``standard_deviation``².

    Raises:
        InputError: a shape of fewer than 2 pixels, or a standard deviation or mean that is not positive.
    """
    if math.prod(checks.counts("shape", shape, "rows", "columns")) < 2:
        raise InputError(f"shape is (rows, columns) of two pixels or more, not {shape}")
    checks.above_zero("standard_deviation", standard_deviation)
    checks.above_zero("mean", mean)
    checks.finite("exponent", exponent)
    radius = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1]))
    radius[0, 0] = 1.0
    power = radius**-exponent
    power[0, 0] = 0.0
    count = shape[0] * shape[1]
    power *= standard_deviation**2 * count / power.sum()
    power[0, 0] = mean**2 * count
    return np.asarray(power)
