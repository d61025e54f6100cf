"""Lens tables of PBRT: one surface per line, from the scene side to the film side, in millimetres.

Four columns (Pharr, Jakob, Humphreys, *Physically Based Rendering*, section 6.4.1): radius of curvature,
thickness to the next surface, refractive index of the medium behind (0 or 1: air), diameter of the opening.
A radius of 0 marks the aperture stop. Text after ``#`` is a comment.
"""

from __future__ import annotations

import math
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.optics.prescription import Prescription, Surface
from vcc.prescriptions.assembly import no_configuration
from vcc.prescriptions.media import Media

_COLUMNS = ("radius", "thickness", "index", "diameter")


def read(content: bytes, file: Path, media: Media, configuration: int | None) -> Prescription:
    """Read the prescription in a PBRT lens table; its indices are for one wavelength, so ``media`` is not used.

    Raises:
        InputError: no surfaces, or a line that is not four numbers. The message names file and line.
    """
    no_configuration(configuration, file)
    text = content.decode("utf-8-sig", errors="replace")
    surfaces: list[Surface] = []
    remarks: list[str] = []
    before = 1.0
    for number, line in enumerate(text.splitlines(), start=1):
        values, _, remark = line.partition("#")
        if not values.strip():
            remarks.append(remark.strip(' \t"'))
            continue
        surfaces.append(_surface(values.split(), before, len(surfaces) + 1, f"{file}, line {number}"))
        before = surfaces[-1].index
    if not surfaces:
        raise InputError(f"{file} lists no surfaces: a line for each, with {', '.join(_COLUMNS)} (millimetres)")
    behind = surfaces[-1].thickness
    return Prescription(
        tuple(surfaces),
        name=next((remark for remark in remarks if remark), ""),
        source=file.name,
        image_distance=behind if behind > 0 else None,
    )


def _surface(columns: list[str], before: float, number: int, place: str) -> Surface:
    if len(columns) != len(_COLUMNS):
        raise InputError(
            f"{place} has {len(columns)} columns: a surface is {', '.join(_COLUMNS)} "
            "(millimetres, radius 0 for the stop)"
        )
    values = {}
    for name, column in zip(_COLUMNS, columns, strict=True):
        try:
            values[name] = float(column)
        except ValueError:
            values[name] = math.nan
        if not math.isfinite(values[name]):
            raise InputError(f'{place}: the {name} of surface {number} is "{column}", which is not a number')
    if values["diameter"] < 0:
        raise InputError(f"{place}: the diameter of surface {number} is {values['diameter']:g} mm, below 0")
    index = values["index"] or 1.0
    stop = values["radius"] == 0
    if stop and index != before:
        raise InputError(
            f"{place}: surface {number} has radius 0, the mark of the aperture stop, but the index changes there "
            f"from {before:g} to {index:g}. Write a flat surface of glass with a large radius, 1e9 say"
        )
    return Surface(
        radius=math.inf if stop else values["radius"] * mm,
        thickness=values["thickness"] * mm,
        index=index,
        diameter=values["diameter"] * mm or None,
        stop=stop,
        number=number,
    )
