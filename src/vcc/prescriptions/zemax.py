"""Sequential lenses from Zemax OpticStudio's text files (.zmx): spheres, conics and even aspheres.

Each line is a keyword and values. ``SURF n`` starts a surface, with CURV the curvature, CONI the conic constant,
PARM and XDAT the aspheric terms, DISZ the distance to the next surface, GLAS the medium behind, DIAM the
semi-diameter, and STOP marking the aperture stop. The first surface is the object and the last the image: both
are left out, as are surfaces without effect in air in front of and behind the lens.

Values are those saved in the file: solves and pickups are resolved there, for the configuration that was active.
``MNUM n a`` states n configurations, a the active one; the lines after it, ``THIC surface configuration value``,
state what differs in the others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.units import cm, m, mm, um
from vcc.optics.prescription import Prescription, Surface
from vcc.prescriptions.assembly import (
    MOST_TERMS,
    assembled,
    not_round,
    not_supported,
    radius_of,
    real,
    text_of,
    to_axis,
    without_r2,
)
from vcc.prescriptions.media import AIR, Media, Medium

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
_OFFSET = "4"
"""The second value of a GLAS line for a catalogue glass with its last two values added to nd and V."""
_PICKUP = "4"
"""The solve of a curvature that is copied from another surface."""
_SYSTEM = {"UNIT", "MODE", "NAME", "GCAT", "FNUM", "ENPD", "FTYP", "XFLN", "YFLN", "PWAV", "WAVN", "WAVL", "MNUM"}
_NUMBERED = {"PARM", "XDAT", "WAVM"}
_THICKNESS_SOLVES = {"PZUP", "TCOM", "TOLE", "MAZH"}
_NOT_ROUND = {
    "SQAP": "a rectangular aperture",
    "ELAP": "an elliptical aperture",
    "USAP": "an aperture of its own shape",
    "OBSC": "an obscuration",
    "SQOB": "an obscuration",
    "ELOB": "an obscuration",
    "USOB": "an obscuration",
    "SPID": "a spider",
}
_PER_SURFACE = {
    "STOP",
    "TYPE",
    "CURV",
    "DISZ",
    "GLAS",
    "DIAM",
    "CONI",
    "CLAP",
    "PPAR",
    *_THICKNESS_SOLVES,
    *_NOT_ROUND,
}
_SUPPORTED = {"STANDARD", "EVENASPH", "XASPHERE"}
_TYPES = {
    "ODDASPHE": "an odd asphere",
    "XOSPHERE": "an odd asphere",
    "COORDBRK": "a coordinate break",
    "TILTSURF": "a tilted surface",
    "QED_TYPE": "a Q-type asphere (vcc.prescriptions.qcon converts the terms of Qcon)",
    "TOROIDAL": "a toroid",
    "BICONICX": "a biconic surface",
    "DGRATING": "a diffraction grating",
    "BINARY_1": "a diffractive surface",
    "BINARY_2": "a diffractive surface",
    "PARAXIAL": "an ideal lens (use vcc.Lens)",
    "NONSEQCO": "a non-sequential component",
}
"""Common unsupported surface types, for messages; gradient-index types are GRADSUR1 and so on."""
_REPLACED = {"THIC": "DISZ", "CRVT": "CURV", "CONN": "CONI", "GLSS": "GLAS", "SDIA": "DIAM"}
"""Operands of configurations, and the line of a surface whose first value they replace."""
_WITHOUT_EFFECT = {"MOFF", "LTTL", "FVCX", "FVCY", "FVDX", "FVDY", "FVAN", "FLWT", "WLWT"}
"""Operands that do not change the lens: titles, weights, vignetting factors of fields."""


@dataclass
class _Lines:
    """The relevant lines of the file's head, or of one surface: keyword → (line number, values)."""

    number: int = -1
    found: dict[str, tuple[int, list[str]]] = field(default_factory=dict)
    numbered: dict[str, dict[int, float]] = field(default_factory=dict)

    def values(self, keyword: str) -> list[str]:
        return self.found.get(keyword, (0, []))[1]


@dataclass
class _File:
    head: _Lines
    surfaces: list[_Lines]
    operands: list[tuple[int, str, list[str]]]


