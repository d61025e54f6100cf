"""Cameras and light that change during an exposure: courses over time, exposures, light-field videos.

::

    sweep = vcc.motion.Lines([0, 0.36], [51 * mm, 54 * mm])
    picture = vcc.MovingCamera(camera, {"sensor.z": sweep}).capture(light_field, exposure=0.36)
"""

from __future__ import annotations

from vcc.motion.courses import Course, Function, Lines, Steps, coded
from vcc.motion.moving_camera import MovingCamera
from vcc.motion.moving_file import load_moving_camera
from vcc.motion.video import LightFieldVideo

__all__ = [
    "Course",
    "Function",
    "LightFieldVideo",
    "Lines",
    "MovingCamera",
    "Steps",
    "coded",
    "load_moving_camera",
]
