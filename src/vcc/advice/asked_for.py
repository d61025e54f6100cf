"""The light field that a camera needs: it fills the opening, as fine as pixels and depths require."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.advice.folded import enough
from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.optics.train import Train

Array = NDArray[np.float64]

MOST_VIEWS = 100_000
"""Largest number of views per side: beyond it, the given depths are assumed to be wrong."""


def asked_for(train: Train, vergences: tuple[float, float], views: Any = None) -> Grid:
    """The grid of the light field that a camera of lenses and prisms needs.

    Its samples have the width of a pixel on the sensor, and its views fill the opening.

    Args:
        train: with at least one stop.
        vergences: 1/Z of the (farthest, nearest) part of the scene, 1/m.
        views: (rows, columns); None uses as many as keep neighbouring views' images at most one pixel apart.

    Raises:
        InputError: a camera without a stop, or with elements other than lenses and prisms that bend light; a
            sensor that no slope reaches, views that are not integers, or an unreasonable number of views.
    """
    _check_known(train)
    matrix = train.arriving_at_sensor.linear
    pitches = np.array(train.sensor.pitches[::-1])
    by_place, by_slope = matrix[:2, :2] / pitches[:, None], matrix[:2, 2:] / pitches[:, None]
    width, height = (_opening(train, axis, vergences) for axis in (0, 1))
    if views is None:
        apart = [np.linalg.norm(by_place + by_slope * vergence, axis=0) for vergence in vergences]
        rows, columns = _needed(np.max(apart, axis=0), width, height)
    else:
        rows, columns = checks.counts("views", views, "rows", "columns")
    slopes = 1 / np.linalg.norm(by_slope, axis=0)
    nt, ns = train.sensor.shape
    steps = np.diag([width / columns, height / rows, -slopes[0], -slopes[1]])
    centre = np.array([columns - 1, rows - 1, ns - 1, nt - 1]) / 2
    return Grid((rows, columns, nt, ns), Affine.from_parts(steps, -steps @ centre), np.dtype(np.float32))


def _check_known(train: Train) -> None:
    for stage in train.stages:
        if stage.faces.bending is not None:
            raise InputError(
                f"{stage.element.label} bends rays otherwise than a lens or a prism: which light field this "
                "camera asks for is not known in closed form; pass one"
            )
    if np.abs(train.arriving_at_sensor.linear[:2, 2:]).max() == 0:
        raise InputError(
            "the sensor lies at an image of the entrance plane, where all slopes fall into one place: which light "
            "field this camera asks for is not known; pass one"
        )


def _opening(train: Train, axis: int, vergences: tuple[float, float]) -> float:
    """Width at the entrance plane of the light that all stops pass, for points at these 1/Z, metres."""
    widths = []
    for stage in train.stages:
        if stage.faces.pattern is not None and math.isfinite(size := stage.faces.pattern.size[axis]):
            by_place, by_slope = stage.arriving.linear[axis, axis], stage.arriving.linear[axis, 2 + axis]
            widths += [size / abs(by_place + by_slope * vergence) for vergence in vergences]
    if not widths:
        raise InputError(
            "nothing bounds the light that this camera takes in: give the lens a diameter, or pass a light field"
        )
    return float(min(widths))


def _needed(pixels_per_metre: Array, width: float, height: float) -> tuple[int, int]:
    """(rows, columns) of views whose images are at most one pixel apart."""
    columns, rows = (max(1, enough(float(gap))) for gap in pixels_per_metre * (width, height))
    if max(rows, columns) > MOST_VIEWS:
        raise InputError(
            f"these depths would need {rows}×{columns} views: are they in metres before the camera, and is the "
            "sensor near focus?"
        )
    return rows, columns
