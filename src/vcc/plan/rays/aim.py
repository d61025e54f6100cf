"""Where rays are aimed on their way back from the sensor: at the smallest window that light can come through.

Rays are bound by strips (`vcc.plan.rays.strips`), whose width depends on how far rays stray
(`vcc.plan.rays.slack`), and that on where they meet what bends them, so on the aim: it is sought in rounds. Before
lens arrays each cell may have a window of its own (`vcc.plan.rays.cell_windows`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.plan.rays import cell_windows
from vcc.plan.rays.path import Path
from vcc.plan.rays.slack import Slack, strayed
from vcc.plan.rays.strips import UNBOUNDED, windows
from vcc.plan.rays.windows import Aim, CellWindows, Window

Array = NDArray[np.float64]

ROUNDS = 8
"""Plates deflect by where they are met, and are met by how they deflect: bounds are refined so often."""
SETTLED = 0.01
"""Share of the slack by which it changes where no more rounds are needed."""
WORTH_NARROWING = 0.7
"""Share of the solid angle asked for below which a smaller one is aimed at; likewise for windows of cells."""


@dataclass(frozen=True, eq=False, repr=False)
class Aimed(Brief):
    """An aim, and for each leg the region (low, high) in which rays that are aimed so meet its stage, metres."""

    aim: Aim
    regions: list[tuple[Array, Array]]


def aimed(path: Path) -> tuple[Aimed, Aimed | None]:
    """Where to aim, and what the camera asks for where that is more.

    A camera asks for all rays that its stops let through. Of those, a light field holds what its views cover:
    without a stop at the views, the grid of views is taken for one.

    Raises:
        InputError: nothing bounds the rays.
    """
    asked = settled(path, everything=False)
    narrow = settled(path, everything=True)
    if _solid_angle(path, narrow.aim) < WORTH_NARROWING * _solid_angle(path, asked.aim):
        return narrow, asked
    return asked, None


def settled(path: Path, everything: bool) -> Aimed:
    """The smallest aim, slack and all; see `vcc.plan.rays.strips.bounds`."""
    slack, before = Slack.none(path), math.inf
    for _ in range(ROUNDS):
        _, slack = strayed(path, smallest(path, slack, everything))
        if abs(slack.size - before) <= SETTLED * before < math.inf:
            break
        if slack.size > UNBOUNDED:
            _refuse(path)
        before = slack.size
    else:
        _refuse(path)
    aim = smallest(path, slack, everything)  # once more, with all that rays can stray by
    return Aimed(aim, strayed(path, aim)[0])


def _refuse(path: Path) -> NoReturn:
    """Say which elements leave the rays without a bound."""
    names = ", ".join(leg.stage.element.label for leg in path.legs if leg.stage.faces.bending is not None)
    raise InputError(
        f"no bound can be found for the rays through {names}: the further out, the more it bends. "
        "Give it a diameter, or put a stop beside it"
    )


def smallest(path: Path, slack: Slack, everything: bool) -> Aim:
    """The aim that takes in the smallest solid angle, or parts it where elements are not smooth.

    Windows of cells are aimed at where they save rays, and where a pixel's rays are enough for all cells that
    it sees: what a pixel sees jumps from cell to cell, and is smooth in each.
    """
    found = windows(path, slack.unknown, everything)
    if not found:
        raise InputError("nothing bounds the rays of this camera: give a lens or a mask a size")
    best = min(found, key=lambda window: window.solid_angle)
    cells = cell_windows.cell_windows(path, slack.whole, everything)
    return best if cells is None else _parted(path, best, cells)


def _parted(path: Path, whole: Window, cells: CellWindows) -> Aim:
    """The cells where that pays, else the window as a whole."""
    by_cells = _solid_angle(path, cells)
    if by_cells < WORTH_NARROWING * whole.solid_angle:
        return cells
    halvings = round(math.log2(max(cell_windows.cells_seen(cells, path.train.sensor), 1.0)))
    enough_rays = 2 ** (halvings + 1) <= path.samples
    much_lost = WORTH_NARROWING * by_cells > whole.solid_angle
    return replace(cells, halvings=halvings) if enough_rays and not much_lost else whole


def _solid_angle(path: Path, aim: Aim) -> float:
    """∫∫ ds dt over the aim."""
    return aim.solid_angle if isinstance(aim, Window) else cell_windows.solid_angle(aim, path.train.sensor)
