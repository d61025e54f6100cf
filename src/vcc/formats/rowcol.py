"""Views whose names end in row and column: ``lf_1_1.png``, ``2067_01_09.png``, ``view_r00_c02.jpg``; also with
a running number, ``IMG_0001_017_02_04.png``.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from vcc.base.errors import InputError
from vcc.formats.grid import Place, ViewGrid, arrange, pictures_in

_NAME = re.compile(r"(?P<before>.*?)(?P<row>\d+)(?P<between>[^\d.]{1,8})(?P<column>\d+)")
_NUMBER = re.compile(r"\d+")


def find(folder: Path, *, sparse: bool = False) -> ViewGrid | None:
    """The grid of pictures whose names end in two numbers, row then column; None if there are none.

    Numbers may be counted from any start and in any constant step. Pictures with other names are ignored. A
    third number that differs in every name is a running number and is ignored.

    Raises:
        InputError: several such sets in the folder, or as in `vcc.formats.grid.arrange`.
    """
    pictures = pictures_in(folder)
    sets: dict[str, list[Place]] = defaultdict(list)
    for file in pictures:
        match = _NAME.fullmatch(file.stem)
        if match:
            place = Place(int(match["row"]), int(match["column"]), file)
            sets[match["before"] + "…" + match["between"] + "…"].append(place)
    several = {name: places for name, places in sets.items() if len(places) > 1}
    if len(several) == 1:
        files = arrange(next(iter(several.values())), folder, sparse=sparse)
        return ViewGrid("names with row and column", files)
    counted = _beside_a_count(pictures)
    if counted:
        return ViewGrid("names with row, column and a running number", arrange(counted, folder, sparse=sparse))
    if not several:
        return None
    named = ", ".join(f'"{name}" ({len(places)} files)' for name, places in several.items())
    raise InputError(
        f"{folder} holds {len(several)} sets of pictures with a row and a column in their "
        f"names: {named}. "
        "Leave one of them in the folder, or list the views in a views.csv"
    )


def _beside_a_count(pictures: Sequence[Path]) -> list[Place]:
    """The places of pictures whose names differ in three numbers, one of which is a running number; none if
    there are no such names, or several sets of them.
    """
    sets: dict[str, list[Path]] = defaultdict(list)
    for file in pictures:
        if "." not in file.stem:  # decimals are positions
            sets[_NUMBER.sub("#", file.stem)].append(file)
    found = [places for files in sets.values() if (places := _without_their_count(files))]
    return found[0] if len(found) == 1 else []


def _without_their_count(files: Sequence[Path]) -> list[Place]:
    """Rows and columns in names of one form; none unless three numbers vary, one of which is a running number."""
    numbers = [[int(digits) for digits in _NUMBER.findall(file.stem)] for file in files]
    varying = [column for column in zip(*numbers, strict=True) if len(set(column)) > 1]
    places = [column for column in varying if len(set(column)) < len(files)]
    if len(varying) != 3 or len(places) != 2:
        return []
    return [Place(row, column, file) for row, column, file in zip(*places, files, strict=True)]
