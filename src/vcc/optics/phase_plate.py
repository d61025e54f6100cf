"""The phase plate: thin glass of any shape, which deflects rays by the gradient of its optical path."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import parameters_in_words
from vcc.base.errors import InputError
from vcc.base.hints import NoSuchMember
from vcc.base.units import short
from vcc.optics.deflections import Deflection, SlopeFunction, checked_slopes
from vcc.optics.dispersion import Dispersive
from vcc.optics.faces import Faces
from vcc.shapes.patterns import Bounded, Circle, Open, Pattern
from vcc.shapes.surface import Scaled, Surface

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SurfaceDeflection(Deflection):
    """The slopes that a surface adds to rays.

    Args:
        surface: whose optical path deflects rays.
    """

    surface: Surface

    @property
    def affine(self) -> Affine | None:
        """A prism or a lens if the surface's slopes are linear in x and y."""
        return self.surface.affine

    def __call__(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """The gradient of the surface's optical path, validated."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        return checked_slopes(self.surface.slopes(x, y), x, y)

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The surface's own bounds."""
        return self.surface.largest(half_width, half_height)


@dataclass(frozen=True)
class PhasePlate(Dispersive):
    """A thin plate that adds an optical path OPL(x, y): rays are deflected by Δs = ∂OPL/∂x, Δt = ∂OPL/∂y.

    Geometric optics: a ray is deflected, but neither split nor delayed. docs/elements/phase-plate.md explains when
    diffraction matters. Aberrations of a lens are a plate of `vcc.surfaces.Zernike` at the lens's z.

    Args:
        surface: a `vcc.surfaces.Surface`, or a function of (x, y) in metres (arrays of one shape) that returns
            the slopes (Δs, Δt).
        diameter: of a round opening, metres.
        width: of a rectangular opening, metres.
        height: of a rectangular opening, metres; None makes it square.
        glass: None, or what the plate is made of: slopes ∝ n(λ) − 1; see `vcc.optics.dispersion.Dispersive`.
        design_wavelength: metres, at which ``surface`` holds. A surface with a refractive index of its own (a
            height map, a rough surface) is given by heights, and that index must be that of the glass there.

    Without a size, a surface that is defined on a sheet (a height map, a path map, a rough surface) is as large as
    its sheet, and others have no rim. Outside a rim the plate is opaque.

    Raises:
        InputError: a surface of another type, a size of zero or less, a diameter and a width together, a height
            without a width, an opening larger than the surface's sheet, or what is no glass.
    """

    cubic = NoSuchMember("PhasePlate(surfaces.Cubic(strength))")
    zernike = NoSuchMember("PhasePlate(surfaces.Zernike(...))")
    axicon = NoSuchMember("PhasePlate(surfaces.Axicon(...))")

    surface: Surface | Callable[[Array, Array], Any]
    diameter: float | None = field(default=None, metadata={"unit": "length"})
    width: float | None = field(default=None, metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.surface, type) or not (isinstance(self.surface, Surface) or callable(self.surface)):
            given = self.surface.__name__ if isinstance(self.surface, type) else type(self.surface).__name__  # type: ignore[redundant-expr]
            raise InputError(
                f"surface of {self.label} is a vcc.surfaces.Surface, such as Cubic(250.0), or a function of "
                f"(x, y) that returns slopes (Δs, Δt), not {given}"
            )
        checks.opening(self.label, self.width, self.height, self.diameter)
        self._check_that_the_sheet_fills_the_opening()

    def _check_that_the_sheet_fills_the_opening(self) -> None:
        opening = self._size
        if opening is None or not isinstance(self.surface, Surface):
            return
        sheet = self.surface.size
        if any(wanted > known * (1 + 1e-9) for wanted, known in zip(opening, sheet, strict=True)):
            opening_words, sheet_words = (f"{short(size[0])} × {short(size[1])}" for size in (opening, sheet))
            raise InputError(
                f"the opening of {self.label}, {opening_words}, is larger than the sheet of its surface, "
                f"{sheet_words}, and beyond the sheet nothing is known: make the sheet larger or the opening "
                "smaller"
            )

    @property
    def _size(self) -> tuple[float, float] | None:
        """(width, height) of the opening; None if there is no rim."""
        if self.diameter is not None:
            return self.diameter, self.diameter
        if self.width is not None:
            return self.width, self.width if self.height is None else self.height
        if isinstance(self.surface, Surface) and all(map(math.isfinite, self.surface.size)):
            return self.surface.size
        return None

    def faces(self) -> Faces:
        """A deflection, affine if the surface's slopes are linear, and an opening if there is a rim."""
        return Faces(deflection=self._deflection(), transmission=self._opening())

    def _deflection(self) -> Deflection:
        if isinstance(self.surface, Surface):
            return SurfaceDeflection(self.surface)
        return SlopeFunction(_given_whole_arrays(self.surface))

    def _stronger(self, factor: float) -> dict[str, Any]:
        if not isinstance(self.surface, Surface):
            return {"surface": partial(_scaled_slopes, self.surface, factor)}
        index = getattr(self.surface, "refractive_index", None)
        if index is None:
            return {"surface": Scaled(self.surface, factor)}
        return {"surface": replace(self.surface, refractive_index=1 + (index - 1) * factor)}  # type: ignore[type-var]

    def _opening(self) -> Pattern | None:
        if self.diameter is not None:
            return Circle(self.diameter)
        return None if self._size is None else Bounded(Open(), *self._size)

    def described(self) -> str:
        """The surface and the opening as text."""
        if isinstance(self.surface, Surface):
            return super().described()
        name = getattr(self.surface, "__name__", type(self.surface).__name__)
        sizes = parameters_in_words(self, leave_out=("z", "name", "surface"))
        return f"slopes by {name}" + (f", {sizes}" if sizes else "")


def _scaled_slopes(function: Callable[[Array, Array], Any], factor: float, x: Array, y: Array) -> Any:
    s, t = function(x, y)
    return factor * np.asarray(s), factor * np.asarray(t)


def _given_whole_arrays(function: Callable[[Array, Array], Any]) -> Callable[[Array, Array], Any]:
    """The function, called with arrays of one shape, so that (−x/f, −y/f) returns two arrays of that shape."""
    return lambda x, y: function(*np.broadcast_arrays(x, y))
