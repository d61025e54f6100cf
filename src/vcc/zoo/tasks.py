"""Tasks of the zoo: extended depth of field, and depth; and the list of all tasks."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.zoo import decoders
from vcc.zoo.bench import ALL_BLURS, BEYOND, BLUR, FOCUS, SIDE, SLOPE, calibrated, distance_of
from vcc.zoo.decoders import BLOCK
from vcc.zoo.entrants import Entrant, codes, plates, with_controls
from vcc.zoo.scenes import Scene
from vcc.zoo.spectra import SPECTRUM
from vcc.zoo.task import PSNR, SSIM, Measure, Task, picture_scores
from vcc.zoo.views import LIGHT_FIELD, REFOCUSING

Array = NDArray[np.float64]

VIEWS_ACROSS = 9
"""Disparities are those between neighbours of so many views across the square, as in the HCI benchmark."""
BAD = 1.0
"""Error of the blur through the whole square, pixels, above which a depth is bad."""


# --- extended depth of field ---


SEVEN = tuple(float(blur) for blur in np.linspace(BLUR, -BLUR, 7))


def _with_stops(
    entrants: list[Entrant], blurs: tuple[float, ...], focus: float, curve: tuple[float, ...]
) -> list[Entrant]:
    """With controls of the same light, and a curve of round stops."""
    middle = (blurs[len(blurs) // 2],)
    lights = {each.name: calibrated(each.camera, middle).light for each in entrants}
    return with_controls(entrants, lights, focus, curve)


EDOF = Task(
    "edof",
    "Extended depth of field: the picture all in focus, out of one recording focused in the middle",
    SEVEN,
    lambda own: _with_stops([*codes(FOCUS), *plates(FOCUS), *own], SEVEN, FOCUS, (0.1, 0.04, 0.01)),
    {
        "as recorded": decoders.as_recorded,
        "denoised": decoders.denoised,
        "Wiener": decoders.by_wiener,
        "total variation": decoders.by_total_variation,
        "plug-and-play": decoders.by_plug_and_play,
    },
    (PSNR, SSIM),
    lambda scene: scene.sharp,
    picture_scores,
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


DEPTH = Task(
    "depth",
    "Depth from one recording, focused beyond all objects",
    ALL_BLURS,
    lambda own: _with_stops([*codes(BEYOND), *own], ALL_BLURS, BEYOND, (0.1,)),
    {"defocus": decoders.by_defocus, "defocus, each block": decoders.by_blocks},
    (Measure("BadPix", "%", False, 1), Measure("MSE·100", "px²", False, 1), Measure("RMSE", "m", False, 3)),
    _distances,
    _depth_scores,
    shown=lambda distance: np.clip((_blur(distance) / BLUR + 1) / 2, 0, 1),
)

TASKS = {task.name: task for task in (EDOF, DEPTH, LIGHT_FIELD, REFOCUSING, SPECTRUM)}


def task_named(name: str) -> Task:
    """A task by name.

    Raises:
        InputError: there is none.
    """
    checks.one_of("--task", name, tuple(TASKS))
    return TASKS[name]
