"""Writing HDF5 files: whatever goes wrong meanwhile ends the work, and comes out as it is."""

from __future__ import annotations

import io
from collections.abc import Callable
from concurrent.futures import wait
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from vcc.base.workers import Workers
from vcc.formats import hdf5

Put = Callable[..., Any]
"""``put(group, name, values, **how)`` writes a data set and returns it; ``how`` is of `h5py.Group.create_dataset`."""


def write_file(path: Path, fill: Callable[[Any, Put], None], **options: Any) -> None:
    """Write an HDF5 file.

    The library hands each piece to a function of Python, and drops what that raises. So it works in a thread of its
    own, where nothing interrupts: Ctrl-C and other signals are handled by this one, which waits.

    Args:
        path: of the file.
        fill: called with the file, an `h5py.File`, and with what puts data sets into its groups.
        options: of `h5py.File`.

    Raises:
        OSError: the disk refuses. The file is then not whole.
        BaseException: anything that is raised meanwhile; likewise.
    """
    with _Written(path, "w+b") as file, Workers(1) as worker:
        filled = worker.submit(_filled, file, fill, options)
        try:
            filled.result()
        except BaseException as error:
            file.end(error)
            wait([filled])
            raise


def _filled(file: _Written, fill: Callable[[Any, Put], None], options: dict[str, Any]) -> None:
    try:
        with hdf5.library().File(file, "w", **options) as made:
            fill(made, file.put)
    finally:
        file.check()


class _Written(io.FileIO):
    """A file that keeps what went wrong first, and goes on as if all were well.

    HDF5 cannot cope with a disk that is full: it fails again for each object that it closes, in words of its own.
    """

    ended: BaseException | None = None

    def end(self, error: BaseException) -> None:
        """Write nothing more."""
        self.ended = self.ended or error

    def check(self) -> None:
        """Raise what ended the work, if anything did."""
        if self.ended is not None:
            raise self.ended

    def put(self, group: Any, name: str, values: NDArray[Any], **how: Any) -> Any:
        """Write a data set chunk by chunk, so that the work can end in between; see `Put`."""
        made = group.create_dataset(name, values.shape, values.dtype, **how)
        for place in [...] if made.chunks is None else made.iter_chunks():
            self.check()
            made[place] = values[place]
        return made

    def write(self, data: Any, /) -> int:
        """Write all of it."""
        rest = memoryview(data).cast("B")
        try:
            while rest and self.ended is None:
                rest = rest[super().write(rest) :]
        except BaseException as error:  # the library would drop it
            self.end(error)
        return len(data)

    def truncate(self, size: int | None = None, /) -> int:
        """Make it so long."""
        try:
            return super().truncate(size)
        except BaseException as error:
            self.end(error)
            return size or 0
