"""Writing a light field video frame by frame; each frame appears complete or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, Self, get_args

import numpy as np
from numpy.typing import DTypeLike

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError, warn_of_result
from vcc.base.progress import Progress
from vcc.base.reading import expanded
from vcc.fields.grid import Sample
from vcc.fields.samples import Samples, check_is_light_field
from vcc.files.atomic import atomic_folder, atomic_path
from vcc.files.parts import check_name, clear_folder, clear_leftovers, part_of, settle, settle_names
from vcc.files.writer_lock import WriterLock
from vcc.store.attributes import Attributes, Transfer, plain, written_here
from vcc.store.compression import Compression, Pixels
from vcc.store.converting import as_kept
from vcc.store.held import drawn
from vcc.store.reading import restored
from vcc.store.video_layout import SHARED, UNFINISHED, VIDEO, Between, Common, Place, VideoAttributes
from vcc.store.video_reading import is_video, open_video
from vcc.store.writing import Framed, StoreWriter, create_store, in_one_piece, write_all


@dataclass(frozen=True, eq=False, repr=False)
class Packing(Brief):
    """Storage settings of a writer; see `create_video`."""

    transfer: Transfer = "linear"
    dtype: np.dtype[Any] | None = None
    channel_names: tuple[str, ...] | None = None
    chunks: Pixels | None = None
    compression: Compression | None = None


@dataclass
class VideoWriter:
    """Appends frames to a video; use in a ``with`` block or directly.

    A frame is written under a temporary name, flushed to the disk and renamed, so it is complete or absent
    however the writer stops, and earlier frames stay. Readers may open the video meanwhile. Only one writer can
    be active: until the ``with`` block or the process ends, writers in other processes raise `InputError`; a
    later writer in the same process replaces it. Created by `create_video`.
    """

    path: Path
    attributes: VideoAttributes
    packing: Packing
    _lock: WriterLock
    _times: list[float] = field(default_factory=list)
    _busy: bool = False

    @property
    def times(self) -> tuple[float, ...]:
        """Times of the existing frames in seconds; after a stop, continue after the last."""
        return tuple(self._times)

    def __len__(self) -> int:
        return len(self._times)

    def append(self, light_field: Samples, time: float, *, progress: Progress | None = None) -> None:
        """Write a frame; it is complete when this function returns.

        Args:
            light_field: a light field in memory, or in a store, which is read view by view.
            time: time of the frame in seconds, after all existing frames.
            progress: called with (done, total) in views.

        Raises:
            InputError: not a light field; a time that is not after the last; a grid that differs from earlier
                frames (the difference is named); as in `vcc.store.convert`; this writer has ended; the write
                fails. Earlier frames stay.
        """
        check_is_light_field(light_field)
        kept = as_kept(light_field, self.packing.transfer, self.packing.dtype)
        grid = kept.grid
        names = kept.channel_names or self.packing.channel_names
        shared = Attributes(grid.frame, kept.transfer, names, sample=grid.sample, wavelengths=grid.wavelengths)
        common = Common(grid.shape, grid.kind, shared)
        stated = {
            "disparity_range": grid.disparity_range,
            "provenance": kept.provenance,
            "filling": grid.filling,
        }
        maps = grid.disparities.maps() if grid.disparities.known else None
        with self._frame(common, time, stated) as writer:
            write_all(writer, kept.view, progress, maps)

    @contextmanager
    def frame(
        self,
        time: float,
        cameras_or_frame: Framed | Affine,
        shape: tuple[int, ...],
        dtype: DTypeLike,
        *,
        sample: Sample = "mean",
        disparity_range: tuple[float, float] | None = None,
        provenance: Mapping[str, Any] | None = None,
    ) -> Iterator[StoreWriter]:
        """Write a frame view by view, for frames larger than memory; it is complete at the end of the block.

        Views may be written in any order:

            with video.frame(0.04, cameras, (*cameras.shape, 3), "float16") as frame:
                for row, column in frame.missing():
                    frame.write_view(row, column, rendered(row, column))

        Args:
            time: see `append`.
            cameras_or_frame: see `create_store`, also for the following arguments.
            shape: see `create_store`.
            dtype: see `create_store`.
            sample: see `create_store`.
            disparity_range: see `create_store`.
            provenance: see `create_store`.

        Raises:
            InputError: as in `append`, or views are missing at the end of the block.
        """
        frame = cameras_or_frame if isinstance(cameras_or_frame, Affine) else cameras_or_frame.frame
        sizes = tuple(int(size) for size in shape)
        how = self.packing
        shared = Attributes(frame, how.transfer, how.channel_names, sample=sample)
        common = Common(sizes, np.dtype(dtype), shared)
        made = None if provenance is None else dict(provenance)
        with self._frame(common, time, {"disparity_range": disparity_range, "provenance": made}) as writer:
            yield writer

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Release the lock."""
        self._lock.give_back()

    @contextmanager
    def _frame(self, common: Common, time: float, stated: Mapping[str, Any]) -> Iterator[StoreWriter]:
        self._check_may_write()
        place = Place.of(len(self), self._following(time))
        self._check_fits(common, place)
        folder = self.path / UNFINISHED
        _made(folder)
        part = part_of(folder / place.name)
        begin = partial(
            create_store,
            part,
            common.attributes.frame,
            common.shape,
            common.kind,
            chunks=self.packing.chunks,
            compression=self.packing.compression,
            **{name: getattr(common.attributes, name) for name in SHARED[1:]},
            **stated,
        )
        put = partial(self._put, part, common, place)
        self._busy = True
        try:
            with in_one_piece(self.path / place.name, part, begin, put) as writer:
                yield writer
        finally:
            self._busy = False
            _removed_if_empty(folder)

    def _put(self, part: Path, common: Common, place: Place) -> None:
        """Rename a finished frame to its final name."""
        self._check_may_write(ending=True)
        try:
            settle(part)
            if self.attributes.common is None:
                self.attributes = replace(self.attributes, common=common)
                _write_attributes(self.path, self.attributes)
            part.rename(self.path / place.name)
            self._times.append(place.time)
            settle_names(self.path)
        except OSError as error:
            raise InputError(f"{part} could not be flushed to the disk: {error.strerror or error}") from error

    def _following(self, time: float) -> float:
        """Check that a time is after all existing frames.

        Raises:
            InputError: the time is not after the last, or not finite.
        """
        checked = checks.finite("the time of a frame", time, "seconds") + 0.0  # -0 is 0
        if self._times and not self._times[-1] < checked:
            raise InputError(
                f"times of frames ascend, and frame {len(self) - 1} of {self.path} is at {self._times[-1]!r} s: "
                f"{checked!r} s is not after it"
            )
        return checked

    def _check_fits(self, common: Common, place: Place) -> None:
        """Raise if a grid differs from that of the existing frames.

        Raises:
            InputError: the grid differs; the message names the difference.
        """
        difference = "" if self.attributes.common is None else common.difference(self.attributes.common)
        if difference:
            raise InputError(
                f"{place.words}, has another grid than the frames of {self.path}: {difference}. All frames of a "
                "video have one grid: write another video"
            )

    def _check_may_write(self, ending: bool = False) -> None:
        self._lock.check("create_video")
        if self._busy and not ending:
            raise InputError(
                f"a frame of {self.path} is being written: one follows the other, end its block first"
            )


