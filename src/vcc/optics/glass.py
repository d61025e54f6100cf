"""Glasses: the refractive index as a function of the wavelength, by formula, by table or by the maker's name."""

from __future__ import annotations

import abc
import functools
import math
from dataclasses import dataclass, field
from typing import Any

from vcc.base import checks
from vcc.base.describe import kind_in_words, parameters_in_words, with_parameters
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.base.wavelengths import LONGEST, SHORTEST, rising
from vcc.base.wavelengths import wavelength as checked
from vcc.base.wavelengths import wavelengths as all_checked
from vcc.optics.catalogues import Glasses, cauchy_through, makers

HIGHEST_INDEX = 10.0
"""No glass refracts more; a larger index comes from coefficients for micrometres."""
_MICROMETRES = "published coefficients are for micrometres: multiply by um**2, or um**4 (from vcc.units import um)"


class Glass(Shown, abc.ABC):
    """A refractive index relative to air by wavelength. Final classes are frozen dataclasses."""

    @property
    def known_range(self) -> tuple[float, float]:
        """(shortest, longest) wavelength for which the glass is known, metres; a catalogue has its own limits."""
        found: tuple[float, float] = getattr(self, "wavelength_range", (SHORTEST, LONGEST))
        return found

    def index(self, wavelength: float) -> float:
        """The refractive index n.

        Args:
            wavelength: λ in vacuum, metres.

        Returns:
            n, without a unit, 1 or more.

        Raises:
            InputError: a wavelength outside `known_range`, or coefficients that are no glass's there.
        """
        wavelength = checked("wavelength", wavelength)
        low, high = self.known_range
        if not low * (1 - 1e-9) <= wavelength <= high * (1 + 1e-9):
            raise InputError(
                f"{self.described()} is known from {low * 1e9:g} to {high * 1e9:g} nm, and the wavelength is "
                f"{wavelength * 1e9:g} nm: take another glass or other bands"
            )
        found = self._index(wavelength)
        if not 1 <= found <= HIGHEST_INDEX:
            raise InputError(
                f"{self.described()} has the index {found:.4g} at {wavelength * 1e9:g} nm, and glasses have 1 to "
                f"{HIGHEST_INDEX:g}: {_MICROMETRES}"
            )
        return found

    @abc.abstractmethod
    def _index(self, wavelength: float) -> float:
        """The index at a wavelength within the range."""

    def described(self) -> str:
        """The glass as text, such as ``"abbe (nd 1.5168, V 64.17)"``."""
        return with_parameters(kind_in_words(type(self)), parameters_in_words(self, ("wavelength_range",)))

    def _check_range(self) -> None:
        given = all_checked(f"wavelength_range of {kind_in_words(type(self))} glass", self.known_range)
        if len(given) != 2 or not given[0] < given[1]:
            raise InputError(f"wavelength_range is (shortest, longest), not {self.known_range!r}")
        object.__setattr__(self, "wavelength_range", given)


@dataclass(frozen=True)
class Cauchy(Glass):
    """Cauchy's formula, n = A + B/λ² + C/λ⁴ (Born and Wolf, Principles of Optics, section 2.3).

    Args:
        A: without a unit.
        B: m²; published values are in µm²: ``0.0042 * um**2``.
        C: m⁴; likewise ``um**4``.
        wavelength_range: (shortest, longest) wavelength, metres, for which the coefficients are good.

    Raises:
        InputError: coefficients that are not finite, or no range of wavelengths.
    """

    A: float
    B: float = field(metadata={"unit": "area"})
    C: float = field(default=0.0, metadata={"unit": "area squared"})
    wavelength_range: tuple[float, float] = field(default=(380e-9, 1100e-9), metadata={"unit": "length"})

    def __post_init__(self) -> None:
        for name in "ABC":
            checks.finite(f"{name} of Cauchy's formula", getattr(self, name))
        self._check_range()

    def _index(self, wavelength: float) -> float:
        return self.A + self.B / wavelength**2 + self.C / wavelength**4


@dataclass(frozen=True)
class Sellmeier(Glass):
    """Sellmeier's formula, n² = 1 + Σ Bᵢλ²/(λ² − Cᵢ), as makers of glass publish it (Schott TIE-29).

    Args:
        B: any number of coefficients without a unit, usually three.
        C: as many, m²; published values are in µm²: ``(0.006 * um**2, …)``.
        wavelength_range: (shortest, longest) wavelength, metres, for which the coefficients are good.

    Raises:
        InputError: not as many B as C, numbers that are not finite, or no range of wavelengths.
    """

    B: tuple[float, ...]
    C: tuple[float, ...] = field(metadata={"unit": "area"})
    wavelength_range: tuple[float, float] = field(default=(380e-9, 1100e-9), metadata={"unit": "length"})

    def __post_init__(self) -> None:
        for name in "BC":
            given = checks.array(
                f"{name} of Sellmeier's formula", getattr(self, name), "numbers, one a term", None
            )
            object.__setattr__(self, name, tuple(given.tolist()))
        if len(self.B) != len(self.C):
            raise InputError(f"Sellmeier's formula has {len(self.B)} numbers B and {len(self.C)} C: give as many")
        largest = max(map(abs, self.C))
        if largest > 1e-6:
            raise InputError(f"C of Sellmeier's formula is up to {largest:g} m²: {_MICROMETRES}")
        self._check_range()

    def _index(self, wavelength: float) -> float:
        square = wavelength**2
        total = 1 + sum(b * square / (square - c) for b, c in zip(self.B, self.C, strict=True))
        return math.sqrt(max(total, 0.0))


