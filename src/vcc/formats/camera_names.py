"""Names that state the camera, as a Blender exporter for light-field renderers writes them:
``NAME_RR_CC_V_U_FOCAL_SENSOR.jpg`` (row, column, position downwards and to the right in mm, focal length, sensor).
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

from vcc.base.errors import InputError
from vcc.files.pictures import read_picture
from vcc.formats.grid import Geometry, ViewGrid
from vcc.formats.positions import START, find_named, names_of, stepped

_NUMBER = r"(\d+(?:\.\d+)?)"
_NAME = re.compile(rf"{START}_{_NUMBER}_{_NUMBER}")
_KIND = "names with camera, focal length and sensor"


def find(folder: Path, *, sparse: bool = False) -> ViewGrid | None:
    """The grid of the pictures whose names state the camera; None if there are none.

    Raises:
        InputError: a grid that `vcc.formats.grid.arrange` refuses, or cameras that are not alike.
    """
    return find_named(folder, _NAME, _KIND, read_geometry, sparse=sparse)


def read_geometry(grid: ViewGrid) -> Geometry | None:
    """The cameras that the names of a grid's files state; None if they do not.

    Positions are millimetres downwards and to the right in the plane of the cameras, which are parallel. The
    sensor is as wide as the longer side of the picture: slope per pixel = sensor / focal length / max(W, H). Reads
    one picture, for its size.

    Raises:
        InputError: cameras of different focal lengths or sensors, or a focal length of 0.
    """
    names = names_of(grid, _NAME)
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
        stepped(names, grid.shape),
        slope_per_pixel=sensor / focal_length / max(picture.shape[:2]),
        focus_distance=math.inf,
        directions_are_true=True,
    )
