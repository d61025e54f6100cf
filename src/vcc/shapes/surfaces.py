"""Surfaces in closed form, and the other surfaces by name; see `vcc.shapes.surface` for definitions."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.shapes.height_maps import HeightMap as HeightMap
from vcc.shapes.height_maps import PathMap as PathMap
from vcc.shapes.height_maps import Rough as Rough
from vcc.shapes.height_maps import Sheet as Sheet
from vcc.shapes.surface import Array, places
from vcc.shapes.surface import Surface as Surface
from vcc.shapes.zernike import Zernike as Zernike
from vcc.shapes.zernike import noll as noll


@dataclass(frozen=True)
class Quadratic(Surface):
    """A paraboloid, equivalent to a thin lens: OPL = −r²/2f, Δs = −x/f, Δt = −y/f.

    Args:
        focal_length: metres; negative for a diverging lens.

    Raises:
        InputError: a focal length of 0 or NaN.
    """

    focal_length: float = field(metadata={"unit": "length"})

    def __post_init__(self) -> None:
        checks.not_zero("focal_length of a quadratic surface", self.focal_length)

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """−r²/2f, metres."""
        x, y = places(x, y)
        return -(x * x + y * y) / (2 * self.focal_length)

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(−x/f, −y/f)."""
        x, y = places(x, y)
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
    """A wedge, equivalent to a thin prism: OPL = δs·x + δt·y.

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
        x, y = places(x, y)
        return self.deflection[0] * x + self.deflection[1] * y

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(δs, δt) everywhere."""
        x, y = places(x, y)
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
        """The plate of phase α·((x/R)³ + (y/R)³), in the notation of Dowski and Cathey.

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
        x, y = places(x, y)
        return self.strength * (x**3 + y**3)

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(3·strength·x², 3·strength·y²)."""
        x, y = places(x, y)
        return 3 * self.strength * x**2, 3 * self.strength * y**2

    @property
    def affine(self) -> Affine | None:
        """The identity if the strength is 0."""
        return Affine.identity() if self.strength == 0 else None

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The slopes at the edges."""
        return 3 * abs(self.strength) * half_width**2, 3 * abs(self.strength) * half_height**2

    def described(self) -> str:
        """The strength with its unit."""
        return f"cubic (strength {self.strength:g} /m²)"


@dataclass(frozen=True)
class Axicon(Surface):
    """A cone: OPL = −slope·r, so that every ray is deflected towards the axis by the same slope.

    At r = 0, where a cone has no gradient, the deflection is 0. (McLeod, The axicon: a new type of optical
    element, Journal of the Optical Society of America 44, 1954.)

    Args:
        slope: dimensionless; negative deflects rays away from the axis. A cone of base angle γ and index n has
            about (n − 1)·γ.

    Raises:
        InputError: not a finite number.
    """

    slope: float

    def __post_init__(self) -> None:
        checks.finite("slope of an axicon", self.slope)

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """−slope·r, metres."""
        return -self.slope * np.hypot(*places(x, y))

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """−slope·(x, y)/r."""
        x, y = places(x, y)
        r = np.hypot(x, y)
        r = np.where(r == 0, 1.0, r)  # x and y are 0 there, and so are the slopes
        return -self.slope * (x / r), -self.slope * (y / r)

    @property
    def affine(self) -> Affine | None:
        """The identity if the slope is 0."""
        return Affine.identity() if self.slope == 0 else None

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The slope, along both axes."""
        return abs(self.slope), abs(self.slope)