def read(content: bytes, file: Path, media: Media, configuration: int | None) -> Prescription:
    """Read the prescription in a Zemax file.

    Raises:
        InputError: not a sequential Zemax file, a surface that is not supported, an unknown glass, a value that is
            not a number, no such configuration or one that cannot be applied. The message names file and surface.
    """
    lines = _grouped(text_of(content), file)
    head, surfaces = lines.head, lines.surfaces
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
    for surface in surfaces:
        _check_opening(surface, file)
    counts = [real(value) or 1.0 for value in head.values("MNUM")[:2]] + [1.0, 1.0]
    many, active = (int(min(max(count, 1), 1e6)) for count in counts[:2])
    image_moves = False
    if configuration is not None:
        checks.whole_number_between("configuration", configuration, 1, many, of=file.name)
        if configuration != active:
            _configure(lines, configuration, unit, file)
            image_moves = _solve(surfaces, file)
    makers = head.values("GCAT")
    listed = [_surface(surface, unit, makers, media, file, _place(file, surface)) for surface in surfaces[:-1]]
    if image_moves:
        listed.append(Surface(math.inf, math.inf, 1.0))  # where the image is now is not known
    return assembled(
        listed,
        file,
        name=" ".join(head.values("NAME")),
        f_number=_f_number(head, file),
        entrance_pupil_diameter=_entrance_pupil(head, unit, file),
        wavelengths=_wavelengths(head),
        fields=_fields(head),
        configurations=many,
    )


def _grouped(text: str, file: Path) -> _File:
    lines = _File(_Lines(), [], [])
    head, surfaces = lines.head, lines.surfaces
    for number, keyword, values in _keywords(text):
        if "MNUM" in head.found:
            lines.operands.append((number, keyword, values))
        elif keyword == "SURF":
            expected = len(surfaces)
            if values[:1] != [str(expected)]:
                raise InputError(
                    f"{file}, line {number}: surface {expected} should follow, not {' '.join(values)!r}"
                )
            surfaces.append(_Lines(expected))
        elif keyword in _NUMBERED:
            _keep_numbered(surfaces[-1] if surfaces else head, number, keyword, values, file)
        elif surfaces and keyword in _PER_SURFACE:
            surfaces[-1].found.setdefault(keyword, (number, values))
        elif keyword in _SYSTEM:
            head.found.setdefault(keyword, (number, values))
    if not surfaces:
        raise InputError(f"{file} lists no surfaces: a Zemax lens has lines SURF 0, SURF 1 …")
    return lines


def _keep_numbered(lines: _Lines, line: int, keyword: str, values: list[str], file: Path) -> None:
    number, value = (real(text) for text in [*values, "", ""][:2])
    if number is None or value is None or not 0 <= number <= MOST_TERMS + 2:
        place = _place(file, lines) if lines.number >= 0 else str(file)
        raise InputError(f'{place}, line {line}: "{keyword} {" ".join(values)}" should have two numbers')
    lines.numbered.setdefault(keyword, {})[int(number)] = value


def _keywords(text: str) -> Iterator[tuple[int, str, list[str]]]:
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if words:
            yield number, words[0], words[1:]


def _place(file: Path, surface: _Lines) -> str:
    return f"{file}: surface {surface.number}"


def _number(lines: _Lines, keyword: str, column: int, place: str) -> float:
    line, values = lines.found[keyword]
    value = real(values[column]) if column < len(values) else None
    if value is None:
        raise InputError(f'{place}, line {line}: "{keyword} {" ".join(values)}" should have a number')
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
    value = _number(head, "FNUM", 0, str(file))
    return value if value > 0 else None


def _entrance_pupil(head: _Lines, unit: float, file: Path) -> float | None:
    if not head.values("ENPD"):
        return None
    value = _number(head, "ENPD", 0, str(file))
    return value * unit if value > 0 else None


def _wavelengths(head: _Lines) -> tuple[float, ...]:
    """Those in use, the main one first; WAVM lists 24, of which FTYP states the number in use."""
    listed = dict(enumerate((real(text) or 0.0 for text in head.values("WAVL")), start=1))
    listed |= head.numbered.get("WAVM", {})
    count = real((head.values("FTYP") or head.values("WAVN") or ["", "", "", ""])[-1:][0])
    if len(head.values("FTYP")) >= 4:
        count = real(head.values("FTYP")[3])
    main = int(min(real((head.values("PWAV") or ["1"])[0]) or 1, 1e3))
    used = [number for number in sorted(listed) if number <= (count or 0) and 0.1 <= listed[number] <= 50]
    return tuple(listed[number] * um for number in sorted(used, key=lambda number: number != main))


