"""What all readers of lens files do: text, numbers, and the lens between the object and the image."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vcc.base.errors import InputError
from vcc.optics.prescription import Prescription, Surface

FAR = 1e9
"""Object distances from here on (in the file's unit) count as infinite: files write 1e10 for infinity."""
MOST_TERMS = 240
"""Largest number of aspheric terms of a surface: that of Zemax's extended asphere."""


def text_of(content: bytes) -> str:
    """Decode UTF-16 (newer programs), UTF-8, or the Windows code page (older programs)."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    if content[1:2] == b"\0":
        return content.decode("utf-16-le", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")  # only names and notes can contain such characters


def real(value: Any) -> float | None:
    """A number, infinite too, from text or JSON; None for anything else and for NaN."""
    try:
        number = float(value) if isinstance(value, str | int | float) else math.nan
    except (ValueError, OverflowError):
        return None
    return None if math.isnan(number) else number


def without_r2(terms: Sequence[float], unit: float, place: str) -> tuple[float, ...]:
    """The terms of r⁴, r⁶ … in SI, from those of r², r⁴ … in the file's unit.

    Raises:
        InputError: a term of r², or too many terms.
    """
    if len(terms) > MOST_TERMS:
        raise InputError(f"{place} has {len(terms)} aspheric terms: {MOST_TERMS} are supported")
    if terms and terms[0] != 0:
        raise InputError(
            f"{place} has a term of r² ({terms[0]:g}), which is not supported: state the surface by its radius, "
            "conic constant and terms of r⁴, r⁶ …"
        )
    return tuple(term * unit ** (1 - 2 * power) if term else 0.0 for power, term in enumerate(terms[1:], start=2))


def radius_of(curvature: float, unit: float) -> float:
    """The radius in metres of a curvature in the file's unit; infinite for a plane."""
    return unit / curvature if curvature else math.inf


def to_axis(angles: Sequence[tuple[float, float]]) -> tuple[float, ...]:
    """The angles between rays and the axis, degrees, of their angles in x and in y."""
    return tuple(
        math.degrees(math.atan(math.hypot(*(math.tan(math.radians(angle)) for angle in pair))))
        if all(0 < abs(angle) < 90 for angle in pair)
        else max(map(abs, pair))  # in one of the two planes; fisheyes have more than 90 degrees
        for pair in angles
    )


def not_supported(place: str, what: str) -> InputError:
    """The error for a surface that has no place in a lens of surfaces of rotation in line."""
    return InputError(
        f"{place} is {what}, which is not supported: only spheres, conics and even aspheres are, with glass or "
        "air behind"
    )


def not_round(place: str, what: str) -> InputError:
    """The error for an opening that is not a disc around the axis."""
    return InputError(
        f"{place} has {what}, which is not supported: only round openings are. Delete it in a copy of the "
        "file, and add a vcc.Mask for it"
    )


def no_configuration(configuration: int | None, file: Path) -> None:
    """Check the number of a configuration for a format without configurations.

    Raises:
        InputError: another than 1.
    """
    if configuration not in (None, 1):
        raise InputError(f"{file} has one configuration: configuration={configuration!r} is not in it")


def assembled(listed: Sequence[Surface], file: Path, **system: Any) -> Prescription:
    """The prescription of listed surfaces: the object first, without the image.

    Idle surfaces in air without refractive power are references of the design; in front of and behind the lens
    they would only increase its length, and are left out. The stop is kept in any position.

    Raises:
        InputError: the object lies in glass.
    """
    if listed[0].index != 1.0:
        raise InputError(f"{file}: the object lies in {listed[0].glass or 'glass'}, not in air")
    surfaces = list(listed[1:])
    before = [1.0, *(surface.index for surface in surfaces)]
    counts = [
        place for place, each in enumerate(surfaces) if each.stop or each.index != 1.0 or before[place] != 1.0
    ]
    distance = math.inf
    if counts:
        distance = math.fsum(surface.thickness for surface in surfaces[counts[-1] :])
        surfaces = surfaces[counts[0] : counts[-1] + 1]
    return Prescription(
        tuple(surfaces), source=file.name, image_distance=distance if 0 < distance < math.inf else None, **system
    )
