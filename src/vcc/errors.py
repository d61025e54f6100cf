"""What goes wrong, as types: an error for bad input, warnings for results to read with care and for lost time."""

from vcc.base.errors import (
    CacheWarning,
    InputError,
    ResultWarning,
)

__all__ = [
    "CacheWarning",
    "InputError",
    "ResultWarning",
]
