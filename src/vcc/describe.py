"""Parameters of frozen dataclasses in words, with the units that their fields state."""

from __future__ import annotations

from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

import numpy as np

from vcc.units import short

LONGEST_LIST = 6
"""Of longer lists only the number of entries is told."""


def parameters_in_words(thing: Any, leave_out: tuple[str, ...] = ()) -> str:
    """The parameters of a dataclass that differ from their defaults, such as ``"diameter 20 mm"``.

    Numbers are rounded to 6 digits; of arrays and long lists only the size is told.

    Args:
        thing: an instance of a dataclass; fields with ``metadata={"unit": ...}`` are written with that unit.
        leave_out: names of fields to pass over.
    """
    parts = []
    for parameter in fields(thing):
        value = getattr(thing, parameter.name)
        if parameter.name in leave_out or value is None or is_default(value, parameter):
            continue
        name = parameter.name.replace("_", " ")
        if isinstance(value, bool):  # it stands apart from its default, so that its name says it all
            parts.append(name if value else f"not {name}")
        else:
            parts.append(f"{name} {_value(value, parameter.metadata.get('unit'))}")
    return ", ".join(parts)


def is_default(value: Any, parameter: Field[Any]) -> bool:
    """Whether a field of a dataclass has its default value; values may be arrays, or hold some.

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
    except (ValueError, TypeError):  # arrays inside, of which == makes an array
        return False


def _value(value: Any, unit: str | None) -> str:
    if isinstance(value, np.ndarray):
        return f"{'×'.join(map(str, value.shape))} numbers" if value.ndim else _value(value.item(), unit)
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, tuple | list):
        if len(value) > LONGEST_LIST:
            return f"({len(value)} values)"
        return "(" + ", ".join(_value(part, unit) for part in value) + ")"
    if isinstance(value, int | float) and not isinstance(value, bool):
        if unit is not None:
            return short(value, unit)
        return f"{value:.6g}" if isinstance(value, float) else str(value)
    described = getattr(value, "described", None)
    if described is not None:
        return str(described())
    if is_dataclass(value) and not isinstance(value, type):
        return f"({parameters_in_words(value)})"
    return str(getattr(value, "__name__", value))