@dataclass(frozen=True)
class Abbe(Glass):
    """A glass known by its index nd and its Abbe number V: n = A + B/λ² through both.

    Two terms follow the index of N-BK7 to 1e-4 from 440 to 700 nm, and worse beyond: take a name or Sellmeier's
    formula where more counts.

    Args:
        nd: the index at the d line, 587.56 nm.
        V: Vd = (nd − 1)/(nF − nC), the lines F and C at 486.13 and 656.27 nm.
        wavelength_range: (shortest, longest) wavelength, metres, for which two terms are good enough.

    Raises:
        InputError: an index of 1 or less, an Abbe number of 0 or less, or no range of wavelengths.
    """

    nd: float
    V: float
    wavelength_range: tuple[float, float] = field(default=(380e-9, 1100e-9), metadata={"unit": "length"})

    def __post_init__(self) -> None:
        checks.above_zero("V, the Abbe number of a glass,", self.V)
        if not 1 < checks.above_zero("nd of a glass", self.nd) <= HIGHEST_INDEX:
            raise InputError(f"nd of a glass is {self.nd:g}: it is above 1, such as 1.5168")
        self._check_range()

    def _index(self, wavelength: float) -> float:
        constant, slope = cauchy_through(self.nd, self.V)
        return constant + slope / wavelength**2


@dataclass(frozen=True)
class Table(Glass):
    """Indices at some wavelengths, and a monotone cubic between them (PCHIP: Fritsch and Carlson 1980).

    Args:
        wavelengths: two or more, rising, metres.
        indices: one for each.

    Raises:
        InputError: wavelengths that do not rise or are not of light in metres, another number of indices, or
            indices below 1.
    """

    wavelengths: tuple[float, ...] = field(metadata={"unit": "length"})
    indices: tuple[float, ...]

    def __post_init__(self) -> None:
        places = rising("wavelengths of a table of indices", self.wavelengths)
        given = checks.array("indices of a table", self.indices, "one for each wavelength", len(places))
        object.__setattr__(self, "wavelengths", places)
        object.__setattr__(self, "indices", tuple(given.tolist()))

    @property
    def wavelength_range(self) -> tuple[float, float]:
        """The first and the last wavelength, metres."""
        return self.wavelengths[0], self.wavelengths[-1]

    def _index(self, wavelength: float) -> float:
        from scipy.interpolate import PchipInterpolator

        within = min(max(wavelength, self.wavelengths[0]), self.wavelengths[-1])
        return float(PchipInterpolator(self.wavelengths, self.indices)(within))


@dataclass(frozen=True)
class Catalogue(Glass):
    """A glass by its maker's name, from refractiveindex.info; elements accept the name alone as ``glass``.

    Needs the extra ``lenses``.

    Args:
        glass: its name, such as ``"N-BK7"``; where makers use one name for different glasses, with the maker
            before it: ``"SCHOTT F2"``.

    Raises:
        InputError: of `index`: the extra is not installed, no such glass, different glasses of that name, or a
            wavelength outside the maker's data.
    """

    glass: str

    def __post_init__(self) -> None:
        if not (isinstance(self.glass, str) and self.glass.strip()):  # type: ignore[redundant-expr]
            raise InputError(f'a glass is known by its name, such as "N-BK7", not {self.glass!r}')

    def _index(self, wavelength: float) -> float:
        return _of_catalogue(self.glass, wavelength)

    def described(self) -> str:
        """Its name."""
        return self.glass


@functools.lru_cache(maxsize=4096)
def _of_catalogue(name: str, wavelength: float) -> float:
    maker, _, rest = name.strip().partition(" ")
    with_maker = bool(rest) and maker.upper() in makers()
    known = Glasses(wavelength)
    return known.by_name(
        rest.strip() if with_maker else name, [maker] if with_maker else [], "glass", in_file=False
    )


def glass_of(name: str, given: Any) -> Glass:
    """A glass as an element holds it: text is the name of a catalogue's.

    Args:
        name: what to call it in an error.
        given: a `Glass`, or a name.

    Raises:
        InputError: neither of them.
    """
    if isinstance(given, str):
        return Catalogue(given)
    if isinstance(given, Glass):
        return given
    raise InputError(
        f'{name} is the name of a glass, such as "N-BK7", or one of vcc.glasses (Abbe, Cauchy, Sellmeier, Table), '
        f"not {given!r}"
    )
