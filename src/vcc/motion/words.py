"""Courses over time as text."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from vcc.base.describe import kind_in_words, parameters_in_words, with_parameters
from vcc.base.units import short
from vcc.learn.parameters import Parameter
from vcc.motion.courses import Lines, Steps, code_of

MOST = 4
"""Largest number of points that are listed completely; otherwise the first and the last."""


def course_in_words(course: Any, of: Parameter | None = None) -> str:
    """A course as text.

    Args:
        course: of a parameter, or of a shutter.
        of: the parameter, for the unit of its values; None for a shutter.
    """
    if isinstance(course, Lines):
        return "changes linearly, " + _points(course, of, "{value} at {time}")
    if isinstance(course, Steps):
        if of is None and (found := code_of(course)) is not None:
            return f"opens and shuts by the code {found[0]} in {short(found[1], 'time')}"
        return "switches, " + _points(course, of, "{value} from {time} on")
    name = getattr(getattr(course, "function", course), "__name__", type(course).__name__)
    told = ", ".join(short(time, "time") for time in course.breaks[:MOST])
    more = " …" if len(course.breaks) > MOST else ""
    return f"is a function of time, {name}" + (f", with breaks at {told}{more}" if told else "")


def _points(course: Lines | Steps, of: Parameter | None, form: str) -> str:
    pairs = list(zip(course.times, course.values, strict=True))
    told = [form.format(value=_value(value, _unit(of)), time=short(time, "time")) for time, value in pairs]
    if len(told) > MOST:
        told[2:-1] = [f"… ({len(told)} in all)"]
    return ", ".join(told)


def _unit(of: Parameter | None) -> str | None:
    if of is None:
        return None
    field = next(each for each in fields(of.holder) if each.name == of.field)
    unit = field.metadata.get("unit")
    return None if unit is None else str(unit)


def _value(value: Any, unit: str | None) -> str:
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        return short(float(value), unit) if unit else f"{value:.6g}"
    if isinstance(value, np.ndarray) and value.ndim:
        return f"{'×'.join(map(str, value.shape))} cells"
    if isinstance(value, tuple):
        return f"({', '.join(_value(each, unit) for each in value)})"
    if is_dataclass(value) and not isinstance(value, type):
        return with_parameters(kind_in_words(type(value)), parameters_in_words(value))
    return str(getattr(value, "__name__", value if isinstance(value, str | bool) else type(value).__name__))
