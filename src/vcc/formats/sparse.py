"""Views of an incomplete grid: not a light field; missing views are not filled in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.words import first_few
from vcc.fields.grid import Grid, Sample
from vcc.fields.sampled import as_slice
from vcc.light_field import LightField


@dataclass(frozen=True, eq=False, repr=False)
class SparseViews(Brief):
    """Some views of a grid, each at its place.

    ``views[4, :]`` is the light field of a complete row, ``views[2:5, 3:6]`` that of a part; a part with
    missing views raises an error that lists them.

    Args:
        pictures: samples of the existing views, shape (n, t, s) or (n, t, s, channels), as in a `vcc.LightField`.
        places: (row, column) of each, row 0 at the top, column 0 at the left.
        shape: (rows, columns) of the whole grid.
        frame: the 5×5 frame of the whole grid's light field.
        disparity_range: (lowest, highest), pixels per view, if known.
        sample: see `vcc.LightField`.

    Raises:
        InputError: places that do not match the pictures or the grid.
    """

    pictures: NDArray[Any]
    places: tuple[tuple[int, int], ...]
    shape: tuple[int, int]
    frame: Affine
    disparity_range: tuple[float, float] | None = None
    sample: Sample = "mean"

    def __post_init__(self) -> None:
        if len(self.places) != len(self.pictures) or len(set(self.places)) != len(self.places):
            raise InputError(
                f"{len(self.pictures)} pictures need as many different places, not {len(self.places)}"
            )
        for row, column in self.places:
            if not (0 <= row < self.shape[0] and 0 <= column < self.shape[1]):
                raise InputError(
                    f"the place {(row, column)} is outside a grid of {self.shape[0]}×{self.shape[1]} views"
                )

    @property
    def present(self) -> NDArray[np.bool_]:
        """Which views exist, shape (rows, columns)."""
        there = np.zeros(self.shape, dtype=np.bool_)
        for place in self.places:
            there[place] = True
        return there

    @property
    def missing(self) -> tuple[tuple[int, int], ...]:
        """(row, column) of the missing views."""
        return tuple((int(row), int(column)) for row, column in np.argwhere(~self.present))

    def __getitem__(self, part: tuple[int | slice, int | slice]) -> LightField:
        """The light field of a complete part of the grid, at its position.

        Args:
            part: (rows, columns), each a number or a slice.

        Raises:
            InputError: a view of the part is missing, or the part is empty.
        """
        rows, columns = (_places(wanted, size) for wanted, size in zip(part, self.shape, strict=True))
        number = {place: n for n, place in enumerate(self.places)}
        missing = [(row, column) for row in rows for column in columns if (row, column) not in number]
        if missing or not rows or not columns:
            named = first_few(missing, len(missing))
            raise InputError(
                f"this part of the grid has no light field: its views {named} are missing"
                if missing
                else f"there is no view in this part of a grid of {self.shape[0]}×{self.shape[1]}"
            )
        picture = self.pictures.shape[1:]
        whole = Grid((*self.shape, *picture), self.frame, self.pictures.dtype, self.sample, self.disparity_range)
        grid, _ = whole.piece((as_slice(rows), as_slice(columns)))
        chosen = [number[row, column] for row in rows for column in columns]
        values = self.pictures[chosen].reshape(len(rows), len(columns), *picture)
        return LightField(values, grid.frame, grid.disparity_range, self.sample)


def _places(wanted: int | slice, size: int) -> range:
    if isinstance(wanted, slice):
        return range(size)[wanted]
    if not -size <= wanted < size:
        raise InputError(f"there is no row or column {wanted} of views in {size}")
    return range(size)[wanted % size : wanted % size + 1]
