"""Writing HDF5 files: what the disk refuses comes out as it is."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from vcc.formats import hdf5


@contextmanager
def new_file(path: Path, **options: Any) -> Iterator[Any]:
    """An HDF5 file to write to.

    Args:
        path: of the file.
        options: of `h5py.File`.

    Raises:
        OSError: the disk refuses. The file is then not whole.
    """
    with _Asked(path, "w+b") as file:
        try:
            with hdf5.library().File(file, "w", **options) as made:
                yield made
        finally:
            if file.refused is not None:
                raise file.refused


class _Asked(io.FileIO):
    """A file that keeps what the disk refused first, and goes on as if all were well.

    HDF5 cannot cope with a disk that is full: it fails again for each object that it closes, in words of its own.
    """

    refused: OSError | None = None

    def write(self, data: Any, /) -> int:
        """Write all of it."""
        rest = memoryview(data).cast("B")
        try:
            while rest and self.refused is None:
                rest = rest[super().write(rest) :]
        except OSError as error:
            self.refused = error
        if self.refused is not None:
            self.seek(len(rest), io.SEEK_CUR)
        return len(data)

    def truncate(self, size: int | None = None, /) -> int:
        """Make it so long."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.refused = self.refused or error
            return size or 0
