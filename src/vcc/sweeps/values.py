"""The values of a parameter: numbers and objects, or text as in camera files."""

from __future__ import annotations

import dataclasses
import math
import re
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import units
from vcc.base.describe import Brief, in_brief, kind_in_words, parameters_in_words, with_parameters
from vcc.base.errors import InputError
from vcc.files.camera_families import PATTERN_NAMES, needed, parameters_of
from vcc.files.camera_reading import Beside, read_field
from vcc.learn.parameters import Parameter, place
from vcc.optics.mask import Mask
from vcc.optics.train import Train
from vcc.shapes.patterns import Cells

HERE = Beside(Path())
"""The files of the current folder."""
MOST_VALUES = 10**6
"""Values of a range given as text."""
SI = {"length": "m", "angle": "rad", "time": "s", None: ""}
"""Units of coordinates."""

_EXAMPLES = {"length": "50mm:54mm:40", "angle": "0deg:30deg:7", "time": "1ms:5ms:5", None: "0.5:1:6"}
"""Example ranges as text, by dimension."""
_OPENS, _CLOSES = "[{(", "]})"


@dataclass(frozen=True, eq=False, repr=False)
class Varied(Brief):
    """A parameter and its values.

    Args:
        name: as in `vcc.learn.parameters`.
        values: as the camera accepts them, SI units.
        labels: the values as text.
        unit: of numeric values: "m", "rad", "s"; "" for dimensionless numbers and other values.
    """

    name: str
    values: tuple[Any, ...]
    labels: tuple[str, ...]
    unit: str = ""

    def __len__(self) -> int:
        return len(self.values)

    def taken(self, places: Iterable[int]) -> Varied:
        """The values with these indices, in that order."""
        listed = list(places)
        values, labels = (tuple(each[n] for n in listed) for each in (self.values, self.labels))
        return dataclasses.replace(self, values=values, labels=labels)

    @property
    def coordinates(self) -> NDArray[Any]:
        """The values if all are numbers, otherwise the labels."""
        if self.values and all(type(each) in (int, float) for each in self.values):
            return np.array(self.values)
        return np.array(self.labels)

    @property
    def values_in_words(self) -> str:
        """The range of values, or the first few, as text."""
        if len(self) > 2 and self.coordinates.dtype.kind in "if":
            return f"{self.labels[0]} … {self.labels[-1]}, {len(self)} values"
        return first_few_labels(self.labels)


def first_few_labels(labels: Sequence[str], most: int = 4) -> str:
    """Labels in one line, the first few of many."""
    return ", ".join(labels[:most]) + (f" … ({len(labels)})" if len(labels) > most else "")


def varied(train: Train, name: str, given: Any, beside: Beside = HERE) -> Varied:
    """The values of a parameter.

    Args:
        train: the camera that has the parameter.
        name: of the parameter.
        given: values in a list or an array; or text: ``"50mm:54mm:40"``, 40 values in equal steps, ``"50 mm,
            52 mm"``, ``"mura, circle"``. Each value may be text itself, as in a camera file.
        beside: the files that text may name.

    Raises:
        InputError: unknown parameter; no values; invalid text.
    """
    found, in_words = place(train, name), False
    listed: Sequence[Any]
    if isinstance(given, str):
        numbers = _range_in(given, found)
        listed = _parted(given) if numbers is None else numbers
        in_words = numbers is None
    elif isinstance(given, Iterable):
        listed = list(given)
    else:
        raise InputError(f"the values of {name} are a list, not one {type(given).__name__}: write [{given!r}]")
    if not listed:
        raise InputError(f"{name} has no values: give one at least")
    return _of(found, listed, beside, in_words=in_words)


def _of(found: Parameter, listed: Sequence[Any], beside: Beside = HERE, in_words: bool = False) -> Varied:
    values = tuple(_value(found, each, beside, in_words) for each in listed)
    dimension = _dimension(found)
    pairs = enumerate(zip(values, listed, strict=True))
    labels = tuple(_label(value, each, number, dimension) for number, (value, each) in pairs)
    return Varied(found.name, values, labels, SI[dimension])


def range_of(train: Train, name: str, given: Any) -> tuple[float, float] | None:
    """The ends of an interval, from two numbers in a tuple or from ``"50mm:54mm"``; None for anything else.

    Raises:
        InputError: unknown parameter; ends that are not finite numbers.
    """
    found = place(train, name)
    if isinstance(given, str):
        given = tuple(part for part in given.split(":")) if given.count(":") == 1 else None
        if given is None or _quantities(given, found) is None:
            return None
    if not (isinstance(given, tuple) and len(given) == 2):
        return None
    ends = _quantities(given, found)
    if ends is None:
        raise InputError(
            f"{name} goes from {given[0]!r} to {given[1]!r}, which are not numbers: give a list of values"
        )
    return ends[0], ends[1]


def taking(train: Train, name: str, numbers: Sequence[float]) -> Varied:
    """A parameter with these numbers as values, SI units."""
    return _of(place(train, name), list(numbers))


# --- text ---


