"""Names of the Stanford light-field archive's gantry: ``out_RR_CC_V_U.png`` (row, column, camera v and u)."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from vcc.formats.grid import Geometry, ViewGrid
from vcc.formats.positions import START, find_named, names_of, stepped

_NAME = re.compile(rf"{START}_?", re.IGNORECASE)


def find(folder: Path, *, sparse: bool = False) -> ViewGrid | None:
    """The grid of the pictures that have gantry names; None if there are none.

    Raises:
        InputError: a grid that `vcc.formats.grid.arrange` refuses.
    """
    return find_named(folder, _NAME, "Stanford gantry names", read_geometry, sparse=sparse)


def read_geometry(grid: ViewGrid) -> Geometry | None:
    """The cameras that the names of a grid's files state; None if they are no gantry names.

    The names state camera positions without a unit: their ratio is known, and they are taken as millimetres.
    Whether they grow with row and column tells which axis to suspect if one is flipped.
    """
    names = names_of(grid, _NAME)
    return None if names is None else replace(stepped(names, grid.shape), spacing_unit="mm")
