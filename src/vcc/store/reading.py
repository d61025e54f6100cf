"""Opening a store: metadata are read at once, samples on access."""

from __future__ import annotations

import math
import os
import platform
import warnings
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.errors import CacheWarning, InputError, ResultWarning
from vcc.base.progress import Progress, tell
from vcc.base.reading import (
    check_path,
    expanded,
    in_words,
    read_bytes,
    read_json,
    reading,
    shown,
    value_at,
)
from vcc.base.words import first_few
from vcc.fields.disparity import Disparities, DisparityMaps
from vcc.fields.grid import SAMPLES_IN_WORDS, Block, Grid, Sample, along_u
from vcc.fields.parallax import Axis, disparity_range
from vcc.fields.plane_sweep import disparity_maps
from vcc.fields.sampled import Index, as_slice
from vcc.fields.samples import OnGrid
from vcc.files.parts import put_back
from vcc.files.transfer import decode
from vcc.image import Image
from vcc.light_field import LightField
from vcc.store.attributes import ARRAY, DTYPES, KEY, Attributes, Transfer
from vcc.store.chunks import Chunked, Range, sharding
from vcc.store.compression import know_pictures
from vcc.store.disparity_maps import keep_maps, read_maps
from vcc.store.held import Held, attributes_of
from vcc.store.video_layout import VIDEO, places

MEASURED_BYTES = 2**26
"""Views for measuring disparities are cut to a band of rows if they exceed this number of bytes as stored."""
MEASURED_REACH = 3
"""Number of views on either side of the middle one for measuring disparities; see `vcc.fields.parallax`."""
MOST_VIEWS = 2**18
"""Maximum number of views of a store: each file is checked individually, and metadata may state any number."""


