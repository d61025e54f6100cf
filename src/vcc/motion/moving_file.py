"""Camera files of time-varying cameras: a table [moving] in addition to the elements and the sensor.

::

    [moving]
    sensor.z = { name = "lines", times = ["0 ms", "90 ms"], values = ["51 mm", "53 mm"] }
    stop.pattern = { name = "steps", times = ["0 ms", "5 ms"], values = [{ name = "open" }, "code.png"] }
    shutter = { name = "coded", code = "1101001", exposure = "90 ms" }

The keys are names of parameters. Their values have the same form as in the element's own table.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from functools import partial
from os import PathLike
from typing import Any

from vcc.base import checks, units
from vcc.base.errors import InputError
from vcc.base.reading import expanded, reading
from vcc.camera import Camera
from vcc.files.camera_reading import (
    MOVING,
    Beside,
    check_keys,
    known_choice,
    read_field,
    read_tables,
    train_of_tables,
)
from vcc.files.toml_words import as_toml, in_toml
from vcc.learn.parameters import place
from vcc.motion.courses import Course, coded
from vcc.motion.moving_camera import MovingCamera
from vcc.motion.moving_writing import CODED, POINTED, SHUTTER

FIELDS = {"name", "times", "values", "code", "exposure"}
"""Fields of courses."""
EXAMPLE = '{ name = "lines", times = ["0 ms", "90 ms"], values = ["51 mm", "53 mm"] }'


def load_moving_camera(path: str | PathLike[str]) -> MovingCamera:
    """Load a moving camera from a TOML file; without a table [moving] it is static.

    Args:
        path: the file: as for `vcc.load_camera`, with a table ``moving``; see `vcc.motion.moving_file`.

    Raises:
        InputError: as `vcc.load_camera`; unknown parameter, not a course; see also `vcc.MovingCamera`. The
            message names the file and the parameter.
    """
    file = expanded(path)
    tables, beside = read_tables(file), Beside(file.parent)
    try:
        with reading(file, "a camera file"):
            train = train_of_tables(tables, beside, f"{file}", file.stem, others=(MOVING,)).train
            camera = Camera(train.elements, train.sensor, name=train.name)
            with checks.within(f"{file}: {MOVING}"):
                return _moving(camera, tables.get(MOVING, {}), beside)
    except InputError as error:
        raise InputError(as_toml(str(error))) from error.__cause__


def _moving(camera: Camera, table: Any, beside: Beside) -> MovingCamera:
    given: dict[str, Mapping[str, Any]] = {}
    for name, each in _listed(table):
        if name in given:
            raise InputError(f"{name} is given twice, in quotes and without: leave one out")
        given[name] = each
    courses, shutter = {}, given.pop(SHUTTER, None)
    for name, each in given.items():
        found = place(camera, name)
        courses[name] = _course(
            each, name, partial(read_field, type(found.holder), found.field, beside=beside), POINTED
        )
    gate = None if shutter is None else _course(shutter, SHUTTER, _share, (*POINTED, CODED))
    return MovingCamera(camera, courses, gate)


def _listed(given: Any, name: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The tables of courses by parameter name; TOML splits unquoted names at dots into nested tables."""
    if not isinstance(given, dict):
        raise InputError(f"{name or 'it'} is {in_toml(given)}: it is a table, such as {EXAMPLE}")
    if name and (not given or not FIELDS.isdisjoint(given)):
        yield name, given
        return
    for key, each in given.items():
        yield from _listed(each, f"{name}.{key}" if name else key)


def _course(
    given: Mapping[str, Any], what: str, read: Callable[[Any, str], Any], kinds: Collection[str]
) -> Course:
    """The course that a table describes.

    Args:
        given: the table.
        what: the name of what changes, for messages.
        read: converts a value of the file, with a name for messages.
        kinds: the supported kinds of courses.
    """
    if "name" not in given:
        raise InputError(f"{what} has no name: write it like {EXAMPLE}")
    kind = known_choice(given["name"], {each: each for each in kinds}, f"{what}: name")
    fields = ("code", "exposure") if kind == CODED else ("times", "values")
    check_keys(given, ("name", *fields), fields, what, "field")
    if kind == CODED:
        exposure = units.parse(given["exposure"], "time", f"{what}: exposure")
        with checks.within(what):
            return coded(_code(given["code"]), exposure)
    times = _each(given["times"], what, "time", lambda each, called: units.parse(each, "time", called))
    values = _each(given["values"], what, "value", read)
    with checks.within(what):
        return POINTED[kind](times, values)


def _each(given: Any, what: str, noun: str, read: Callable[[Any, str], Any]) -> list[Any]:
    if not isinstance(given, list):
        raise InputError(f"{what}: {noun}s is {in_toml(given)}: it is a list, as in {EXAMPLE}")
    return [read(each, f"{what}: {noun} {number} of {len(given)}") for number, each in enumerate(given, start=1)]


def _share(given: Any, called: str) -> float:
    """The transmission of a shutter."""
    if not isinstance(given, int | float) or isinstance(given, bool):
        raise InputError(f"{called} is {in_toml(given)}: it is the share of the light that passes, 0 to 1")
    return checks.zero_or_more(called, given, most=1)


def _code(given: Any) -> Any:
    if isinstance(given, str):
        return given
    if not isinstance(given, list):
        raise InputError(f'code is {in_toml(given)}: write it as text of 0 and 1, such as "1101"')
    return _each(given, "code", "part", _share)
