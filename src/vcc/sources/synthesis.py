"""Light fields from renderers: rendered view by view, stored as they are done, continued after a stop."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

from vcc import __version__
from vcc.base.errors import InputError, ResultWarning
from vcc.base.progress import Progress, tell
from vcc.fields.disparity import Disparities
from vcc.light_field import LightField
from vcc.run.executors import Work, worker_pool
from vcc.sources.views import CameraArray, ViewCamera
from vcc.store import StoredLightField, create_store

DTYPES = ("float16", "float32", "uint8", "uint16")
"""Supported types of the samples of a synthesized light field."""
MOST_IN_A_TASK = 16
"""Views that a task of an executor renders at most: they are stored when it ends."""
TASKS = 4
"""Tasks for each worker of an executor, if there are enough views: the scene is sent with each."""


class Renderer(Protocol):
    """Renders the image of one view. A renderer that holds resources may also have ``close()``.

    A renderer that computes depth may also have ``disparity_maps(cameras)``, which returns `DisparityMaps`: they
    become the disparities of the light field. A renderer for executors can be pickled. If its attribute
    ``threads`` is None (all cores), tasks set it to 1.
    """

    def description(self) -> dict[str, Any]:
        """Everything that an image depends on except the camera, as JSON data.

        Images are stored together only if their descriptions are equal.
        """
        ...

    def render(self, camera: ViewCamera) -> NDArray[np.float32]:
        """Return the image of a camera: linear radiance, shape (rows, columns, 3), row 0 at the top.

        Each sample is the mean over its pixel.
        """
        ...


def synthesize(
    renderer: Renderer,
    cameras: CameraArray,
    store: str | PathLike[str] | None = None,
    *,
    dtype: DTypeLike = "float16",
    executor: Any = None,
    progress: Progress | None = None,
) -> LightField | StoredLightField:
    """Render the light field of a scene with an array of cameras, view by view.

    With a store, each view is written to disk as soon as it is rendered; after a stop, the same call continues
    with the missing views. A store with another description (scene, samples, cameras, dtype …) raises.

    Args:
        renderer: renderer of the images.
        cameras: positions of the views.
        store: folder of a Zarr store (see `vcc.store`); None keeps the light field in memory.
        dtype: ``"float16"`` (11 bits of precision, radiance up to 65504) or ``"float32"`` keep radiance linear.
            ``"uint8"`` and ``"uint16"`` are rounded with full scale at radiance 1; brighter samples are
            clipped, with a warning.
        executor: renders the views, some in each task: a `concurrent.futures.Executor` or a
            ``dask.distributed.Client``. The samples are the same as without.
        progress: called with (done, total) in views, including views found in the store.

    Returns:
        A `vcc.LightField`, or with a store the result of `vcc.store.open_store`: shape (v, u, t, s, 3), linear.

    Raises:
        InputError: another dtype; a store of another description; a view that could not be rendered, has
            another shape than requested, or contains values that are not finite, negative or too large for the
            dtype; a renderer that cannot be pickled, with an executor; see also `vcc.run.executors`. Views that
            are done stay in the store.
    """
    kind = np.dtype(dtype)
    if kind.name not in DTYPES:
        raise InputError(f"the samples of a synthesized light field are {', '.join(DTYPES)}, not {kind}")
    task = _Task(renderer, cameras, kind)
    if store is None:
        return _in_memory(task, executor, progress)
    return _in_store(task, Path(fspath(store)), executor, progress)


@dataclass(frozen=True, repr=False)
class _Task:
    """What rendering a view needs."""

    renderer: Renderer
    cameras: CameraArray
    kind: np.dtype[Any]


def _in_memory(task: _Task, executor: Any, progress: Progress | None) -> LightField:
    renderer, cameras = task.renderer, task.cameras
    values = np.empty((*cameras.shape, 3), task.kind)
    order, clipped = list(np.ndindex(*cameras.views)), 0
    hint = "Give store=… (a folder) to keep the views that are done and to go on where it stopped"
    tell(progress, 0, len(order))
    for done, (place, view, too_bright) in enumerate(_rendered(task, order, executor, hint), 1):
        values[place] = view
        clipped += too_bright
        tell(progress, done, len(order))
    _warn_of_clipped(clipped, values.size, task.kind)
    light_field = cameras.light_field(values)
    maps = getattr(renderer, "disparity_maps", None)
    if maps is None:
        return light_field
    return LightField(values, light_field.frame, disparity=Disparities(maps(cameras)))


def _in_store(task: _Task, path: Path, executor: Any, progress: Progress | None) -> StoredLightField:
    cameras, rendered = task.cameras, task.renderer.description()
    description = {"renderer": rendered, "cameras": asdict(cameras), "dtype": task.kind.name}
    provenance = {"made_by": f"vcc {__version__}, vcc.sources.synthesize", "renderer": rendered}
    total = cameras.views[0] * cameras.views[1]
    clipped = samples = 0
    with create_store(
        path,
        cameras,
        (*cameras.shape, 3),
        task.kind,
        provenance=provenance,
        description=description,
        channel_names=("R", "G", "B"),
    ) as writer:
        missing = writer.missing()
        hint = f"{{done}} of {total} views are kept in {path}: the same call goes on with the others"
        done = total - len(missing)
        tell(progress, done, total)
        for place, view, too_bright in _rendered(task, missing, executor, hint, done):
            writer.write_view(*place, view)
            clipped, samples, done = clipped + too_bright, samples + view.size, done + 1
            tell(progress, done, total)
        _warn_of_clipped(clipped, samples, task.kind)
        maps = getattr(task.renderer, "disparity_maps", None)
        if maps is not None and not writer.attributes.complete:
            writer.write_disparity(maps(cameras))
        return writer.finish()


_Place = tuple[int, int]
_View = tuple[NDArray[Any], int]
"""The samples of a view as stored, and the number of clipped ones."""


def _rendered(
    task: _Task, places: Sequence[_Place], executor: Any, hint: str, done: int = 0
) -> Iterator[tuple[_Place, NDArray[Any], int]]:
    """Yield (place, samples, number of clipped samples) of views as they are done, in any order.

    Args:
        task: what rendering needs.
        places: (row, column) of the views.
        executor: None for this process.
        hint: how to continue after an error, with {done} for the number of views that are done.
        done: their number now.

    Raises:
        InputError: a view could not be rendered or converted, or the executor failed.
    """
    try:
        for place, (view, clipped) in (
            _one_by_one(task, places) if executor is None else _by(executor, task, places)
        ):
            yield place, view, clipped
            done += 1
    except InputError as error:
        raise InputError(f"{error}\n{hint.replace('{done}', str(done))}") from error


def _one_by_one(task: _Task, places: Sequence[_Place]) -> Iterator[tuple[_Place, _View]]:
    for place in places:
        yield place, _one_view(task, place)


def _by(executor: Any, task: _Task, places: Sequence[_Place]) -> Iterator[tuple[_Place, _View]]:
    workers = worker_pool(executor)
    size = max(1, min(MOST_IN_A_TASK, len(places) // (TASKS * max(workers.places, 1))))
    parts = [places[first : first + size] for first in range(0, len(places), size)]
    with closing(workers.each(Work(_some_views, task), parts)) as results:
        for number, views in results:
            yield from zip(parts[number], views, strict=True)


def _some_views(task: _Task, places: Sequence[_Place]) -> list[_View]:
    """The views of a task; its renderer is a copy of its own."""
    renderer: Any = task.renderer
    if getattr(renderer, "threads", 0) is None:
        renderer.threads = 1
    return [_one_view(task, place) for place in places]


def _one_view(task: _Task, place: _Place) -> _View:
    """Render a view and convert it to the stored type.

    Raises:
        InputError: rendering or conversion failed; the message names the view and the reason.
    """
    try:
        radiance = np.asarray(task.renderer.render(task.cameras.camera(*place)))
    except Exception as error:
        name = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
        raise InputError(f"view {place} could not be rendered. {name}{error}") from error
    try:
        return _kept(radiance, (*task.cameras.pixels, 3), task.kind)
    except InputError as error:
        raise InputError(f"view {place} {error}") from None


def _kept(radiance: NDArray[Any], shape: tuple[int, ...], kind: np.dtype[Any]) -> _View:
    """Check an image and convert it to the stored type.

    Raises:
        InputError: the values are not valid radiance, or do not fit the type.
    """
    if radiance.shape != shape:
        raise InputError(f"came as an array of shape {radiance.shape}, and {shape} was requested")
    if radiance.dtype.kind != "f":
        raise InputError(f"came as {radiance.dtype}: a renderer returns linear radiance, as float32")
    bad = ~(np.isfinite(radiance) & (radiance >= 0))
    if bad.any():
        place = tuple(int(n) for n in np.argwhere(bad)[0])
        raise InputError(
            f"holds {int(bad.sum())} values that are not valid radiance (NaN, infinite or negative), the "
            f"first at (row, column, channel) {place}: {radiance[place]}. Check the materials and lights"
        )
    if kind.kind == "f":
        largest = float(np.finfo(kind).max)
        if radiance.max() > largest:
            raise InputError(
                f'holds radiance of {radiance.max():g}, and {kind} ends at {largest:g}: take dtype="float32"'
            )
        return radiance.astype(kind), 0
    full = np.iinfo(kind).max
    return np.rint(np.minimum(radiance, 1.0) * full).astype(kind), int((radiance > 1).sum())


def _warn_of_clipped(clipped: int, samples: int, kind: np.dtype[Any]) -> None:
    """Warn about clipped samples, if there are any."""
    if clipped:
        warnings.warn(
            ResultWarning(
                f"{100 * clipped / samples:.2g} % of the samples were brighter than radiance 1 and were "
                f'clipped to it, the maximum of {kind}. dtype="float16" holds more'
            ),
            stacklevel=4,
        )
