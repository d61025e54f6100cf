"""Spectra: numbers by wavelength, such as a filter's transmission or a sensor's sensitivity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.base.wavelengths import rising


@dataclass(frozen=True)
class Spectrum(Shown):
    """Numbers at some wavelengths, and straight lines between them.

    Args:
        wavelengths: two or more, rising, metres.
        values: one for each, 0 or more: a share (transmission) or a sensitivity.

    Raises:
        InputError: wavelengths that do not rise or are not of light in metres, another number of values, or values
            that are negative or not finite.
    """

    wavelengths: tuple[float, ...] = field(metadata={"unit": "length"})
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        places = rising("wavelengths of a spectrum", self.wavelengths)
        given = checks.array("values of a spectrum", self.values, "one for each wavelength", len(places))
        checks.none_negative("values of a spectrum", given)
        object.__setattr__(self, "wavelengths", places)
        object.__setattr__(self, "values", tuple(given.tolist()))

    def __call__(self, wavelength: float) -> float:
        """The value at a wavelength, metres.

        Raises:
            InputError: a wavelength outside the table.
        """
        low, high = self.wavelengths[0], self.wavelengths[-1]
        if not low * (1 - 1e-9) <= wavelength <= high * (1 + 1e-9):
            raise InputError(
                f"the spectrum is known from {low * 1e9:g} to {high * 1e9:g} nm, and the wavelength is "
                f"{wavelength * 1e9:g} nm: extend the table, with 0 where nothing passes"
            )
        return float(np.interp(wavelength, self.wavelengths, self.values))

    def described(self) -> str:
        """Its range as text."""
        return f"from {self.wavelengths[0] * 1e9:g} to {self.wavelengths[-1] * 1e9:g} nm"


def value_at(name: str, spectrum: Spectrum | Callable[[float], Any], wavelength: float, most: float) -> float:
    """A number of a spectrum, or of a function of the wavelength in metres.

    Args:
        name: what to call it in an error.
        spectrum: a `Spectrum` or any function.
        wavelength: metres.
        most: the largest number that it may be.

    Raises:
        InputError: outside a table's range, or a number that is negative, too large or not finite.
    """
    with checks.within(name):
        given = spectrum(wavelength)
    return checks.zero_or_more(f"{name} at {wavelength * 1e9:g} nm", given, most=most)
