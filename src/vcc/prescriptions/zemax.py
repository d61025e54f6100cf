"""Sequential lenses from Zemax OpticStudio's text files (.zmx): spheres, conics and even aspheres.

Each line is a keyword and values. ``SURF n`` starts a surface, with CURV the curvature, DISZ the distance to
the next surface, GLAS the medium behind, DIAM the semi-diameter, and STOP marking the aperture stop. The first
surface is the object and the last the image: both are left out, as are surfaces without effect in air in front
of and behind the lens. Values are those saved in the file (solves and pickups resolved, one configuration).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.units import cm, m, mm
from vcc.prescriptions.media import AIR, Media, Medium
from vcc.optics.prescription import Prescription, Surface

_UNITS = {
    "MM": mm,
    "CM": cm,
    "M": m,
    "METER": m,
    "METERS": m,
    "IN": 25.4 * mm,
    "INCH": 25.4 * mm,
    "INCHES": 25.4 * mm,
}
_MODEL_GLASS = "___BLANK"
_SYSTEM = {"UNIT", "MODE", "NAME", "GCAT", "FNUM", "ENPD"}
_PER_SURFACE = {"STOP", "TYPE", "CURV", "DISZ", "GLAS", "DIAM", "CONI"}
_TYPES = {
    "ODDASPHE": "an odd asphere",
    "XASPHERE": "an extended asphere",
    "COORDBRK": "a coordinate break",
    "TOROIDAL": "a toroid",
    "BICONICX": "a biconic surface",
    "DGRATING": "a diffraction grating",
    "BINARY_1": "a diffractive surface",
    "BINARY_2": "a diffractive surface",
    "PARAXIAL": "an ideal lens (use vcc.Lens)",
    "NONSEQCO": "a non-sequential component",
}
"""Common unsupported surface types, for messages; gradient-index types are GRADSUR1 and so on."""


@dataclass
class _Lines:
    """The relevant lines of the file's head, or of one surface: keyword → (line number, values)."""

    number: int = -1
    found: dict[str, tuple[int, list[str]]] = field(default_factory=dict)
    parameters: dict[int, float] = field(default_factory=dict)

    def values(self, keyword: str) -> list[str]:
        return self.found.get(keyword, (0, []))[1]


def read(content: bytes, file: Path, media: Media) -> Prescription:
    """Read the prescription in a Zemax file.

    Raises:
        InputError: not a sequential Zemax file, a surface that is not a sphere or plane between glass and air,
            an unknown glass, a value that is not a number. The message names file and surface.
    """
    head, surfaces = _grouped(_text(content), file)
    mode = head.values("MODE")
    if mode and mode[0] != "SEQ":
        raise InputError(f"{file} is in mode {mode[0]}: only sequential lenses (MODE SEQ) can be read")
    if len(surfaces) < 3:
        raise InputError(
            f"{file} lists {len(surfaces)} surfaces (SURF): a Zemax lens has an object, surfaces and an image"
        )
    unit = _unit(head, file)
    for surface in surfaces:  # before glasses are looked up: a lens with mirrors raises without a catalogue
        _check_supported(surface, file)
    makers = head.values("GCAT")
    listed = [_surface(surface, unit, makers, media, file, _place(file, surface)) for surface in surfaces[:-1]]
    if listed[0].index != 1.0:
        raise InputError(f"{file}: the object lies in {listed[0].glass or 'glass'}, not in air")
    inner, image_distance = _without_idle_ends(listed[1:])
    return Prescription(
        tuple(inner),
        name=" ".join(head.values("NAME")),
        source=file.name,
        f_number=_f_number(head, file),
        entrance_pupil_diameter=_entrance_pupil(head, unit, file),
        image_distance=image_distance,
    )


