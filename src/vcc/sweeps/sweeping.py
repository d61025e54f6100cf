"""A sweep: the images that many cameras record of one light field."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from os import PathLike
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.memory import check_memory
from vcc.base.notices import Notices, worked_elsewhere
from vcc.base.progress import Progress, tell
from vcc.camera import Camera, each_captured
from vcc.fields.samples import Samples, check_is_light_field
from vcc.plan.how import How, Options
from vcc.plan.protocol import OutputBuffers
from vcc.run.executors import Work as Task
from vcc.run.executors import memory_of_task, worker_pool
from vcc.run.serialization import check_portable
from vcc.sweeps.design import Cameras, Design, cameras_of
from vcc.sweeps.identity import identity
from vcc.sweeps.keeping import InStore
from vcc.sweeps.metrics import KNOWN, Metric, metrics_in_words, metrics_of, numbers_of, row_of
from vcc.sweeps.result import InMemory, Results, Sweep

BATCH_BYTES = 2**29
"""Approximate limit on the bytes of images in one batch; each takes some more while it is made."""
SHARE_A_READING = 16
"""Least number of cameras in a batch if the light field is on disk, so that it is not read for each of them."""
MOST_TOGETHER = 1024
"""Largest number of images in a batch: progress is reported, and results are kept, after each batch."""
BATCH_SAMPLES = 10**10
"""Approximate limit on the samples processed for a batch: some seconds of work."""


def sweep(
    cameras: Camera | Sequence[Camera],
    light_field: Samples,
    parameters: Mapping[str, Any] | Design | None = None,
    how: How | None = None,
    *,
    metrics: Mapping[str, Metric] | Iterable[str | Metric] = (),
    pictures: bool = True,
    output: str | PathLike[str] | None = None,
    executor: Any = None,
    progress: Progress | None = None,
    **options: Unpack[Options],
) -> Sweep:
    """Capture the images of many cameras of one light field, with a table of numbers for each image.

    Cameras that differ only in the pattern of one mask share one pass over the light field.

    Args:
        cameras: one whose parameters change, or several (an axis ``"camera"``).
        light_field: given at the entrance plane; in memory or on disk.
        parameters: names of parameters and their values, every combination of which is a camera:
            ``{"sensor.z": np.linspace(50, 54, 40) * mm, "code.pattern": [mura(31), Circle(8 * mm)]}``; or a
            `Design` from `vcc.sweeps.listed`, `vcc.sweeps.random` or `vcc.sweeps.sobol`.
        how: as in `vcc.Camera.capture`.
        metrics: numbers for the table, in addition to ``mean``, ``missing_rays`` and ``sampling_error``:
            functions of the image (a `vcc.Image`, whose ``camera`` made it) by name, or a list of them;
            ``"sharpness"``, `vcc.sweeps.PSNR`, `vcc.sweeps.DeblurringError`.
        pictures: whether images are kept; False keeps only the table, and allows images of different shapes.
        output: a folder for the results, a Zarr group that xarray opens; each image is written when it is
            done. The same sweep resumes where it was stopped; new metrics are computed from the images in the
            store. None keeps the results in memory.
        executor: makes the images, some cameras per task, each with one thread unless ``threads`` is given:
            any `concurrent.futures.Executor`, or a ``dask.distributed.Client``; both stay open. The light
            field must then be in a store, or be a NumPy array of at most 64 MiB. None uses this process.
        progress: called with (done, total) in images.
        options: as in `vcc.Camera.capture`.

    Returns:
        Images along labelled axes, and the table.

    Warns:
        ResultWarning: the warnings of `vcc.Camera.capture`, once for each kind, with the number of cameras.

    Raises:
        InputError: unknown parameter (the message lists the available ones), values that a camera rejects
            (named), images of different shapes, too little memory for the images; errors of a metric or of
            `vcc.Camera.capture`, with the camera's values; an output that is something else or another sweep
            (the message names the difference), or an error of the disk: earlier results are kept.
    """
    check_is_light_field(light_field)
    listed = cameras_of(cameras, parameters)
    work = Work(listed, light_field, How.of(how, options), metrics_of(metrics), pictures)
    if pictures and output is None:
        work.check_memory()
    work.check_names()
    listed.check()
    with work.results(output) as results:
        work.run(results, executor, progress)
    return results.finished()


@dataclass(frozen=True, eq=False, repr=False)
class Work(Brief):
    """The work of a sweep.

    Args:
        cameras: all of them.
        light_field: before the cameras.
        how: how the images are made.
        metrics: of each image.
        pictures: whether images are kept.
    """

    cameras: Cameras
    light_field: Samples
    how: How
    metrics: Mapping[str, Metric]
    pictures: bool

    def check_names(self) -> None:
        """Check that no metric has the name of a parameter: both are columns of one table.

        Raises:
            InputError: one has.
        """
        for name in self.metrics:
            if name in (each.name for each in self.cameras.varied):
                raise InputError(f"two columns of a table cannot both be {name!r}: name the metric otherwise")

    def picture_shape(self) -> tuple[int, ...]:
        """The shape of all images.

        Raises:
            InputError: the shapes differ.
        """
        shapes = {sensor.shape: number for number, sensor in enumerate(self.cameras.sensors)}
        if len(shapes) > 1:
            (one, first), (other, second) = list(shapes.items())[:2]
            raise InputError(
                f"pictures of a sweep have one shape, and there are {one} ({self.cameras.said(first)}) and "
                f"{other} ({self.cameras.said(second)}): keep sensor.shape, or pass pictures=False for the table "
                "alone"
            )
        return (*next(iter(shapes)), *self.light_field.grid.shape[4:])

    def check_memory(self) -> None:
        """Check that the images fit in memory.

        Raises:
            InputError: they do not.
        """
        shape = (*self.cameras[0].sensor.shape, *self.light_field.grid.shape[4:])
        what = f"{len(self.cameras)} pictures of {'×'.join(map(str, shape))}"
        way_out = "keep only the table (pictures=False), or fewer cameras"
        check_memory(4 * len(self.cameras) * math.prod(shape), None, what, way_out)

    def batches(self, todo: Sequence[int], places: int = 0) -> Iterator[list[int]]:
        """Batches of cameras, ordered so that as many as possible share their work.

        A batch is complete even if only some of its images are missing: the composition of a batch can change
        rounding, and a resumed sweep must equal an uninterrupted one.

        Args:
            todo: the numbers of the cameras whose images are missing.
            places: the number of batches that run in parallel; 0 for one after the other.
        """
        wanted, ordered = set(todo), self.cameras.alike()
        count = self.batch_size() if wanted else 1
        if places:
            count = min(count, max(len(ordered) // (4 * places), 1))
        for first in range(0, len(ordered), count):
            batch = ordered[first : first + count]
            if not wanted.isdisjoint(batch):
                yield batch

    def batch_size(self) -> int:
        """The number of cameras in a batch: limited by memory, and to a few seconds of work."""
        camera, channels = self.cameras[0], self.light_field.grid.channels or 1
        if camera.depends_on_bands:  # each camera has several plans, and shares no work with others
            return 1
        pixels = math.prod(camera.sensor.shape) * channels
        how = replace(self.how, diffraction=bool(self.how.diffraction))  # a plan has one kernel
        samples = camera.compile(self.light_field, how).samples_touched * channels
        least = 1 if self.light_field.whole() is not None else SHARE_A_READING
        within_time = max(BATCH_SAMPLES // max(samples, 1), least)
        return int(max(1, min(MOST_TOGETHER, BATCH_BYTES // (4 * pixels), within_time)))

    def results(self, output: str | PathLike[str] | None) -> Results:
        """The receiver of the results, with existing results of the same sweep.

        Raises:
            InputError: images of different shapes; see also `vcc.sweeps.keeping.InStore`.
        """
        swept = Sweep.empty(self.cameras, (*KNOWN, *self.metrics))
        picture = self.picture_shape() if self.pictures else None
        if output is not None:
            known = identity(self.cameras, self.light_field, self.how)
            return InStore(output, swept, picture, known, metrics_in_words(self.metrics))
        return Results(swept) if picture is None else InMemory(swept, picture)

    def run(self, results: Results, executor: Any, progress: Progress | None) -> None:
        """Make the missing images, and compute missing metrics of existing images."""
        todo, untold, remarks = results.left(), results.unreported(self.metrics), Notices()
        done, total = len(self.cameras) - len(todo) - len(untold), len(self.cameras)
        made = (
            self.made_here(todo, results, remarks) if executor is None else self.made_by(executor, todo, remarks)
        )
        for count in chain(self.reported(results, untold), self.put(results, set(todo), made)):
            results.commit()
            done += count
            tell(progress, done, total)
        remarks.say(total, "cameras")

    def reported(self, results: Results, untold: Sequence[int]) -> Iterator[int]:
        """Compute and add metrics of existing images; yield the number of images each time."""
        for number in untold:
            with checks.within(self.cameras.said(number)):
                results.tell(number, numbers_of(results.picture(number), self.metrics))
            yield 1

    def put(self, results: Results, todo: set[int], made: Iterable[Rows]) -> Iterator[int]:
        """Add new images; yield the number of images each time."""
        for rows in made:
            lacking = [row for row in rows if row[0] in todo]
            for number, values, numbers in lacking:
                results.put(number, values, numbers)
            yield len(lacking)

    def made_here(self, todo: Sequence[int], results: Results, remarks: Notices) -> Iterator[Rows]:
        """The images of cameras, made in this process."""
        for batch in self.batches(todo):
            with remarks.gathered():
                for row in rows_of(self, batch, results.output_buffers):
                    yield [row]

    def made_by(self, executor: Any, todo: Sequence[int], remarks: Notices) -> Iterator[Rows]:
        """The same by an executor, in order of completion.

        Raises:
            InputError: a light field in memory that is too large to be sent; see also `vcc.run.executors`.
        """
        check_portable(self.light_field)
        workers = worker_pool(executor)
        if self.how.between_views == "depth":
            self.light_field.grid.disparities.maps()  # computed once, and sent
        batches = list(self.batches(todo, workers.places))
        limit = math.ceil(memory_of_task(self.how.memory_limit, workers))
        alone = replace(self, how=replace(self.how, threads=self.how.threads or 1, memory_limit=limit))
        with remarks.gathered():  # from threads of this process
            for _, (rows, elsewhere) in workers.each(Task(rows_elsewhere, (alone, os.getpid())), batches):
                remarks.add(elsewhere)
                yield rows


Row = tuple[int, NDArray[np.float32] | None, dict[str, float]]
"""The number of a camera, its image if images are kept, and the numbers of the image."""
Rows = list[Row]


def rows_of(
    work: Work, batch: Sequence[int], output_buffers: OutputBuffers = lambda numbers: None
) -> Iterator[Row]:
    """The images of some cameras with their numbers, in order of completion.

    Args:
        work: of the sweep.
        batch: the numbers of these cameras.
        output_buffers: for the images.

    Raises:
        InputError: errors of a camera or a metric, with the camera's values.
    """

    def buffers_of(places: Sequence[int]) -> NDArray[np.float32] | None:
        return output_buffers([batch[place] for place in places])

    cameras = [work.cameras[number] for number in batch]
    for place, image in each_captured(cameras, work.light_field, work.how, output_buffers=buffers_of):
        with checks.within(work.cameras.said(batch[place])):
            row = batch[place], image.to_numpy() if work.pictures else None, row_of(image, work.metrics)
        yield row


def rows_elsewhere(shared: tuple[Work, int], batch: Sequence[int]) -> tuple[Rows, Notices]:
    """The same as a task; also returns the warnings, unless it runs in the requesting process."""
    work, asking = shared
    return worked_elsewhere(lambda: list(rows_of(work, batch)), asking)