def create_video(
    path: str | PathLike[str],
    *,
    between: Between | None = None,
    transfer: Transfer = "linear",
    dtype: DTypeLike | None = None,
    channel_names: tuple[str, ...] | None = None,
    provenance: dict[str, Any] | None = None,
    chunks: Pixels | None = None,
    compression: Compression | None = None,
) -> VideoWriter:
    """Create a video, or continue an existing one; returns a writer that appends frames.

    To continue after an interruption:

        with vcc.store.create_video("scene.zarr") as video:
            for n in range(len(video), 240):
                video.append(rendered(n / 24), n / 24)

    All frames have the grid of the first one: shape, type, frame, transfer, channel names.

    Args:
        path: folder of the video; created if missing or empty, else it must be a video.
        between: interpolation between frames, ``"linear"`` or ``"held"``, see `vcc.motion.LightFieldVideo`;
            None keeps that of an existing video and is ``"linear"`` for a new one.
        transfer: for light fields in memory: ``"srgb"`` if their integers are sRGB codes. Light fields on disk
            state their own.
        dtype: type of the stored samples, see `vcc.store.convert`; None keeps the samples bit for bit.
        channel_names: a name for each channel.
        provenance: origin of a new video, as JSON data.
        chunks: see `vcc.store.create_store`.
        compression: compression of the frames that this writer appends, see `vcc.store.create_store`.

    Warns:
        ResultWarning: an earlier writer was stopped during a frame, which is lost.

    Raises:
        InputError: the path is something else; an invalid argument; a video with another ``between``, or a
            damaged one; another process writes it (named); the write fails.
    """
    folder = expanded(path)
    if between is not None:
        checks.one_of("between", between, get_args(Between))
    checks.one_of("transfer", transfer, get_args(Transfer))
    plain(provenance or {}, "provenance")
    names = None if channel_names is None else tuple(channel_names)
    packing = Packing(transfer, None if dtype is None else np.dtype(dtype), names, chunks, compression)
    check_name(folder)
    restored(folder)
    there = folder.exists() and not (folder.is_dir() and not any(folder.iterdir()))
    if there and not is_video(folder):
        raise InputError(f"{folder} exists already, and is not a video of light fields: choose another name")
    lock = WriterLock(folder)
    try:
        clear_leftovers(folder, lock.patience)
        if not there:
            origin = written_here() if provenance is None else provenance
            made = VideoAttributes(between or "linear", None, origin, drawn())
            _begin(folder, made)
        video = open_video(folder)
        if between not in (None, video.between):
            raise InputError(
                f'{folder} states that it is "{video.between}" between frames, not "{between}": leave between out'
            )
        lost = clear_folder(folder / UNFINISHED, lock.patience)
        _removed_if_empty(folder / UNFINISHED)
        if lost:
            last = f"it goes on after {video.places[-1].words}" if video else "it has no frame yet"
            warn_of_result(f"{folder}: a writer was stopped in a frame, of which nothing is kept: {last}")
        attributes = video.attributes if video else replace(video.attributes, common=None)
        return VideoWriter(folder, attributes, packing, lock, list(video.times))
    except BaseException:
        lock.give_back()
        raise


def _begin(folder: Path, attributes: VideoAttributes) -> None:
    """Create the group under a temporary name and rename it."""
    with atomic_folder(folder) as part:
        part.mkdir()
        _write_attributes(part, attributes)
    try:
        settle_names(folder.parent)
    except OSError as error:
        raise InputError(f"{folder} could not be flushed to the disk: {error.strerror or error}") from error


def _removed_if_empty(folder: Path) -> None:
    with suppress(OSError):  # the folder does not exist or contains a frame
        folder.rmdir()


def _made(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder.parent} cannot be written to: {error.strerror or error}") from error


def _write_attributes(folder: Path, attributes: VideoAttributes) -> None:
    group = {"zarr_format": 3, "node_type": "group", "attributes": {VIDEO: attributes.as_json()}}
    with atomic_path(folder / "zarr.json") as temporary, temporary.open("w", encoding="utf-8") as stream:
        json.dump(group, stream, indent=2)
        stream.flush()
        os.fsync(stream.fileno())
