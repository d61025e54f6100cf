"""Courses, values as functions of time: Python functions, steps, and lines between points."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.values import Value


@runtime_checkable
class Course(Protocol):
    """A value as a function of time. Integrals are split at its breaks; in between it must be smooth."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times at which it jumps or bends, seconds, ascending."""
        ...

    def __call__(self, time: float) -> Any:
        """The value at a time, seconds."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Function(Brief):
    """A function of time.

    Args:
        function: from seconds to the value.
        breaks: times at which it jumps or bends, seconds, ascending.

    Raises:
        InputError: not a function; breaks that do not ascend.
    """

    function: Callable[[float], Any]
    breaks: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise InputError(
                "a course must be a function of seconds, vcc.motion.Steps or vcc.motion.Lines, not a "
                f"{type(self.function).__name__}"
            )
        object.__setattr__(self, "breaks", _times(self.breaks))

    def __call__(self, time: float) -> Any:
        """The value at a time, seconds."""
        return self.function(time)


@dataclass(frozen=True, eq=False, repr=False)
class Steps(Brief, Value):
    """One value after the other: each is valid from its time until the next one's.

    Args:
        times: seconds, ascending. The first value is also valid before its time.
        values: one per time.

    Raises:
        InputError: times that do not ascend, or another number of values.
    """

    times: Sequence[float]
    values: Sequence[Any]

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", _times(self.times))
        object.__setattr__(self, "values", tuple(self.values))
        _check_as_many(self.times, self.values)

    @property
    def breaks(self) -> tuple[float, ...]:
        """The times at which the value switches."""
        return tuple(self.times)[1:]

    def __call__(self, time: float) -> Any:
        """The value at a time, seconds."""
        return self.values[max(bisect_right(self.times, time) - 1, 0)]


@dataclass(frozen=True, eq=False, repr=False)
class Lines(Brief, Value):
    """Linear interpolation between numbers at given times, constant before and after.

    Args:
        times: seconds, ascending.
        values: one number per time, or one pair such as ``(0, 2 * mm)`` for parameters with x and y.

    Raises:
        InputError: times that do not ascend, another number of values, values that are not numbers, or a
            mixture of numbers and pairs.
    """

    times: Sequence[float]
    values: Sequence[float | tuple[float, ...]]

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", _times(self.times))
        object.__setattr__(self, "values", tuple(map(_numbers, self.values)))
        _check_as_many(self.times, self.values)
        if len(set(map(np.shape, self.values))) > 1:
            raise InputError(
                "some values of Lines are one number and some are several: give equally many at each time"
            )

    @property
    def breaks(self) -> tuple[float, ...]:
        """All times."""
        return tuple(self.times)

    def __call__(self, time: float) -> float | tuple[float, ...]:
        """The number at a time, seconds, or the numbers."""
        after = bisect_right(self.times, time)
        if after in (0, len(self.times)):
            return self.values[0 if after == 0 else -1]
        begin, end = self.times[after - 1], self.times[after]
        share = (time - begin) / (end - begin)
        one, other = self.values[after - 1], self.values[after]
        if isinstance(one, tuple) and isinstance(other, tuple):
            return tuple((1 - share) * a + share * b for a, b in zip(one, other, strict=True))
        return (1 - share) * one + share * other  # type: ignore[operator]


def coded(code: str | Iterable[float], exposure: float) -> Steps:
    """A coded shutter, open or closed in equal parts of an exposure (Raskar et al. 2006).

    Args:
        code: such as ``"1101"``, or the transmission in each part, 0 to 1.
        exposure: total duration, seconds.

    Raises:
        InputError: an empty code, characters other than 0 and 1, numbers outside 0 to 1, an exposure of 0 or
            less.
    """
    length = checks.above_zero("exposure", exposure, unit="s")
    if isinstance(code, str) and set(code) - {"0", "1"}:
        raise InputError(f'the code of a shutter is written in 0 and 1, such as "1101", not {code!r}')
    shares = [checks.zero_or_more("a part of the shutter's code", float(part), most=1) for part in code]
    if not shares:
        raise InputError('the code of a shutter is empty: give one such as "1101"')
    return Steps([n * length / len(shares) for n in range(len(shares))], shares)


def code_of(steps: Steps) -> tuple[str, float] | None:
    """The code of a coded shutter and its exposure, seconds; None for other steps."""
    count = len(steps.times)
    if count < 2 or not all(isinstance(each, int | float) and each in (0, 1) for each in steps.values):
        return None
    code = "".join(str(int(each)) for each in steps.values)
    # Both estimates of the exposure may be off in the last digit.
    lengths = [count * steps.times[1], count / (count - 1) * steps.times[-1]]
    return next(((code, each) for each in lengths if each > 0 and coded(code, each).times == steps.times), None)


def course(given: Any) -> Course:
    """Convert to a course; a function is assumed to be smooth.

    Raises:
        InputError: not a course or function.
    """
    return given if isinstance(given, Course) else Function(given)


def pieces(start: float, stop: float, breaks: Iterable[float]) -> list[tuple[float, float]]:
    """The parts of an interval between breaks; equal breaks (up to rounding) are merged."""
    least = 1e-12 * max(abs(start), abs(stop))
    ends = [start]
    for each in sorted(breaks):
        if each - ends[-1] > least and stop - each > least:
            ends.append(each)
    return list(zip(ends, [*ends[1:], stop], strict=True))


def _times(given: Iterable[float]) -> tuple[float, ...]:
    times = tuple(checks.finite("a time", each, "seconds") for each in given)
    for before, after in pairwise(times):
        if not before < after:
            raise InputError(f"times must ascend, but {after:g} s comes after {before:g} s: sort them")
    return times


def _numbers(given: Any) -> float | tuple[float, ...]:
    """A number as a float, several as a tuple."""
    if isinstance(given, str) or np.ndim(given) == 0:
        return float(checks.finite("a value of Lines", given))
    return tuple(float(checks.finite("a number of a value of Lines", each)) for each in given)


def _check_as_many(times: Sequence[float], values: Sequence[Any]) -> None:
    if not times or len(times) != len(values):
        raise InputError(f"there are {len(times)} times and {len(values)} values: give equally many, at least one")
