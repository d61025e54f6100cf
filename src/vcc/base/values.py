"""Frozen data that is equal when its content is equal, arrays included, and can be a key of a cache."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Hashable
from numbers import Number
from typing import Any

import numpy as np


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
