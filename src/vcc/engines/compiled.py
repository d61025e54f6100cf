"""Functions compiled by Numba, cached on disk. They also work if they cannot be cached.

Numba caches machine code next to the source, in the home folder, or in ``NUMBA_CACHE_DIR``. It fails if it can
write to none of them, or if the cached files are damaged. Here the code is then read from the same places
without being cached (a container image may include it), and else compiled by each process.

The index of a cache and the code are separate files. Processes that start together and write both at once have
crashed programs (numba issues 4807 and 10128): here they write one after the other, under a lock.

Numba invalidates cached code when the function's own file changes. Functions, constants and types from other
files are compiled into the same code: here the stamp covers every file of this package that the function's file
imports, directly or indirectly.
"""

from __future__ import annotations

import functools
import gc
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
from numba import config, njit
from numba.core.caching import FunctionCache
from numba.core.sigutils import normalize_signature

from vcc.base.errors import CacheWarning

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

TURN = ".vcc.lock"
"""Name of the lock file in a cache folder."""
PATIENCE = 5.0
"""Seconds after which a process stops waiting for the lock: on some network disks locks do not work."""

_IMPORTED = re.compile(
    rb"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]*(\([^)]*\)|[^\n]*)|import[ \t]+([^\n]*))", re.MULTILINE
)
"""Import statements: a module and names from it, or modules."""

SAMPLES = tuple(map(np.dtype, ("uint8", "uint16", "int16", "float32")))
"""Types of samples that loops read without conversion: those of stored light fields and of sharpened bytes."""


def read_as(kind: np.dtype[Any]) -> np.dtype[Any]:
    """The type in which compiled loops read samples of a type: float32 unless it is in `SAMPLES`.

    Numba does not support half precision. Double precision and 32-bit integers would gain no digits, since loops
    sum in single precision, and each type takes seconds to compile.
    """
    return kind if kind in SAMPLES else np.dtype(np.float32)


def compiled(borrowing: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """A decorator that compiles a function at its first call, with `numba.njit`'s options.

    Args:
        borrowing: the function makes no arrays, and counts no references to its arguments. Functions called with
            tuples of arrays for each pixel spent half of their time counting, with all threads taking turns.
        options: of `numba.njit`.
    """

    def made(function: Callable[..., Any]) -> Any:
        # No wrapper for C is compiled, which saves a tenth of the time.
        dispatcher = njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, _nrt=not borrowing, **options)(
            function
        )
        dispatcher._cache = _Kept(function)  # as dispatcher.enable_caching() does
        if not config.DISABLE_JIT:  # else, as in the simulator of GPUs, the function stays as it is
            dispatcher._compiler.compile = _without_collection(dispatcher._compiler.compile)
        return dispatcher

    return made


def _without_collection(compile_: Callable[..., Any]) -> Callable[..., Any]:
    """The same function, with Python's garbage collection off while it runs.

    Compiling makes millions of small objects and hardly any garbage: looking for it took an eighth of the time.
    """

    @functools.wraps(compile_)
    def quiet(*given: Any) -> Any:
        enabled = gc.isenabled()
        gc.disable()
        try:
            return compile_(*given)
        finally:
            if enabled:
                gc.enable()

    return quiet


def _only_read(locator: Any) -> Any:
    """One of Numba's cache locators, for a folder that is not writable."""
    return type(locator.__name__, (locator,), {"ensure_cache_path": lambda self: None})


_Places: Any = FunctionCache._impl_class


class _ReadableToo(_Places):  # type: ignore[misc]
    """The cache location: the first of Numba's places that is writable, or else one that is readable."""

    _locator_classes = (*_Places._locator_classes, *map(_only_read, _Places._locator_classes))


class _Kept(FunctionCache):  # type: ignore[misc]
    """The code of a function on disk; if it cannot be read or written, the function works all the same."""

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
        except Exception:  # truncated or damaged: compile again
            self._start_anew()
            return None
        # Without locks, two processes that write at the same time may give two files one name.
        fits = found is not None and tuple(found.signature.args) == tuple(normalize_signature(sig)[0])
        return found if fits else None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Cache the code for arguments of these types, or warn that it cannot be cached."""
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
    """A digest of all files of this package that may be compiled into a module's functions."""
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
            except OSError:  # an imported name that is not a module, or a package
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
    """The digest of a file, and full names of its imports; read again if the file has changed."""
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
    """Hold the lock of a folder, so that no other process reads or writes code there, if locks work."""
    stream = _turn(Path(folder) / TURN)
    try:
        yield
    finally:
        if stream is not None:
            os.close(stream)  # releases the lock


def _turn(file: Path) -> int | None:
    """The open lock file, locked; None if it cannot be locked."""
    if fcntl is None:
        return None
    try:
        stream = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError:  # the folder does not exist yet, or is not writable
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


# --- the decorators of this package's loops: those of rays make no arrays ---

_ORDERED = {"contract", "nsz"}
_FAST = {*_ORDERED, "reassoc"}
"""Sums may be reordered, so that they vectorise; NaN and infinity keep their meaning."""

ordered_loop = compiled(fastmath=_ORDERED)
fast_loop = compiled(fastmath=_FAST)
fast_inlined = compiled(fastmath=_FAST, inline="always")
ray_loop = compiled(borrowing=True, fastmath=_ORDERED)
ray_inlined = compiled(borrowing=True, fastmath=_ORDERED, inline="always")
ray_inner = compiled(borrowing=True, no_cpython_wrapper=True, fastmath=_ORDERED)
"""Called by compiled code only: no wrapper for Python is compiled."""
ray_back = compiled(borrowing=True, fastmath=_FAST)
ray_back_inlined = compiled(borrowing=True, fastmath=_FAST, inline="always")
