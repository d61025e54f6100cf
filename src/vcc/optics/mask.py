"""The mask: a flat sheet whose transmission depends on position."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.optics.band import Band
from vcc.optics.faces import Element, Faces, Way
from vcc.optics.spectrum import Spectrum, value_at
from vcc.shapes.by_channel import ByChannel, weighted
from vcc.shapes.patterns import Bounded, Cells, Pattern, as_pattern


@dataclass(frozen=True)
class Mask(Element):
    """A printed transparency, a stop, a coded aperture: the paper's dot product (section 3.2.3).

    Args:
        pattern: an array of transmissions (rows, columns), 0 to 1, row 0 at the top; or a pattern from
            `vcc.patterns`; or any function of (x, y) in metres that returns transmission. An array (rows, columns,
            channels), or `vcc.patterns.ByChannel`, has a pattern for each channel of the light field.
        width: of the sheet, metres, opaque outside; required for an array. For a pattern, None is unbounded.
        height: metres; None keeps an array's cells square, and makes other sheets square.
        spectrum: of the sheet as a filter: a `vcc.Spectrum` of transmission, 0 to 1, or a function of the
            wavelength in metres. Several belong to as many patterns, ``array[..., n]`` or those of ``ByChannel``:
            filters side by side, which let pass Σ spectrum · pattern. None lets all wavelengths pass alike.

    Raises:
        InputError: an array that is empty, not 2-D or 3-D or outside 0 to 1, an array without a width, a size of
            zero or less, a mask that transmits nothing, or not one spectrum for each pattern.
    """

    pattern: ArrayLike | Pattern | Callable[[NDArray[np.float64], NDArray[np.float64]], ArrayLike]
    width: float | None = field(default=None, metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})
    source: str = field(default="", compare=False)
    """The file that the pattern was read from, if any."""
    spectrum: Spectrum | Callable[[float], Any] | tuple[Spectrum | Callable[[float], Any], ...] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.sizes(self.label, width=self.width, height=self.height)
        object.__setattr__(self, "pattern", self._as_pattern())
        if isinstance(self.pattern, Cells) and not self.pattern.values.any():
            raise InputError(f"{self.label} is opaque everywhere: its transmission is 0 throughout")
        if isinstance(self.pattern, ByChannel) and not weighted([(1.0, each) for each in self.pattern.patterns]):
            raise InputError(f"{self.label} is opaque everywhere: its transmission is 0 in all channels")
        spectra: Any = self.spectrum
        if isinstance(spectra, list):
            object.__setattr__(self, "spectrum", tuple(spectra))
        self._check_spectrum()

    def _check_spectrum(self) -> None:
        several = self.spectrum if isinstance(self.spectrum, tuple) else (self.spectrum,)
        if self.spectrum is not None and not all(callable(each) for each in several):
            raise InputError(
                f"spectrum of {self.label} is a vcc.Spectrum(wavelengths, values) or a function of the "
                "wavelength, or a tuple of these"
            )
        patterns = len(self.pattern.patterns) if isinstance(self.pattern, ByChannel) else 1
        if isinstance(self.spectrum, tuple) and len(several) != patterns:
            raise InputError(f"{self.label} has {len(several)} spectra and {patterns} patterns: give one for each")

    @property
    def depends_on_band(self) -> bool:
        """Whether it has a pattern for each channel, or a spectrum."""
        return isinstance(self.pattern, ByChannel) or self.spectrum is not None

    def ways(self, band: Band) -> tuple[Way, ...]:
        """The sheet as the band meets it: its pattern, weighted by the filter's transmission.

        Raises:
            InputError: another number of channels than patterns, a band without a wavelength where there is a
                spectrum, or a transmission outside 0 to 1.
        """
        if not self.depends_on_band:
            return super().ways(band)
        spectra = self.spectrum if isinstance(self.spectrum, tuple) else (self.spectrum,)
        there = 0.0 if self.spectrum is None else band.stated(self.label)
        shares = [
            1.0 if each is None else value_at(f"spectrum of {self.label}", each, there, 1.0) for each in spectra
        ]
        patterns = weighted([(share, each) for share, each in zip(shares, self._patterns_of(band), strict=True)])
        return tuple((share, replace(self, pattern=each, spectrum=None)) for share, each in patterns)

    def _patterns_of(self, band: Band) -> tuple[Pattern, ...]:
        """Those of all filters, or that of the channel."""
        if not isinstance(self.pattern, ByChannel):
            return (as_pattern(self.pattern),)  # type: ignore[arg-type]
        patterns = self.pattern.patterns
        if isinstance(self.spectrum, tuple):
            return patterns
        if len(patterns) != band.channels:
            raise InputError(
                f"{self.label} has {len(patterns)} channels, and the light field has {band.channels}: give the "
                "mask an array (rows, columns, channels) with as many, or a spectrum for each of its patterns"
            )
        return (patterns[band.channel],)

    def _as_pattern(self) -> Pattern:
        given: Any = self.pattern
        if not isinstance(given, tuple | list) and not hasattr(given, "__array__"):
            with checks.within(self.label):
                return as_pattern(given)
        if self.width is None:
            raise InputError(f"{self.label} is an array of cells: give its width in metres, e.g. width=30 * mm")
        try:
            cells = np.asarray(given, dtype=np.float64)
            if cells.ndim == 3:
                return ByChannel(tuple(Cells(each, self.width, self.height) for each in np.moveaxis(cells, 2, 0)))
            return Cells(cells, self.width, self.height)
        except (InputError, ValueError, TypeError) as error:
            raise InputError(f"{self.label}: {error}") from None

    def faces(self) -> Faces:
        """A transmission, opaque outside the sheet."""
        pattern = as_pattern(self.pattern)  # type: ignore[arg-type]
        if isinstance(pattern, Cells) or self.width is None:
            return Faces(transmission=pattern)
        height = self.width if self.height is None else self.height
        return Faces(transmission=Bounded(pattern, self.width, height))

    def described(self) -> str:
        """The pattern and the sheet's size as text."""
        return super().described() if not self.source else f"{super().described()}, from {self.source}"
