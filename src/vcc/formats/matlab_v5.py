"""MATLAB's .mat before version 7.3, with a limit on the decompressed size.

Structure: "MAT-File Format", The MathWorks, chapter 1: a header of 128 bytes, then elements with a type, a
    length and data; elements of type 15 are compressed with zlib.
"""

from __future__ import annotations

import io
import zlib
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from vcc.files.declared_sizes import LIGHT_FIELD

_HEADER = 128
_BYTE_ORDERS = {b"IM": "little", b"MI": "big"}
_PACKED = 15


def read_matlab(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of a file by name.

    Raises:
        Exception: of any type, if the file is damaged.
    """
    from scipy.io import loadmat

    arrays = loadmat(io.BytesIO(_unpacked(path.read_bytes())))
    return {name: each for name, each in arrays.items() if not name.startswith("__")}


def _unpacked(data: bytes) -> bytes:
    """The same file with all elements decompressed, so that nothing can exceed its size."""
    order: Any = _BYTE_ORDERS.get(data[126:128])
    if order is None:
        return data  # version 4, which has no compression; or another format, which the library reports
    parts, place, left = [data[:_HEADER]], _HEADER, LIGHT_FIELD
    while place + 8 <= len(data):
        kind, length = (int.from_bytes(data[at : at + 4], order) for at in (place, place + 4))
        body = data[place + 8 : place + 8 + length]
        if kind == _PACKED:
            stream = zlib.decompressobj()
            body = stream.decompress(body, max(1, left))
            if not stream.eof:
                raise ValueError(f"a variable of it is truncated, or unpacks to more than {left:,} bytes")
            parts.append(body)
        else:
            parts.append(data[place : place + 8 + length])
        left -= len(body)
        place += 8 + length
    return b"".join(parts)
