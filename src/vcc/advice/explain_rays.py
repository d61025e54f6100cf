"""A ray plan in words: how it samples, what it costs, what to beware of."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vcc.fields.sampled import known
from vcc.light_field import LightField
from vcc.plan.rays.model import CellWindows, RayPlan

if TYPE_CHECKING:
    from vcc.engines import Recorded

PATCH = 32
"""Pixels a side, and for each thread, of the pieces of the picture that are traced to foretell time and error."""
PLACES = (0.1, 0.5, 0.9)
"""Where they lie along each axis, as a share of the sensor's size."""


def sections(
    plan: RayPlan, light_field: LightField, engine: Any, tolerance: float | None
) -> tuple[list[str], float | None]:
    """The sections of `vcc.Camera.explain` after how the picture is made, and the seconds expected."""
    pilot = _pilot(plan, light_field, engine)
    seconds = None if pilot is None else pilot[0]
    return [
        _sampling(plan, pilot, tolerance),
        _cost(plan, light_field, pilot),
        _warnings(plan, pilot),
    ], seconds


def _pilot(plan: RayPlan, light_field: LightField, engine: Any) -> tuple[float, float, float, float] | None:
    """(seconds, rays, error as a share of the mean, missing share) foretold by tracing pieces of the picture.

    None where the samples cannot be run (an array under a tracer).
    """
    from vcc.engines import chosen, record
    from vcc.engines.sharpening import sharpened

    if known(light_field.values[:1, :1, :1, :1]) is None:
        return None
    name = chosen(engine, light_field.values)
    if plan.sharpening is not None:
        sharpened(plan, light_field.values[:1, :1], name)  # the first run may compile
    start = time.perf_counter()
    plan, values = sharpened(plan, light_field.values, name)
    sharpening = time.perf_counter() - start

    def traced_in(patches: list[RayPlan]) -> tuple[list[Recorded], float]:
        start = time.perf_counter()
        found = [record(patch, values, engine=engine) for patch in patches]
        return found, (time.perf_counter() - start) / len(patches)

    rows, columns = plan.sensor_shape
    patches = list(_patches(plan, (os.cpu_count() or 1) if name == "numba" else 1))
    pixel = replace(plan, sensor_shape=(1, 1))
    traced_in([pixel])  # the first run may compile
    _, fixed = traced_in([pixel])
    traced, each = traced_in(patches)
    factor = rows * columns / sum(math.prod(patch.sensor_shape) for patch in patches)
    seconds = sharpening + fixed + max(each - fixed, 0.0) * len(patches) * factor
    means = [float(np.mean(known(one.values), dtype=np.float64)) for one in traced]  # type: ignore[arg-type]
    error = math.sqrt(sum(one.sampling_error**2 for one in traced) / len(traced))
    mean = abs(sum(means) / len(means))
    missing = sum(one.missing_rays for one in traced) / len(traced)
    return seconds, sum(one.rays for one in traced) * factor, error / mean if mean > 0 else 0.0, missing


def _patches(plan: RayPlan, threads: int) -> Iterator[RayPlan]:
    """Pieces of the sensor, evenly placed; neighbouring pixels look at neighbouring samples and stay together."""
    rows, columns = min(plan.sensor_shape[0], PATCH), min(plan.sensor_shape[1], PATCH * threads)
    for down in PLACES:
        for across in PLACES:
            row = round(down * (plan.sensor_shape[0] - rows))
            column = round(across * (plan.sensor_shape[1] - columns))
            yield replace(
                plan,
                sensor_shape=(rows, columns),
                first_pixel=(
                    plan.first_pixel[0] + column * plan.pitch[0],
                    plan.first_pixel[1] + row * plan.pitch[1],
                ),
            )


def _sampling(plan: RayPlan, pilot: Any, tolerance: float | None) -> str:
    lines = [f"  met on the way back from the sensor: {plan.met}"]
    through = " and cell of the array that it sees" if isinstance(plan.aim, CellWindows) else ""
    lines.append(f"  {plan.samples} rays for each pixel{through}, evenly spread, seed {plan.seed}")
    if pilot is not None:
        lines.append(
            f"  expected sampling error: {pilot[2]:.2g} of the picture's mean, root mean square"
            + ("" if tolerance is None else f"; samples are doubled until it is {tolerance:g}")
        )
    return "Sampling\n" + "\n".join(lines)


def _cost(plan: RayPlan, light_field: LightField, pilot: Any) -> str:
    lines = []
    if pilot is not None:
        lines.append(f"  {pilot[1] / 1e6:.3g} million rays")
    lines.append(f"  about {expected_memory(plan, light_field) / 1e6:.0f} MB of memory beside the light field")
    if pilot is not None:
        lines.append(f"  about {pilot[0]:.2g} s expected (pieces of the picture were timed on this machine)")
    return "Cost\n" + "\n".join(lines)


def expected_memory(plan: RayPlan, light_field: LightField) -> int:
    """Bytes that a run of the plan takes beside the light field and the picture, estimated."""
    from vcc.engines.sharpening import kept_as

    # Once in the plan's steps and once as the kernel reads them; a single large table is not copied.
    tables = 2 * sum(table.nbytes for table in plan.packed().arrays())
    values = light_field.values
    copied = 0
    if isinstance(values, np.ndarray):
        kept = kept_as(plan, values.dtype)
        if plan.sharpening is not None or kept != values.dtype or not values.flags.c_contiguous:
            copied = values.size * kept.itemsize
    return int(plan.points.nbytes + tables + copied)


def _warnings(plan: RayPlan, pilot: Any) -> str:
    lines = []
    if pilot is not None and pilot[3] > 1e-3:
        lines.append(
            f"  {pilot[3]:.1%} of the rays asked for are missing: they fall outside the grid of views or the "
            "views' pictures"
        )
    lines += [f"  {caution}" for caution in plan.cautions]
    return "Warnings\n" + ("\n".join(lines) if lines else "  none")
