"""Sequential lenses from CODE V's command files (.seq): spheres, conics and even aspheres.

A command is a name, sometimes a surface (``S3``), and values; ``;`` and line ends separate commands, ``&`` at the
end of a line continues it, ``!`` starts a comment. ``SO``, ``S`` and ``SI`` are the object, the next surface and
the image, each with its radius (curvature after ``RDM N``), the distance to the next surface and the glass behind.
The commands after a surface belong to it: STO, CIR, K, the terms A to J of r⁴ to r²⁰. Values are those of the
first zoom position; ``ZOO n`` states n positions, and ``ZOO THI S3 …`` one value for each.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.units import cm, mm, nm
from vcc.optics.catalogues import spelled
from vcc.optics.glass import Glass, Table
from vcc.optics.prescription import Prescription, Surface
from vcc.prescriptions.assembly import (
    FAR,
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

_UNITS = {"M": mm, "MM": mm, "C": cm, "CM": cm, "I": 25.4 * mm, "IN": 25.4 * mm}
_TERMS = "ABCDEFGHJ"
"""The commands of the terms of r⁴, r⁶ … r²⁰."""
_NUMBERS = {"THI", "RDY", "CUY", "K", "CIR", *_TERMS}
"""Commands of a surface with one number."""
_REFUSED = {
    "CYL": "a cylinder", "XTO": "a toroid", "YTO": "a toroid", "AAS": "an anamorphic asphere",
    "SPS": "a special surface", "ZRN": "a Zernike surface", "UDS": "a surface of its own shape",
    "ODD": "an odd asphere", "DIF": "a diffractive surface", "GRT": "a grating", "HOE": "a hologram",
    "GRI": "a gradient-index surface", "RMD": "a mirror", "BEN": "a mirror", "NSS": "a non-sequential surface",
}  # fmt: skip
_ZERO = {
    **dict.fromkeys(("XDE", "YDE", "ZDE", "ADE", "BDE", "CDE"), "a decentred or tilted surface"),
    **dict.fromkeys(("ADX", "ADY"), "a surface with a decentred opening"),
    "CUF": "a Fresnel surface",
}
"""Commands that are supported only with values of 0."""
_NOT_ROUND = {"REX": "a rectangular", "REY": "a rectangular", "ELX": "an elliptical", "ELY": "an elliptical"}
_OF_SURFACES = {"STO", "GLA", "PIM", *_NUMBERS, *_REFUSED, *_ZERO, *_NOT_ROUND}
_WITHOUT_EFFECT = re.compile(r"THC|CCY|KC|[A-J]C|GLC|V[UL][XY]|WT[FWZ]|TIT|[XY](AN|IM|RI|OB)|POS|SLB|DLT|PIM")
"""What does not change the lens between zoom positions: codes of optimisation, vignetting, fields, titles."""
_FICTITIOUS = re.compile(r"(\d{3,6})\.(\d{3,6})|(\d{3})(\d{3})|(\d\.\d+):(\d+\.?\d*)")
"""Glasses by number: 516800.641700, 517642 and 1.5168:64.2, all nd and V."""


@dataclass
class _Row:
    """A surface as the file states it; numbers in the file's unit."""

    number: int
    values: dict[str, float] = field(default_factory=dict)
    glass: str = ""
    stop: bool = False
    solve: list[str] = field(default_factory=list)

    @property
    def curvature(self) -> float:
        if "CUY" in self.values:
            return self.values["CUY"]
        radius = self.values.get("RDY", 0.0)
        return 1 / radius if radius else 0.0


