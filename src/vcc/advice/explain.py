"""A plan in words: what was folded, what was pulled to the sensor, which sampling was chosen, what it costs."""

from __future__ import annotations

import math
import re
import textwrap
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from vcc.advice.limits import in_words, sampling_limits
from vcc.base.units import short
from vcc.fields.sampled import known, to_dtype
from vcc.light_field import SAMPLES_IN_WORDS, LightField, describe_geometry
from vcc.plan.footprints.model import Plan
from vcc.plan.parallax_rule import vergences
from vcc.plan.rays.model import RayPlan

if TYPE_CHECKING:
    from vcc.camera import Camera


COLUMNS = 80
"""Into which an explanation's lines fit, but for words that are longer."""
PLACES_END = 20
"""The column at which an element's words begin, behind its place on the axis."""


class Explanation(str):
    """Text that shows itself plainly in a notebook or at the prompt."""

    __slots__ = ("expected_seconds", "plan")
    plan: Plan | RayPlan
    expected_seconds: float | None

    def __repr__(self) -> str:
        return str(self)


def explain(camera: Camera, light_field: LightField, **options: Any) -> Explanation:
    """The plan of a camera for a light field in words; see `vcc.Camera.explain`.

    The time is foretold by running a slice of the plan on the light field and scaling it up.
    """
    engine = options.pop("engine", None)
    options.pop("progress", None)
    tolerance = options.pop("tolerance", None)
    limits = _limits(camera, light_field, options.get("scene_distance"))
    plan = camera.compile(light_field, **options)
    how = "How the picture is made\n" + "\n".join(f"  {note}" for note in plan.notes)
    if isinstance(plan, RayPlan):
        from vcc.advice.explain_rays import sections

        parts, seconds = sections(plan, light_field, engine, tolerance)
    else:
        seconds = expected_seconds(plan, light_field, engine)
        parts = [_sampling(plan), _cost(plan, light_field, seconds), _warnings(plan)]
    result = Explanation(_wrapped("\n\n".join([_what(camera, light_field), how, limits, *parts])))
    result.plan, result.expected_seconds = plan, seconds
    return result


def _wrapped(text: str) -> str:
    """Text whose lines fit a terminal: what is longer goes on in the next line, further to the right."""
    lines = []
    for line in text.split("\n"):
        indent = len(line) - len(line.lstrip())
        # A quantity stays in one piece.
        whole = re.sub(
            r"z = (?=[-\d])", "z\xa0=\xa0", re.sub(r"(?<=\d) (?=(?:[mun]?m|s|MB|pixels)\b)", "\xa0", line)
        )
        further = " " * (indent + (2 if "z =" not in line[:6] else PLACES_END - indent))
        pieces = textwrap.wrap(
            whole, COLUMNS, subsequent_indent=further, break_long_words=False, break_on_hyphens=False
        )
        lines += [piece.replace("\xa0", " ") for piece in pieces] or [""]
    return "\n".join(lines)


def _place(z: float) -> str:
    """The beginning of an element's line."""
    return f"  z = {z * 1e3:9.6g} mm  "


def _what(camera: Camera, light_field: LightField) -> str:
    nv, nu, nt, ns = light_field.shape[:4]
    lines = [
        f"Light field: {nv}×{nu} views of {nt}×{ns} pixels, "
        f"{light_field.channels or 1} channel{'s' if (light_field.channels or 1) > 1 else ''}, "
        f"{to_dtype(light_field.values)} {SAMPLES_IN_WORDS[light_field.sample]}; {describe_geometry(light_field)}"
    ]
    lines += [
        f"{_place(element.z)}{element.kind}"
        + (f' "{element.name}"' if element.name else "")
        + (f", {element.described()}" if element.described() else "")
        for element in camera.elements
    ]
    rows, columns = camera.sensor.shape
    vertical, horizontal = camera.sensor.pitches
    pitch = short(vertical) if vertical == horizontal else f"{short(vertical)} × {short(horizontal)}"
    lines.append(f"{_place(camera.sensor.z)}sensor, {rows}×{columns} pixels of {pitch}")
    return "\n".join(lines)


def _limits(camera: Camera, light_field: LightField, scene_distance: float | None) -> str:
    shown = vergences(light_field, scene_distance)
    scene = None if shown is None else (float(shown.min()), float(shown.max()))
    nv, nu, nt, ns = light_field.shape[:4]
    found = sampling_limits(camera, light_field.frame, (nv, nu, nt, ns), scene)
    return "What the samples can carry\n" + in_words(found)


