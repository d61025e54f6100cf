"""A sweep: the pictures that many cameras record of one light field."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError, ResultWarning, warn_of_result
from vcc.base.memory import check_memory
from vcc.base.progress import Progress, tell
from vcc.camera import Camera, captured_together
from vcc.fields.samples import Samples, check_is_light_field
from vcc.image import Image
from vcc.plan.how import How, Options
from vcc.sweeps.design import Cameras, Design, cameras_of
from vcc.sweeps.metrics import KNOWN, Metric, metrics_of, row_of
from vcc.sweeps.result import Sweep

BATCH_BYTES = 2**28
"""Of the pictures that are made together, about; each of them takes some more while it is made."""
MOST_TOGETHER = 256
"""Pictures that are made together, at most: progress is told, and results are kept, after each batch."""
MANY_KINDS = 5
"""Kinds of remarks on pictures that are still passed on."""


def sweep(
    cameras: Camera | Sequence[Camera],
    light_field: Samples,
    parameters: Mapping[str, Any] | Design | None = None,
    how: How | None = None,
    *,
    metrics: Mapping[str, Metric] | Iterable[str | Metric] = (),
    pictures: bool = True,
    progress: Progress | None = None,
    **options: Unpack[Options],
) -> Sweep:
    """The pictures that many cameras record of one light field, and a table of what is told of them.

    Cameras that differ only in the pattern of one mask are made in one pass over the light field.

    Args:
        cameras: one whose parameters change, or several (an axis ``"camera"``).
        light_field: given at the entrance plane; in memory or on disk.
        parameters: names of parameters and their values, every combination of which is a camera: ``{"sensor.z":
            np.linspace(50, 54, 40) * mm, "code.pattern": [mura(31), Circle(8 * mm)]}``; or a `Design`, of
            `vcc.sweeps.listed`, `vcc.sweeps.random`, `vcc.sweeps.sobol`.
        how: as in `vcc.Camera.capture`.
        metrics: numbers for the table, beside ``mean``, ``missing_rays`` and ``sampling_error``: functions of the
            picture (a `vcc.Image`, whose ``camera`` made it) by name, or a list of them; ``"sharpness"``,
            `vcc.sweeps.PSNR`, `vcc.sweeps.DeblurringError`.
        pictures: whether pictures are kept; False keeps the table alone, and lets them differ in shape.
        progress: called with (done, total) in pictures.
        options: as in `vcc.Camera.capture`.

    Returns:
        Pictures along labelled axes, and the table.

    Warns:
        ResultWarning: what `vcc.Camera.capture` warns of, once for each kind, with the number of cameras.

    Raises:
        InputError: a parameter that there is not (those that there are are listed), values that a camera does not
            take (named), pictures of different shapes, more pictures than there is memory for, what a metric or
            `vcc.Camera.capture` refuses, with the camera's values.
    """
    check_is_light_field(light_field)
    listed = cameras_of(cameras, parameters)
    work = Work(listed, light_field, How.of(how, options), metrics_of(metrics))
    if pictures:
        work.check_memory()
    listed.check()
    kept = InMemory.of(listed, work.picture_shape() if pictures else None, tuple(work.metrics))
    work.run(kept, progress)
    return kept.swept(listed)


@dataclass(frozen=True, eq=False, repr=False)
class Work(Brief):
    """What a sweep has to do.

    Args:
        cameras: all of them.
        light_field: of which they make pictures.
        how: they do.
        metrics: told of each picture.
    """

    cameras: Cameras
    light_field: Samples
    how: How
    metrics: Mapping[str, Metric]

    def picture_shape(self) -> tuple[int, ...]:
        """The shape of all pictures.

        Raises:
            InputError: they have different ones.
        """
        shapes = {camera.sensor.shape: number for number, camera in enumerate(self.cameras)}
        if len(shapes) > 1:
            (one, first), (other, second) = list(shapes.items())[:2]
            raise InputError(
                f"pictures of a sweep have one shape, and there are {one} ({self.cameras.said(first)}) and "
                f"{other} ({self.cameras.said(second)}): keep sensor.shape, or pass pictures=False for the table "
                "alone"
            )
        return (*next(iter(shapes)), *self.light_field.grid.shape[4:])

    def check_memory(self) -> None:
        """Refuse more pictures than there is memory for.

        Raises:
            InputError: there are.
        """
        shape = (*self.cameras[0].sensor.shape, *self.light_field.grid.shape[4:])
        what = f"{len(self.cameras)} pictures of {'×'.join(map(str, shape))}"
        way_out = "keep only the table (pictures=False), or fewer cameras"
        check_memory(4 * len(self.cameras) * math.prod(shape), None, what, way_out)

    def batches(self, numbers: Iterable[int]) -> Iterator[list[int]]:
        """Cameras that are made together, in an order in which as many as can share their work."""
        wanted, batch, room = set(numbers), list[int](), BATCH_BYTES
        for number in filter(wanted.__contains__, self.cameras.alike()):
            batch.append(number)
            room -= 4 * math.prod(self.cameras[number].sensor.shape) * (self.light_field.grid.channels or 1)
            if room <= 0 or len(batch) == MOST_TOGETHER:
                yield batch
                batch, room = [], BATCH_BYTES
        if batch:
            yield batch

    def run(self, kept: Kept, progress: Progress | None) -> None:
        """Make the pictures that are not there yet."""
        todo = [number for number in range(len(self.cameras)) if not kept.has(number)]
        done, total = len(self.cameras) - len(todo), len(self.cameras)
        remarks = Remarks(total)
        for batch in self.batches(todo):
            for number, image, row in self.made(batch, remarks):
                kept.put(number, image, row)
            kept.commit()
            done += len(batch)
            tell(progress, done, total)
        remarks.say()

    def made(self, batch: Sequence[int], remarks: Remarks) -> Iterator[tuple[int, Image, dict[str, float]]]:
        """The pictures of some cameras, with what is told of them.

        Raises:
            InputError: what a camera or a metric refuses, with the camera's values.
        """
        with remarks.gathered():
            images = captured_together([self.cameras[number] for number in batch], self.light_field, self.how)
        for number, image in zip(batch, images, strict=True):
            with checks.within(self.cameras.said(number)):
                yield number, image, row_of(image, self.metrics)


class Remarks:
    """What is remarked on pictures, said once for each kind.

    Args:
        total: pictures of the whole.
    """

    def __init__(self, total: int) -> None:
        self._total, self._kinds, self._first = total, Counter[str](), dict[str, str]()

    def say(self) -> None:
        """Say what was remarked."""
        for kind, count in self._kinds.most_common(MANY_KINDS):
            of = f"{count} of {self._total} cameras, one of them: " if self._total > 1 else ""
            warn_of_result(f"{of}{self._first[kind]}")

    @contextmanager
    def gathered(self) -> Iterator[None]:
        """Take note of what is remarked within."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ResultWarning)
            yield
        for each in caught:
            said = str(each.message)
            if not issubclass(each.category, ResultWarning):
                warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
                continue
            kind = "".join(letter for letter in said if not letter.isdigit() and letter not in ".e-")
            self._kinds[kind] += 1
            self._first.setdefault(kind, said)