class _Reader:
    """Runs the commands of a file, in order."""

    def __init__(self, file: Path) -> None:
        self.file, self.place = file, str(file)
        self.rows: list[_Row] = []
        self.system: dict[str, list[str]] = {}
        self.zooms: list[tuple[str, list[str]]] = []
        self.private: dict[str, Glass | float] = {}
        self.private_wavelengths: list[float] = []
        self.in_private = self.pickups = False
        self.curvatures: bool | None = None

    def run(self, line: int, words: list[str]) -> None:
        self.place = f"{self.file}, line {line}"
        name, values = words[0].upper(), words[1:]
        if self.in_private:
            self._private_glass(name[:3], words)
        elif re.fullmatch(r"S(O|I|\d{1,6})?", name):
            self._new_surface(name[1:], values)
        elif name.startswith("ZOO"):
            self.zooms.append((self.place, values))
        elif self.zooms and any(re.fullmatch(r"Z\d{1,6}", value.upper()) for value in values[:2]):
            self.zooms.append((self.place, words))
        elif name == "RDM":
            self.curvatures = bool(values) and values[0].upper().startswith("N")
        elif name == "PRV":
            self.in_private = True
        elif name == "PIK":
            self.pickups = True
        elif not self._of_surface(name[:3], values):
            self.system[name[:3]] = values

    def _private_glass(self, name: str, words: list[str]) -> None:
        """A line between PRV and END: wavelengths (PWL), or a glass with its index at each of them."""
        numbers = [real(word) for word in words[1:]]
        if name == "END":
            self.in_private = False
        elif name == "PWL":
            self.private_wavelengths = [(number or 0.0) * nm for number in numbers]
        elif len(numbers) == len(self.private_wavelengths) and None not in numbers:
            pairs = sorted(zip(self.private_wavelengths, (number or 0.0 for number in numbers), strict=True))
            waves, indices = zip(*pairs, strict=True)
            self.private[_bare(words[0])] = indices[0] if len(pairs) == 1 else Table(waves, indices)

    def _new_surface(self, which: str, values: list[str]) -> None:
        if not values:
            raise InputError(f"{self.place}: a surface has a radius, a thickness and a glass")
        expected = "O" if not self.rows else str(len(self.rows))
        if (which or expected) not in (expected, "I") and not (which == "0" and not self.rows):
            raise InputError(f"{self.place}: surface S{expected} should follow, not S{which}")
        if self.rows and self.rows[-1].number < 0:
            raise InputError(f"{self.place}: a surface follows the image surface SI")
        row = _Row(-1 if which == "I" else len(self.rows))
        self.rows.append(row)
        if self.curvatures is None and self._value(values[0]) != 0:
            raise InputError(
                f"{self.file} does not state whether surfaces have radii or curvatures: add a line RDM (radii) or "
                "RDM N (curvatures)"
            )
        row.values["CUY" if self.curvatures else "RDY"] = self._value(values[0])
        row.values["THI"] = self._value(values[1]) if len(values) > 1 else 0.0
        row.glass = " ".join(values[2:3])
        if any(real(value) is not None for value in values[3:]):
            raise InputError(
                f"{self.place}: {' '.join(values[3:])} follows the radius, the thickness and the glass"
            )
        if any(value.upper().startswith("REFL") for value in values[2:]):
            raise not_supported(self.surface(row), "a mirror (REFL)")

    def surface(self, row: _Row) -> str:
        return f"{self.file}: surface {row.number}"

    def _value(self, text: str) -> float:
        number = real(text)
        if number is None:
            raise InputError(f'{self.place}: "{text}" should be a number')
        return number

    def _row(self, which: str) -> _Row:
        """The row of O, I, S (the stop) or a number."""
        rows = [row for row in self.rows if row.stop] if which == "S" else self.rows
        number = {"O": 0, "I": -1, "S": 0}.get(which, int(which) if which.isdigit() else 0)
        if not -1 <= number < len(rows) or not rows:
            raise InputError(f"{self.place}: there is no surface S{which}")
        return rows[number]

    def _of_surface(self, name: str, values: list[str]) -> bool:
        """Run a command of the surface that it names, else of the last; whether it is one."""
        row = self.rows[-1] if self.rows else None
        if values and (named := re.fullmatch(r"S([OIS]|\d{1,6})", values[0].upper())):
            row, values = self._row(named[1]), values[1:]
        if row is None or name not in _OF_SURFACES:
            return False
        if name in _REFUSED and not (name == "RMD" and [v.upper()[:4] for v in values[:1]] == ["REFR"]):
            raise not_supported(self.surface(row), f"{_REFUSED[name]} ({name})")
        if name in _ZERO and any(real(value) not in (0, None) for value in values):
            raise not_supported(self.surface(row), f"{_ZERO[name]} ({name})")
        qualifier = values[0].upper() if values and real(values[0]) is None else ""
        if (name in _NOT_ROUND and qualifier != "EDG") or (name == "CIR" and qualifier in ("OBS", "HOL")):
            raise not_round(self.surface(row), f"{_NOT_ROUND.get(name, 'an obscured')} opening ({name})")
        if name == "STO":
            row.stop = True
        elif name == "GLA":
            row.glass = " ".join(values[:1])
        elif name == "PIM" or (name == "THI" and qualifier):
            row.solve = [name, *values]
        elif name in _NUMBERS and qualifier != "EDG" and values:
            if name in ("RDY", "CUY"):
                row.values.pop("CUY" if name == "RDY" else "RDY", None)
            row.values[name] = self._value(values[-1])
        return True

    def configure(self, configuration: int, many: int) -> bool:
        """Replace values by those of a zoom position; whether the distance to the image is not known any more."""
        if self.pickups and configuration != 1:
            raise InputError(
                f"{self.file} has pickups (PIK), which are not applied in other configurations: save the file "
                "with this position as the only one"
            )
        moved: set[int] = set()
        for place, words in self.zooms:
            self.place, name, values = place, "".join(words[:1]).upper(), words[1:]
            if real(name) is not None or _WITHOUT_EFFECT.fullmatch(name[:3]):
                if name in ("XAN", "YAN"):
                    self.system.pop(name, None)
                continue
            if name not in (*_NUMBERS, "GLA", "EPD", "FNO", "NA"):
                raise InputError(
                    f"{self.place}: zoom positions change {name}, which cannot be applied: save the file with one "
                    "position"
                )
            target = values.pop(0) if values and re.match(r"S([OIS]|\d)", values[0].upper()) else ""
            if values and (position := re.fullmatch(r"Z(\d{1,6})", values[0].upper())):
                values = [values[1]] if position[1] == str(configuration) and len(values) > 1 else []
            elif values:
                if len(values) not in (1, many):
                    raise InputError(f"{place}: {name} has {len(values)} values for {many} zoom positions")
                values = [values[min(configuration, len(values)) - 1]]
            if values and not self._of_surface(name, [target, *values] if target else values):
                self.system[name] = values
            if values and target and name == "THI":
                moved.add(self._row(target[1:].upper()).number)
        return configuration != 1 and self._solve(moved)

    def _solve(self, moved: set[int]) -> bool:
        last = self.rows[-2]
        for row in self.rows:
            if row.number in moved or not row.solve:
                continue
            kind, *rest = row.solve[1:] or [""]
            ends = re.fullmatch(r"S(\d{1,6})\.\.(\d{1,6})", (rest or [""])[0].upper())
            if kind.upper() == "OAL" and ends and int(ends[1]) <= row.number == int(ends[2]) - 1 and len(rest) > 1:
                before = self.rows[int(ends[1]) : row.number]
                row.values["THI"] = self._value(rest[1]) - math.fsum(each.values["THI"] for each in before)
            elif row is not last:
                raise InputError(
                    f"{self.surface(row)} has the solve {' '.join(row.solve)}, which is not applied in other "
                    "configurations: save the file with this position as the only one"
                )
        return bool(last.solve) and last.number not in moved

    def number(self, name: str, column: int = 0) -> float | None:
        values = self.system.get(name, [])
        return real(values[column]) if len(values) > column else None


