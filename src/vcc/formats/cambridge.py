"""Light fields of Cambridge's Blender add-on: pictures ``RR_CC.png`` and ``param.txt``."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.reading import read_bytes
from vcc.formats.grid import Geometry

PARAMETERS = "param.txt"

_LINE = re.compile(r"\s*(num_x|num_y|base_x|base_y)\s*[:=]?\s*(\S+)\s*")


@dataclass(frozen=True)
class Parameters:
    """What ``param.txt`` states.

    Camera t of T in a row stands base_x·(2t/(T − 1) − 1) to the left of the middle, and rows go upwards alike:
    base is half the width of all cameras together. Source: CamPoses in util.py of
    gfxdisp/Blender-addon-light-field-camera, alike in all its versions; its README calls base the distance
    between neighbours, which it is for 3 views only.

    Args:
        views: (rows, columns) of views.
        base: (base_y, base_x), in Blender's unit, the metre.
    """

    views: tuple[int, int]
    base: tuple[float, float]

    @property
    def spacing(self) -> tuple[float, float] | None:
        """Distance (dv, du) between neighbouring views, metres; a single row has that of the columns. None for one
        view.
        """
        steps = [2 * base / (n - 1) if n > 1 else None for base, n in zip(self.base, self.views, strict=True)]
        down, right = steps[0] or steps[1], steps[1] or steps[0]
        return None if down is None or right is None else (down, right)

    @property
    def geometry(self) -> Geometry:
        """The cameras: parallel, counted from the lower right; their focal length is not stated."""
        return Geometry(
            spacing=self.spacing, focus_distance=math.inf, directions=(-1, -1), directions_are_true=True
        )


def read_parameters(folder: Path) -> Parameters | None:
    """What ``param.txt`` states; None without such a file.

    Raises:
        InputError: a quantity that is missing or impossible.
    """
    path = folder / PARAMETERS
    if not os.path.lexists(path):
        return None
    text = read_bytes(path).decode("utf-8", errors="replace")
    stated = {match[1]: match[2] for line in text.splitlines() if (match := _LINE.fullmatch(line))}
    if not stated:
        return None  # some other file of this common name
    values: dict[str, float] = {}
    for name in ("num_x", "num_y", "base_x", "base_y"):
        if name not in stated:
            raise InputError(f"{path} does not state {name}. Add a line such as {name}: 9")
        try:
            values[name] = float(stated[name])
        except ValueError:
            values[name] = math.nan
        if not 0 < values[name] < math.inf or (name.startswith("num") and values[name] % 1):
            raise InputError(f'{path}: {name} is "{stated[name]}", and must be a number above 0')
    return Parameters((int(values["num_y"]), int(values["num_x"])), (values["base_y"], values["base_x"]))
