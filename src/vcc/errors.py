"""What goes wrong, as types: the public face of `vcc.base.errors`."""

from vcc.base.errors import (
    InputError,
    ResultWarning,
)

__all__ = [
    "InputError",
    "ResultWarning",
]
