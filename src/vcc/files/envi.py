"""ENVI pictures: raw samples, ``.img``, ``.bsq``, ``.bil`` or ``.bip``, with a text header ``.hdr`` beside them.

The header's fields are those of the ENVI format (NV5 Geospatial, "ENVI Header Files"); unknown ones are ignored.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import number
from vcc.base.wavelengths import wavelength

ENDINGS = (".img", ".bsq", ".bil", ".bip")
"""Of the files of samples."""
LARGEST_HEADER = 1_000_000
"""Bytes; headers of hundreds of bands have some thousand."""

_FIELD = re.compile(r"^[ \t]*([^={}\n]+?)[ \t]*=[ \t]*(\{[^{}]*\}|[^\n]*)", re.MULTILINE)
_KINDS = {1: np.uint8, 2: np.int16, 4: np.float32, 5: np.float64, 12: np.uint16}
_AXES = {"bsq": (2, 0, 1), "bil": (0, 2, 1), "bip": (0, 1, 2)}
"""Which of (rows, columns, bands) each axis of the file is."""
_UNITS = {"nanometers": 1e-9, "nm": 1e-9, "micrometers": 1e-6, "um": 1e-6, "microns": 1e-6, "angstroms": 1e-10}


def read_envi(path: Path) -> NDArray[Any]:
    """The samples, (rows, columns) or (rows, columns, bands): uint8, uint16 or float32, as stored.

    Args:
        path: of the samples. The header is ``picture.hdr`` or ``picture.img.hdr``.

    Raises:
        InputError: no header or a damaged one, another data type, negative integers, or a file of another size.
    """
    fields = _header_of(path)
    rows, columns, bands = (_whole(fields, name) for name in ("lines", "samples", "bands"))
    kind = _KINDS.get(_whole(fields, "data type"))
    interleave = fields.get("interleave", "").lower()
    if kind is None or interleave not in _AXES:
        raise InputError(
            f"its ENVI header states data type {fields['data type'][:20]} and interleave {interleave[:20]!r}: "
            f"types {', '.join(map(str, _KINDS))} and {', '.join(_AXES)} are supported"
        )
    stored = np.dtype(kind).newbyteorder(">" if fields.get("byte order", "0") == "1" else "<")
    offset, count = _whole(fields, "header offset", 0), rows * columns * bands
    if count == 0 or path.stat().st_size != offset + count * stored.itemsize:
        raise InputError(
            f"its ENVI header states {rows}×{columns} pixels of {bands} bands, "
            f"{offset + count * stored.itemsize} bytes, and the file has {path.stat().st_size}"
        )
    axes = _AXES[interleave]
    shape = [(rows, columns, bands)[axis] for axis in axes]
    values = np.fromfile(path, stored, count, offset=offset).reshape(shape).transpose(np.argsort(axes))
    if kind is np.int16:
        if values.min() < 0:
            raise InputError(f"this ENVI picture holds negative numbers, down to {values.min()}: it is no light")
        kind = np.uint16
    samples = np.ascontiguousarray(values, dtype=np.float32 if kind is np.float64 else kind)
    return samples[..., 0] if bands == 1 else samples


def wavelengths_of(path: Path) -> tuple[float, ...] | None:
    """The wavelengths that the header states for the bands, metres; None if it states none.

    Raises:
        InputError: a missing or damaged header, an unknown unit, wavelengths that are no numbers from 100 nm to
            50 µm, or another number of them than of bands.
    """
    fields = _header_of(path)
    if "wavelength" not in fields:
        return None
    unit = fields.get("wavelength units", "").lower()
    if unit not in _UNITS:
        raise InputError(
            f"the unit of the wavelengths in its ENVI header is {unit[:20]!r}, not one of {', '.join(_UNITS)}"
        )
    stated = fields["wavelength"].strip("{} \n\t").split(",")
    if len(stated) != _whole(fields, "bands"):
        raise InputError(f"its ENVI header states {len(stated)} wavelengths for {fields['bands'][:20]} bands")
    return tuple(
        wavelength(f"wavelength {each.strip()[:20]!r} of its ENVI header", number(each) * _UNITS[unit])
        for each in stated
    )


def _header_of(path: Path) -> dict[str, str]:
    """The fields by their names in lower case."""
    for file in (path.with_suffix(".hdr"), path.with_name(path.name + ".hdr")):
        if file.is_file():
            break
    else:
        raise InputError(f"its ENVI header, {path.with_suffix('.hdr').name}, is missing")
    if file.stat().st_size > LARGEST_HEADER:
        raise InputError(f"its ENVI header has {file.stat().st_size} bytes: that is no header")
    text = file.read_text(encoding="utf-8", errors="replace").replace("\r\n", "\n")
    if not text.startswith("ENVI"):
        raise InputError(f"{file.name} beside it is no ENVI header: its first line is not ENVI")
    return {name.strip().lower(): value.strip() for name, value in _FIELD.findall(text)}


def _whole(fields: dict[str, str], name: str, default: int | None = None) -> int:
    stated = fields.get(name, "" if default is None else str(default))
    if not re.fullmatch(r"\d{1,12}", stated):
        raise InputError(f'its ENVI header states "{name}" as {stated[:20]!r}: a whole number is needed')
    return int(stated)
