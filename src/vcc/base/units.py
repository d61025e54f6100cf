"""Units as plain factors to SI, for code such as ``Lens(focal_length=50 * mm)``.

This library uses metres, radians and seconds; slopes are dimensionless.
``parse`` reads a quantity with its unit, as written in camera files and on the command line.
"""

from __future__ import annotations

import functools
import json
import math
import re
from typing import Any, Final

from vcc.base.errors import InputError

m: Final = 1.0
cm: Final = 1e-2
mm: Final = 1e-3
um: Final = 1e-6
nm: Final = 1e-9
rad: Final = 1.0
mrad: Final = 1e-3
deg: Final = math.pi / 180.0
s: Final = 1.0
ms: Final = 1e-3
us: Final = 1e-6


_UNITS: Final[dict[str, dict[str, float]]] = {
    "length": {"m": m, "cm": cm, "mm": mm, "um": um, "µm": um, "μm": um, "nm": nm},
    "angle": {"rad": rad, "mrad": mrad, "deg": deg, "°": deg},
    "time": {"s": s, "ms": ms, "us": us, "µs": us, "μs": us},
    "area": {"m2": m**2, "mm2": mm**2, "um2": um**2, "µm2": um**2, "μm2": um**2, "nm2": nm**2},
    "area squared": {"m4": m**4, "mm4": mm**4, "um4": um**4, "µm4": um**4, "μm4": um**4, "nm4": nm**4},
}
"""The units read without pint: the factors of this module, so that "48 um" is 48 * um exactly."""
NAMES: Final = tuple(name for units in _UNITS.values() for name in units)
"""Of these units."""
_WRITTEN: Final[dict[str, tuple[str, ...]]] = {
    "length": ("m", "mm", "um", "nm"),
    "angle": ("rad", "mrad", "deg"),
    "time": ("s", "ms", "us"),
    "area": ("m2", "mm2", "um2"),
    "area squared": ("m4", "mm4", "um4"),
}
_CLEARLY: Final = 4
"""Number of characters that another unit must save to be used instead of the most readable one."""
_LONGEST_SHOWN: Final = 60
"""Characters of an invalid quantity that an error shows."""
SI_NAMES: Final = {
    "length": "metre",
    "angle": "radian",
    "time": "second",
    "area": "square metre",
    "area squared": "fourth power of a metre",
}
_EXAMPLES: Final = {
    "length": "50 mm",
    "angle": "2 deg",
    "time": "10 ms",
    "area": "0.0042 um2",
    "area squared": "0.0001 um4",
}
_QUANTITY: Final = re.compile(r"([+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf))\s*(.*)", re.DOTALL)
_UNIT_NAME: Final = re.compile(r"[^\W\d]+|°")


_IN_PYTHON: Final = {"µm": "um", "μm": "um", "µs": "us", "μs": "us", "°": "deg"}


def as_python(text: str) -> str | None:
    """A quantity or a number in text as a Python expression, ``"50 * mm"`` for "50 mm"; None for other text.

    Args:
        text: as in camera files and on the command line.
    """
    match = _QUANTITY.fullmatch(text.strip())
    if match is None:
        return None
    number, unit = match[1].replace("inf", "math.inf"), match[2]
    if not unit:
        return number
    known = any(unit in units for units in _UNITS.values())
    return f"{number} * {_IN_PYTHON.get(unit, unit)}" if known else None


@functools.cache
def _registry() -> Any:
    import pint  # 0.3 s to import: only needed for uncommon units

    return pint.UnitRegistry()


def parse(text: object, dimension: str, what: str) -> float:
    """The SI value of a quantity written with its unit, such as ``"50 mm"``.

    Units are those of this module and all names that pint supports (``"2 inch"``, ``"30 arcmin"``).

    Args:
        text: the quantity, a string with a number and a unit.
        dimension: ``"length"`` (metres), ``"angle"`` (radians) or ``"time"`` (seconds).
        what: name of the quantity in an error, such as ``'focal_length of lens "L1"'``.

    Raises:
        InputError: not a string, no unit, an unknown unit, or a unit of another dimension.
    """
    kind, example = f"{_article(dimension)} {dimension}", _EXAMPLES[dimension]
    if not isinstance(text, str):
        given = _cut(json.dumps(text, ensure_ascii=False, default=str))  # as camera files write it
        raise InputError(f'{what} is {given}: {kind} needs a unit, written as text, e.g. "{example}"')
    match = _QUANTITY.fullmatch(text.strip())
    if match is None:
        raise InputError(f'{what} is "{_cut(text)}", which is not {kind}; write it like "{example}"')
    number, unit = float(match[1]), match[2]
    text = _cut(text)
    if not unit:
        raise InputError(f'{what} is "{text}": {kind} needs a unit, e.g. "{example}"')
    factor = _UNITS[dimension].get(unit)
    if factor is None:
        factor = _factor_by_pint(unit, dimension, f'{what} is "{text}"')
    return number * factor + 0.0  # -0 is 0