def _text(content: bytes) -> str:
    """Decode UTF-16 (newer versions), UTF-8, or the Windows code page (older versions)."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    if content[1:2] == b"\0":
        return content.decode("utf-16-le", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")  # only names and notes can contain such characters


def _grouped(text: str, file: Path) -> tuple[_Lines, list[_Lines]]:
    head, surfaces = _Lines(), list[_Lines]()
    for number, keyword, values in _keywords(text):
        if keyword == "SURF":
            expected = len(surfaces)
            if values[:1] != [str(expected)]:
                raise InputError(
                    f"{file}, line {number}: surface {expected} should follow, not {' '.join(values)!r}"
                )
            surfaces.append(_Lines(expected))
        elif surfaces and keyword == "PARM":
            _parameter(surfaces[-1], number, values, file)
        elif surfaces and keyword in _PER_SURFACE:
            surfaces[-1].found.setdefault(keyword, (number, values))
        elif keyword in _SYSTEM:
            head.found.setdefault(keyword, (number, values))
    if not surfaces:
        raise InputError(f"{file} lists no surfaces: a Zemax lens has lines SURF 0, SURF 1 …")
    return head, surfaces


def _parameter(surface: _Lines, line: int, values: list[str], file: Path) -> None:
    try:
        surface.parameters[int(values[0])] = float(values[1])
    except (IndexError, ValueError):
        raise InputError(
            f'{_place(file, surface)}, line {line}: "PARM {" ".join(values)}" should have two numbers'
        ) from None


def _keywords(text: str) -> Iterator[tuple[int, str, list[str]]]:
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if words:
            yield number, words[0], words[1:]


def _place(file: Path, surface: _Lines) -> str:
    return f"{file}: surface {surface.number}"


def _number(lines: _Lines, keyword: str, column: int, place: str, file: Path) -> float:
    line, values = lines.found[keyword]
    try:
        value = float(values[column])
    except (IndexError, ValueError):
        value = math.nan
    if math.isnan(value):
        where = place if place != str(file) else f"{file}"
        raise InputError(f'{where}, line {line}: "{keyword} {" ".join(values)}" should have a number')
    return value


def _unit(head: _Lines, file: Path) -> float:
    values = head.values("UNIT")
    if not values:
        raise InputError(f"{file} does not state its unit of length: add a line UNIT MM")
    if values[0].upper() not in _UNITS:
        raise InputError(f"{file}: its unit of length {values[0]} is not known; known are {', '.join(_UNITS)}")
    return _UNITS[values[0].upper()]


def _f_number(head: _Lines, file: Path) -> float | None:
    """The stated f-number for a distant scene; None for a working f-number (second value 1)."""
    values = head.values("FNUM")
    if not values or (len(values) > 1 and values[1] != "0"):
        return None
    value = _number(head, "FNUM", 0, str(file), file)
    return value if value > 0 else None


def _entrance_pupil(head: _Lines, unit: float, file: Path) -> float | None:
    if not head.values("ENPD"):
        return None
    value = _number(head, "ENPD", 0, str(file), file)
    return value * unit if value > 0 else None


def _check_supported(surface: _Lines, file: Path) -> None:
    place = _place(file, surface)
    kind = (surface.values("TYPE") or ["STANDARD"])[0].upper()
    if kind not in ("STANDARD", "EVENASPH"):
        what = _TYPES.get(kind, "a gradient-index surface" if kind.startswith("GRAD") else "not a known surface")
        raise InputError(
            f"{place} is {what} (TYPE {kind}), which is not supported: only spheres, conics and even aspheres are"
        )
    if surface.values("GLAS")[:1] == ["MIRROR"]:
        raise InputError(f"{place} is a mirror (GLAS MIRROR), which is not supported: only refracting lenses are")


def _surface(surface: _Lines, unit: float, makers: list[str], media: Media, file: Path, place: str) -> Surface:
    for keyword in ("CURV", "DISZ"):
        if keyword not in surface.found:
            raise InputError(f"{place} has no line {keyword}")
    curvature = _number(surface, "CURV", 0, place, file)
    distance = surface.values("DISZ")[:1]
    thickness = math.inf if distance == ["INFINITY"] else _number(surface, "DISZ", 0, place, file) * unit
    diameter = 2 * _number(surface, "DIAM", 0, place, file) * unit if "DIAM" in surface.found else 0.0
    medium = _medium(surface, makers, media, place, file)
    return Surface(
        radius=math.inf if curvature == 0 else unit / curvature,
        thickness=thickness,
        index=medium.index,
        diameter=diameter if diameter > 0 else None,
        stop="STOP" in surface.found,
        glass=medium.glass,
        number=surface.number,
        conic=_number(surface, "CONI", 0, place, file) if "CONI" in surface.found else 0.0,
        aspheres=_aspheres(surface, unit, place, file),
        material=medium.material,
    )


def _aspheres(surface: _Lines, unit: float, place: str, file: Path) -> tuple[float, ...]:
    """The terms of r⁴, r⁶ … of an EVENASPH surface, whose parameter i is the term of r^2i."""
    if surface.values("TYPE")[:1] != ["EVENASPH"]:
        return ()
    if surface.parameters.get(1, 0.0) != 0:
        raise InputError(
            f"{place} has a term of r² (PARM 1 {surface.parameters[1]:g}), which is not supported: "
            "add it to the curvature"
        )
    return tuple(surface.parameters.get(i, 0.0) * unit ** (1 - 2 * i) for i in range(2, 9))


def _medium(surface: _Lines, makers: list[str], media: Media, place: str, file: Path) -> Medium:
    """The medium behind a surface; the index after a catalogue name is ignored: files have placeholders there."""
    if "GLAS" not in surface.found:
        return AIR
    values = surface.values("GLAS")
    if not values:
        raise InputError(f"{place} has a line GLAS that names no glass")
    if values[0] != _MODEL_GLASS:
        return media.of_name(values[0], makers, place)
    abbe_number = _number(surface, "GLAS", 4, place, file) if len(values) > 4 else 0.0
    return media.of_numbers(_number(surface, "GLAS", 3, place, file), abbe_number, place)


def _without_idle_ends(surfaces: list[Surface]) -> tuple[list[Surface], float | None]:
    """The lens without idle surfaces at its ends, and the distance from its last surface to the image.

    Surfaces in air without refractive power are references of the design; in front of and behind the lens they
    would only increase its length. The stop is kept in any position.
    """
    before = [1.0, *(surface.index for surface in surfaces)]
    counts = [
        place for place, each in enumerate(surfaces) if each.stop or each.index != 1.0 or before[place] != 1.0
    ]
    if not counts:
        return surfaces, None
    first, last = counts[0], counts[-1]
    distance = math.fsum(surface.thickness for surface in surfaces[last:])
    return surfaces[first : last + 1], distance if 0 < distance < math.inf else None
