"""Frozen data that is compared by content, arrays included: keys of caches, and permanent names."""

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
    """Base of frozen dataclasses (``eq=False``) whose fields may hold arrays: equal if all fields are equal.

    User functions, and other objects without comparable content, are equal to themselves only.
    """

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return type(self) is type(other) and content(self) == content(other)

    def __hash__(self) -> int:
        return hash(content(self))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_content"}  # it may contain ids


def content(thing: Any) -> Hashable:
    """A hashable key of an object's content: equal keys for equal content.

    Args:
        thing: a number, a text, an array, a dataclass, or a tuple, list or dictionary of these. Other objects that
            are not hashable are compared by identity.
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
            if isinstance(thing, Value):  # frozen, arrays included by convention: the content does not change
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


def has_identity(key: Hashable) -> bool:
    """Whether a key from `content` contains an object that is compared by identity, for instance a function."""
    if isinstance(key, tuple):
        return key[:1] == ("identity",) or any(map(has_identity, key))
    return not (key is None or isinstance(key, Number | str | bytes | type))


# --- a name for the content of a value: for equal values the same in all runs and on all machines ---


_DIGITS = 12
"""Digits of numbers: differences of rounding between the libraries of two machines are ignored."""
_LENGTH = 12
"""Hexadecimal digits: among a million cameras, the probability of a collision is 1 in 500."""


class Unhashable(Exception):
    """An object has no comparable content, for instance a Python function; the message names it."""


def fingerprint(*parts: Any) -> str:
    """12 hexadecimal digits of SHA-256, the same for equal parts and different for others (except by chance).

    Args:
        parts: numbers, texts, arrays, dataclasses, and tuples, lists or dictionaries of these. The key of a
            dataclass is the name of its class and its compared fields that are not at their defaults (so that a
            field added by a later version changes nothing), or the result of its method ``compared``.

    Raises:
        Unhashable: an object of another type.
    """
    plain = json.dumps([_plain(part) for part in parts], sort_keys=True, allow_nan=True)
    return hashlib.sha256(plain.encode()).hexdigest()[:_LENGTH]


def _plain(thing: Any) -> Any:
    """A representation of an object that JSON supports."""
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
