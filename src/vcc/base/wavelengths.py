"""Wavelengths of light, in metres: checked, and as text."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import numpy as np

from vcc.base.errors import InputError

D_LINE: Final = 587.5618e-9
"""The yellow helium line d, metres: the wavelength at which lenses and nd are specified."""
SHORTEST: Final = 100e-9
LONGEST: Final = 50e-6
"""Wavelengths that are accepted, metres: from the ultraviolet to the thermal infrared."""
_LONGEST_LIST: Final = 6
"""Of more bands than this only the number and the range are listed."""


def wavelength(name: str, value: Any) -> float:
    """A wavelength in metres, as a float.

    Args:
        name: what to call it in an error.
        value: the number.

    Raises:
        InputError: no number from 100 nm to 50 µm.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if SHORTEST <= number <= LONGEST:
        return number
    way_out = "give the wavelength of light in metres, 100 nm to 50 µm, such as 550 * nm"
    if 100 <= number <= 50e3:
        way_out = f"write {value:g} * nm (from vcc.units import nm)"
    raise InputError(f"{name} is {value!r} m: {way_out}")


def wavelengths(name: str, values: Any, count: int | None = None) -> tuple[float, ...]:
    """Wavelengths in metres, as a tuple of floats.

    Args:
        name: what to call them in an error.
        values: a sequence or a one-dimensional array of numbers.
        count: how many they must be; None for one or more.

    Raises:
        InputError: no such sequence, another number of them, or one that is not from 100 nm to 50 µm.
    """
    if isinstance(values, str) or not hasattr(values, "__len__"):
        raise InputError(
            f"{name} are a sequence in metres, such as [610 * nm, 540 * nm, 465 * nm], not {values!r}"
        )
    if len(values) != count and (count is not None or not len(values)):
        wanted = f"{count} channel{'' if count == 1 else 's'}" if count else "one or more channels"
        raise InputError(f"{name} are {len(values)}, for {wanted}: give one for each channel")
    return tuple(wavelength(f"{name}, number {number},", each) for number, each in enumerate(values, start=1))


def rising(name: str, values: Any) -> tuple[float, ...]:
    """Wavelengths of a table, metres: as `wavelengths`, two or more in rising order.

    Raises:
        InputError: as `wavelengths`; fewer than two, or not rising.
    """
    places = wavelengths(name, values)
    if len(places) < 2 or any(np.diff(places) <= 0):
        raise InputError(f"{name} are two or more, and rise")
    return places


def as_text(values: Iterable[float]) -> str:
    """Wavelengths for people: ``"bands 465, 540, 610 nm"``, or ``"31 bands from 400 to 700 nm"``."""
    listed = [f"{each * 1e9:.5g}" for each in values]
    if len(listed) > _LONGEST_LIST:
        numbers = sorted(map(float, listed))
        return f"{len(listed)} bands from {numbers[0]:g} to {numbers[-1]:g} nm"
    return f"band{'' if len(listed) == 1 else 's'} {', '.join(listed)} nm"


def bandwidths(values: tuple[float, ...]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The width of the band around each wavelength, metres: from midpoint to midpoint between neighbours.

    The outermost bands are as wide on the outer side as on the inner one. A single band has the width 1.

    Args:
        values: in any order, metres.

    Raises:
        InputError: two bands of one wavelength.
    """
    if len(values) == 1:
        return np.ones(1)
    order = np.argsort(values)
    steps = np.diff(np.asarray(values)[order])
    if not steps.all():
        raise InputError(f"two {as_text(values)} have the same wavelength: bands without a width cannot be summed")
    widths = np.empty(len(values))
    widths[order] = (np.append(steps, steps[-1]) + np.insert(steps, 0, steps[0])) / 2
    return widths
