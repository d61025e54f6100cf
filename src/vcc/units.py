"""Units as plain factors to SI, so that code reads ``Lens(focal_length=50 * mm)``.

Everything inside this library is in metres, radians and seconds; slopes are dimensionless.
``parse`` reads a quantity with its unit, as camera files and the command line carry it.
"""

from __future__ import annotations

import functools
import math
from typing import Any, Final

from vcc.errors import InputError

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


@functools.cache
def _registry() -> Any:
    import pint  # 0.3 s to import: only those who read camera files pay for it

    return pint.UnitRegistry()


def parse(text: object, dimension: str, what: str) -> float:
    """The SI value of a quantity written with its unit, such as ``"50 mm"``.

    Args:
        text: the quantity, a string with a number and a unit.
        dimension: ``"length"`` (metres), ``"angle"`` (radians) or ``"time"`` (seconds).
        what: how to name the quantity in an error, such as ``'focal_length of lens "L1"'``.

    Raises:
        InputError: not a string, no unit, an unknown unit, or a unit of another dimension.
    """
    unit, example = {"length": ("metre", "50 mm"), "angle": ("radian", "2 deg"), "time": ("second", "10 ms")}[
        dimension
    ]
    if not isinstance(text, str):
        raise InputError(f'{what} is {text!r}: a {dimension} needs a unit, written as text, e.g. "{example}"')
    import pint

    try:
        quantity = _registry().Quantity(text)
        if quantity.unitless and dimension != "angle" or text.strip().replace(".", "").isdigit():
            raise InputError(f'{what} is "{text}": a {dimension} needs a unit, e.g. "{example}"')
        return float(quantity.to(unit).magnitude)
    except InputError:
        raise
    except pint.UndefinedUnitError as error:
        raise InputError(f'{what} is "{text}": {error}; write a {dimension} like "{example}"') from None
    except pint.DimensionalityError:
        raise InputError(f'{what} is "{text}", which is not a {dimension}; write it like "{example}"') from None
    except Exception as error:  # pint raises many types on text that is not a quantity at all
        raise InputError(f'{what} is "{text}", which is not a {dimension} ({error}); e.g. "{example}"') from None


def text(value: float, dimension: str = "length") -> str:
    """A value in SI, written with the unit in which it reads best, such as ``"50 mm"``.

    ``parse(text(value, dimension), dimension, "")`` gives the same float back (17 digits where needed).
    """
    steps = {
        "length": (("m", 1.0), ("mm", 1e-3), ("um", 1e-6), ("nm", 1e-9)),
        "angle": (("rad", 1.0), ("mrad", 1e-3)),
        "time": (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)),
    }[dimension]
    if value == 0 or not math.isfinite(value):
        return f"{value:g} {steps[0][0]}"
    for name, factor in steps:
        if abs(value) >= factor * 0.9999999:
            break
    return f"{float(f'{value / factor:.15g}'):.15g} {name}"
