"""Aberrations of lenses as surfaces: sums of Zernike polynomials."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.shapes.patterns import is_grid
from vcc.shapes.surface import Array, Surface, places

PLACES_AT_ONCE = 4096
"""Places that are computed together: their results stay in the cache."""
LARGE_GRID = 4
"""Times the number of places that determine a polynomial: larger grids are interpolated."""
ROUNDING = 1e-8
"""Rounding error allowed in interpolation, as a share of the slopes in the disc."""

Waves = NDArray[np.complex128]


@dataclass(frozen=True)
class Zernike(Surface):
    """Aberrations of a lens as a sum of Zernike polynomials in Noll's order: OPL = Σⱼ aⱼ·Zⱼ(ρ, θ).

    The polynomials are orthonormal over the disc (Noll, Zernike polynomials and atmospheric turbulence, Journal
    of the Optical Society of America 66, 1976, eq. 1 and table I): over the disc, the root mean square of a path
    is √(Σ aⱼ²) without piston (j = 1). ρ = r/R, and θ runs from x towards y, which is downwards here.

    | j  | name                | Zⱼ                   |
    |----|---------------------|----------------------|
    | 1  | piston              | 1                    |
    | 2  | tilt along x        | 2ρ cos θ             |
    | 3  | tilt along y        | 2ρ sin θ             |
    | 4  | defocus             | √3 (2ρ² − 1)         |
    | 5  | oblique astigmatism | √6 ρ² sin 2θ         |
    | 6  | astigmatism         | √6 ρ² cos 2θ         |
    | 7  | coma along y        | √8 (3ρ³ − 2ρ) sin θ  |
    | 8  | coma along x        | √8 (3ρ³ − 2ρ) cos θ  |
    | 11 | spherical           | √5 (6ρ⁴ − 6ρ² + 1)   |

    Beyond the disc the same polynomials continue, and grow fast.

    Args:
        coefficients: a₁, a₂, a₃, …, metres of optical path, any number; see `from_terms` for few terms.
        diameter: 2R of the disc, metres.

    Raises:
        InputError: no coefficients, one that is not finite, or a diameter of 0 or less.
    """

    linear_in: ClassVar[str] = "coefficients"

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
            InputError: no terms, a number below 1, or as for the class.
        """
        if not terms or not all((checks.whole_number(j) or 0) >= 1 for j in terms):
            raise InputError(f"terms of a Zernike surface are numbered 1, 2, 3, … after Noll, not {list(terms)}")
        return cls(tuple(terms.get(j, 0.0) for j in range(1, max(terms) + 1)), diameter)

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The sum of the terms, metres."""
        sums = self._by_frequency

        def path(w: Waves, argument: Array) -> tuple[Array]:
            total, power = np.zeros(w.shape), np.ones_like(w)
            for m, coefficients in enumerate(sums):
                total += (_jacobi_sums(coefficients, m, argument)[0] * power).real
                power = power * w
            return (total,)

        return self._in_pieces(path, 1, x, y)[0]

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """The sum of the terms' gradients, in closed form; on large grids by equally exact interpolation."""
        across, down = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if is_grid(across, down) and self._interpolates(across, down):
            return self._interpolated(across, down)
        sums = self._by_frequency

        def slopes(w: Waves, argument: Array) -> tuple[Array, Array]:
            s, t = np.zeros(w.shape), np.zeros(w.shape)
            before, power = np.zeros_like(w), np.ones_like(w)
            for m, coefficients in enumerate(sums):
                value, derivative = _jacobi_sums(coefficients, m, argument)
                around = m * value * before  # d(wᵐ)/dx = m·wᵐ⁻¹ and d(wᵐ)/dy = i·m·wᵐ⁻¹
                outwards = 4 * (derivative * power).real  # d(2ρ² − 1) = 4(x dx + y dy)/R²
                s += around.real + outwards * w.real
                t += outwards * w.imag - around.imag
                before, power = power, power * w
            return s, t

        s, t = self._in_pieces(slopes, 2, x, y)
        return s / (self.diameter / 2), t / (self.diameter / 2)

    @property
    def _order(self) -> int:
        """The degree of the polynomials in x and y."""
        return max((noll(j)[0] for j, _ in self._terms), default=0)

    def _interpolates(self, x: Array, y: Array) -> bool:
        """Whether a polynomial through few places determines a grid within `ROUNDING` of its values in the disc.

        Beyond the disc, terms of order n grow as (ρ + √(ρ² − 1))ⁿ, and rounding errors there affect all places.
        """
        if x.size * y.size < LARGE_GRID * (self._order + 1) ** 2:
            return False
        farthest = max(float(np.hypot(np.abs(x).max(), np.abs(y).max())) / (self.diameter / 2), 1.0)
        growth = self._order * math.log(farthest + math.sqrt(farthest**2 - 1))
        return growth < math.log(ROUNDING / np.finfo(np.float64).eps)

    def _interpolated(self, x: Array, y: Array) -> tuple[Array, Array]:
        """The slopes on a grid, by Chebyshev polynomials through as many places as determine them."""
        degree = max(self._order - 1, 0)
        nodes = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
        fixed = np.linalg.inv(chebvander(nodes, degree))
        places_at, weights = [], []
        for each in (x.reshape(-1), y.reshape(-1)):
            middle, half = (each.max() + each.min()) / 2, max((each.max() - each.min()) / 2, np.finfo(float).tiny)
            places_at.append(middle + half * nodes)
            weights.append(chebvander((each - middle) / half, degree) @ fixed)
        at_nodes = self.slopes(*np.meshgrid(*places_at))
        across, down = weights
        return down @ at_nodes[0] @ across.T, down @ at_nodes[1] @ across.T

    @property
    def _by_frequency(self) -> list[NDArray[np.complex128]]:
        """Sums of terms of each angular frequency m = 0, 1, … are Re wᵐ·Σₖ cₖ·P_k^(0, m): the coefficients cₖ."""
        found: dict[int, dict[int, complex]] = {}
        for j, coefficient in self._terms:
            term = _Term.of(j)
            of_m = found.setdefault(term.m, {})
            of_m[term.k] = of_m.get(term.k, 0) + term.norm * coefficient * (-1j if term.sine else 1)
        most = max(found, default=-1)
        return [
            np.array([found.get(m, {}).get(k, 0) for k in range(max(found.get(m, {}), default=-1) + 1)], complex)
            for m in range(most + 1)
        ]

    def _in_pieces(
        self, of: Callable[[Waves, Array], tuple[Array, ...]], count: int, x: ArrayLike, y: ArrayLike
    ) -> tuple[Array, ...]:
        """Values of a function at places, computed in pieces small enough for the cache."""
        across, down = places(x, y)
        found = tuple(np.empty(across.shape) for _ in range(count))
        flat = [each.reshape(-1) for each in found]
        xs, ys = across.reshape(-1), down.reshape(-1)
        for first in range(0, xs.size, PLACES_AT_ONCE):
            some = slice(first, first + PLACES_AT_ONCE)
            for kept, each in zip(flat, of(*self._within_disc(xs[some], ys[some])), strict=True):
                kept[some] = each
        return found

    def slopes_back(self, x: Array, y: Array, weights: tuple[Array, Array]) -> Array:
        """See `Surface`; for the coefficients. The transpose of `slopes`, sum by sum."""
        terms = [_Term.of(j) for j in range(1, len(self.coefficients) + 1)]
        sums = [
            np.zeros(1 + max(term.k for term in terms if term.m == m), np.complex128)
            for m in range(1 + max(term.m for term in terms))
        ]
        flat = [each.reshape(-1) for each in np.broadcast_arrays(x, y, *weights)]
        for first in range(0, flat[0].size, PLACES_AT_ONCE):
            across, down, along_x, along_y = (each[first : first + PLACES_AT_ONCE] for each in flat)
            w, argument = self._within_disc(across, down)
            around, outwards = along_x + 1j * along_y, 4 * (along_x * w.real + along_y * w.imag)
            before, power = np.zeros_like(w), np.ones_like(w)
            for m, found in enumerate(sums):
                found += _jacobi(found.size, 0, m, argument) @ (m * around * before)
                steepness = _steepness(found.size, m)
                found[1:] += steepness * (_jacobi(steepness.size, 1, m + 1, argument) @ (outwards * power))
                before, power = power, power * w
        parts = [(term, sums[term.m][term.k]) for term in terms]
        back = np.array([term.norm * (part.imag if term.sine else part.real) for term, part in parts])
        return back / (self.diameter / 2)

    @property
    def _terms(self) -> list[tuple[int, float]]:
        """Noll's numbers of the terms that are not 0, and their coefficients."""
        return [(j, coefficient) for j, coefficient in enumerate(self.coefficients, start=1) if coefficient != 0]

    def _within_disc(self, x: Array, y: Array) -> tuple[NDArray[np.complex128], Array]:
        """w = (x + iy)/R, and 2ρ² − 1."""
        radius = self.diameter / 2
        return np.asarray((x + 1j * y) / radius, dtype=np.complex128), 2 * (x**2 + y**2) / radius**2 - 1

    @property
    def affine(self) -> Affine | None:
        """A prism, a lens and a cylinder lens, if all terms beyond astigmatism (j = 6) are 0."""
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


