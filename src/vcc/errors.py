"""What goes wrong, as types: one error for bad input, one warning for a result to be read with care."""

from vcc.base.errors import (
    InputError,
    ResultWarning,
)

__all__ = [
    "InputError",
    "ResultWarning",
]
