"""Aberrations of lenses as surfaces: sums of Zernike polynomials."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.shapes.surface import Array, Surface, places


@dataclass(frozen=True)
class Zernike(Surface):
    """Aberrations of a lens as a sum of Zernike polynomials in Noll's order: OPL = Σⱼ aⱼ·Zⱼ(ρ, θ).

    The polynomials are orthonormal over the disc (Noll, Zernike polynomials and atmospheric turbulence, Journal
    of the Optical Society of America 66, 1976, eq. 1 and table I): over it, the root mean square of a path is
    √(Σ aⱼ²) with piston (j = 1) left out. ρ = r/R, and θ runs from x towards y, which is downwards here.

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
        x, y = places(x, y)
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

        x, y = places(x, y)
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
