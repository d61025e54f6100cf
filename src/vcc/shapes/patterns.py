"""Transmission patterns: the transmission of a mask as a function of position.

A pattern is called with positions (x, y) in metres relative to its own middle (x right, y down) and returns the
transmitted share, 0 to 1. Light fields are sampled in cells, so a camera needs a pattern's *mean*
over a rectangle, never its value at a point: patterns with a closed form compute it exactly, the others
with a fine raster. `as_pattern` converts any function of (x, y) to a pattern.
"""

from __future__ import annotations

import abc
import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.describe import instead_of_name, kind_in_words, parameters_in_words, with_parameters
from vcc.base.errors import InputError
from vcc.base.lookup import bilinear
from vcc.base.showing import Shown
from vcc.base.units import text
from vcc.base.values import Value

Array = NDArray[np.float64]

RASTER_PER_CELL = 16
"""Raster points across a rectangle for patterns without a closed form: edges are accurate to 1/16² of it."""
FEWEST_PER_CELL = 4
"""Smallest number of raster points across a rectangle, for many rectangles side by side."""
RASTER_LIMIT = 4096
"""Largest square raster, points a side: 128 MiB of float64 while a plan is being made."""
LONGEST_RASTER = 4 * RASTER_LIMIT
"""Points along the longer side of a raster that is not square."""


class Pattern(Shown, abc.ABC):
    """Transmission of a flat element, by position. Final classes are frozen dataclasses of SI numbers."""

    @abc.abstractmethod
    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Transmission, 0 to 1, at positions x, y in metres (arrays that broadcast against each other)."""

    def described(self) -> str:
        """The pattern as text, such as ``"circle (diameter 3 mm)"``."""
        return with_parameters(kind_in_words(type(self)), parameters_in_words(self))

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) in metres outside which nothing passes; infinite if there is no such bound."""
        return math.inf, math.inf

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """Mean transmission over rectangles centred at x, y (metres, broadcast against each other).

        Args:
            x: centres, metres.
            y: centres, metres.
            width: of every rectangle, metres.
            height: of every rectangle, metres.
        """
        found = mean_by_raster(lambda a, b, _: self(a, b), self.size, x, y, width, height, FEWEST_PER_CELL)
        return (
            self.mean_of_points(np.asarray(x, float), np.asarray(y, float), width, height)
            if found is None
            else found
        )

    def mean_of_points(self, x: Array, y: Array, width: float, height: float) -> Array:
        """The mean of 4×4 points of each rectangle; arguments as for `mean`."""
        steps = (np.arange(4) + 0.5) / 4 - 0.5
        points = [self(x + a * width, y + b * height) for a in steps for b in steps]
        return np.asarray(np.mean(np.broadcast_arrays(*points), axis=0))


