"""Surfaces of phase plates: the optical path that a thin plate adds, as a function of position.

A thin plate of height h(x, y) and refractive index n in air adds the optical path OPL = (n − 1)·h. Rays are
normal to wavefronts, so that the plate adds the path's gradient to their slopes, (Δs, Δt) = (∂OPL/∂x, ∂OPL/∂y):
light bends towards the thicker glass (Born and Wolf, Principles of Optics, section 3.1, for small slopes). Only
differences of path matter; a constant does nothing. Positions (x, y) are in metres from the surface's own
middle, x right and y down, and slopes have no unit.
"""

from __future__ import annotations

import abc
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import kind_in_words, parameters_in_words, with_parameters
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.shapes.patterns import is_grid

Array = NDArray[np.float64]

RASTER = 257
"""Points a side at which slopes are looked at for their largest, where no closed form is known."""
POINTS_PER_CORRELATION_LENGTH = 4
"""Of a rough surface. Its spectrum exp(−π²f²l²) has fallen to 1e-17 at the highest frequency that they hold."""
LARGEST_GRID = 4096
"""Points a side of a rough surface: 128 MiB of float64, and seconds to make."""


class Surface(abc.ABC):
    """The optical path that a thin plate adds, by position. Final classes are frozen dataclasses of SI numbers.

    Yours needs `path` and `slopes`; the rest follows.
    """

    @abc.abstractmethod
    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """OPL in metres at positions x, y in metres (arrays that broadcast against each other)."""

    @abc.abstractmethod
    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(Δs, Δt) = (∂OPL/∂x, ∂OPL/∂y), which rays gain at positions x, y in metres (broadcast)."""

    @property
    def affine(self) -> Affine | None:
        """The deflection as a 5×5 map of rays where the slopes are linear in x and y, else None."""
        return None

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) in metres outside which the surface is not known; infinite where there is no bound."""
        return math.inf, math.inf

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """Bounds of (|Δs|, |Δt|) over the rectangle of these half sizes around the middle, metres.

        Here: the largest on a raster of 257×257 points, edges included, and 5 % more.
        """
        x = np.linspace(-half_width, half_width, RASTER)
        y = np.linspace(-half_height, half_height, RASTER)
        s, t = self.slopes(x[None, :], y[:, None])
        return 1.05 * float(np.abs(s).max()), 1.05 * float(np.abs(t).max())

    def described(self) -> str:
        """The surface in words, such as ``"quadratic (focal length 50 mm)"``."""
        return with_parameters(kind_in_words(type(self)), parameters_in_words(self))


@dataclass(frozen=True)
class Quadratic(Surface):
    """A paraboloid, which is a thin lens: OPL = −r²/2f, Δs = −x/f, Δt = −y/f.

    Args:
        focal_length: metres; negative for a diverging lens.

    Raises:
        InputError: a focal length of 0 or not a number.
    """

    focal_length: float = field(metadata={"unit": "length"})

    def __post_init__(self) -> None:
        checks.not_zero("focal_length of a quadratic surface", self.focal_length)

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """−r²/2f, metres."""
        x, y = _places(x, y)
        return -(x * x + y * y) / (2 * self.focal_length)

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(−x/f, −y/f)."""
        x, y = _places(x, y)
        return -x / self.focal_length, -y / self.focal_length

    @property
    def affine(self) -> Affine:
        """The thin lens."""
        return Affine.lens(self.focal_length)

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """(half_width, half_height)/|f|: the slopes at the edges."""
        return half_width / abs(self.focal_length), half_height / abs(self.focal_length)


@dataclass(frozen=True)
class Tilt(Surface):
    """A wedge, which is a thin prism: OPL = δs·x + δt·y.

    Args:
        deflection: (δs, δt), dimensionless slopes; positive moves light to the right and down. A wedge of
            apex angle α and index n deflects by about (n − 1)·α.

    Raises:
        InputError: not two finite numbers.
    """

    deflection: tuple[float, float]

    def __post_init__(self) -> None:
        slopes = checks.pair("deflection of a tilt", self.deflection, "two slopes (δs, δt)")
        object.__setattr__(self, "deflection", slopes)

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """δs·x + δt·y, metres."""
        x, y = _places(x, y)
        return self.deflection[0] * x + self.deflection[1] * y

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(δs, δt) everywhere."""
        x, y = _places(x, y)
        return np.full(x.shape, self.deflection[0]), np.full(x.shape, self.deflection[1])

    @property
    def affine(self) -> Affine:
        """The thin prism."""
        return Affine.prism(self.deflection)

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """(|δs|, |δt|)."""
        return abs(self.deflection[0]), abs(self.deflection[1])


