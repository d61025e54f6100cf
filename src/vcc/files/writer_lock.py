"""One writer of a thing at a time: another is told who is at it."""

from __future__ import annotations

import os
import platform
import threading
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from vcc.base.errors import InputError
from vcc.files.parts import DAY, lock_of

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

_locks: weakref.WeakValueDictionary[Path, WriterLock] = weakref.WeakValueDictionary()
"""Those of this process, by the file that stands for them."""
_turns: weakref.WeakValueDictionary[Path, Any] = weakref.WeakValueDictionary()
"""Locks for the threads of this process that write a thing as a whole, by the same file."""
_one_thread = threading.Lock()
"""Held while the above are looked at."""


class WriterLock:
    """The right to write to a path, until it is given back, forgotten or taken by a later one of this process.

    It is a lock on a file ``.NAME.lock`` beside the path, which says who holds it. The system lets go of it when
    the process ends, however that happens, and knows of those of other containers and, over NFS, other machines.
    Readers look at none of it. Where there are no such locks (Windows, some network disks, a folder that may not
    be written to beside the store), writers are not told of one another.

    Args:
        target: what is to be written.

    Raises:
        InputError: another process writes it; the message says which, as far as is known.
    """

    def __init__(self, target: Path) -> None:
        target = Path(os.path.realpath(target))
        self._file = lock_of(target)
        with _one_thread:
            earlier = _locks.pop(self._file, None)
            if earlier is not None:
                earlier.give_back()
            self._held = _locked(self._file, target)
            self._let_go = weakref.finalize(self, _let_go, self._held, self._file, os.getpid())
            _locks[self._file] = self

    @property
    def held(self) -> bool:
        """Whether it has not been given back or taken."""
        return self._let_go.alive

    @property
    def patience(self) -> float:
        """Seconds for which other machines' leftovers are let be: none where no other writer can be at work."""
        return DAY if self._held is None else 0.0

    def give_back(self) -> None:
        """Let others write."""
        self._let_go()


@contextmanager
def in_turn(target: Path) -> Iterator[None]:
    """Write a thing as a whole; other threads of this process that do so wait."""
    file = lock_of(Path(os.path.realpath(target)))
    with _one_thread:
        turn = _turns.setdefault(file, threading.RLock())
    with turn:
        yield


def _locked(file: Path, target: Path) -> int | None:
    """The open file that holds the lock, or None where there is none to be had."""
    if fcntl is None:
        return None
    while True:
        try:
            stream = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError:  # what is written next says so, where that cannot be written either
            return None
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(stream, 300).decode(errors="replace").strip()
            os.close(stream)
            raise InputError(
                f"{target} is being written by {owner or 'another process'}: wait for it, end it, or choose "
                "another name"
            ) from None
        except OSError:  # this disk has no locks
            os.close(stream)
            return None
        if _still(stream, file):
            with suppress(OSError):  # the disk is full; what is written next says so
                os.truncate(stream, 0)
                since = f"{datetime.now():%Y-%m-%d %H:%M:%S}"
                os.write(stream, f"process {os.getpid()} on {platform.node()} since {since}".encode())
            return stream
        os.close(stream)  # who held it removed it in the meantime


def _still(stream: int, file: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(stream), file.stat())
    except FileNotFoundError:
        return False


def _let_go(held: int | None, file: Path, process: int) -> None:
    if held is not None and process == os.getpid():  # a fork holds it for the process that it came from
        file.unlink(missing_ok=True)
        os.close(held)
