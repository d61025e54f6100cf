"""Warnings about many images, issued once for each kind."""

from __future__ import annotations

import os
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from vcc.base.errors import ResultWarning, warn_of_result

Result = TypeVar("Result")

MANY_KINDS = 5
"""Largest number of kinds of warnings that are passed on."""
_collecting: list[tuple[int, Notices]] = []
"""Who collects now: threads, and their notices."""


def worked_elsewhere(work: Callable[[], Result], asking: int) -> tuple[Result, Notices]:
    """The result of a task and its warnings; without these in the process that asks, which collects its own.

    Args:
        work: called here.
        asking: number of the process that sent the task.
    """
    remarks = Notices()
    if os.getpid() == asking:
        return work(), remarks
    with remarks.gathered():
        return work(), remarks


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

    @property
    def texts(self) -> list[str]:
        """The first warning of each kind, sorted."""
        return sorted(self._first.values())

    @contextmanager
    def gathered(self) -> Iterator[None]:
        """Collect the warnings about results that are issued within the context.

        Warnings of a thread belong to the innermost context of that thread; those of threads without a context
        belong to the first context that was opened. Filters of warnings are those of the whole process: contexts
        of several threads need a context around all of them.
        """
        mine = (threading.get_ident(), self)
        with warnings.catch_warnings():
            shown = warnings.showwarning

            def hear(message: Any, category: type[Warning], *place: Any, **more: Any) -> None:
                if not issubclass(category, ResultWarning):
                    shown(message, category, *place, **more)
                elif _collecting:
                    own = [found for thread, found in _collecting if thread == threading.get_ident()]
                    (own[-1] if own else _collecting[0][1])._heard(str(message))

            warnings.simplefilter("always", ResultWarning)
            warnings.showwarning = hear  # restored by catch_warnings
            _collecting.append(mine)
            try:
                yield
            finally:
                _collecting.remove(mine)

    def _heard(self, said: str) -> None:
        kind = "".join(letter for letter in said if not letter.isdigit() and letter not in ".e-")
        self._kinds[kind] += 1
        self._first.setdefault(kind, said)
