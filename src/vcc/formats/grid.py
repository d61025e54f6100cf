"""Grids of views: which file stands at which row and column, and whether all of them are there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from vcc.errors import InputError
from vcc.units import mm

PICTURE_ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr")
"""The endings of the files that views may be stored in."""

DEFAULT_SPACING = 1 * mm
"""The view spacing taken where nothing states one, metres."""

_NAMED_AT_MOST = 12


@dataclass(frozen=True)
class Place:
    """A view as a file name or list gives it: its numbers, whatever they count from, and its
    file.
    """

    row: int
    column: int
    file: Path


@dataclass(frozen=True)
class Geometry:
    """What a format states of the cameras; None for each quantity that it does not.

    Args:
        spacing: distance (dv, du) between neighbouring views, metres.
        spacing_is_relative: the numbers are known, and their unit is not: taken as millimetres.
        slope_per_pixel: pixel pitch over focal length.
        focus_distance: where the views converge, metres; infinite if parallel.
        disparity_range: (lowest, highest), pixels per view.
        directions: (+1 or −1 along rows of views, likewise columns): whether the stated camera
            position grows from one to the next.
        picture_shape: (rows, columns) that the pictures must have.
    """

    spacing: tuple[float, float] | None = None
    spacing_is_relative: bool = False
    slope_per_pixel: float | None = None
    focus_distance: float | None = None
    disparity_range: tuple[float, float] | None = None
    directions: tuple[int, int] | None = None
    picture_shape: tuple[int, int] | None = None


@dataclass(frozen=True)
class ViewGrid:
    """A complete grid of views.

    Args:
        format: what the files follow, for people.
        files: files[row][column], row 0 at the top, column 0 at the left.
        geometry: what is known of the cameras.
    """

    format: str
    files: tuple[tuple[Path, ...], ...]
    geometry: Geometry = Geometry()

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of views."""
        return len(self.files), len(self.files[0])


def pictures_in(folder: Path) -> list[Path]:
    """The picture files directly in a folder, by name; hidden ones are left out."""
    return sorted(
        file
        for file in folder.iterdir()
        if file.suffix.lower() in PICTURE_ENDINGS and not file.name.startswith(".")
    )


def arrange(
    places: Iterable[Place],
    folder: Path,
    numbers: tuple[Sequence[int], Sequence[int]] | None = None,
) -> tuple[tuple[Path, ...], ...]:
    """Files as files[row][column], every place of the grid filled once.

    Rows and columns may be counted from any number and in any even step (0, 1, 2 …; 9 … 17; 0, 2, 4
    …).

    Args:
        places: the views that there are.
        folder: how to name them all in an error.
        numbers: the row and column numbers that there must be, where the format states them.

    Raises:
        InputError: two files for a place, places without a file, or files outside the grid.
    """
    at: dict[tuple[int, int], Path] = {}
    for place in places:
        where = (place.row, place.column)
        if where in at:
            raise InputError(
                f"{folder} has two files for the view (row {where[0]}, column {where[1]}): "
                f"{at[where].name} and {place.file.name}. Move one of them away"
            )
        at[where] = place.file
    if not at:
        raise InputError(f"{folder} holds no views")
    rows, columns = numbers or (_counted([r for r, _ in at]), _counted([c for _, c in at]))
    _refuse_extra(at, rows, columns, folder)
    _refuse_missing(at, rows, columns, folder)
    return tuple(tuple(at[row, column] for column in columns) for row in rows)


def _counted(numbers: list[int]) -> range:
    """From the lowest number to the highest, in the largest step that meets all."""
    low, high = min(numbers), max(numbers)
    step = math.gcd(*(number - low for number in numbers)) or 1
    return range(low, high + 1, step)


def _refuse_extra(
    at: dict[tuple[int, int], Path], rows: Sequence[int], columns: Sequence[int], folder: Path
) -> None:
    extra = [where for where in at if where[0] not in rows or where[1] not in columns]
    if extra:
        raise InputError(
            f"{folder} has {len(extra)} views outside its grid of {len(rows)}×{len(columns)} "
            "views, "
            f"for instance {at[extra[0]].name} at (row {extra[0][0]}, column {extra[0][1]}). "
            "Move them away or correct the size of the grid"
        )


def _refuse_missing(
    at: dict[tuple[int, int], Path], rows: Sequence[int], columns: Sequence[int], folder: Path
) -> None:
    total = len(rows) * len(columns)
    if len(at) == total:
        return
    missing: list[tuple[int, int]] = []
    for row in rows:
        for column in columns:
            if (row, column) not in at:
                missing.append((row, column))
            if len(missing) == _NAMED_AT_MOST:
                break
        if len(missing) == _NAMED_AT_MOST:
            break
    count = total - len(at)
    named = ", ".join(map(str, missing)) + (", …" if count > len(missing) else "")
    raise InputError(
        f"{folder} has {len(at)} of the {total} views of its {len(rows)}×{len(columns)} grid; "
        f"{count} are missing, by (row, column): {named}. Incomplete grids cannot be opened yet: "
        "add the missing files, or move a smaller complete grid of them to a folder of its own"
    )
