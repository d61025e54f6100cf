"""The media of a lens file: the index at one wavelength, and the glass by wavelength."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from vcc.base.errors import InputError
from vcc.base.wavelengths import D_LINE
from vcc.optics.catalogues import Glasses
from vcc.optics.glass import Abbe, Catalogue, Glass


@dataclass(frozen=True)
class Medium:
    """What is behind a surface: the fields of a `Surface`."""

    index: float
    glass: str = ""
    material: Glass | None = None


AIR = Medium(1.0)


@dataclass(frozen=True)
class Media:
    """Makes media from what lens files state.

    Args:
        wavelength: wavelength of the indices, metres.
        given: indices or glasses by the file's name, case-insensitive, which override catalogues.

    Raises:
        InputError: a wavelength outside the range of light in metres.
    """

    wavelength: float = D_LINE
    given: Mapping[str, float | Glass] = field(default_factory=dict)

    def __post_init__(self) -> None:
        Glasses(self.wavelength)
        object.__setattr__(self, "given", {name.upper(): each for name, each in self.given.items()})

    def of_name(self, name: str, makers: Sequence[str], place: str) -> Medium:
        """A glass by its name; makers are searched in this order, then all.

        Raises:
            InputError: as `Glasses.catalogued`.
        """
        given = self.given.get(name.upper())
        if isinstance(given, Glass):
            return self.of_glass(name, given, place)
        if given is not None:
            return Medium(float(given), name)
        full, index = Glasses(self.wavelength).catalogued(name, makers, place)
        return Medium(index, name, Catalogue(full))

    def of_numbers(self, nd: float, abbe_number: float, place: str, name: str = "") -> Medium:
        """A glass by nd and Abbe number; with the Abbe number 0, the index is the same at all wavelengths.

        Raises:
            InputError: no glass has these numbers.
        """
        if abbe_number == 0 or nd == 1:
            return Medium(nd, name)
        try:
            glass = Abbe(nd, abbe_number)
        except InputError as error:
            raise InputError(f"{place}: {error}") from None
        return self.of_glass(name, glass, place)

    def of_glass(self, name: str, glass: Glass, place: str) -> Medium:
        """A glass by wavelength.

        Raises:
            InputError: it is not known at the wavelength.
        """
        try:
            return Medium(glass.index(self.wavelength), name, glass)
        except InputError as error:
            raise InputError(f"{place}: {error}") from None
