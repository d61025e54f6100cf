"""Surfaces of phase plates: the optical path that a thin plate adds, as a function of position.

A thin plate of height h(x, y) and refractive index n in air adds the optical path OPL = (n − 1)·h. Rays are
normal to wavefronts, so the plate adds the path's gradient to their slopes, (Δs, Δt) = (∂OPL/∂x, ∂OPL/∂y):
light bends towards the thicker glass (Born and Wolf, Principles of Optics, section 3.1, for small slopes). Only
differences of path matter; a constant has no effect. Positions (x, y) are in metres relative to the surface's own
middle, x right and y down, and slopes have no unit.
"""

from __future__ import annotations

import abc
import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.affine import Affine
from vcc.base.describe import kind_in_words, parameters_in_words, with_parameters
from vcc.base.showing import Shown

Array = NDArray[np.float64]

RASTER = 257
"""Points a side at which slopes are sampled to estimate their maximum, if there is no closed form."""


class Surface(Shown, abc.ABC):
    """The optical path that a thin plate adds, by position. Final classes are frozen dataclasses of SI numbers.

    Subclasses define `path` and `slopes`; the rest is optional. If slopes are linear in a field of many numbers,
    name the field in ``linear_in`` and define `slopes_back`: all of its numbers are then learned at once,
    instead of with two plans for each.

    Attributes:
        linear_in: of the class, the field that `slopes` are linear in; None without `slopes_back`.
    """

    linear_in: ClassVar[str | None] = None

    @abc.abstractmethod
    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """OPL in metres at positions x, y in metres (arrays that broadcast against each other)."""

    @abc.abstractmethod
    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(Δs, Δt) = (∂OPL/∂x, ∂OPL/∂y), added to the slopes of rays at positions x, y in metres (broadcast)."""

    def slopes_back(self, x: Array, y: Array, weights: tuple[Array, Array]) -> Array:
        """The transpose of `slopes`: the gradient of Σ weights[0]·Δs + Σ weights[1]·Δt to ``linear_in``.

        Args:
            x: columns of a grid of places, (1, n), metres.
            y: rows, (m, 1).
            weights: two arrays (m, n).

        Returns:
            Of the field's shape.
        """
        raise NotImplementedError(f"slopes of {type(self).__name__} are not stated to be linear in anything")

    @property
    def affine(self) -> Affine | None:
        """The deflection as a 5×5 map of rays if the slopes are linear in x and y, else None."""
        return None

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) in metres outside which the surface is undefined; infinite if there is no bound."""
        return math.inf, math.inf

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """Bounds of (|Δs|, |Δt|) over the rectangle of these half sizes around the middle, metres.

        Default: the largest values on a raster of 257×257 points, edges included, plus 5 %.
        """
        x = np.linspace(-half_width, half_width, RASTER)
        y = np.linspace(-half_height, half_height, RASTER)
        s, t = self.slopes(x[None, :], y[:, None])
        return 1.05 * float(np.abs(s).max()), 1.05 * float(np.abs(t).max())

    def described(self) -> str:
        """The surface as text, such as ``"quadratic (focal length 50 mm)"``."""
        return with_parameters(kind_in_words(type(self)), parameters_in_words(self))


@dataclass(frozen=True)
class Scaled(Surface):
    """A surface whose optical path is some times as long: the same glass at another wavelength.

    Args:
        surface: what is scaled.
        factor: of its path.
    """

    surface: Surface
    factor: float

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The path of the surface times the factor, metres."""
        return self.factor * self.surface.path(x, y)

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """The slopes of the surface times the factor."""
        s, t = self.surface.slopes(x, y)
        return self.factor * s, self.factor * t

    @property
    def affine(self) -> Affine | None:
        """The scaled deflection where that of the surface is affine."""
        given = self.surface.affine
        return None if given is None else Affine(np.eye(5) + self.factor * (given.matrix - np.eye(5)))

    @property
    def size(self) -> tuple[float, float]:
        """Of the surface."""
        return self.surface.size

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The bounds of the surface times the factor."""
        s, t = self.surface.largest(half_width, half_height)
        return abs(self.factor) * s, abs(self.factor) * t


def places(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Positions as float64 arrays of one shape."""
    x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
    return x, y