def mean_by_raster(
    values: Callable[[Array, Array, tuple[float, float]], ArrayLike],
    size: tuple[float, float],
    x: ArrayLike,
    y: ArrayLike,
    width: float,
    height: float,
    fewest: int,
) -> Array | None:
    """Means over rectangles by a raster whose points do not depend on the rectangles.

    Args:
        values: function of raster points (x, y) and, as third argument, their size (x, y), metres.
        size: (width, height) around the origin outside which nothing passes, metres.
        x: centres of the rectangles, metres.
        y: likewise.
        width: of every rectangle, metres.
        height: of every rectangle, metres.
        fewest: smallest number of points across a rectangle, if `RASTER_PER_CELL` would be too many.

    Returns:
        The means; None if even the fewest points across each rectangle are too many.
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    across, down = (
        raster(centre, length, bound, fewest)
        for centre, length, bound in ((x, width, size[0]), (y, height, size[1]))
    )
    if across is None or down is None or across.places.size * down.places.size > RASTER_LIMIT**2:
        return None
    return mean_over(across, down, values, x, y, width, height)


class Raster(NamedTuple):
    """Points along an axis, in the middles of equal steps from low to high, metres."""

    places: Array
    low: float
    high: float

    @property
    def length(self) -> float:
        """Of all steps, metres."""
        return self.high - self.low

    @property
    def step(self) -> float:
        """Metres."""
        return self.length / self.places.size


def raster(centre: Array, length: float, bound: float, fewest: int) -> Raster | None:
    """The points of `mean_by_raster` along an axis; None if even the fewest are too many."""
    low = max(float(centre.min()) - length / 2, -bound / 2)
    high = max(min(float(centre.max()) + length / 2, bound / 2), low)
    across = RASTER_PER_CELL
    # By the pattern's own size if it has one, so that pieces of a light field use the same raster.
    extent = bound if math.isfinite(bound) else high - low
    while across > fewest and length > 0 and extent / length * across > RASTER_LIMIT:
        across //= 2
    return points_between(low, high, length / across)


def points_between(low: float, high: float, step: float) -> Raster | None:
    """The points at odd multiples of half a step that cover a range, metres; None if they are too many."""
    if step <= 0 or (high - low) / step > LONGEST_RASTER:
        return None
    first, last = math.floor(low / step), max(math.ceil(high / step), math.floor(low / step) + 1)
    return Raster(np.asarray((np.arange(first, last) + 0.5) * step), first * step, last * step)


def mean_over(
    across: Raster,
    down: Raster,
    values: Callable[[Array, Array, tuple[float, float]], ArrayLike],
    x: Array,
    y: Array,
    width: float,
    height: float,
) -> Array:
    """Means over rectangles of values at the points of a raster; arguments as for `mean_by_raster`."""
    found = np.asarray(values(across.places[None, :], down.places[:, None], (across.step, down.step)), float)
    cells = np.broadcast_to(found, (down.places.size, across.places.size))
    middle = (across.low + across.high) / 2, (down.low + down.high) / 2
    return Cells(cells, across.length, down.length, middle).mean(x, y, width, height)


def _share_by_integral(
    hole: Circle | Polygon, x: Array, y: Array, width: float, height: float, inner: float
) -> Array:
    """The share of rectangles that lies inside a hole around the origin.

    The rim cuts few of many rectangles: areas are computed only for these.

    Args:
        hole: with a known area.
        x: centres, metres.
        y: centres, metres, of the same shape.
        width: of every rectangle, metres.
        height: of every rectangle, metres.
        inner: radius of a circle within the hole, metres.
    """
    across, down = np.abs(x), np.abs(y)
    nearest = np.maximum(across - width / 2, 0) ** 2 + np.maximum(down - height / 2, 0) ** 2
    inside = (across + width / 2) ** 2 + (down + height / 2) ** 2 <= inner**2
    cut = ~inside & (nearest < hole.diameter**2 / 4)
    share = np.array(inside, dtype=np.float64)
    share[cut] = _mean_from_integral(hole._integral, x[cut], y[cut], width, height)
    return share


def _mean_from_integral(
    integral: Callable[[Array, Array], Array], x: Array, y: Array, width: float, height: float
) -> Array:
    """The mean over rectangles of a function whose integral over (−∞, x] × (−∞, y] is known."""
    right, left, bottom, top = x + width / 2, x - width / 2, y + height / 2, y - height / 2
    content = integral(right, bottom) - integral(left, bottom) - integral(right, top) + integral(left, top)
    # Transmission is a share: differences of integrals must not leave its range by rounding.
    return np.clip(content / (width * height), 0.0, None)


@dataclass(frozen=True)
class Open(Pattern):
    """Transmits all light."""

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """One everywhere."""
        return np.ones(np.broadcast_shapes(np.shape(x), np.shape(y)))

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """One everywhere."""
        return self(x, y)


@dataclass(frozen=True)
class Circle(Pattern):
    """A round hole.

    Args:
        diameter: metres.
    """

    diameter: float = field(metadata={"unit": "length"})

    def __post_init__(self) -> None:
        checks.above_zero("diameter of circle", self.diameter, unit="m")

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) of the hole, metres."""
        return self.diameter, self.diameter

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """One inside the circle, zero outside."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        return np.asarray(x * x + y * y <= self.diameter**2 / 4, dtype=np.float64)

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """The share of each rectangle that lies inside the circle, in closed form."""
        floor = self.diameter * 1e-5
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        return _share_by_integral(self, x, y, max(width, floor), max(height, floor), self.diameter / 2)

    def _integral(self, x: Array, y: Array) -> Array:
        """Area of the circle left of x and above y."""
        radius = self.diameter / 2
        x, y = np.clip(x, -radius, radius), np.clip(y, -radius, radius)
        reach = np.sqrt(np.maximum(radius**2 - y * y, 0))  # |x| below which the line at y runs inside the circle

        area_below_arc = self._below_arc
        inner = np.clip(x, -reach, reach)
        cut = y * (inner + reach) + area_below_arc(inner) - area_below_arc(-reach)
        full = area_below_arc(np.minimum(x, -reach)) - area_below_arc(np.asarray(-radius))
        full = full + np.where(x > reach, area_below_arc(x) - area_below_arc(reach), 0.0)
        return cut + np.where(y >= 0, 2 * full, 0.0)

    def _below_arc(self, a: Array) -> Array:
        """∫₀ᵃ √(R² − x²) dx; rounding errors of the root appear in both terms, and cancel."""
        radius = self.diameter / 2
        root = np.sqrt(np.maximum(radius**2 - a * a, 0))
        return np.asarray((a * root + radius**2 * np.arctan2(a, root)) / 2)


@dataclass(frozen=True)
class Polygon(Pattern):
    """A regular polygon, as formed by the blades of an iris.

    Args:
        sides: number of sides, 3 to 1000.
        diameter: of the circle through the corners, metres.
        rotation: radians, clockwise as seen looking at the scene; at 0 a corner points right.
    """

    sides: int
    diameter: float = field(metadata={"unit": "length"})
    rotation: float = field(default=0.0, metadata={"unit": "angle"})

    def __post_init__(self) -> None:
        checks.above_zero("diameter of polygon", self.diameter, unit="m")
        checks.whole_number_between(
            "sides of polygon", self.sides, 3, 1000, way_out="more are a vcc.patterns.Circle"
        )
        checks.finite("rotation of polygon", self.rotation, "radians")

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) of the circle through the corners, metres."""
        return self.diameter, self.diameter

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """One inside the polygon, zero outside."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        inside = np.ones(np.broadcast_shapes(x.shape, y.shape), dtype=bool)
        for side in range(self.sides):
            normal = self.rotation + (2 * side + 1) * math.pi / self.sides
            inside &= x * math.cos(normal) + y * math.sin(normal) <= self._apothem
        return inside.astype(np.float64)

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """The share of each rectangle that lies inside the polygon, in closed form."""
        floor = self.diameter * 1e-5
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        return _share_by_integral(self, x, y, max(width, floor), max(height, floor), self._apothem)

    @property
    def _apothem(self) -> float:
        """Distance from the middle to a side, metres."""
        return self.diameter / 2 * math.cos(math.pi / self.sides)

    def _integral(self, x: Array, y: Array) -> Array:
        """Area of the polygon left of x and above y.

        By Green's theorem it is ∮ min(x(b), x) db around the part above y. Since x·∮ db = 0, this equals
        −∮ max(x − x(b), 0) db: for each side, the mean of the positive part of a linear function, times the side's
        height.
        """
        angle = self.rotation + 2 * math.pi * np.arange(self.sides + 1) / self.sides
        a, b = self.diameter / 2 * np.cos(angle), self.diameter / 2 * np.sin(angle)
        total = np.zeros(np.broadcast_shapes(x.shape, y.shape))
        for n in range(self.sides):
            high = b[n + 1] - b[n]
            if abs(high) < 1e-12 * self.diameter:
                continue
            first, last = np.minimum(b[n], y), np.minimum(b[n + 1], y)
            slope = (a[n + 1] - a[n]) / high
            total -= (last - first) * _mean_above_zero(
                x - a[n] - slope * (first - b[n]), x - a[n] - slope * (last - b[n])
            )
        return total


def _mean_above_zero(one: Array, other: Array) -> Array:
    """The mean of max(f, 0) for a function f that is linear from one number to another."""
    low, high = np.minimum(one, other), np.maximum(one, other)
    crossing = (low < 0) & (high > 0)
    crossed = np.divide(high * high, 2 * (high - low), out=np.zeros(low.shape), where=crossing)
    return np.where(crossing, crossed, np.maximum((low + high) / 2, 0.0))


@dataclass(frozen=True, eq=False)
class Cells(Value, Pattern):
    """A transmission array: values and a frame; uniform rectangular cells side by side, opaque outside.

    Args:
        values: transmission of each cell, 0 to 1, shape (rows, columns), row 0 at the top.
        width: of the whole array, metres.
        height: metres; None makes the cells square.
        middle: place (x, y) of the array's middle, metres.

    Raises:
        InputError: not 2-D, empty, outside 0 to 1, not finite, opaque throughout, or a size of zero or less.
    """

    values: NDArray[np.float64]
    width: float = field(metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})
    middle: tuple[float, float] = field(default=(0.0, 0.0), metadata={"unit": "length"})

    def __post_init__(self) -> None:
        checks.plain("a transmission array", self.values)
        try:
            values = np.asarray(self.values, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(
                f"a transmission array is rows of equally many numbers, not {type(self.values).__name__}"
            ) from None
        if values.ndim != 2:
            raise InputError(f"a transmission array has (rows, columns), not shape {values.shape}")
        if values.size == 0:
            raise InputError(f"a transmission array of shape {values.shape} is empty")
        checks.all_finite("a transmission array", values)
        if values.min() < 0 or values.max() > 1:
            counted = values.min() >= 0 and values.max() >= 2
            way_out = "divide it by its full scale (255 for 8-bit values)" if counted else "clip it to 0 and 1"
            raise InputError(
                f"transmission lies between 0 and 1; this array goes from {values.min():g} to {values.max():g}: "
                f"{way_out}"
            )
        object.__setattr__(self, "values", values)
        checks.above_zero("width of cells", self.width, unit="m")
        if self.height is None:
            object.__setattr__(self, "height", self.width * values.shape[0] / values.shape[1])
        checks.above_zero("height of cells", self.height, unit="m")
        object.__setattr__(self, "middle", checks.pair("middle of cells", self.middle, "(x, y) in metres"))

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) of the array, metres."""
        assert self.height is not None
        # A bound around the axis, so that an array off the axis is not cut.
        return self.width + 2 * abs(self.middle[0]), self.height + 2 * abs(self.middle[1])

    @property
    def frame(self) -> Affine:
        """Maps (column, row, 1) to (x, y, 1) of the middle of a cell, metres."""
        assert self.height is not None
        rows, columns = self.values.shape
        return (
            Affine.translation(*self.middle)
            @ Affine.scaling(self.width / columns, self.height / rows)
            @ Affine.translation(-(columns - 1) / 2, -(rows - 1) / 2)
        )

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The value of the cell at each position; zero outside the array."""
        r, c = self.cells_at(np.asarray(x, float), np.asarray(y, float))
        return np.where((r >= 0) & (c >= 0), self.values[r, c], 0.0)

    def cells_at(self, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows of the cells at places y, and columns of the cells at places x; −1 outside the array."""
        places = zip(self._index(x, y), self.values.shape, strict=True)
        row, column = (
            np.where((place >= 0) & (place < count), np.floor(place), -1).astype(np.int64)
            for place, count in places
        )
        return row, column

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """Mean transmission over rectangles, exact (differences of the array's integral)."""
        width, height = max(width, self.width * 1e-5), max(height, self.size[1] * 1e-5)
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if is_grid(x, y):  # then two small products are enough
            content = self.means(self.values[None], x.reshape(-1), y.reshape(-1), width, height)
            return content.reshape(np.broadcast_shapes(x.shape, y.shape))
        return _mean_from_integral(self._integral, x, y, width, height)

    def means(self, values: Array, x: Array, y: Array, width: float, height: float) -> Array:
        """`mean` for several arrays in place of this one, over rectangles in rows and columns.

        Args:
            values: (arrays, rows, columns).
            x: centres, metres, (columns of rectangles,).
            y: centres, metres, (rows of rectangles,).
            width: of every rectangle, metres.
            height: of every rectangle, metres.

        Returns:
            (arrays, rows of rectangles, columns of rectangles).
        """
        width, height = max(width, self.width * 1e-5), max(height, self.size[1] * 1e-5)
        across, down = _densely(self._overlaps(x, width, 1)), _densely(self._overlaps(y, height, 0))
        return np.stack([down @ each @ across.T for each in values])

    def _index(self, x: Array, y: Array) -> tuple[Array, Array]:
        """(row, column) relative to the array's top left corner, in cells."""
        place = self._place
        return y * place.matrix[1, 1] + place.offset[1] + 0.5, x * place.matrix[0, 0] + place.offset[0] + 0.5

    @property
    @cached
    def _place(self) -> Affine:
        """Maps (x, y, 1) to (column, row, 1) of cells."""
        return self.frame.inverse()

    def _overlaps(self, centres: Array, length: float, axis: int) -> Any:
        """Share of each interval that each cell along an axis fills: a sparse matrix (intervals, cells)."""
        assert self.height is not None
        cells = self.values.shape[axis]
        pitch = (self.height, self.width)[axis] / cells
        start = (centres - self.middle[1 - axis]) / pitch + cells / 2 - length / pitch / 2
        reach = length / pitch
        return overlaps(start, start + reach, cells) / reach

    def _integral(self, x: Array, y: Array) -> Array:
        rows, columns = self.values.shape
        total = np.zeros((rows + 1, columns + 1))
        total[1:, 1:] = self.values.cumsum(0).cumsum(1)
        assert self.height is not None
        return np.asarray(bilinear(total, *self._index(x, y)) * (self.width / columns) * (self.height / rows))

    def described(self) -> str:
        """The number of cells and the size of the array as text."""
        rows, columns = self.values.shape
        return f"{rows}×{columns} cells ({text(self.width)} wide)"

    def __repr__(self) -> str:
        rows, columns = self.values.shape
        return f"Cells({rows}×{columns}, width={self.width!r}, height={self.height!r})"


