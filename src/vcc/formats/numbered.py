"""Views that are only numbered, ``frame_017.png``: in rows or columns, all in one direction or to and fro."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.words import first_few
from vcc.files.pictures import read_picture
from vcc.formats.grid import MOST_PLACES, ViewGrid, pictures_in

Order = Literal["row-major", "column-major", "serpentine", "serpentine-columns"]

ORDERS: tuple[Order, ...] = ("row-major", "column-major", "serpentine", "serpentine-columns")

_NAME = re.compile(r"(?P<before>.*?)(?P<number>\d+)(?P<after>\D*)")
_THUMBNAIL = 24  # pixels: parallax is then a small part of a feature, and differences grow with it
_CLEARLY = 1.1  # by this factor the best arrangement must beat the next
_LINE = 1.5  # and a single row of views the best grid


def find(
    folder: Path, *, views: tuple[int, int] | None = None, order: Order | None = None, sparse: bool = False
) -> ViewGrid | None:
    """The grid of the folder's pictures with running numbers; None if there are none.

    Args:
        folder: where the pictures are; others without a number are left alone.
        views: (rows, columns). Not given, it is found from the pictures, which are read for it: in the right
            arrangement neighbours differ least.
        order: "row-major" (rows from left to right, one below the other), "column-major", or "serpentine" and
            "serpentine-columns", every other row or column reversed. Found likewise.
        sparse: allow numbers that are missing.

    Raises:
        InputError: several sets of numbered pictures, numbers missing, a number of pictures that is not that of
            the views, or an arrangement that the pictures do not tell clearly.
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
        views, order = _arrangement([file for file in line if file is not None], views, order, folder)
    places = running_numbers(views, order)
    files = tuple(tuple(line[number] for number in row) for row in places)
    return ViewGrid(f"running numbers, {views[0]}×{views[1]} views, {order}", files)


def running_numbers(views: tuple[int, int], order: Order) -> NDArray[np.intp]:
    """The running number, from 0, of the view at each (row, column).

    Args:
        views: (rows, columns).
        order: see `find`.
    """
    rows, columns = views
    if order in ("column-major", "serpentine-columns"):
        turned: Order = "row-major" if order == "column-major" else "serpentine"
        return running_numbers((columns, rows), turned).T
    numbers = np.arange(rows * columns).reshape(rows, columns)
    if order == "serpentine":
        numbers[1::2] = numbers[1::2, ::-1]
    return numbers


def _numbered(folder: Path) -> dict[int, Path]:
    """The largest set of pictures whose names differ in one number only."""
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
    """The files in the order of their numbers, None for those missing."""
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
            "others are missing cannot be known. Add them, or list those that there are in a views.csv"
        )
    missing = count - len(numbered)
    if missing and (not sparse or count > MOST_PLACES):
        named = (number for number in range(first, first + count * step, step) if number not in numbered)
        way_out = "Add them, or open those that there are with vcc.formats.open_sparse_views"
        raise InputError(
            f"{folder} has {len(numbered)} of {count} numbered views; {missing} are missing: "
            f"{first_few(named, missing)}. {way_out if not sparse else 'Is a number wrong?'}"
        )
    return [numbered.get(first + n * step) for n in range(count)]


@dataclass(frozen=True)
class _Candidate:
    views: tuple[int, int]
    order: Order
    difference: float


def _arrangement(
    files: list[Path], views: tuple[int, int] | None, order: Order | None, folder: Path
) -> tuple[tuple[int, int], Order]:
    """The arrangement in which neighbouring views differ least."""
    count = len(files)
    if views is not None and 1 in views:
        return views, order or "row-major"
    differences = _differences(files)
    # A square grid told as rows or as columns has the same neighbours: parallax decides later.
    orders: tuple[Order, ...] = (order,) if order else ("row-major", "serpentine")
    if views is None:
        shapes = [(n, count // n) for n in range(2, count // 2 + 1) if count % n == 0]
    else:
        shapes = [views]
        if order is None and views[0] != views[1]:
            orders = ORDERS
    found = sorted(
        (
            _Candidate(shape, way, float(np.mean(list(_neighbours(differences, running_numbers(shape, way))))))
            for shape in shapes
            for way in orders
        ),
        key=lambda candidate: candidate.difference,
    )
    if views is None:
        line = float(np.mean(np.diagonal(differences, 1)))
        if not found or line * _LINE < found[0].difference:
            return (1, count), "row-major"
    if len(found) > 1 and not found[1].difference > _CLEARLY * found[0].difference:
        likely = " or ".join(f'views={c.views}, order="{c.order}"' for c in found[:2])
        raise InputError(
            f"{folder} has {count} numbered pictures, and they do not tell how they are arranged. Pass {likely}, "
            "or whatever is right"
        )
    return found[0].views, found[0].order


def _differences(files: list[Path]) -> NDArray[np.float64]:
    """Mean absolute difference of each two pictures, made small."""
    small = np.stack([_thumbnail(read_picture(file)[0]) for file in files]).reshape(len(files), -1)
    differences = np.zeros((len(files), len(files)))
    for number in range(len(files)):
        differences[number, number + 1 :] = np.abs(small[number + 1 :] - small[number]).mean(axis=1)
    return differences + differences.T


def _thumbnail(picture: NDArray[Any]) -> NDArray[np.float32]:
    """Block means of the picture's grey values."""
    grey = picture.mean(axis=2, dtype=np.float32) if picture.ndim == 3 else picture.astype(np.float32)
    size = max(1, min(grey.shape) // _THUMBNAIL)
    rows, columns = (n // size for n in grey.shape)
    blocks = grey[: rows * size, : columns * size].reshape(rows, size, columns, size)
    small: NDArray[np.float32] = blocks.mean(axis=(1, 3))
    return small


def _neighbours(differences: NDArray[np.float64], places: NDArray[np.intp]) -> Iterator[float]:
    """The differences of all views next to each other."""
    yield from differences[places[:, :-1], places[:, 1:]].ravel()
    yield from differences[places[:-1], places[1:]].ravel()
