"""What something is at each time: functions, steps, and lines between points."""

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
    """What something is at each time. Integrals are cut at its breaks, and are taken to be smooth in between."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times at which it jumps or bends, seconds, ascending."""
        ...

    def __call__(self, time: float) -> Any:
        """What it is at a time, seconds."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Function(Brief):
    """A function of time.

    Args:
        function: from seconds to what there is then.
        breaks: times at which it jumps or bends, seconds, ascending.

    Raises:
        InputError: what is no function; breaks that do not ascend.
    """

    function: Callable[[float], Any]
    breaks: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise InputError(
                "what changes with time is a function of seconds, vcc.motion.Steps or vcc.motion.Lines, not a "
                f"{type(self.function).__name__}"
            )
        object.__setattr__(self, "breaks", _times(self.breaks))

    def __call__(self, time: float) -> Any:
        """What it is at a time, seconds."""
        return self.function(time)


@dataclass(frozen=True, eq=False, repr=False)
class Steps(Brief, Value):
    """One value after the other: each from its time on until the next one's.

    Args:
        times: seconds, ascending. Before the first, there is what is there at the first.
        values: as many.

    Raises:
        InputError: times that do not ascend, or as many values as there are not times.
    """

    times: Sequence[float]
    values: Sequence[Any]

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", _times(self.times))
        object.__setattr__(self, "values", tuple(self.values))
        _check_as_many(self.times, self.values)

    @property
    def breaks(self) -> tuple[float, ...]:
        """When one value follows another."""
        return tuple(self.times)[1:]

    def __call__(self, time: float) -> Any:
        """The value of a time, seconds."""
        return self.values[max(bisect_right(self.times, time) - 1, 0)]


@dataclass(frozen=True, eq=False, repr=False)
class Lines(Brief, Value):
    """Numbers that go evenly from each time's to the next one's, and stay as they are before and after.

    Args:
        times: seconds, ascending.
        values: as many numbers, or pairs of numbers such as ``(0, 2 * mm)`` for what has an x and a y.

    Raises:
        InputError: times that do not ascend, as many values as there are not times, values that are no numbers, or
            some that are pairs and some that are not.
    """

    times: Sequence[float]
    values: Sequence[float | tuple[float, ...]]

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", _times(self.times))
        object.__setattr__(self, "values", tuple(map(_numbers, self.values)))
        _check_as_many(self.times, self.values)
        if len(set(map(np.shape, self.values))) > 1:
            raise InputError("some values of Lines are one number and some are several: give as many at each time")

    @property
    def breaks(self) -> tuple[float, ...]:
        """All times."""
        return tuple(self.times)

    def __call__(self, time: float) -> float | tuple[float, ...]:
        """The number of a time, seconds, or the numbers."""
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
    """A shutter that opens and shuts by a code, in equal parts of an exposure (Raskar et al. 2006).

    Args:
        code: such as ``"1101"``, or what share of the light passes in each part, 0 to 1.
        exposure: of the whole, seconds.

    Raises:
        InputError: an empty code, letters other than 0 and 1, numbers outside 0 to 1, no exposure.
    """
    length = checks.above_zero("exposure", exposure, unit="s")
    if isinstance(code, str) and set(code) - {"0", "1"}:
        raise InputError(f'the code of a shutter is written in 0 and 1, such as "1101", not {code!r}')
    shares = [checks.zero_or_more("a part of the shutter's code", float(part), most=1) for part in code]
    if not shares:
        raise InputError('the code of a shutter is empty: give one such as "1101"')
    return Steps([n * length / len(shares) for n in range(len(shares))], shares)


def code_of(steps: Steps) -> tuple[str, float] | None:
    """The code of a shutter that opens and shuts in equal parts, and the exposure, seconds; None for others."""
    count = len(steps.times)
    if count < 2 or not all(isinstance(each, int | float) and each in (0, 1) for each in steps.values):
        return None
    code = "".join(str(int(each)) for each in steps.values)
    # Either may have lost its last digit
    lengths = [count * steps.times[1], count / (count - 1) * steps.times[-1]]
    return next(((code, each) for each in lengths if each > 0 and coded(code, each).times == steps.times), None)


def course(given: Any) -> Course:
    """What is given, as a course: functions are smooth.

    Raises:
        InputError: what is none.
    """
    return given if isinstance(given, Course) else Function(given)


def pieces(start: float, stop: float, breaks: Iterable[float]) -> list[tuple[float, float]]:
    """The parts of an interval between breaks; those within rounding of each other or of its ends count once."""
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
            raise InputError(f"times ascend, and {after:g} s comes after {before:g} s: sort them")
    return times


def _numbers(given: Any) -> float | tuple[float, ...]:
    """A number as it is, several as a tuple."""
    if isinstance(given, str) or np.ndim(given) == 0:
        return float(checks.finite("a value of Lines", given))
    return tuple(float(checks.finite("a number of a value of Lines", each)) for each in given)


def _check_as_many(times: Sequence[float], values: Sequence[Any]) -> None:
    if not times or len(times) != len(values):
        raise InputError(f"there are {len(times)} times and {len(values)} values: give as many, one at least")
