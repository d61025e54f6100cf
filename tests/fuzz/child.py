"""One case in a forked child, with a limit on time and on addresses: whatever comes of it, the run goes on."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vcc.errors import InputError

ADDRESSES = 3 * 2**30
"""Bytes of address space that a child may have."""

Outcome = dict[str, Any]
"""``kind``: opened, refused, leak, crash or hang; ``peak`` bytes of memory and ``seconds``; and what was said."""


def limited() -> None:
    """Limit the addresses of this process."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _outcome(work: Callable[[], Outcome]) -> Outcome:
    try:
        with warnings.catch_warnings(record=True):
            warnings.simplefilter("always")
            return {"kind": "opened", **work()}
    except InputError as error:
        cause = error.__cause__
        caught = cause is not None and "what should not be there" in str(error)
        said = {"kind": "refused", "message": str(error)[:300], "length": len(str(error))}
        return said | (
            {"type": type(cause).__name__, "where": _where(cause)} if cause is not None and caught else {}
        )
    except BaseException as error:  # all of it is what we look for
        said = {"kind": "leak", "message": str(error)[:300], "length": len(str(error))}
        return said | {"type": type(error).__name__, "where": _where(error)}


def _where(error: BaseException) -> str:
    """The last line of vcc in a traceback, which is where a fault is mended."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "/vcc/" in frame.filename]
    last = (ours or frames)[-1]
    return f"{'/'.join(Path(last.filename).parts[-2:])}:{last.lineno} {last.name}"


class Child:
    """A forked process that does some work; ``pipe`` is readable when it has something to say, and closes.

    Args:
        work: returns what is to be known of it.
        limit: whether its addresses are.
    """

    def __init__(self, work: Callable[[], Outcome], limit: bool = True) -> None:
        self.began, self._told = time.monotonic(), b""
        self.pipe, end = os.pipe()
        self._process = os.fork()
        if self._process == 0:
            with contextlib.suppress(BaseException):
                os.close(self.pipe)
                if limit:
                    limited()
                    with open(os.devnull, "r+b") as null:  # noqa: PTH123
                        for number in (0, 1, 2):
                            os.dup2(null.fileno(), number)
                os.write(end, json.dumps(_outcome(work)).encode()[:60000])
            os._exit(0)
        os.close(end)

    def hear(self) -> bool:
        """Read what the child has said; False if that was all."""
        heard = os.read(self.pipe, 65536)
        self._told += heard
        return bool(heard)

    def end(self, kill: bool = False) -> Outcome:
        """Wait for its end, or bring it about; returns what came of it."""
        if kill:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGKILL)
        _, status, usage = os.wait4(self._process, 0)
        os.close(self.pipe)
        used = {"seconds": time.monotonic() - self.began, "peak": usage.ru_maxrss * 1024}
        if kill:
            return {"kind": "hang"} | used
        if os.WIFSIGNALED(status):
            return {"kind": "crash", "type": signal.Signals(os.WTERMSIG(status)).name} | used
        try:
            return json.loads(self._told) | used
        except ValueError:
            return {"kind": "crash", "type": f"exit {os.WEXITSTATUS(status)} without a word"} | used


def alone(work: Callable[[], Outcome], limit: bool = True) -> Outcome:
    """What comes of work in a child, waited for."""
    child = Child(work, limit)
    while child.hear():
        pass
    return child.end()
