"""Light fields of Cambridge's Blender add-on: pictures ``RR_CC.png`` and ``param.txt``."""

from __future__ import annotations

import math
import re
from pathlib import Path

from vcc.base.errors import InputError
from vcc.formats.grid import Geometry

PARAMETERS = "param.txt"

_LINE = re.compile(r"\s*(num_x|num_y|base_x|base_y)\s*[:=]?\s*(\S+)\s*")


def read_parameters(folder: Path) -> tuple[tuple[int, int], Geometry] | None:
    """The (rows, columns) of views and the cameras that ``param.txt`` states; None without such a file.

    base_x and base_y are distances between neighbouring views in Blender's unit, the metre. The cameras are
    parallel; their focal length is not stated.

    Raises:
        InputError: a quantity that is missing or impossible.
    """
    path = folder / PARAMETERS
    if not path.is_file():
        return None
    text = path.read_text(encoding="utf-8", errors="replace")
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
    shape = int(values["num_y"]), int(values["num_x"])
    return shape, Geometry(spacing=(values["base_y"], values["base_x"]), focus_distance=math.inf)
