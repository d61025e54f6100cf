"""Which core a plan gets: footprints where the optics allow them, else rays."""

from __future__ import annotations

from dataclasses import replace

from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.optics.train import Train
from vcc.plan.depth_rule import denser
from vcc.plan.footprints.compile import blurs_or_why_not, compile_footprints
from vcc.plan.how import How
from vcc.plan.model import MadeFor, Plan
from vcc.plan.rays.compile import compile_rays


def compile_best(train: Train, grid: Grid, how: How | None = None) -> Plan:
    """The plan by which an engine makes the picture that an optical train makes of a light field.

    Args:
        train: the optics and the sensor.
        grid: of the light field.
        how: what was chosen; None takes the defaults.

    Raises:
        InputError: options that do not go with one another, an element that returns what it must not.
    """
    plan = _compiled(train, grid, how or How())
    return replace(plan, grid_shape=grid.shape[:4], made_for=MadeFor(train, grid.frame))


def _compiled(train: Train, grid: Grid, how: How) -> Plan:
    by_footprints = "asked for" if how.method == "rays" else blurs_or_why_not(train, grid, how)
    if how.between_views == "depth":
        if isinstance(by_footprints, str):
            raise InputError(
                "between_views='depth' is for pictures made by footprints; this one is made by rays "
                f"({by_footprints}): leave it out, and rays interpolate along the parallax of one depth"
            )
        made, between, why = denser(train, grid)
        plan = _compiled(train, made, replace(how, between_views="auto"))
        return replace(plan, views_between=between, notes=(*plan.notes, why))
    if not isinstance(by_footprints, str):
        for name, given in (("samples", how.samples), ("tolerance", how.tolerance)):
            if given is not None:
                raise InputError(
                    f"{name} is for pictures made by rays, and this camera needs none: footprints have no "
                    "sampling error. Leave it out, or pass method='rays'"
                )
        return compile_footprints(train, grid, how, by_footprints)
    if how.method == "footprints":
        raise InputError(f"this camera's picture cannot be made by footprints: {by_footprints}. Use method='rays'")
    for name, value, fine in (
        ("interpolation", how.interpolation, how.interpolation in ("sharp", "linear")),
        ("refine", how.refine, how.refine == "auto"),
    ):
        if not fine:
            raise InputError(
                f"{name}={value!r} is for pictures made by footprints; this one is made by rays "
                f"({by_footprints}): leave it out"
            )
    return compile_rays(train, grid, how, by_footprints)