def _densely(overlaps: Any) -> Any:
    """A sparse matrix, converted to a full one if products of that are faster."""
    return overlaps.toarray() if 8 * overlaps.nnz > math.prod(overlaps.shape) else overlaps


@dataclass(frozen=True)
class CosineSum(Pattern):
    """A sum of cosines, raised to stay between 0 and 1: the carrier of heterodyne light-field cameras.

    T(x, y) = ∏ over the axes of ½ + (1/2h)·Σₙ cos(2πn·x/period), n = 1 … h (Veeraraghavan et al. 2007,
    section 3, in the separable form that a printed transparency can have).

    Args:
        period: of the first harmonic, metres: one number, or (x, y), where infinity makes an axis constant.
        harmonics: h, number of equal cosines along each axis, 1 to 1000.
        phase: radians, added to every first harmonic (n times to the n-th).
    """

    period: float | tuple[float, float] = field(metadata={"unit": "length"})
    harmonics: int = 1
    phase: float = field(default=0.0, metadata={"unit": "angle"})

    def __post_init__(self) -> None:
        for period in self.period if isinstance(self.period, tuple | list) else (self.period,):
            checks.above_zero("period of cosine sum", period, unit="m", infinite=True)
        checks.whole_number_between("harmonics of cosine sum", self.harmonics, 1, 1000)
        checks.finite("phase of cosine sum", self.phase, "radians")

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The product of the two axes' sums."""
        return self.mean(x, y, 0.0, 0.0)

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """The mean over rectangles in closed form: each cosine shrinks by sinc(n·width/period)."""
        return self._axis(np.asarray(x, float), self.periods[0], width) * self._axis(
            np.asarray(y, float), self.periods[1], height
        )

    @property
    def periods(self) -> tuple[float, float]:
        """The period along (x, y), metres."""
        if isinstance(self.period, tuple | list):
            return float(self.period[0]), float(self.period[1])
        return float(self.period), float(self.period)

    def _axis(self, x: Array, period: float, width: float) -> Array:
        if math.isinf(period):
            return np.ones_like(x)
        total = np.zeros_like(x)
        for n in range(1, self.harmonics + 1):
            total += np.cos(n * (2 * math.pi * x / period + self.phase)) * np.sinc(n * width / period)
        return 0.5 + total / (2 * self.harmonics)


