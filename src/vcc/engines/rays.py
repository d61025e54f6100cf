"""Running a ray plan: by the compiled kernel, or plainly in NumPy, or on arrays of any library with gradients.

All three trace the same rays. The plain way is the plan's own (`RayPlan.looked_up`); it defines what is correct.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError, ResultWarning
from vcc.engines.late import compiled
from vcc.engines.sharpening import sharpened
from vcc.fields.sampled import known, to_dtype
from vcc.plan.rays.model import TABLE, CellWindows, RayPlan

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

RAYS_AT_ONCE = 2**17
"""Rays that are traced at once in NumPy: some tens of MiB."""


@dataclass(frozen=True, eq=False)
class Traced:
    """What a run of a ray plan found.

    Args:
        values: irradiance, (rows, columns[, channels]) float32.
        sampling_error: root mean square over the pixels of the picture's estimated error from sampling, in units
            of the values.
        missing_rays: the share of the light asked for that the light field does not hold.
        rays: how many rays were traced.
        samples: rays a pixel.
    """

    values: Any
    sampling_error: float
    missing_rays: float
    rays: int
    samples: int


def run(
    plan: RayPlan,
    values: Any,
    engine: str,
    tolerance: float | None = None,
    progress: Progress | None = None,
    threads: int | None = None,
) -> Traced:
    """The picture of samples (v, u, t, s[, channels]) by a ray plan.

    Args:
        plan: what to trace.
        values: the light field's samples.
        engine: ``"numba"``, ``"array_api"`` or ``"reference"``.
        tolerance: double the samples until the sampling error is at most this share of the picture's mean; None
            takes the plan's samples.
        progress: called with (done, total) in tiles or pieces; with a tolerance the total is that of a round.
        threads: how many the compiled engine takes; None takes `vcc.plan.how.cores`. The picture is the same.
    """
    once = _way(engine, threads)
    plan, values = sharpened(plan, values, engine, threads)
    traced = once(plan, values, 0, progress)
    round_number = 0
    while tolerance is not None and traced.sampling_error > tolerance * abs(_mean(traced.values)):
        if traced.samples * 2 > TABLE:
            warn_of_error(traced.sampling_error / abs(_mean(traced.values)), traced.samples, tolerance, 5)
            break
        round_number += 1
        # As many rays again, from the block beside the ones taken: together they are one larger even set.
        more = once(_doubled(plan, round_number), values, 1, progress)
        difference = traced.values - more.values
        traced = Traced(
            values=(traced.values + more.values) / 2,
            sampling_error=float(_mean(difference * difference)) ** 0.5 / 2,
            missing_rays=(traced.missing_rays + more.missing_rays) / 2,
            rays=traced.rays + more.rays,
            samples=2 * traced.samples,
        )
    return traced


def check_tolerance(tolerance: float | None, by_rays: bool) -> None:
    """Refuse a tolerance that is not one.

    Raises:
        InputError: it is for pictures by rays only, and a number above 0.
    """
    if tolerance is None:
        return
    if not by_rays:
        raise InputError("tolerance is for pictures made by rays; footprints have no sampling error")
    if not tolerance > 0:
        raise InputError(f"tolerance is a share of the picture's mean, greater than 0, not {tolerance}")


def warn_of_error(error: float, samples: int, tolerance: float, stacklevel: int) -> None:
    """Say that the most rays that there are do not reach a tolerance; the error is a share of the mean."""
    warnings.warn(
        f"the sampling error is {error:.2g} of the picture's mean after {samples} rays a pixel, the most there "
        f"are; {tolerance:g} was asked for",
        ResultWarning,
        stacklevel=stacklevel,
    )


def _way(engine: str, threads: int | None) -> Callable[..., Traced]:
    """What traces one round of a plan's rays: a function of (plan, values, blocks beside, progress)."""
    if engine == "numba":
        return partial(compiled("vcc.engines.rays_compiled").traced, threads=threads)
    return partial(_in_library, double=engine == "reference")


def _doubled(plan: RayPlan, round_number: int) -> RayPlan:
    return replace(plan, samples=plan.samples * 2 ** (round_number - 1))


def _mean(values: Any) -> float:
    numbers = known(values)
    return float("nan") if numbers is None else float(np.mean(numbers, dtype=np.float64))


# --- plain, on arrays of any library ---


