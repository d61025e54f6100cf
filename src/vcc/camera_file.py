"""Camera files: a camera as TOML, with units in every length, written and read without loss.

::

    [[elements]]
    kind = "lens"
    z = "0 mm"
    focal_length = "50 mm"
    diameter = "20 mm"

    [[elements]]
    kind = "mask"
    z = "40 mm"
    pattern = "mask.png"       # .png, .tif, .npy, .csv …, found beside the camera file
    width = "30 mm"

    [sensor]
    z = "52 mm"
    shape = [500, 500]
    pitch = "48 um"

A mask's ``pattern`` is the name of a file, rows of numbers (``[[0, 1], [1, 0]]``) or a pattern by
name: ``{ name = "cosine_sum", period = ["1 mm", "1 mm"], harmonics = 3 }``. Names are those of the
classes in `vcc.patterns` (``open``, ``circle``, ``polygon``, ``cells``, ``cosine_sum``,
``bounded``) and ``mura``.

Reading and writing go by the fields of the dataclasses, their types and their units, so that a new
element or pattern needs no code here.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
import tomllib
import types
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from vcc import optics, patterns, units
from vcc.camera import Camera
from vcc.errors import InputError
from vcc.optics import Element
from vcc.patterns import Cells, FunctionPattern, Pattern
from vcc.sensor import Sensor

_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def _friendly(kind: type) -> str:
    """The name of a class in a file: CosineSum is "cosine_sum"."""
    return _CAMEL.sub("_", kind.__name__).lower()


ELEMENT_KINDS: dict[str, type[Element]] = {
    _friendly(kind): kind
    for kind in (getattr(optics, name) for name in optics.__all__)
    if isinstance(kind, type) and issubclass(kind, Element) and kind is not Element
}
"""Which class each ``kind`` in a camera file stands for. Add your own to read and write them."""

PATTERN_NAMES: dict[str, type[Pattern]] = {
    _friendly(kind): kind
    for kind in vars(patterns).values()
    if isinstance(kind, type) and issubclass(kind, Pattern) and kind not in (Pattern, FunctionPattern)
}
"""Which class each ``name`` of a pattern in a camera file stands for."""

_MURA = "mura"


def load_camera(path: str | PathLike[str]) -> Camera:
    """The camera that a TOML file describes; see `vcc.camera_file` for its form.

    Args:
        path: the file. Pictures of masks are found relative to its folder.

    Raises:
        InputError: no such file, not TOML, or anything in it that is unknown, missing, of a wrong
            type, without a unit or refused by the element itself. The message names the file, the
            element (counted from 1) and the field.
    """
    file = Path(path).expanduser()
    tables = _read_toml(file)
    _check_keys(tables, {"elements", "sensor"}, {"sensor"}, f"{file}", "table")
    elements = tables.get("elements", [])
    if not isinstance(elements, list) or not all(isinstance(entry, dict) for entry in elements):
        raise InputError(f"{file}: each element starts with a line [[elements]] of its own")
    if not isinstance(tables["sensor"], dict):
        raise InputError(f"{file}: the sensor is a table that starts with a line [sensor]")
    built = [_read_element(entry, number, file) for number, entry in enumerate(elements, start=1)]
    sensor = _build(Sensor, tables["sensor"], f"{file}: sensor", file.parent)
    try:
        return Camera(built, sensor)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def save_camera(camera: Camera, path: str | PathLike[str]) -> None:
    """Write a camera as TOML, so that `load_camera` gives back an equal one.

    Masks given as arrays are written beside the file, as .npy named after it and the element,
    unless the file that they came from is there already. Files appear whole or not at all.

    Args:
        camera: what to write.
        path: where to; an older file of that name is replaced.

    Raises:
        InputError: an element or pattern that a file cannot hold (any Python function), or a folder
            that cannot be written to.
    """
    import tomli_w

    from vcc.formats.atomic import atomic_path

    file = Path(path).expanduser()
    arrays: dict[str, NDArray[np.float64]] = {}
    tables = {
        "elements": [
            _write_element(element, number, file, arrays)
            for number, element in enumerate(camera.elements, start=1)
        ],
        "sensor": _Writer(file, "sensor", "sensor", arrays).fields_of(camera.sensor),
    }
    if not camera.elements:
        del tables["elements"]
    for name, values in arrays.items():  # first, so that the camera file never names a missing one
        with atomic_path(file.parent / name) as temporary, temporary.open("wb") as stream:
            np.save(stream, values)
    with atomic_path(file) as temporary:
        temporary.write_text(tomli_w.dumps(tables), encoding="utf-8")


# --- reading ---


def _read_toml(file: Path) -> dict[str, Any]:
    try:
        content = file.read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise InputError(f"there is no camera file {file}") from None
    except UnicodeDecodeError:
        raise InputError(f"{file} is not a text file in UTF-8, as TOML is") from None
    except OSError as error:
        raise InputError(f"{file} could not be read: {error.strerror or error}") from None
    try:
        return tomllib.loads(content)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file} is not valid TOML: {error}") from None


def _read_element(entry: Mapping[str, Any], number: int, file: Path) -> Element:
    place = f"{file}: element {number}"
    if "kind" not in entry:
        known = ", ".join(f'"{kind}"' for kind in ELEMENT_KINDS)
        raise InputError(f"{place} has no kind: add kind = … with one of {known}")
    kind = _known(entry["kind"], ELEMENT_KINDS, f"{place}: kind")
    name = entry.get("name")
    named = f' "{name}"' if isinstance(name, str) and name else ""
    given = {key: value for key, value in entry.items() if key != "kind"}
    element: Element = _build(kind, given, f"{place} ({entry['kind']}{named})", file.parent)
    return element


def _known(name: object, choices: Mapping[str, Any], what: str) -> Any:
    """The choice of that name, in which capitals, spaces, "-" and "_" do not matter."""
    if not isinstance(name, str):
        raise InputError(f"{what} is {name!r}: write it as text, one of {_listed(choices)}")
    plain = {_plain(choice): choice for choice in choices}
    if _plain(name) in plain:
        return choices[plain[_plain(name)]]
    raise InputError(f'{what} "{name}" is not known{_nearest(name, choices)}')


def _plain(name: str) -> str:
    return re.sub(r"[\s_-]", "", name).lower()


def _listed(choices: Iterable[str]) -> str:
    return ", ".join(f'"{choice}"' for choice in choices)


def _nearest(name: str, choices: Iterable[str]) -> str:
    close = difflib.get_close_matches(name.lower(), list(choices), n=1, cutoff=0.5)
    if close:
        return f': did you mean "{close[0]}"?'
    return f"; known are {_listed(choices)}"


def _check_keys(
    given: Mapping[str, Any], known: Iterable[str], required: Iterable[str], place: str, noun: str
) -> None:
    """Refuse what is not known, then what is missing."""
    known = list(known)
    for key in given:
        if key not in known:
            raise InputError(f'{place} has an unknown {noun} "{key}"{_nearest(key, known)}')
    for key in required:
        if key not in given:
            raise InputError(f'{place} has no {noun} "{key}", which it needs')


def _build(kind: type, given: Mapping[str, Any], place: str, folder: Path) -> Any:
    """An object of a dataclass from the fields of a table."""
    fields = _fields(kind)
    _check_keys(given, fields, [name for name in fields if _needed(fields[name])], place, "field")
    hints = get_type_hints(kind)
    values = {
        name: _read_value(value, hints[name], _unit(fields[name]), f"{place}: {name}", folder)
        for name, value in given.items()
    }
    pattern = given.get("pattern")
    if isinstance(pattern, str) and any(field.name == "source" for field in dataclasses.fields(kind)):
        values["source"] = pattern
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def _fields(kind: type) -> dict[str, dataclasses.Field[Any]]:
    """The fields that a file holds: parameters, not remarks that do not count in a comparison."""
    return {field.name: field for field in dataclasses.fields(kind) if field.init and field.compare}


def _needed(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _unit(field: dataclasses.Field[Any]) -> str | None:
    """The dimension of a field; None for plain numbers, text and patterns."""
    unit = field.metadata.get("unit")
    return None if unit is None else str(unit)


def _alternatives(hint: Any) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def _read_value(given: Any, hint: Any, unit: str | None, what: str, folder: Path) -> Any:
    """A value of a file as the type that a field wants."""
    choices = _alternatives(hint)
    if any(isinstance(choice, type) and issubclass(choice, Pattern) for choice in choices):
        return _read_pattern(given, len(choices) > 1, what, folder)
    if any(get_origin(choice) is np.ndarray for choice in choices):
        return _read_array(given, what, folder)
    pairs = [get_args(choice) for choice in choices if get_origin(choice) is tuple]
    if pairs and (isinstance(given, list) or not {int, float, str} & set(choices)):
        return _read_list(given, pairs[0], unit, what, folder)
    if unit is not None:
        return units.parse(given, unit, what)
    return _read_plain(given, choices, what)


def _read_list(given: Any, hints: tuple[Any, ...], unit: str | None, what: str, folder: Path) -> tuple[Any, ...]:
    example = {None: "0", "length": '"1 mm"', "angle": '"1 deg"', "time": '"1 ms"'}[unit]
    if not isinstance(given, list) or len(given) != len(hints):
        wanted = ", ".join([example] * len(hints))
        raise InputError(f"{what} is {given!r}: it is a list of {len(hints)}, like [{wanted}]")
    return tuple(
        _read_value(value, hint, unit, f"{what}, number {number} of {len(hints)},", folder)
        for number, (value, hint) in enumerate(zip(given, hints, strict=True), start=1)
    )


def _read_plain(given: Any, choices: tuple[Any, ...], what: str) -> Any:
    """Numbers, text and truth values, which TOML keeps apart."""
    if type(given) in choices:
        return given
    if type(given) is int and float in choices:
        return float(given)
    names = {int: "a whole number", float: "a number", str: "text in quotes", bool: "true or false"}
    wanted = " or ".join(names[choice] for choice in choices if choice in names)
    raise InputError(f"{what} is {given!r}: it is {wanted or 'something else'}")


def _read_pattern(given: Any, arrays: bool, what: str, folder: Path) -> Any:
    """A pattern by name; where a field takes arrays, also one from a file or rows of numbers."""
    if isinstance(given, dict):
        if "name" not in given:
            names = _listed([*PATTERN_NAMES, _MURA])
            raise InputError(f"{what} has no name: add name = … with one of {names}")
        parameters = {key: value for key, value in given.items() if key != "name"}
        kind = _known(given["name"], {**PATTERN_NAMES, _MURA: _Mura}, f"{what}: name")
        built = _build(kind, parameters, f"{what} ({given['name']})", folder)
        if not isinstance(built, _Mura):
            return built
        if arrays:
            return built.cells(what)
    if arrays:
        return _read_array(given, what, folder)
    raise InputError(
        f'{what} is {given!r}: write a pattern by name, like {{ name = "circle", diameter = "5 mm" }}'
    )


@dataclasses.dataclass(frozen=True)
class _Mura:
    """`vcc.patterns.mura` as a file writes it; its cells are an array."""

    prime: int

    def cells(self, what: str) -> NDArray[np.float64]:
        try:
            return patterns.mura(self.prime)
        except InputError as error:
            raise InputError(f"{what}: {error}") from None


def _read_array(given: Any, what: str, folder: Path) -> NDArray[np.float64]:
    """Transmissions from a file beside the camera file, or from rows of numbers."""
    if isinstance(given, str):
        return _read_array_file(folder / Path(given).expanduser(), given, what)
    try:
        values = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.array(0.0)
    if values.ndim != 2:
        raise InputError(
            f"{what} is {given!r}: it is the name of a file, or rows of equally many numbers, "
            "like [[0, 1], [1, 0]]"
        )
    return values


def _read_array_file(file: Path, name: str, what: str) -> NDArray[np.float64]:
    """Transmission, 0 to 1, as float64: .npy and .csv as they are, pictures by `read_grey`."""
    if not file.is_file():
        raise InputError(f'{what}: there is no file "{name}" in {file.parent}')
    ending = file.suffix.lower()
    try:
        if ending == ".csv":
            return np.loadtxt(file, delimiter=",", dtype=np.float64, ndmin=2)
        if ending == ".npy":
            values = np.load(file, allow_pickle=False)
            if values.ndim == 2 and values.dtype.kind == "f":
                return np.asarray(values, dtype=np.float64)
    except (ValueError, OSError, EOFError) as error:
        raise InputError(f"{what}: {name} could not be read: {error}") from None
    from vcc.formats.pictures import read_grey

    try:
        return read_grey(file)
    except InputError as error:
        raise InputError(f"{what}: {error}") from None


# --- writing ---


def _write_element(
    element: Element, number: int, file: Path, arrays: dict[str, NDArray[np.float64]]
) -> dict[str, Any]:
    for name, kind in ELEMENT_KINDS.items():
        if type(element) is kind:
            slug = re.sub(r"\W+", "_", element.name) or f"{name}_{number}"
            writer = _Writer(file, element.label, slug, arrays)
            return {"kind": name, **writer.fields_of(element)}
    raise InputError(
        f"{element.label} cannot be written to {file.name}: a camera file knows "
        f"{_listed(ELEMENT_KINDS)}. Add its class to vcc.camera_file.ELEMENT_KINDS, "
        "in the program that reads the file too"
    )


@dataclasses.dataclass(frozen=True)
class _Writer:
    """Turns one object into a table; arrays are put aside, to be written as files of their own."""

    file: Path
    label: str
    slug: str
    arrays: dict[str, NDArray[np.float64]]

    def fields_of(self, thing: Any) -> dict[str, Any]:
        """The fields that differ from their defaults."""
        table = {}
        for name, field in _fields(type(thing)).items():
            value = getattr(thing, name)
            if value is None or (not _needed(field) and value == field.default):
                continue
            if isinstance(value, Pattern):
                table[name] = self.pattern(value, thing)
            else:
                table[name] = self.value(value, _unit(field), name)
        return table

    def value(self, value: Any, unit: str | None, name: str) -> Any:
        if isinstance(value, tuple | list):
            return [self.value(part, unit, name) for part in value]
        if isinstance(value, np.ndarray):
            return self.array(value)
        if isinstance(value, np.generic):
            value = value.item()
        if unit is not None:
            return units.text(value, unit, exact=True)
        if isinstance(value, bool | int | float | str):
            return value
        raise InputError(f"{name} of {self.label} is a {type(value).__name__}, which a camera file cannot hold")

    def array(self, values: NDArray[np.float64]) -> str:
        """The name of the file that will hold an array."""
        name, count = f"{self.file.stem}_{self.slug}.npy", 1
        while name in self.arrays:
            count += 1
            name = f"{self.file.stem}_{self.slug}_{count}.npy"
        self.arrays[name] = values
        return name

    def pattern(self, pattern: Pattern, owner: Any) -> Any:
        if isinstance(pattern, Cells) and _is_plain_array(pattern, owner):
            return self.plain_array(pattern.values, getattr(owner, "source", ""))
        for name, kind in PATTERN_NAMES.items():
            if type(pattern) is kind:
                return {"name": name, **self.fields_of(pattern)}
        function = getattr(pattern, "function", pattern)
        raise InputError(
            f"the pattern of {self.label} is {getattr(function, '__name__', repr(function))}, "
            "a piece of Python that a camera file cannot hold. Use a pattern of vcc.patterns "
            f"({', '.join(kind.__name__ for kind in PATTERN_NAMES.values())}) or sample it on a "
            "grid: Mask(pattern=function(x, y), width=…) with arrays x and y of cell centres"
        )

    def plain_array(self, values: NDArray[np.float64], source: str) -> Any:
        """The file that it came from if that is within reach, a MURA by name, else a new file."""
        if source and self.holds(source, values):
            return source
        size = len(values)
        if values.shape == (size, size) and _is_mura(values):
            return {"name": _MURA, "prime": size}
        return self.array(values)

    def holds(self, source: str, values: NDArray[np.float64]) -> bool:
        try:
            return np.array_equal(_read_array(source, "", self.file.parent), values)
        except InputError:
            return False


def _is_plain_array(cells: Cells, owner: Any) -> bool:
    """Whether an element makes just these cells of an array and its own width and height."""
    width = getattr(owner, "width", None)
    return width is not None and cells == Cells(cells.values, width, owner.height)


def _is_mura(values: NDArray[np.float64]) -> bool:
    if not math.isclose(values.mean(), 0.5, abs_tol=0.1):  # half of its cells are open
        return False
    try:
        return np.array_equal(values, patterns.mura(len(values)))
    except InputError:
        return False
