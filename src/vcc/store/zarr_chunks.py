"""Arrays of Zarr that others wrote: chunks are looked at before they are read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import MOST_UNPACKED, check_file, reading

HEADS = 2**12
"""Bytes by which a chunk that cannot be packed may exceed its samples, beside one in 128: heads and checksums."""


def chunk_file(folder: Path, array: Any, place: tuple[int, ...]) -> Path:
    """The file of a chunk, given by its place along the first axes; along the others there is one chunk."""
    rest = (0,) * (len(array.shape) - len(place))
    return folder / str(array.metadata.encode_chunk_key((*place, *rest)))


def read_array(folder: Path, array: Any, index: Any, places: Sequence[tuple[int, ...]], what: str) -> NDArray[Any]:
    """A part of a Zarr array, whose chunks are looked at before they are read.

    Args:
        folder: of the array.
        array: the Zarr array, with one chunk along all axes but the first ones.
        index: the part.
        places: of its chunks, along the first axes.
        what: it is, for messages.

    Raises:
        InputError: a chunk that is no regular file, larger than it can be, or damaged.
    """
    with reading(folder, what):
        kind = np.dtype(array.dtype)
        size = math.prod(array.chunks) * kind.itemsize
        most = size + size // 128 + HEADS if kind.kind in "bfiu" else MOST_UNPACKED
        for place in places:
            file = chunk_file(folder, array, place)
            if file.exists():
                check_file(file)
                check_size(file, most)
        return np.asarray(array[index])


def check_size(file: Path, most: int) -> None:
    """Refuse a file of more bytes than can be right.

    Raises:
        InputError: it has more.
    """
    size = file.stat().st_size
    if size > most:
        raise InputError(f"{file} has {size:,} bytes, and at most {most:,} can be right: it is damaged")
