"""Values and messages in TOML, the syntax of camera files."""

from __future__ import annotations

import json
import re
from typing import Any

LONGEST_SHOWN = 60
"""Maximum number of characters of a value in a message."""

_TRUTH = re.compile(r"\b([a-z]\w*)=(True|False)\b")
_QUANTITY = re.compile(r"\b([a-z]\w*)=(-?[\d.]+(?:e[-+]?\d+)?) \* ([a-z]+)\b")
_BARE = re.compile(r"(?<![\w=.*])(-?\d[\d.]*(?:e[-+]?\d+)?) \* ([a-z]+)\b")
_SI = re.compile(r",? in (?:metres|radians|seconds)\b")
_PAIRS = re.compile(r"\b([a-z]\w*)=(\([()\d.,e+\- ]*\))")
_NUMBER = re.compile(r"\b([a-z]\w*)=(-?\d[\d.]*(?:e[-+]?\d+)?)(?![\w*])")


def in_toml(value: Any) -> str:
    """A value on one line as TOML writes it, cut to `LONGEST_SHOWN` characters.

    Args:
        value: text, a number, a boolean, a date, a list or a table of these.
    """
    words = _written(value)
    return words if len(words) <= LONGEST_SHOWN else f"{words[:LONGEST_SHOWN]}…"


def as_toml(message: str) -> str:
    """Convert a message of the library to TOML syntax: ``normalise=True`` becomes ``normalise = true``.

    Quantities in TOML carry their units: "in metres" is left out.

    Args:
        message: a message with Python arguments: ``width=30 * mm``, ``pitch=1e-3``, ``offset=(0, 1)``, or
            quantities: ``550 * nm``.
    """
    message = _TRUTH.sub(lambda found: f"{found[1]} = {found[2].lower()}", message)
    message = _QUANTITY.sub(r'\1 = "\2 \3"', message)
    message = _SI.sub("", _BARE.sub(r'"\1 \2"', message))
    message = _PAIRS.sub(lambda found: f"{found[1]} = {found[2].replace('(', '[').replace(')', ']')}", message)
    return _NUMBER.sub(r"\1 = \2", message)


def _written(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list):
        return f"[{', '.join(map(_written, value))}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_written(each)}' for key, each in value.items())} }}" if value else "{}"
    return str(value)  # numbers, dates and times are written alike
