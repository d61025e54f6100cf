"""Scatter kernels: how a diffuser spreads a ray over slopes (paper, section 3.2.2).

A kernel D(δs, δt) is the share of light that leaves with its slope changed by (δs, δt); its integral is 1, so
that light is spread and none is lost.
"""

from __future__ import annotations

import abc

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Kernel(abc.ABC):
    """A probability density D(δs, δt) over changes of slope, zero beyond its reach; a frozen dataclass."""

    @property
    @abc.abstractmethod
    def reach(self) -> tuple[float, float]:
        """(|δs|, |δt|) beyond which the kernel is zero."""

    @abc.abstractmethod
    def deflections(self, xi: Array, eta: Array) -> tuple[Array, Array]:
        """Changes of slope (δs, δt) for places (ξ, η) of the unit square, which they map onto the kernel.

        Equal areas of the square go to equal shares of light: evenly spread (ξ, η) give deflections of the
        kernel's density (inverse transform sampling).
        """

    @abc.abstractmethod
    def density(self, s: ArrayLike, t: ArrayLike) -> Array:
        """D at changes of slope (s, t), per unit of slope squared; it integrates to 1."""

    def quadrature(self, points: int = 256) -> tuple[Array, Array]:
        """Changes of slope (n, 2) and their shares (n,), which sum to 1: the kernel as a sum of that many rays.

        Args:
            points: along each axis of the unit square; the square's cells carry equal shares.
        """
        middle = (np.arange(points) + 0.5) / points
        xi, eta = (axis.ravel() for axis in np.meshgrid(middle, middle))
        s, t = self.deflections(xi, eta)
        return np.stack([s, t], axis=-1), np.full(xi.size, 1.0 / xi.size)

    def described(self) -> str:
        """The kernel in words."""
        from vcc.describe import parameters_in_words

        parameters = parameters_in_words(self)
        name = type(self).__name__.removesuffix("Kernel").lower()
        return f"{name} ({parameters})" if parameters else name
