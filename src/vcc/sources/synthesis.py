"""Light fields from renderers: rendered view by view, stored as they are done, continued after a stop."""

from __future__ import annotations

import warnings
from dataclasses import asdict
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
from vcc.sources.views import CameraArray, ViewCamera
from vcc.store import StoredLightField, create_store

DTYPES = ("float16", "float32", "uint8", "uint16")
"""Supported types of the samples of a synthesized light field."""


class Renderer(Protocol):
    """Renders the image of one view. A renderer that holds resources may also have ``close()``.

    A renderer that computes depth may also have ``disparity_maps(cameras)``, which returns `DisparityMaps`: they
    become the disparities of the light field.
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
        progress: called with (done, total) in views, including views found in the store.

    Returns:
        A `vcc.LightField`, or with a store the result of `vcc.store.open_store`: shape (v, u, t, s, 3), linear.

    Raises:
        InputError: another dtype; a store of another description; a view that could not be rendered, has
            another shape than requested, or contains values that are not finite, negative or too large for the
            dtype. Views before it stay in the store.
    """
    kind = np.dtype(dtype)
    if kind.name not in DTYPES:
        raise InputError(f"the samples of a synthesized light field are {', '.join(DTYPES)}, not {kind}")
    if store is None:
        return _in_memory(renderer, cameras, kind, progress)
    return _in_store(renderer, cameras, Path(fspath(store)), kind, progress)


def _in_memory(
    renderer: Renderer, cameras: CameraArray, kind: np.dtype[Any], progress: Progress | None
) -> LightField:
    values = np.empty((*cameras.shape, 3), kind)
    order = list(np.ndindex(*cameras.views))
    cut = _Cut(kind)
    for done, (row, column) in enumerate(order):
        tell(progress, done, len(order))
        hint = "Give store=… (a folder) to keep the views that are done and to go on where it stopped"
        values[row, column] = _rendered(renderer, cameras, row, column, done, cut, hint)
    tell(progress, len(order), len(order))
    cut.warn()
    light_field = cameras.light_field(values)
    maps = getattr(renderer, "disparity_maps", None)
    if maps is None:
        return light_field
    return LightField(values, light_field.frame, disparity=Disparities(maps(cameras)))


def _in_store(
    renderer: Renderer, cameras: CameraArray, path: Path, kind: np.dtype[Any], progress: Progress | None
) -> StoredLightField:
    rendered = renderer.description()
    description = {"renderer": rendered, "cameras": asdict(cameras), "dtype": kind.name}
    provenance = {"made_by": f"vcc {__version__}, vcc.sources.synthesize", "renderer": rendered}
    total = cameras.views[0] * cameras.views[1]
    cut = _Cut(kind)
    with create_store(
        path,
        cameras,
        (*cameras.shape, 3),
        kind,
        provenance=provenance,
        description=description,
        channel_names=("R", "G", "B"),
    ) as writer:
        missing = writer.missing()
        for done, (row, column) in enumerate(missing, total - len(missing)):
            tell(progress, done, total)
            hint = f"{done} of {total} views are kept in {path}: the same call goes on with this one"
            writer.write_view(row, column, _rendered(renderer, cameras, row, column, done, cut, hint))
        tell(progress, total, total)
        cut.warn()
        maps = getattr(renderer, "disparity_maps", None)
        if maps is not None and not writer.attributes.complete:
            writer.write_disparity(maps(cameras))
        return writer.finish()


def _rendered(
    renderer: Renderer,
    cameras: CameraArray,
    row: int,
    column: int,
    done: int,
    cut: _Cut,
    hint: str,
) -> NDArray[Any]:
    """Render a view and convert it to the stored type.

    Raises:
        InputError: rendering or conversion failed; the message names the view, the reason and how to continue.
    """
    total = cameras.views[0] * cameras.views[1]
    view = f"view ({row}, {column}), number {done + 1} of {total}"
    try:
        radiance = np.asarray(renderer.render(cameras.camera(row, column)))
    except Exception as error:
        name = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
        raise InputError(f"{view} could not be rendered. {name}{error}\n{hint}") from error
    try:
        return cut.kept(radiance, (*cameras.pixels, 3))
    except InputError as error:
        raise InputError(f"{view} {error}\n{hint}") from None


class _Cut:
    """Converts radiance to samples of a dtype and counts clipped samples."""

    def __init__(self, kind: np.dtype[Any]) -> None:
        self._kind = kind
        self._cut = 0
        self._seen = 0

    def kept(self, radiance: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
        """Check the image and convert it to the stored type.

        Raises:
            InputError: the values are not valid radiance, or do not fit the dtype.
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
        if self._kind.kind == "f":
            largest = float(np.finfo(self._kind).max)
            if radiance.max() > largest:
                raise InputError(
                    f"holds radiance of {radiance.max():g}, and {self._kind} ends at {largest:g}: "
                    'take dtype="float32"'
                )
            return radiance.astype(self._kind)
        self._cut += int((radiance > 1).sum())
        self._seen += radiance.size
        full = np.iinfo(self._kind).max
        return np.asarray(np.rint(np.minimum(radiance, 1.0) * full), dtype=self._kind)

    def warn(self) -> None:
        """Warn about clipped samples, if there are any."""
        if self._cut:
            warnings.warn(
                ResultWarning(
                    f"{100 * self._cut / self._seen:.2g} % of the samples were brighter than radiance 1 and were "
                    f'clipped to it, the maximum of {self._kind}. dtype="float16" holds more'
                ),
                stacklevel=4,
            )
