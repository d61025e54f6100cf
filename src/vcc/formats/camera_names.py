"""File names that state a view's row, column and position: ``NAME_RR_CC_V_U…`` of gantries and renderers.

The gantry of the Stanford light field archive writes ``out_RR_CC_V_U.png`` (row, column, camera v and u). A
Blender exporter for light field renderers adds the camera: ``NAME_RR_CC_V_U_FOCAL_SENSOR.jpg`` (position
downwards and to the right in mm, focal length, sensor).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.files.pictures import read_picture
from vcc.formats.grid import Geometry, Place, ViewGrid, arrange, pictures_in

_START = r"(.+?)_(\d+)_(\d+)_(-?\d+\.\d+)_(-?\d+\.\d+)"
"""Start of such names: a word, row, column, and the position downwards and to the right."""
_NUMBER = r"(\d+(?:\.\d+)?)"
_OF_GANTRIES = re.compile(rf"{_START}_?", re.IGNORECASE)
_WITH_CAMERA = re.compile(rf"{_START}_{_NUMBER}_{_NUMBER}")


def find(folder: Path, *, sparse: bool = False) -> ViewGrid | None:
    """The grid of pictures whose names state the camera; None if there are none.

    Raises:
        InputError: as in `vcc.formats.grid.arrange`, or cameras that differ.
    """
    return _find_named(
        folder, _WITH_CAMERA, "names with camera, focal length and sensor", read_geometry, sparse=sparse
    )


def read_geometry(grid: ViewGrid) -> Geometry | None:
    """The cameras stated by the names of a grid's files; None if the names do not state any.

    Positions are millimetres downwards and to the right in the plane of the cameras, which are parallel. The
    sensor width belongs to the longer side of the picture: slope per pixel = sensor / focal length / max(W, H).
    Reads one picture for its size.

    Raises:
        InputError: cameras of different focal lengths or sensors, or a focal length of 0.
    """
    names = _names_of(grid, _WITH_CAMERA)
    if names is None:
        return None
    kinds: dict[tuple[float, float], Path] = {}
    for place, match in names.items():
        kinds.setdefault((float(match[6]), float(match[7])), grid.present[place])
    if len(kinds) > 1 or min(next(iter(kinds))) <= 0:
        named = ", ".join(
            f"{file.name} (focal length {kind[0]:g}, sensor {kind[1]:g})" for kind, file in kinds.items()
        )
        raise InputError(
            f"{next(iter(kinds.values())).parent}: the names state cameras that are not alike or not possible: "
            f"{named}. All views have the same focal length and sensor, both above 0"
        )
    focal_length, sensor = next(iter(kinds))
    picture, _ = read_picture(next(iter(grid.present.values())))
    return replace(
        _stepped(names, grid.shape),
        slope_per_pixel=sensor / focal_length / max(picture.shape[:2]),
        focus_distance=math.inf,
        directions_are_true=True,
    )


def find_of_gantry(folder: Path, *, sparse: bool = False) -> ViewGrid | None:
    """The grid of pictures with gantry names; None if there are none.

    Raises:
        InputError: as in `vcc.formats.grid.arrange`.
    """
    return _find_named(folder, _OF_GANTRIES, "Stanford gantry names", geometry_of_gantry, sparse=sparse)


def geometry_of_gantry(grid: ViewGrid) -> Geometry | None:
    """The cameras stated by the names of a grid's files; None if they are not gantry names.

    The names state camera positions without a unit: their ratio is known, and millimetres are assumed. The sign
    of their growth with row and column indicates the wrong axis if one is flipped.
    """
    names = _names_of(grid, _OF_GANTRIES)
    return None if names is None else replace(_stepped(names, grid.shape), spacing_unit="mm")


def _find_named(
    folder: Path,
    name: re.Pattern[str],
    kind: str,
    geometry_of: Callable[[ViewGrid], Geometry | None],
    *,
    sparse: bool,
) -> ViewGrid | None:
    """The grid of pictures with such names; None if there are none.

    Args:
        folder: folder of the pictures; other files are ignored.
        name: pattern of a file name without extension; begins with `_START`.
        kind: name of the format, for people.
        geometry_of: returns the cameras stated by the names of a grid.
        sparse: use None for missing views instead of raising.

    Raises:
        InputError: as in `vcc.formats.grid.arrange` or ``geometry_of``.
    """
    matches = {file: match for file in pictures_in(folder) if (match := name.fullmatch(file.stem))}
    if not matches:
        return None
    places = [Place(int(match[2]), int(match[3]), file) for file, match in matches.items()]
    grid = ViewGrid(kind, arrange(places, folder, sparse=sparse))
    return replace(grid, geometry=geometry_of(grid) or Geometry())


def _names_of(grid: ViewGrid, name: re.Pattern[str]) -> dict[tuple[int, int], re.Match[str]] | None:
    """Match the names of a grid's files; None if one of them does not match."""
    matches = {place: name.fullmatch(file.stem) for place, file in grid.present.items()}
    found = {place: match for place, match in matches.items() if match is not None}
    return found if len(found) == len(matches) else None


def _stepped(names: dict[tuple[int, int], re.Match[str]], shape: tuple[int, int]) -> Geometry:
    """Spacing, directions and deviations from an even grid, from the positions in names, in millimetres.

    Args:
        names: matched names of the existing views, from `_names_of`.
        shape: (rows, columns) of views.
    """
    where = np.full((*shape, 2), np.nan)
    for place, match in names.items():
        where[place] = float(match[4]), float(match[5])
    down, right = _mean_step(where[..., 0], 0), _mean_step(where[..., 1], 1)
    spacing = (abs(down) or abs(right), abs(right) or abs(down))  # a single row has no step down
    off_grid = None
    if spacing[0] > 0:
        rows, columns = np.indices(shape)
        off = (where - np.stack([rows * down, columns * right], axis=-1)) / spacing
        off -= np.nanmean(off, axis=(0, 1))
        rms = np.sqrt(np.nanmean(off**2, axis=(0, 1)))
        off_grid = (float(rms[0]), float(rms[1]))
    return Geometry(
        spacing=(spacing[0] * mm, spacing[1] * mm) if spacing[0] > 0 else None,
        directions=(-1 if down < 0 else 1, -1 if right < 0 else 1),
        off_grid=off_grid,
    )


def _mean_step(positions: NDArray[Any], axis: int) -> float:
    """The mean step along an axis of a grid, with NaN for missing views; 0 for a single position."""
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
