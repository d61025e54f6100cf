"""Transmission by direction: patterns of affine functions of the ray, each a mask in a plane of its own.

A transmission is a product of terms g(A·(x, y, s, t)). Completed to an invertible map of rays, A leads to a plane
in which the term is an ordinary mask, and its inverse leads back. So plans, gradients and drawings treat a term as
a mask.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.values import Value
from vcc.shapes.patterns import Pattern, as_pattern, as_transmission

Array = NDArray[np.float64]

PLACE = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0))
"""The numbers of a position mask: (x, y)."""
SLOPE = ((0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
"""The numbers of an angle filter: (s, t), as metres on a sheet one metre away."""


@dataclass(frozen=True, eq=False)
class RayTransmission(Value):
    """A transmission by place and direction at once: any function of four numbers.

    Args:
        function: T(x, y, s, t), of places in metres from the element's middle and slopes of the arriving ray,
            arrays of one shape; returns the share of light that passes, 0 to 1.
        owner: the element, named in errors of the function.
    """

    function: Callable[[Array, Array, Array, Array], ArrayLike]
    owner: str = ""

    def share(self, rays: Array) -> Array:
        """The share of light that passes, of rays (..., 4) about the element's middle.

        Raises:
            InputError: the function returns another shape, or numbers outside 0 to 1.
        """
        x, y, s, t = np.moveaxis(rays, -1, 0)
        name = f"transmission {getattr(self.function, '__name__', repr(self.function))}"
        name = f"{self.owner}: {name}" if self.owner else name
        return as_transmission(name, self.function(x, y, s, t), x.shape)


@dataclass(frozen=True, eq=False)
class Term(Value):
    """One factor of a transmission: a pattern of two numbers that are affine in the arriving ray.

    Args:
        pattern: transmission as a function of the two numbers: a `vcc.patterns.Pattern`, or a function of two
            arrays.
        of: A, 2×4, or 2×5 with an offset: the two numbers are A·(x, y, s, t[, 1]), with x, y in metres from the
            element's middle and slopes s, t.

    Raises:
        InputError: another shape, numbers that are not finite, or rows that depend on each other.
    """

    pattern: Pattern | Callable[[Array, Array], ArrayLike]
    of: ArrayLike = PLACE

    def __post_init__(self) -> None:
        object.__setattr__(self, "pattern", as_pattern(self.pattern))
        try:
            given = np.asarray(self.of, dtype=np.float64)
        except (TypeError, ValueError):
            given = np.zeros(0)
        if given.shape not in ((2, 4), (2, 5)):
            raise InputError(
                "a term's `of` is a 2×4 array A (or 2×5 with an offset): its pattern is a function of A·(x, y, "
                "s, t)"
            )
        checks.all_finite("a term's `of`", given)
        matrix = np.zeros((2, 5))
        matrix[:, : given.shape[1]] = given
        size = np.abs(matrix[:, :4]).max(axis=1)
        if size.min() == 0 or np.linalg.svd(matrix[:, :4] / size[:, None])[1][1] < 1e-9:
            raise InputError(f"the rows of a term's `of` must be independent of each other, not {matrix.tolist()}")
        matrix.flags.writeable = False
        object.__setattr__(self, "of", matrix)

    @classmethod
    def of_slopes(cls, pattern: Pattern | Callable[[Array, Array], ArrayLike]) -> Term:
        """A pattern of the slopes (s, t); a length of 1 m in the pattern is a slope of 1."""
        return cls(pattern, SLOPE)

    @classmethod
    def behind(cls, pattern: Pattern | Callable[[Array, Array], ArrayLike], distance: float) -> Term:
        """A pattern ``distance`` metres behind the element: of (x + distance·s, y + distance·t)."""
        return cls(pattern, ((1, 0, distance, 0), (0, 1, 0, distance)))

    def share(self, rays: Array) -> Array:
        """The share of light that passes, of rays (..., 4) about the element's middle."""
        matrix = np.asarray(self.of)
        seen = rays @ matrix[:, :4].T + matrix[:, 4]
        return np.asarray(self.pattern(seen[..., 0], seen[..., 1]), dtype=np.float64)

    @property
    def steepest(self) -> tuple[float, float]:
        """The largest slopes (s, t) that pass at the element's middle; infinite if unbounded."""
        by_slope = np.asarray(self.of)[:, 2:4]
        half = np.array(self.pattern.size) / 2  # type: ignore[union-attr]
        bounds = np.full((2, 2), np.inf)
        np.divide(half[:, None], np.abs(by_slope), out=bounds, where=by_slope != 0)
        s, t = bounds.min(axis=0).tolist()
        return s, t

    @property
    @cached
    def to_plane(self) -> Affine:
        """The map of rays, about the element's middle, to the plane in which the pattern is a mask."""
        matrix = np.asarray(self.of)
        pairs = list(itertools.combinations(range(4), 2))
        size = np.abs(matrix[:, :4]).max(axis=1, keepdims=True)
        completed = [np.vstack([matrix[:, :4] / size, np.eye(4)[list(pair)]]) for pair in pairs]
        best = pairs[int(np.argmax([abs(np.linalg.det(one)) for one in completed]))]
        linear = np.vstack([matrix[:, :4], np.eye(4)[list(best)]])
        return Affine.from_parts(linear, [*matrix[:, 4], 0.0, 0.0])

    @property
    def mixes(self) -> bool:
        """Whether the two numbers see place and slope along different axes, as (x, h·s) does.

        A mask at some distance sees x and s by its first number, y and t by its second, perhaps rotated:
        footprints of samples are rectangles or parallelograms in its plane. Otherwise they can be lines, and rays
        are traced.
        """
        parts = [np.asarray(self.of)[:, :2], np.asarray(self.of)[:, 2:4]]
        if not any(part[[0, 1], [1, 0]].any() for part in parts):
            return False
        scaled = [part / np.abs(part).max() for part in parts if part.any()]
        return any(abs(float(np.linalg.det(part))) < 1e-9 for part in scaled)
