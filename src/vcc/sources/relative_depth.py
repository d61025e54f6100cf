"""Distances in metres from a depth map without a scale, such as that of a network for single pictures."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError, ResultWarning

Array = NDArray[np.float64]
LinearIn = Literal["inverse distance", "distance"]


@dataclass(frozen=True, eq=False, repr=False)
class FittedDepth(Brief):
    """Distances fitted to a relative depth map.

    Args:
        distances: metres, (rows, columns); infinite where the fit lies beyond infinity.
        scale: factor of the map.
        shift: added to it; 1/m or m, like the scale.
        errors: relative errors of the distances at the known points, in their order: fitted/known − 1.
        beyond: share of the pixels that lie beyond infinity.
    """

    distances: Array
    scale: float
    shift: float
    errors: Array
    beyond: float


def fitted_depth(
    relative: ArrayLike, known: Mapping[tuple[int, int], float], *, linear_in: LinearIn = "inverse distance"
) -> FittedDepth:
    """Distances from a depth map that is right up to a scale and a shift, fitted to known distances.

    1/Z = scale·map + shift (or Z, see ``linear_in``), by least squares of relative errors. Networks for single
    pictures that estimate disparity or "inverse depth" are linear in 1/Z (Ranftl et al. 2022).

    Args:
        relative: the map, (rows, columns).
        known: distances in metres along the axis at pixels (row, column), two or more, of different values in the
            map.
        linear_in: whether the map is linear in the inverse distance, or in the distance.

    Returns:
        Distances for `vcc.sources.DepthMapScene`. With two points the errors are 0, which says nothing: measure
        more.

    Warns:
        ResultWarning: the fit misses a known distance by more than 10 %, or pixels lie beyond infinity.

    Raises:
        InputError: a map that is not 2-D and finite, fewer than two points, a point outside of the map, a distance
            that is not above 0, points of the same value, or a fitted distance of zero or less at a point.
    """
    checks.one_of("linear_in", linear_in, get_args(LinearIn))
    given = np.asarray(relative, np.float64)
    if given.ndim != 2 or not np.isfinite(given).all():
        raise InputError(f"a relative depth map has finite numbers of shape (rows, columns), not {given.shape}")
    if len(known) < 2:
        raise InputError(f"scale and shift need two known distances or more, not {len(known)}")
    for row, column in known:
        if not (0 <= row < given.shape[0] and 0 <= column < given.shape[1]):
            raise InputError(f"the known point {(row, column)} is outside of a map of {given.shape} pixels")
    true = np.array([checks.above_zero(f"the distance at {place}", z) for place, z in known.items()])
    values = given[tuple(np.array(list(known)).T)]
    if np.ptp(values) <= 1e-9 * np.abs(given).max():
        raise InputError("the map has the same value at all known points: give points at different distances")
    inverse = linear_in == "inverse distance"
    weights, wanted = (true, 1 / true) if inverse else (1 / true, true)
    system = np.stack([values, np.ones_like(values)], axis=1) * weights[:, None]
    scale, shift = np.linalg.lstsq(system, wanted * weights, rcond=None)[0]
    fitted = scale * given + shift
    at_points = scale * values + shift
    if (at_points <= 0).any():
        row, column = list(known)[int(np.argmin(at_points))]
        raise InputError(
            f"the fit has no positive distance at the known point {(row, column)}: the map is not linear in the "
            f"{linear_in}, or a point is wrong"
        )
    if not inverse and (fitted <= 0).any():
        raise InputError(f"{(fitted <= 0).mean():.1%} of the pixels have a fitted distance of zero or less")
    errors = (1 / at_points if inverse else at_points) / true - 1
    beyond = float((fitted <= 0).mean())
    distances = np.where(fitted > 0, 1 / np.where(fitted > 0, fitted, 1), np.inf) if inverse else fitted
    said = [f"{beyond:.1%} of the pixels lie beyond infinity and are taken as infinitely far"] if beyond else []
    if np.abs(errors).max() > 0.1:
        place = list(known)[int(np.argmax(np.abs(errors)))]
        said.insert(0, f"the distance at {place} is missed by {np.abs(errors).max():.0%}")
    if said:
        warnings.warn(f"fitted depth: {'; '.join(said)}", ResultWarning, stacklevel=2)
    return FittedDepth(np.asarray(distances), float(scale), float(shift), errors, beyond)
