"""Properties that are computed once.

`functools.cached_property` of Python 3.11 holds one lock for all objects of a class while it computes. Threads
that plan two cameras would wait for each other, and two benches that run alternately would deadlock: one holds the
lock and waits for its turn, the other has its turn and waits for the lock.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

Owner = TypeVar("Owner")
Value = TypeVar("Value")


def cached(compute: Callable[[Owner], Value]) -> Callable[[Owner], Value]:
    """Compute a property once for each object, and store it with the object.

    Written below ``@property``, so that type checkers and the API reference recognise the property.

    Threads that read the same property concurrently may each compute it; later reads return one of their values.

    Args:
        compute: returns the value, which must not depend on anything that changes.
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
    """Set values of an object's cached properties that are already known.

    Args:
        owner: the object.
        **values: by the names of the properties.
    """
    vars(owner).update(values)


def is_computed(owner: object, name: str) -> bool:
    """Whether a cached property of an object has been computed, or preset."""
    return name in vars(owner)
