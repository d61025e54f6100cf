"""What goes wrong, as types: one error for bad input, one warning for a result to be read with care."""


class InputError(ValueError):
    """Something given to the camera, a light field or a file reader is unusable.

    The message names the thing, its value and the way out.
    """


class ResultWarning(UserWarning):
    """A result was made, but part of what was asked for was not there (rays, orientation, units)."""


class CacheWarning(UserWarning):
    """Something could not be kept to be used again: results are the same, and take longer the next time."""