def read(content: bytes, file: Path, media: Media, configuration: int | None) -> Prescription:
    """Read the prescription in a CODE V command file.

    Raises:
        InputError: no surfaces, a surface that is not supported, an unknown glass, a value that is not a number,
            no such configuration or one that cannot be applied. The message names the file and the surface or
            line.
    """
    reader = _Reader(file)
    for line, words in _commands(text_of(content)):
        reader.run(line, words)
    rows = reader.rows
    if len(rows) < 3 or rows[-1].number >= 0:
        raise InputError(
            f"{file} lists {len(rows)} surfaces: a CODE V lens has an object SO, surfaces S, and last an image SI"
        )
    dimension = (reader.system.get("DIM") or ["M"])[0].upper()
    if dimension not in _UNITS:
        raise InputError(f"{file}: its unit of length DIM {dimension} is not known; known are {', '.join(_UNITS)}")
    unit = _UNITS[dimension]
    many = next(
        (int(count) for _, values in reader.zooms if values and 1 <= (count := real(values[0]) or 0) < 1e6), 1
    )
    lost = False
    if configuration is not None:
        checks.whole_number_between("configuration", configuration, 1, many, of=file.name)
        lost = reader.configure(configuration, many)
    rows[-2].values["THI"] += math.inf if lost else rows[-1].values["THI"]  # that of the image is its defocus
    f_number, pupil, aperture = (reader.number(name) for name in ("FNO", "EPD", "NA"))
    if abs(rows[0].values["THI"]) < FAR:
        f_number = aperture = None  # those of a near object: the stop's opening counts
    elif aperture:
        f_number = 1 / (2 * aperture)
    x, y = ([real(value) or 0.0 for value in reader.system.get(name, [])] for name in ("XAN", "YAN"))
    waves = [(real(value) or 0.0) * nm for value in reader.system.get("WL", [])]
    reference = int(min(max(reader.number("REF") or 1, 1), 1e3)) - 1
    return assembled(
        [_surface(row, reader, unit, media) for row in rows[:-1]],
        file,
        name=" ".join(map(_bare, reader.system.get("TIT", []))),
        f_number=f_number if f_number and f_number > 0 else None,
        entrance_pupil_diameter=pupil * unit if pupil and pupil > 0 else None,
        wavelengths=tuple(waves[reference : reference + 1] + waves[:reference] + waves[reference + 1 :]),
        fields=to_axis(list(itertools.zip_longest(x, y, fillvalue=0.0))),
        configurations=many,
    )


