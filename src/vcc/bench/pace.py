"""The fineness of images during a drag: the finest that the machine makes in time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass

from vcc.bench.picture import COARSER, WHOLE, Fineness, Taken

IN_TIME = 0.020
"""Time limit of an image during a drag, seconds: of those that take longer, a coarser one is made. The browser of
the same machine needs as much again for each."""
CLOSE = 1.3
"""A finer image is made in any case if it takes up to this times the quickest, or this times its processor
time."""
BESIDES = 0.020
"""Processor time of an image that does not depend on its fineness, seconds: the drawing, and the browser."""
LONGER, SHORTER = 0.3, 0.9
"""Weight of the newest time in the running mean if it is longer, or shorter: busy machines delay some images."""
NOTICED, SOON = 0.04, 0.7
"""Time of a whole image, seconds, from which on another one is shown before it, if it takes this share of the time
at most."""
LEFT = 0.4
"""Seconds after which a fineness that was too slow is tried again, if it was fast enough once."""
TRIALS = 0.1
"""Share of the time that trials may cost: the slower one was, the longer it is left."""
WORTH = 1.5
"""A coarse image is tried again if its shortest time, by how busy the machine is, is at most the limit, or this
times `IN_TIME`; a whole one, whose time varies more with the place, if it is at most the limit."""
BUSY, FREE = 1.5, 1.2
"""Times the shortest time from which on the machine is busy, and up to which it is free."""
MOST_KINDS = 50
"""Camera kinds whose times are remembered."""


@dataclass
class _Times:
    """Times of images of one kind and fineness, seconds.

    Args:
        recent: a running mean.
        planning: the part of it before the plan was ready.
        least: the shortest.
        work: a running mean of the processor time, which a busy machine hardly changes.
        at: the clock at the newest.
    """

    recent: float
    planning: float
    least: float
    work: float
    at: float


class Pace:
    """Chooses the fineness of an image from the times of earlier images of the same kind of camera.

    The finest image is chosen that is expected within `IN_TIME`, or within `CLOSE` times the quickest, by the
    clock or by the processor time that it costs with everything around it. For a coarse fineness without a
    measurement, the estimate is the planning time of another fineness plus its run time, scaled by the work; a
    whole image must have been measured. A fineness that was too slow is tried again after `LEFT`, since the
    machine may have been busy. If several kinds of images took longer than before, it was; when one is as quick as
    before, times that were measured meanwhile are forgotten.

    Args:
        clock: seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._kept: dict[Hashable, tuple[bool, dict[Fineness, _Times]]] = {}
        self._busy: set[Fineness] = set()

    def noted(self, of: Hashable, fineness: Fineness, taken: Taken) -> None:
        """Record the time of an image.

        Args:
            of: the key of cameras and light fields that take about the same time.
            fineness: of the image.
            taken: the image.
        """
        by_rays, times = self._kept.pop(of, (taken.by_rays, {}))
        if by_rays != taken.by_rays:
            by_rays, times = taken.by_rays, {}
        now, took, planning = self._clock(), taken.seconds, taken.planning
        before = times.get(fineness)
        if before is None:
            times[fineness] = _Times(took, planning, took, taken.processor, now)
        else:
            weight = LONGER if took > before.recent else SHORTER
            before.recent += weight * (took - before.recent)
            before.planning += weight * (planning - before.planning)
            weight = LONGER if taken.processor > before.work else SHORTER
            before.work += weight * (taken.processor - before.work)
            before.least, before.at = min(before.least, took), now
            if took > BUSY * before.least:
                self._busy.add(fineness)
            elif took < FREE * before.least and fineness in self._busy:
                for each in times.values():
                    each.recent = min(each.recent, each.least)
                self._busy.clear()
        for other, each in list(times.items()):
            coarser = other != WHOLE if fineness == WHOLE else other.share(by_rays) < fineness.share(by_rays)
            if coarser and each.recent > took:  # loading or compiling code delayed its first image
                del times[other]
        self._kept[of] = by_rays, times
        if len(self._kept) > MOST_KINDS:
            del self._kept[next(iter(self._kept))]

    def seconds(self, of: Hashable) -> float | None:
        """Expected time of a whole image, seconds; None without measurements of one."""
        times = self._kept[of][1].get(WHOLE) if of in self._kept else None
        return None if times is None else times.recent

    def is_soon(self, of: Hashable, fineness: Fineness) -> bool:
        """Whether such an image comes much sooner than a whole one, which takes noticeably long; or unknown."""
        whole = self.seconds(of)
        if whole is None or whole <= NOTICED:
            return False
        times = self._kept[of][1].get(fineness)
        return times is None or times.recent < SOON * whole

    def fineness(self, of: Hashable) -> Fineness:
        """The fineness of the next image; without measurements, coarse: as of the newest kind, or the finest."""
        if of not in self._kept:
            newest = next(reversed(self._kept), None)
            found = WHOLE if newest is None else self.fineness(newest)
            return COARSER[0] if found == WHOLE else found
        whole = self.seconds(of)
        expected = ({} if whole is None else {WHOLE: whole}) | {each: self._expected(of, each) for each in COARSER}
        limit = max(IN_TIME, CLOSE * min(expected.values()))
        work = {each: BESIDES + times.work for each, times in self._kept[of][1].items()}
        close = CLOSE * work.get(min(expected, key=expected.__getitem__), 0.0)
        return next(
            each
            for each, seconds in expected.items()
            if seconds <= limit or work.get(each, math.inf) <= close or self._tried(of, each, limit)
        )

    def _tried(self, of: Hashable, fineness: Fineness, limit: float) -> bool:
        """Whether a fineness that was too slow is worth another trial now."""
        every = self._kept[of][1]
        times = every.get(fineness)
        newest = max(every.values(), key=lambda each: each.at)
        most = limit if fineness == WHOLE else max(limit, WORTH * IN_TIME)
        if times is None or times.least * newest.recent / newest.least > most:
            return False
        return self._clock() - times.at >= max(LEFT, (times.recent - limit) / TRIALS)

    def _expected(self, of: Hashable, fineness: Fineness) -> float:
        by_rays, times = self._kept[of]
        if fineness in times:
            return times[fineness].recent
        share = fineness.share(by_rays)
        return min(
            each.planning + share / other.share(by_rays) * (each.recent - each.planning)
            for other, each in times.items()
        )
