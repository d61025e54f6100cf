"""Light fields of Cambridge's Blender add-on: pictures ``RR_CC.png`` and ``param.txt``."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.reading import number, read_bytes
from vcc.formats.grid import Geometry

PARAMETERS = "param.txt"

_LINE = re.compile(r"\s*(num_x|num_y|base_x|base_y)\s*[:=]?\s*(\S+)\s*")


@dataclass(frozen=True)
class Parameters:
    """Content of ``param.txt``.

    Camera t of T in a row is base_x·(2t/(T − 1) − 1) to the left of the centre, and rows go upwards likewise:
    base is half the extent of all cameras. Source: CamPoses in util.py of
    gfxdisp/Blender-addon-light-field-camera, equal in all versions; its README describes base as the distance
    between neighbours, which is true for 3 views only.

    Args:
        views: (rows, columns) of views.
        base: (base_y, base_x), in Blender's unit, metres.
    """

    views: tuple[int, int]
    base: tuple[float, float]

    @property
    def spacing(self) -> tuple[float, float] | None:
        """Distance (dv, du) between neighbouring views, metres; a single row gets the value of the columns.
        None for one view.
        """
        steps = [2 * base / (n - 1) if n > 1 else None for base, n in zip(self.base, self.views, strict=True)]
        down, right = steps[0] or steps[1], steps[1] or steps[0]
        return None if down is None or right is None else (down, right)

    @property
    def geometry(self) -> Geometry:
        """The cameras: parallel, counted from the lower right; the focal length is unknown."""
        return Geometry(
            spacing=self.spacing, focus_distance=math.inf, directions=(-1, -1), directions_are_true=True
        )


def read_parameters(folder: Path) -> Parameters | None:
    """Read ``param.txt``; None if there is no such file.

    Raises:
        InputError: a quantity is missing or invalid.
    """
    path = folder / PARAMETERS
    if not os.path.lexists(path):
        return None
    text = read_bytes(path).decode("utf-8", errors="replace")
    stated = {match[1]: match[2] for line in text.splitlines() if (match := _LINE.fullmatch(line))}
    if not stated:
        return None  # another file of this common name
    values: dict[str, float] = {}
    for name in ("num_x", "num_y", "base_x", "base_y"):
        if name not in stated:
            raise InputError(f"{path} does not state {name}. Add a line such as {name}: 9")
        values[name] = number(stated[name])
        if not 0 < values[name] < math.inf or (name.startswith("num") and values[name] % 1):
            raise InputError(f'{path}: {name} is "{stated[name]}", and must be a number above 0')
    return Parameters((int(values["num_y"]), int(values["num_x"])), (values["base_y"], values["base_x"]))
