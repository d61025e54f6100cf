"""Reading Zarr arrays of unknown origin: the size of each chunk file is checked first."""

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
"""Overhead in bytes of an incompressible chunk (headers, checksums), in addition to 1/128 of its samples."""


def opened_array(folder: Path, name: str, what: str, mode: Any = "r") -> Any:
    """Open the Zarr array of that name in a group; its values are not read yet.

    Raises:
        InputError: the metadata are missing, too large or damaged.
    """
    import zarr

    where = folder / name / "zarr.json"
    check_file(where, what)
    check_size(where, MOST_UNPACKED)
    with reading(where, what):
        store = zarr.storage.LocalStore(folder, read_only=mode == "r")
        return zarr.open_array(store=store, path=name, mode=mode, zarr_format=3)


def chunk_file(folder: Path, array: Any, place: tuple[int, ...]) -> Path:
    """The file of a chunk, given by its index along the first axes; the other axes have one chunk."""
    rest = (0,) * (len(array.shape) - len(place))
    return folder / str(array.metadata.encode_chunk_key((*place, *rest)))


def read_array(folder: Path, array: Any, index: Any, places: Sequence[tuple[int, ...]], what: str) -> NDArray[Any]:
    """Read a part of a Zarr array after checking its chunk files.

    Args:
        folder: folder of the array.
        array: the Zarr array, with a single chunk along all axes except the first ones.
        index: index of the part.
        places: indices of its chunks along the first axes.
        what: noun for messages.

    Raises:
        InputError: a chunk is not a regular file, is too large, or is damaged.
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
    """Raise if a file exceeds the maximum size.

    Raises:
        InputError: the file is larger.
    """
    size = file.stat().st_size
    if size > most:
        raise InputError(f"{file} has {size:,} bytes, and at most {most:,} can be right: it is damaged")
