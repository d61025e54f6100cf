"""Surfaces defined on a sheet: measured, computed, or random rough ones, with a spline between their points."""

from __future__ import annotations

import abc
import math
from dataclasses import dataclass, field, fields
from numbers import Real
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.describe import kind_in_words
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.shapes.patterns import is_grid
from vcc.shapes.surface import Array, Surface

POINTS_PER_CORRELATION_LENGTH = 4
"""Points of a rough surface. Its spectrum exp(−π²f²l²) is 1e-17 at the highest frequency that they resolve."""
LARGEST_GRID = 4097
"""Points a side of a rough surface, on its sheet: 128 MiB of float64, and seconds to compute."""


class Sheet(Surface):
    """A surface defined on a grid of points of a sheet, with a spline between them, and flat outside.

    The interpolant is the bicubic spline through the points, so that slopes and their derivatives are
    continuous. It is computed on first use.
    """

    width: float
    height: float | None

    @abc.abstractmethod
    def _samples(self) -> tuple[Array, Array, Array]:
        """(y, x, OPL) in metres: rows, columns, and the path at each, (rows, columns)."""

    @property
    @abc.abstractmethod
    def size(self) -> tuple[float, float]:
        """(width, height) of the sheet, metres."""

    @property
    @cached
    def _spline(self) -> Any:
        from scipy.interpolate import RectBivariateSpline

        y, x, path = self._samples()
        half_width, half_height = self.size[0] / 2, self.size[1] / 2
        # Points may lie outside the sheet, or end half a cell inside it; the spline covers both.
        bounds = [
            min(-half_height, y[0]),
            max(half_height, y[-1]),
            min(-half_width, x[0]),
            max(half_width, x[-1]),
        ]
        return RectBivariateSpline(y, x, path, bbox=bounds, kx=3, ky=3, s=0)

    @property
    @cached
    def _gradient(self) -> tuple[Any, Any]:
        """Splines of (∂OPL/∂x, ∂OPL/∂y)."""
        return self._spline.partial_derivative(0, 1), self._spline.partial_derivative(1, 0)

    @property
    def affine(self) -> Affine | None:
        """The identity if the sheet is flat."""
        return Affine.identity() if self._flat else None

    @property
    @cached
    def _flat(self) -> bool:
        return not np.ptp(self._samples()[2])

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The spline on the sheet, metres; 0 beyond it."""
        return self._on_sheet(self._spline, x, y)

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """The spline's gradient on the sheet; 0 beyond it."""
        along_x, along_y = self._gradient
        return self._on_sheet(along_x, x, y), self._on_sheet(along_y, x, y)

    def _on_sheet(self, spline: Any, x: ArrayLike, y: ArrayLike) -> Array:
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        # A millionth larger, so that a place on the edge is on the sheet despite rounding
        inside = (np.abs(x) <= self.size[0] * 0.500001) & (np.abs(y) <= self.size[1] * 0.500001)
        if is_grid(x, y) and (np.diff(x[0]) > 0).all() and (np.diff(y[:, 0]) > 0).all():
            # The spline is a product along both axes: 50 times as fast as separate places
            return np.where(inside, spline(y[:, 0], x[0], grid=True), 0.0)
        x, y = np.broadcast_arrays(x, y)
        values = np.zeros(x.shape)
        values[inside] = spline(y[inside], x[inside], grid=False)
        return values

    def slopes_back(self, x: Array, y: Array, weights: tuple[Array, Array]) -> Array:
        """See `Surface`; for the given optical paths."""
        known_y, known_x, _ = self._samples()
        knots_y, knots_x, _ = self._spline.tck
        on_sheet = (np.abs(x) <= self.size[0] * 0.500001) & (np.abs(y) <= self.size[1] * 0.500001)
        along_x, along_y = (np.where(on_sheet, each, 0.0) for each in weights)
        total = _basis(knots_y, y, 0).T @ along_x @ _basis(knots_x, x, 1)
        total += _basis(knots_y, y, 1).T @ along_y @ _basis(knots_x, x, 0)
        # The coefficients are such that the spline passes through the given points.
        down = np.linalg.solve(_basis(knots_y, known_y, 0).T, total)
        return np.asarray(np.linalg.solve(_basis(knots_x, known_x, 0).T, down.T).T)

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The largest coefficients of the slopes' splines in the rectangle, which bound the splines.

        (The convex hull property of B-splines; de Boor, A Practical Guide to Splines.)
        """
        along_x, along_y = self._gradient
        return _coefficient_bound(along_x, half_width, half_height), _coefficient_bound(
            along_y, half_width, half_height
        )


def _basis(knots: Array, places: Array, derivative: int) -> Array:
    """The cubic B-splines on knots, or their derivative, at places: (places, splines)."""
    from scipy.interpolate import BSpline

    splines = BSpline(knots, np.eye(len(knots) - 4), 3)
    return np.asarray(splines(places.reshape(-1), nu=derivative))


def _coefficient_bound(spline: Any, half_width: float, half_height: float) -> float:
    knots_y, knots_x, coefficients = spline.tck
    degree_y, degree_x = spline.degrees
    near_y = (knots_y[degree_y + 1 :] >= -half_height) & (knots_y[: -degree_y - 1] <= half_height)
    near_x = (knots_x[degree_x + 1 :] >= -half_width) & (knots_x[: -degree_x - 1] <= half_width)
    table = coefficients[: len(near_y) * len(near_x)].reshape(len(near_y), len(near_x))
    return float(np.abs(table[np.ix_(near_y, near_x)]).max())


class _Table(Sheet):
    """A surface with values at the middles of square or rectangular cells that fill its sheet."""

    linear_in: ClassVar[str]

    @property
    def _cells(self) -> Array:
        """The value of each cell, (rows, columns)."""
        return np.asarray(getattr(self, self.linear_in))

    @property
    def factor(self) -> float:
        """The optical path per unit of the values."""
        return 1.0

    def slopes_back(self, x: Array, y: Array, weights: tuple[Array, Array]) -> Array:
        """See `Surface`."""
        return self.factor * super().slopes_back(x, y, weights)

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) of the sheet, metres."""
        rows, columns = self._cells.shape
        return self.width, self.width * rows / columns if self.height is None else self.height

    def _samples(self) -> tuple[Array, Array, Array]:
        y, x = (
            ((np.arange(cells) + 0.5) / cells - 0.5) * length
            for cells, length in zip(self._cells.shape, self.size[::-1], strict=True)
        )
        return y, x, self.factor * self._cells

    def compared(self) -> tuple[Any, ...]:
        """Properties to compare: the size, because a missing height makes the cells square."""
        return self._cells, self.size, self.factor

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and (
            np.array_equal(self._cells, other._cells) and self.compared()[1:] == other.compared()[1:]
        )

    def __hash__(self) -> int:
        return hash((self._cells.tobytes(), self.size, self.factor))

    @property
    def _in_words(self) -> str:
        rows, columns = self._cells.shape
        width, height = self.size
        return f"{rows}×{columns} points, {short(width)} × {short(height)}"

    def described(self) -> str:
        """The number of points and the size of the sheet as text."""
        return f"{kind_in_words(type(self))} ({self._in_words})"

    def __repr__(self) -> str:
        rows, columns = self._cells.shape
        numbers = ", ".join(f"{each.name}={getattr(self, each.name)!r}" for each in fields(self)[1:])  # type: ignore[arg-type]
        return f"{type(self).__name__}({rows}×{columns}, {numbers})"


