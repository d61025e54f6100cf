"""Warnings about many images, issued once for each kind."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from vcc.base.errors import ResultWarning, warn_of_result

MANY_KINDS = 5
"""Largest number of kinds of warnings that are passed on."""


class Notices:
    """Warnings collected while images are made."""

    def __init__(self) -> None:
        self._kinds, self._first = Counter[str](), dict[str, str]()

    def say(self, total: int, of: str) -> None:
        """Issue the collected warnings.

        Args:
            total: number of images.
            of: what the images are counted by, such as "cameras".
        """
        for kind, count in self._kinds.most_common(MANY_KINDS):
            share = f"{count} of {total} {of}, one of them: " if total > 1 else ""
            warn_of_result(f"{share}{self._first[kind]}")

    def add(self, other: Notices) -> None:
        """Add warnings collected elsewhere."""
        self._kinds += other._kinds
        self._first = {**other._first, **self._first}

    @contextmanager
    def gathered(self) -> Iterator[None]:
        """Collect the warnings issued within the context."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ResultWarning)
            yield
        for each in caught:
            said = str(each.message)
            if not issubclass(each.category, ResultWarning):
                warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
                continue
            kind = "".join(letter for letter in said if not letter.isdigit() and letter not in ".e-")
            self._kinds[kind] += 1
            self._first.setdefault(kind, said)
