"""Lists in words."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice


def first_few(items: Iterable[object], count: int, most: int = 12) -> str:
    """The first of some things, and a sign where there are more: "(0, 1), (2, 3), …".

    Args:
        items: the things; no more of them are taken than are named.
        count: how many there are.
        most: how many are named.
    """
    return ", ".join(map(str, islice(items, most))) + (", …" if count > most else "")
