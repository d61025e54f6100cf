"""Sweeps on disk: a Zarr group that xarray opens, written image by image, and resumed after an interruption.

An image is on disk completely or not at all. Its entry in ``done`` and its numbers are written after it.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import check_path, expanded, in_words, read_bytes, read_json, reading, value_at
from vcc.base.version import VERSION
from vcc.files.atomic import atomic_folder, check_parent, refusal
from vcc.files.parts import check_name, clear_leftovers
from vcc.files.writer_lock import WriterLock
from vcc.store.attributes import check_version, difference, plain, same
from vcc.store.zarr_chunks import opened_array
from vcc.sweeps.metrics import KNOWN
from vcc.sweeps.result import PIXEL_AXES, Results, Sweep
from vcc.sweeps.stored import SWEEP, StoredPictures, small
from vcc.sweeps.values import Varied

KEY = "sweep"
"""The attribute of the group that contains all others."""
FORMAT_VERSION = 1
PICTURES, DONE, FRAME = "pictures", "done", "sensor_frame"
PLACES = ("y", "x")
"""Coordinates of rows and columns on the sensor, metres."""
NOTED_EVERY = 2.0
"""Seconds between updates of ``done``: the most work, besides images in progress, that a kill can undo."""
IN_WORDS = {
    "mean": "mean irradiance",
    "missing_rays": "share of the rays asked for that the light field lacks",
    "sampling_error": "root mean square error of sampling by rays, in units of the picture",
    DONE: "whether the picture is there",
    FRAME: "from (column, row, 1) to (x, y, 1) on the sensor, metres",
}
"""Descriptions of the arrays, for xarray."""


class InStore(Results):
    """Results of a sweep in a store. A second writer gets an error that names the process that holds the lock.

    Args:
        path: folder of the store; created, or an existing store of the same sweep, which is resumed.
        swept: the sweep, nothing of which is done.
        picture: the shape of all images; None if none are kept.
        description: everything that the images depend on (`vcc.sweeps.identity`).
        metrics: the requested metrics with their fingerprints (`vcc.sweeps.metrics.metrics_in_words`). Other
            metrics in the store are kept; the values of a different metric of the same name are discarded.

    Raises:
        InputError: the path is something else, or another sweep (the message names the difference); new
            metrics of images that were not kept; another process writes the store; the disk reports an error.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        swept: Sweep,
        picture: tuple[int, ...] | None,
        description: dict[str, Any] | None,
        metrics: dict[str, str | None],
    ) -> None:
        super().__init__(swept)
        self.path = Path(path).expanduser()
        check_name(self.path)
        check_parent(self.path)
        stated = None if description is None else plain({**description, "pictures": picture}, "description")
        there = os.path.lexists(self.path)
        if there:
            _check_same(self.path, stated)
        self._lock = WriterLock(self.path)
        try:
            clear_leftovers(self.path, self._lock.patience)
            if not there:
                _make(self.path, swept, picture, stated, metrics)
            for left in self.path.rglob("*.partial"):  # left by a killed run
                left.unlink(missing_ok=True)
            self._group = _opened(self.path)
            self._pictures: Any = None if picture is None else self._group[PICTURES]
            self._take_over(metrics)
        except BaseException:
            self._lock.give_back()
            raise
        self._noted = time.monotonic()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Record what is done, however the work ended, add it to the error message, and release the lock."""
        try:
            self._note()
        except InputError:
            if error is None:
                raise
        finally:
            self._lock.give_back()
        if isinstance(error, InputError):
            raise InputError(f"{error}. {self.kept}") from error.__cause__
        if isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(self.kept) from None

    @property
    def kept(self) -> str:
        """How many images the store has, as text."""
        done = self.swept.done
        return f"{done.sum()} of {done.size} pictures are kept in {self.path}: run the same sweep again to resume"

    def keep(self, place: tuple[int, ...], values: NDArray[np.float32]) -> None:
        """See `Results`.

        Raises:
            InputError: the disk reports an error; all earlier results are kept.
        """
        with self._disk(f"the picture of {self.swept.labels(place)}"):
            self._pictures[place] = values

    def commit(self) -> None:
        """Record what is done, unless that happened a moment ago."""
        if time.monotonic() - self._noted > NOTED_EVERY:
            self._note()

    def finished(self) -> Sweep:
        """See `Results`."""
        pictures = self._pictures
        if pictures is not None:
            pictures = StoredPictures(self.path / PICTURES, pictures, len(self.swept.shape))
        return replace(self.swept, pictures=pictures)

    def _take_over(self, metrics: dict[str, str | None]) -> None:
        """Load the results of the same sweep, and create arrays for metrics that are new or have changed."""
        there = _stated(self.path)["metrics"]
        self.swept.done[...] = small(self.path, DONE, self.swept.shape)
        wanted = {name: metric for name, metric in metrics.items() if there.get(name, "") != metric}
        if wanted and self._pictures is None and self.swept.done.any():
            raise InputError(
                f"{self.path} keeps no pictures, which {', '.join(wanted)} would need: leave that out, or choose "
                "another name for the sweep"
            )
        with self._disk("the numbers of pictures"):
            for name in wanted:
                if name in self._group:
                    self._group[name][...] = np.nan
                else:
                    _number(self._group, self.swept, name, self.swept.numbers[name])
            # Written last: after a kill before this point, the metrics still count as missing.
            self._group.attrs[KEY] = {**self._group.attrs[KEY], "metrics": {**there, **metrics}}
        shape = self.swept.shape
        numbers = {name: small(self.path, name, shape) for name in (*KNOWN, *there, *wanted)}
        self.swept = replace(self.swept, numbers=numbers)

    def _note(self) -> None:
        with self._disk("the numbers of pictures"):
            for name, values in self.swept.numbers.items():
                self._group[name][...] = values
            self._group[DONE][...] = self.swept.done  # last: it declares the rest complete
        self._noted = time.monotonic()

    @contextmanager
    def _disk(self, what: str) -> Iterator[None]:
        """Turn errors of the disk into `InputError`."""
        try:
            yield
        except OSError as error:
            raise InputError(f"{what} could not be written to {self.path}: {refusal(error, self.path)}") from error


def open_sweep(path: str | PathLike[str]) -> Sweep:
    """Open a sweep that was written to a store, finished or not; images are read on access.

    Args:
        path: folder of the store.

    Raises:
        InputError: no such folder, not a sweep, or a damaged one (the message names the file). A damaged
            image raises when it is read.
    """
    folder = expanded(path)
    with reading(folder, "a sweep"):
        stated = _stated(folder)
        axes, parameters = tuple(stated["axes"]), stated["parameters"]
        together = axes != tuple(each["name"] for each in parameters)
        sizes = [len(each["labels"]) for each in parameters]
        shape = tuple(sizes[:1] if together else sizes)
        if len(axes) != len(shape) or (together and len(set(sizes)) != 1):
            raise InputError(f"{folder / 'zarr.json'}: {len(parameters)} parameters do not fit the axes {axes}")
        coordinates = tuple(
            Varied(
                each["name"],
                tuple(small(folder, each["name"], (size,)).tolist()),
                tuple(each["labels"]),
                each["unit"],
            )
            for each, size in zip(parameters, sizes, strict=True)
        )
        frames = small(folder, FRAME, (3, 3), (*shape, 3, 3))
        if not np.isfinite(frames).all():
            raise InputError(f"{folder / FRAME} holds numbers that are not finite")
        return Sweep(
            axes,
            coordinates,
            {name: small(folder, name, shape) for name in (*KNOWN, *stated["metrics"])},
            _pictures_of(folder, shape) if (folder / PICTURES).is_dir() else None,
            frames,
            small(folder, DONE, shape),
        )


def _pictures_of(folder: Path, shape: tuple[int, ...]) -> StoredPictures:
    """The images of a sweep, one per chunk; the shape is checked."""
    array, n = opened_array(folder, PICTURES, SWEEP), len(shape)
    one = (*(1,) * n, *array.shape[n:])
    if tuple(array.shape[:n]) != shape or tuple(array.chunks) != one or len(one) - n not in (2, 3):
        raise InputError(
            f"{folder / PICTURES} has the shape {tuple(array.shape)} in chunks of {tuple(array.chunks)}, and the "
            f"sweep is one of {shape} pictures, a chunk for each"
        )
    return StoredPictures(folder / PICTURES, array, n)


def save_sweep(swept: Sweep, path: str | PathLike[str]) -> None:
    """Write a sweep from memory to a new store, which appears complete or not at all.

    Args:
        swept: the sweep.
        path: folder of the store.

    Raises:
        InputError: the path exists; the disk reports an error.
    """
    folder = Path(path).expanduser()
    check_name(folder)
    if os.path.lexists(folder):
        raise InputError(f"{folder} is there already: choose another name")
    picture = None if swept.pictures is None else swept.pictures.shape[len(swept.shape) :]
    clear_leftovers(folder)
    _make(
        folder, swept, picture, None, {name: None for name in swept.numbers if name not in KNOWN}, swept.pictures
    )


def _stated(folder: Path) -> dict[str, Any]:
    """The attributes of a store that describe the sweep.

    Raises:
        InputError: there are none, or their version is newer than this one supports.
    """
    check_path(folder, "sweep")
    if not (folder / "zarr.json").is_file():
        raise InputError(f"{folder} is no sweep: it {'is a file' if folder.is_file() else 'holds no zarr.json'}")
    stated = read_json(read_bytes(folder / "zarr.json"), f"{folder / 'zarr.json'}")
    found = value_at(stated, "attributes", KEY)
    if not isinstance(found, dict):
        raise InputError(f'{folder} is a Zarr group, and no sweep: its attributes have no "{KEY}"')
    check_version(folder, found.get("format_version"), FORMAT_VERSION)
    if not isinstance(found.get("metrics"), dict):
        raise InputError(f"{folder} cannot be used as a sweep: it does not state its metrics")
    return found


def _opened(folder: Path) -> Any:
    """The group, for writing."""
    import zarr

    try:
        return zarr.open_group(store=zarr.storage.LocalStore(folder), mode="r+", zarr_format=3)
    except Exception as error:
        raise InputError(f"{folder} cannot be used as a sweep: {in_words(error)}") from error


def _check_same(folder: Path, wanted: dict[str, Any] | None) -> None:
    """Raise `InputError` unless a folder contains the same sweep."""
    found = _stated(folder).get("description")
    if wanted is None or found is None:
        raise InputError(
            f"{folder} is there already, and a sweep with Python functions cannot be resumed, because functions "
            "cannot be compared: remove it, or choose another name"
        )
    if not same(wanted, found):
        raise InputError(
            f"{folder} is another sweep, and results of two sweeps are never mixed. {difference(found, wanted)}. "
            "Remove it, or choose another name"
        )


def _make(
    folder: Path,
    swept: Sweep,
    picture: tuple[int, ...] | None,
    description: dict[str, Any] | None,
    metrics: dict[str, str | None],
    values: Any = None,
) -> None:
    """Create the group and its arrays under a temporary name, and rename it when complete."""
    import zarr

    with atomic_folder(folder) as part:
        group = zarr.create_group(
            zarr.storage.LocalStore(part), attributes={KEY: _statement(swept, description, metrics)}
        )
        for each in swept.coordinates:
            axes = swept.axes if swept.in_one_batch else (each.name,)
            _array(group, each.name, each.coordinates, axes, {"units": each.unit} if each.unit else {})
        for name, numbers in swept.numbers.items():
            _number(group, swept, name, numbers)
        _number(group, swept, DONE, swept.done)
        _array(
            group,
            FRAME,
            swept.frames,
            (*(swept.axes if swept.frames.ndim > 2 else ()), "to", "from"),
            {"long_name": IN_WORDS[FRAME]},
        )
        if picture is not None:
            made = _make_pictures(group, swept, picture)
        if picture is not None and values is not None:
            for place in np.ndindex(*swept.shape):
                made[place] = values[place]


def _statement(swept: Sweep, description: dict[str, Any] | None, metrics: dict[str, str | None]) -> dict[str, Any]:
    return {
        "format_version": FORMAT_VERSION,
        "written_by": f"vcc {VERSION}",
        "axes": list(swept.axes),
        "parameters": [
            {"name": each.name, "unit": each.unit, "labels": list(each.labels)} for each in swept.coordinates
        ],
        "metrics": metrics,
        "description": description,
    }


def _remark(swept: Sweep) -> dict[str, str]:
    """The attribute with which xarray attaches several parameters to one axis."""
    return {"coordinates": " ".join(each.name for each in swept.coordinates)} if swept.in_one_batch else {}


def _number(group: Any, swept: Sweep, name: str, values: NDArray[Any]) -> None:
    """Create the array of one number per image."""
    words = {"long_name": IN_WORDS[name]} if name in IN_WORDS else {}
    _array(group, name, values, swept.axes, _remark(swept) | words)


def _array(group: Any, name: str, values: NDArray[Any], axes: tuple[str, ...], attributes: dict[str, Any]) -> None:
    """Create a small array with labelled axes, in one chunk."""
    kind = str if values.dtype.kind == "U" else values.dtype
    made = group.create_array(
        name,
        shape=values.shape,
        dtype=kind,
        chunks=values.shape,
        dimension_names=axes,
        attributes=attributes,
        fill_value=np.nan if values.dtype.kind == "f" else None,
    )
    made[...] = values


def _make_pictures(group: Any, swept: Sweep, picture: tuple[int, ...]) -> Any:
    """Create the array of images, one per chunk, and the positions of pixels if all sensors have the same."""
    from zarr.codecs import BloscCodec, Crc32cCodec

    remark = _remark(swept)
    if swept.frames.ndim == 2:
        for n, axis in enumerate(PIXEL_AXES[:2]):
            places = swept.frames[1 - n, 1 - n] * np.arange(picture[n]) + swept.frames[1 - n, 2]
            _array(group, PLACES[n], places, (axis,), {"units": "m"})
        remark = {"coordinates": " ".join([*remark.values(), *PLACES])}
    return group.create_array(
        PICTURES,
        shape=(*swept.shape, *picture),
        dtype="float32",
        chunks=(*(1,) * len(swept.shape), *picture),
        compressors=[BloscCodec(cname="zstd", clevel=3, shuffle="shuffle", typesize=4), Crc32cCodec()],
        fill_value=np.nan,
        dimension_names=(*swept.axes, *PIXEL_AXES[: len(picture)]),
        attributes={**remark, "long_name": "irradiance, as light lands on the sensor"},
    )
