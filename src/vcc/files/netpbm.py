"""Binary Netpbm pictures, ``.ppm`` and ``.pgm`` (used by JPEG Pleno's light fields), and floats, ``.pfm``."""

from __future__ import annotations

import math
import re
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import expanded, number, read_bytes

_SPACE = rb"(?:\s|#[^\n]*\n)+"
_HEADER = re.compile(rb"P([56])" + _SPACE + rb"(\d{1,18})" + _SPACE + rb"(\d{1,18})" + _SPACE + rb"(\d{1,9})\s")
_HEADER_OF_FLOATS = re.compile(rb"(P[fF])\s+(\d{1,18})\s+(\d{1,18})\s+(\S+)[ \t\r]*\n")


def read_netpbm(path: Path) -> NDArray[Any]:
    """The samples of a P5 or P6 file, shape (rows, columns) or (rows, columns, 3).

    Samples with a maximum of 255 or 65535 are returned unchanged; other maxima (1023 for 10 bits) are scaled to
    the full range of uint8 or uint16, rounded.

    Raises:
        InputError: another format, a truncated file, or samples above the declared maximum.
    """
    data = path.read_bytes()
    match = _HEADER.match(data)
    if match is None:
        raise InputError("this is not a binary Netpbm picture (P5 or P6)")
    width, height, largest = (int(match[n]) for n in (2, 3, 4))
    channels = 3 if match[1] == b"6" else 1
    if not 0 < largest < 65536 or width * height == 0:
        raise InputError(f"this Netpbm picture states {width}×{height} pixels up to {largest}")
    kind = np.dtype(np.uint8) if largest < 256 else np.dtype(">u2")
    count = width * height * channels
    if len(data) - match.end() < count * kind.itemsize:
        raise InputError(
            f"this picture is truncated: {width}×{height} pixels are {count * kind.itemsize} bytes, and it has "
            f"{len(data) - match.end()}"
        )
    samples: NDArray[Any] = np.frombuffer(data, kind, count, match.end()).astype(kind.newbyteorder("="))
    full = 255 if largest < 256 else 65535
    if largest != full:
        if int(samples.max()) > largest:
            raise InputError(f"this picture holds {samples.max()}, and states that nothing is above {largest}")
        samples = np.rint(samples * np.float64(full / largest)).astype(samples.dtype)
    return samples.reshape((height, width, 3) if channels == 3 else (height, width))


def read_pfm(path: str | PathLike[str]) -> NDArray[np.float32]:
    """The numbers of a PFM file, (rows, columns) or (rows, columns, 3), first row at the top.

    Raises:
        InputError: no such file, another format, or a truncated file.
    """
    path = expanded(path)
    data = read_bytes(path)
    match = _HEADER_OF_FLOATS.match(data)
    scale = math.nan if match is None else number(match[4].decode("latin-1"))
    if match is None or not (math.isfinite(scale) and scale != 0):
        raise InputError(
            f'{path} is not a PFM file: it begins with {data[:12]!r} and not with "Pf", size and scale'
        )
    width, height, channels = int(match[2]), int(match[3]), 3 if match[1] == b"PF" else 1
    wanted, there = 4 * width * height * channels, len(data) - match.end()
    if wanted == 0 or there < wanted:
        raise InputError(
            f"{path} is truncated: {width}×{height} pixels of {channels} float32 are {wanted} bytes, and it has "
            f"{there}. Copy it again from where it came from"
        )
    values = np.frombuffer(data, "<f4" if scale < 0 else ">f4", width * height * channels, match.end())
    shape = (height, width, 3) if channels == 3 else (height, width)
    return np.ascontiguousarray(values.reshape(shape)[::-1], dtype=np.float32)
