"""Types of errors and warnings: one error for bad input, one warning for results to be read with care."""

import inspect
import warnings
from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """An argument of the camera, a light field or a file reader is unusable.

    The message names the argument, its value and a solution.
    """


class ResultWarning(UserWarning):
    """A result is complete except for missing input (rays, orientation, units)."""


class CacheWarning(UserWarning):
    """A result could not be cached: later results are the same, but take longer."""


def warn_of_result(message: str) -> None:
    """Warn about a result; the warning refers to the line that called this package.

    Args:
        message: description of the problem, and a solution.

    Warns:
        ResultWarning: always.
    """
    frame, level = inspect.currentframe(), 1
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "vcc":
        frame, level = frame.f_back, level + 1
    warnings.warn(message, ResultWarning, stacklevel=level)


@contextmanager
def without_result_warnings() -> Iterator[None]:
    """Ignore `ResultWarning` within: where what the result lacks is intended, or measured."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResultWarning)
        yield
