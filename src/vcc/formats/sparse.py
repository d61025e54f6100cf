"""Views of an incomplete grid, and light fields from them: of a complete part, or with missing views filled."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress, part_of, tell
from vcc.base.words import first_few
from vcc.fields.disparity import Disparities
from vcc.fields.filling import Missing, filling_of
from vcc.fields.grid import Grid, Sample
from vcc.fields.sampled import as_slice
from vcc.light_field import LightField
from vcc.run.scattered_views import ScatteredViews


@dataclass(frozen=True, eq=False, repr=False)
class SparseViews(Brief):
    """Some views of a grid, each at its place.

    ``views[4, :]`` is the light field of a complete row, ``views[2:5, 3:6]`` that of a part; a part with
    missing views raises an error that lists them. `light_field` is that of the whole grid.

    Args:
        pictures: samples of the existing views, shape (n, t, s) or (n, t, s, channels), as in a `vcc.LightField`.
        places: (row, column) of each, row 0 at the top, column 0 at the left.
        shape: (rows, columns) of the whole grid.
        frame: the 5×5 frame of the whole grid's light field.
        disparity_range: (lowest, highest), pixels per view, if known.
        sample: see `vcc.LightField`.
        wavelengths: of the channels, see `vcc.LightField`.

    Raises:
        InputError: places that do not match the pictures or the grid.
    """

    pictures: NDArray[Any]
    places: tuple[tuple[int, int], ...]
    shape: tuple[int, int]
    frame: Affine
    disparity_range: tuple[float, float] | None = None
    sample: Sample = "mean"
    wavelengths: tuple[float, ...] | None = None

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
        number = self._numbers
        missing = [(row, column) for row in rows for column in columns if (row, column) not in number]
        if missing or not rows or not columns:
            named = first_few(missing, len(missing))
            raise InputError(
                f"this part of the grid has no light field: its views {named} are missing"
                if missing
                else f"there is no view in this part of a grid of {self.shape[0]}×{self.shape[1]}"
            )
        grid, _ = self._grid.piece((as_slice(rows), as_slice(columns)))
        chosen = [number[row, column] for row in rows for column in columns]
        values = self.pictures[chosen].reshape(len(rows), len(columns), *self.pictures.shape[1:])
        return LightField(values, grid.frame, grid.disparity_range, self.sample, wavelengths=self.wavelengths)

    def light_field(
        self, missing: Missing = "fill", *, memory_limit: int | None = None, progress: Progress | None = None
    ) -> LightField:
        """The light field of the whole grid; ``given`` and ``filling`` report which views were not recorded.

        Args:
            missing: "fill" renders missing views from the others. Disparities are found for up to three views by
                plane sweeps (docs/depth.md), and a view takes each pixel from the nearest view that shows it.
                The error is estimated by rendering recorded views from the others in the same way (up to 40 of
                them); missing views that are farther from the nearest recorded one have proportionally larger
                errors. "dark" leaves missing views without light; "refuse" raises an error.
            memory_limit: bytes for costs and temporary arrays; None uses `vcc.base.memory.MEMORY_LIMIT`.
            progress: called with (done, total).

        Raises:
            InputError: views are missing and are to be refused; fewer than one view in 64; a single view, or
                views without texture, to be filled; not enough memory.
        """
        checks.one_of("missing", missing, get_args(Missing))
        absent, given = self.missing, self.present
        if absent and missing == "refuse":
            raise InputError(f"views are missing: {first_few(absent, len(absent))}")
        if math.prod(self.shape) > _MOST_PLACES * len(self.places):
            raise InputError(
                f"{len(self.places)} views are too few for a grid of {self.shape[0]}×{self.shape[1]}: more "
                f"than one in {_MOST_PLACES} is needed. Is a row or column number wrong?"
            )
        values = np.zeros(self._grid.shape, self.pictures.dtype)
        for place, picture in zip(self.places, self.pictures, strict=True):
            values[place] = picture
        if not absent:
            return LightField.of(values, self._grid)
        if missing == "dark":
            shown = Disparities(find=lambda told: self._scattered(memory_limit).find_disparities(progress=told))
            if len(self.places) > 1:
                shown = Disparities(find=shown.maps, measure=lambda: shown.maps().extent)
            return LightField.of(
                values, replace(self._grid, disparities=shown, filling=filling_of(given, np.nan, 1))
            )
        scattered = self._scattered(memory_limit)
        maps = scattered.find_disparities(progress=part_of(progress, 0, 3))
        tested = scattered.errors(part_of(progress, 1, 3))
        scale, unseen = self._grid.full_scale, []
        for done, place in enumerate(absent):
            made, held = scattered.view_at(place)
            made = made.reshape(self.pictures.shape[1:])
            values[place] = np.rint(np.clip(made, 0, 1) * scale) if values.dtype.kind == "u" else made
            unseen.append(1 - float(held.mean()))
            tell(part_of(progress, 2, 3), done + 1, len(absent))
        filling = filling_of(given, scattered.expected_error(absent, *tested), unseen)
        return LightField.of(values, replace(self._grid, disparities=Disparities(maps), filling=filling))

    def _scattered(self, memory_limit: int | None) -> ScatteredViews:
        order = sorted(range(len(self.places)), key=self.places.__getitem__)  # not as the files happen to be named
        pictures = (self.pictures[order] / np.float32(self._grid.full_scale)).astype(np.float32, copy=False)
        pictures = pictures.reshape(*pictures.shape[:3], -1)
        places = np.array(self.places, float)[order]
        return ScatteredViews(pictures, places, self._grid, memory_limit=memory_limit)

    @property
    def _grid(self) -> Grid:
        shape, kind = (*self.shape, *self.pictures.shape[1:]), self.pictures.dtype
        return Grid(shape, self.frame, kind, self.sample, self.disparity_range, wavelengths=self.wavelengths)

    @property
    def _numbers(self) -> dict[tuple[int, int], int]:
        return {place: n for n, place in enumerate(self.places)}

    def around_a_view(self) -> tuple[LightField, int] | None:
        """3×3 views around the most central view whose neighbours above, below and beside exist, and their step.

        Other views of the 3×3 are dark. None if there is no such view.
        """
        number = self._numbers
        middle = np.subtract(self.shape, 1) / 2
        for step in range(1, max(self.shape)):
            for row, column in sorted(number, key=lambda place: float(np.abs(place - middle).sum())):
                cross = {(row + j * step, column + i * step): (1 + j, 1 + i) for j, i in _CROSS}
                if all(place in number for place in cross):
                    values = np.zeros((3, 3, *self.pictures.shape[1:]), self.pictures.dtype)
                    for place, where in cross.items():
                        values[where] = self.pictures[number[place]]
                    return LightField(values, self.frame @ Affine.scaling(step, step, 1, 1)), step
        return None


_MOST_PLACES = 64  # places of a grid for one view that exists
_CROSS = ((-1, 0), (0, -1), (0, 0), (0, 1), (1, 0))


def _places(wanted: int | slice, size: int) -> range:
    if isinstance(wanted, slice):
        return range(size)[wanted]
    if not -size <= wanted < size:
        raise InputError(f"there is no row or column {wanted} of views in {size}")
    return range(size)[wanted % size : wanted % size + 1]