@dataclass(frozen=True, eq=False)
class FunctionPattern(Pattern):
    """A pattern from any function of position; see `as_pattern`.

    Args:
        function: called with x and y in metres (arrays that broadcast); returns transmission, 0 to 1.
        owner: the element of the pattern, named in errors if the function returns invalid values.
    """

    function: Callable[[Array, Array], ArrayLike]
    owner: str = ""

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The function's values, validated."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        # Full arrays: a function of x alone then returns one number for each place, too.
        x, y = np.broadcast_arrays(x, y)
        shape = x.shape
        name = f"pattern {getattr(self.function, '__name__', repr(self.function))}"
        name = f"{self.owner}: {name}" if self.owner else name
        return as_transmission(name, self.function(x, y), shape)


def as_transmission(name: str, returned: Any, shape: tuple[int, ...]) -> Array:
    """What a function of the user returned, as an array of the given shape.

    Raises:
        InputError: another shape, or numbers that are not finite or lie outside 0 to 1.
    """
    checks.plain(f"what {name} returned", returned)
    values = np.asarray(returned, dtype=np.float64)
    if values.shape not in (shape, ()):
        raise InputError(f"{name} returned shape {values.shape} for positions of shape {shape}")
    if not np.isfinite(values).all():
        raise InputError(f"{name} returned numbers that are not finite")
    if values.size and (values.min() < 0 or values.max() > 1):
        raise InputError(
            f"{name} returned transmission from {values.min():g} to {values.max():g}; it lies between 0 and 1"
        )
    return np.broadcast_to(values, shape)


