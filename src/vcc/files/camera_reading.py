"""Reading camera files: an optical train from TOML, with error messages for faulty files."""

from __future__ import annotations

import dataclasses
import difflib
import functools
import inspect
import math
import os
import re
import tomllib
from collections.abc import Collection, Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks, units
from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import check_file, expanded, in_words, read_bytes, reading
from vcc.files.camera_families import (
    ELEMENT_KINDS,
    FROM_FILES,
    Family,
    alternatives,
    family_of,
    first_field,
    listed,
    needed,
    parameters_of,
    unit_of,
)
from vcc.files.npy import read_npy
from vcc.files.pictures import read_grey
from vcc.files.toml_words import LONGEST_SHOWN, as_toml, in_toml
from vcc.optics import Element
from vcc.optics.focusing import focused_train
from vcc.optics.sensor import Sensor
from vcc.optics.train import Train
from vcc.shapes.patterns import Pattern

LIKELY = 0.75
"""Similarity above which an unknown name counts as a typing error: "lense" for "lens", not "stop" for "prism"."""

MOVING = "moving"
"""The table of a camera file that describes changes over time; see `vcc.motion.moving_file`."""
DEEPEST = 30
"""Maximum nesting of tables and lists in a camera; NumPy arrays have up to 32 axes."""
LARGEST = float(np.finfo(np.float32).max)
"""Largest number in a camera file: computations on light use float32."""
LARGEST_TERM = 1e100
"""Of aspheric terms, which are per metre to powers up to that of r¹⁶ and more: phone lenses have 10⁴⁵."""

_ARRAY_LIKE = set(get_args(ArrayLike))


@dataclasses.dataclass(frozen=True, repr=False)
class Beside(Brief):
    """The files that the tables of a camera may name.

    Args:
        folder: the folder of these files.
        only: names that may be opened; None allows all.
        arrays: arrays that are already in memory, by the names that tables use, in the form of .npy files.
        opened: collects the names that were opened.
    """

    folder: Path
    only: frozenset[str] | None = None
    arrays: Mapping[str, NDArray[np.float64]] = dataclasses.field(default_factory=dict)
    opened: set[str] = dataclasses.field(default_factory=set)

    def path(self, name: str) -> Path:
        """Path of a file name.

        Raises:
            InputError: the file may not be opened.
        """
        if self.only is not None and name not in self.only:
            known = sorted(self.only | set(self.arrays))
            raise InputError(
                f"{in_toml(name)} is not among the files that may be read here"
                f" ({listed(known) if known else 'none was named at the start'})"
            )
        self.opened.add(name)
        return self.folder / expanded(name)

    def exists(self, name: str) -> bool:
        """Whether the file exists; False if it may not be opened."""
        if name in self.arrays:
            return True
        return (self.only is None or name in self.only) and (self.folder / name).exists()


@dataclasses.dataclass(frozen=True)
class TrainAsWritten:
    """The optical train that tables describe.

    Args:
        elements: in the order of the tables.
        train: the train of these elements.
    """

    elements: tuple[Element, ...]
    train: Train


def read_train(path: str | PathLike[str]) -> Train:
    """The optical train that a TOML file describes; see `vcc.camera_file.load_camera`."""
    file = expanded(path)
    try:
        with reading(file, "a camera file"):
            return _train_of(_read_toml(file), f"{file}", Beside(file.parent), file.stem).train
    except InputError as error:
        raise InputError(as_toml(str(error))) from error.__cause__


