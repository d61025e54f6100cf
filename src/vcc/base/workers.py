"""Threads that share work, and stop on interrupts."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any, Literal, TypeVar

import numpy as np

Result = TypeVar("Result")


class Workers(ThreadPoolExecutor):
    """A pool of threads. An error ends the work: tasks that have not started are cancelled.

    A pool of one thread runs in the thread that creates it, unless that is Python's main thread, which handles
    Ctrl-C: handing work over and waiting for it would cost two switches of the GIL.

    After Ctrl-C the pool does not wait for running tasks, which are short, or cannot be interrupted because they
    are compiled.

    Attributes:
        threads: number of threads.
        ended: (1,), True if the work has ended early: polled by long compiled loops.
    """

    def __init__(self, threads: int) -> None:
        super().__init__(threads)
        self.threads, self.ended = threads, np.zeros(1, dtype=np.bool_)
        self._is_this_thread = threads == 1 and threading.current_thread() is not threading.main_thread()

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


def program_ends() -> bool:
    """Whether Python is shutting down: from then on no pool of threads accepts work, which is a `RuntimeError`."""
    with ThreadPoolExecutor(1) as pool:
        try:
            pool.submit(int)
        except RuntimeError:
            return True
    return False


def uninterrupted(work: Callable[..., Result], /, *given: Any) -> Result:
    """Return the result of work in a separate thread, which is not interrupted; this thread waits.

    Python handles Ctrl-C and other signals only in its main thread. So their exceptions are never raised inside
    a library that continues in threads of its own (Zarr): the interrupted work has finished when the exception is
    raised here.

    Args:
        work: called with the arguments.
        given: the arguments.

    Raises:
        BaseException: an exception of the work, or, after the work, one that was raised here in the meantime.
    """
    with Workers(1) as worker:
        try:
            done: Future[Result] = worker.submit(work, *given)
            return done.result()
        except BaseException:
            worker.shutdown()
            raise
