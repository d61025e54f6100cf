"""Views whose names end in a row and a column: ``lf_1_1.png``, ``2067_01_09.png``,
``view_r00_c02.jpg``.
"""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

from vcc.base.errors import InputError
from vcc.formats.grid import Place, ViewGrid, arrange, pictures_in

_NAME = re.compile(r"(?P<before>.*?)(?P<row>\d+)(?P<between>[^\d.]{1,8})(?P<column>\d+)")


def find(folder: Path, *, sparse: bool = False) -> ViewGrid | None:
    """The grid of the pictures whose names end in two numbers, row then column; None if there are
    none.

    Counted from any number and in any even step. Pictures of other names are left alone.

    Raises:
        InputError: several such sets in the folder, or a grid that `vcc.formats.grid.arrange`
            refuses.
    """
    sets: dict[str, list[Place]] = defaultdict(list)
    for file in pictures_in(folder):
        match = _NAME.fullmatch(file.stem)
        if match:
            place = Place(int(match["row"]), int(match["column"]), file)
            sets[match["before"] + "…" + match["between"] + "…"].append(place)
    several = {name: places for name, places in sets.items() if len(places) > 1}
    if not several:
        return None
    if len(several) > 1:
        named = ", ".join(f'"{name}" ({len(places)} files)' for name, places in several.items())
        raise InputError(
            f"{folder} holds {len(several)} sets of pictures with a row and a column in their "
            f"names: {named}. "
            "Leave one of them in the folder, or list the views in a views.csv"
        )
    files = arrange(next(iter(several.values())), folder, sparse=sparse)
    return ViewGrid("names with row and column", files)
