"""The arrays of a sweep on disk; damaged files raise `InputError`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import reading
from vcc.store.zarr_chunks import chunk_file, opened_array, read_array

SWEEP = "an array of a sweep"


@dataclass(frozen=True, eq=False)
class StoredPictures:
    """The images of a sweep on disk, read on access and indexed like a NumPy array.

    Args:
        folder: of the array.
        array: the Zarr array, one image per chunk.
        axes: the number of its axes that belong to the sweep; the others belong to an image.
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
        """The number of axes."""
        return len(self.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the values."""
        kind: np.dtype[Any] = np.dtype(self.array.dtype)
        return kind

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return (self[n] for n in range(len(self)))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self[...], dtype)

    def __getitem__(self, index: Any) -> NDArray[Any]:
        """Part of the images, read now; NaN for images that are not done.

        Raises:
            InputError: the file of a single requested image is missing; a file is damaged, or is not a
                regular file of the size of an image; invalid index.
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


def small(folder: Path, name: str, *shapes: tuple[int, ...]) -> NDArray[Any]:
    """The values of a small array, which has one chunk.

    Args:
        folder: of the sweep.
        group: the Zarr group.
        name: of the array.
        shapes: the allowed ones.

    Raises:
        InputError: as `member`; another shape; a file that is damaged or too large for the array.
    """
    array = opened_array(folder, name, SWEEP)
    with reading(folder / name, SWEEP):
        if tuple(array.shape) not in shapes or tuple(array.chunks) != tuple(array.shape):
            raise InputError(
                f"{folder / name} has the shape {tuple(array.shape)} in chunks of {tuple(array.chunks)}, and the "
                f"sweep's parameters ask for {' or '.join(map(str, shapes))} in one chunk"
            )
    return read_array(folder / name, array, ..., [()], SWEEP)