@dataclass(frozen=True)
class _Term:
    """One polynomial: its norm × Re or Im of wᵐ × a Jacobi polynomial P_k^(0, m) of 2ρ² − 1, w = (x + iy)/R.

    This form needs no angle and no division by ρ; the rest is evaluated by recurrence.

    Args:
        norm: makes it orthonormal.
        k: (n − m)/2.
        m: angular frequency.
        sine: whether it has the factor sin mθ.
    """

    norm: float
    k: int
    m: int
    sine: bool

    @classmethod
    def of(cls, j: int) -> _Term:
        """Noll's term j."""
        n, m = noll(j)
        return cls(math.sqrt(n + 1 if m == 0 else 2 * (n + 1)), (n - m) // 2, m, m > 0 and j % 2 == 1)


def _jacobi_sums(coefficients: NDArray[np.complex128], m: int, argument: Array) -> tuple[Waves, Waves]:
    """Σₖ cₖ·P_k^(0, m) of Jacobi's polynomials, and its derivative."""
    count = coefficients.size
    if not count:
        return np.zeros(argument.shape, np.complex128), np.zeros(argument.shape, np.complex128)
    value = _weighted(coefficients, _jacobi(count, 0, m, argument))
    steepness = coefficients[1:] * _steepness(count, m)
    return value, _weighted(steepness, _jacobi(count - 1, 1, m + 1, argument))


def _steepness(count: int, m: int) -> Array:
    """Factors of the derivatives of P_1, P_2, …: dP_k^(0, m)/dz = (k + m + 1)/2 · P_(k−1)^(1, m+1)(z)."""
    return (np.arange(1, count) + m + 1) / 2


def _weighted(coefficients: NDArray[np.complex128], polynomials: Array) -> Waves:
    parts = np.stack([coefficients.real, coefficients.imag]) @ polynomials
    return np.asarray(parts[0] + 1j * parts[1], dtype=np.complex128)


def _jacobi(count: int, a: int, b: int, argument: Array) -> Array:
    """The first ``count`` Jacobi polynomials P_k^(a, b), shape (count, places).

    By their recurrence over k (Abramowitz and Stegun, Handbook of Mathematical Functions, 22.7.1).
    """
    found = np.ones((count, argument.size))
    if count > 1:
        found[1] = (a + b + 2) / 2 * argument + (a - b) / 2
    for k in range(1, count - 1):
        twice = 2 * k + a + b
        all_of = 2 * (k + 1) * (k + a + b + 1) * twice
        np.multiply(argument, (twice + 1) * (twice + 2) * twice / all_of, out=found[k + 1])
        found[k + 1] += (twice + 1) * (a * a - b * b) / all_of
        found[k + 1] *= found[k]
        found[k + 1] -= 2 * (k + a) * (k + b) * (twice + 2) / all_of * found[k - 1]
    return found


def noll(j: int) -> tuple[int, int]:
    """(n, m) of Noll's term j = 1, 2, 3, …: radial order and angular frequency, m ≥ 0.

    Even j have the factor cos mθ, odd j sin mθ (Noll 1976, eq. 1).
    """
    n = (math.isqrt(8 * j - 7) - 1) // 2
    place = j - n * (n + 1) // 2  # 1 … n + 1 within the row of order n
    return n, 2 * (place // 2) if n % 2 == 0 else 2 * ((place - 1) // 2) + 1