@dataclass(frozen=True)
class Cubic(Surface):
    """The cubic plate of wavefront coding: OPL = strength·(x³ + y³), Δs = 3·strength·x², Δt likewise.

    Dowski and Cathey (Extended depth of field through wave-front coding, Applied Optics 34, 1995) give the
    phase α·(x/R)³ in radians over a square pupil of half side R: strength = α·λ/(2π·R³); see `from_alpha`.

    Args:
        strength: 1/m²; positive bends light to the right and down.

    Raises:
        InputError: not a finite number.
    """

    strength: float

    def __post_init__(self) -> None:
        checks.finite("strength of a cubic surface", self.strength, "1/m²")

    @classmethod
    def from_alpha(cls, alpha: float, half_width: float, wavelength: float) -> Cubic:
        """The plate of phase α·((x/R)³ + (y/R)³), as Dowski and Cathey state it.

        Args:
            alpha: α, radians of phase at the edge of the pupil, on each axis.
            half_width: R, half the side of the square pupil, metres.
            wavelength: λ, metres.

        Raises:
            InputError: a half width or wavelength of 0 or less.
        """
        checks.above_zero("half_width of a cubic surface", half_width, unit="m")
        checks.above_zero("wavelength of a cubic surface", wavelength, unit="m")
        return cls(alpha * wavelength / (2 * math.pi * half_width**3))

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """strength·(x³ + y³), metres."""
        x, y = _places(x, y)
        return self.strength * (x**3 + y**3)

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(3·strength·x², 3·strength·y²)."""
        x, y = _places(x, y)
        return 3 * self.strength * x**2, 3 * self.strength * y**2

    @property
    def affine(self) -> Affine | None:
        """Nothing where the strength is 0."""
        return Affine.identity() if self.strength == 0 else None

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The slopes at the edges."""
        return 3 * abs(self.strength) * half_width**2, 3 * abs(self.strength) * half_height**2

    def described(self) -> str:
        """The strength with its unit."""
        return f"cubic (strength {self.strength:g} /m²)"


