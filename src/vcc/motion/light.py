"""The light before a camera over time: one light field, frames, or a function of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from operator import getitem
from typing import Any, Protocol

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.samples import Samples, check_is_light_field
from vcc.motion.video import LightFieldVideo
from vcc.store.video_reading import StoredVideo

Part = tuple[Any, Callable[[], Any], float]
"""(key, function that returns the light field, share)."""


class Light(Protocol):
    """Light fields over time."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times at which it jumps or bends, seconds."""
        ...

    def check_lasts(self, start: float, stop: float) -> None:
        """Check that there is light during an interval.

        Raises:
            InputError: there is none at some time.
        """
        ...

    def at(self, time: float) -> list[Part]:
        """The light fields at a time, and their shares."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class _Still(Brief):
    light_field: Samples
    breaks: tuple[float, ...] = ()

    def check_lasts(self, start: float, stop: float) -> None:
        return

    def at(self, time: float) -> list[Part]:
        return [("still", lambda: self.light_field, 1.0)]


@dataclass(frozen=True, eq=False, repr=False)
class _Frames(Brief):
    video: LightFieldVideo

    @property
    def breaks(self) -> tuple[float, ...]:
        return self.video.times

    def check_lasts(self, start: float, stop: float) -> None:
        self.video.check_lasts(start, stop)

    def at(self, time: float) -> list[Part]:
        frames = self.video.frames
        return [(number, partial(getitem, frames, number), share) for number, share in self.video.shares(time)]


@dataclass(frozen=True, eq=False, repr=False)
class _Made(Brief):
    function: Callable[[float], Samples]
    breaks: tuple[float, ...] = ()

    def check_lasts(self, start: float, stop: float) -> None:
        return

    def at(self, time: float) -> list[Part]:
        return [(time, lambda: self._checked(time), 1.0)]

    def _checked(self, time: float) -> Samples:
        made = self.function(time)
        try:
            check_is_light_field(made)
        except InputError as error:
            raise InputError(f"the function of time returned an invalid value at {time:g} s: {error}") from None
        return made


def light_of(given: Any) -> Light:
    """Convert to light over time.

    Raises:
        InputError: not a light field, video or function.
    """
    if isinstance(given, StoredVideo):
        return _Frames(LightFieldVideo(given, given.times, given.between))
    if isinstance(given, LightFieldVideo):
        return _Frames(given)
    if callable(given):
        return _Made(given, tuple(getattr(given, "breaks", ())))
    check_is_light_field(given)
    return _Still(given)
