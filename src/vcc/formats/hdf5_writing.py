"""Writing HDF5 files: whatever goes wrong meanwhile ends the work, and comes out as it is."""

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
"""``put(group, name, values, **how)`` writes a data set, ``how`` of h5py's ``create_dataset``, and returns it."""


def write_file(path: Path, fill: Callable[[Any, Put], None], **options: Any) -> None:
    """Write an HDF5 file.

    The library hands each piece to a function of Python, and drops what that raises.

    Args:
        path: of the file.
        fill: called with the file, an `h5py.File`, and with what puts data sets into its groups; in a thread of
            its own (`vcc.base.workers.uninterrupted`).
        options: of `h5py.File`.

    Raises:
        OSError: the disk refuses. The file is then not whole.
        BaseException: anything that is raised meanwhile; likewise.
    """
    state = _State()
    uninterrupted(_filled, path, state, fill, options, end=state.end)


@dataclass
class _State:
    """What ended the work first, if anything did."""

    error: BaseException | None = None

    def end(self, error: BaseException) -> None:
        """Have nothing more written."""
        self.error = self.error or error

    def check(self) -> None:
        """Raise what ended the work."""
        if self.error is not None:
            raise self.error

    def put(self, group: Any, name: str, values: NDArray[Any], **how: Any) -> Any:
        """Write a data set chunk by chunk, so that the work can end in between; see `Put`."""
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
    """A file that keeps what went wrong first, and goes on as if all were well.

    HDF5 cannot cope with a disk that is full: it fails again for each object that it closes, in words of its own.
    """

    state: _State

    def write(self, data: Any, /) -> int:
        """Write all of it."""
        rest = memoryview(data).cast("B")
        try:
            while rest and self.state.error is None:
                rest = rest[super().write(rest) :]
        except BaseException as error:  # the library would drop it
            self.state.end(error)
        return len(data)

    def truncate(self, size: int | None = None, /) -> int:
        """Make it so long."""
        try:
            return super().truncate(size)
        except BaseException as error:
            self.state.end(error)
            return size or 0
