"""Tasks of the zoo: what is recorded, what a decoder returns, and how it is scored."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.measures import psnr
from vcc.recover import depth_from_defocus
from vcc.zoo import decoders
from vcc.zoo.bench import BLUR, FOCUS, SHAPE, SIDE, SLOPE, distance_of, inner
from vcc.zoo.decoders import Decoder, Recorded
from vcc.zoo.entrants import Entrant, codes, plates
from vcc.zoo.scenes import Scene

Array = NDArray[np.float64]

LEAST_BLUR = 3.0
"""Blur of the farthest objects for the task depth, pixels: the focus lies beyond all objects."""
BLOCK = 48
"""Side of the blocks of depth from defocus, pixels."""
VIEWS_ACROSS = 9
"""Disparities are those between neighbours of so many views across the square, as in the HCI benchmark."""
BAD = 1.0
"""Error of the blur through the whole square, pixels, above which a depth is bad."""


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
        focus: distance on which all cameras are focused, metres.
        blurs: of the points of the calibration, see `vcc.zoo.bench.distance_of`.
        entrants: the published cameras, without controls.
        curve: light of further round stops, for the curve of what a stop alone reaches.
        decoders: by name.
        measures: of a decoded recording; the first one ranks. The time of the decoder is added to them.
        truth: of a scene.
        scored: the measures of what a decoder returned, given the truth.
        shown: the same as a grey picture, 0 to 1.
    """

    name: str
    title: str
    focus: float
    blurs: tuple[float, ...]
    entrants: Callable[[float], list[Entrant]]
    curve: tuple[float, ...]
    decoders: Mapping[str, Decoder]
    measures: tuple[Measure, ...]
    truth: Callable[[Scene], Array]
    scored: Callable[[Array, Array], tuple[float, ...]]
    shown: Callable[[Array], Array] = field(default=lambda picture: picture)

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
        if found.shape != SHAPE or not np.isfinite(found).all():
            raise InputError(
                f"the decoder {name} returns {found.shape}, and the task {self.name} takes a picture of {SHAPE} "
                "finite numbers"
            )
        return found


# --- extended depth of field ---


def _all_in_focus(scene: Scene) -> Array:
    return scene.sharp


def _picture_scores(decoded: Array, truth: Array) -> tuple[float, float]:
    """PSNR, white 1, and SSIM (Wang et al. 2004: Gaussian window, σ = 1.5), without borders."""
    with checks.package("the score SSIM", "scikit-image", "zoo"):
        from skimage.metrics import structural_similarity
    found, true = inner(decoded), inner(truth)
    similar = structural_similarity(
        found, true, data_range=1.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )
    return psnr(found, true, peak=1.0), float(similar)


EDOF = Task(
    "edof",
    "Extended depth of field: the picture all in focus, out of one recording focused in the middle",
    FOCUS,
    tuple(float(blur) for blur in np.linspace(BLUR, -BLUR, 7)),
    lambda focus: [*codes(focus), *plates(focus)],
    (0.1, 0.04, 0.01),
    {
        "as recorded": decoders.as_recorded,
        "denoised": decoders.denoised,
        "Wiener": decoders.by_wiener,
        "total variation": decoders.by_total_variation,
        "plug-and-play": decoders.by_plug_and_play,
    },
    (Measure("PSNR", "dB", True, 1), Measure("SSIM", "", True, 2)),
    _all_in_focus,
    _picture_scores,
)


# --- depth ---


def _distances(scene: Scene) -> Array:
    if scene.blur is None:
        raise InputError(
            f"the scene {scene.name} has no map of depth in its middle view, which the task depth needs"
        )
    return np.asarray(distance_of(scene.blur))


def _blur(distance: Array) -> Array:
    """The blur through the whole square at focus `FOCUS`, pixels: the inverse of `distance_of`."""
    return np.asarray((1 / distance - 1 / FOCUS) * SIDE / SLOPE)


def _depth_scores(decoded: Array, truth: Array) -> tuple[float, float, float]:
    """Bad pixels, per cent; 100·MSE of disparity, square pixels; root mean square error, metres."""
    half = slice(BLOCK // 2, -(BLOCK // 2))
    found, true = decoded[half, half], truth[half, half]
    if not (found > 0).all():
        raise InputError("a decoder of the task depth returns distances in metres, above 0")
    error = _blur(found) - _blur(true)
    return (
        100 * float(np.mean(np.abs(error) > BAD)),
        100 * float(np.mean((error / VIEWS_ACROSS) ** 2)),
        math.sqrt(float(np.mean((found - true) ** 2))),
    )


def by_defocus(recorded: Recorded, smoothed: bool = True) -> Array:
    """The most likely kernel of each block, interpolated to pixels (`vcc.recover.depth_from_defocus`)."""
    kernels = recorded.kernels
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


DEPTH = Task(
    "depth",
    "Depth from one recording, focused beyond all objects",
    distance_of(-BLUR - LEAST_BLUR),
    tuple(float(blur) for blur in np.arange(BLUR + 1, -BLUR - 0.01, -1.0)),
    codes,
    (0.1,),
    {"defocus": by_defocus, "defocus, each block": by_blocks},
    (Measure("BadPix", "%", False, 1), Measure("MSE·100", "px²", False, 1), Measure("RMSE", "m", False, 3)),
    _distances,
    _depth_scores,
    lambda distance: np.clip((_blur(distance) / BLUR + 1) / 2, 0, 1),
)

TASKS = {task.name: task for task in (EDOF, DEPTH)}


def task_named(name: str) -> Task:
    """A task by name.

    Raises:
        InputError: there is none.
    """
    checks.one_of("--task", name, tuple(TASKS))
    return TASKS[name]