def owned(pattern: Pattern, owner: str) -> Pattern:
    """The pattern with the name of its owner, for errors of functions that return invalid values."""
    if isinstance(pattern, FunctionPattern):
        return replace(pattern, owner=owner)
    if isinstance(pattern, Bounded):
        return replace(pattern, pattern=owned(pattern.pattern, owner))
    return pattern


def as_pattern(pattern: Pattern | Callable[[Array, Array], ArrayLike]) -> Pattern:
    """A pattern from a pattern or from any function of (x, y) in metres.

    Raises:
        InputError: an object of another type: a class or a name, for instance.
    """
    if isinstance(pattern, Pattern):
        return pattern
    given: Any = pattern
    if given is mura or (isinstance(given, str) and given.lower() == "mura"):
        raise InputError("a MURA is an array of cells: write vcc.Mask(vcc.patterns.mura(29), width=10 * mm)")
    if isinstance(given, str) and Path(given).suffix:
        read = f"vcc.files.pictures.read_grey({given!r})"
        raise InputError(f"{given!r} is the name of a file: write vcc.Mask({read}, width=30 * mm)")
    if isinstance(given, str | type):
        kinds = (Open, Circle, Polygon, CosineSum, Cells, Bounded)
        raise InputError(f"{given!r} is no pattern: {instead_of_name(given, 'vcc.patterns', kinds)}")
    if callable(given):
        _check_two_arguments(given)
        return FunctionPattern(given)
    raise InputError(
        "a pattern is a vcc.patterns.Pattern, a function of (x, y) or, for a mask, an array of transmissions, "
        f"not {type(given).__name__}"
    )


