"""What a task of the zoo is: cameras, decoders, a truth, and scores."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.measures import psnr
from vcc.camera import Camera
from vcc.light_field import LightField
from vcc.zoo.bench import REFERENCE, SHAPE, check_camera, inner, white_field
from vcc.zoo.decoders import Decoder
from vcc.zoo.entrants import AGAINST, Entrant
from vcc.zoo.scenes import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Measure:
    """A score.

    Args:
        name: of the score.
        unit: of it; empty for none.
        larger: whether larger is better.
        digits: after the point, in tables.
    """

    name: str
    unit: str
    larger: bool
    digits: int

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


SECONDS = Measure("time", "s", False, 2)


@dataclass(frozen=True, eq=False, repr=False)
class Task(Brief):
    """A task.

    Args:
        name: on the command line.
        title: one line.
        blurs: of the points of the calibration, see `vcc.zoo.bench.distance_of`.
        entrants: the published cameras and those of the user, which are given, with all controls.
        decoders: by name.
        measures: of a decoded recording; the first one ranks. The time of the decoder is added to them.
        truth: of a scene.
        scored: the measures of what a decoder returned, given the truth.
        shape: of the truth and of what decoders return.
        against: what `Entrant.controls` are, for the headings of tables.
        shown: one picture of the same, (rows, columns) or (rows, columns, 3), 0 to 1.
        light_field: of a scene.
        white: radiance 1 everywhere, likewise.
        reference: irradiance of white times the area of a pixel, of the open camera, whose light is 100 %.
        pixels: of the open camera, that the scene fills.
        inverted: whether sensors show the scene upside down.
        check: raises InputError for a camera of the user that does not follow the rules.
    """

    name: str
    title: str
    blurs: tuple[float, ...]
    entrants: Callable[[list[Entrant]], list[Entrant]]
    decoders: Mapping[str, Decoder]
    measures: tuple[Measure, ...]
    truth: Callable[[Scene], Array]
    scored: Callable[[Array, Array], tuple[float, ...]]
    shape: tuple[int, ...] = SHAPE
    against: tuple[str, ...] = AGAINST
    shown: Callable[[Array], Array] = field(default=lambda picture: picture)
    light_field: Callable[[Scene], LightField] = field(default=lambda scene: scene.field)
    white: Callable[[], LightField] = white_field
    reference: float = REFERENCE
    pixels: int = SHAPE[0] * SHAPE[1]
    inverted: bool = True
    check: Callable[[Camera, str], None] = check_camera

    @property
    def all_measures(self) -> tuple[Measure, ...]:
        """The measures, and the time."""
        return (*self.measures, SECONDS)

    def checked(self, decoded: Any, name: str) -> Array:
        """What a decoder returned, checked.

        Raises:
            InputError: another shape, or values that are not finite.
        """
        found = np.asarray(decoded, np.float64)
        if found.shape != self.shape or not np.isfinite(found).all():
            raise InputError(
                f"the decoder {name} returns {found.shape}, and the task {self.name} takes an array of "
                f"{self.shape} finite numbers"
            )
        return found


PSNR, SSIM = Measure("PSNR", "dB", True, 1), Measure("SSIM", "", True, 2)


def picture_scores(decoded: Array, truth: Array) -> tuple[float, float]:
    """PSNR, white 1, and SSIM (Wang et al. 2004: Gaussian window, σ = 1.5), without borders; of linear light."""
    with checks.package("the score SSIM", "scikit-image", "zoo"):
        from skimage.metrics import structural_similarity
    found, true = inner(decoded), inner(truth)
    similar = structural_similarity(
        found, true, data_range=1.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )
    return psnr(found, true, peak=1.0), float(similar)