@dataclass(frozen=True, eq=False, repr=False)
class StoredLightField(OnGrid):
    """A light field on disk; parts are read on access.

    ``stored[2:4, :, 100:200]`` reads a part and returns a `vcc.LightField` at the same position. Cameras accept
    stored light fields; `vcc.Camera.capture` reads them in pieces within its ``memory_limit``.

    Args:
        path: folder of the store.
        attributes: the attributes of the store; see `vcc.store.attributes.Attributes`.
        array: the Zarr array of samples.
        held: checks that the store has not been replaced since it was opened; None inside its writer.
    """

    path: Path
    attributes: Attributes
    array: Any
    held: Held | None = None

    @property
    @cached
    def grid(self) -> Grid:
        """The light field without its samples, for planning cameras and parts."""
        return Grid(
            self.shape,
            self.frame,
            self.read_dtype,
            self.sample,
            self.disparity_range,
            Disparities(find=self._kept_or_found, measure=self._measured),
            wavelengths=self.wavelengths,
            filling=self.attributes.filling,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle path and attributes: the receiver opens the store itself."""
        stated = None if self.held is None else self.held.attributes
        return _opened_elsewhere, (self.path.absolute(), self.attributes, stated)

    @property
    def shape(self) -> tuple[int, ...]:
        """(v, u, t, s) or (v, u, t, s, channels)."""
        return tuple(self.array.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the samples as stored; see ``transfer``."""
        kind: np.dtype[Any] = np.dtype(self.array.dtype)
        return kind

    @property
    def read_dtype(self) -> np.dtype[Any]:
        """Type of the samples as read: linear, so sRGB codes become float32."""
        return np.dtype(np.float32) if self.transfer == "srgb" else self.dtype

    @property
    def frame(self) -> Affine:
        """See `vcc.LightField`."""
        return self.attributes.frame

    @property
    def transfer(self) -> Transfer:
        """Transfer function of the stored samples, ``"linear"`` or ``"srgb"``. Reading returns linear values."""
        return self.attributes.transfer

    @property
    def channel_names(self) -> tuple[str, ...] | None:
        """A name for each channel; None if not stated."""
        return self.attributes.channel_names

    @property
    def wavelengths(self) -> tuple[float, ...] | None:
        """In the middle of each channel's band, metres, if stated."""
        return self.attributes.wavelengths

    @property
    def disparity_range(self) -> tuple[float, float] | None:
        """(lowest, highest) in pixels per view along u; None if not stated."""
        return self.attributes.disparity_range

    @property
    def sample(self) -> Sample:
        """Meaning of a sample, ``"mean"`` or ``"point"``; see `vcc.LightField`."""
        return self.attributes.sample

    @property
    def disparity(self) -> Disparities:
        """Disparity maps of the pixels: read from the store, or computed on first access and saved there."""
        return self.grid.disparities

    @property
    def provenance(self) -> dict[str, Any]:
        """Origin of the light field."""
        return self.attributes.provenance

    @property
    def description(self) -> dict[str, Any] | None:
        """Everything that the samples depend on; None if not stated."""
        return self.attributes.description

    @property
    def lossy(self) -> dict[str, Any] | None:
        """Codec, quality and measured PSNR of lossy samples; None for lossless ones."""
        return self.attributes.lossy

    @property
    def complete(self) -> bool:
        """Whether the store was finished, with all views written."""
        return self.attributes.complete

    @property
    def view_bytes(self) -> int:
        """Bytes of one view in memory."""
        return math.prod(self.shape[2:]) * self.read_dtype.itemsize

    @property
    def stored_bytes(self) -> int:
        """Bytes of all views on disk."""
        files = (self.view_file(*view) for view in np.ndindex(*self.shape[:2]))
        return sum(file.stat().st_size for file in files if file.is_file())

    def whole(self) -> None:
        """Return None: no samples are in memory."""

    def read(self, block: Block | None = None, progress: Progress | None = None) -> Any:
        """Read everything as a `vcc.LightField` in memory; for a block, return the samples only.

        Args:
            block: the samples to read; None for all.
            progress: called with (done, total) in views.

        Raises:
            InputError: as for reading a part.
        """
        if block is None:
            return self._piece(Ellipsis, progress)
        return self._samples(tuple(range(*ends) for ends in block.ranges), progress)

    def __getitem__(self, index: Index | tuple[Index, ...]) -> LightField:
        """Read a part of the light field at its position: slices along (v, u, t, s[, channel]).

        Raises:
            InputError: no such part; a view that is missing, damaged, truncated or contains invalid radiance
                (named, with its file); or not enough memory.
        """
        return self._piece(index)

    def view(self, row: int, column: int) -> Image:
        """Return one view as an image; only its file is read. See `vcc.LightField.view`.

        Raises:
            InputError: there is no such view, or it cannot be read.
        """
        j, i = self.grid.place_of(row, column)
        return self[j : j + 1, i : i + 1].view(0, 0)

    def scaled(self, factor: float) -> StoredLightField:
        """The light field of the scene scaled in size, without reading samples. See `vcc.LightField.scaled`."""
        return replace(self, attributes=replace(self.attributes, frame=self.grid.scaled(factor).frame))

    def with_wavelengths(self, wavelengths: Sequence[float] | None) -> StoredLightField:
        """The same light field with the wavelengths of its channels; the store itself is unchanged.

        See `vcc.LightField.with_wavelengths`. To keep them, write a store: ``vcc.store.save_store(stored, path)``.
        """
        grid = replace(self.grid, wavelengths=wavelengths)  # type: ignore[arg-type]
        return replace(self, attributes=replace(self.attributes, wavelengths=grid.wavelengths))

    def missing(self) -> list[tuple[int, int]]:
        """(row, column) of the views that are missing."""
        folder, key = f"{self.path / ARRAY}{os.sep}", self.array.metadata.encode_chunk_key
        rest = (0,) * (len(self.shape) - 2)
        # Text: building a path for each of many views takes four times as long.
        return [at for at in np.ndindex(*self.shape[:2]) if not os.path.isfile(folder + key((*at, *rest)))]  # noqa: PTH113

    def check_complete(self) -> None:
        """Raise if views are missing, before a long computation.

        Raises:
            InputError: views are missing (named).
        """
        with self._through():
            missing = self.missing()
        if missing or not self.complete:
            raise InputError(f"{self.path} is not complete: {self._count_words(missing)}")

    def view_file(self, row: int, column: int) -> Path:
        """The file that holds a view."""
        place = (row, column) + (0,) * (len(self.shape) - 2)
        return self.path / ARRAY / str(self.array.metadata.encode_chunk_key(place))

    def linear_view(
        self, row: int, column: int, first: int, stop: int, columns: Range | None = None
    ) -> NDArray[Any]:
        """Read rows of pixels of one view, as stored; sRGB codes are converted to linear float32.

        Only the chunks that contain these pixels are read.

        Args:
            row: row of the view.
            column: column of the view.
            first: first row of pixels.
            stop: the row of pixels after the last.
            columns: first column of pixels and the column after the last; None for all.

        Returns:
            Shape (rows, columns[, channels]).

        Raises:
            InputError: the view is missing, its file is damaged or truncated, or contains invalid radiance; or
                the store was replaced since it was opened.
        """
        samples = self.stored_view(row, column, first, stop, columns)
        return decode(samples) if self.transfer == "srgb" else samples

    def stored_view(
        self, row: int, column: int, first: int, stop: int, columns: Range | None = None
    ) -> NDArray[Any]:
        """Like `linear_view`, but always as stored."""
        with self._through():
            return self._stored(row, column, (first, stop), columns)

    def _through(self) -> AbstractContextManager[None]:
        """Context that raises if the store was replaced since it was opened."""
        return nullcontext() if self.held is None else self.held.through()

    def _stored(self, row: int, column: int, rows: Range, columns: Range | None) -> NDArray[Any]:
        file = self.view_file(row, column)
        if not file.is_file():
            raise InputError(
                f"view ({row}, {column}) is missing in {self.path}: there is no file {file}. "
                + ("Copy or make the store again" if self.complete else self._count_words(self.missing()))
            )
        try:
            samples = self._unpacked(row, column, rows, columns or (0, self.shape[3]))
        except MemoryError as error:
            raise InputError(
                f"view ({row}, {column}) of {self.path} takes {self.view_bytes / 1e9:.1f} GB of memory, more than "
                "there is"
            ) from error
        except Exception as error:
            raise InputError(
                f"view ({row}, {column}) of {self.path} cannot be read: {file} is damaged or cut off "
                f"({shown(str(error), 200)}). Copy the file again; or delete it and make this view again"
            ) from error
        if samples.dtype.kind == "f" and not (samples.min() >= 0 and np.isfinite(samples.max())):
            raise InputError(
                f"view ({row}, {column}) of {self.path} holds samples that are NaN, infinite or negative, so "
                f"not valid radiance: {file}. Make this view again"
            )
        return samples

    @property
    @cached
    def _chunked(self) -> Chunked | None:
        """Layout of the view files in chunks."""
        return Chunked.of(self.array)

    def _unpacked(self, row: int, column: int, rows: Range, columns: Range) -> NDArray[Any]:
        """Pixels of a view; read by Zarr if the layout is not that of this package."""
        file = self.view_file(row, column)
        if self._chunked is not None and self._chunked.kind is not None:
            return self._chunked.read(file, rows, columns)
        if self._chunked is not None:
            self._chunked.index(file)
        return np.asarray(self.array[row, column, slice(*rows), slice(*columns)])

    def _count_words(self, missing: list[tuple[int, int]]) -> str:
        """Text for missing views."""
        total = self.shape[0] * self.shape[1]
        if not missing:
            return f"all {total} views exist, but the store was not finished: continue the program that wrote it"
        way_out = "Copy or make the store again" if self.complete else "Continue the program that wrote it"
        return (
            f"{len(missing)} of its {total} views are missing, by (row, column): "
            f"{first_few(missing, len(missing), 8)}. {way_out}; or take a part that is complete, stored[a:b, c:d]"
        )

    def _piece(self, index: Any, progress: Progress | None = None) -> LightField:
        grid, ranges = self.grid.piece(index)
        return LightField.of(self._samples(ranges, progress), grid)

    def _samples(self, ranges: tuple[range, ...], progress: Progress | None = None) -> NDArray[Any]:
        """Read the samples at these indices along each axis."""
        rows, columns, *pixels = ranges
        down, of_rows = _spanned(pixels[0])
        across, of_columns = _spanned(pixels[1])
        within = (of_rows, of_columns, *map(as_slice, pixels[2:]))
        channels = self.shape[4:] if len(pixels) == 2 else (len(pixels[2]),)
        shape = (len(rows), len(columns), len(pixels[0]), len(pixels[1]), *channels)
        try:
            values: NDArray[Any] = np.empty(shape, self.read_dtype)
        except MemoryError:
            size = math.prod(shape) * self.read_dtype.itemsize / 1e9
            raise InputError(
                f"this part of {self.path} takes {size:.1f} GB of memory, more than there is: read less at "
                "a time, or let camera.capture(stored, memory_limit=…) read it in pieces"
            ) from None
        total = len(rows) * len(columns)
        for done, (j, i) in enumerate(np.ndindex(len(rows), len(columns)), start=1):
            values[j, i] = self.linear_view(rows[j], columns[i], down[0], down[1], across)[within]
            tell(progress, done, total)
        return values

    def _kept_or_found(self, progress: Progress | None) -> DisparityMaps:
        with self._through():
            kept = read_maps(self.path, self.shape)
        if kept is not None:
            return kept
        found = disparity_maps(self, progress=progress)
        try:
            with self._through():  # check first, so that maps are not saved in another store
                pass
            keep_maps(self.path, found)
        except OSError as error:
            warnings.warn(
                f"the disparities found for {self.path} could not be saved there ({error.strerror or error}): "
                "they will be computed again the next time",
                CacheWarning,
                stacklevel=2,
            )
        return found

    def _measured(self) -> tuple[float, float] | None:
        nt = self.shape[2]
        shown: list[tuple[float, float] | None] = [None, None]
        axes: tuple[tuple[int, Axis], ...] = ((1, "u"), (0, "v"))
        for along, axis in axes:
            n = self.shape[along]
            if n == 1:
                continue
            middle = [slice(views // 2, views // 2 + 1) for views in self.shape[:2]]
            middle[along] = slice(max(n // 2 - MEASURED_REACH, 0), n // 2 + MEASURED_REACH + 1)
            views = min(n, 2 * MEASURED_REACH + 1)
            rows = min(nt, max(MEASURED_BYTES * nt // (views * self.view_bytes), 64))
            first = (nt - rows) // 2
            _, ranges = self.grid.piece((middle[0], middle[1], slice(first, first + rows)))
            values = self._samples(ranges)
            shown[1 - along] = disparity_range(values, axis)
        return along_u(self.frame, *shown)

    def __repr__(self) -> str:
        sizes = "×".join(map(str, self.shape))
        state = "" if self.complete else ", not complete"
        return (
            f"StoredLightField({self.path}: {sizes} {self.dtype}, {self.transfer}, "
            f"{SAMPLES_IN_WORDS[self.sample]}, "
            f"{self.grid.geometry}{state})"
        )


def _spanned(along: range) -> tuple[Range, slice]:
    """The first index and the one after the last, and the slice that picks the indices from that range."""
    first, stop = min(along[0], along[-1]), max(along[0], along[-1]) + 1
    return (first, stop), as_slice(range(along.start - first, along.stop - first, along.step))


def open_store(path: str | PathLike[str]) -> StoredLightField:
    """Open a light field on disk without reading its samples.

    Args:
        path: folder of the store.

    Raises:
        InputError: no such folder, not a Zarr v3 group, not a light field, a newer version, or attributes or an
            array that are invalid (named).
    """
    folder = expanded(path)
    restored(folder)
    with reading(folder, "a light field in a store"):
        held = Held.now(folder, "light field", _identity)
        array, attributes = read_metadata(folder)
        _check_array(folder, array, attributes)
        held.check()
        return StoredLightField(folder, attributes, array, held)


def _opened_elsewhere(path: Path, attributes: Attributes, stated: str | None) -> StoredLightField:
    """Open in this process a store that another process has open.

    Raises:
        InputError: the store is not accessible to this process, or has other content.
    """
    try:
        found = open_store(path)
    except InputError as error:
        raise InputError(
            f"the store is not found on {platform.node()}: {error}. All processes must use the same path"
        ) from error
    if stated is not None and (found.held is None or found.held.attributes != stated):
        raise InputError(
            f"on {platform.node()}, {path} holds another light field than the one that was opened: open it "
            "again, and make sure that all processes read the same files"
        )
    return replace(found, attributes=attributes)


def _identity(folder: Path) -> Any:
    """The attributes that identify a store; a continuing writer does not change them."""
    return attributes_of(folder, KEY, ARRAY, ("complete", "lossy"))


def _check_array(folder: Path, array: Any, attributes: Attributes) -> None:
    """Raise for an array that is not a light field, or whose views cannot be read individually."""
    shape, kind = tuple(array.shape), np.dtype(array.dtype)
    where = folder / ARRAY
    if len(shape) not in (4, 5) or 0 in shape:
        raise InputError(f"{where}: samples have the axes (v, u, t, s[, channel]), not the shape {shape}")
    if shape[0] * shape[1] > MOST_VIEWS:
        raise InputError(
            f"{where} states {shape[0]}×{shape[1]} views, a file for each: a store has at most {MOST_VIEWS:,}"
        )
    if kind.name not in DTYPES:
        raise InputError(f"{where}: samples are {', '.join(DTYPES)}, not {kind}")
    if attributes.transfer == "srgb" and kind.kind != "u":
        raise InputError(f'{folder}: transfer is "srgb", and the samples are {kind}: only integers are sRGB codes')
    attributes.check(str(folder), shape[4] if len(shape) == 5 else None)
    file = tuple(array.shards or array.chunks)
    if file[:2] != (1, 1) or any(part < size for part, size in zip(file[2:], shape[2:], strict=True)):
        raise InputError(
            f"{where}: each view is a file of its own (a shard of 1, 1 and the size of a view), not "
            f"shards of {file}"
        )
    if array.shards is not None:
        index = [codec.get("name") for codec in sharding(array).get("index_codecs", [])]
        if index != ["bytes", "crc32c"]:
            raise InputError(f"{where}: index_codecs of the shards are bytes and crc32c, not {index}")


def restored(folder: Path) -> None:
    """Restore a store whose writer died while replacing it, and warn.

    Raises:
        InputError: the store cannot be restored.
    """
    try:
        back = put_back(folder)
    except OSError as error:
        raise InputError(
            f"{folder} was being replaced when its writer was stopped, and the old store cannot be restored "
            f"({error.strerror or error}): rename {error.filename} to {folder.name}"
        ) from error
    if back:
        warnings.warn(
            f"{folder} was being replaced when its writer was stopped: the old store was restored",
            ResultWarning,
            stacklevel=3,
        )


def is_store(path: str | PathLike[str]) -> bool:
    """Whether a path is a Zarr group of version 3 or older, which `open_store` reads or reports on."""
    folder = expanded(path)
    restored(folder)
    return any((folder / name).is_file() for name in ("zarr.json", ".zgroup", ".zarray"))


def read_metadata(folder: Path, mode: str = "r") -> tuple[Any, Attributes]:
    """Open the Zarr array of samples and read the attributes.

    Raises:
        InputError: as in `open_store`.
    """
    check_path(folder, "store")
    if not is_store(folder):
        raise InputError(
            f"{folder} is not a light field in a Zarr store: {'it is a file' if folder.is_file() else 'it'} "
            f"{'' if folder.is_file() else 'holds no zarr.json'}"
        )
    if not (folder / "zarr.json").is_file():
        raise InputError(f"{folder} is Zarr version 2; a light field is kept in version 3. Convert it with zarr")
    stated = read_json(read_bytes(folder / "zarr.json"), f"{folder / 'zarr.json'}")
    if stated.get("zarr_format") != 3 or stated.get("node_type") != "group":
        raise InputError(
            f"{folder / 'zarr.json'}: zarr_format {stated.get('zarr_format')!r}, node_type "
            f"{stated.get('node_type')!r}; a light field is a group of version 3"
        )
    if value_at(stated, "attributes", VIDEO) is not None:
        raise InputError(f"{folder} is a video of light fields: {_choice(folder)}")
    attributes = Attributes.from_json(value_at(stated, "attributes", KEY), folder)
    where = folder / ARRAY / "zarr.json"
    if not where.is_file():
        raise InputError(f'{folder} has no array "{ARRAY}": {where} is missing')
    if attributes.lossy is not None or b"vcc.picture" in read_bytes(where):
        know_pictures()
    import zarr

    try:
        array = zarr.open_array(
            store=zarr.storage.LocalStore(folder, read_only=mode == "r"), path=ARRAY, mode=mode
        )
        if array.metadata.zarr_format != 3:
            raise ValueError(f"it has zarr_format {array.metadata.zarr_format}")
    except Exception as error:
        raise InputError(f"{where} cannot be used: {in_words(error)}") from error
    return array, attributes


def _choice(folder: Path) -> str:
    """Text on how to open one frame of a video."""
    frames = places(folder)
    if not frames:
        return "it has no frame yet"
    first, last = frames[0], frames[-1]
    return (
        f"take one of its frames, {folder / first.name} ({first.time:g} s) to {last.name} ({last.time:g} s); "
        "vcc.store.open_video opens all"
    )
