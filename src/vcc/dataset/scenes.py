"""The scenes of a data set: light fields in stores, videos and memory, and renderers with an array of cameras."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from typing import Any

import numpy as np

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import expanded
from vcc.fields.grid import Grid
from vcc.fields.samples import InMemory
from vcc.light_field import LightField
from vcc.sources.synthesis import synthesize
from vcc.sources.views import CameraArray
from vcc.store import StoredLightField, StoredVideo, is_store, is_video, open_store, open_video
from vcc.sweeps.identity import of_light_field

READ_WHOLE = 2**30
"""Stored scenes whose samples take at most this many bytes in memory are read once; larger ones in pieces."""
EXAMPLES = (
    'a store ("scene.zarr", vcc.store.open_store), a video (vcc.store.open_video), a vcc.LightField, or a '
    "renderer with its cameras, (renderer, vcc.sources.CameraArray(...))"
)


@dataclass(frozen=True, eq=False, repr=False)
class Scene(Brief):
    """A light field before the cameras, which each worker opens for itself.

    Args:
        name: for the card and messages.
        source: a light field, or a renderer with its array of cameras.
    """

    name: str
    source: Any

    @property
    def grid(self) -> Grid:
        """The grid of the light field; nothing is rendered."""
        if isinstance(self.source, tuple):
            cameras: CameraArray = self.source[1]
            return cameras.light_field(np.broadcast_to(np.float32(0), (*cameras.shape, 3))).grid
        grid: Grid = self.source.grid
        return grid

    def identity(self) -> str:
        """Text that differs for other samples or geometry: a fingerprint, or a renderer's description."""
        if isinstance(self.source, tuple):
            renderer, cameras = self.source
            return json.dumps([renderer.description(), asdict(cameras)], sort_keys=True, default=repr)
        return of_light_field(self.source)

    def opened(self) -> Any:
        """The light field: in memory if it takes at most `READ_WHOLE` bytes there, otherwise in its store."""
        if isinstance(self.source, tuple):
            return synthesize(*self.source, dtype="float32")
        if isinstance(self.source, StoredLightField):
            self.source.check_complete()
            size = math.prod(self.source.shape) * self.source.read_dtype.itemsize
            return self.source.read() if size <= READ_WHOLE else self.source
        return self.source


def scenes_of(given: Any) -> tuple[Scene, ...]:
    """The scenes that a user passes: one or several; each frame of a video is a scene.

    Raises:
        InputError: none, something else, or light fields with different numbers of channels.
    """
    several = [given] if _is_one(given) else list(given) if isinstance(given, Sequence) else [given]
    found = tuple(scene for number, each in enumerate(several) for scene in _scenes(each, number))
    if not found:
        raise InputError(f"a data set needs at least one scene: {EXAMPLES}")
    channels = {scene.grid.channels: scene for scene in found}
    if len(channels) > 1:
        (one, first), (other, second) = list(channels.items())[:2]
        raise InputError(
            f"scenes of a data set have equally many channels: {first.name} has {one or 'no axis of them'}, and "
            f"{second.name} {other or 'no axis of them'}. Make a data set of each kind"
        )
    return found


def _is_one(given: Any) -> bool:
    return isinstance(given, str | PathLike | StoredVideo) or _is_rendered(given)


def _is_rendered(given: Any) -> bool:
    return isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], CameraArray)


def _scenes(given: Any, number: int) -> Iterator[Scene]:
    name = f"scene {number}"
    if isinstance(given, str | PathLike):
        path = expanded(given)
        if is_video(path):
            given = open_video(path)
        elif is_store(path):
            given = open_store(path)
        elif not path.exists():
            raise InputError(f"there is no scene {path}")
        else:
            raise InputError(
                f"{path} is no store, and workers read scenes from stores: convert it first with vcc convert "
                f"{path} scene.zarr, or pass vcc.open_light_field({str(path)!r})"
            )
    if isinstance(given, StoredVideo):
        if not len(given):
            raise InputError(f"{given.path} has no frames")
        yield from (Scene(f"{given.path.name}, frame {n}", given[n]) for n in range(len(given)))
    elif isinstance(given, StoredLightField):
        given.check_complete()
        yield Scene(given.path.name, given)
    elif isinstance(given, InMemory):
        yield Scene(name, given if isinstance(given, LightField) else LightField.of(given.values, given.grid))
    elif _is_rendered(given):
        if not (hasattr(given[0], "render") and hasattr(given[0], "description")):
            raise InputError(
                f"{name} is rendered by a {type(given[0]).__name__}, which is no renderer: {EXAMPLES}"
            )
        yield Scene(f"{name} ({type(given[0]).__name__})", given)
    else:
        raise InputError(f"{name} is a {type(given).__name__}: a scene is {EXAMPLES}")
