"""What goes wrong, as types: one error for bad input, one warning for a result to be read with care."""


class InputError(ValueError):
    """Something given to the camera, a light field or a file reader is unusable.

    The message names the thing, its value and the way out.
    """


class ResultWarning(UserWarning):
    """A result was made, but part of what was asked for was not there (rays, orientation, units)."""
