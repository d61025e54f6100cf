"""Elements of glass: what refracts by n − 1 refracts each wavelength by its own index."""

from __future__ import annotations

import abc
from dataclasses import dataclass, field, replace
from typing import Any

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.wavelengths import D_LINE, wavelength
from vcc.optics.band import Band
from vcc.optics.faces import Element, Way
from vcc.optics.glass import Glass, glass_of


@dataclass(frozen=True, kw_only=True)
class Dispersive(Element, abc.ABC):
    """An element of thin glass: its deflection is proportional to n(λ) − 1.

    Without a glass all wavelengths take the same path. With one, the parameters hold at the design wavelength λ₀,
    and a band of wavelength λ is deflected by (n(λ) − 1)/(n(λ₀) − 1) times as much (Born and Wolf, Principles of
    Optics, section 4.7, for thin elements). Drawings, `vcc.Camera.focused` and the analysis use the design
    wavelength.

    Args:
        glass: None; the name of a catalogue glass, such as ``"N-BK7"`` (extra ``lenses``); or one of
            `vcc.glasses`.
        design_wavelength: λ₀, metres, at which the element's own parameters hold; None takes the d line, 587.56
            nm.

    Raises:
        InputError: what is no glass, or a wavelength that is not of light in metres.
    """

    glass: Glass | str | None = None
    design_wavelength: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.glass is not None:
            glass_of(f"glass of {self.label}", self.glass)
        if self.design_wavelength is not None:
            wavelength(f"design_wavelength of {self.label}", self.design_wavelength)

    @property
    def depends_on_band(self) -> bool:
        """Whether it has a glass."""
        return self.glass is not None

    def ways(self, band: Band) -> tuple[Way, ...]:
        """The element without a glass, as strong as it is for a band.

        Raises:
            InputError: a band without a wavelength, or outside the range of the glass.
        """
        if self.glass is None:
            return super().ways(band)
        there = band.stated(self.label)
        with checks.within(self.label):
            glass = glass_of("glass", self.glass)
            designed = glass.index(self.design_wavelength or D_LINE) - 1
            if designed <= 0:
                raise InputError(
                    f"{glass.described()} has the index 1 at the design wavelength: it does not refract"
                )
            strength = (glass.index(there) - 1) / designed
        return ((1.0, replace(self, glass=None, design_wavelength=None, **self._stronger(strength))),)

    @abc.abstractmethod
    def _stronger(self, factor: float) -> dict[str, Any]:
        """The fields that change where the element deflects ``factor`` times as much."""