def _cut(words: str) -> str:
    return words if len(words) <= _LONGEST_SHOWN else f"{words[:_LONGEST_SHOWN]}…"


def _factor_by_pint(unit: str, dimension: str, what: str) -> float:
    """The factor to SI of a unit that is not defined in this module."""
    kind, example = f"{_article(dimension)} {dimension}", _EXAMPLES[dimension]
    if len(unit) > _LONGEST_SHOWN:
        raise InputError(f'{what}, which is not {kind}; write it like "{example}"')
    if not _UNIT_NAME.fullmatch(unit):  # pint would evaluate it as arithmetic
        raise InputError(f'{what}, and "{unit}" is not a unit of {dimension}; write {kind} like "{example}"')
    import pint

    try:
        return float(_registry().Quantity(1.0, unit).to(SI_NAMES[dimension]).magnitude)
    except pint.UndefinedUnitError:
        raise InputError(f'{what}, and "{unit}" is not a known unit; write {kind} like "{example}"') from None
    except pint.PintError:  # another dimension, or a scale with an offset such as degC
        raise InputError(f'{what}, which is not {kind}; write it like "{example}"') from None


def text(value: float, dimension: str = "length", *, exact: bool = False) -> str:
    """A value in SI, written with the most readable unit, such as ``"50 mm"``.

    Args:
        value: metres, radians or seconds.
        dimension: ``"length"``, ``"angle"`` or ``"time"``.
        exact: whether ``parse(text(value, dimension, exact=True), dimension, "")`` must return the same
            float, bit by bit, as required for files; otherwise 15 digits, which hide rounding.
    """
    names = _WRITTEN[dimension]
    value = float(value) + 0.0  # -0 is 0
    if value == 0 or not math.isfinite(value):
        return f"{value:g} {names[0]}"
    best = _best_unit(value, names, dimension)
    ordered = [best, *(name for name in names if name != best)]
    if dimension == "angle":  # the shortest is the intended one: 45 deg, 0.2 rad
        ordered.sort(key=lambda name: len(_written(value, name, dimension, 15)))
    if not exact:
        return _written(value, ordered[0], dimension, 15)
    # In SI the factor is 1, and 17 digits always reproduce the float.
    candidates = [_written(value, name, dimension, n) for n in (15, 17) for name in ordered]
    faithful = [each for each in candidates if parse(each, dimension, "it") == value]
    short = [each for each in faithful if "e" not in each]
    if faithful[0] == candidates[0]:
        return faithful[0]
    # Another unit only if it is clearly shorter: 0.04 mm for 40e-6, but not millions of nanometres.
    return min(short or faithful, key=lambda each: len(each) + _CLEARLY * (each.split()[1] != ordered[0]))


def short(value: float, dimension: str = "length", digits: int = 6) -> str:
    """A value for display, rounded to ``digits`` digits: ``"59.4562 mm"``, ``"1°"``; see `text`."""
    value = float(value)
    if dimension != "angle" or value == 0 or not math.isfinite(value):
        return text(float(f"{value:.{digits}g}"), dimension)
    # Rounded in each unit separately: 1° is not a round number of radians, and must not look like one.
    names = _WRITTEN[dimension]
    best = _best_unit(value, names, dimension)
    ordered = [best, *(name for name in names if name != best)]
    return min((_written(value, name, dimension, digits).replace(" deg", "°") for name in ordered), key=len)


def _best_unit(value: float, names: tuple[str, ...], dimension: str) -> str:
    """The largest unit in which the number is at least 1."""
    for name in names:
        if abs(value) >= _UNITS[dimension][name] * 0.9999999:
            return name
    return names[-1]


def _written(value: float, unit: str, dimension: str, digits: int) -> str:
    return f"{value / _UNITS[dimension][unit]:.{digits}g} {unit}"


def _article(dimension: str) -> str:
    return "a" if dimension in ("length", "time") else "an"
