"""Grids of views: which file stands at which row and column, and whether all of them are there."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.base.words import first_few
from vcc.fields.grid import Sample

PICTURE_ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr", ".ppm", ".pgm")
"""The endings of the files that views may be stored in."""

MOST_PLACES = 2**20
"""Of a grid of which views are missing: a name with a wrong number could claim any."""

DEFAULT_SPACING = 1 * mm
"""The view spacing taken where nothing states one, metres."""


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
        spacing_unit: "" where the unit of the spacing is known; else what its numbers are taken for, "mm" or "m".
        slope_per_pixel: pixel pitch over focal length.
        focus_distance: where the views converge, metres; infinite if parallel.
        disparity_at_infinity: disparity of infinitely far points, pixels per view, from which the focus distance
            follows with the spacing: −du/(p·F). For formats that state a shift of the pictures.
        disparity_range: (lowest, highest), pixels per view.
        directions: (+1 or −1 along rows of views, likewise columns): whether the stated camera
            position grows from one to the next.
        directions_are_true: the positions are known to grow downwards and to the right, so that a −1 says that the
            files are counted the other way.
        picture_shape: (rows, columns) that the pictures must have.
        sample: what a sample is, see `vcc.LightField`: means over pixels unless a file says otherwise.
    """

    spacing: tuple[float, float] | None = None
    spacing_unit: Literal["", "mm", "m"] = ""
    slope_per_pixel: float | None = None
    focus_distance: float | None = None
    disparity_at_infinity: float | None = None
    disparity_range: tuple[float, float] | None = None
    directions: tuple[int, int] | None = None
    directions_are_true: bool = False
    picture_shape: tuple[int, int] | None = None
    sample: Sample = "mean"


@dataclass(frozen=True, eq=False, repr=False)
class Decoded(Brief):
    """What one file (or a folder that is one thing) holds, before it is made a light field.

    Args:
        format: what the file follows, for people.
        values: the samples as stored, shape (v, u, t, s) or (v, u, t, s, channels), unsigned integers (fractions
            of their full scale) or floating point.
        transfer: "srgb" for display-referred samples, "linear" for those proportional to light.
        geometry: what is known of the cameras, where there is no ``frame``.
        frame: the 5×5 frame, indices from 0, where the format has a full one.
        depth: true distances Z, metres, of the pixels of each view, shape (v, u, t, s), or of the centre view,
            shape (t, s).
        disparity: likewise true disparities, pixels per view, positive where nearer than the focus.
        weights: how much each sample is to be trusted, 0 (unknown) to 1, shape (v, u, t, s).
        notices: for the user, each a sentence.
        metadata: everything else that the file states, as plain values.
    """

    format: str
    values: NDArray[Any]
    transfer: Literal["srgb", "linear"]
    geometry: Geometry = Geometry()
    frame: Affine | None = None
    depth: NDArray[Any] | None = None
    disparity: NDArray[Any] | None = None
    weights: NDArray[Any] | None = None
    notices: tuple[str, ...] = ()
    metadata: dict[str, Any] = field(default_factory=dict)


def weights_apart(values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.float32]]:
    """Samples whose last channel is a weight (or an opacity), not copied, and that weight, 0 to 1.

    Args:
        values: shape (…, channels), unsigned integers or floating point.
    """
    whole = np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1
    return values[..., :-1], values[..., -1].astype(np.float32) / np.float32(whole)


@dataclass(frozen=True, repr=False)
class ViewGrid(Brief):
    """A grid of views.

    Args:
        format: what the files follow, for people.
        files: files[row][column], row 0 at the top, column 0 at the left; None for a view that is missing from a
            grid that may be sparse.
        geometry: what is known of the cameras.
    """

    format: str
    files: tuple[tuple[Path | None, ...], ...]
    geometry: Geometry = Geometry()

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of views."""
        return len(self.files), len(self.files[0])

    @property
    def present(self) -> dict[tuple[int, int], Path]:
        """The views there are, by (row, column), row by row."""
        return {
            (row, column): file
            for row, line in enumerate(self.files)
            for column, file in enumerate(line)
            if file is not None
        }

    @property
    def missing(self) -> tuple[tuple[int, int], ...]:
        """(row, column) of the views that there are not."""
        rows, columns = self.shape
        present = self.present
        return tuple((r, c) for r in range(rows) for c in range(columns) if (r, c) not in present)


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
    numbers: tuple[range, range] | None = None,
    *,
    sparse: bool = False,
) -> tuple[tuple[Path | None, ...], ...]:
    """Files as files[row][column], every place of the grid filled once.

    Rows and columns may be counted from any number and in any even step (0, 1, 2 …; 9 … 17; 0, 2, 4
    …).

    Args:
        places: the views that there are.
        folder: how to name them all in an error.
        numbers: the row and column numbers that there must be, where the format states them.
        sparse: leave None where a view is missing, instead of refusing the grid.

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
    if not sparse:
        _refuse_missing(at, rows, columns, folder)
    elif length(rows) * length(columns) > MOST_PLACES:
        raise InputError(
            f"{folder} has {len(at)} views in a grid of {length(rows)}×{length(columns)}, and a grid with views "
            f"missing has at most {MOST_PLACES:,} places: is a number wrong? The highest are row {rows[-1]} and "
            f"column {columns[-1]}"
        )
    return tuple(tuple(at.get((row, column)) for column in columns) for row in rows)


def _counted(numbers: list[int]) -> range:
    """From the lowest number to the highest, in the largest step that meets all."""
    low, high = min(numbers), max(numbers)
    step = math.gcd(*(number - low for number in numbers)) or 1
    return range(low, high + 1, step)


def length(numbers: range) -> int:
    """How many numbers, also where they are more than `len` can say."""
    return max(0, (numbers.stop - numbers.start + numbers.step - 1) // numbers.step)


def _refuse_extra(at: dict[tuple[int, int], Path], rows: range, columns: range, folder: Path) -> None:
    extra = [where for where in at if where[0] not in rows or where[1] not in columns]
    if extra:
        raise InputError(
            f"{folder} has {len(extra)} views outside its grid of {length(rows)}×{length(columns)} views, for "
            f"instance {at[extra[0]].name} at (row {extra[0][0]}, column {extra[0][1]}). "
            "Move them away or correct the size of the grid"
        )


def _refuse_missing(at: dict[tuple[int, int], Path], rows: range, columns: range, folder: Path) -> None:
    total = length(rows) * length(columns)
    if len(at) == total:
        return
    missing = ((row, column) for row in rows for column in columns if (row, column) not in at)
    count = total - len(at)
    raise InputError(
        f"{folder} has {len(at)} of the {total} views of its {length(rows)}×{length(columns)} grid; "
        f"{count} {'is' if count == 1 else 'are'} missing, by (row, column): {first_few(missing, count)}. A "
        "light field needs all views: add the missing files, or open the others with vcc.formats.open_sparse_views"
    )
