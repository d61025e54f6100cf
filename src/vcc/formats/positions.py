"""Names of files that state a view's row, column and position: ``NAME_RR_CC_V_U…`` of gantries and renderers."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.units import mm
from vcc.formats.grid import Geometry, Place, ViewGrid, arrange, pictures_in

START = r"(.+?)_(\d+)_(\d+)_(-?\d+\.\d+)_(-?\d+\.\d+)"
"""How such names begin: a word, row, column, and the position downwards and to the right."""


def find_named(
    folder: Path,
    name: re.Pattern[str],
    kind: str,
    geometry_of: Callable[[ViewGrid], Geometry | None],
    *,
    sparse: bool,
) -> ViewGrid | None:
    """The grid of the pictures with such names; None if there are none.

    Args:
        folder: where the pictures are; others are left alone.
        name: of a file without its ending, begins with `START`.
        kind: what the files follow, for people.
        geometry_of: the cameras that the names of a grid state.
        sparse: leave None where a view is missing, instead of refusing the grid.

    Raises:
        InputError: a grid that `vcc.formats.grid.arrange` refuses, or what ``geometry_of`` does.
    """
    matches = {file: match for file in pictures_in(folder) if (match := name.fullmatch(file.stem))}
    if not matches:
        return None
    places = [Place(int(match[2]), int(match[3]), file) for file, match in matches.items()]
    grid = ViewGrid(kind, arrange(places, folder, sparse=sparse))
    return replace(grid, geometry=geometry_of(grid) or Geometry())


def names_of(grid: ViewGrid, name: re.Pattern[str]) -> dict[tuple[int, int], re.Match[str]] | None:
    """The names of a grid's files, taken apart; None if one of them is not such a name."""
    matches = {place: name.fullmatch(file.stem) for place, file in grid.present.items()}
    found = {place: match for place, match in matches.items() if match is not None}
    return found if len(found) == len(matches) else None


def stepped(names: dict[tuple[int, int], re.Match[str]], shape: tuple[int, int]) -> Geometry:
    """The spacing and the directions that positions in names state, taken as millimetres.

    Args:
        names: of the views there are, from `names_of`.
        shape: (rows, columns) of views.
    """
    where = np.full((*shape, 2), np.nan)
    for place, match in names.items():
        where[place] = float(match[4]), float(match[5])
    down, right = _mean_step(where[..., 0], 0), _mean_step(where[..., 1], 1)
    spacing = (abs(down) or abs(right), abs(right) or abs(down))  # a single row has no step down
    return Geometry(
        spacing=(spacing[0] * mm, spacing[1] * mm) if spacing[0] > 0 else None,
        directions=(-1 if down < 0 else 1, -1 if right < 0 else 1),
    )


def _mean_step(positions: NDArray[Any], axis: int) -> float:
    """The mean step between neighbours along an axis of a grid; 0 if it has one place only, NaN where missing."""
    if positions.shape[axis] < 2:
        return 0.0
    places = np.arange(positions.shape[axis])
    along = np.moveaxis(positions, axis, -1).reshape(-1, positions.shape[axis])
    slopes = []
    for line in along:
        there = np.isfinite(line)
        if there.sum() > 1:
            slopes.append(float(np.polyfit(places[there], line[there], 1)[0]))
    return float(np.mean(slopes)) if slopes else 0.0
