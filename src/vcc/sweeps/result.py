"""The result of a sweep: images along labelled axes, and a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.camera import Camera
from vcc.image import Image
from vcc.sweeps.design import Cameras
from vcc.sweeps.table import Table
from vcc.sweeps.values import Varied, first_few_labels

PIXEL_AXES = ("row", "column", "channel")
"""Axes of an image, after those of the sweep."""


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Shown):
    """The images that cameras record of one light field.

    ``swept[3, 0]`` is the image of one camera, a `vcc.Image`; ``swept.pictures`` contains the values of all.

    Args:
        axes: names of the axes: parameters, or ``"camera"``.
        coordinates: the parameters and their values; one axis each, or all along ``"camera"``.
        numbers: the numbers of the images, by name, arrays of the sweep's shape; NaN for images that are not
            done.
        pictures: irradiance, (…, rows, columns[, channels]), in the orientation of the sensor; an array, or a
            `vcc.sweeps.stored.StoredPictures`, which reads parts on access. None if no images were kept.
        frames: maps from (column, row, 1) to (x, y, 1) on the sensor, metres: (3, 3), or (…, 3, 3) if they
            differ.
        done: which images are done, of the sweep's shape.
        cameras: the cameras, numbered; None if the sweep was opened from a file.
    """

    axes: tuple[str, ...]
    coordinates: tuple[Varied, ...]
    numbers: Mapping[str, NDArray[np.float64]]
    pictures: Any
    frames: NDArray[np.float64]
    done: NDArray[np.bool_]
    cameras: Cameras | None = None

    @classmethod
    def empty(cls, cameras: Cameras, names: Sequence[str]) -> Sweep:
        """A sweep of which nothing is done.

        Args:
            cameras: of the sweep.
            names: of the numbers of each image.
        """
        shape = cameras.shape
        numbers = {name: np.full(shape, np.nan) for name in names}
        done = np.zeros(shape, dtype=bool)
        return cls(cameras.axes, cameras.varied, numbers, None, cameras.frames(), done, cameras)

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of cameras along each axis."""
        return self.done.shape

    @property
    def in_one_batch(self) -> bool:
        """Whether all parameters change along one axis."""
        return self.axes != tuple(each.name for each in self.coordinates)

    @property
    def complete(self) -> bool:
        """Whether all images are done."""
        return bool(self.done.all())

    def __len__(self) -> int:
        """The number of cameras."""
        return self.done.size

    def __getitem__(self, index: int | tuple[int, ...]) -> Image:
        """The image of one camera: one index per axis.

        Raises:
            InputError: other indices, an image that is not done, or no images at all.
            IndexError: an index beyond the axis.
        """
        place = index if isinstance(index, tuple) else (index,)
        if len(place) != len(self.shape):
            raise InputError(
                f"this sweep has the axes {', '.join(self.axes)}: give {len(self.shape)} whole numbers for the "
                "picture of one camera; swept.pictures has them all"
            )
        if self.pictures is None:
            raise InputError("this sweep kept no pictures, only the table")
        if not self.done[place]:
            raise InputError(f"the picture at {place} is not done yet: resume the sweep")
        frame = self.frames if self.frames.ndim == 2 else self.frames[place]
        missing, error = (float(self.numbers[name][place]) for name in ("missing_rays", "sampling_error"))
        return Image(np.asarray(self.pictures[place]), Affine(frame), missing, error, camera=self._camera(place))

    def _camera(self, place: tuple[int, ...]) -> Camera | None:
        if self.cameras is None:
            return None
        within = tuple(n % size for n, size in zip(place, self.shape, strict=True))
        made: Camera = self.cameras[int(np.ravel_multi_index(within, self.shape))]
        return made

    @property
    @cached
    def table(self) -> Table:
        """One row per camera: its parameters, and the numbers of its image."""
        count, columns = len(self), {}
        for axis, each in enumerate(self.coordinates):
            places = np.indices(self.shape).reshape(len(self.shape), count)[0 if self.in_one_batch else axis]
            columns[each.name] = each.coordinates[places]
        columns |= {name: values.reshape(-1) for name, values in self.numbers.items()}
        return Table(columns, {each.name: each.unit for each in self.coordinates})

    def best(self, name: str, *, largest: bool = True) -> tuple[int, ...]:
        """The index in ``swept[…]`` at which a number of the table is largest, or smallest.

        Raises:
            InputError: the column does not exist, or has no finite number.
        """
        values = self.numbers.get(name)
        if values is None or not np.isfinite(values).any():
            raise InputError(f"there are no numbers {name!r}: there are {', '.join(self.numbers)}")
        found = np.nanargmax(values) if largest else np.nanargmin(values)
        return tuple(int(n) for n in np.unravel_index(found, self.shape))

    def values(self, index: Sequence[int]) -> list[str]:
        """The values of a camera's parameters as text."""
        places = [index[0]] * len(self.coordinates) if self.in_one_batch else index
        return [each.labels[n] for each, n in zip(self.coordinates, places, strict=True)]

    def labels(self, index: Sequence[int]) -> str:
        """The same with the parameters' names, in one line."""
        pairs = zip(self.coordinates, self.values(index), strict=True)
        return ", ".join(f"{each.name} {value}" for each, value in pairs)

    def __repr__(self) -> str:
        lines = [
            f"Sweep({'×'.join(map(str, self.shape))} {'camera' if len(self) == 1 else 'cameras'}{self._left})"
        ]
        lines += [f"  {each.name} {each.values_in_words}" for each in self.coordinates]
        if self.pictures is not None:
            lines.append(f"  pictures of {'×'.join(map(str, self.pictures.shape[len(self.shape) :]))}")
        return "\n".join([*lines, f"  numbers of each: {first_few_labels(tuple(self.numbers), 10)}"])

    @property
    def _left(self) -> str:
        left = int(np.count_nonzero(~self.done))
        return f", {left} to be done" if left else ""


