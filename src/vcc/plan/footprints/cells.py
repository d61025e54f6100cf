"""How the cells of views and samples are divided where masks are finer than they are."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.plan.footprints.planes import Plane, detail_lost
from vcc.plan.how import LARGEST_REFINEMENT
from vcc.plan.parallax_rule import BetweenViews

Array = NDArray[np.float64]

CORRELATED = 0.02
"""Share of two masks' variances that may vanish together inside the cell of a view before cells are divided."""
FINE_DETAIL_IN_VIEW = 0.15
"""Share of a mask's variance that may vanish inside the cell of a view before cells are divided."""
FINE_DETAIL_IN_SAMPLE = 0.01
"""Share of a mask's variance that may vanish inside a sample before samples are divided."""
LARGEST_CHOSEN_REFINEMENT = 4
"""Beyond this a plan divides samples only when told to: the cost grows with the square."""


@dataclass(frozen=True)
class CellDivision:
    """How the cells of views are divided.

    Args:
        parts: of each, along each axis.
        spread: whether a view's light reaches its neighbours, as a tent, for a place between views is interpolated
            from both; else it stays in its own cell.
        left: the correlation that masks in different planes still have inside a part (see `CORRELATED`).
    """

    parts: int
    spread: bool
    left: float = 0.0


def tap_places(views: int, division: CellDivision) -> tuple[NDArray[np.int64], Array, Array]:
    """Views read, shifts from them in views, and shares, of the taps along one axis.

    Undivided, each view is one tap. Divided, it is one in each part of its cell; or its light is spread over a
    tent that reaches its neighbours, so that a place between views is interpolated linearly from both.
    """
    divide = division.parts
    if division.spread:
        shift = (np.arange(-divide, divide) + 0.5) / divide
        share = (1 - np.abs(shift)) / divide
    else:
        shift = (np.arange(divide) + 0.5) / divide - 0.5
        share = np.full(divide, 1 / divide)
    return np.repeat(np.arange(views), len(shift)), np.tile(shift, views), np.tile(share, views)


def divide_views(
    planes: list[Plane],
    path_planes: list[Plane],
    between: BetweenViews,
    refine: int | str,
    lost: Callable[[Plane, Array, Array], float] = detail_lost,
) -> CellDivision:
    """How a view's cell is divided so that fine masks keep their detail.

    Where a cell's picture is spread over more than a pixel, what a mask does inside the cell must fall where it
    belongs. Elsewhere it adds up in one place, and the mean over the cell says it all for one mask; but the mean
    of two masks' product is not the product of their means where both are finer than the cell.

    Args:
        planes: of masks that are not against the sensor.
        path_planes: those in mid-path.
        between: what is between views.
        refine: "auto", or what was asked for.
        lost: finds `detail_lost`.
    """
    if refine != "auto":
        return CellDivision(1, False)
    divide = 1
    for plane in planes:
        cell = np.abs(plane.view_step(between.motion)).sum(axis=1)
        while divide < min(LARGEST_REFINEMENT, max(between.gap_filled)):
            if lost(plane, np.zeros(2), cell / divide) < FINE_DETAIL_IN_VIEW:
                break
            divide *= 2
    if divide > 1:
        return CellDivision(divide, True)

    if len(path_planes) < 2:
        return CellDivision(1, False)

    def correlated(parts: int) -> float:
        shares = sorted(
            lost(plane, np.zeros(2), np.abs(plane.view_step(between.motion)).sum(axis=1) / parts)
            for plane in path_planes
        )
        return math.sqrt(max(shares[-2], 0.0) * max(shares[-1], 0.0))  # what is counted on cells may be below 0

    left = correlated(1)
    while left > CORRELATED and divide < LARGEST_CHOSEN_REFINEMENT:
        divide *= 2
        left = correlated(divide)
    return CellDivision(divide, False, left)


def divide_samples(
    planes: list[Plane],
    between: BetweenViews,
    views: tuple[float, float],
    refine: int | str,
    lost: Callable[[Plane, Array, Array], float] = detail_lost,
) -> int:
    """Into how many parts a sample is divided each way, so that a mask near the sensor stays sharp.

    A sample's light lands on the pixels as one footprint, mask and all: detail of the mask that the
    aperture's penumbra leaves and the footprint would blur needs finer samples.

    Args:
        planes: of masks in mid-path.
        between: what is between views.
        views: (rows, columns) of the grid of views.
        refine: "auto", or what was asked for.
        lost: finds `detail_lost`.
    """
    if isinstance(refine, int):
        return refine
    fine = 1
    for plane in planes:
        penumbra = np.abs(plane.view_step(between.motion)) @ np.array([views[1], views[0]])
        sample = 2 * np.abs(plane.sample_step).sum(axis=1)
        while fine < LARGEST_CHOSEN_REFINEMENT:
            if lost(plane, penumbra, sample / fine) < FINE_DETAIL_IN_SAMPLE:
                break
            fine *= 2
    return fine
