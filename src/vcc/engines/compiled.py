"""Functions compiled by Numba. Their machine code is kept on disk; they work where it cannot be kept, too.

Numba keeps code beside the source, or under the home folder, or where ``NUMBA_CACHE_DIR`` says, and fails where it
can write to none of them, or where what it finds there is damaged. Here code is then read from the same places
without being kept (a container's image may bring it along), and else compiled by each process.

An index of what there is and the code itself are two files, and many processes that begin at once would write both
in each other's way, which has crashed programs (numba issues 4807 and 10128): they take turns.

Numba stamps kept code by the file that its function stands in. Functions that it calls, constants and types of
other files are compiled into the same code: here the stamp covers every file of ours from which the function's
file imports, and those from which these import.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numba.core.caching import FunctionCache
from numba.core.sigutils import normalize_signature

from vcc.base.errors import CacheWarning

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

TURN = ".vcc.lock"
"""The file in a folder of code that says whose turn it is."""
PATIENCE = 5.0
"""Seconds after which nobody waits for a turn any more: some network disks have no locks that work."""

_IMPORTED = re.compile(
    rb"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]*(\([^)]*\)|[^\n]*)|import[ \t]+([^\n]*))", re.MULTILINE
)
"""Import statements: a module and names from it, or modules."""

SAMPLES = tuple(map(np.dtype, ("uint8", "uint16", "int16", "float32")))
"""Types of samples that loops read as they are: in which light fields are kept, and what is made of 8 bits."""


def read_as(kind: np.dtype[Any]) -> np.dtype[Any]:
    """The type in which compiled loops read samples of a type: float32 for all that are not among `SAMPLES`.

    Half precision is unknown to them; of double precision and 32 bits they would keep no more digits, since they
    add up in single precision, and each type takes seconds to compile.
    """
    return kind if kind in SAMPLES else np.dtype(np.float32)


def compiled(borrowing: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """What makes a function a compiled one, with `numba.njit`'s options; it is compiled when first called.

    Args:
        borrowing: it makes no arrays, and counts no references to those that its callers hold. Functions that were
            given tuples of arrays for each pixel spent half of their time counting, in all threads alternately.
        options: of `numba.njit`.
    """

    def made(function: Callable[..., Any]) -> Any:
        # No way for C to call it is compiled, which takes a tenth of the time.
        dispatcher = njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, _nrt=not borrowing, **options)(
            function
        )
        dispatcher._cache = _Kept(function)  # as dispatcher.enable_caching() does
        return dispatcher

    return made


def _only_read(locator: Any) -> Any:
    """A way of Numba's to find the folder of a function's code, for a folder that cannot be written to."""
    return type(locator.__name__, (locator,), {"ensure_cache_path": lambda self: None})


_Places: Any = FunctionCache._impl_class


class _ReadableToo(_Places):  # type: ignore[misc]
    """Where code is kept: in the first of Numba's places that can be written to, or else where it may be read."""

    _locator_classes = (*_Places._locator_classes, *map(_only_read, _Places._locator_classes))


class _Kept(FunctionCache):  # type: ignore[misc]
    """The code of a function on disk: where it cannot be read or kept, the function works all the same."""

    _impl_class = _ReadableToo

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        own, others = self._cache_file._source_stamp, _sources(function.__module__, function.__code__.co_filename)
        self._cache_file._source_stamp = (own, others)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code for arguments of these types, or None."""
        try:
            with _in_turn(self.cache_path):
                found = super().load_overload(sig, target_context)
        except Exception:  # cut off or damaged: compiled again
            self._start_anew()
            return None
        # Where there are no locks, two processes that keep code at once may give two files one name.
        fits = found is not None and tuple(found.signature.args) == tuple(normalize_signature(sig)[0])
        return found if fits else None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for arguments of these types, or say that it is not kept."""
        try:
            with _in_turn(self.cache_path):
                super().save_overload(sig, data)
        except OSError as error:
            _say_once(self.cache_path, error)

    def _start_anew(self) -> None:
        try:
            with _in_turn(self.cache_path):
                self.flush()
        except OSError as error:
            _say_once(self.cache_path, error)


def _sources(module: str, file: str) -> str:
    """A digest of all files of ours that may be compiled into a module's functions."""
    ours = {
        module.partition(".")[0]: Path(file).parents[module.count(".")],
        __name__.partition(".")[0]: Path(__file__).parents[__name__.count(".")],
    }
    found: dict[str, bytes] = {}
    ahead = [module]
    while ahead:
        name = ahead.pop()
        if name in found or (folder := ours.get(name.partition(".")[0])) is None:
            continue
        place = folder.joinpath(*name.split("."))
        for source in (place.with_suffix(".py"), place / "__init__.py"):
            try:
                status = source.stat()
            except OSError:  # what is imported is no module, or a package
                continue
            found[name], imported = _read(source, status.st_mtime_ns, status.st_size)
            ahead += imported
            break
    together = hashlib.sha256()
    for name in sorted(found):
        together.update(name.encode() + found[name])
    return together.hexdigest()


@functools.cache
def _read(source: Path, changed: int, size: int) -> tuple[bytes, tuple[str, ...]]:
    """The digest of a file, and full names of what it imports; read again where it has changed."""
    text = source.read_bytes()
    statements = re.sub(rb"#[^\n]*", b"", text)
    names: list[str] = []
    for origin, some, modules in _IMPORTED.findall(statements):
        parts = [
            part.split()[0].decode() for part in (some or modules).strip(b"()\r\n ").split(b",") if part.split()
        ]
        names += [origin.decode(), *(f"{origin.decode()}.{part}" for part in parts)] if origin else parts
    return hashlib.sha256(text).digest(), tuple(names)


@contextmanager
def _in_turn(folder: str) -> Iterator[None]:
    """While no other process reads or keeps code in a folder, as far as the system can tell."""
    stream = _turn(Path(folder) / TURN)
    try:
        yield
    finally:
        if stream is not None:
            os.close(stream)  # which lets go of the lock


def _turn(file: Path) -> int | None:
    """The open file that says that it is this process's turn; None where there is no telling."""
    if fcntl is None:
        return None
    try:
        stream = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError:  # no such folder yet, or one that nobody writes to
        return None
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(0.005)
        except OSError:
            break
        else:
            return stream
    os.close(stream)
    return None


_said: list[str] = []


def _say_once(folder: str, error: OSError) -> None:
    if _said:
        return
    _said.append(folder)
    setting = os.environ.get("NUMBA_CACHE_DIR")
    warnings.warn(
        f"compiled code cannot be kept in {setting or folder} ({error.strerror or error}): results are the same, "
        "but each process compiles again what it needs, which takes up to half a minute. Let the environment "
        "variable NUMBA_CACHE_DIR name a folder that can be written to",
        CacheWarning,
        stacklevel=2,
    )
