"""Lists as text."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice


def first_few(items: Iterable[object], count: int, most: int = 12) -> str:
    """The first few items as text, with a sign if there are more: "(0, 1), (2, 3), …".

    Args:
        items: any; only as many are consumed as are listed.
        count: number of items.
        most: largest number of items to list.
    """
    return ", ".join(map(str, islice(items, most))) + (", …" if count > most else "")