def _fields(head: _Lines) -> tuple[float, ...]:
    """Angles to the axis, degrees; heights of objects and images (FTYP 1 to 3) are left out."""
    kind = [real(value) for value in head.values("FTYP")[:3]]
    if len(kind) < 3 or kind[0] != 0:
        return ()
    pairs = zip(head.values("XFLN"), head.values("YFLN"), strict=False)
    return to_axis([(real(x) or 0.0, real(y) or 0.0) for x, y in list(pairs)[: int(min(kind[2] or 0, 1e3))]])


def _check_supported(surface: _Lines, file: Path) -> None:
    place = _place(file, surface)
    kind = (surface.values("TYPE") or ["STANDARD"])[0].upper()
    if kind not in _SUPPORTED:
        what = _TYPES.get(kind, "a gradient-index surface" if kind.startswith("GRAD") else "not a known surface")
        raise not_supported(place, f"{what} (TYPE {kind})")
    if surface.values("GLAS")[:1] == ["MIRROR"]:
        raise not_supported(place, "a mirror (GLAS MIRROR)")


def _check_opening(surface: _Lines, file: Path) -> None:
    place = _place(file, surface)
    for keyword in _NOT_ROUND:
        if keyword in surface.found:
            raise not_round(place, f"{_NOT_ROUND[keyword]} ({keyword})")
    if "CLAP" in surface.found and _number(surface, "CLAP", 0, place) > 0:
        raise not_round(place, "an aperture with an obscured centre (CLAP)")


def _surface(surface: _Lines, unit: float, makers: list[str], media: Media, file: Path, place: str) -> Surface:
    for keyword in ("CURV", "DISZ"):
        if keyword not in surface.found:
            raise InputError(f"{place} has no line {keyword}")
    distance = surface.values("DISZ")[:1]
    thickness = math.inf if distance == ["INFINITY"] else _number(surface, "DISZ", 0, place) * unit
    diameter = 2 * _number(surface, "DIAM", 0, place) * unit if "DIAM" in surface.found else 0.0
    if "CLAP" in surface.found:
        diameter = 2 * _number(surface, "CLAP", 1, place) * unit
    medium = _medium(surface, makers, media, place)
    return Surface(
        radius=radius_of(_number(surface, "CURV", 0, place), unit),
        thickness=thickness,
        index=medium.index,
        diameter=diameter if diameter > 0 else None,
        stop="STOP" in surface.found,
        glass=medium.glass,
        number=surface.number,
        conic=_number(surface, "CONI", 0, place) if "CONI" in surface.found else 0.0,
        aspheres=_aspheres(surface, unit, place),
        material=medium.material,
    )


def _aspheres(surface: _Lines, unit: float, place: str) -> tuple[float, ...]:
    """The terms of r⁴, r⁶ …: PARM i is that of r^2i; XDAT i + 2 that of (r/XDAT 2)^2i, for i up to XDAT 1."""
    kind = surface.values("TYPE")[:1]
    if kind == ["EVENASPH"]:
        terms = surface.numbered.get("PARM", {})
        return without_r2([terms.get(i, 0.0) for i in range(1, 9)], unit, place)
    if kind == ["XASPHERE"]:
        terms = surface.numbered.get("XDAT", {})
        count, norm = int(min(terms.get(1, 0), MOST_TERMS)), terms.get(2, 1.0)
        if count > 0 and norm < 1e-6:
            raise InputError(f"{place} has the norm radius {norm:g} (XDAT 2): it is 1e-6 or more")
        return without_r2([terms.get(i + 2, 0.0) / norm ** (2 * i) for i in range(1, count + 1)], unit, place)
    return ()


def _medium(surface: _Lines, makers: list[str], media: Media, place: str) -> Medium:
    """The medium behind a surface; the index after a catalogue name is ignored: files have placeholders there."""
    if "GLAS" not in surface.found:
        return AIR
    values = surface.values("GLAS")
    if not values:
        raise InputError(f"{place} has a line GLAS that names no glass")
    if values[0] != _MODEL_GLASS:
        offsets = values[9:11] if values[1:2] == [_OFFSET] else []
        if any(real(offset) != 0 for offset in offsets) and values[0].upper() not in media.given:
            raise InputError(
                f"{place} is of {values[0]} with an offset of nd and V ({', '.join(offsets)}), which is not "
                f'supported: pass the glass, glasses={{"{values[0]}": vcc.glasses.Abbe(1.69, 53.0)}}, say'
            )
        return media.of_name(values[0], makers, place)
    abbe_number = _number(surface, "GLAS", 4, place) if len(values) > 4 else 0.0
    return media.of_numbers(_number(surface, "GLAS", 3, place), abbe_number, place)


