"""Why a picture is dark throughout although the light field is not, in a sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vcc.light_field import LightField
from vcc.plan.footprints.model import Plan
from vcc.plan.rays.model import RayPlan

if TYPE_CHECKING:
    from vcc.store import StoredLightField


def why_dark(
    plan: Plan | RayPlan,
    light_field: LightField | StoredLightField,
    picture: Any,
    rays: int,
    missing_rays: float,
    missing_reason: str,
) -> str | None:
    """A sentence that says why a picture is exactly 0 everywhere; None where it is not, or where it must be.

    It must be 0 where the light field is dark, and where a mask lets nothing through, which footprints know and
    rays do not. Only NumPy pictures are looked at, and the light field only where the picture is 0.

    Args:
        plan: that made the picture.
        light_field: of which it was made.
        picture: (rows, columns[, channels]).
        rays: how many were traced; 0 for footprints.
        missing_rays: the share of the rays asked for that the light field lacks.
        missing_reason: in words.
    """
    if not isinstance(picture, np.ndarray) or _lit(picture):
        return None
    why = _why_no_rays(plan, rays) if isinstance(plan, RayPlan) else _why_no_footprints(plan)
    if why is None or _dark(light_field):
        return None
    lacking = f"; {missing_rays:.1%} of the rays asked for are missing ({missing_reason})" if missing_rays else ""
    return (
        f"the picture is 0 everywhere, and the light field is not: {why}{lacking}. Check where the elements, the "
        "sensor and the light field stand (camera.explain, camera.plot)"
    )


def _lit(picture: np.ndarray[Any, Any]) -> bool:
    """Whether any pixel is not 0: most often that in the middle."""
    rows, columns = picture.shape[:2]
    return bool(picture[rows // 2, columns // 2].any() or picture.any())


def _dark(light_field: LightField | StoredLightField) -> bool:
    if isinstance(light_field, LightField):
        return not bool(np.any(light_field.values))
    nv, nu, nt = light_field.outline.shape[:3]
    return not any(light_field.linear_view(row, column, 0, nt).any() for row in range(nv) for column in range(nu))


def _why_no_rays(plan: RayPlan, rays: int) -> str:
    return (
        f"{rays} rays were traced back towards {plan.aim.words}, and each was stopped on its way ({plan.met}), or "
        "came from beside the light field or from a dark sample of it"
    )


def _why_no_footprints(plan: Plan) -> str | None:
    """None where masks close the camera: nothing was asked for."""
    against = plan.sensor_transmission
    if not all(mask.texture.any() for mask in plan.masks) or not (against is None or against.any()):
        return None
    if not plan.weights.any():
        # A stop that is open beside the grid of views asks for rays that are missing; a closed one for none.
        return "what passes the stops comes from beside the grid of views" if plan.missing_rays else None
    corners = np.array([[k, l] for k in (0, plan.samples[1] - 1) for l in (0, plan.samples[0] - 1)])
    used = plan.weights > 0
    ends = []
    for places, step in ((plan.x, plan.step[0]), (plan.y, plan.step[1])):
        on_sensor = places[used][:, None] - plan.guard + corners @ step
        ends += [round(float(on_sensor.min())), round(float(on_sensor.max()))]
    rows, columns = plan.sensor_shape
    return (
        f"its samples land on columns {ends[0]} to {ends[1]} and rows {ends[2]} to {ends[3]} of a sensor of "
        f"{rows}×{columns} pixels, and those that meet it are dark or masked"
    )