class Results:
    """Receiver of the results of a running sweep; this base class keeps the numbers in memory, and no images.

    Args:
        swept: the sweep; its numbers are filled in.
    """

    def __init__(self, swept: Sweep) -> None:
        self.swept = swept

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        pass

    def left(self) -> list[int]:
        """The numbers of the cameras whose images are not done."""
        return [int(n) for n in np.flatnonzero(~self.swept.done)]

    def unreported(self, names: Iterable[str]) -> list[int]:
        """The numbers of the cameras whose images are done but lack some of these metrics."""
        lacking = np.zeros(self.swept.shape, dtype=bool)
        for name in names:
            lacking |= np.isnan(self.swept.numbers[name])
        return [int(n) for n in np.flatnonzero(lacking & self.swept.done)]

    def picture(self, number: int) -> Image:
        """An image that is done."""
        return self.finished()[self.place(number)]

    def put(self, number: int, values: NDArray[np.float32] | None, row: Mapping[str, float]) -> None:
        """Add an image, if images are kept, and its numbers."""
        if values is not None:
            self.keep(self.place(number), values)
        self.tell(number, row)
        self.swept.done[self.place(number)] = True

    def tell(self, number: int, row: Mapping[str, float]) -> None:
        """Add numbers of an image."""
        for name, value in row.items():
            self.swept.numbers[name][self.place(number)] = value

    def place(self, number: int) -> tuple[int, ...]:
        """The index of a camera along each axis."""
        return tuple(int(n) for n in np.unravel_index(number, self.swept.shape))

    def keep(self, place: tuple[int, ...], values: NDArray[np.float32]) -> None:
        """Keep an image."""

    def output_buffers(self, numbers: Sequence[int]) -> NDArray[np.float32] | None:
        """The contiguous memory in which to make the images of some cameras; None if there is none."""
        return None

    def commit(self) -> None:
        """Make sure that everything added so far is kept."""

    def finished(self) -> Sweep:
        """The sweep with its results."""
        return self.swept


class InMemory(Results):
    """Results in memory, including the images.

    Args:
        swept: the sweep; its numbers are filled in.
        picture: the shape of all images.
    """

    def __init__(self, swept: Sweep, picture: tuple[int, ...]) -> None:
        pictures = np.empty((*swept.shape, *picture), dtype=np.float32)
        super().__init__(replace(swept, pictures=pictures))

    def keep(self, place: tuple[int, ...], values: NDArray[np.float32]) -> None:
        """See `Results`."""
        if not np.may_share_memory(values, self.swept.pictures):  # otherwise it was made in place
            self.swept.pictures[place] = values

    def output_buffers(self, numbers: Sequence[int]) -> NDArray[np.float32] | None:
        """See `Results`."""
        pictures = self.swept.pictures
        first, count = numbers[0], len(numbers)
        if list(numbers) != list(range(first, first + count)):
            return None
        made: NDArray[np.float32] = pictures.reshape(-1, *pictures.shape[len(self.swept.shape) :])
        return made[first : first + count]