def accepts(function: Callable[..., Any], arguments: int) -> bool:
    """Whether a function can be called with so many numbers; functions written in C may hide their signature."""
    try:
        inspect.signature(function).bind(*[0.0] * arguments)
    except TypeError:
        return False
    except ValueError:
        return True
    return True


def _check_two_arguments(function: Callable[..., Any]) -> None:
    """Raise if a function cannot be called with (x, y), such as one of position and slope."""
    if not accepts(function, 2):
        raise InputError(
            "a pattern is a function of two numbers, (x, y), and this one has the arguments "
            f"{inspect.signature(function)}. A transmission T(x, y, s, t) that depends on direction, too, is "
            "vcc.RayFilter(function), or vcc.Faces(transmission=function) of your own element"
        )


@dataclass(frozen=True)
class Bounded(Pattern):
    """Another pattern on a sheet of limited size, opaque outside it.

    Args:
        pattern: on the sheet.
        width: of the sheet, metres.
        height: of the sheet, metres.

    Raises:
        InputError: an object that is not a pattern, or a size of 0 or less.
    """

    pattern: Pattern
    width: float = field(metadata={"unit": "length"})
    height: float = field(metadata={"unit": "length"})

    def __post_init__(self) -> None:
        object.__setattr__(self, "pattern", as_pattern(self.pattern))
        checks.sizes("a bounded pattern", width=self.width, height=self.height)

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) of the clear area, metres."""
        return min(self.width, self.pattern.size[0]), min(self.height, self.pattern.size[1])

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The pattern on the sheet, zero outside."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        inside = (np.abs(x) <= self.width / 2) & (np.abs(y) <= self.height / 2)
        return np.where(inside, self.pattern(x, y), 0.0)

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """The pattern's mean times the share of each rectangle that lies on the sheet.

        Exact if no rectangle crosses the border of the sheet, or if the pattern is constant across it.
        """
        x, y = np.asarray(x, float), np.asarray(y, float)
        share_x = overlap_share(x, max(width, self.width * 1e-5), self.width)
        share_y = overlap_share(y, max(height, self.height * 1e-5), self.height)
        return self.pattern.mean(x, y, width, height) * share_x * share_y


def overlap_share(centre: Array, length: Array | float, sheet: float) -> Array:
    """The share of intervals of some length around places that lies within ±sheet/2."""
    covered = np.minimum(centre + length / 2, sheet / 2) - np.maximum(centre - length / 2, -sheet / 2)
    return np.asarray(np.clip(covered / length, 0.0, 1.0))


LARGEST_MURA = 4093
"""Cells a side of the largest MURA, which takes 134 MB."""


def mura(prime: int) -> NDArray[np.float64]:
    """A modified uniformly redundant array: prime × prime cells of 0 and 1, half of them open.

    Cell (i, j) is open if j = 0 and i ≠ 0, or if i and j are both or neither quadratic residues modulo
    the prime (Gottesman and Fenimore 1989, eq. 13).

    Args:
        prime: a prime number of cells a side, 5 to `LARGEST_MURA`.

    Raises:
        InputError: not a prime of 5 or more, or a larger one.
    """
    prime = checks.whole_number_between("prime of a MURA", prime, 5)
    if prime > LARGEST_MURA:
        raise InputError(
            f"a MURA of {prime}×{prime} cells takes {8 * prime**2 / 1e9:,.3g} GB: prime is at most {LARGEST_MURA}"
        )
    if any(prime % divisor == 0 for divisor in range(2, math.isqrt(prime) + 1)):
        raise InputError(f"a MURA has a prime number of cells a side, 5 or more, not {prime}")
    residues = {n * n % prime for n in range(1, prime)}
    sign = np.array([1 if n in residues else -1 for n in range(prime)], np.int8)
    cells = (sign[:, None] * sign[None, :] == 1).astype(np.float64)
    cells[0, :] = 0.0
    cells[1:, 0] = 1.0
    return np.asarray(cells)


def overlaps(first: Array, last: Array, count: int) -> Any:
    """Lengths of each cell that each interval covers, a sparse matrix (intervals, cells).

    Args:
        first: starts of the intervals, in cells from the border of the first cell, (intervals,).
        last: their ends.
        count: number of cells.
    """
    from scipy.sparse import csr_array

    low = np.floor(first).astype(np.int64)
    index = low[:, None] + np.arange(int((np.ceil(last) - low).max(initial=0)))
    share = np.minimum(index + 1, last[:, None]) - np.maximum(index, first[:, None])
    keep = (share > 0) & (index >= 0) & (index < count)
    interval = np.broadcast_to(np.arange(len(first))[:, None], index.shape)
    return csr_array((share[keep], (interval[keep], index[keep])), shape=(len(first), count))


def is_grid(x: Array, y: Array) -> bool:
    """Whether places are rows y, (rows, 1), times columns x, (1, columns)."""
    return x.ndim == y.ndim == 2 and x.shape[0] == 1 and y.shape[1] == 1