def _in_library(plan: RayPlan, values: Any, beside: int, progress: Progress | None, *, double: bool) -> Traced:
    """The plan's own rays; places and weights are NumPy numbers, samples may be arrays of any library."""
    from array_api_compat import array_namespace

    xp = array_namespace(values)
    channels = values.shape[4] if values.ndim == 5 else 1
    wide = double or to_dtype(values) == np.float64
    working = xp.float64 if wide else xp.float32
    samples = xp.reshape(xp.astype(values, working), (-1, channels))
    rows, columns = plan.sensor_shape
    pieces, halves = [], []
    weights, missing, rays = 0.0, 0.0, 0
    for pixel in _pieces(plan):
        index, share = plan.looked_up(pixel, plan.block(pixel) ^ beside)
        inside, held = plan.held(index)
        weights += float((share * (inside | plan.views_may_end)).sum())
        missing += float((share * (~held) * (inside | plan.views_may_end)).sum())
        rays += int(np.count_nonzero(share))
        found = _found(plan, xp, samples, index, share * inside, working)  # (pixels, cells, samples, channels)
        half = plan.samples // 2
        one, two = xp.sum(found[:, :, :half, :], axis=(1, 2)), xp.sum(found[:, :, half:, :], axis=(1, 2))
        pieces.append((one + two) * plan.scale)
        halves.append((one - two) * plan.scale)
        if progress is not None:
            progress(int(pixel[-1]) + 1, rows * columns)
    picture = xp.astype(xp.reshape(xp.concat(pieces, axis=0), (rows, columns, channels)), xp.float32)
    difference = xp.concat(halves, axis=0)
    error = _mean(difference * difference) ** 0.5
    share_missing = missing / weights if weights > 0 else 0.0
    return Traced(picture if values.ndim == 5 else picture[:, :, 0], error, share_missing, rays, plan.samples)


def _pieces(plan: RayPlan) -> Iterator[NDArray[np.int64]]:
    """Numbers of pixels, some at a time."""
    cells = 1
    if isinstance(plan.aim, CellWindows):
        cells = (2 * plan.aim.reach[0] + 1) * (2 * plan.aim.reach[1] + 1)
    at_once = max(RAYS_AT_ONCE // (plan.samples * cells), 1)
    total = plan.sensor_shape[0] * plan.sensor_shape[1]
    for first in range(0, total, at_once):
        yield np.arange(first, min(first + at_once, total))


def _found(plan: RayPlan, xp: Any, samples: Any, index: Array, share: Array, working: Any) -> Any:
    """What rays find in the light field, interpolated in all four dimensions, times their shares."""
    from array_api_compat import device

    nv, nu, nt, ns = plan.views
    i, j, k, l = np.moveaxis(index, -1, 0)
    ci, cj = np.clip(i, 0, nu - 1), np.clip(j, 0, nv - 1)
    if plan.between_views:
        i0 = np.minimum(ci.astype(np.int64), max(nu - 2, 0))
        j0 = np.minimum(cj.astype(np.int64), max(nv - 2, 0))
        corners = [
            (i0 + di, j0 + dj, np.abs(1 - di - (ci - i0)) * np.abs(1 - dj - (cj - j0)))
            for di in range(min(nu, 2))
            for dj in range(min(nv, 2))
        ]
    else:
        corners = [((ci + 0.5).astype(np.int64), (cj + 0.5).astype(np.int64), np.ones_like(ci))]
    total = None
    for view_i, view_j, weight in corners:
        away = np.stack([i - view_i, j - view_j])
        moved = np.tensordot(plan.motion, away, axes=1) if plan.between_views else np.zeros_like(away)
        place = np.clip(np.stack([k, l]) + moved, -1e9, 1e9)
        first = np.floor(place).astype(np.int64)
        part = place - first
        for dk in range(2):
            for dl in range(2):
                c, r = first[0] + dk, first[1] + dl
                w = share * weight * np.abs(1 - dk - part[0]) * np.abs(1 - dl - part[1])
                w = w * ((c >= 0) & (c < ns) & (r >= 0) & (r < nt))
                at = ((view_j * nu + view_i) * nt + np.clip(r, 0, nt - 1)) * ns + np.clip(c, 0, ns - 1)
                where = xp.asarray(at.reshape(-1), device=device(samples))
                taken = xp.reshape(xp.take(samples, where, axis=0), (*at.shape, samples.shape[1]))
                found = taken * xp.asarray(w[..., None], dtype=working, device=device(samples))
                total = found if total is None else total + found
    return total
