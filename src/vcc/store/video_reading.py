"""Opening a video of light fields: its times at once, a frame when its turn comes."""

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
"""Frames that stay open, those that were asked for last: disparities are then measured once."""


@dataclass(frozen=True, eq=False, repr=False)
class StoredVideo(Sequence[StoredLightField]):
    """A video of light fields on disk: the whole frames that there were when it was opened.

    ``video[3]`` is a frame, a `StoredLightField`, of which nothing is read before it is asked for; ``video[3:9]``
    is a shorter video. `vcc.MovingCamera.capture` takes it as it is; ``vcc.motion.LightFieldVideo(video,
    video.times, "held")`` says otherwise than the store what is between frames. Open it again to see the frames
    that came since.

    Args:
        path: folder of the video.
        attributes: what it states; see `vcc.store.video_layout.VideoAttributes`.
        places: of the frames.
        held: that the video is still the one that was opened.
    """

    path: Path
    attributes: VideoAttributes
    places: tuple[Place, ...]
    held: Held
    _open: OrderedDict[int, StoredLightField] = field(default_factory=OrderedDict)
    _known: dict[int, str] = field(default_factory=dict)

    @property
    def times(self) -> tuple[float, ...]:
        """Of the frames, seconds, ascending."""
        return tuple(place.time for place in self.places)

    @property
    def between(self) -> Between:
        """What there is between two frames: ``"linear"`` or ``"held"``, see `vcc.motion.LightFieldVideo`."""
        return self.attributes.between

    @property
    def shape(self) -> tuple[int, ...]:
        """Of a frame, (v, u, t, s) or (v, u, t, s, channels).

        Raises:
            InputError: there is no frame yet.
        """
        return self._common.shape

    @property
    def provenance(self) -> dict[str, Any]:
        """Where the video comes from."""
        return self.attributes.provenance

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, number: int) -> StoredLightField: ...

    @overload
    def __getitem__(self, number: slice) -> StoredVideo: ...

    def __getitem__(self, number: int | slice) -> StoredLightField | StoredVideo:
        """A frame, opened now, or a part of the video.

        Raises:
            InputError: the frame is missing or damaged, or has another grid than the video; it is named.
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
        """What is open stays here."""
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
        difference = common_of(frame).difference(self._common)
        if difference:
            raise InputError(
                f"{place.words}, of {self.path} has another grid than the video states: {difference}. Copy the "
                "frame again"
            )
        stated = "" if frame.held is None else frame.held.attributes
        if self._known.setdefault(place.number, stated) != stated:
            raise InputError(
                f"{place.words}, of {self.path} is another one than before: it was replaced while the video was "
                "read. Open the video again"
            )
        return frame


def _opened_elsewhere(
    path: Path, attributes: VideoAttributes, places: tuple[Place, ...], stated: str
) -> StoredVideo:
    """A video that another process has open: no frame is opened here of any other one."""
    return StoredVideo(path, attributes, places, Held(path, WHAT, _identity, stated))


def _identity(folder: Path) -> Any:
    """What tells a video from another; the grid comes with the first frame."""
    return attributes_of(folder, VIDEO, but=("grid",))


def common_of(frame: StoredLightField) -> Common:
    """What a frame has in common with the others of its video."""
    return Common(frame.shape, frame.dtype, frame.frame, frame.transfer, frame.sample, frame.channel_names)


def open_video(path: str | PathLike[str]) -> StoredVideo:
    """A video of light fields on disk, opened without reading its frames, also while frames are appended.

    Args:
        path: folder of the video.

    Raises:
        InputError: no such folder, no video, a newer version, attributes that cannot be used, or frames that are
            missing or do not follow one another (named).
    """
    folder = expanded(path)
    check_path(folder, "video")
    if not is_store(folder):
        raise InputError(f"{folder} is no video of light fields: it holds no zarr.json")
    with reading(folder, "a video of light fields"):
        held = Held.now(folder, WHAT, _identity)
        # Before what they have in common, which is stated before the first one comes.
        found = tuple(places(folder))
        attributes = VideoAttributes.read(folder)
        held.check()
        if found and attributes.common is None:
            raise InputError(f"{folder} states no grid, and holds a frame, {found[0].name}: see docs/store.md")
        return StoredVideo(folder, attributes, found, held)


def is_video(path: str | PathLike[str]) -> bool:
    """Whether a folder is a video of light fields."""
    folder = expanded(path)
    return is_store(folder) and video_attributes(folder) is not None
