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
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.affine import Affine
from vcc.base.describe import kind_in_words, parameters_in_words, with_parameters
from vcc.base.showing import Shown

Array = NDArray[np.float64]

RASTER = 257
"""Points a side at which slopes are looked at for their largest, where no closed form is known."""


class Surface(Shown, abc.ABC):
    """The optical path that a thin plate adds, by position. Final classes are frozen dataclasses of SI numbers.

    Yours needs `path` and `slopes`; the rest follows. Where slopes are linear in a field of many numbers, name it
    in ``linear_in`` and write `slopes_back`: they are then learned all at once, not by two plans for each of them.

    Attributes:
        linear_in: of the class, the field that `slopes` are linear in; None where there is no `slopes_back`.
    """

    linear_in: ClassVar[str | None] = None

    @abc.abstractmethod
    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """OPL in metres at positions x, y in metres (arrays that broadcast against each other)."""

    @abc.abstractmethod
    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(Δs, Δt) = (∂OPL/∂x, ∂OPL/∂y), which rays gain at positions x, y in metres (broadcast)."""

    def slopes_back(self, x: Array, y: Array, weights: tuple[Array, Array]) -> Array:
        """The transpose of `slopes`: what each number of ``linear_in`` adds to Σ weights[0]·Δs + Σ weights[1]·Δt.

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


def places(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Positions as float64 arrays of one shape."""
    x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
    return x, y
