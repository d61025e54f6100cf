"""Views made sharper before rays look them up, by as much as looking up will soften them.

A ray interpolates linearly between the samples of a view. Seen from places all over a sample, that averages the
view with a tent, which takes 1 − sinc²(f) of a cosine of f cycles a sample: 3 % at 0.1, 7 % at 0.15. Where a
sample is itself a mean over its pixel, light that is averaged over a sensor's pixel is averaged a second time, and
loses 1 − sinc(f) more. A short symmetric filter along k and along l gives that back beforehand. With Δ the second
difference along an axis, whose factor is −4 sin²(πf), 1/sincᵖ(f) is, to the fourth order in f,

    1 − (p/24) Δ + (p(p + 1)/1152 − p/1920 + p/288) Δ².

Beyond a view's border its last samples go on, so that what is even stays even.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.engines.late import compiled
from vcc.fields.sampled import to_dtype
from vcc.plan.rays.model import RayPlan
from vcc.plan.rays.sharpening import DIGITS, REACH

KEPT_DIGITS = 5
"""Binary digits after the point with which 8-bit samples are kept in 16 bits: 2⁻⁵ of a level, sixteen times finer
than they were rounded, with room for values 4 times the range (the filter's are at most 3.4 times)."""


def sharpened(plan: RayPlan, values: Any, engine: str, threads: int | None = None) -> tuple[RayPlan, Any]:
    """Samples as the plan wants them looked up, and the plan that looks those up as they are.

    Args:
        plan: with or without a filter of the views.
        values: samples (v, u, t, s[, channels]).
        engine: ``"numba"``, ``"array_api"`` or ``"reference"``.
        threads: how many ``"numba"`` takes; None takes `vcc.plan.how.cores`. The samples are the same.

    Returns:
        The plan and the samples themselves where there is no filter; else new samples of type `kept_as`, with
        ``"reference"`` float64, and the plan without filter, its scale that of the new samples.
    """
    if plan.sharpening is None:
        return plan, values
    once = replace(plan, sharpening=None, scale=plan.scale * (2.0**-KEPT_DIGITS if _is_small(values) else 1.0))
    if engine == "numba":
        return once, compiled("vcc.engines.sharpening_kernels").filtered(plan.sharpening, values, threads)
    return once, _in_library(plan.sharpening, values, engine == "reference")


def kept_as(plan: RayPlan, kind: np.dtype[Any]) -> np.dtype[Any]:
    """The type in which samples of a type are traced by the compiled engine: none in half precision."""
    if plan.sharpening is None:
        return np.dtype(np.float32) if kind == np.float16 else kind
    if kind == np.uint8:
        return np.dtype(np.int16)
    return np.dtype(np.float64) if kind == np.float64 else np.dtype(np.float32)


def _is_small(values: Any) -> bool:
    return bool(to_dtype(values) == np.uint8)


def _in_library(weights: tuple[int, int, int], values: Any, double: bool) -> Any:
    """The same on arrays of any library, differentiable; whole numbers exactly the same."""
    from array_api_compat import array_namespace

    xp = array_namespace(values)
    if _is_small(values):
        filtered = xp.astype(values, xp.int32)
        for axis in (3, 2):
            filtered = _along(xp, filtered, axis, weights)
        left = 2 * DIGITS - KEPT_DIGITS
        return xp.astype(
            xp.bitwise_right_shift(filtered + 2 ** (left - 1), xp.asarray(left, dtype=xp.int32)), xp.int16
        )
    wide = double or to_dtype(values) == np.float64
    filtered = xp.astype(values, xp.float64 if wide else xp.float32)
    factors = tuple(weight * 2.0**-DIGITS for weight in weights)
    for axis in (3, 2):
        filtered = _along(xp, filtered, axis, factors)
    return filtered


def _along(xp: Any, values: Any, axis: int, weights: tuple[Any, ...]) -> Any:
    """Σ weights[|n|] · values moved by n along an axis, the last ones going on."""
    size = values.shape[axis]
    total = values * weights[0]
    for n in range(1, REACH + 1):
        for moved in (-n, n):
            place = np.clip(np.arange(size) + moved, 0, size - 1)
            total = total + weights[n] * xp.take(values, _indices(xp, values, place), axis=axis)
    return total


def _indices(xp: Any, values: Any, place: NDArray[np.int64]) -> Any:
    from array_api_compat import device

    return xp.asarray(place, device=device(values))
