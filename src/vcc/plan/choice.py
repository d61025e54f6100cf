"""Which kind of plan a camera gets: footprints where its optics allow them, else rays."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from vcc.base.errors import InputError
from vcc.plan.depth_rule import denser
from vcc.plan.footprints.compile import compile_plan, why_not_footprints
from vcc.plan.footprints.model import Plan
from vcc.plan.rays.compile import compile_rays
from vcc.plan.rays.model import RayPlan

if TYPE_CHECKING:
    from vcc.camera import Camera
    from vcc.light_field import LightField


def compile_best(
    camera: Camera,
    light_field: LightField,
    *,
    method: str = "auto",
    interpolation: str = "sharp",
    between_views: str = "auto",
    scene_distance: float | None = None,
    refine: int | str = "auto",
    samples: int | None = None,
    seed: int = 0,
) -> Plan | RayPlan:
    """The plan by which an engine makes the picture; the arguments are those of `vcc.Camera.capture`.

    Raises:
        InputError: an option that does not exist, or does not go with the method.
    """
    if method not in ("auto", "footprints", "rays"):
        raise InputError(f"method is 'auto', 'footprints' or 'rays', not {method!r}")
    if between_views == "depth":
        if scene_distance is not None:
            raise InputError(
                "scene_distance is for between_views='auto'; by 'depth' each pixel has a distance of its own: "
                "leave it out"
            )
        by_rays = "asked for" if method == "rays" else why_not_footprints(camera, light_field)
        if by_rays is not None:
            raise InputError(
                f"between_views='depth' is for pictures made by footprints; this one is made by rays ({by_rays}): "
                "leave it out, and rays interpolate along the parallax of one depth"
            )
        made, between, why = denser(camera, light_field)
        plan = compile_best(
            camera,
            made,
            method=method,
            interpolation=interpolation,
            refine=refine,
            samples=samples,
        )
        assert isinstance(plan, Plan)
        return replace(plan, views_between=between, notes=(*plan.notes, why))
    if between_views not in ("auto", "none"):
        raise InputError(f"between_views is 'auto', 'none' or 'depth', not {between_views!r}")
    reason = "asked for" if method == "rays" else why_not_footprints(camera, light_field)
    if reason is None:
        if samples is not None:
            raise InputError(
                "samples is for pictures made by rays, and this camera needs none: leave it out, or pass "
                "method='rays'"
            )
        return compile_plan(
            camera,
            light_field,
            interpolation=interpolation,
            between_views=between_views,
            scene_distance=scene_distance,
            refine=refine,
        )
    if method == "footprints":
        raise InputError(f"this camera's picture cannot be made by footprints: {reason}. Use method='rays'")
    for name, given, allowed in (
        ("interpolation", interpolation, ("sharp", "linear")),
        ("refine", refine, ("auto",)),
    ):
        if given not in allowed:
            raise InputError(
                f"{name}={given!r} is for pictures made by footprints; this one is made by rays ({reason}): "
                "leave it out"
            )
    return compile_rays(
        camera,
        light_field,
        interpolation=interpolation,
        between_views=between_views,
        scene_distance=scene_distance,
        samples=samples,
        seed=seed,
        reason=reason,
    )
