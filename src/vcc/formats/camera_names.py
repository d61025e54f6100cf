"""Names that state the camera, as a Blender exporter for light-field renderers writes them:
``NAME_RR_CC_V_U_FOCAL_SENSOR.jpg`` (row, column, position downwards and to the right in mm, focal length, sensor).
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.files.pictures import read_picture
from vcc.formats.grid import Geometry, Place, ViewGrid, arrange, mean_step, pictures_in

_NUMBER = r"(\d+(?:\.\d+)?)"
_NAME = re.compile(rf"(.+?)_(\d+)_(\d+)_(-?\d+\.\d+)_(-?\d+\.\d+)_{_NUMBER}_{_NUMBER}")


def find(folder: Path, *, sparse: bool = False) -> ViewGrid | None:
    """The grid of the pictures whose names state the camera; None if there are none.

    Raises:
        InputError: a grid that `vcc.formats.grid.arrange` refuses, or cameras that are not alike.
    """
    matches = {file: match for file in pictures_in(folder) if (match := _NAME.fullmatch(file.stem))}
    if not matches:
        return None
    places = [Place(int(match[2]), int(match[3]), file) for file, match in matches.items()]
    grid = ViewGrid("names with camera, focal length and sensor", arrange(places, folder, sparse=sparse))
    return ViewGrid(grid.format, grid.files, read_geometry(grid) or Geometry())


def read_geometry(grid: ViewGrid) -> Geometry | None:
    """The cameras that the names of a grid's files state; None if they do not.

    Positions are millimetres downwards and to the right in the plane of the cameras, which are parallel. The
    sensor is as wide as the longer side of the picture: slope per pixel = sensor / focal length / max(W, H). Reads
    one picture, for its size.

    Raises:
        InputError: cameras of different focal lengths or sensors, or a focal length of 0.
    """
    where = np.full((*grid.shape, 2), np.nan)
    kinds: dict[tuple[float, float], Path] = {}
    for place, file in grid.present.items():
        match = _NAME.fullmatch(file.stem)
        if match is None:
            return None
        where[place] = float(match[4]), float(match[5])
        kinds.setdefault((float(match[6]), float(match[7])), file)
    if len(kinds) > 1 or min(next(iter(kinds))) <= 0:
        named = ", ".join(
            f"{file.name} (focal length {kind[0]:g}, sensor {kind[1]:g})" for kind, file in kinds.items()
        )
        raise InputError(
            f"{next(iter(kinds.values())).parent}: the names state cameras that are not alike or not possible: "
            f"{named}. All views have the same focal length and sensor, both above 0"
        )
    focal_length, sensor = next(iter(kinds))
    down, right = mean_step(where[..., 0], 0), mean_step(where[..., 1], 1)
    spacing = (abs(down) or abs(right), abs(right) or abs(down))  # a single row has no step down
    picture, _ = read_picture(next(iter(grid.present.values())))
    return Geometry(
        spacing=(spacing[0] * mm, spacing[1] * mm) if spacing[0] > 0 else None,
        slope_per_pixel=sensor / focal_length / max(picture.shape[:2]),
        focus_distance=math.inf,
        directions=(-1 if down < 0 else 1, -1 if right < 0 else 1),
        directions_are_true=True,
    )