@dataclass(frozen=True)
class Axicon(Surface):
    """A cone: OPL = −slope·r, so that every ray bends towards the axis by the same slope.

    The point at r = 0, where a cone has no gradient, bends nothing. (McLeod, The axicon: a new type of optical
    element, Journal of the Optical Society of America 44, 1954.)

    Args:
        slope: dimensionless; negative bends rays away from the axis. A cone of base angle γ and index n has
            about (n − 1)·γ.

    Raises:
        InputError: not a finite number.
    """

    slope: float

    def __post_init__(self) -> None:
        checks.finite("slope of an axicon", self.slope)

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """−slope·r, metres."""
        return -self.slope * np.hypot(*_places(x, y))

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """−slope·(x, y)/r."""
        x, y = _places(x, y)
        r = np.hypot(x, y)
        r = np.where(r == 0, 1.0, r)  # x and y are 0 there, and so are the slopes
        return -self.slope * (x / r), -self.slope * (y / r)

    @property
    def affine(self) -> Affine | None:
        """Nothing where the slope is 0."""
        return Affine.identity() if self.slope == 0 else None

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The slope, along both axes."""
        return abs(self.slope), abs(self.slope)


@dataclass(frozen=True)
class Zernike(Surface):
    """Aberrations of a lens as a sum of Zernike polynomials in Noll's order: OPL = Σⱼ aⱼ·Zⱼ(ρ, θ).

    The polynomials are orthonormal over the disc (Noll, Zernike polynomials and atmospheric turbulence, Journal
    of the Optical Society of America 66, 1976, eq. 1 and table I): over it, the root mean square of a path is
    √(Σ aⱼ²) with piston (j = 1) left out. ρ = r/R, and θ runs from x towards y, which is downwards here.

    === =================== =========================
    j   name                Zⱼ
    === =================== =========================
    1   piston              1
    2   tilt along x        2ρ cos θ
    3   tilt along y        2ρ sin θ
    4   defocus             √3 (2ρ² − 1)
    5   oblique astigmatism √6 ρ² sin 2θ
    6   astigmatism         √6 ρ² cos 2θ
    7   coma along y        √8 (3ρ³ − 2ρ) sin θ
    8   coma along x        √8 (3ρ³ − 2ρ) cos θ
    11  spherical           √5 (6ρ⁴ − 6ρ² + 1)
    === =================== =========================

    Beyond the disc the same polynomials go on, and grow fast.

    Args:
        coefficients: a₁, a₂, a₃, …, metres of optical path, as many as wanted; see `from_terms` for few.
        diameter: 2R of the disc, metres.

    Raises:
        InputError: no coefficients, one that is not finite, or a diameter of 0 or less.
    """

    coefficients: tuple[float, ...] = field(metadata={"unit": "length"})
    diameter: float = field(metadata={"unit": "length"})

    def __post_init__(self) -> None:
        terms = "one or more numbers of metres of Noll's terms 1, 2, 3, …"
        coefficients = checks.array("coefficients of a Zernike surface", self.coefficients, terms, None)
        object.__setattr__(self, "coefficients", tuple(coefficients.tolist()))
        checks.above_zero("diameter of a Zernike surface", self.diameter, unit="m")

    @classmethod
    def from_terms(cls, terms: Mapping[int, float], diameter: float) -> Zernike:
        """A surface from a few terms, such as ``Zernike.from_terms({4: 200 * nm, 11: 80 * nm}, 20 * mm)``.

        Args:
            terms: coefficients in metres of optical path by Noll's number j, 1 or more; all others are 0.
            diameter: of the disc, metres.

        Raises:
            InputError: no terms, a number below 1, and as for the class.
        """
        if not terms or not all((checks.whole_number(j) or 0) >= 1 for j in terms):
            raise InputError(f"terms of a Zernike surface are numbered 1, 2, 3, … after Noll, not {list(terms)}")
        return cls(tuple(terms.get(j, 0.0) for j in range(1, max(terms) + 1)), diameter)

    @cached_property
    def _terms(self) -> list[tuple[float, int, int, bool]]:
        """(coefficient and norm, k = (n − m)/2, m, whether it goes with the sine) of terms other than 0."""
        found = []
        for j, coefficient in enumerate(self.coefficients, start=1):
            n, m = noll(j)
            norm = math.sqrt(n + 1 if m == 0 else 2 * (n + 1))
            if coefficient != 0:
                found.append((coefficient * norm, (n - m) // 2, m, j % 2 == 1))
        return found

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The sum of the terms, metres."""
        from scipy.special import eval_jacobi

        # With w = (x + iy)/R, a term is its norm × Re or Im of wᵐ × a Jacobi polynomial P_k^(0, m) of 2ρ² − 1:
        # no angle, no division by ρ, and evaluated by recurrence.
        x, y = _places(x, y)
        w = (x + 1j * y) / (self.diameter / 2)
        argument = 2 * (w.real**2 + w.imag**2) - 1
        total = np.zeros(w.shape)
        for weight, k, m, sine in self._terms:
            angular = w**m
            total += weight * (angular.imag if sine and m else angular.real) * eval_jacobi(k, 0, m, argument)
        return total

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """The sum of the terms' gradients, in closed form."""
        from scipy.special import eval_jacobi

        x, y = _places(x, y)
        radius = self.diameter / 2
        w = (x + 1j * y) / radius
        argument = 2 * (w.real**2 + w.imag**2) - 1
        s, t = np.zeros(w.shape), np.zeros(w.shape)
        for weight, k, m, sine in self._terms:
            sine = sine and m > 0
            angular = w**m
            harmonic = angular.imag if sine else angular.real
            if m:  # d(wᵐ)/dx = m·wᵐ⁻¹ and d(wᵐ)/dy = i·m·wᵐ⁻¹
                radial = weight * m * eval_jacobi(k, 0, m, argument)
                slope = w ** (m - 1)
                s += radial * (slope.imag if sine else slope.real)
                t += radial * (slope.real if sine else -slope.imag)
            if k:  # dP_k^(0, m)(z)/dz = (k + m + 1)/2 · P_(k−1)^(1, m+1)(z), with dz = 4(x dx + y dy)/R²
                steepness = weight * harmonic * 2 * (k + m + 1) * eval_jacobi(k - 1, 1, m + 1, argument)
                s += steepness * w.real
                t += steepness * w.imag
        return s / radius, t / radius

    @property
    def affine(self) -> Affine | None:
        """A prism, a lens and a cylinder lens, where no term beyond astigmatism (j = 6) is other than 0."""
        if any(self.coefficients[6:]):
            return None
        radius = self.diameter / 2
        _, tilt_x, tilt_y, defocus, oblique, upright = (*self.coefficients, 0.0, 0.0, 0.0, 0.0, 0.0)[:6]
        matrix = np.eye(5)
        matrix[2, 0] = (4 * math.sqrt(3) * defocus + 2 * math.sqrt(6) * upright) / radius**2
        matrix[3, 1] = (4 * math.sqrt(3) * defocus - 2 * math.sqrt(6) * upright) / radius**2
        matrix[2, 1] = matrix[3, 0] = 2 * math.sqrt(6) * oblique / radius**2
        matrix[2:4, 4] = 2 * tilt_x / radius, 2 * tilt_y / radius
        return Affine(matrix)

    def described(self) -> str:
        """The terms that are not 0, by Noll's numbers."""
        terms = [f"Z{j} {short(value)}" for j, value in enumerate(self.coefficients, start=1) if value != 0]
        return f"Zernike ({', '.join([*terms, f'diameter {short(self.diameter)}'])})"


