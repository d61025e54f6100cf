"""Threads that share work, and let go of it when somebody interrupts."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any, Literal, TypeVar

import numpy as np

Result = TypeVar("Result")

_this_thread = threading.local()


def _begin() -> None:
    _this_thread.works = True


class Workers(ThreadPoolExecutor):
    """A pool of threads. What goes wrong ends the work: what has not begun does not begin.

    A pool of one thread that a thread of another pool asks for is that thread itself: to hand work over and wait
    for it would cost a turn each of the lock that all threads of Python share.

    After Ctrl-C nobody waits for the pieces at work, which are short, or, where code is compiled, cannot be broken
    off.

    Attributes:
        threads: how many there are.
        ended: (1,), True once the work has ended early: for compiled loops that take long, which look at it.
    """

    def __init__(self, threads: int) -> None:
        super().__init__(threads, initializer=_begin)
        self.threads, self.ended = threads, np.zeros(1, dtype=np.bool_)
        self._is_this_thread = threads == 1 and getattr(_this_thread, "works", False)

    def submit(self, function: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        """See `concurrent.futures.Executor.submit`."""
        if not self._is_this_thread:
            return super().submit(function, *args, **options)
        done: Future[Any] = Future()
        try:
            done.set_result(function(*args, **options))
        except Exception as error:
            done.set_exception(error)
        return done

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> Literal[False]:
        self.ended[0] = kind is not None
        interrupted = kind is not None and not issubclass(kind, Exception)
        self.shutdown(wait=not interrupted, cancel_futures=kind is not None)
        return False


def uninterrupted(
    work: Callable[..., Result], /, *given: Any, end: Callable[[BaseException], object] | None = None
) -> Result:
    """What some work returns, done in a thread of its own, where nothing interrupts; this one waits.

    Python handles Ctrl-C and other signals in its main thread alone. So what they raise never arrives in the midst
    of a library that drops it (h5py) or that goes on in threads of its own (Zarr): what was interrupted is over
    when it is raised here.

    Args:
        work: called with what is given.
        given: to it.
        end: called with what is raised here meanwhile, so that long work ends early.

    Raises:
        BaseException: what the work raises, or, once it is over, what was raised here meanwhile.
    """
    with Workers(1) as worker:
        try:
            done: Future[Result] = worker.submit(work, *given)
            return done.result()
        except BaseException as error:
            if end is not None:
                end(error)
            worker.shutdown()
            raise
