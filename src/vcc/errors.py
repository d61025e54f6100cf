"""Exceptions and warnings: errors for invalid input, warnings about doubtful results and about lost time."""

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
