"""Writing a store view by view; each view appears complete or not at all, so work can resume after a stop."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import DTypeLike, NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.measures import decibels
from vcc.base.progress import Progress, tell
from vcc.base.words import first_few
from vcc.base.workers import uninterrupted
from vcc.fields.disparity import DisparityMaps
from vcc.fields.filling import Filling
from vcc.fields.grid import Grid, Sample
from vcc.fields.samples import Samples, check_is_light_field
from vcc.fields.view_arrays import one_view
from vcc.files.atomic import atomic_folder, refusal
from vcc.files.parts import check_name, clear_leftovers, part_of, put_in_place
from vcc.files.writer_lock import WriterLock, in_turn
from vcc.store.attributes import (
    ARRAY,
    AXES,
    DTYPES,
    KEY,
    SETTINGS,
    Attributes,
    Transfer,
    difference,
    plain,
    same,
    written_here,
)
from vcc.store.compression import Compression, Lossless, Lossy, Pixels, layout
from vcc.store.disparity_maps import keep_maps
from vcc.store.held import drawn
from vcc.store.reading import StoredLightField, is_store, open_store, read_metadata, restored


class Framed(Protocol):
    """An object that states the positions of views, such as `vcc.sources.CameraArray`."""

    @property
    def frame(self) -> Affine:
        """The affine map from indices to rays."""
        ...


@dataclass
class StoreWriter:
    """Writes the views of a store in any order; use in a ``with`` block or directly.

    A view is written under a temporary name and renamed, so after a kill it is complete or absent. Only one
    writer can be active: until the store is finished, or the ``with`` block or the process ends, writers in
    other processes raise `InputError`; a later writer in the same process replaces it. Created by
    `create_store`.
    """

    path: Path
    attributes: Attributes
    array: Any
    compression: Compression
    _lock: WriterLock
    _errors: dict[tuple[int, int], float] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, ...]:
        """(v, u, t, s) or (v, u, t, s, channels)."""
        return tuple(self.array.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the samples as stored."""
        kind: np.dtype[Any] = np.dtype(self.array.dtype)
        return kind

    def missing(self) -> list[tuple[int, int]]:
        """(row, column) of the views that are still missing, row by row."""
        return self._reader.missing()

    def write_view(self, row: int, column: int, samples: NDArray[Any]) -> None:
        """Write one view; it is complete when this function returns.

        Args:
            row: row of the view, 0 at the top.
            column: column of the view, 0 at the left.
            samples: shape (rows, columns[, channels]), of the store's type. Floating-point samples are rounded
                to the precision of a floating-point store.

        Raises:
            InputError: the store is finished; no such view; another shape or type; samples that are NaN,
                infinite, negative or too large; the write fails (full, no permission). Views written before
                stay.
        """
        nv, nu = self.shape[:2]
        if not (0 <= row < nv and 0 <= column < nu):
            raise InputError(f"there is no view ({row}, {column}) in a store of {nv}×{nu} views")
        if self.attributes.complete:
            raise InputError(f"{self.path} is finished: its views stay as they are")
        self._lock.check("create_store")
        view = self._fitting(np.asarray(samples), f"view ({row}, {column}) for {self.path}")
        try:
            uninterrupted(self.array.__setitem__, (row, column), view)
        except OSError as error:
            kept = nv * nu - len(self.missing())
            raise InputError(
                f"view ({row}, {column}) could not be written to {self.path}: {refusal(error, self.path)}. "
                f"{kept} of {nv * nu} views are kept"
            ) from error
        if isinstance(self.compression, Lossy):
            kept_as = self._reader.stored_view(row, column, 0, self.shape[2])
            difference = kept_as.astype(np.float64) - view
            self._errors[row, column] = float(np.mean(difference * difference))

    def write_disparity(self, maps: DisparityMaps) -> None:
        """Write disparity maps next to the samples, if there are none yet.

        Args:
            maps: the maps, with their source.

        Raises:
            InputError: the write fails.
        """
        try:
            keep_maps(self.path, maps)
        except OSError as error:
            reason = error.strerror or error
            raise InputError(f"the disparities could not be written to {self.path}: {reason}") from error

    def finish(self) -> StoredLightField:
        """Mark the store as complete and open it.

        Raises:
            InputError: views are missing (named), or the write fails.
        """
        if self.attributes.complete:
            self._lock.give_back()
            return open_store(self.path)
        missing = self.missing()
        if missing:
            raise InputError(
                f"{self.path} cannot be finished: {len(missing)} of {self.shape[0] * self.shape[1]} views are "
                f"missing, by (row, column): {first_few(missing, len(missing), 8)}"
            )
        self.attributes = self.attributes.finished(self._measured_loss())
        _write_attributes(self.path, self.attributes)
        self._lock.give_back()
        return open_store(self.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Release the lock. The store is not finished: an unfinished store can be continued."""
        self._lock.give_back()

    @property
    def _reader(self) -> StoredLightField:
        return StoredLightField(self.path, self.attributes, self.array)

    def _fitting(self, samples: NDArray[Any], what: str) -> NDArray[Any]:
        """Check shape and range of samples and convert them to the store's type."""
        if samples.shape != self.shape[2:]:
            raise InputError(f"{what} has the shape {samples.shape}, and the store's views have {self.shape[2:]}")
        if samples.dtype != self.dtype and not (samples.dtype.kind == "f" and self.dtype.kind == "f"):
            raise InputError(f"{what} is {samples.dtype}, and the store keeps {self.dtype}: convert it before")
        if self.dtype.kind != "f":
            return samples
        lowest, highest = samples.min(), samples.max()  # a NaN anywhere makes both NaN
        if not (lowest >= 0 and np.isfinite(highest)):
            raise InputError(f"{what} holds samples that are NaN, infinite or negative, so not valid radiance")
        if highest > np.finfo(self.dtype).max:
            raise InputError(
                f"{what} holds radiance of {highest:g}, and {self.dtype} ends at {np.finfo(self.dtype).max:g}: "
                'pass dtype="float32"'
            )
        return samples.astype(self.dtype, copy=False)

    def _measured_loss(self) -> dict[str, Any] | None:
        """Loss in the views that this writer wrote: PSNR in dB relative to full scale; None if lossless."""
        if not isinstance(self.compression, Lossy):
            return None
        stated: dict[str, Any] = {"codec": self.compression.codec, "quality": self.compression.quality}
        if self._errors:
            worst = max(self._errors, key=lambda view: self._errors[view])
            stated |= {
                "psnr": self._decibels(sum(self._errors.values()) / len(self._errors)),
                "worst_psnr": self._decibels(self._errors[worst]),
                "worst_view": list(worst),
                "measured_views": len(self._errors),
            }
        return stated

    def _decibels(self, mean_square: float) -> float:
        peak = float(np.iinfo(self.dtype).max)
        return math.inf if mean_square == 0 else decibels(mean_square, peak)


def create_store(
    path: str | PathLike[str],
    cameras_or_frame: Framed | Affine,
    shape: tuple[int, ...],
    dtype: DTypeLike,
    *,
    provenance: dict[str, Any],
    description: dict[str, Any] | None = None,
    transfer: Transfer = "linear",
    channel_names: tuple[str, ...] | None = None,
    disparity_range: tuple[float, float] | None = None,
    sample: Sample = "mean",
    wavelengths: tuple[float, ...] | None = None,
    filling: Filling | None = None,
    chunks: Pixels | None = None,
    compression: Compression | None = None,
) -> StoreWriter:
    """Create a store, or continue one of the same description; returns a writer of views.

    Args:
        path: folder of the store; created if missing or empty, else it must be a store of the same description.
        cameras_or_frame: positions of the views: a `vcc.sources.CameraArray`, or a frame (see `vcc.LightField`).
        shape: (v, u, t, s) or (v, u, t, s, channels).
        dtype: type of the stored samples: ``"uint8"``, ``"uint16"``, ``"float16"`` or ``"float32"``.
        provenance: origin of the light field, as JSON data.
        description: everything that the samples depend on, as JSON data. A store without one cannot be continued.
        transfer: ``"linear"``, or ``"srgb"`` for integers that are sRGB codes (read as linear float32).
        channel_names: a name for each channel.
        disparity_range: (lowest, highest), pixels per view along u, if known.
        sample: ``"mean"`` over a pixel or ``"point"``, see `vcc.LightField`.
        wavelengths: in the middle of each channel's band, metres, if known.
        filling: views that were not recorded, see `vcc.LightField`.
        chunks: rows of pixels per chunk, or (rows, columns): cameras and parts that need few pixels of each
            view read only the chunks that contain them. None uses rows of about 128 KiB.
        compression: `Lossless` or `Lossy`; None is ``Lossless()``.

    Returns:
        The writer. For a finished store, it reports no missing views.

    Raises:
        InputError: an invalid shape, type or attribute; a path that is something else; a store of another
            description (the difference is named); another process writes the store (named); the write fails.
    """
    folder = Path(path).expanduser()
    frame = cameras_or_frame if isinstance(cameras_or_frame, Affine) else cameras_or_frame.frame
    kind, packing = np.dtype(dtype), compression or Lossless()
    shape = tuple(int(n) for n in shape)
    _check(folder, shape, kind, transfer, packing)
    settings = {
        "frame": frame.matrix.tolist(),
        "shape": list(shape),
        "dtype": kind.name,
        "transfer": transfer,
        "channel_names": None if channel_names is None else list(channel_names),
        "disparity_range": None if disparity_range is None else list(disparity_range),
        "compression": packing.words,
        "chunks": list(chunks) if isinstance(chunks, tuple) else chunks,
        "sample": sample,
    }
    if wavelengths is not None:
        settings["wavelengths"] = list(wavelengths)
    made = None if description is None else {"maker": description, SETTINGS: settings}
    attributes = Attributes(
        frame,
        transfer,
        None if channel_names is None else tuple(channel_names),
        None if disparity_range is None else (float(disparity_range[0]), float(disparity_range[1])),
        provenance,
        None if made is None else plain(made, "description"),
        sample=sample,
        identity=drawn(),
        wavelengths=None if wavelengths is None else tuple(map(float, wavelengths)),
        filling=filling,
    )
    attributes.check(str(folder), shape[4] if len(shape) == 5 else None)
    attributes.as_json()  # raises for data that JSON cannot represent, before anything is created
    check_name(folder)
    restored(folder)
    there = folder.exists() and not (folder.is_dir() and not any(folder.iterdir()))
    if there:
        attributes = _continued(folder, attributes)
    lock = WriterLock(folder)
    try:
        clear_leftovers(folder, lock.patience)
        if not there:
            _make(folder, attributes, shape, kind, packing, chunks)
        for left in (folder / ARRAY).rglob("*.partial"):  # left by a killed writer
            left.unlink(missing_ok=True)
        array, _ = read_metadata(folder, "r+")
        return StoreWriter(folder, attributes, _writable(array), packing, lock)
    except BaseException:
        lock.give_back()
        raise


def save_store(
    light_field: Samples,
    path: str | PathLike[str],
    *,
    provenance: dict[str, Any] | None = None,
    transfer: Transfer = "linear",
    channel_names: tuple[str, ...] | None = None,
    chunks: Pixels | None = None,
    compression: Compression | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> StoredLightField:
    """Write a light field to a store, atomically.

    Args:
        light_field: uint8, uint16, float16 or float32 samples; a light field on disk is read view by view.
        path: folder of the store.
        provenance: origin of the light field, as JSON data.
        transfer: ``"srgb"`` if integer samples are sRGB codes instead of linear.
        channel_names: see `create_store`.
        chunks: see `create_store`.
        compression: see `create_store`.
        overwrite: replace an existing store; the old store stays until the new one is complete.
        progress: called with (done, total) in views.

    Raises:
        InputError: the path exists and is not a store or ``overwrite`` is False; or as in `create_store` and
            `StoreWriter.write_view`.
    """
    check_is_light_field(light_field)
    grid = light_field.grid
    return write_views(
        path,
        grid,
        partial(one_view, light_field),
        overwrite=overwrite,
        progress=progress,
        disparity=grid.disparities.maps() if grid.disparities.known else None,
        provenance=written_here() if provenance is None else provenance,
        transfer=transfer,
        channel_names=channel_names,
        chunks=chunks,
        compression=compression,
    )


def write_views(
    path: str | PathLike[str],
    grid: Grid,
    view: Callable[[int, int], NDArray[Any]],
    *,
    overwrite: bool,
    progress: Progress | None,
    disparity: DisparityMaps | None = None,
    **stated: Any,
) -> StoredLightField:
    """Write a whole store under a temporary name and rename it.

    Args:
        path: folder of the store.
        grid: the geometry, and the type of the stored samples.
        view: function that returns the samples of view (row, column).
        overwrite: see `save_store`.
        progress: see `save_store`.
        disparity: disparity maps to store, if known.
        stated: further arguments of `create_store`.

    Raises:
        InputError: as in `save_store`.
    """
    folder = Path(path).expanduser()
    check_name(folder)
    with in_turn(folder):
        restored(folder)
        if os.path.lexists(folder):
            _check_replaceable(folder, overwrite)
        lock = WriterLock(folder)
        try:
            clear_leftovers(folder, lock.patience)
            stated |= {
                "disparity_range": grid.disparity_range,
                "sample": grid.sample,
                "wavelengths": grid.wavelengths,
                "filling": grid.filling,
            }
            part = part_of(folder)
            begin = partial(create_store, part, grid.frame, grid.shape, grid.kind, **stated)
            with in_one_piece(folder, part, begin, partial(_put_in_place, part, folder, overwrite)) as writer:
                write_all(writer, view, progress, disparity)
        finally:
            lock.give_back()
        return open_store(folder)


@contextmanager
def in_one_piece(
    folder: Path, part: Path, begin: Callable[[], StoreWriter], put: Callable[[], None]
) -> Iterator[StoreWriter]:
    """Context for writing a store that appears at the end of the block, or not at all.

    Args:
        folder: folder of the store.
        part: temporary folder of the store.
        begin: creates the store in the temporary folder.
        put: renames the finished store.

    Raises:
        InputError: as raised within, with the final name of the store; the write fails; views are missing.
    """
    try:
        with begin() as writer:
            yield writer
            writer.finish()
        put()
    except InputError as error:
        if str(part) not in str(error):
            raise
        if not isinstance(error.__cause__, OSError):
            raise InputError(str(error).replace(str(part), str(folder))) from error.__cause__
        stays = "the store that was there stays" if folder.exists() else "nothing of it is kept"
        reason = refusal(error.__cause__, part)
        raise InputError(f"{folder} could not be written: {reason}. It is written as a whole: {stays}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def write_all(
    writer: StoreWriter,
    view: Callable[[int, int], NDArray[Any]],
    progress: Progress | None,
    disparity: DisparityMaps | None,
) -> None:
    """Write all views of a store, and disparity maps if known; see `write_views`."""
    total = writer.shape[0] * writer.shape[1]
    for done, (j, i) in enumerate(np.ndindex(*writer.shape[:2]), start=1):
        writer.write_view(j, i, view(j, i))
        tell(progress, done, total)
    if disparity is not None:
        writer.write_disparity(disparity)


def _check(folder: Path, shape: tuple[int, ...], kind: np.dtype[Any], transfer: str, packing: Compression) -> None:
    if len(shape) not in (4, 5) or min(shape) < 1:
        raise InputError(f"{folder}: a store has the shape (v, u, t, s[, channels]), each 1 or more, not {shape}")
    if kind.name not in DTYPES:
        raise InputError(f"{folder}: samples are stored as {', '.join(DTYPES)}, not {kind}: convert them before")
    if transfer == "srgb" and kind.kind != "u":
        raise InputError(f'{folder}: transfer="srgb" is for integer codes, and the samples are {kind}')
    if isinstance(packing, Lossy):
        packing.check(kind, shape[4] if len(shape) == 5 else None)


def _make(
    folder: Path,
    attributes: Attributes,
    shape: tuple[int, ...],
    kind: np.dtype[Any],
    packing: Compression,
    chunks: Pixels | None,
) -> None:
    """Create the group and its array under a temporary name and rename the folder."""
    import zarr

    cut = layout(shape, kind, packing, chunks)

    def make(part: Path) -> None:
        store = zarr.storage.LocalStore(part)
        group = zarr.create_group(store, attributes={KEY: attributes.as_json()})
        group.create_array(
            ARRAY,
            shape=shape,
            dtype=kind,
            fill_value=0,
            dimension_names=AXES[: len(shape)],
            **cut,
        )

    with atomic_folder(folder) as part:
        uninterrupted(make, part)


def _writable(array: Any) -> Any:
    """Configure the array to write all-zero chunks too: an absent chunk means a missing view."""
    return array.with_config({"write_empty_chunks": True})


def _continued(folder: Path, wanted: Attributes) -> Attributes:
    """The attributes of an existing store that is to be continued."""
    if not folder.is_dir() or not is_store(folder):
        raise InputError(f"{folder} exists already, and is not a store: choose another name")
    _, found = read_metadata(folder, "r+")
    if wanted.description is None or found.description is None:
        raise InputError(
            f"{folder} exists already{'' if found.complete else ', not finished'}, and cannot be continued "
            "without a description of what its views depend on: remove it, or choose another name"
        )
    found.description.get(SETTINGS, {}).setdefault("sample", "mean")  # for stores older than this setting
    if not same(wanted.description, found.description):
        raise InputError(
            f"{folder} was made from another description, and their views must not be mixed. "
            f"{difference(found.description, wanted.description)}. Remove it, or choose another name"
        )
    return found


def _write_attributes(folder: Path, attributes: Attributes) -> None:
    import zarr

    def write() -> None:
        group = zarr.open_group(store=zarr.storage.LocalStore(folder), mode="r+")
        group.attrs[KEY] = attributes.as_json()

    try:
        uninterrupted(write)
    except OSError as error:
        raise InputError(
            f"{folder} could not be finished: {error.strerror or error}. All views are kept"
        ) from error


def _check_replaceable(folder: Path, overwrite: bool) -> None:
    if not overwrite:
        raise InputError(f"{folder} exists already: choose another name, or pass overwrite=True")
    if folder.is_symlink() or not (folder.is_dir() and is_store(folder)):
        raise InputError(f"{folder} exists already and is not a store: it is not overwritten. Choose another name")


def _put_in_place(part: Path, folder: Path, overwrite: bool) -> None:
    """Rename a finished store to its final name; existing content is then removed."""
    try:
        put_in_place(part, folder, overwrite)
    except OSError as error:
        raise InputError(f"{folder} could not be written: {error.strerror or error}") from error
