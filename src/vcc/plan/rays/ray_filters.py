"""A transmission T(x, y, s, t) as a sum of products of functions of place and of slope, Σ aₖ(x, y)·bₖ(s, t).

The terms are slices of T itself, chosen by the cross approximation with full pivoting of a matrix of T at many
places and slopes (Bebendorf 2000). The remainder is measured on rays that were not used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.optics.terms import RayTransmission
from vcc.plan.rays.bounds.extent import RayExtent
from vcc.plan.rays.steps import Bundle, SharesByRay

Array = NDArray[np.float64]

MOST_TERMS = 64
"""Terms of the sum; each costs a ray two look-ups."""
POINTS = 9
"""Binary logarithm of the number of places, and of slopes, among which the slices are chosen."""
REMAINDER = 1e-4
"""Largest remainder at these points, as a share of the largest value, below which no term is added."""
RAYS = 12
"""Binary logarithm of the number of rays on which the error is measured."""
VALUES = 5_000_000
"""Largest number of values of a texture: all terms at all points."""
SIZES = (65, 129, 257, 513, 1025, 2049)
"""Points a side of the textures, tried until they are fine enough."""


@dataclass(frozen=True, eq=False, repr=False)
class Slices(Brief):
    """The functions aₖ and bₖ.

    Args:
        share: T, of rays (..., 4) from the element's middle.
        places: (terms, 2), of the slices over slopes.
        slopes: (terms, 2), of the slices over places.
        lower: (terms, terms), lower triangular with ones on its diagonal.
        upper: (terms, terms), upper triangular: ``lower`` @ ``upper`` is T at ``places`` and ``slopes``.
    """

    share: Callable[[Array], Array]
    places: Array
    slopes: Array
    lower: Array
    upper: Array

    @classmethod
    def of(cls, transmission: RayTransmission, places: Box, slopes: Box) -> Slices:
        """Slices that represent a transmission over boxes of places and slopes.

        Args:
            transmission: T.
            places: lowest and highest (x, y), metres from the element's middle.
            slopes: lowest and highest (s, t).

        Raises:
            InputError: T returns invalid values.
        """
        from scipy.stats import qmc  # slow to import

        x, s = (
            low + (high - low) * qmc.Sobol(2, seed=number).random_base2(POINTS)
            for number, (low, high) in enumerate((places, slopes))
        )
        left = transmission.share(_paired(x, s)).copy()
        least = REMAINDER * left.max()
        rows: list[int] = []
        columns: list[int] = []
        over_places: list[Array] = []
        over_slopes: list[Array] = []
        while len(rows) < MOST_TERMS:
            row, column = map(int, np.unravel_index(np.argmax(np.abs(left)), left.shape))
            pivot = left[row, column]
            if abs(pivot) <= least and rows:
                break
            rows.append(row)
            columns.append(column)
            over_places.append(left[:, column] / pivot if pivot else np.ones(len(x)))
            over_slopes.append(left[row].copy())
            left -= np.outer(over_places[-1], over_slopes[-1])
        lower, upper = np.stack(over_places, axis=1)[rows], np.stack(over_slopes)[:, columns]
        if not upper.any():  # T is 0: any one term with a coefficient of 0
            upper = np.ones((1, 1))
        return cls(transmission.share, x[rows], s[columns], np.tril(lower), np.triu(upper))

    @property
    def sizes(self) -> tuple[int, ...]:
        """Points a side of textures of these slices."""
        return tuple(size for size in SIZES if size**2 * len(self.places) <= VALUES)

    def by_place(self, x: Array, y: Array, _: tuple[float, float]) -> Array:
        """aₖ at places, broadcast: (..., terms)."""
        from scipy.linalg import solve_triangular

        places = np.stack(np.broadcast_arrays(x, y), axis=-1)
        values = np.stack([self.share(_joined(places, slope)) for slope in self.slopes], axis=-1)
        solved = solve_triangular(self.upper, values.reshape(-1, len(self.slopes)).T, trans="T")
        return np.asarray(solved.T.reshape(values.shape))

    def by_slope(self, s: Array, t: Array, _: tuple[float, float]) -> Array:
        """bₖ at slopes, broadcast: (..., terms)."""
        from scipy.linalg import solve_triangular

        slopes = np.stack(np.broadcast_arrays(s, t), axis=-1)
        values = np.stack([self.share(_joined(place, slopes)) for place in self.places], axis=-1)
        flat = values.reshape(-1, len(self.places)).T
        return np.asarray(
            solve_triangular(self.lower, flat, lower=True, unit_diagonal=True).T.reshape(values.shape)
        )


Box = tuple[Array, Array]


def rays_within(extent: RayExtent, middle: tuple[float, float], places: Box) -> Array:
    """Rays of an extent that lie within a box of places, (rays, 4), from the element's middle."""
    from scipy.stats import qmc

    columns = np.concatenate([extent.basis, extent.loose], axis=1)
    drawn = qmc.Sobol(columns.shape[1], seed=2).random_base2(RAYS) * 2 - 1
    rays = extent.middle + drawn @ columns.T - [*middle, 0.0, 0.0]
    inside = (rays[:, :2] >= places[0]) & (rays[:, :2] <= places[1])
    return np.asarray(rays[inside.all(axis=1)])


def missed(step: SharesByRay, transmission: RayTransmission, rays: Array, middle: tuple[float, float]) -> float:
    """By how much a step misses T on rays (n, 4) from the element's middle.

    Root mean square, as a share of the largest value.
    """
    truth = transmission.share(rays)
    x, y, s, t = np.add(rays, [*middle, 0.0, 0.0]).T
    found = Bundle(x, y, s, t, np.ones(len(rays)), np.zeros(0))
    step(found)
    return float(np.sqrt(np.mean((found.share - truth) ** 2))) / max(float(truth.max()), 1e-300)


def _paired(places: Array, slopes: Array) -> Array:
    """All pairs, (places, slopes, 4)."""
    return _joined(places[:, None], slopes)


def _joined(places: Array, slopes: Array) -> Array:
    shape = np.broadcast_shapes(places.shape, slopes.shape)
    return np.concatenate([np.broadcast_to(places, shape), np.broadcast_to(slopes, shape)], axis=-1)
