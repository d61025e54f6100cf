"""Frozen data that is equal when its content is equal, arrays included: keys of caches, and names that last."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Hashable
from numbers import Number, Real
from typing import Any

import numpy as np

from vcc.base.describe import is_default, kind_in_words


class Value:
    """A base of frozen dataclasses (``eq=False``) whose fields may hold arrays: equal when all fields are.

    Functions of users, and whatever else tells nothing of its content, are equal to themselves only.
    """

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return type(self) is type(other) and content(self) == content(other)

    def __hash__(self) -> int:
        return hash(content(self))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_content"}  # it may hold identities


def content(thing: Any) -> Hashable:
    """What two things of equal content have in common: a key that is equal when they are.

    Args:
        thing: a number, a text, an array, a dataclass, or a tuple, list or dictionary of such. What is neither
            hashable nor any of these counts by its identity.
    """
    if isinstance(thing, np.ndarray):
        plain = np.ascontiguousarray(thing + 0 if thing.dtype.kind == "f" else thing)  # -0.0 equals 0.0
        digest = hashlib.sha256(plain.view(np.uint8).reshape(-1).data).digest()
        return ("array", str(thing.dtype), thing.shape, digest)
    if dataclasses.is_dataclass(thing) and not isinstance(thing, type):
        kept = vars(thing).get("_content")
        if kept is None:
            compared = (field.name for field in dataclasses.fields(thing) if field.compare)
            kept = (type(thing), tuple(content(getattr(thing, name)) for name in compared))
            if isinstance(thing, Value):  # frozen, arrays included by convention: what it is stays
                object.__setattr__(thing, "_content", kept)
        return kept
    if isinstance(thing, tuple | list):
        return (type(thing).__name__, tuple(content(part) for part in thing))
    if isinstance(thing, dict):
        return ("dict", tuple((key, content(part)) for key, part in thing.items()))
    try:
        hash(thing)
    except TypeError:
        return ("identity", id(thing))
    return thing if isinstance(thing, Number) else (type(thing), thing)  # 1 and 1.0 are equal


# --- a name for the content of a value: the same from run to run and from machine to machine for equal values ---


_DIGITS = 12
"""Of numbers: what libraries of two machines round differently is still the same."""
_LENGTH = 12
"""Hexadecimal digits: by chance, two of a million cameras agree once in 500 times."""


class Unhashable(Exception):
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
        raise Unhashable(f"a {kind_in_words(type(thing))}")
    if hasattr(thing, "compared"):
        return [type(thing).__name__, _plain(thing.compared())]
    compared = {each.name: getattr(thing, each.name) for each in dataclasses.fields(thing) if each.compare}
    defaults = [each.name for each in dataclasses.fields(thing) if is_default(getattr(thing, each.name), each)]
    return [type(thing).__name__, {name: _plain(compared[name]) for name in compared if name not in defaults}]
