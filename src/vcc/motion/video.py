"""A light field that changes over time: frames, their times, and the interpolation between them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.samples import Samples
from vcc.store.video_layout import Between


@dataclass(frozen=True, eq=False, repr=False)
class LightFieldVideo(Brief):
    """Frames of a light field over time.

    Args:
        frames: light fields of one grid, in memory or on disk; each is accessed when it is needed.
        times: of the frames, seconds, ascending.
        between: ``"linear"``: linear interpolation between frames, and the video lasts from the first to the
            last; ``"held"``: each frame lasts until the next, and the last one as long as the one before it.

    Raises:
        InputError: different numbers of times and frames, times that do not ascend; fewer than two frames.
    """

    frames: Sequence[Samples]
    times: tuple[float, ...]
    between: Between = "linear"

    def __post_init__(self) -> None:
        times = tuple(checks.finite("the time of a frame", each, "seconds") for each in self.times)
        object.__setattr__(self, "times", times)
        checks.one_of("between", self.between, get_args(Between))
        if len(times) != len(self.frames):
            raise InputError(f"there are {len(self.frames)} frames and {len(times)} times: give a time for each")
        if len(times) < 2:
            raise InputError(f"a video has two frames or more, and there are {len(times)}: pass the frame itself")
        late = next((n for n in range(1, len(times)) if not times[n - 1] < times[n]), None)
        if late is not None:
            raise InputError(
                f"times of frames must ascend, but frame {late} is at {times[late]:g} s, frame {late - 1} at "
                f"{times[late - 1]:g} s"
            )

    def __len__(self) -> int:
        return len(self.times)

    @property
    def stop(self) -> float:
        """The end of the video, seconds."""
        last = self.times[-1]
        return last if self.between == "linear" else last + (last - self.times[-2])

    def check_lasts(self, start: float, stop: float) -> None:
        """Check that the video covers an interval.

        Raises:
            InputError: it starts before the first frame, or stops after the end.
        """
        least = 1e-9 * (stop - start)  # tolerance for rounding of sums of times
        if start < self.times[0] - least or stop > self.stop + least:
            if start == stop:
                raise InputError(
                    f"{start:g} s is not within the video, from {self.times[0]:g} s to {self.stop:g} s"
                )
            raise InputError(
                f"the exposure goes from {start:g} s to {stop:g} s, and the video from {self.times[0]:g} s to "
                f"{self.stop:g} s: choose another start, or a shorter exposure"
            )

    def shares(self, time: float) -> list[tuple[int, float]]:
        """The frames at a time, and their shares, which sum to 1."""
        after = min(max(bisect_right(self.times, time), 1), len(self.times))
        if self.between == "held" or after == len(self.times):
            return [(after - 1, 1.0)]
        begin, end = self.times[after - 1], self.times[after]
        share = min(max((time - begin) / (end - begin), 0.0), 1.0)
        return [(after - 1, 1 - share), (after, share)]
