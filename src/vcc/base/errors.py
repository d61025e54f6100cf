"""What goes wrong, as types: one error for bad input, one warning for a result to be read with care."""

import inspect
import warnings


class InputError(ValueError):
    """Something given to the camera, a light field or a file reader is unusable.

    The message names the thing, its value and the way out.
    """


class ResultWarning(UserWarning):
    """A result was made, but part of what was asked for was not there (rays, orientation, units)."""


class CacheWarning(UserWarning):
    """Something could not be kept to be used again: results are the same, and take longer the next time."""


def warn_of_result(message: str) -> None:
    """Warn of a result, at the line that called this package, however far inside it this is noticed.

    Args:
        message: what is to be known of the result, and the way out.

    Warns:
        ResultWarning: always.
    """
    frame, level = inspect.currentframe(), 1
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "vcc":
        frame, level = frame.f_back, level + 1
    warnings.warn(message, ResultWarning, stacklevel=level)
