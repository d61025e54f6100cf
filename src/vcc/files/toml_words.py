"""Values and messages in the syntax of camera files, TOML."""

from __future__ import annotations

import json
import re
from typing import Any

LONGEST_SHOWN = 60
"""Characters of a value that are shown in a message."""

_TRUTH = re.compile(r"\b([a-z]\w*)=(True|False)\b")
_QUANTITY = re.compile(r"\b([a-z]\w*)=(-?[\d.]+(?:e[-+]?\d+)?) \* ([a-z]+)\b")
_PAIRS = re.compile(r"\b([a-z]\w*)=(\([()\d.,e+\- ]*\))")
_NUMBER = re.compile(r"\b([a-z]\w*)=(-?\d[\d.]*(?:e[-+]?\d+)?)(?![\w*])")


def in_toml(value: Any) -> str:
    """A value that TOML can hold, as TOML writes it on one line; no longer than `LONGEST_SHOWN`.

    Args:
        value: text, a number, a truth value, a date, a list or a table of such.
    """
    words = _written(value)
    return words if len(words) <= LONGEST_SHOWN else f"{words[:LONGEST_SHOWN]}…"


def as_toml(message: str) -> str:
    """A message of the library in the syntax of TOML: ``normalise=True`` is ``normalise = true`` there.

    Args:
        message: with ways out as Python writes them: ``width=30 * mm``, ``pitch=1e-3``, ``offset=(0, 1)``.
    """
    message = _TRUTH.sub(lambda found: f"{found[1]} = {found[2].lower()}", message)
    message = _QUANTITY.sub(r'\1 = "\2 \3"', message)
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
