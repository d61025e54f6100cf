"""Reading the pictures of a grid of views into one array."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Collection
from concurrent.futures import Future, as_completed, wait
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.files.declared_sizes import LIGHT_FIELD, check_declared_size
from vcc.files.pictures import read_picture, read_png_into
from vcc.files.transfer import decode
from vcc.formats.views_with_metadata import ViewsWithMetadata

_THREADS = 2  # decoding releases the interpreter's lock


def read_views(
    files: dict[tuple[int, int], Path],
    picture: tuple[int, ...],
    stored: type[np.generic],
    *,
    linear: bool,
    stated: ViewsWithMetadata | None = None,
    progress: Progress | None = None,
    first: Collection[tuple[int, int]] = (),
    meanwhile: Callable[[NDArray[Any]], None] | None = None,
) -> NDArray[Any]:
    """Read all pictures into one array, shape (n, t, s[, channel]), in the order of ``files``.

    Args:
        files: files by (row, column).
        picture: shape that all pictures must have.
        stored: type that all pictures must have.
        linear: keep the stored type; else decode from sRGB to float32.
        stated: metadata of the pictures, if they differ from the default. If pictures were exposed or rotated,
            the result is float32.
        progress: called as progress(done, total) after each picture.
        first: places of the views to read first.
        meanwhile: called with the array when these views have been read, in parallel with further reading; for
            slow work that needs only these views. Not called if one of them cannot be read.

    Raises:
        InputError: pictures that differ in size or type, a damaged picture, a declared size too large for the
            files, or not enough memory.
    """
    undone = stated is not None and not stated.is_neutral
    as_stored = linear and not undone
    kind = stored if as_stored else np.float32
    shape = (len(files), *picture)
    stored_bytes = sum(file.stat().st_size for file in set(files.values()) if file.is_file())
    folder = next(iter(files.values())).parent
    check_declared_size(math.prod(shape) * np.dtype(stored).itemsize, stored_bytes, str(folder), LIGHT_FIELD)
    try:
        values: NDArray[Any] = np.empty(shape, kind)
    except MemoryError:
        size = math.prod(shape) * np.dtype(kind).itemsize / 1e9
        raise InputError(
            f"{len(files)} views of shape {picture} need {size:.1f} GB of memory as {np.dtype(kind)}, more than "
            'there is. transfer="linear" keeps the stored type, or leave views out'
        ) from None
    listed = list(files.values())
    own = threading.local()

    def read(number: int) -> None:
        file = listed[number]
        if not as_stored and not hasattr(own, "scratch"):
            own.scratch = np.empty(picture, stored)
        into = values[number] if as_stored else own.scratch
        if not read_png_into(file, into):
            samples, _ = read_picture(file)
            if samples.shape != picture or samples.dtype != stored:
                raise InputError(
                    f"{file.name} and {listed[0].name} in {file.parent} are not alike: "
                    f"{_describe(samples.shape, samples.dtype)} and "
                    f"{_describe(picture, np.dtype(stored))}. "
                    "All views have the same size and type"
                )
            into[...] = samples
        if stated is not None and undone:
            values[number] = stated.light(file, into)
        elif stated is not None:
            stated.picture(file, into)
        elif not linear:
            decode(into, values[number])

    def when_read(awaited: list[Future[None]]) -> None:
        wait(awaited)  # these tasks were submitted earlier, so this cannot deadlock
        if meanwhile is not None and all(not task.cancelled() and task.exception() is None for task in awaited):
            meanwhile(values)

    early = [number for number, place in enumerate(files) if place in first]
    late = [number for number, place in enumerate(files) if place not in first]
    with Workers(_THREADS) as pool:
        tasks = [pool.submit(read, number) for number in early]
        beside = pool.submit(when_read, tasks[:])
        tasks += [pool.submit(read, number) for number in late]
        for done, task in enumerate(as_completed(tasks), 1):
            task.result()
            tell(progress, done, len(listed))
        beside.result()
    return values


def _describe(shape: tuple[int, ...], kind: np.dtype[Any]) -> str:
    channels = f"{shape[2]} channels" if len(shape) == 3 else "grey"
    return f"{shape[1]}×{shape[0]} pixels, {channels}, {kind}"
