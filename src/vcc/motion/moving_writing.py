"""Writes camera files of time-varying cameras: the elements and the sensor, and a table [moving]."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from os import PathLike
from typing import Any

from vcc.base import units
from vcc.base.errors import InputError
from vcc.base.reading import expanded
from vcc.camera import Camera
from vcc.files.camera_reading import MOVING
from vcc.files.camera_writing import Writer, tables_of_train, write_tables
from vcc.learn.parameters import place
from vcc.motion.courses import Course, Lines, Steps, code_of

SHUTTER = "shutter"
"""Key in the table; no parameter has this name, because names of parameters contain a dot."""
POINTED: dict[str, type[Lines | Steps]] = {"lines": Lines, "steps": Steps}
"""Courses that are defined by points in time, by their names in files."""
CODED = "coded"
"""The name of `vcc.motion.coded`, for shutters only."""

Changing = Course | Callable[[float], Any]
"""A value as a function of time."""


def write_moving(
    camera: Camera, courses: Mapping[str, Changing], shutter: Changing | None, path: str | PathLike[str]
) -> None:
    """Write a moving camera as TOML; see `vcc.MovingCamera.save`.

    Args:
        camera: provides all parameters that do not change.
        courses: by names of parameters.
        shutter: None for always open.
        path: the file; an older file of that name is replaced.

    Raises:
        InputError: a file cannot hold the camera, or the folder cannot be written to.
    """
    file = expanded(path)
    tables, arrays = tables_of_train(camera, file)
    changing: dict[str, Any] = {}
    for name, course in courses.items():
        found = place(camera, name)
        slug = re.sub(r"\W+", "_", name.removesuffix(found.field)).strip("_")
        writer = Writer(file, found.owned_by, slug, arrays)
        changing[name] = _table(course, name, partial(writer.field, found.holder, found.field))
    if shutter is not None:
        changing[SHUTTER] = _coded_table(shutter) or _table(shutter, f"the {SHUTTER}", float)
    write_tables(file, tables | ({MOVING: changing} if changing else {}), arrays)


def _table(course: Changing, what: str, written: Callable[[Any], Any]) -> dict[str, Any]:
    """The table of a course."""
    for name, kind in POINTED.items():
        if type(course) is kind:
            times = [units.text(time, "time", exact=True) for time in course.times]
            return {"name": name, "times": times, "values": [written(value) for value in course.values]}
    raise InputError(
        f"{what} changes by a function of Python, which a camera file cannot hold: write it by points in time, "
        "vcc.motion.Lines(times, [f(t) for t in times]), or as vcc.motion.Steps"
    )


def _coded_table(shutter: Changing) -> dict[str, Any] | None:
    """The table of a coded shutter; None for another one."""
    found = code_of(shutter) if isinstance(shutter, Steps) else None
    if found is None:
        return None
    code, length = found
    return {"name": CODED, "code": code, "exposure": units.text(length, "time", exact=True)}
