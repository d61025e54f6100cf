"""Deflections that are not affine: changes of the slopes of rays by a thin element, by position.

A lens or a prism is an affine map (`vcc.Affine`). The classes here are affine only piecewise (arrays of
lenslets, a biprism) or not at all (a phase plate). Each is a function of the position (x, y) relative to the
element's middle and returns the slopes (Δs, Δt) that it adds.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.shapes.lattice import Lattice

Array = NDArray[np.float64]


class Deflection(abc.ABC):
    """Slopes (Δs, Δt) added to rays by position (x, y), metres from the element's middle."""

    @abc.abstractmethod
    def __call__(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(Δs, Δt) at positions x, y in metres (arrays that broadcast against each other)."""

    @abc.abstractmethod
    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """Bounds of (|Δs|, |Δt|) over the rectangle of these half sizes around the middle, metres."""

    @property
    def affine(self) -> Affine | None:
        """The same as a 5×5 map of rays, if its parameters make it affine (a biprism of 0); None otherwise."""
        return None


@dataclass(frozen=True, eq=False, repr=False)
class CellDeflection(Brief, Deflection):
    """A lattice of cells, each with its own lens and prism: Δs = −(x − x_cell)/f_cell + δs_cell.

    Cell (row, column) uses entry (row mod rows, column mod columns) of the tables.

    Args:
        lattice: the cells.
        powers: 1/f of the cells, 1/m, table (rows, columns); 0 for no lens.
        slopes: (δs, δt) of the cells, table (rows, columns, 2).
    """

    lattice: Lattice
    powers: Array
    slopes: Array

    def __post_init__(self) -> None:
        powers, slopes = np.asarray(self.powers, dtype=np.float64), np.asarray(self.slopes, dtype=np.float64)
        if powers.ndim != 2 or slopes.shape != (*powers.shape, 2) or powers.size == 0:
            raise InputError(
                "cells have tables of powers (rows, columns) and of slopes (rows, columns, 2), "
                f"not {powers.shape} and {slopes.shape}"
            )
        checks.all_finite("powers of cells", powers)
        checks.all_finite("slopes of cells", slopes)
        object.__setattr__(self, "powers", powers)
        object.__setattr__(self, "slopes", slopes)

    @property
    def affine(self) -> Affine | None:
        """A prism if no cell is a lens and all cells are the same prism."""
        return None if self.powers.any() else _one_prism(self.slopes.reshape(-1, 2))

    def __call__(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """The deflection by the cell at each place."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        row, column = self.lattice.cell_of(x, y)
        centre_x, centre_y = self.lattice.centre_of(row, column)
        rows, columns = self.powers.shape
        power = self.powers[row % rows, column % columns]
        slope = self.slopes[row % rows, column % columns]
        return slope[..., 0] - power * (x - centre_x), slope[..., 1] - power * (y - centre_y)

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The slopes at the corners of the steepest cells."""
        at_corners = np.abs(self.powers)[..., None] * np.array(self.lattice.reach) + np.abs(self.slopes)
        s, t = at_corners.reshape(-1, 2).max(axis=0)
        return float(s), float(t)


@dataclass(frozen=True, eq=False, repr=False)
class FacetDeflection(Brief, Deflection):
    """Plane facets that meet in the middle: each deflects the rays in the sector around its direction.

    Args:
        directions: unit vectors (x, y) of the sectors' middles, (n, 2); a place belongs to the direction
            with the largest projection.
        slopes: (δs, δt) that each sector adds, (n, 2).
    """

    directions: Array
    slopes: Array

    def __post_init__(self) -> None:
        for name in ("directions", "slopes"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.float64).reshape(-1, 2))
        if len(self.directions) != len(self.slopes) or len(self.directions) < 1:
            raise InputError("facets have as many directions as slopes, at least one")

    @property
    def affine(self) -> Affine | None:
        """A prism if all facets are equal."""
        return _one_prism(self.slopes)

    def __call__(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """The slopes of the facet at each place."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        outward = x[..., None] * self.directions[:, 0] + y[..., None] * self.directions[:, 1]
        slope = self.slopes[np.argmax(outward, axis=-1)]
        return slope[..., 0], slope[..., 1]

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The largest slopes among the facets."""
        s, t = np.abs(self.slopes).max(axis=0)
        return float(s), float(t)


@dataclass(frozen=True, eq=False)
class SlopeFunction(Deflection):
    """A deflection from any smooth function of position.

    Args:
        function: called with x and y in metres (arrays that broadcast); returns the slopes (Δs, Δt).
    """

    function: Callable[[Array, Array], Any]

    def __call__(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """The function's values, validated."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        # Full arrays: functions such as (−x/f, −y/f) then return slopes of one shape.
        x, y = np.broadcast_arrays(x, y)
        return checked_slopes(self.function(x, y), x, y, (x.shape, ()))

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The largest slopes on a raster of 257×257 points over the rectangle, plus 5 %."""
        x, y = np.linspace(-half_width, half_width, 257), np.linspace(-half_height, half_height, 257)
        s, t = self(x[None, :], y[:, None])
        return 1.05 * float(np.abs(s).max()), 1.05 * float(np.abs(t).max())


def _one_prism(slopes: Array) -> Affine | None:
    """The prism with slopes (δs, δt) if all rows of (n, 2) are equal; else None."""
    return Affine.prism((float(slopes[0, 0]), float(slopes[0, 1]))) if (slopes == slopes[0]).all() else None


def checked_slopes(
    returned: Any, x: Array, y: Array, shapes: tuple[tuple[int, ...], ...] | None = None
) -> tuple[Array, Array]:
    """The values of a function at positions x, y as two full arrays (Δs, Δt).

    Args:
        returned: by the function.
        x: positions, metres, that broadcast against y.
        y: likewise.
        shapes: allowed shapes of the two; None allows all that broadcast to the shape of the positions.

    Raises:
        InputError: not two arrays, of another shape, or with numbers that are not finite.
    """
    shape = np.broadcast_shapes(x.shape, y.shape)
    checks.plain("what the deflection returned", returned)
    try:
        s, t = returned
    except (TypeError, ValueError):
        raise InputError(
            f"the deflection must return two arrays, the slopes (Δs, Δt), not {_in_words(returned)}"
        ) from None
    s, t = (np.asarray(slope, dtype=np.float64) for slope in (s, t))
    for slope in (s, t):
        if not (_broadcasts(slope.shape, shape) if shapes is None else slope.shape in shapes):
            raise InputError(f"the deflection returned shape {slope.shape} for positions of shape {shape}")
        if not np.isfinite(slope).all():
            bad = np.argwhere(~np.isfinite(np.broadcast_to(slope, shape)))[0]
            where = tuple(float(np.broadcast_to(place, shape)[tuple(bad)]) for place in (x, y))
            raise InputError(
                f"the deflection returned a number that is not finite at (x, y) = "
                f"({where[0] * 1e3:g}, {where[1] * 1e3:g}) mm"
            )
    return np.broadcast_to(s, shape), np.broadcast_to(t, shape)


def _broadcasts(given: tuple[int, ...], shape: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(given, shape) == shape
    except ValueError:
        return False


def _in_words(returned: Any) -> str:
    shape = getattr(returned, "shape", None)
    return type(returned).__name__ if shape is None else f"an array of shape {tuple(shape)}"


def as_deflection(given: Any) -> Deflection:
    """A deflection from a deflection or from any function of (x, y) in metres that returns (Δs, Δt).

    Raises:
        InputError: an object of another type.
    """
    if isinstance(given, Deflection):
        return given
    if callable(given):
        return SlopeFunction(given)
    raise InputError(
        f"a deflection is an Affine, a vcc.optics.Deflection or a function of (x, y), not {type(given).__name__}"
    )
