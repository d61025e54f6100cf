"""Engines run a plan on the samples of a light field; they know nothing of optics.

All of them compute the same sum (`vcc.plan.footprints.model`). ``reference`` is the plain one that defines what is
correct, ``array_api`` works on arrays of PyTorch, JAX and others and carries gradients, ``numba`` is fast on
NumPy arrays. An engine is an argument or follows from the arrays' type; there is no global setting.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from vcc.base.errors import InputError
from vcc.plan.footprints.model import Plan
from vcc.plan.rays.model import RayPlan

EngineName = Literal["reference", "array_api", "numba"]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Recorded:
    """A picture and what is known about it.

    Args:
        values: irradiance (rows, columns[, channels]), float32; an array of the library of the samples with the
            ``array_api`` engine, else of NumPy.
        missing_rays: the share of the rays asked for that the light field does not hold.
        missing_reason: in words.
        sampling_error: root mean square over the pixels, in units of the values; 0 for footprints.
        rays: how many were traced; 0 for footprints.
        samples: rays a pixel; 0 for footprints.
    """

    values: Any
    missing_rays: float
    missing_reason: str
    sampling_error: float = 0.0
    rays: int = 0
    samples: int = 0


def record(
    plan: Plan | RayPlan,
    values: Any,
    *,
    engine: EngineName | None = None,
    tolerance: float | None = None,
    progress: Progress | None = None,
) -> Recorded:
    """The picture that either kind of plan makes of a light field's samples; see `run_plan`.

    Args:
        plan: from `vcc.Camera.compile`.
        values: samples (v, u, t, s[, channels]).
        engine: see `vcc.Camera.capture`.
        tolerance: see `vcc.Camera.capture`; for ray plans only.
        progress: called with (done, total).

    Raises:
        InputError: what `run_plan` refuses, or a tolerance that is not a number above 0 or not for rays.
    """
    from vcc.engines import rays

    rays.check_tolerance(tolerance, by_rays=isinstance(plan, RayPlan))
    if isinstance(plan, Plan):
        picture = run_plan(plan, values, engine=engine, progress=progress)
        return Recorded(picture, plan.missing_rays, plan.missing_reason)
    traced = rays.run(plan, values, chosen(engine, values), tolerance, progress)
    return Recorded(
        traced.values,
        traced.missing_rays if plan.missing_rays is None else plan.missing_rays,
        "they fall outside the grid of views or outside the views' pictures",
        traced.sampling_error,
        traced.rays,
        traced.samples,
    )


def chosen(engine: EngineName | None, values: Any) -> EngineName:
    """The engine by name, or by the arrays' type.

    Raises:
        InputError: an unknown engine, or one that does not take arrays of this type.
    """
    name = engine or ("numba" if isinstance(values, np.ndarray) else "array_api")
    if name not in get_args(EngineName):
        raise InputError(f"there is no engine {name!r}: choose one of {', '.join(get_args(EngineName))}")
    if name != "array_api" and not isinstance(values, np.ndarray):
        raise InputError(
            f"engine {name!r} takes NumPy arrays, not {type(values).__module__}.{type(values).__name__}: "
            "use engine='array_api'"
        )
    return name


def run_plan(
    plan: Plan, values: Any, *, engine: EngineName | None = None, progress: Progress | None = None
) -> Any:
    """The picture that a plan makes of a light field's samples.

    Args:
        plan: from `vcc.Camera.compile`.
        values: samples (v, u, t, s[, channels]), of the light field that the plan was made for or of
            another with the same shape and frame.
        engine: see `vcc.Camera.capture`; None lets the type of ``values`` decide.
        progress: called with (done, total).

    Returns:
        Irradiance (rows, columns[, channels]), float32; an array of the library of ``values`` with the
        ``array_api`` engine, else of NumPy.

    Raises:
        InputError: an unknown engine, or one that does not take arrays of this type.
    """
    engine = chosen(engine, values)
    if plan.views_between is not None:
        from vcc.engines import depth_views

        return depth_views.run(plan, values, engine, progress)
    if plan.view_blur is not None:
        from vcc.engines import view_blur

        return view_blur.run(plan, values, engine, progress)
    if plan.swap_pixel_axes:
        values = _pixel_axes_swapped(values)
    if engine == "reference":
        from vcc.engines import reference

        return reference.run(plan, values, progress)
    if engine == "array_api":
        from vcc.engines import array_api

        return array_api.run(plan, values, progress)
    from vcc.engines import numba_cpu

    return numba_cpu.run(plan, values, progress)


def _pixel_axes_swapped(values: Any) -> Any:
    if isinstance(values, np.ndarray):
        return values.swapaxes(2, 3)
    from array_api_compat import array_namespace

    order = (0, 1, 3, 2, *range(4, values.ndim))
    return array_namespace(values).permute_dims(values, order)