def _configure(lines: _File, configuration: int, unit: float, file: Path) -> None:
    """Replace the saved values by those of a configuration."""
    surfaces, head = lines.surfaces, lines.head
    for line, keyword, values in lines.operands:
        if keyword in _WITHOUT_EFFECT or real([*values, "", ""][1]) != configuration:
            continue
        where = f"{file}, line {line}"
        first = int(min(max(real(values[0]) or 0, 0), 1e6))
        if len(values) < 3:
            raise InputError(f'{where}: "{keyword} {" ".join(values)}" should have a surface and a value')
        value = values[2].strip('"')
        if keyword in _REPLACED or keyword == "STPS":
            if first >= len(surfaces):
                raise InputError(f"{where}: {keyword} is for surface {first}, and the last is {len(surfaces) - 1}")
            if keyword == "STPS":
                for surface in surfaces:
                    surface.found.pop("STOP", None)
                surfaces[first].found["STOP"] = (line, [])
            elif keyword == "GLSS" and not value:
                surfaces[first].found.pop("GLAS", None)
            else:
                surfaces[first].found[_REPLACED[keyword]] = (line, [value])
        elif keyword == "APER" and (stated := next((k for k in ("FNUM", "ENPD") if k in head.found), None)):
            head.found[stated] = (line, [value, *head.values(stated)[1:]])
        elif keyword in ("XFIE", "YFIE"):
            old = head.values(f"{keyword[0]}FLN")
            old[first - 1 : first] = [value]
        elif keyword == "WAVE":
            head.numbered.setdefault("WAVM", {})[first] = real(value) or 0.0
        else:
            raise InputError(
                f"{where}: configuration {configuration} changes {keyword}, which cannot be applied: save the "
                "file with this configuration active, and leave out configuration="
            )
    for surface in surfaces:  # an operand may have made a mirror
        _check_supported(surface, file)


def _solve(surfaces: list[_Lines], file: Path) -> bool:
    """Resolve solves again, in the order of surfaces; whether the distance to the image is not known any more."""
    for surface in surfaces[:-1]:
        place = _place(file, surface)
        curve, glass = surface.values("CURV"), surface.values("GLAS")
        if curve[1:2] == [_PICKUP] and len(curve) >= 4:
            source = _source(surface, "CURV", 2, surfaces, place)
            scaled = _number(surface, "CURV", 3, place) * _number(source, "CURV", 0, _place(file, source))
            surface.found["CURV"] = (surface.found["CURV"][0], [repr(scaled)])
        elif curve[1:2] not in ([], ["0"], ["1"]):
            raise _unsolved(place, f"CURV {' '.join(curve)}")
        if "PPAR" in surface.found:
            raise _unsolved(place, "PPAR")
        if glass[1:2] == ["2"] and len(glass) > 2:
            source = _source(surface, "GLAS", 2, surfaces, place)
            surface.found["GLAS"] = (surface.found["GLAS"][0], source.values("GLAS")[:1] or [_MODEL_GLASS])
        for keyword in _THICKNESS_SOLVES & set(surface.found):
            if keyword not in ("PZUP", "TCOM", "TOLE"):
                if surface is surfaces[-2]:
                    return True
                raise _unsolved(place, keyword)
            source = _source(surface, keyword, 0, surfaces, place)
            known = [_number(source, "DISZ", 0, _place(file, source))]
            if keyword == "TOLE":
                between = surfaces[source.number : surface.number]
                known = [_number(each, "DISZ", 0, _place(file, each)) for each in between]
            if keyword == "PZUP":
                scale, offset = (_number(surface, keyword, column, place) for column in (1, 2))
                thickness = scale * known[0] + offset
            else:
                thickness = _number(surface, keyword, 1, place) - math.fsum(known)
            surface.found["DISZ"] = (surface.found[keyword][0], [repr(thickness)])
    return False


def _source(surface: _Lines, keyword: str, column: int, surfaces: list[_Lines], place: str) -> _Lines:
    """The earlier surface that a solve refers to."""
    number = _number(surface, keyword, column, place)
    if not 0 <= number < surface.number:
        raise InputError(f"{place}: its {keyword} refers to surface {number:g}, which is not before it")
    return surfaces[int(number)]


def _unsolved(place: str, solve: str) -> InputError:
    return InputError(
        f"{place} has the solve {solve}, which is not applied in another configuration: save the file with this "
        "configuration active, and leave out configuration="
    )
