"""Properties that are computed once.

`functools.cached_property` of Python 3.11 holds one lock for all objects of a class while it computes. Threads
that plan two cameras would wait for each other, and two benches that take turns would wait for ever: one holds the
lock and waits for its turn, the other has its turn and waits for the lock.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

Owner = TypeVar("Owner")
Value = TypeVar("Value")


def cached(compute: Callable[[Owner], Value]) -> Callable[[Owner], Value]:
    """Compute a property once for each object, and keep it with the object.

    Written below ``@property``, by which type checkers and the pages of the API know it for one.

    Threads that ask for the same object's value at one time may each compute it; all that ask later get one of
    them.

    Args:
        compute: gives the value; it depends on nothing that changes.
    """
    name = compute.__name__

    @wraps(compute)
    def value(self: Owner) -> Value:
        kept = self.__dict__
        if name not in kept:
            kept[name] = compute(self)
        found: Value = kept[name]
        return found

    return value


def preset(owner: object, **values: Any) -> None:
    """Give an object values of its cached properties that are known already.

    Args:
        owner: the object.
        **values: by the names of the properties.
    """
    vars(owner).update(values)


def is_computed(owner: object, name: str) -> bool:
    """Whether a cached property of an object has been computed, or preset."""
    return name in vars(owner)
