"""The arrays of a sweep on disk, within the boundary to files of others: what is damaged is an `InputError`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import MOST_UNPACKED, check_file, reading
from vcc.store.zarr_chunks import check_size, chunk_file, read_array

SWEEP = "an array of a sweep"


@dataclass(frozen=True, eq=False)
class StoredPictures:
    """The pictures of a sweep on disk; a part is read when it is asked for, as of an array of NumPy.

    Args:
        folder: of the array.
        array: the Zarr array, a picture in each chunk.
        axes: how many of its axes are the sweep's; the others are a picture's.
    """

    folder: Path
    array: Any
    axes: int

    @property
    def shape(self) -> tuple[int, ...]:
        """(…, rows, columns[, channels])."""
        return tuple(self.array.shape)

    @property
    def ndim(self) -> int:
        """How many axes there are."""
        return len(self.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the pictures."""
        kind: np.dtype[Any] = np.dtype(self.array.dtype)
        return kind

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return (self[n] for n in range(len(self)))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self[...], dtype)

    def __getitem__(self, index: Any) -> NDArray[Any]:
        """Some of the pictures, read now; NaN where a picture is not there yet.

        Raises:
            InputError: a file that is missing for a picture asked for by itself, damaged, or no regular file of
                the size of a picture; no such part.
        """
        first = index[: self.axes] if isinstance(index, tuple) else (index,)
        if len(first) == self.axes and all(isinstance(n, int | np.integer) for n in first):
            sizes = self.shape[: self.axes]
            places = [tuple(int(n) % size for n, size in zip(first, sizes, strict=True))]
            file = chunk_file(self.folder, self.array, places[0])
            if not file.exists():
                raise InputError(f"the picture at {places[0]} is missing: there is no file {file}")
        else:
            places = list(np.ndindex(*self.shape[: self.axes]))
        return read_array(self.folder, self.array, index, places, SWEEP)


def member(folder: Path, group: Any, name: str) -> Any:
    """The Zarr array of that name, none of which is read yet.

    Raises:
        InputError: there is none, or its metadata cannot be used.
    """
    where = folder / name / "zarr.json"
    check_file(where)
    check_size(where, MOST_UNPACKED)
    with reading(where, SWEEP):
        return group[name]


def small(folder: Path, group: Any, name: str, *shapes: tuple[int, ...]) -> NDArray[Any]:
    """What a small array holds, which lies in one chunk.

    Args:
        folder: of the sweep.
        group: the Zarr group.
        name: of the array.
        shapes: those that it may have.

    Raises:
        InputError: as `member`; another shape; a file that is damaged or larger than the array can be.
    """
    array = member(folder, group, name)
    with reading(folder / name, SWEEP):
        if tuple(array.shape) not in shapes or tuple(array.chunks) != tuple(array.shape):
            raise InputError(
                f"{folder / name} has the shape {tuple(array.shape)} in chunks of {tuple(array.chunks)}, and the "
                f"sweep's parameters ask for {' or '.join(map(str, shapes))} in one chunk"
            )
    return read_array(folder / name, array, ..., [()], SWEEP)
