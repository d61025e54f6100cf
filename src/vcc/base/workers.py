"""Threads that share work, and let go of it when somebody interrupts."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Literal

import numpy as np


class Workers(ThreadPoolExecutor):
    """A pool of threads. What goes wrong ends the work: what has not begun does not begin.

    After Ctrl-C nobody waits for the pieces at work, which are short, or, where code is compiled, cannot be broken
    off.

    Attributes:
        ended: (1,), True once the work has ended early: for compiled loops that take long, which look at it.
    """

    def __init__(self, threads: int) -> None:
        super().__init__(threads)
        self.ended = np.zeros(1, dtype=np.bool_)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> Literal[False]:
        self.ended[0] = kind is not None
        interrupted = kind is not None and not issubclass(kind, Exception)
        self.shutdown(wait=not interrupted, cancel_futures=kind is not None)
        return False
