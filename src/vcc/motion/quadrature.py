"""The mean of images over an interval of time, by the midpoint rule with adaptive refinement.

Dividing each interval into thirds keeps its midpoint, so that each refinement reuses all images. Midpoints
are never at the ends, where a value may switch. All weights are equal and positive, so that the mean of
positive values is positive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Generic, Protocol, Self, TypeVar

from vcc.base.describe import Brief

LEAST, MOST = 9, 729
"""Moments of an interval, least and most: the error estimate requires two refinements."""


class Summand(Protocol):
    """A term of a sum: supports addition, and multiplication by numbers."""

    def __add__(self, other: Self, /) -> Self: ...

    def __mul__(self, factor: float, /) -> Self: ...

    def size(self) -> float:
        """Its mean; tolerances are relative to it."""
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
        moments: their number.
        reached: whether the tolerance was reached.
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
    """The mean of images over an interval, by 9, 27, 81, … moments.

    If the mean converges as 1/n, as with jumps at unknown times, the error of n moments is half of the last
    change, and a sixth of the change before it. The estimate is the larger one, because a refinement may
    change nothing by chance. If images only bend, the mean converges as 1/n², and both are too large.

    Args:
        start: seconds.
        stop: seconds.
        at: returns the images of some moments, in their order; it is called with all moments of a refinement
            at once, so that they can be computed in batches.
        tolerance: the acceptable error, as a share of the mean.
        most: moments, 9 or more.
    """

    def new(count: int) -> list[float]:
        """The new moments of a refinement to ``count`` moments."""
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