@dataclass(frozen=True, eq=False, repr=False)
class HeightMap(_Table):
    """Glass of measured or designed height h: OPL = (n − 1)·h, sampled on a grid.

    The sheet is ``width`` wide and bounds a plate made of it; values are at the middles of its cells.

    Args:
        heights: thickness of the glass, metres, (rows, columns), row 0 at the top; 4×4 or more.
        width: of the whole sheet, metres.
        height: of the whole sheet, metres; None makes the cells square.
        refractive_index: n of the glass, more than 1.

    Raises:
        InputError: not a table of 4×4 or more finite numbers, a size of zero or less, or no glass (n ≤ 1).
    """

    linear_in: ClassVar[str] = "heights"

    heights: NDArray[np.float64]
    width: float = field(metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})
    refractive_index: float = 1.5

    def __post_init__(self) -> None:
        object.__setattr__(self, "heights", _table("heights of a height map", self.heights))
        checks.sizes("a height map", width=self.width, height=self.height)
        _check_glass("a height map", self.refractive_index)

    @property
    def factor(self) -> float:
        """The optical path for 1 metre of glass: n − 1."""
        return self.refractive_index - 1

    def described(self) -> str:
        """The number of points, the size of the sheet and the glass as text."""
        return f"height map ({self._in_words}, refractive index {self.refractive_index:g})"


