"""Names of the Stanford light-field archive's gantry: ``out_RR_CC_V_U.png`` (row, column, camera v
and u).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from vcc.base.units import mm
from vcc.formats.grid import Geometry, Place, ViewGrid, arrange, mean_step, pictures_in

_NAME = re.compile(r"(.+?)_(\d+)_(\d+)_(-?\d+\.\d+)_(-?\d+\.\d+)_?", re.IGNORECASE)


def find(folder: Path, *, sparse: bool = False) -> ViewGrid | None:
    """The grid of the pictures that have gantry names; None if there are none.

    Raises:
        InputError: a grid that `vcc.formats.grid.arrange` refuses.
    """
    matches = {file: match for file in pictures_in(folder) if (match := _NAME.fullmatch(file.stem))}
    if not matches:
        return None
    places = [Place(int(match[2]), int(match[3]), file) for file, match in matches.items()]
    grid = ViewGrid("Stanford gantry names", arrange(places, folder, sparse=sparse))
    return ViewGrid(grid.format, grid.files, read_geometry(grid) or Geometry())


def read_geometry(grid: ViewGrid) -> Geometry | None:
    """The cameras that the names of a grid's files state; None if they are no gantry names.

    The names state camera positions without a unit: their ratio is known, and they are taken as
    millimetres. Whether they grow with row and column tells which axis to suspect if one is
    flipped.
    """
    where = np.full((*grid.shape, 2), np.nan)
    for place, file in grid.present.items():
        match = _NAME.fullmatch(file.stem)
        if match is None:
            return None
        where[place] = float(match[4]), float(match[5])
    down, right = mean_step(where[..., 0], 0), mean_step(where[..., 1], 1)
    spacing = (abs(down) or abs(right), abs(right) or abs(down))  # a single row has no step down
    return Geometry(
        spacing=(spacing[0] * mm, spacing[1] * mm) if spacing[0] > 0 else None,
        spacing_unit="mm",
        directions=(-1 if down < 0 else 1, -1 if right < 0 else 1),
    )