def _commands(text: str) -> Iterator[tuple[int, list[str]]]:
    """(line number, words) of each command; quotes keep spaces, and stay."""
    line, kept = 0, ""
    for number, part in enumerate(text.splitlines(), start=1):
        line = line if kept else number
        kept += re.sub(r"""("[^"]*"|'[^']*')|!.*""", lambda found: found[1] or "", part).rstrip()
        if kept.endswith("&"):
            kept = kept[:-1] + " "
            continue
        words: list[str] = []
        for word in [*re.findall(r"""[^\s;"']*"[^"]*"|'[^']*'|[^\s;]+|;""", kept), ";"]:
            if word != ";":
                words.append(word)
            elif words:
                yield line, words
                words = []
        kept = ""


def _bare(text: str) -> str:
    return text.strip("'\"")


def _surface(row: _Row, reader: _Reader, unit: float, media: Media) -> Surface:
    place, values = reader.surface(row), row.values
    medium = _medium(row.glass, reader.private, media, place)
    far = abs(values["THI"]) >= FAR
    diameter = 2 * values.get("CIR", 0.0) * unit
    return Surface(
        radius=radius_of(row.curvature, unit),
        thickness=math.inf if far else values["THI"] * unit,
        index=medium.index,
        diameter=diameter if diameter > 0 else None,
        stop=row.stop,
        glass=medium.glass,
        number=row.number,
        conic=values.get("K", 0.0),
        aspheres=without_r2([0.0, *(values.get(term, 0.0) for term in _TERMS)], unit, place),
        material=medium.material,
    )


def _medium(written: str, private: dict[str, Glass | float], media: Media, place: str) -> Medium:
    """The medium that a glass name or number states: ``NBK7_SCHOTT``, ``'MINE'``, ``517642``, ``1.5168:64.2``."""
    name = _bare(written)
    if name.upper() in ("", "AIR"):
        return AIR
    if name.upper() in media.given:
        return media.of_name(name, [], place)
    if name.upper().startswith("REFL"):
        raise not_supported(place, "a mirror (REFL)")
    if name in private:
        own = private[name]
        return media.of_glass(name, own, place) if isinstance(own, Glass) else Medium(own, name)
    if number := _FICTITIOUS.fullmatch(name):
        nd, v = (part for part in number.groups() if part is not None)
        if ":" in name:
            return media.of_numbers(float(nd), float(v), place, name)
        return media.of_numbers(1 + float(f"0.{nd}"), 100 * float(f"0.{v}"), place, name)
    if (index := real(name)) is not None:
        return Medium(index, name)
    letters, _, maker = name.partition("_")
    return media.of_name(spelled(letters, maker) if maker else letters, [maker] if maker else [], place)
