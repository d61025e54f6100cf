"""Grids of views: the file at each row and column, and checks for completeness."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.base.words import first_few
from vcc.fields.filling import Filling
from vcc.fields.grid import Sample
from vcc.files.envi import ENDINGS as ENVI

PICTURE_ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr", ".ppm", ".pgm", *ENVI)
"""Extensions of files for views."""

MOST_PLACES = 2**20
"""Maximum size of a grid with missing views: a name with a wrong number could claim any size."""

DEFAULT_SPACING = 1 * mm
"""Default view spacing, metres."""


@dataclass(frozen=True)
class Place:
    """A view as stated by a file name or list: its numbers, counted from any start, and its file."""

    row: int
    column: int
    file: Path


@dataclass(frozen=True)
class Geometry:
    """Geometry of the cameras as stated by a format; None for unknown quantities.

    Args:
        spacing: distance (dv, du) between neighbouring views, metres.
        spacing_unit: "" if the unit of the spacing is known; else the assumed unit, "mm" or "m".
        slope_per_pixel: pixel pitch over focal length.
        focus_distance: distance at which the views converge, metres; infinite if parallel.
        disparity_at_infinity: disparity of infinitely far points, pixels per view, which with the spacing gives
            the focus distance: −du/(p·F). For formats that state a shift of the pictures.
        disparity_range: (lowest, highest), pixels per view.
        directions: (+1 or −1 along rows of views, likewise columns): the sign of the steps between stated
            camera positions.
        directions_are_true: whether positions are known to grow downwards and to the right, so that −1 means
            that the files are counted in reverse.
        picture_shape: (rows, columns) required of the pictures.
        sample: meaning of a sample, see `vcc.LightField`; means over pixels unless a file states otherwise.
        wavelengths: of the channels, metres.
        filling: views that were not recorded, if a file states it.
        off_grid: root mean square distance of stated camera positions from an even grid, in its steps along rows
            and columns of views.
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
    wavelengths: tuple[float, ...] | None = None
    filling: Filling | None = None
    off_grid: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Decoded(Brief):
    """Content of one file (or of a folder that counts as a file), before conversion to a light field.

    Args:
        format: name of the format, for people.
        values: the samples as stored, shape (v, u, t, s) or (v, u, t, s, channels), unsigned integers (fractions
            of their full scale) or floating point.
        transfer: "srgb" for display-referred samples, "linear" for linear ones.
        geometry: known geometry of the cameras, if there is no ``frame``.
        frame: the 5×5 frame, indices from 0, if the format states a full one.
        depth: true distances Z, metres, of the pixels of each view, shape (v, u, t, s), or of the central view,
            shape (t, s).
        disparity: likewise true disparities, pixels per view, positive if nearer than the focus.
        weights: confidence of each sample, 0 (unknown) to 1, shape (v, u, t, s).
        notices: notices for the user, each a sentence.
        metadata: further metadata of the file, as plain values.
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


def stated_sample(stated: Any, where: str) -> Sample:
    """The meaning of samples that a file states as text; None is the mean over a pixel.

    Raises:
        InputError: another text.
    """
    if stated is None:
        return "mean"
    sample: Sample | None = next((known for known in get_args(Sample) if stated == known), None)
    if sample is None:
        raise InputError(f'{where} is {stated!r}; "mean" and "point" are known')
    return sample


def stated_range(stated: NDArray[Any] | None, where: str) -> tuple[float, float] | None:
    """(lowest, highest) disparity that a file states, pixels per view; None if it does not.

    Raises:
        InputError: not two finite numbers, the lowest first.
    """
    if stated is None:
        return None
    given = stated.ravel()
    if given.size != 2 or given.dtype.kind not in "fiu" or not -math.inf < given[0] <= given[1] < math.inf:
        raise InputError(f"{where} is {given[:3].tolist()}, not two numbers, lowest first")
    return float(given[0]), float(given[1])


def weights_apart(values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.float32]]:
    """Split samples whose last channel is a weight (or alpha): the samples, as a view, and the weight, 0 to 1.

    Args:
        values: shape (…, channels), unsigned integers or floating point.
    """
    whole = np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1
    return values[..., :-1], values[..., -1].astype(np.float32) / np.float32(whole)


@dataclass(frozen=True, repr=False)
class ViewGrid(Brief):
    """A grid of views.

    Args:
        format: name of the format, for people.
        files: files[row][column], row 0 at the top, column 0 at the left; None for a missing view of a sparse
            grid.
        geometry: known geometry of the cameras.
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
        """The existing views by (row, column), row by row."""
        return {
            (row, column): file
            for row, line in enumerate(self.files)
            for column, file in enumerate(line)
            if file is not None
        }

    @property
    def missing(self) -> tuple[tuple[int, int], ...]:
        """(row, column) of the missing views."""
        rows, columns = self.shape
        present = self.present
        return tuple((r, c) for r in range(rows) for c in range(columns) if (r, c) not in present)


def pictures_in(folder: Path) -> list[Path]:
    """The picture files directly in a folder, sorted by name, without hidden files."""
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
    """Arrange files as files[row][column], with every place filled once.

    Rows and columns may be counted from any number and in any constant step (0, 1, 2 …; 9 … 17; 0, 2, 4 …).

    Args:
        places: the existing views.
        folder: name of the collection in messages.
        numbers: required row and column numbers, if the format states them.
        sparse: use None for missing views instead of raising.

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
    """From the lowest number to the highest, in the largest step that includes all."""
    low, high = min(numbers), max(numbers)
    step = math.gcd(*(number - low for number in numbers)) or 1
    return range(low, high + 1, step)


def length(numbers: range) -> int:
    """Number of elements, also beyond the maximum of `len`."""
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
        'light field needs all views: add the missing files, or pass missing="fill" to render them from the '
        "others "
        'by depth, or missing="dark". vcc.formats.open_sparse_views opens only those that are there'
    )
