"""Running a ray plan: by the compiled kernel, or plainly in NumPy, or on arrays of any library with gradients.

All three trace the same rays. The plain way is the plan's own (`RayPlan.looked_up`); it defines what is correct.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError, ResultWarning
from vcc.engines.sharpening import sharpened
from vcc.fields.sampled import to_dtype
from vcc.plan.rays.model import TABLE, CellWindows, RayPlan, Window

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

TILE = 32
"""Pixels a side that a thread works on at once: what they look up in the light field stays in its cache."""
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
) -> Traced:
    """The picture of samples (v, u, t, s[, channels]) by a ray plan.

    Args:
        plan: what to trace.
        values: the light field's samples.
        engine: ``"numba"``, ``"array_api"`` or ``"reference"``.
        tolerance: double the samples until the sampling error is at most this share of the picture's mean; None
            takes the plan's samples.
        progress: called with (done, total) in tiles or pieces; with a tolerance the total is that of a round.
    """
    once = {"numba": _compiled, "array_api": _in_library, "reference": _in_library}[engine]
    kind = np.float64 if engine == "reference" else None
    plan, values = sharpened(plan, values, engine)
    traced = once(plan, values, 0, kind, progress)
    round_number = 0
    while tolerance is not None and traced.sampling_error > tolerance * abs(_mean(traced.values)):
        if traced.samples * 2 > TABLE:
            warn_of_error(traced.sampling_error / abs(_mean(traced.values)), traced.samples, tolerance, 5)
            break
        round_number += 1
        # As many rays again, from the block beside the ones taken: together they are one larger even set.
        more = once(_doubled(plan, round_number), values, 1, kind, progress)
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


def _doubled(plan: RayPlan, round_number: int) -> RayPlan:
    from dataclasses import replace

    return replace(plan, samples=plan.samples * 2 ** (round_number - 1))


def _mean(values: Any) -> float:
    from vcc.fields.sampled import known

    numbers = known(values)
    return float("nan") if numbers is None else float(np.mean(numbers, dtype=np.float64))


# --- compiled ---


def _compiled(plan: RayPlan, values: NDArray[Any], beside: int, _kind: Any, progress: Progress | None) -> Traced:
    channels = values.shape[4] if values.ndim == 5 else 1
    rows, columns = plan.sensor_shape
    picture = np.empty((rows, columns, channels), dtype=np.float32)
    tally = np.zeros(4)
    add = _tile_adder(plan, values, channels, beside)
    tiles = [(r, r + TILE, c, c + TILE) for r in range(0, rows, TILE) for c in range(0, columns, TILE)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        # Tallies are summed in the order of tiles: the same sums whatever the number of threads.
        for done, part in enumerate(pool.map(partial(add, picture), tiles), start=1):
            tally += part
            if progress is not None:
                progress(done, len(tiles))
    error = float(np.sqrt(tally[2] / picture.size))
    missing = float(tally[1] / tally[0]) if tally[0] > 0 else 0.0
    return Traced(picture if values.ndim == 5 else picture[..., 0], error, missing, int(tally[3]), plan.samples)


def _tile_adder(
    plan: RayPlan, values: NDArray[Any], channels: int, beside: int
) -> Callable[[NDArray[np.float32], tuple[int, int, int, int]], Array]:
    """A function that traces one tile of the picture and returns its tally."""
    from vcc.engines import ray_kernels as kernels

    kind = np.float32 if values.dtype == np.float16 else values.dtype  # no half precision in compiled code
    flat = np.ascontiguousarray(values, dtype=kind).reshape(-1)
    pixels = np.array([plan.first_pixel, plan.pitch, plan.sensitive]).T.copy()
    window, scatter = np.zeros((3, 5)), np.zeros((0, 5))
    cells, kinds, whole = np.zeros((0, 2)), np.zeros((0, 3)), np.zeros(5, dtype=np.int64)
    borders = np.zeros((0, 2))
    if isinstance(plan.aim, Window):
        window[:2, :2], window[:2, 2:4] = plan.aim.slope_from_point, plan.aim.slope_from_sensor
        window[:2, 4], window[2, :2] = plan.aim.offset, (plan.aim.solid_angle, plan.aim.disc)
        terms = [[column, *matrix.reshape(-1)] for column, matrix in plan.aim.slope_from_scatter]
        scatter = np.array(terms).reshape(-1, 5)
    else:
        cells, kinds, whole = _cell_tables(plan.aim)
        borders = np.ascontiguousarray(plan.aim.borders)
    steps = plan.packed().arrays()
    points, seed = np.ascontiguousarray(plan.points.T), plan.seed & 0xFFFFFFFF  # the hash takes no more of it

    def add(picture: NDArray[np.float32], tile: tuple[int, int, int, int]) -> Array:
        tally = np.zeros(4)
        kernels.add_tile(
            flat, plan.views, channels, plan.scale, pixels, tile, plan.samples, beside, seed, points,
            window, scatter, cells, kinds, whole, borders, *steps, plan.index_from_ray.matrix[:4].copy(),
            plan.motion, plan.between_views, plan.views_may_end, picture, tally,
        )  # fmt: skip
        return tally

    return add


def _cell_tables(aim: CellWindows) -> tuple[Array, Array, NDArray[np.int64]]:
    """The windows of cells as the kernel reads them: by axis, by kind, and whole numbers."""
    lattice = aim.lattice
    cells = np.array(
        [
            [np.cos(lattice.rotation), np.sin(lattice.rotation)],
            lattice.offset,
            [lattice.pitch, lattice.row_height],
            aim.place_from_sensor,
            aim.place_from_slope,
            aim.offset,
            aim.beyond,
            aim.beyond_from_sensor,
            aim.beyond_from_slope,
            aim.beyond_offset,
            aim.middle,
            aim.half,
            aim.cell_half,
            [aim.opening_radius, aim.disc],
        ]
    )
    kinds = np.concatenate([aim.powers[..., None], aim.slopes], axis=-1).reshape(-1, 3)
    whole = np.array([lattice.layout == "hexagonal", *aim.powers.shape, *aim.reach], dtype=np.int64)
    return cells, kinds, whole


# --- plain, on arrays of any library ---


def _in_library(plan: RayPlan, values: Any, beside: int, kind: Any, progress: Progress | None) -> Traced:
    """The plan's own rays; places and weights are NumPy numbers, samples may be arrays of any library."""
    from array_api_compat import array_namespace

    xp = array_namespace(values)
    channels = values.shape[4] if values.ndim == 5 else 1
    wide = kind == np.float64 or to_dtype(values) == np.float64
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
