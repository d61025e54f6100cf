"""Hints for names that do not exist: suggestions of the intended name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any, NoReturn


def no_such_name(module: str, name: str, known: Iterable[str], instead: Mapping[str, str]) -> AttributeError:
    """The error for a missing attribute of a module, with the closest names.

    Args:
        module: its full name.
        name: of the attribute.
        known: all public names of the module.
        instead: other names, in lower case, and the replacement of each.
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
    """A class attribute that does not exist: raises `AttributeError` with its replacement.

    Args:
        instead: the replacement.
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
