"""A name for the content of a value: the same from run to run and from machine to machine for equal values."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from numbers import Real
from typing import Any

import numpy as np

from vcc.base.describe import is_default, kind_in_words

_DIGITS = 12
"""Of numbers: what libraries of two machines round differently is still the same."""
_LENGTH = 12
"""Hexadecimal digits: by chance, two of a million cameras agree once in 500 times."""


class Untold(Exception):
    """Something that tells nothing of its content, a Python function for instance; the message says what."""


def fingerprint(*parts: Any) -> str:
    """12 hexadecimal digits of SHA-256 that are the same for equal parts, and differ (but for chance) for others.

    Args:
        parts: numbers, texts, arrays, dataclasses, and tuples, lists or dictionaries of such. A dataclass counts
            by the name of its class and those fields that it is compared by and that are not at their defaults
            (so that a field which a later version adds changes nothing), or by what its method ``compared``
            returns.

    Raises:
        Untold: anything else.
    """
    plain = json.dumps([_plain(part) for part in parts], sort_keys=True, allow_nan=True)
    return hashlib.sha256(plain.encode()).hexdigest()[:_LENGTH]


def _plain(thing: Any) -> Any:
    """What JSON can hold of a thing."""
    if thing is None or isinstance(thing, str):
        return thing
    if isinstance(thing, Real | np.bool_):
        number = float(thing)
        return f"{number + 0.0:.{_DIGITS}g}" if math.isfinite(number) else str(number)
    if isinstance(thing, np.ndarray) and thing.dtype.kind in "biuf":
        values = np.ascontiguousarray(thing, dtype="<f8") + 0.0  # −0 is 0
        return ["array", list(values.shape), hashlib.sha256(values.data).hexdigest()]
    if isinstance(thing, tuple | list):
        return [_plain(part) for part in thing]
    if isinstance(thing, dict) and all(isinstance(key, str) for key in thing):
        return {key: _plain(part) for key, part in thing.items()}
    if isinstance(thing, type) or not (dataclasses.is_dataclass(thing) or hasattr(thing, "compared")):
        raise Untold(f"a {kind_in_words(type(thing))}")
    if hasattr(thing, "compared"):
        return [type(thing).__name__, _plain(thing.compared())]
    compared = {each.name: getattr(thing, each.name) for each in dataclasses.fields(thing) if each.compare}
    defaults = [each.name for each in dataclasses.fields(thing) if is_default(getattr(thing, each.name), each)]
    return [type(thing).__name__, {name: _plain(compared[name]) for name in compared if name not in defaults}]
