"""Messages of the library in the language of the page: names as in its fields, quantities as they are typed."""

import re

from vcc.base import units
from vcc.files.toml_words import as_toml

_UNIT = f"(?:{'|'.join(units.NAMES)})"
_QUANTITY = re.compile(rf'"([-+]?[\d.]+(?:e[-+]?\d+)? ?{_UNIT})"')
_LIST = re.compile(rf"\[([^\[\]\"]*\d {_UNIT})\]")
_NAME = re.compile(r"\"[^\"]*\"|\b[a-z]+(?:_[a-z]+)+\b(?!\()")
_IN_FILES = re.compile(r",? (?:written as text|in quotes)\b")
_MICRO = re.compile(r"\bu([ms])(\d?)\b")


def page_words(message: str) -> str:
    """A message for the page: "such as 550 * nm" becomes "such as 550 nm", ``focal_length`` "focal length".

    Text in quotes stays, except for quantities.

    Args:
        message: with the syntax of Python or of camera files.
    """
    message = _LIST.sub(r"\1", _QUANTITY.sub(r"\1", _IN_FILES.sub("", as_toml(message))))
    message = _NAME.sub(lambda found: found[0] if found[0][0] == '"' else found[0].replace("_", " "), message)
    return _MICRO.sub(r"µ\1\2", message)