def _sampling(plan: Plan) -> str:
    step = max(abs(plan.row_step), abs(plan.column_step))
    relation = (
        "the sensor is no finer than the samples' footprints: shares laid out forward, by sample"
        if plan.direction == "forward"
        else "the sensor is finer than the samples' footprints: shares laid out backward, by pixel"
    )
    lines = [
        f"  a step from sample to sample is {step:.3g} pixel{'' if f'{step:.3g}' == '1' else 's'} on the sensor; "
        f"{relation}",
        f"  interpolation within a view: {_interpolation(plan)}"
        + ("" if plan.separable else "; the frame shears the pixel grid, which takes the slower general path"),
    ]
    for kernel, what in ((plan.view_blur, "each view, in samples"), (plan.blur, "the picture, in pixels")):
        if kernel is not None:
            lines.append(f"  a diffuser's kernel of {kernel.shape[0]} × {kernel.shape[1]} blurs {what}")
    if any(plan.smear):
        lines.append(
            f"  gaps between views closed by a tent of {plan.smear[0]:.3g} × {plan.smear[1]:.3g} pixels half width"
        )
    return "Sampling\n" + "\n".join(lines)


def _interpolation(plan: Plan) -> str:
    """How values between samples are found, and what that takes given back, in words."""
    by = {"spline": "cubic splines"}.get(plan.interpolation, plan.interpolation)
    if plan.sharpen is None:
        return by
    size = "×".join(str(len(weights)) for weights in plan.sharpen)
    return f"{by}, sharp: what that takes is given back by a filter of {size} weights"


def _cost(plan: Plan, light_field: LightField, seconds: float | None) -> str:
    times = (1, 1) if plan.views_between is None else plan.views_between.times
    views = len(np.unique(plan.view_rows // times[0])) * len(np.unique(plan.view_columns // times[1]))
    view_bytes = np.prod(light_field.shape[2:]) * to_dtype(light_field.values).itemsize
    between = [] if plan.views_between is None else [f"  {plan.taps_used} views in between made from {views}"]
    lines = [
        *between,
        f"  {plan.taps_used} view taps, {plan.samples_touched * (light_field.channels or 1) / 1e6:.0f} million "
        "sample values",
        f"  {min(views, plan.taps_used) * view_bytes / 1e6:.0f} MB of the light field read",
        f"  about {expected_memory(plan, light_field) / 1e6:.0f} MB of memory beside it",
    ]
    if seconds is not None:
        lines.append(f"  about {seconds:.2g} s expected (a slice was timed on this machine)")
    return "Cost\n" + "\n".join(lines)


def _warnings(plan: Plan) -> str:
    lines = []
    if plan.missing_rays > 1e-3:
        lines.append(f"  {plan.missing_rays:.1%} of the rays asked for are missing: {plan.missing_reason}")
    if plan.expected_ghosting > 1.5 * max(1.0, abs(plan.row_step)):
        lines.append(
            f"  ghosting: views' pictures of some depths stay {plan.expected_ghosting:.2g} pixels apart; "
            "the light field has too few views for this defocus"
        )
    return "Warnings\n" + ("\n".join(lines) if lines else "  none")


def expected_memory(plan: Plan, light_field: LightField) -> int:
    """Bytes that a run of the plan takes beside the light field and the picture, estimated."""
    from vcc.engines.depth_views import IN_MEMORY
    from vcc.engines.numba_cpu import memory

    channels = light_field.channels or 1
    # One column of views is blurred at a time: in double precision, and kept in single.
    blurred = 0 if plan.view_blur is None else 4 * channels * light_field.shape[0] * math.prod(plan.samples)
    between = 0 if plan.views_between is None else IN_MEMORY
    return memory(plan, channels) + int(blurred + between)


def expected_seconds(plan: Plan, light_field: LightField, engine: Any = None) -> float | None:
    """How long a run of the plan will take: some columns of view taps are run and timed, then scaled up.

    None where the samples cannot be run (an array under a tracer).
    """
    from vcc.engines import run_plan

    if known(light_field.values[:1, :1, :1, :1]) is None:
        return None
    if plan.taps_used == 0:
        return 0.0
    used = np.count_nonzero(plan.weights, axis=0)
    # Enough of them that their own time stands out from the clock's noise.
    enough = 1e8 if plan.views_between is None else 1e7  # views in between take ten times as long
    share = max(1 / 16, min(1.0, enough / (plan.samples_touched * (light_field.channels or 1))))
    columns = np.sort(np.argsort(-used)[: math.ceil(len(used) * share)])
    piece = plan.columns(columns)
    # What a run costs whatever it adds up.
    nothing = replace(piece, weights=np.zeros_like(piece.weights))

    def least_seconds(plan: Plan) -> float:
        step = partial(run_plan, plan, light_field.values, engine=engine)
        return min(_timed(step) for _ in range(3))  # the first run may compile

    whole, fixed = least_seconds(piece), least_seconds(nothing)
    return fixed + max(whole - fixed, 0.0) * plan.taps_used / piece.taps_used


def _timed(step: Callable[[], object]) -> float:
    start = time.perf_counter()
    step()
    return time.perf_counter() - start
