"""PFM, the portable float map: one header in text, then float32, bottom row first."""

from __future__ import annotations

import math
import re
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import expanded, read_bytes

_HEADER = re.compile(rb"(P[fF])\s+(\d{1,18})\s+(\d{1,18})\s+(\S+)[ \t\r]*\n")


def read_pfm(path: str | PathLike[str]) -> NDArray[np.float32]:
    """The numbers of a PFM file, shape (rows, columns) or (rows, columns, 3), first row at the top.

    Raises:
        InputError: no such file, another format, or one that is truncated.
    """
    path = expanded(path)
    data = read_bytes(path)
    match = _HEADER.match(data)
    scale = math.nan
    if match is not None:
        try:
            scale = float(match[4])
        except ValueError:
            scale = math.nan
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
