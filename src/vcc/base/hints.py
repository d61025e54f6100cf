"""Hints for names that do not exist: what a user probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any, NoReturn


def no_such_name(module: str, name: str, known: Iterable[str], instead: Mapping[str, str]) -> AttributeError:
    """The error of a module without an attribute, with the names that come closest.

    Args:
        module: its full name.
        name: of the attribute.
        known: all public names of the module.
        instead: other words, in lower case, and what to write for each.
    """
    words = f"module {module!r} has no attribute {name!r}"
    written = instead.get(name.lower())
    if written is None:
        by_lower = {each.lower(): each for each in known}
        written = " or ".join(
            by_lower[each] for each in difflib.get_close_matches(name.lower(), by_lower, 2, 0.75)
        )
    return AttributeError(f"{words}. Did you mean {written}?" if written else words)


class NoSuchMember:
    """A class attribute that does not exist: raises `AttributeError` that says what to write.

    Args:
        instead: what to write.
    """

    def __init__(self, instead: str) -> None:
        self.instead = instead

    def __set_name__(self, owner: type, name: str) -> None:
        """Remember the name."""
        self.name = name

    def __get__(self, instance: Any, owner: type) -> NoReturn:
        """Raise.

        Raises:
            AttributeError: always.
        """
        raise AttributeError(f"{owner.__name__} has no attribute {self.name!r}: write {self.instead}")