class Kept:
    """Where the results of a sweep go."""

    def has(self, number: int) -> bool:
        """Whether a picture is there."""
        raise NotImplementedError

    def put(self, number: int, image: Image, row: Mapping[str, float]) -> None:
        """Keep a picture, and what is told of it."""
        raise NotImplementedError

    def commit(self) -> None:
        """What was put is there from now on."""


@dataclass(frozen=True, eq=False, repr=False)
class InMemory(Kept, Brief):
    """Results in memory.

    Args:
        shape: of the sweep.
        pictures: values, one after the other; None where none are kept.
        numbers: by name, one after the other.
        frames: of the sensors, likewise.
    """

    shape: tuple[int, ...]
    pictures: NDArray[np.float32] | None
    numbers: dict[str, NDArray[np.float64]]
    frames: NDArray[np.float64]
    done: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))

    @classmethod
    def of(cls, cameras: Cameras, picture: tuple[int, ...] | None, names: tuple[str, ...]) -> InMemory:
        """Room for the results of all cameras."""
        count = len(cameras)
        values = None if picture is None else np.full((count, *picture), np.nan, dtype=np.float32)
        numbers = {name: np.full(count, np.nan) for name in (*KNOWN, *names)}
        return cls(cameras.shape, values, numbers, np.full((count, 3, 3), np.nan), np.zeros(count, dtype=bool))

    def has(self, number: int) -> bool:
        """See `Kept`."""
        return bool(self.done[number])

    def put(self, number: int, image: Image, row: Mapping[str, float]) -> None:
        """See `Kept`."""
        if self.pictures is not None:
            self.pictures[number] = image.to_numpy()
        for name, value in row.items():
            self.numbers[name][number] = value
        self.frames[number] = image.frame.matrix
        self.done[number] = True

    def swept(self, cameras: Cameras) -> Sweep:
        """What a sweep gives of it."""
        frames = self.frames
        one = np.array_equal(frames, np.broadcast_to(frames[0], frames.shape))
        return Sweep(
            cameras.axes,
            cameras.varied,
            {name: values.reshape(self.shape) for name, values in self.numbers.items()},
            None if self.pictures is None else self.pictures.reshape(*self.shape, *self.pictures.shape[1:]),
            frames[0] if one else frames.reshape(*self.shape, 3, 3),
            self.done.reshape(self.shape),
            cameras,
        )