def _range_in(given: str, found: Parameter) -> list[float] | None:
    """Numbers in equal steps from text like ``"50mm:54mm:40"``; None for other text."""
    if ":" not in given or not _is_number(found):
        return None
    parts = [part.strip() for part in given.split(":")]
    ends = _quantities(parts[:2], found)
    if ends is None or len(parts) > 3:
        kind = _dimension(found) or "number"
        raise InputError(
            f'{found.name} is "{given}": a range goes from one {kind} to another, in so many values, like '
            f'"{_EXAMPLES[_dimension(found)]}"'
        )
    if len(parts) == 2:
        raise InputError(
            f'{found.name} is "{given}", which does not say how many values there are: write "{given}:20", or '
            "draw from it by a random or Sobol' design"
        )
    if not (re.fullmatch(r"\d{1,9}", parts[2]) and 1 <= int(parts[2]) <= MOST_VALUES):
        raise InputError(
            f'{found.name} is "{given}": how many values it has is a whole number from 1 to {MOST_VALUES}, not '
            f'"{parts[2]}"'
        )
    return [float(each) for each in np.linspace(ends[0], ends[1], int(parts[2]))]


def _is_number(found: Parameter) -> bool:
    """Whether a parameter is a number, with a unit or without."""
    return _dimension(found) is not None or type(found.value) in (int, float)


def _quantities(parts: Sequence[Any], found: Parameter) -> list[float] | None:
    """Finite numbers in the parameter's unit; None if a part is not one."""
    dimension, numbers = _dimension(found), []
    for part in parts:
        try:
            if isinstance(part, str):
                numbers.append(float(part) if dimension is None else units.parse(part, dimension, found.name))
            else:
                numbers.append(float(part))
        except (InputError, ValueError, TypeError):
            return None
    return numbers if all(map(math.isfinite, numbers)) else None


def _parted(text: str) -> list[Any]:
    """The parts between commas, except commas in brackets and quotes, parsed as TOML if possible, or as text."""
    depth, quote, parts = 0, "", [""]
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        depth += (letter in _OPENS) - (letter in _CLOSES) if not quote else 0
        if letter == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [_written(part.strip()) for part in parts if part.strip()]


def _written(part: str) -> Any:
    try:
        return tomllib.loads(f"x = {part}")["x"]
    except tomllib.TOMLDecodeError:
        return part


def _value(found: Parameter, given: Any, beside: Beside, in_words: bool) -> Any:
    """A value as the camera accepts it; numbers with a dimension in text must have a unit."""
    if isinstance(given, np.generic):
        given = given.item()
    in_words = in_words or isinstance(given, str | dict) or (isinstance(given, list) and _has_text(given))
    if not in_words:
        return _as_tuple(given) if isinstance(given, list) and isinstance(found.value, tuple) else given
    kind = type(found.holder)
    if isinstance(given, str) and isinstance(found.holder, Mask) and found.field == "pattern":
        given = _sized(given, found.holder, beside)
    return read_field(kind, found.field, given, found.name, beside)


def _has_text(given: list[Any]) -> bool:
    return any(isinstance(each, str) or (isinstance(each, list) and _has_text(each)) for each in given)


def _as_tuple(given: Any) -> Any:
    return tuple(map(_as_tuple, given)) if isinstance(given, list) else given


def _sized(name: str, mask: Mask, beside: Beside) -> Any:
    """The table of a pattern that is given by name alone, with the size of the mask that it replaces.

    A circle or polygon is as wide as the mask, a MURA has as many cells as its array.
    """
    plain = re.sub(r"[\s_-]", "_", name).lower()
    if beside.exists(name):
        return name
    if plain not in ("mura", *PATTERN_NAMES):
        raise InputError(
            f'the pattern of {mask.label} is "{name}", which is no file in {beside.folder.resolve()}, and no '
            f"pattern by name: there are mura, {', '.join(PATTERN_NAMES)}"
        )
    cells = mask.pattern if isinstance(mask.pattern, Cells) else None
    if plain == "mura":
        rows = None if cells is None else len(cells.values)
        return {"name": name} if rows is None else {"name": name, "prime": rows}
    fields = parameters_of(PATTERN_NAMES[plain])
    wide = mask.width or getattr(mask.pattern, "width", None) or getattr(mask.pattern, "diameter", None)
    if wide is None:
        return {"name": name}
    sizes = [key for key in ("diameter", "width", "height") if key in fields and needed(fields[key])]
    return {"name": name, **dict.fromkeys(sizes, units.text(wide, exact=True))}


# --- labels ---


def _dimension(found: Parameter) -> str | None:
    field = next(each for each in dataclasses.fields(found.holder) if each.name == found.field)
    unit = field.metadata.get("unit")
    return None if unit is None else str(unit)


def _label(value: Any, given: Any, number: int, dimension: str | None) -> str:
    """A value as text: as it was given if it was text, otherwise a short description."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return units.short(value, dimension) if dimension else f"{value:.6g}"
    if isinstance(given, str):
        return given
    if isinstance(given, dict):
        rest = ", ".join(f"{key} {each}" for key, each in given.items() if key != "name")
        return with_parameters(str(given.get("name", "")), rest)
    if dataclasses.is_dataclass(value) and not isinstance(value, Cells):
        return with_parameters(kind_in_words(type(value)), parameters_in_words(value))
    if isinstance(value, tuple) and all(isinstance(each, int | float) for each in value):
        return f"({', '.join(units.short(each, dimension) if dimension else f'{each:.6g}' for each in value)})"
    if isinstance(value, Cells | np.ndarray | list | tuple):
        return str(number)
    return getattr(value, "__name__", None) or in_brief(value)