def noll(j: int) -> tuple[int, int]:
    """(n, m) of Noll's term j = 1, 2, 3, …: radial order and angular frequency, m ≥ 0.

    Even j go with cos mθ, odd j with sin mθ (Noll 1976, eq. 1).
    """
    n = (math.isqrt(8 * j - 7) - 1) // 2
    place = j - n * (n + 1) // 2  # 1 … n + 1 within the row of order n
    return n, 2 * (place // 2) if n % 2 == 0 else 2 * ((place - 1) // 2) + 1


class Sheet(Surface):
    """A surface known on a grid of points of a sheet, a spline between them, and nothing (flat) beyond.

    The interpolant is the bicubic spline through the points, so that slopes and their derivatives are
    continuous. It is made when first asked for.
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

    @cached_property
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

    @cached_property
    def _gradient(self) -> tuple[Any, Any]:
        """Splines of (∂OPL/∂x, ∂OPL/∂y)."""
        return self._spline.partial_derivative(0, 1), self._spline.partial_derivative(1, 0)

    @property
    def affine(self) -> Affine | None:
        """Nothing where the sheet is flat."""
        return Affine.identity() if self._flat else None

    @cached_property
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
        # A millionth more, so that a place on the edge is on the sheet whatever rounding did to it
        inside = (np.abs(x) <= self.size[0] * 0.500001) & (np.abs(y) <= self.size[1] * 0.500001)
        if is_grid(x, y) and (np.diff(x[0]) > 0).all() and (np.diff(y[:, 0]) > 0).all():
            # The spline is a product along both axes: 50 times as fast as place by place
            return np.where(inside, spline(y[:, 0], x[0], grid=True), 0.0)
        x, y = np.broadcast_arrays(x, y)
        values = np.zeros(x.shape)
        values[inside] = spline(y[inside], x[inside], grid=False)
        return values

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The largest coefficients of the slopes' splines in the rectangle, which no spline can exceed.

        (The convex hull property of B-splines; de Boor, A Practical Guide to Splines.)
        """
        along_x, along_y = self._gradient
        return _coefficient_bound(along_x, half_width, half_height), _coefficient_bound(
            along_y, half_width, half_height
        )


def _coefficient_bound(spline: Any, half_width: float, half_height: float) -> float:
    knots_y, knots_x, coefficients = spline.tck
    degree_y, degree_x = spline.degrees
    near_y = (knots_y[degree_y + 1 :] >= -half_height) & (knots_y[: -degree_y - 1] <= half_height)
    near_x = (knots_x[degree_x + 1 :] >= -half_width) & (knots_x[: -degree_x - 1] <= half_width)
    table = coefficients[: len(near_y) * len(near_x)].reshape(len(near_y), len(near_x))
    return float(np.abs(table[np.ix_(near_y, near_x)]).max())


class _Table(Sheet):
    """A surface known at the middles of square or rectangular cells side by side, which fill its sheet."""

    @property
    @abc.abstractmethod
    def _cells(self) -> Array:
        """What is known of each cell, (rows, columns)."""

    @property
    def _factor(self) -> float:
        """The optical path for 1 of what is known."""
        return 1.0

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
        return y, x, self._factor * self._cells

    def __eq__(self, other: object) -> bool:
        # By the size, since a height that is left out is one that makes the cells square.
        return isinstance(other, type(self)) and (
            np.array_equal(self._cells, other._cells) and (self.size, self._factor) == (other.size, other._factor)
        )

    def __hash__(self) -> int:
        return hash((self._cells.tobytes(), self.size, self._factor))

    @property
    def _in_words(self) -> str:
        rows, columns = self._cells.shape
        width, height = self.size
        return f"{rows}×{columns} points, {short(width)} × {short(height)}"

    def described(self) -> str:
        """The number of points and the size of the sheet in words."""
        return f"{kind_in_words(type(self))} ({self._in_words})"

    def __repr__(self) -> str:
        rows, columns = self._cells.shape
        numbers = ", ".join(f"{each.name}={getattr(self, each.name)!r}" for each in fields(self)[1:])  # type: ignore[arg-type]
        return f"{type(self).__name__}({rows}×{columns}, {numbers})"


@dataclass(frozen=True, eq=False, repr=False)
class HeightMap(_Table):
    """Glass of measured or designed height h: OPL = (n − 1)·h, sampled on a grid.

    The sheet is ``width`` wide and bounds a plate made of it; values stand at the middles of its cells.

    Args:
        heights: thickness of the glass, metres, (rows, columns), row 0 at the top; 4×4 or more.
        width: of the whole sheet, metres.
        height: of the whole sheet, metres; None makes the cells square.
        refractive_index: n of the glass, more than 1.

    Raises:
        InputError: not a table of 4×4 or more finite numbers, a size of zero or less, or no glass (n ≤ 1).
    """

    heights: NDArray[np.float64]
    width: float = field(metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})
    refractive_index: float = 1.5

    def __post_init__(self) -> None:
        object.__setattr__(self, "heights", _table("heights of a height map", self.heights))
        checks.sizes("a height map", width=self.width, height=self.height)
        _check_glass("a height map", self.refractive_index)

    @property
    def _cells(self) -> Array:
        return self.heights

    @property
    def _factor(self) -> float:
        return self.refractive_index - 1

    def described(self) -> str:
        """The number of points, the size of the sheet and the glass in words."""
        return f"height map ({self._in_words}, refractive index {self.refractive_index:g})"


