"""Opening a light field video: times are read at once, frames on access."""

from __future__ import annotations

import operator
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any, overload

from vcc.base.errors import InputError
from vcc.base.reading import check_path, expanded, reading, shown
from vcc.store.held import Held, attributes_of
from vcc.store.reading import StoredLightField, is_store, open_store
from vcc.store.video_layout import VIDEO, Between, Common, Place, VideoAttributes, places, video_attributes

WHAT = "video"
KEPT = 8
"""Number of recently used frames that stay open, so that their disparities are measured once."""


@dataclass(frozen=True, eq=False, repr=False)
class StoredVideo(Sequence[StoredLightField]):
    """A light field video on disk, with the complete frames at the time of opening.

    ``video[3]`` is a frame, a `StoredLightField`, whose samples are read on access; ``video[3:9]`` is a shorter
    video. Pass a video to `vcc.MovingCamera.capture`; ``vcc.motion.LightFieldVideo(video, video.times,
    "held")`` overrides the interpolation between frames. Open the video again to see frames appended since.

    Args:
        path: folder of the video.
        attributes: attributes of the video; see `vcc.store.video_layout.VideoAttributes`.
        places: numbers, times and names of the frames.
        held: checks that the video has not been replaced since it was opened.
    """

    path: Path
    attributes: VideoAttributes
    places: tuple[Place, ...]
    held: Held
    _open: OrderedDict[int, StoredLightField] = field(default_factory=OrderedDict)
    _known: dict[int, str] = field(default_factory=dict)

    @property
    def times(self) -> tuple[float, ...]:
        """Times of the frames in seconds, ascending."""
        return tuple(place.time for place in self.places)

    @property
    def between(self) -> Between:
        """Interpolation between two frames: ``"linear"`` or ``"held"``, see `vcc.motion.LightFieldVideo`."""
        return self.attributes.between

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of a frame, (v, u, t, s) or (v, u, t, s, channels).

        Raises:
            InputError: there are no frames yet.
        """
        return self._common.shape

    @property
    def provenance(self) -> dict[str, Any]:
        """Origin of the video."""
        return self.attributes.provenance

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, number: int) -> StoredLightField: ...

    @overload
    def __getitem__(self, number: slice) -> StoredVideo: ...

    def __getitem__(self, number: int | slice) -> StoredLightField | StoredVideo:
        """Open a frame, or return a part of the video.

        Raises:
            InputError: the frame (named) is missing or damaged, or its grid differs from that of the video.
            IndexError: there is no such frame.
        """
        if isinstance(number, slice):
            return replace(self, places=self.places[number], _open=OrderedDict())
        place = self.places[operator.index(number)]
        kept = self._open.pop(place.number, None)
        self._open[place.number] = frame = self._opened(place) if kept is None else kept
        while len(self._open) > KEPT:
            self._open.popitem(last=False)
        return frame

    def __reduce__(self) -> tuple[Any, ...]:
        """Open frames are not pickled."""
        return _opened_elsewhere, (self.path.absolute(), self.attributes, self.places, self.held.attributes)

    def __repr__(self) -> str:
        name = f"StoredVideo({self.path}: "
        if not self.places:
            return f"{name}no frames)"
        first, last = self.times[0], self.times[-1]
        return f"{name}{len(self)} frames, {first:g} s to {last:g} s, {self.between}, of a {self._common.grid})"

    @property
    def _common(self) -> Common:
        if self.attributes.common is None:
            raise InputError(f"{self.path} has no frame yet, and states no grid")
        return self.attributes.common

    def _opened(self, place: Place) -> StoredLightField:
        try:
            with self.held.through():
                frame = open_store(self.path / place.name)
            if not frame.complete:
                raise InputError(f"{frame.path} was not finished")
        except InputError as error:
            self.held.check()
            said = shown(str(error), 300)
            raise InputError(
                f"{place.words}, of {self.path} cannot be used: {said}. Copy the frame again"
            ) from error
        difference = Common(frame.shape, frame.dtype, frame.attributes).difference(self._common)
        if difference:
            raise InputError(
                f"{place.words}, of {self.path} has another grid than the video states: {difference}. Copy the "
                "frame again"
            )
        stated = "" if frame.held is None else frame.held.attributes
        if self._known.setdefault(place.number, stated) != stated:
            raise InputError(
                f"{place.words}, of {self.path} was replaced while the video was read. Open the video again"
            )
        return frame


def _opened_elsewhere(
    path: Path, attributes: VideoAttributes, places: tuple[Place, ...], stated: str
) -> StoredVideo:
    """A video opened by another process; frames are only opened if it is still the same video."""
    return StoredVideo(path, attributes, places, Held(path, WHAT, _identity, stated))


def _identity(folder: Path) -> Any:
    """The attributes that identify a video, without the grid, which is added with the first frame."""
    return attributes_of(folder, VIDEO, but=("grid",))


def open_video(path: str | PathLike[str]) -> StoredVideo:
    """Open a light field video without reading its frames; frames may be appended meanwhile.

    Args:
        path: folder of the video.

    Raises:
        InputError: no such folder, not a video, a newer version, invalid attributes, or frames that are missing
            or out of order (named).
    """
    folder = expanded(path)
    check_path(folder, "video")
    if not is_store(folder):
        raise InputError(f"{folder} is not a video of light fields: it holds no zarr.json")
    with reading(folder, "a video of light fields"):
        held = Held.now(folder, WHAT, _identity)
        # List frames before reading attributes: the writer states the grid before the first frame appears.
        found = tuple(places(folder))
        attributes = VideoAttributes.read(folder)
        held.check()
        if found and attributes.common is None:
            raise InputError(f"{folder} states no grid, and holds a frame, {found[0].name}: see docs/store.md")
        return StoredVideo(folder, attributes, found, held)


def is_video(path: str | PathLike[str]) -> bool:
    """Whether a folder is a light field video."""
    folder = expanded(path)
    return is_store(folder) and video_attributes(folder) is not None
