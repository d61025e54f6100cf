"""A band of light: the channel of a light field, and its wavelength where stated."""

from __future__ import annotations

from dataclasses import dataclass

from vcc.base.errors import InputError

STATE_THEM = (
    "state one for each channel: light_field.with_wavelengths([610 * nm, 540 * nm, 465 * nm]), or on the command "
    'line --wavelengths "610, 540, 465 nm"'
)
"""The way out where wavelengths are missing."""


@dataclass(frozen=True)
class Band:
    """One channel of a light field, as elements meet it.

    Args:
        channel: its number, from 0 on.
        channels: how many the light field has.
        wavelength: in the middle of the band, metres; None where the light field does not state it.
    """

    channel: int = 0
    channels: int = 1
    wavelength: float | None = None

    def stated(self, label: str) -> float:
        """The wavelength, metres.

        Args:
            label: of the element that needs it.

        Raises:
            InputError: the light field does not state it.
        """
        if self.wavelength is None:
            raise InputError(f"{label} depends on the wavelength, and the light field states none: {STATE_THEM}")
        return self.wavelength
