"""What commands ask of a camera, with the options of the command line."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

from vcc.advice.explain import Explanation
from vcc.base.progress import Progress
from vcc.camera import Camera
from vcc.image import Image
from vcc.light_field import LightField
from vcc.plan.how import How
from vcc.run.recording import Recording
from vcc.store import StoredLightField

SAMPLES_WORTH_A_BAR = 3e8
"""Below this, a picture takes less than a second, and asking for progress would only slow it down."""


def captured(camera: Camera, field: LightField | StoredLightField, how: How, progress: Progress) -> Image:
    """The picture; progress is asked for where it takes long."""
    asked = progress if _is_long(camera, field, how) else None
    return camera.capture(field, **_options(how), progress=asked)


def exposed(
    camera: Camera,
    field: LightField | StoredLightField,
    exposure: float | Literal["auto"],
    how: How,
    *,
    seed: int,
    radiance: float,
) -> Recording:
    """What the sensor's electronics make of it; ``seed`` is the noise's, and that of ``how`` the rays'."""
    options = _options(how)
    return camera.expose(field, exposure, seed=seed, radiance=radiance, ray_seed=options.pop("seed"), **options)


def explained(camera: Camera, field: LightField | StoredLightField, how: How) -> Explanation:
    """The plan in words."""
    return camera.explain(field, **_options(how))


def _is_long(camera: Camera, field: LightField | StoredLightField, how: How) -> bool:
    if not isinstance(field, LightField):
        return True
    options = {name: value for name, value in _options(how).items() if name not in _NOT_OF_THE_PLAN}
    return camera.compile(field, **options).samples_touched * (field.channels or 1) > SAMPLES_WORTH_A_BAR


_NOT_OF_THE_PLAN = ("tolerance", "engine", "memory_limit")


def _options(how: How) -> dict[str, Any]:
    """One by one, as `Camera.capture` takes them."""
    return {field.name: getattr(how, field.name) for field in dataclasses.fields(how) if field.name != "threads"}