@dataclass(frozen=True, eq=False, repr=False)
class PathMap(_Table):
    """Optical path lengths sampled on a grid, from another program or a wavefront measurement.

    The sheet is ``width`` wide and bounds a plate made of it; values are at the middles of its cells.

    Args:
        paths: optical path lengths, metres, (rows, columns), row 0 at the top; 4×4 or more.
        width: of the whole sheet, metres.
        height: of the whole sheet, metres; None makes the cells square.

    Raises:
        InputError: not a table of 4×4 or more finite numbers, or a size of zero or less.
    """

    linear_in: ClassVar[str] = "paths"

    paths: NDArray[np.float64]
    width: float = field(metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        object.__setattr__(self, "paths", _table("paths of a path map", self.paths))
        checks.sizes("a path map", width=self.width, height=self.height)


@dataclass(frozen=True)
class Rough(Sheet):
    """A random surface of ground glass: Gaussian heights of correlation C(r) = σ²·exp(−r²/l²).

    Its slopes are Gaussian too, with the variance (n − 1)²·2σ²/l² along each axis, which is −(n − 1)²·∂²C/∂x² at 0
    (Papoulis, Probability, Random Variables and Stochastic Processes, on derivatives of stationary processes).
    It is computed on first use: white noise from NumPy's generator, filtered by exp(−2r²/l²), which produces this
    correlation. The same parameters and seed give the same surface.

    Args:
        height_rms: σ, root mean square of the heights, metres.
        correlation_length: l, distance at which the correlation has fallen to 1/e, metres.
        width: of the sheet, metres; it bounds a plate made of it.
        height: of the sheet, metres; None makes it square.
        refractive_index: n of the glass, more than 1.
        seed: of the random numbers, an integer of 0 or more.

    Raises:
        InputError: lengths of zero or less (σ may be 0), no glass (n ≤ 1), an invalid seed, or a
            sheet so much larger than the correlation length that its grid would be too large.
    """

    height_rms: float = field(metadata={"unit": "length"})
    correlation_length: float = field(metadata={"unit": "length"})
    width: float = field(metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})
    refractive_index: float = 1.5
    seed: int = 0

    def __post_init__(self) -> None:
        checks.zero_or_more("height_rms of a rough surface", self.height_rms, unit="m")
        checks.above_zero("correlation_length of a rough surface", self.correlation_length, unit="m")
        checks.sizes("a rough surface", width=self.width, height=self.height)
        _check_glass("a rough surface", self.refractive_index)
        object.__setattr__(self, "seed", checks.seed(self.seed, "seed of a rough surface"))
        rows, columns = (points - 2 * _MARGIN for points in self.grid)
        if max(rows, columns) > LARGEST_GRID:
            room = (LARGEST_GRID - 1) * self._step
            raise InputError(
                f"a rough surface of correlation length {short(self.correlation_length)} on a sheet of "
                f"{short(self.size[0])} × {short(self.size[1])} takes a grid of {columns}×{rows} points, more "
                f"than {LARGEST_GRID} a side: make the sheet at most {short(room, digits=4)} wide and high, or "
                "use a Diffuser, which scatters without a grid"
            )

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) of the sheet, metres."""
        return self.width, self.width if self.height is None else self.height

    @property
    def grid(self) -> tuple[int, int]:
        """(rows, columns) of points at which the surface is computed, with 16 points beyond each edge."""
        # A millionth of a step less: a sheet of an integer number of steps does not get one more step by rounding
        rows, columns = (
            2 * (math.ceil(length / (2 * self._step) - 1e-6) + _MARGIN) + 1 for length in self.size[::-1]
        )
        return rows, columns

    @property
    def _step(self) -> float:
        return self.correlation_length / POINTS_PER_CORRELATION_LENGTH

    @property
    def slope_rms(self) -> float:
        """Root mean square of Δs, and of Δt, over the ensemble of surfaces: (n − 1)·√2·σ/l."""
        return (self.refractive_index - 1) * math.sqrt(2) * self.height_rms / self.correlation_length

    @property
    def affine(self) -> Affine | None:
        """The identity if the glass is smooth."""
        return Affine.identity() if self.height_rms == 0 else None

    def _samples(self) -> tuple[Array, Array, Array]:
        from scipy.ndimage import convolve1d

        # exp(−2·3²) = 1.5e-8: contributions from beyond 3 l are invisible in float32
        reach = 3 * POINTS_PER_CORRELATION_LENGTH
        kernel = np.exp(-2 * (np.arange(-reach, reach + 1) / POINTS_PER_CORRELATION_LENGTH) ** 2)
        kernel /= np.sqrt(np.sum(kernel**2))  # so that noise keeps variance 1
        rows, columns = self.grid
        heights = _noise(self.seed, rows // 2 + reach, columns // 2 + reach)
        # Only points with the whole kernel inside the noise are kept: no edge effects, no wrapping around.
        heights = convolve1d(heights, kernel, axis=0)[reach:-reach]
        heights = convolve1d(heights, kernel, axis=1)[:, reach:-reach]
        y, x = (
            np.asarray((np.arange(points) - (points - 1) / 2) * self._step, dtype=np.float64)
            for points in (rows, columns)
        )
        return y, x, np.asarray((self.refractive_index - 1) * self.height_rms * heights)


_MARGIN = 16
"""Points of a rough surface beyond each edge of its sheet. End effects of a spline decay by 0.27 from point
to point: on the sheet, 1e-9 remains, so that one point more or less is invisible."""


def _noise(seed: int, rows: int, columns: int) -> Array:
    """Normal numbers of variance 1 at places −rows … rows, −columns … columns; larger tables contain smaller ones.

    So a surface does not change if its sheet becomes larger or its grid finer, and its sizes can be learned.
    """
    table = np.empty((2 * rows + 1, 2 * columns + 1))
    for row in range(-rows, rows + 1):
        place = 2 * abs(row) + (row < 0)
        left, right = np.random.default_rng((seed, place)).standard_normal((columns + 1, 2)).T
        table[row + rows] = np.concatenate([left[:0:-1], right])
    return table


def _table(what: str, given: Any) -> Array:
    needed = "a table of 4×4 numbers of metres or more, (rows, columns) (a cubic spline needs 4)"
    return checks.array(what, given, needed, None, None, least=4)


def _check_glass(what: str, refractive_index: Any) -> None:
    checks.plain(f"refractive_index of {what}", refractive_index)
    if not (isinstance(refractive_index, Real) and 1 < refractive_index < math.inf):  # type: ignore[operator]
        raise InputError(
            f"refractive_index of {what} is {refractive_index}: a surface with no glass bends "
            "nothing; glass has more than 1, such as 1.5"
        )
