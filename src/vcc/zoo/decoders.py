"""Decoders: functions of a recording. ``decode(recorded) -> array``; any function of that form can take part."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import lazy_import
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.recover import depth_from_defocus, sparse_gradients, wiener
from vcc.recover.blur import Blur
from vcc.zoo.bench import Kernels
from vcc.zoo.entrants import Exposure

Array = NDArray[np.float64]

BLOCK = 48
"""Side of the blocks of depth from defocus, pixels."""
TV_FACTOR, PNP_FACTOR = 1.0, 2.0
"""Factors of `misfit`, chosen out of 1, 2 and 4 on the scenes leaves-101 and leaves-102, which are in no run."""


@dataclass(frozen=True, eq=False, repr=False)
class Recorded(Brief):
    """What a decoder gets: a recording and the camera's calibration; of the scene only its range of depths.

    Args:
        values: (rows, columns), or (exposures, rows, columns) of several, upright, white 1: electrons divided by
            those of white light through this camera, the mean over its pixels, with noise, also below 0.
        noise: standard deviation of the noise, in the unit of the values; the mean over the pictures, estimated
            from the recording and the sensor's electronics.
        kernels: the camera's images of points at distances over the range of the rules; None for cameras that
            have no such images, because they record views.
        camera: the camera, that of the first exposure.
        exposures: the camera, relative time and filters of each exposure (`vcc.zoo.entrants.Exposure`).
    """

    values: Array
    noise: float
    kernels: Kernels | None
    camera: Camera
    exposures: tuple[Exposure, ...] = ()

    @property
    def traced(self) -> Kernels:
        """The kernels.

        Raises:
            InputError: the camera has none.
        """
        if self.kernels is None:
            raise InputError("a camera that records views has no images of points: take a decoder of its kind")
        return self.kernels


Decoder = Callable[[Recorded], Any]
"""A function of a recording."""


def as_recorded(recorded: Recorded) -> Array:
    """The recording itself."""
    return recorded.values


def by_wiener(recorded: Recorded) -> Array:
    """The Wiener filter with the least error over all distances."""
    return wiener(recorded.values, recorded.traced.values, recorded.noise).picture


def misfit(recorded: Recorded, factor: float) -> float:
    """The standard deviation of the noise and of the error of one kernel for all distances.

    The error is the difference between the mean kernel and each kernel, applied to the Wiener estimate of the
    picture, squared and averaged over the distances; times a factor.
    """
    estimate = by_wiener(recorded)
    kernels = recorded.traced
    blur = Blur.of(np.concatenate([kernels.values, kernels.mean[None]]), None, _sides(estimate), "unknown", True)
    spectrum = np.fft.rfft2(blur.extended(estimate, "wrap"))
    apart = [np.fft.irfft2((each - blur.transfer[-1]) * spectrum, s=blur.domain) for each in blur.transfer[:-1]]
    error = float(np.mean([blur.seen(each) ** 2 for each in apart]))
    return math.sqrt(recorded.noise**2 + factor**2 * error)


def _sides(picture: Array) -> tuple[int, int]:
    return picture.shape[0], picture.shape[1]


def by_total_variation(recorded: Recorded) -> Array:
    """Total variation with the mean kernel; the error of one kernel for all distances counts as noise."""
    noise = misfit(recorded, TV_FACTOR)
    return sparse_gradients(recorded.values, recorded.traced.mean, noise, iterations=25).picture


def by_plug_and_play(recorded: Recorded) -> Array:
    """Half-quadratic splitting with a learned denoiser (DPIR of deepinv), with the same kernel and noise.

    Raises:
        InputError: deepinv, or the package with the denoiser's weights, is not installed.
    """
    noise = misfit(recorded, PNP_FACTOR)
    denoised = lazy_import.module("vcc.zoo.torch_denoiser").plug_and_play
    found: Array = denoised(recorded.values, recorded.traced.mean, noise)
    return found


def denoised(recorded: Recorded) -> Array:
    """The learned denoiser alone, without deblurring: what a picture gains from denoising.

    Raises:
        InputError: see `by_plug_and_play`.
    """
    found: Array = lazy_import.module("vcc.zoo.torch_denoiser").denoised(recorded.values, recorded.noise)
    return found


def by_defocus(recorded: Recorded, smoothed: bool = True) -> Array:
    """The most likely kernel of each block, interpolated to pixels (`vcc.recover.depth_from_defocus`)."""
    kernels = recorded.traced
    found = depth_from_defocus(
        recorded.values, list(kernels.values), kernels.distances, noise=recorded.noise, block=BLOCK, step=4
    )
    vergence = 1 / (found.smoothed() if smoothed else found).distance
    rows, columns = (np.arange(n) for n in recorded.values.shape)
    wide = np.stack([np.interp(columns, found.columns, row) for row in vergence])
    return 1 / np.stack([np.interp(rows, found.rows, column) for column in wide.T], axis=1)


def by_blocks(recorded: Recorded) -> Array:
    """As `by_defocus`, with each block alone."""
    return by_defocus(recorded, smoothed=False)
