"""Why a picture is dark although the light field is not, throughout or where rays are missing, in a sentence."""

from __future__ import annotations

from typing import Any

import numpy as np

from vcc.fields.grid import Block
from vcc.fields.samples import Samples
from vcc.plan.footprints.model import Footprints
from vcc.plan.model import Plan
from vcc.plan.operators import OnSensor
from vcc.plan.rays.model import Rays
from vcc.run.drive import Recorded

MUCH_MISSING = 0.01
"""Share of the rays asked for that may be missing without a word."""


def why_dark(plan: Plan, samples: Samples, found: Recorded) -> str | None:
    """A sentence that says why a picture is exactly 0 everywhere; None where it is not, or where it must be.

    It must be 0 where the light field is dark, and where a mask lets nothing through, which footprints know and
    rays do not. Only NumPy pictures are looked at, and the light field only where the picture is 0.

    Args:
        plan: that made the picture.
        samples: of which it was made.
        found: the picture, and what the run told.
    """
    if not isinstance(found.values, np.ndarray) or _lit(found.values):
        return None
    core = plan.core
    why = _why_no_rays(core, found.rays) if isinstance(core, Rays) else _why_no_footprints(plan, core)
    if why is None or _dark(samples):
        return None
    lacking = (
        f"; {found.missing_rays:.1%} of the rays asked for are missing ({found.missing_reason})"
        if found.missing_rays
        else ""
    )
    return (
        f"the picture is 0 everywhere, and the light field is not: {why}{lacking}. Check where the elements, the "
        "sensor and the light field stand (camera.explain, camera.plot)"
    )


def why_darker(found: Recorded) -> str | None:
    """A sentence that says how many rays are missing, and why; None where they are few.

    Args:
        found: what the run told.
    """
    if found.missing_rays > MUCH_MISSING:
        return (
            f"{found.missing_rays:.1%} of the rays that this camera asks for are not in the light field "
            f"({found.missing_reason}); the picture is darker there"
        )
    return None


def _lit(picture: np.ndarray[Any, Any]) -> bool:
    """Whether any pixel is not 0: most often that in the middle."""
    rows, columns = picture.shape[:2]
    return bool(picture[rows // 2, columns // 2].any() or picture.any())


def _dark(samples: Samples) -> bool:
    whole = samples.whole()
    if whole is not None:
        return not bool(np.any(whole))
    everything = Block.all_of(samples.grid.shape)
    views = np.ndindex(samples.grid.shape[:2])
    blocks = (Block((j, j + 1), (i, i + 1), everything.pixel_rows, everything.pixel_columns) for j, i in views)
    return not any(samples.read(block).any() for block in blocks)


def _why_no_rays(core: Rays, rays: int) -> str:
    return (
        f"{rays} rays were traced back towards {core.aim.words}, and each was stopped on its way ({core.met}), or "
        "came from beside the light field or from a dark sample of it"
    )


def _why_no_footprints(plan: Plan, core: Any) -> str | None:
    """None where masks close the camera: nothing was asked for."""
    assert isinstance(core, Footprints)
    on = next((operator for operator in plan.after if isinstance(operator, OnSensor)), OnSensor(0))
    open_sensor = on.transmission is None or on.transmission.any()
    if not all(mask.texture.any() for mask in core.masks) or not open_sensor:
        return None
    if not core.weights.any():
        # A stop that is open beside the grid of views asks for rays that are missing; a closed one for none.
        return "what passes the stops comes from beside the grid of views" if plan.missing_rays else None
    corners = np.array([[k, l] for k in (0, core.samples[1] - 1) for l in (0, core.samples[0] - 1)])
    used = core.weights > 0
    ends = []
    for places, step in ((core.x, core.step[0]), (core.y, core.step[1])):
        on_sensor = places[used][:, None] - on.guard + corners @ step
        ends += [round(float(on_sensor.min())), round(float(on_sensor.max()))]
    rows, columns = plan.sensor_shape
    return (
        f"its samples land on columns {ends[0]} to {ends[1]} and rows {ends[2]} to {ends[3]} of a sensor of "
        f"{rows}×{columns} pixels, and those that meet it are dark or masked"
    )