@dataclass(frozen=True, eq=False, repr=False)
class PathMap(_Table):
    """Optical path lengths sampled on a grid, from another program or a wavefront measurement.

    The sheet is ``width`` wide and bounds a plate made of it; values stand at the middles of its cells.

    Args:
        paths: optical path lengths, metres, (rows, columns), row 0 at the top; 4×4 or more.
        width: of the whole sheet, metres.
        height: of the whole sheet, metres; None makes the cells square.

    Raises:
        InputError: not a table of 4×4 or more finite numbers, or a size of zero or less.
    """

    paths: NDArray[np.float64]
    width: float = field(metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        object.__setattr__(self, "paths", _table("paths of a path map", self.paths))
        checks.sizes("a path map", width=self.width, height=self.height)

    @property
    def _cells(self) -> Array:
        return self.paths


@dataclass(frozen=True)
class Rough(Sheet):
    """A random surface of ground glass: Gaussian heights of correlation C(r) = σ²·exp(−r²/l²).

    Its slopes are Gaussian too, with the variance (n − 1)²·2σ²/l² along each axis, which is −(n − 1)²·∂²C/∂x² at 0
    (Papoulis, Probability, Random Variables and Stochastic Processes, on derivatives of stationary processes).
    It is made when first asked for: white noise from NumPy's generator, filtered by exp(−2r²/l²), which has that
    correlation. The same parameters and seed give the same surface.

    Args:
        height_rms: σ, root mean square of the heights, metres.
        correlation_length: l, where the correlation has fallen to 1/e, metres.
        width: of the sheet, metres; it bounds a plate made of it.
        height: of the sheet, metres; None makes it square.
        refractive_index: n of the glass, more than 1.
        seed: of the random numbers, an integer of 0 or more.

    Raises:
        InputError: lengths of zero or less (σ may be 0), no glass (n ≤ 1), a seed that is no such integer, or a
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
        rows, columns = self.grid
        if max(rows, columns) > LARGEST_GRID:
            room = (LARGEST_GRID - 1 - 2 * _MARGIN) * self._step
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
        """(rows, columns) of points at which the surface is made, the outermost a few beyond each edge."""
        # A millionth of a step less: a sheet of a whole number of steps is not one step longer by rounding
        rows, columns = (math.ceil(length / self._step - 1e-6) + 1 + 2 * _MARGIN for length in self.size[::-1])
        return rows, columns

    @property
    def _step(self) -> float:
        return self.correlation_length / POINTS_PER_CORRELATION_LENGTH

    @property
    def slope_rms(self) -> float:
        """Root mean square of Δs, and of Δt, over all such surfaces: (n − 1)·√2·σ/l."""
        return (self.refractive_index - 1) * math.sqrt(2) * self.height_rms / self.correlation_length

    @property
    def affine(self) -> Affine | None:
        """Nothing where the glass is smooth."""
        return Affine.identity() if self.height_rms == 0 else None

    def _samples(self) -> tuple[Array, Array, Array]:
        from scipy.ndimage import convolve1d

        # exp(−2·3²) = 1.5e-8: what lies further out than 3 l does not show in float32
        reach = 3 * POINTS_PER_CORRELATION_LENGTH
        kernel = np.exp(-2 * (np.arange(-reach, reach + 1) / POINTS_PER_CORRELATION_LENGTH) ** 2)
        kernel /= np.sqrt(np.sum(kernel**2))  # so that noise of variance 1 stays so
        rows, columns = self.grid
        heights = np.random.default_rng(self.seed).standard_normal((rows + 2 * reach, columns + 2 * reach))
        # Only points with the whole kernel inside the noise are kept: no edge, no wrapping around.
        heights = convolve1d(heights, kernel, axis=0)[reach:-reach]
        heights = convolve1d(heights, kernel, axis=1)[:, reach:-reach]
        y, x = (
            np.asarray((np.arange(points) - (points - 1) / 2) * self._step, dtype=np.float64)
            for points in (rows, columns)
        )
        return y, x, np.asarray((self.refractive_index - 1) * self.height_rms * heights)


_MARGIN = 3
"""Points of a rough surface beyond each edge of its sheet, where the spline's ends do no harm."""


def _places(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
    return x, y


def _table(what: str, given: Any) -> Array:
    needed = "a table of 4×4 numbers of metres or more, (rows, columns) (a cubic spline needs 4)"
    return checks.array(what, given, needed, None, None, least=4)


def _check_glass(what: str, refractive_index: Any) -> None:
    if not (isinstance(refractive_index, Real) and 1 < refractive_index < math.inf):  # type: ignore[operator]
        raise InputError(
            f"refractive_index of {what} is {refractive_index}: a surface with no glass bends "
            "nothing; glass has more than 1, such as 1.5"
        )
