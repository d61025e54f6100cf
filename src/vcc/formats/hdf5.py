"""Opening HDF5 files, with clear error messages."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from vcc.base import checks
from vcc.base.errors import InputError

MAGIC = b"\x89HDF\r\n\x1a\n"

BEGINNINGS = (0, 512)
"""Possible offsets of the signature: MATLAB's files begin with a block of 512 bytes."""


def is_hdf5(path: Path) -> bool:
    """Whether a file has the HDF5 signature at its start or, like MATLAB's files, after a block of 512 bytes."""
    with path.open("rb") as file:
        start = file.read(520)
    return any(start[place : place + len(MAGIC)] == MAGIC for place in BEGINNINGS)


def library() -> Any:
    """Import h5py.

    Raises:
        InputError: h5py is not installed.
    """
    with checks.package("reading and writing HDF5 files (.mat, .h5)", "h5py", "hdf5"):
        import h5py

        return h5py


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Open an HDF5 file for reading.

    Raises:
        InputError: no such file, another format, a truncated or damaged file, or no h5py.
    """
    if not path.is_file():
        raise InputError(f"there is no file {path}")
    if not is_hdf5(path):
        text = f"{path} is not an HDF5 file: it does not begin with HDF5's signature. "
        if path.suffix.lower() == ".mat":
            text += "In MATLAB, save it again with save(…, '-v7.3')"
        else:
            text += "Copy it again from where it came from"
        raise InputError(text)
    h5py = library()
    try:
        with h5py.File(path, "r") as file:
            yield file
    except InputError:
        raise
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:  # what h5py raises for damaged files
        raise InputError(
            f"{path} cannot be read: it is truncated or damaged ({error}). Copy it again from where it came from"
        ) from error


def made_in_memory(fill: Callable[[Any], None], **options: Any) -> Any:
    """The bytes of a new HDF5 file behind its user block.

    Made in memory, because HDF5 and h5py do not report each error of the disk, and drop exceptions.

    Args:
        fill: writes into the open file.
        options: of ``h5py.File``.
    """
    with library().File("in memory", "w", driver="core", backing_store=False, **options) as file:
        fill(file)
        file.flush()
        return file.id.get_file_image()


def number(found: dict[str, Any], name: str, path: Path) -> float:
    """An attribute that is a single number, possibly in an array of one.

    Raises:
        InputError: the attribute is missing or not a finite number.
    """
    value = found.get(name)
    if value is None:
        raise InputError(f"{path} does not state the attribute {name}")
    try:
        only = float(np.asarray(value).reshape(-1)[0])
    except (ValueError, TypeError, IndexError):
        only = float("nan")
    if not np.isfinite(only) or np.asarray(value).size != 1:
        raise InputError(f"{path}: the attribute {name} is {str(value)[:100]!r}, not a finite number")
    return only
