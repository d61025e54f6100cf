"""NumPy files of one array, ``.npy``."""

from __future__ import annotations

from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import check_file, reading

_ZIP = b"PK\x03\x04"


def write_npy(values: NDArray[Any], stream: IO[bytes]) -> None:
    """Write an array like ``numpy.save``, whose error for a full disk gives only the number of elements written.

    Raises:
        OSError: the write fails.
    """
    values = np.asarray(values, order="C")
    np.lib.format.write_array_header_1_0(stream, np.lib.format.header_data_from_array_1_0(values))
    stream.write(values.reshape(-1).view(np.uint8).data)


def read_npy(path: Path, what: str = "file") -> NDArray[Any]:
    """Read the array of a ``.npy`` file into new memory that is no larger than the file.

    Args:
        path: the file.
        what: noun for messages.

    Raises:
        InputError: no such file, a truncated or damaged file, or one of Python objects, which are never loaded.
    """
    check_file(path, what)
    with reading(path, "a NumPy array"):
        with path.open("rb") as file:
            several = file.read(len(_ZIP)) == _ZIP
        if several:
            raise InputError(f"{path} is not one array of NumPy's but several, an .npz: rename it")
        # A memory map raises for a file that declares more than it holds before memory is allocated.
        try:
            return np.array(np.lib.format.open_memmap(path, mode="r"))
        except ValueError as error:
            if "pickle" not in str(error) and "Python objects" not in str(error):
                raise
            raise InputError(
                f"{path} cannot be read as a NumPy array: it is none, or of objects. Save numbers only"
            ) from error
