"""Parameters of frozen dataclasses in words, with the units that their fields state."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from vcc.units import short


def parameters_in_words(thing: Any, leave_out: tuple[str, ...] = ()) -> str:
    """The parameters of a dataclass that differ from their defaults, such as ``"diameter 20 mm"``.

    Args:
        thing: an instance of a dataclass; fields with ``metadata={"unit": ...}`` are written with that unit.
        leave_out: names of fields to pass over.
    """
    parts = []
    for parameter in fields(thing):
        value = getattr(thing, parameter.name)
        if parameter.name in leave_out or value is None or value == parameter.default:
            continue
        parts.append(f"{parameter.name.replace('_', ' ')} {_value(value, parameter.metadata.get('unit'))}")
    return ", ".join(parts)


def _value(value: Any, unit: str | None) -> str:
    if isinstance(value, tuple):
        return "(" + ", ".join(_value(part, unit) for part in value) + ")"
    if unit is not None and isinstance(value, int | float):
        return short(value, unit)
    described = getattr(value, "described", None)
    return str(value) if described is None else str(described())
