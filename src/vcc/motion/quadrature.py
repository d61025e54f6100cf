"""The mean of pictures over an interval of time, by midpoints, until it changes little.

Midpoints of thirds hold the midpoint of the whole: each refinement keeps all pictures that there are. They are
never at the ends, where something may just switch, and all weigh the same, so that what is never dark stays so.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Generic, Protocol, Self, TypeVar

from vcc.base.describe import Brief

LEAST, MOST = 9, 729
"""Moments of an interval: a change tells of the error when there are two of them."""


class Summand(Protocol):
    """What can be added, and weighed by numbers."""

    def __add__(self, other: Self, /) -> Self: ...

    def __mul__(self, factor: float, /) -> Self: ...

    def size(self) -> float:
        """Its mean, as tolerances are a share of it."""
        ...

    def distance(self, other: Self, /) -> float:
        """The root mean square of the difference."""
        ...


Picture = TypeVar("Picture", bound=Summand)


@dataclass(frozen=True, eq=False, repr=False)
class Mean(Brief, Generic[Picture]):
    """A mean over time.

    Args:
        value: the mean.
        error: its estimated error, root mean square, in units of the values.
        moments: of which it is the mean.
        reached: whether the tolerance was.
    """

    value: Picture
    error: float
    moments: int
    reached: bool


def mean_over(
    start: float,
    stop: float,
    at: Callable[[Sequence[float]], Iterable[Picture]],
    tolerance: float,
    most: int = MOST,
) -> Mean[Picture]:
    """The mean of pictures over an interval, by 9, 27, 81, … moments.

    Where the mean is approached as 1/n, as beside jumps at times that nobody told of, the error of n moments is
    half of what the last step changed, and a sixth of what the one before it did. The larger one is taken: a step
    may change nothing by chance. Where pictures only bend, the mean is approached as 1/n², and both are too large.

    Args:
        start: seconds.
        stop: seconds.
        at: the pictures of some moments, in their order; it is asked for all of a step at once, so that they can
            be made together.
        tolerance: the error that is good enough, as a share of the mean.
        most: moments, 9 or more.
    """

    def new(count: int) -> list[float]:
        """Those of so many moments that the step before has not."""
        numbers = (number for number in range(count) if count == 1 or number % 3 != 1)
        return [start + (number + 0.5) / count * (stop - start) for number in numbers]

    beginning = iter(at([*new(1), *new(3), *new(LEAST)]))
    count, total, changed = 1, next(beginning), math.inf
    while True:
        before, count = total * (1 / count), 3 * count
        times = new(count)
        for picture in islice(beginning, len(times)) if count <= LEAST else at(times):
            total = total + picture
        mean = total * (1 / count)
        earlier, changed = changed, mean.distance(before)
        error = max(changed / 2, earlier / 6)
        good = error <= tolerance * abs(mean.size())
        if good or 3 * count > most:
            return Mean(mean, error, count, good)
