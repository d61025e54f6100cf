"""Views that are only numbered, ``frame_017.png``: by rows or columns, in one direction or serpentine."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.words import first_few
from vcc.files.pictures import read_picture
from vcc.formats.grid import MOST_PLACES, ViewGrid, pictures_in
from vcc.formats.orders import Order, arrangement, running_numbers, thumbnail

_NAME = re.compile(r"(?P<before>.*?)(?P<number>\d+)(?P<after>\D*)")


def find(
    folder: Path, *, views: tuple[int, int] | None = None, order: Order | None = None, sparse: bool = False
) -> ViewGrid | None:
    """The grid of the folder's pictures with running numbers; None if there are none.

    Args:
        folder: folder of the pictures; pictures without a number are ignored.
        views: (rows, columns). By default detected from the pictures, which are read for this: in the right
            arrangement neighbours differ least.
        order: see `vcc.formats.orders`; detected likewise.
        sparse: allow missing numbers.

    Raises:
        InputError: several sets of numbered pictures, missing numbers, a number of pictures that does not match
            the views, or an arrangement that is not clear from the pictures.
    """
    numbered = _numbered(folder)
    if len(numbered) < 2:
        return None
    if views is not None and views[0] * views[1] < len(numbered):
        raise InputError(
            f"{folder} has {len(numbered)} numbered pictures, and views={views} would be {views[0] * views[1]}"
        )
    line = _line(numbered, views, folder, sparse)
    if views is None or order is None:
        if None in line:
            raise InputError(
                f'{folder} is incomplete: pass views=(rows, columns) and order="row-major" or another'
            )
        small = [thumbnail(read_picture(file)[0]) for file in line if file is not None]
        views, order = arrangement(small, views, order, f"{folder} has {len(small)} numbered pictures")
    places = running_numbers(views, order)
    files = tuple(tuple(line[number] for number in row) for row in places)
    return ViewGrid(f"running numbers, {views[0]}×{views[1]} views, {order}", files)


def _numbered(folder: Path) -> dict[int, Path]:
    """The set of pictures whose names differ in one number only; empty if there is none."""
    sets: dict[str, dict[int, Path]] = defaultdict(dict)
    for file in pictures_in(folder):
        match = _NAME.fullmatch(file.stem)
        if match is None:
            continue
        numbers = sets[f"{match['before']}…{match['after']}"]
        number = int(match["number"])
        if number in numbers:
            raise InputError(
                f"{folder} has two files for the view number {number}: {numbers[number].name} and {file.name}. "
                "Move one of them away"
            )
        numbers[number] = file
    several = {name: numbers for name, numbers in sets.items() if len(numbers) > 1}
    if len(several) > 1:
        named = ", ".join(f'"{name}" ({len(numbers)} files)' for name, numbers in several.items())
        raise InputError(
            f"{folder} holds {len(several)} sets of numbered pictures: {named}. "
            "Leave one of them in the folder, or list the views in a views.csv"
        )
    return next(iter(several.values())) if several else {}


def _line(
    numbered: dict[int, Path], views: tuple[int, int] | None, folder: Path, sparse: bool
) -> list[Path | None]:
    """The files in the order of their numbers, with None for missing ones."""
    first, last = min(numbered), max(numbered)
    step = math.gcd(*(number - first for number in numbered)) or 1
    span = (last - first) // step + 1
    count = views[0] * views[1] if views else span
    if span > count:
        raise InputError(
            f"{folder}: the number {last} of {numbered[last].name} is beyond {count} views from {first}"
        )
    if span < count and (first != 0 or step != 1):
        raise InputError(
            f"{folder} has {len(numbered)} of {count} numbered views, from {first} to {last}, and which of the "
            "others are missing is unknown. Add them, or list the existing views in a views.csv"
        )
    missing = count - len(numbered)
    if missing and (not sparse or count > MOST_PLACES):
        named = (number for number in range(first, first + count * step, step) if number not in numbered)
        verb = "is" if missing == 1 else "are"
        way_out = (
            'Add them, or pass missing="fill" (rendered from the others) or "dark"; open_sparse_views opens the '
            "existing ones"
        )
        raise InputError(
            f"{folder} has {len(numbered)} of {count} numbered views; {missing} {verb} missing: "
            f"{first_few(named, missing)}. {way_out if not sparse else 'Is a number wrong?'}"
        )
    return [numbered.get(first + n * step) for n in range(count)]
