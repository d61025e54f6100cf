"""How a thin element scatters light by position: the paper's third category (section 3.2.2, eq. 6)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.kernels import Kernel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scatter:
    """What a scatterer does by position: one kernel, or kernels mixed and stretched over the surface.

    D(δ | x, y) = Σₙ weightₙ(x, y) · Dₙ(δ / width(x, y)) / width(x, y)².

    Args:
        kernels: the kernels Dₙ.
        weights: function of (x, y) in metres that returns the kernels' shares, shape (..., n), summing to 1;
            None where there is one kernel.
        width: function of (x, y) in metres that returns the factor by which the kernels are stretched, 0 or
            more; None stretches nothing.
        largest_width: the largest value that ``width`` takes.
    """

    kernels: tuple[Kernel, ...]
    weights: Callable[[Array, Array], Array] | None = None
    width: Callable[[Array, Array], Array] | None = None
    largest_width: float = 1.0

    @property
    def uniform(self) -> bool:
        """Whether the kernel is the same everywhere."""
        return self.weights is None and self.width is None

    @property
    def reach(self) -> tuple[float, float]:
        """(|δs|, |δt|) beyond which no kernel reaches."""
        reaches = np.array([kernel.reach for kernel in self.kernels]) * self.largest_width
        s, t = reaches.max(axis=0)
        return float(s), float(t)
