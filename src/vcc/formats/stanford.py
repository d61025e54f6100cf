"""Names of the Stanford light-field archive's gantry: ``out_RR_CC_V_U.png`` (row, column, camera v
and u).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcc.formats.grid import Geometry, Place, ViewGrid, arrange, pictures_in
from vcc.units import mm

_NAME = re.compile(r"(.+?)_(\d+)_(\d+)_(-?\d+\.\d+)_(-?\d+\.\d+)_?", re.IGNORECASE)


def find(folder: Path) -> ViewGrid | None:
    """The grid of the pictures that have gantry names; None if there are none.

    The names state camera positions without a unit: their ratio is known, and they are taken as
    millimetres. Whether they grow with row and column tells which axis to suspect if one is
    flipped.

    Raises:
        InputError: a grid that `vcc.formats.grid.arrange` refuses.
    """
    places, positions = [], {}
    for file in pictures_in(folder):
        match = _NAME.fullmatch(file.stem)
        if match:
            places.append(Place(int(match[2]), int(match[3]), file))
            positions[file] = (float(match[4]), float(match[5]))
    if not places:
        return None
    files = arrange(places, folder)
    where = np.array([[positions[file] for file in row] for row in files])
    down, right = _step(where[..., 0], 0), _step(where[..., 1], 1)
    spacing = (abs(down) or abs(right), abs(right) or abs(down))  # a single row has no step down
    geometry = Geometry(
        spacing=(spacing[0] * mm, spacing[1] * mm) if spacing[0] > 0 else None,
        spacing_is_relative=True,
        directions=(-1 if down < 0 else 1, -1 if right < 0 else 1),
    )
    return ViewGrid("Stanford gantry names", files, geometry)


def _step(positions: NDArray[np.float64], axis: int) -> float:
    """The mean step along an axis of the grid, 0 if it has one place only."""
    return float(np.diff(positions, axis=axis).mean()) if positions.shape[axis] > 1 else 0.0
