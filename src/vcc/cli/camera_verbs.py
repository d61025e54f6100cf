"""What commands ask of a camera, with the options of the command line."""

from __future__ import annotations

from typing import Any, Literal

from vcc.advice.explain import Explanation
from vcc.base.progress import Progress
from vcc.camera import Camera
from vcc.cli.timing import Timing
from vcc.fields.samples import Samples
from vcc.image import Image
from vcc.motion import MovingCamera
from vcc.plan.how import How
from vcc.recording import Recording
from vcc.store import StoredVideo

SAMPLES_WORTH_A_BAR = 3e8
"""Below this, a picture takes less than a second, and asking for progress would only slow it down."""


def captured(camera: Camera, field: Samples, how: How, progress: Progress, executor: Any = None) -> Image:
    """The picture; progress is asked for where it takes long."""
    plan = camera.compile(field, how, progress=progress)
    long = field.whole() is None or plan.samples_touched * (field.grid.channels or 1) > SAMPLES_WORTH_A_BAR
    return camera.capture(field, how, plan=plan, executor=executor, progress=progress if long else None)


def captured_over_time(
    moving: MovingCamera,
    light: Samples | StoredVideo,
    timing: Timing,
    how: How,
    progress: Progress,
    executor: Any = None,
) -> Image:
    """The picture of a moment of a video, or what the sensor gathers over an exposure."""
    start, length = timing.of(light)
    return moving.capture(
        light,
        length,
        how,
        start=start,
        time_tolerance=timing.time_tolerance,
        progress=progress,
        executor=executor,
    )


def exposed(
    camera: Camera,
    field: Samples,
    exposure: float | Literal["auto"],
    how: How,
    *,
    seed: int,
    radiance: float,
    executor: Any = None,
) -> Recording:
    """What the sensor's electronics make of it; ``seed`` is the noise's, and that of ``how`` the rays'."""
    return camera.expose(
        field, exposure, seed=seed, radiance=radiance, ray_seed=how.seed, how=how, executor=executor
    )


def explained(camera: MovingCamera, field: Samples, how: How, executor: Any = None) -> Explanation:
    """The plan in words."""
    return camera.explain(field, how, executor=executor)