def read_tables(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the tables of a camera file without checking their content.

    Raises:
        InputError: no such file, or not TOML.
    """
    file = expanded(path)
    with reading(file, "a camera file"):
        return _read_toml(file)


def tables_of_text(text: str) -> dict[str, Any]:
    """Return the tables of a camera file from its text.

    Raises:
        InputError: not TOML.
    """
    return _parsed(text, "the camera")


def train_of_tables(
    tables: Mapping[str, Any],
    beside: Beside,
    called: str = "the camera",
    name: str = "",
    others: Collection[str] = (),
) -> TrainAsWritten:
    """The optical train that tables describe; the tables need not come from a file.

    Args:
        tables: ``elements`` and ``sensor``; only text, numbers, booleans, lists and tables of these.
        beside: the files that the tables may name.
        called: name of the camera in messages.
        name: of the train.
        others: names of further tables to ignore.

    Raises:
        InputError: as in `vcc.camera_file.load_camera`, or a file that may not be opened.
    """
    try:
        _check_values(tables, called, DEEPEST)
        return _train_of({key: each for key, each in tables.items() if key not in others}, called, beside, name)
    except InputError as error:
        raise InputError(as_toml(str(error))) from error.__cause__


def _check_values(given: Mapping[str, Any] | list[Any], place: str, levels: int, largest: float = LARGEST) -> None:
    """Raise for values that no camera has: numbers that overflow in computation, lists nested too deeply."""
    if not levels:
        raise InputError(
            f"{place[:LONGEST_SHOWN]}… is nested too deeply: lists and tables have up to {DEEPEST} levels"
        )
    for key, each in enumerate(given, start=1) if isinstance(given, list) else given.items():
        if isinstance(each, dict | list):
            inside = f"{place}: {key}" if isinstance(key, str) else f"{place} {key}"
            _check_values(each, inside, levels - 1, LARGEST_TERM if key == "aspheres" else largest)
        elif isinstance(each, int | float) and abs(each) > largest and each not in (math.inf, -math.inf):
            inside = f"{place}: {key}" if isinstance(key, str) else f"{place} {key}"
            raise InputError(f"{inside} is {in_toml(each)}: a camera's numbers are up to {largest:.3g}")


def read_field(kind: type, name: str, given: Any, called: str, beside: Beside) -> Any:
    """The value of a dataclass field from its value in a camera file.

    Args:
        kind: class of the element, sensor or pattern.
        name: name of the field.
        given: text, a number, a boolean, a list or a table of these.
        called: name of the field in messages.
        beside: the files that the value may name.

    Raises:
        InputError: as in `read_train`.
    """
    try:
        return _read_value(given, _hints(kind)[name], unit_of(parameters_of(kind)[name]), called, beside)
    except InputError as error:
        raise InputError(as_toml(str(error))) from error.__cause__


def _train_of(tables: Mapping[str, Any], called: str, beside: Beside, name: str) -> TrainAsWritten:
    if MOVING in tables:
        raise InputError(
            f"{called} has a table [{MOVING}], which describes a time-varying camera and is not supported here. "
            "Load it with vcc.motion.load_moving_camera, or run vcc capture with --exposure-time. Without "
            f"[{MOVING}] the file describes the camera at rest"
        )
    check_keys(tables, {"elements", "sensor"}, {"sensor"}, called, "table")
    elements = tables.get("elements", [])
    if not isinstance(elements, list) or not all(isinstance(entry, dict) for entry in elements):
        raise InputError(f"{called}: each element starts with a line [[elements]] of its own")
    if not isinstance(tables["sensor"], dict):
        raise InputError(f"{called}: the sensor is a table that starts with a line [sensor]")
    built = tuple(_read_element(entry, number, called, beside) for number, entry in enumerate(elements, start=1))
    given, place = dict(tables["sensor"]), f"{called}: sensor"
    focus = _focus(given, place)
    sensor = _build(Sensor, given, place, beside)
    with checks.within(called):
        if focus is None:
            return TrainAsWritten(built, Train(built, sensor, name=name))
        return TrainAsWritten(built, focused_train(built, sensor, focus, name))


def _focus(given: dict[str, Any], place: str) -> float | None:
    """Remove the focus distance from a sensor's fields, set z to 0 and return the distance; None if z is given."""
    if "focus" not in given:
        if "z" not in given:
            raise InputError(f'{place} has no field "z" (or "focus", the distance in focus), which it needs')
        return None
    if "z" in given:
        raise InputError(f"{place} has a z and a focus, of which z would follow: leave one out")
    focus = given.pop("focus")
    given["z"] = "0 m"
    if focus in ("inf", "infinity"):
        return math.inf
    return units.parse(focus, "length", f"{place}: focus")


def _read_toml(file: Path) -> dict[str, Any]:
    try:
        content = read_bytes(file, "camera file").decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{file} is not a text file in UTF-8, as TOML is") from None
    return _parsed(content, f"{file}")


def _parsed(content: str, called: str) -> dict[str, Any]:
    try:
        return tomllib.loads(content)
    except (ValueError, RecursionError) as error:  # also raised for numbers with thousands of digits
        reason = in_words(error) if isinstance(error, RecursionError) else error
        raise InputError(f"{called} is not valid TOML: {reason}") from None


def _read_element(entry: Mapping[str, Any], number: int, called: str, beside: Beside) -> Any:
    place = f"{called}: element {number}"
    if "kind" not in entry:
        raise InputError(f"{place} has no kind: add kind = … with one of {listed(ELEMENT_KINDS)}")
    kind = known_choice(entry["kind"], ELEMENT_KINDS, f"{place}: kind")
    name = entry.get("name")
    named = f" {in_toml(name)}" if isinstance(name, str) and name else ""
    place = f"{place} ({entry['kind']}{named})"
    given = {key: value for key, value in entry.items() if key != "kind"}
    if kind not in FROM_FILES or not _comes_from_file(kind, given, place):
        return _build(kind, given, place, beside)
    form = FROM_FILES[kind]
    built = _build(form, given, place, beside)
    with checks.within(f"{place}: {first_field(form)}"):
        beside.path(getattr(built, first_field(form)))
        return built.made(beside.folder)


def _comes_from_file(kind: type, given: Mapping[str, Any], place: str) -> bool:
    """Whether a file describes the element instead of its fields; raises if both or neither are given."""
    form, fields = FROM_FILES[kind], parameters_of(kind)
    key = first_field(form)
    if key not in given:
        for name in fields:
            if needed(fields[name]) and name not in given:
                raise InputError(f'{place} has no field "{name}", and no "{key}" that would give it')
        return False
    for name in given:
        if name in fields and name not in parameters_of(form):
            raise InputError(f"{place} has a {key} and a {name}: the file gives the {name}, leave one out")
    return True


def known_choice(name: object, choices: Mapping[str, Any], what: str) -> Any:
    """The choice of that name; capitals, spaces, "-" and "_" are ignored.

    Args:
        name: the name in the file.
        choices: the choices by name.
        what: noun for messages.

    Raises:
        InputError: not text, or an unknown name; the message suggests a similar name or lists all.
    """
    if not isinstance(name, str):
        raise InputError(f"{what} is {in_toml(name)}: write it as text, one of {listed(choices)}")
    plain = {_plain(choice): choice for choice in choices}
    if _plain(name) in plain:
        return choices[plain[_plain(name)]]
    raise InputError(f"{what} {in_toml(name)} is not known{_nearest(name[:LONGEST_SHOWN], choices)}")


def _plain(name: str) -> str:
    return re.sub(r"[\s_-]", "", name).lower()


def _nearest(name: str, choices: Iterable[str]) -> str:
    """A suggestion if a similar name exists, else a list of all names."""
    close = difflib.get_close_matches(name.lower(), list(choices), n=1, cutoff=LIKELY)
    if close:
        return f': did you mean "{close[0]}"?'
    return f"; known are {listed(choices)}"


def check_keys(
    given: Mapping[str, Any], known: Iterable[str], required: Iterable[str], place: str, noun: str
) -> None:
    """Raise for unknown keys, then for missing ones.

    Args:
        given: a table.
        known: allowed keys.
        required: keys that must be present.
        place: location of the table, for messages.
        noun: noun for a key, such as "field".

    Raises:
        InputError: a key is unknown or missing.
    """
    known = list(known)
    for key in given:
        if key not in known:
            raise InputError(f"{place} has an unknown {noun} {in_toml(key)}{_nearest(key[:LONGEST_SHOWN], known)}")
    for key in required:
        if key not in given:
            raise InputError(f'{place} has no {noun} "{key}", which it needs')


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    """The types of a class's fields, resolved: slow in Python."""
    return get_type_hints(kind)


def _build(kind: type, given: Mapping[str, Any], place: str, beside: Beside) -> Any:
    """Build an object of a dataclass from the fields of a table."""
    fields = parameters_of(kind)
    check_keys(given, fields, [name for name in fields if needed(fields[name])], place, "field")
    hints = _hints(kind)
    values = {
        name: _read_value(value, hints[name], unit_of(fields[name]), f"{place}: {name}", beside)
        for name, value in given.items()
    }
    pattern = given.get("pattern")
    if isinstance(pattern, str) and any(field.name == "source" for field in dataclasses.fields(kind)):
        values["source"] = pattern
    with checks.within(place):
        return kind(**values)


def _takes_arrays(choices: tuple[Any, ...]) -> bool:
    return set(choices) >= _ARRAY_LIKE or any(np.ndarray in (choice, get_origin(choice)) for choice in choices)


def _read_value(given: Any, hint: Any, unit: str | None, what: str, beside: Beside) -> Any:
    """Convert a value of a file to the type of the field."""
    choices = alternatives(hint)
    family, arrays = family_of(choices), _takes_arrays(choices)
    items = next((get_args(choice) for choice in choices if get_origin(choice) is tuple), None)
    if (
        family is not None
        and not (isinstance(given, list) and items)
        and not (isinstance(given, str) and str in choices)
        and not (arrays and not isinstance(given, dict))
    ):
        return _read_named(given, family, arrays, what, beside)
    if arrays:
        _check_no_name(given, family, what, beside)
        return read_array(given, unit, family is not None and family.base is Pattern, what, beside)
    is_table = isinstance(given, dict) and any(map(dataclasses.is_dataclass, choices))
    if items and (isinstance(given, list) or not (is_table or {int, float, str} & set(choices))):
        return _read_list(given, items, unit, what, beside)
    for choice in choices:
        if choice is Affine:
            return _read_affine(given, what, beside)
        if get_origin(choice) is dict:
            entry = get_args(choice)[1]
            table = _checked_table(given, what)
            return {key: _read_value(one, entry, unit, f"{what}: {key}", beside) for key, one in table.items()}
        if dataclasses.is_dataclass(choice) and inspect.isclass(choice):
            return _build(choice, _checked_table(given, what), what, beside)
    if unit is not None:
        return units.parse(given, unit, what)
    return _read_plain(given, choices, what)


def _check_no_name(given: Any, family: Family | None, what: str, beside: Beside) -> None:
    """Raise if the name of a pattern is given as text, which stands for a file."""
    if family is None or not isinstance(given, str) or beside.exists(given):
        return
    if given in {**family.names, **family.arrays}:
        raise InputError(
            f"{what}: there is no file {in_toml(given)} in {beside.folder}; a {family.noun} is written by name: "
            f"{{ name = {in_toml(given)}, … }}"
        )


def _checked_table(given: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(given, dict):
        raise InputError(
            f"{what} is {in_toml(given)}: it is a table of fields, in braces or below a line of its own, such as "
            f"[sensor.electronics]"
        )
    return given


def _read_list(given: Any, hints: tuple[Any, ...], unit: str | None, what: str, beside: Beside) -> tuple[Any, ...]:
    """A list of fixed length, or of any length if the hints are ``(float, ...)``."""
    if len(hints) == 2 and hints[1] is Ellipsis:
        wanted, fits = "", isinstance(given, list)
        family = family_of(alternatives(hints[0]))
        hints = (hints[0],) * (len(given) if isinstance(given, list) else 2)
    else:
        wanted, fits = f" of {len(hints)}", isinstance(given, list) and len(given) == len(hints)
        family = None
    if not fits:
        example = {
            None: "200" if hints[0] is int else "0",
            "length": '"1 mm"',
            "angle": '"1 deg"',
            "time": '"1 ms"',
            "area": '"1 um2"',
            "area squared": '"1 um4"',
        }[unit]
        if str in alternatives(hints[0]):
            example = '"…"'
        example = example if family is None else family.example
        raise InputError(
            f"{what} is {in_toml(given)}: it is a list{wanted}, like [{', '.join([example] * len(hints))}]"
        )
    return tuple(
        _read_value(value, hint, unit, f"{what}, number {number} of {len(hints)},", beside)
        for number, (value, hint) in enumerate(zip(given, hints, strict=True), start=1)
    )


def _read_plain(given: Any, choices: tuple[Any, ...], what: str) -> Any:
    """Check a number, text or boolean; TOML distinguishes these types."""
    if type(given) in choices:
        return given
    if type(given) is int and float in choices:
        return float(given)
    names = {int: "a whole number", float: "a number", str: "text in quotes", bool: "true or false"}
    wanted = " or ".join(names[choice] for choice in choices if choice in names)
    raise InputError(f"{what} is {in_toml(given)}: it is {wanted or 'something that a camera file cannot hold'}")


def _read_named(given: Any, family: Family, arrays: bool, what: str, beside: Beside) -> Any:
    """An object by name; if the field accepts arrays, also a name that stands for an array."""
    if not isinstance(given, dict):
        raise InputError(f"{what} is {in_toml(given)}: write a {family.noun} by name, like {family.example}")
    extra = family.arrays if arrays else {}
    if "name" not in given:
        raise InputError(f"{what} has no name: add name = … with one of {listed([*family.names, *extra])}")
    parameters = {key: value for key, value in given.items() if key != "name"}
    kind = known_choice(given["name"], {**family.names, **extra}, f"{what}: name")
    built = _build(kind, parameters, f"{what} ({given['name']})", beside)
    if kind not in extra.values():
        return built
    with checks.within(what):
        return built.made()


def _read_affine(given: Any, what: str, beside: Beside) -> Affine:
    with checks.within(what):
        return Affine(read_array(given, None, False, what, beside))


def read_array(given: Any, unit: str | None, transmission: bool, what: str, beside: Beside) -> NDArray[np.float64]:
    """An array from a file next to the camera file, or from nested lists; each number states its unit, if any."""
    if isinstance(given, str):
        if given in beside.arrays:
            return beside.arrays[given]
        with checks.within(what):
            file = beside.path(given)
        return _read_array_file(file, given, unit, transmission, what)
    with_units = given if unit is None else _with_units(given, unit, what)
    try:
        values = np.array(with_units, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.array(0.0)
    if values.ndim == 0:
        example = {None: "[[0, 1], [1, 0]]", "length": '[["1 um", "2 um"], ["2 um", "1 um"]]'}.get(
            unit, '[["1 deg", "2 deg"]]'
        )
        raise InputError(
            f"{what} is {in_toml(given)}: it is the name of a file, or rows of equally many numbers, "
            f"like {example}"
        )
    return values


def _with_units(given: Any, unit: str, what: str) -> Any:
    if isinstance(given, list):
        return [_with_units(each, unit, what) for each in given]
    return units.parse(given, unit, what)


def _read_array_file(
    file: Path, name: str, unit: str | None, transmission: bool, what: str
) -> NDArray[np.float64]:
    """Numbers as float64: .npy and .csv unchanged, in SI units; pictures as a fraction of full scale.

    For transmissions, integers in a .npy file are a fraction of full scale too, as in a picture.
    """
    if not os.path.lexists(file):
        raise InputError(f'{what}: there is no file "{name}" in {file.parent}')
    ending = file.suffix.lower()
    with checks.within(what):
        check_file(file)
        if ending == ".csv":
            with reading(file, "a table of numbers"):
                return np.loadtxt(file, delimiter=",", dtype=np.float64, ndmin=2)
        if ending == ".npy":
            values = read_npy(file)
            if values.dtype.kind not in "fiub":
                raise InputError(f"{file} holds {values.dtype}, not real numbers")
            if values.dtype.kind == "f" or not transmission:
                return np.asarray(values, dtype=np.float64)
    if unit is not None:
        raise InputError(
            f"{what} is {name}: only .npy and .csv hold numbers with a unit, in SI ({units.SI_NAMES[unit]}s)"
        )
    with checks.within(what):
        return read_grey(file)
