"""Parameters of frozen dataclasses as text, with the units given in their fields."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.units import short

LONGEST_LIST = 6
"""Longest list of numbers that is written out; of longer ones, the number and the range are written."""


def parameters_in_words(thing: Any, leave_out: tuple[str, ...] = ()) -> str:
    """The parameters of a dataclass that differ from their defaults, such as ``"diameter 20 mm"``.

    Numbers are rounded to 6 digits; arrays and long lists are described by shape and range, dataclasses in
    fields by their own text (``described()`` if they have it).

    Args:
        thing: an instance of a dataclass; fields with ``metadata={"unit": ...}`` are written with that unit.
        leave_out: names of fields to skip.
    """
    parts = []
    for parameter in fields(thing):
        value = getattr(thing, parameter.name)
        if parameter.name in leave_out or value is None or is_default(value, parameter):
            continue
        name = parameter.name.replace("_", " ")
        if isinstance(value, bool):  # it differs from its default, so its name is enough
            parts.append(name if value else f"not {name}")
        else:
            parts.append(f"{name} {_value(value, parameter.metadata.get('unit'))}")
    return ", ".join(parts)


def parameters_listed(thing: Any, leave_out: tuple[str, ...] = ()) -> list[tuple[str, str]]:
    """All parameters of a dataclass that are not empty, defaults too: (name, value with its unit), as text.

    Args:
        thing: as for `parameters_in_words`.
        leave_out: names of fields to skip.
    """
    listed = []
    for parameter in fields(thing):
        value = getattr(thing, parameter.name)
        if parameter.name in leave_out or value is None or (isinstance(value, str) and not value):
            continue
        said = {True: "yes", False: "no"}[value] if isinstance(value, bool) else ""
        unit = parameter.metadata.get("unit")
        listed.append((parameter.name.replace("_", " "), said or _value(value, unit)))
    return listed


class Brief:
    """Base of dataclasses (``repr=False``) whose arrays and long lists are described by shape and range."""

    def __repr__(self) -> str:
        shown = (part for part in fields(self) if part.repr)  # type: ignore[arg-type]
        values = ", ".join(f"{part.name}={in_brief(getattr(self, part.name))}" for part in shown)
        return f"{type(self).__name__}({values})"


def in_brief(value: Any) -> str:
    """The repr of a value, with arrays and long lists described by shape, type and range.

    Args:
        value: of any type. Arrays of any library are recognised by their ``shape`` and ``dtype``.
    """
    shape, kind = getattr(value, "shape", None), getattr(value, "dtype", None)
    if isinstance(value, np.ndarray) and value.ndim:
        low_high = ""
        if value.size and value.dtype.kind in "biuf":
            # The range of arrays of gigabytes would take too long.
            low_high = f" from {value.min():.4g} to {value.max():.4g}" if value.size <= 10**7 else ""
        return f"<{'×'.join(map(str, value.shape))} {value.dtype}{low_high}>"
    if isinstance(shape, tuple) and kind is not None and shape:
        return f"<{'×'.join(map(str, shape))} {kind}>"
    if isinstance(value, tuple | list) and len(value) > LONGEST_LIST:
        return f"<{len(value)} of {type(value[0]).__name__}>"
    if isinstance(value, tuple) and type(value) is tuple and value:
        inside = ", ".join(map(in_brief, value))
        return f"({inside},)" if len(value) == 1 else f"({inside})"
    if isinstance(value, list):
        return f"[{', '.join(map(in_brief, value))}]"
    if isinstance(value, dict):
        if len(value) > LONGEST_LIST:
            return f"<dictionary of {len(value)}>"
        return "{" + ", ".join(f"{key!r}: {in_brief(each)}" for key, each in value.items()) + "}"
    text = repr(value)
    return text if "\n" not in text else f"<{type(value).__name__}>"  # a multi-line repr does not fit


def kind_in_words(kind: type, gap: str = " ") -> str:
    """The name of a class in lower case: ``"lens array"`` for LensArray.

    Args:
        kind: the class.
        gap: separator of its words.
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", gap, kind.__name__).lower()


def instead_of_name(given: str | type, module: str, kinds: Iterable[type]) -> str:
    """The expression to write instead of a name, as in camera files, or a class, for an error.

    Args:
        given: such as "circle", or the class itself.
        module: where users find them, such as "vcc.patterns".
        kinds: the existing dataclasses.
    """
    by_name = {kind.__name__.lower(): kind for kind in kinds}
    said = given.__name__ if isinstance(given, type) else given
    kind = by_name.get(re.sub(r"[\s_-]", "", said).lower())
    if kind is None:
        return f"{module} has {', '.join(each.__name__ for each in by_name.values())}"
    needed = [each.name for each in fields(kind) if each.default is MISSING and each.default_factory is MISSING]
    why = "that is the class" if isinstance(given, type) else "names are for camera files"
    return f"{why}; write {module}.{kind.__name__}({', '.join(f'{name}=…' for name in needed)})"


def with_parameters(name: str, parameters: str) -> str:
    """A name, with parameters in brackets if there are any: ``"circle (diameter 3 mm)"``."""
    return f"{name} ({parameters})" if parameters else name


def is_default(value: Any, parameter: Field[Any]) -> bool:
    """Whether a field of a dataclass has its default value; values may be arrays, or contain arrays.

    Args:
        value: of the field.
        parameter: the field, as `dataclasses.fields` lists it.
    """
    made = parameter.default_factory
    default = parameter.default if made is MISSING else made()
    if value is default:
        return True
    if default is MISSING:
        return False
    if isinstance(value, np.ndarray) or isinstance(default, np.ndarray):
        return isinstance(value, np.ndarray) and isinstance(default, np.ndarray) and np.array_equal(value, default)
    try:
        return bool(value == default)
    except (ValueError, TypeError):  # arrays inside, for which == returns an array
        return False


def _value(value: Any, unit: str | None) -> str:
    if isinstance(value, np.ndarray):
        return _array(value, unit) if value.ndim else _value(value.item(), unit)
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, tuple | list):
        return _list(value, unit)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return _number(value, unit)
    described = getattr(value, "described", None)
    if described is not None:
        return str(described())
    if is_dataclass(value) and not isinstance(value, type):
        return with_parameters(type(value).__name__, parameters_in_words(value))
    # A function has a name; other objects without a name or a description may have a repr of any length.
    return str(getattr(value, "__name__", None) or (value if isinstance(value, str) else type(value).__name__))


def _number(value: float, unit: str | None) -> str:
    if unit is not None:
        return short(value, unit) if math.isfinite(value) else ("infinite" if value > 0 else "minus infinite")
    return str(value) if isinstance(value, int) else f"{value:.6g}"


def _list(values: tuple[Any, ...] | list[Any], unit: str | None) -> str:
    try:
        numbers = np.asarray(values)
    except ValueError:  # lists of different lengths inside
        numbers = np.asarray([])
    if numbers.size > LONGEST_LIST and numbers.dtype.kind in "biuf":
        return _array(numbers, unit)
    if len(values) > LONGEST_LIST:
        return f"({len(values)} values)"
    return "(" + ", ".join(_value(part, unit) for part in values) + ")"


def _array(values: NDArray[Any], unit: str | None) -> str:
    """The shape and the range of numbers."""
    what = f"{'×'.join(map(str, values.shape))} numbers" if values.ndim > 1 else f"{values.size} numbers"
    if values.size == 0 or values.dtype.kind not in "biuf":
        return what
    low, high = (_number(float(end), unit) for end in (values.min(), values.max()))
    return f"{what}, all {low}" if low == high else f"{what} from {low} to {high}"
