"""Writing HDF5 files so that any error stops the work and is raised unchanged."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from vcc.base.workers import uninterrupted
from vcc.formats import hdf5

Put = Callable[..., Any]
"""``put(group, name, values, **how)`` writes and returns a data set; ``how`` is for h5py's ``create_dataset``."""


def write_file(path: Path, fill: Callable[[Any, Put], None], **options: Any) -> None:
    """Write an HDF5 file.

    The library passes each block to a Python function and discards exceptions raised there.

    Args:
        path: path of the file.
        fill: called with the file, an `h5py.File`, and a function that writes data sets; runs in a separate
            thread (`vcc.base.workers.uninterrupted`).
        options: options of `h5py.File`.

    Raises:
        OSError: the write fails. The file is then incomplete.
        BaseException: any other exception during writing; likewise.
    """
    state = _State()
    uninterrupted(_filled, path, state, fill, options, end=state.end)


@dataclass
class _State:
    """The first exception, if there was one."""

    error: BaseException | None = None

    def end(self, error: BaseException) -> None:
        """Record the exception and stop all further writing."""
        self.error = self.error or error

    def check(self) -> None:
        """Raise the recorded exception."""
        if self.error is not None:
            raise self.error

    def put(self, group: Any, name: str, values: NDArray[Any], **how: Any) -> Any:
        """Write a data set chunk by chunk, so that the work can stop in between; see `Put`."""
        made = group.create_dataset(name, values.shape, values.dtype, **how)
        for place in [...] if made.chunks is None else made.iter_chunks():
            self.check()
            made[place] = values[place]
        return made


def _filled(path: Path, state: _State, fill: Callable[[Any, Put], None], options: dict[str, Any]) -> None:
    with _Written(path, "w+b") as file:
        file.state = state
        try:
            with hdf5.library().File(file, "w", **options) as made:
                fill(made, state.put)
        finally:
            state.check()


class _Written(io.FileIO):
    """A file that records the first exception and then pretends to succeed.

    HDF5 cannot handle a full disk: it fails again for each object that it closes, with its own messages.
    """

    state: _State

    def write(self, data: Any, /) -> int:
        """Write all bytes, or record the exception."""
        rest = memoryview(data).cast("B")
        try:
            while rest and self.state.error is None:
                rest = rest[super().write(rest) :]
        except BaseException as error:  # the library would discard it
            self.state.end(error)
        return len(data)

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length, or record the exception."""
        try:
            return super().truncate(size)
        except BaseException as error:
            self.state.end(error)
            return size or 0
