"""Metrics of the images of a sweep: functions from an image, which includes its camera, to a number."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.analysis.deblurring import expected_deblurring_error, natural_image_power
from vcc.analysis.point_spread import psf
from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.measures import psnr
from vcc.base.values import Unhashable, fingerprint
from vcc.camera import Camera
from vcc.image import Image

Metric = Callable[[Image], float]
"""A function from an image to one number; the image's ``camera`` is the camera that made it."""

PRIOR = 128
"""Side, in pixels, of the natural images over which R(K) averages."""


@dataclass(frozen=True, eq=False, repr=False)
class PSNR(Brief):
    """The peak signal-to-noise ratio against a target, decibels.

    Args:
        target: an image of the same shape, in the orientation of the sensor; a `vcc.Image` has its own
            orientation.
        peak: in the unit of the image; None for the target's brightest value.

    Raises:
        InputError: a target with values that are not finite.
    """

    target: ArrayLike | Image
    peak: float | None = None

    def __post_init__(self) -> None:
        given = self.target
        turned = isinstance(given, Image) and not given.inverted
        values = np.asarray(given, dtype=np.float64)
        checks.all_finite("the target", values)
        object.__setattr__(self, "target", values[::-1, ::-1] if turned else values)

    def __call__(self, image: Image) -> float:
        """Decibels; 10·log₁₀(peak² / mean squared difference).

        Raises:
            InputError: an image of another shape.
        """
        target: NDArray[np.float64] = self.target  # type: ignore[assignment]
        if target.shape != image.shape:
            raise InputError(
                f"the target has the shape {target.shape}, and the picture {image.shape}: give one of the same "
                "pixels and channels"
            )
        return psnr(image.to_numpy().astype(np.float64), target, self.peak)


def sharpness(image: Image) -> float:
    """The energy of an image's gradient relative to its mean: larger is sharper, independent of the exposure.

    The mean over pixels of (I(r + 1, c) − I(r, c))² + (I(r, c + 1) − I(r, c))², after averaging channels,
    over the squared mean of I: the energy of the image gradient (Subbarao, Choi and Nikzad 1993), made
    relative.

    Args:
        image: two pixels or more each way.

    Returns:
        A dimensionless number; 0 for a uniform image, NaN for a black one.
    """
    values = image.to_numpy().astype(np.float64)
    grey = values.mean(axis=2) if values.ndim == 3 else values
    down, across = np.diff(grey, axis=0)[:, :-1], np.diff(grey, axis=1)[:-1]
    mean = float(grey.mean())
    return float((down**2 + across**2).mean()) / mean**2 if mean else math.nan


@dataclass(frozen=True)
class DeblurringError:
    """R(K) of a camera's point spread function (Zhou and Nayar 2009), per pixel: smaller is better.

    The expected mean squared error of a natural image after the best linear deblurring; see
    `vcc.analysis.expected_deblurring_error`. The kernel is the camera's point spread function. Its sum is 1,
    or with ``aperture`` the share of the light that masks transmit, which compares apertures at equal
    exposure.

    Args:
        distance: of the point before the camera, metres, above 0.
        noise: standard deviation, for images with values from 0 to 1.
        aperture: (width, height) of the open part of the entrance plane, metres; None derives it from the
            camera's stops.

    Raises:
        InputError: a distance or noise of 0 or less.
    """

    distance: float
    noise: float = 0.01
    aperture: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        checks.above_zero("distance", self.distance, unit="m", infinite=True)
        checks.above_zero("noise", self.noise, "a standard deviation")

    def __call__(self, image: Image) -> float:
        """R(K) over the number of frequencies, in squared units of the image.

        Raises:
            InputError: an image without a camera, or a kernel larger than 128 pixels; see also
                `vcc.analysis.psf`.
        """
        if not isinstance(image.camera, Camera):
            raise InputError("R(K) requires the camera, and this image has none")
        found = psf(image.camera, self.distance, aperture=self.aperture)
        share = 1.0 if self.aperture is None else found.collecting_area / math.prod(self.aperture)
        power = natural_image_power((PRIOR, PRIOR))
        return expected_deblurring_error(found.values * share, self.noise, power) / power.size


NAMED: dict[str, Metric] = {"sharpness": sharpness}
"""Metrics that can be given by name."""


def metrics_of(given: Mapping[str, Metric] | Iterable[str | Metric]) -> dict[str, Metric]:
    """Functions of an image by name.

    Args:
        given: functions by name; or a list of named functions and of names in `NAMED`.

    Raises:
        InputError: unknown name, not callable, a function without a name, or a repeated name.
    """
    if isinstance(given, str) or callable(given):
        raise InputError(f"metrics must be a list, or a mapping by name: write [{given!r}]")
    pairs: list[tuple[Any, Any]] = list(given.items()) if isinstance(given, Mapping) else []
    for each in () if isinstance(given, Mapping) else given:
        name = each if isinstance(each, str) else getattr(each, "__name__", type(each).__name__.lower())
        if name == "<lambda>":
            raise InputError('a lambda has no name: write {"brightest": lambda image: image.to_numpy().max()}')
        pairs.append((name, each))
    found: dict[str, Metric] = {}
    for name, metric in pairs:
        if isinstance(metric, str):
            if metric not in NAMED:
                raise InputError(f"there is no metric {metric!r}: there is {', '.join(NAMED)}, or give a function")
            metric = NAMED[metric]
        if not isinstance(name, str) or not callable(metric):
            raise InputError(f"a metric is a function of a picture, not {metric!r}")
        if not re.fullmatch(r"[\w.()\- ]+", name) or name in TAKEN:
            raise InputError(
                f"a metric cannot be called {name!r}: letters, digits, dots and hyphens, and not {TAKEN}"
            )
        if name in found or name in KNOWN:
            raise InputError(f"two columns of a table cannot both be {name!r}: name the metric otherwise")
        found[name] = metric
    return found


TAKEN = ("pictures", "done", "sensor_frame", "x", "y", "row", "column", "channel", "camera", "to", "from")
"""Names that a sweep's store uses otherwise."""
KNOWN = ("mean", "missing_rays", "sampling_error")
"""Numbers that every image gets."""


def metrics_in_words(metrics: Mapping[str, Metric]) -> dict[str, str | None]:
    """Fingerprints of metrics; None for Python functions, which cannot be compared."""
    found: dict[str, str | None] = {}
    for name, metric in metrics.items():
        try:
            found[name] = fingerprint(metric)
        except Unhashable:
            found[name] = None
    return found


def row_of(image: Image, metrics: Mapping[str, Metric]) -> dict[str, float]:
    """All numbers of an image, by name.

    Raises:
        InputError: the result of a metric is not a number.
    """
    return {
        "mean": float(image.to_numpy().mean(dtype=np.float64)),
        "missing_rays": float(image.missing_rays),
        "sampling_error": float(image.sampling_error),
        **numbers_of(image, metrics),
    }


def numbers_of(image: Image, metrics: Mapping[str, Metric]) -> dict[str, float]:
    """The results of metrics on an image, by name.

    Raises:
        InputError: the result of a metric is not a number.
    """
    found = {}
    for name, metric in metrics.items():
        value = metric(image)
        try:
            found[name] = float(value)
        except (TypeError, ValueError):
            raise InputError(
                f"the metric {name} gives {value!r}, and a table holds one number for each picture"
            ) from None
    return found
