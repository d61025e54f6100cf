"""A lock per target: one writer at a time; other writers get an error that names the owner."""

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
"""The locks of this process, by lock file."""
_turns: weakref.WeakValueDictionary[Path, Any] = weakref.WeakValueDictionary()
"""Locks for threads of this process that write a whole target, by lock file."""
_one_thread = threading.Lock()
"""Held during access to the two dictionaries above."""


class WriterLock:
    """Exclusive lock on a path, until released, garbage collected or replaced by a later lock of this process.

    The lock is on a file ``.NAME.lock`` next to the path, which names the owner. The system releases it
    whenever the process ends, and it works across containers and, over NFS, machines. Readers ignore it. On
    systems without such locks (Windows, some network disks, a read-only folder), writers do not exclude each
    other.

    Args:
        target: the path to write.

    Raises:
        InputError: another process writes the path; the message names it if known.
    """

    def __init__(self, target: Path) -> None:
        target = Path(os.path.realpath(target))
        self._file, self._target = lock_of(target), target
        with _one_thread:
            earlier = _locks.pop(self._file, None)
            if earlier is not None:
                earlier.give_back()
            self._held = _locked(self._file, target)
            self._let_go = weakref.finalize(self, _let_go, self._held, self._file, os.getpid())
            _locks[self._file] = self

    @property
    def held(self) -> bool:
        """Whether the lock is still held."""
        return self._let_go.alive

    def check(self, maker: str) -> None:
        """Check that the lock is still held.

        Args:
            maker: function that makes a writer, for the error.

        Raises:
            InputError: it was released, or replaced by a later one.
        """
        if not self.held:
            raise InputError(
                f"this writer of {self._target} has ended: its with block is over, or another was made since. Use "
                f"that, or make one by {maker}"
            )

    @property
    def patience(self) -> float:
        """Seconds for which leftovers of other machines are kept: 0 if no other writer can be active."""
        return DAY if self._held is None else 0.0

    def give_back(self) -> None:
        """Release the lock."""
        self._let_go()


@contextmanager
def in_turn(target: Path) -> Iterator[None]:
    """Write a whole target; other threads of this process that do so wait."""
    file = lock_of(Path(os.path.realpath(target)))
    with _one_thread:
        turn = _turns.setdefault(file, threading.RLock())
    with turn:
        yield


def _locked(file: Path, target: Path) -> int | None:
    """The file descriptor that holds the lock; None if locks are not supported."""
    if fcntl is None:
        return None
    while True:
        try:
            stream = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError:  # the next write reports an inaccessible folder
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
            with suppress(OSError):  # the disk is full; the next write reports it
                os.truncate(stream, 0)
                since = f"{datetime.now():%Y-%m-%d %H:%M:%S}"
                os.write(stream, f"process {os.getpid()} on {platform.node()} since {since}".encode())
            return stream
        os.close(stream)  # the previous owner removed the file in the meantime


def _still(stream: int, file: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(stream), file.stat())
    except FileNotFoundError:
        return False


def _let_go(held: int | None, file: Path, process: int) -> None:
    if held is not None and process == os.getpid():  # after a fork, the lock belongs to the parent process
        file.unlink(missing_ok=True)
        os.close(held)
