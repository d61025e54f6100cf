"""A plan by footprints as text: sampling, cost, warnings."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from vcc.fields.grid import Block
from vcc.fields.sampled import has_values
from vcc.plan.footprints.model import Footprints
from vcc.plan.model import Plan
from vcc.plan.operators import AlongAxes, Blur, BlurViews
from vcc.run.drive import IN_MEMORY, Drive

TAPS_VALUES, TAPS_VALUES_BETWEEN = 1e8, 1e7
"""Number of sample values for a reliable timing; a tenth with interpolated views, which are slower."""


def sections(run: Drive) -> tuple[list[str], float | None]:
    """The sections of `vcc.Camera.explain` after "How the image is made", and the estimated seconds."""
    core = run.plan.core
    assert isinstance(core, Footprints)
    seconds = expected_seconds(run) if run.given.whole() is not None else None
    return [_sampling(run.plan, core), _cost(run, core, seconds), _warnings(run.plan)], seconds


def _sampling(plan: Plan, core: Footprints) -> str:
    step = max(abs(core.row_step), abs(core.column_step))
    relation = (
        "the sensor is no finer than the samples' footprints: shares laid out forward, by sample"
        if core.direction == "forward"
        else "the sensor is finer than the samples' footprints: shares laid out backward, by pixel"
    )
    lines = [
        f"  a step from sample to sample is {step:.3g} pixel{'' if f'{step:.3g}' == '1' else 's'} on the sensor; "
        f"{relation}",
        f"  interpolation within a view: {_interpolation(plan, core)}"
        + ("" if core.separable else "; the frame shears the pixel grid, which takes the slower general path"),
    ]
    for operator in (*plan.before, *plan.after):
        if isinstance(operator, BlurViews):
            rows, columns = operator.kernel.shape
            lines.append(f"  a diffuser's kernel of {rows} × {columns} blurs each view, in samples")
        if isinstance(operator, Blur) and operator.scatters:
            rows, columns = operator.kernel.shape
            lines.append(f"  a diffuser's kernel of {rows} × {columns} blurs the picture, in pixels")
    if any(plan.smear):
        lines.append(
            f"  gaps between views closed by a tent of {plan.smear[0]:.3g} × {plan.smear[1]:.3g} pixels half width"
        )
    return "Sampling\n" + "\n".join(lines)


def _interpolation(plan: Plan, core: Footprints) -> str:
    """The interpolation within a view and the filter that sharpens after it, as text."""
    by = {"spline": "cubic splines"}.get(core.interpolation, core.interpolation)
    for operator in plan.after:
        if isinstance(operator, AlongAxes) and not any(operator.half_widths):
            size = f"{len(operator.down)}×{len(operator.across)}"
            return f"{by}, sharp: what that takes is given back by a filter of {size} weights"
    return by


def _cost(run: Drive, core: Footprints, seconds: float | None) -> str:
    grid, between = run.given.grid, run.plan.views_between
    times = (1, 1) if between is None else between.times
    views = len(np.unique(core.view_rows // times[0])) * len(np.unique(core.view_columns // times[1]))
    view_bytes = math.prod(grid.shape[2:]) * grid.kind.itemsize
    lines = [] if between is None else [f"  {core.taps_used} views in between made from {views}"]
    lines += [
        f"  {core.taps_used} view taps, {core.samples_touched * run.channels / 1e6:.0f} million sample values",
        f"  {min(views, core.taps_used) * view_bytes / 1e6:.0f} MB of the light field read",
        f"  about {_memory(run) / 1e6:.0f} MB of memory beside it",
    ]
    if seconds is not None:
        lines.append(f"  about {seconds:.2g} s expected, once views are read (a slice was timed on this machine)")
    return "Cost\n" + "\n".join(lines)


def _memory(run: Drive) -> int:
    """Estimated memory of a run besides the light field and the image, bytes."""
    grid = run.given.grid
    # Only one column of views is blurred at a time.
    copies = any(operator.copies for operator in run.plan.before)
    blurred = 4 * grid.shape[0] * math.prod(run.plan.shape(grid.shape)[2:]) if copies else 0
    between = 0 if run.plan.views_between is None else IN_MEMORY
    return run.engine.memory(run.plan.core, run.channels, run.threads) + blurred + between


def _warnings(plan: Plan) -> str:
    lines = []
    if plan.missing_rays > 1e-3:
        lines.append(f"  {plan.missing_rays:.1%} of the rays asked for are missing: {plan.missing_reason}")
    lines += [f"  {caution}" for caution in plan.cautions]
    return "Warnings\n" + ("\n".join(lines) if lines else "  none")


def expected_seconds(run: Drive) -> float | None:
    """The estimated run time: some columns of view taps are timed, and the time is scaled up.

    None if the samples have no values (an array under a tracer).
    """
    core = run.plan.core
    assert isinstance(core, Footprints)
    if not has_values(run.given.whole()):
        return None
    if core.taps_used == 0:
        return 0.0
    used = np.count_nonzero(core.weights, axis=0)
    enough = TAPS_VALUES if run.plan.views_between is None else TAPS_VALUES_BETWEEN
    share = max(1 / 16, min(1.0, enough / (core.samples_touched * run.channels)))
    columns = np.sort(np.argsort(-used)[: math.ceil(len(used) * share)])
    piece = core.of_columns(columns)
    # The constant part of the run time.
    nothing = replace(piece, weights=np.zeros_like(piece.weights))

    def least_seconds(core: Any) -> float:
        part = Drive(replace(run.plan, core=core), run.given, run.how)
        return min(_timed(part.recorded) for _ in range(3))  # the first run may compile

    whole, fixed = least_seconds(piece), least_seconds(nothing)
    return fixed + max(whole - fixed, 0.0) * core.taps_used / piece.taps_used


def seconds_from_store(run: Drive) -> float:
    """The estimated time to read and run: some views of a row are timed, and the time is scaled up."""
    block, share = some_views(run)
    seconds = min(_timed(lambda: run.summed([block])) for _ in range(2))  # the first run may compile
    return seconds / share


def some_views(run: Drive) -> tuple[Block, float]:
    """Up to eight views of a row, and their share of all used views."""
    shape = run.samples.grid.shape
    used = run.core.used_views(shape)
    row = int(np.argmax(used.sum(axis=1)))
    columns = np.flatnonzero(used[row])
    some = int(columns[0]), int(columns[min(len(columns), 8) - 1]) + 1
    block = replace(Block.all_of(shape), rows=(row, row + 1), columns=some)
    return block, float(used[row, some[0] : some[1]].sum()) / float(used.sum())


def _timed(step: Callable[[], object]) -> float:
    start = time.perf_counter()
    step()
    return time.perf_counter() - start
