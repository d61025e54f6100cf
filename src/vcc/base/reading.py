"""Safe reading of files from other sources: every fault of a file becomes an `InputError`.

Every public reader reads within `reading`, and first passes what it opens to `check_file`: reading a pipe
without a writer would block, and a device has no end.
"""

from __future__ import annotations

import gzip
import json
import math
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

from vcc.base.errors import InputError
from vcc.base.progress import ENDS_WORK

LONGEST_MESSAGE = 600
"""Maximum number of characters of an error: it quotes contents of files, which may have any length."""
MOST_UNPACKED = 2**26
"""Bytes to which a packed text or image may always unpack, for any packed size."""
MOST_TIMES_PACKED = 100
"""Largest ratio of unpacked to packed size above that; texts and images usually have 2 to 20."""

_FAULTS_OF_PROGRAMS = (AssertionError, ImportError, NameError)

_SPECIAL = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


@contextmanager
def reading(path: str | PathLike[str], what: str) -> Iterator[None]:
    """Context for reading files from other sources: any exception becomes an error that names the file.

    Exceptions that cannot come from a file are passed on: assertions of this package, missing names and packages,
    warnings that are raised, and exceptions of a `Progress`. The original exception is the ``__cause__`` of the
    error.

    Args:
        path: the file or folder.
        what: kind of the contents, such as "a light field".

    Raises:
        InputError: as raised within, with the name of the file added if missing, at most `LONGEST_MESSAGE`
            long; or instead of any other exception.
    """
    try:
        yield
    except InputError as error:
        error.args = (shown(_named(str(error), path)),)
        raise
    except (*_FAULTS_OF_PROGRAMS, Warning):
        raise
    except Exception as error:  # each library has its own types for a damaged file
        if hasattr(error, ENDS_WORK):
            raise
        raise InputError(shown(f"{os.fspath(path)} cannot be read as {what}: {in_words(error)}")) from error


def _named(said: str, path: str | PathLike[str]) -> str:
    return said if Path(path).name in said else f"{os.fspath(path)}: {said}"


def shown(text: str, most: int = LONGEST_MESSAGE) -> str:
    """A text safe for display: control characters as their codes, the middle of a long text omitted.

    Args:
        text: any.
        most: maximum number of characters of the result.
    """

    def plain(part: str) -> str:
        return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in part)

    if len(text) <= most and len(whole := plain(text)) <= most:
        return whole
    first, last = plain(text[:most]), plain(text[-most:])
    head = most * 2 // 3
    return f"{first[:head]} … {last[head + 3 - most :]}"


def in_words(error: BaseException) -> str:
    """An exception as text, for readers without knowledge of Python."""
    said = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        return "it needs more memory than there is" + (f" ({said})" if said else "")
    if isinstance(error, RecursionError):
        return "what it holds is nested too deeply"
    if isinstance(error, UnicodeError):
        return f"it is not text in UTF-8 ({said})"
    if isinstance(error, PermissionError):
        return f"there is no permission to read {error.filename or 'it'}"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror + (f": {error.filename}" if error.filename else "")
    reason = f"{type(error).__name__}: {said}" if said else type(error).__name__
    return f"it is truncated, damaged or holds what should not be there ({reason})"


def expanded(path: str | PathLike[str]) -> Path:
    """A path with ``~`` and ``~user`` replaced.

    Raises:
        InputError: neither text nor a path; an unknown user, or a NUL character.
    """
    if not isinstance(path, str | PathLike):
        raise InputError(f"the name of a file or folder is text or a pathlib.Path, not a {type(path).__name__}")
    found = Path(path)
    if "\0" in str(found):
        raise InputError(shown(f"{found} is no path: it holds a NUL character"))
    try:
        return found.expanduser()
    except RuntimeError as error:
        raise InputError(shown(f"{found}: {error}")) from None


def check_path(path: Path, what: str) -> bool:
    """Check that a path is an existing file or folder.

    Args:
        path: any.
        what: expected kind, such as "picture file".

    Returns:
        Whether it is a folder.

    Raises:
        InputError: nothing there, no permission, or a pipe, a socket or a device.
    """
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):  # ValueError: a NUL
        raise InputError(shown(f"there is no {what} {path}")) from None
    except OSError as error:
        raise InputError(shown(f"{path} cannot be read: {error.strerror or in_words(error)}")) from None
    special = _SPECIAL.get(stat.S_IFMT(mode))
    if special is not None:
        raise InputError(shown(f"{path} is {special} and no {what}: nothing is read from it"))
    if not os.access(path, os.R_OK):
        raise InputError(shown(f"{path} cannot be read: there is no permission to"))
    return stat.S_ISDIR(mode)


def check_file(path: Path, what: str = "file") -> None:
    """Check that a path is a readable file; as `check_path`.

    Raises:
        InputError: also for a folder.
    """
    if check_path(path, what):
        raise InputError(shown(f"there is no {what} {path}: it is a folder"))


def is_file(path: Path) -> bool:
    """Whether there is such a file; False also for invalid paths."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_bytes(path: Path, what: str = "file") -> bytes:
    """The contents of a file.

    Raises:
        InputError: as `check_file`; or an error of the disk.
    """
    check_file(path, what)
    with reading(path, f"a {what}"):
        return path.read_bytes()


def read_text(path: Path, what: str = "text file") -> str:
    """The contents of a file in UTF-8, without a byte order mark.

    Raises:
        InputError: as `read_bytes`; or it is not UTF-8.
    """
    data = read_bytes(path, what)
    with reading(path, f"a {what}"):
        return data.decode("utf-8-sig")


def read_json(data: bytes, name: str) -> dict[str, Any]:
    """The object in a JSON text.

    Args:
        data: the text.
        name: of the file, or of its part, for an error.

    Raises:
        InputError: it is not JSON, nested too deeply, or not an object.
    """
    try:
        found = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        reason = in_words(error) if isinstance(error, RecursionError | UnicodeError) else error
        raise InputError(shown(f"{name} is not JSON: {reason}")) from None
    if not isinstance(found, dict):
        raise InputError(f"{name} is not a JSON object")
    return found


def number(text: str | None) -> float:
    """A number in text; NaN if it is none."""
    try:
        return float(text or "")
    except ValueError:
        return math.nan


def value_at(tree: Any, *keys: str) -> Any:
    """The value at a path of keys in a JSON tree; None if there is none."""
    for key in keys:
        tree = tree.get(key) if isinstance(tree, dict) else None
    return tree


def most_unpacked(packed: int) -> int:
    """Bytes to which a text or an image of this packed size may unpack; arrays may be larger."""
    return max(MOST_UNPACKED, MOST_TIMES_PACKED * packed)


def unpacked_gzip(path: Path, what: str = "file") -> bytes:
    """The contents of a gzip file.

    Raises:
        InputError: as `read_bytes`; it is damaged, or unpacks to more than `most_unpacked` allows.
    """
    check_file(path, what)
    most = most_unpacked(path.stat().st_size)
    with reading(path, f"a {what} packed by gzip"), gzip.open(path) as packed:
        data = packed.read(most + 1)
    if len(data) > most:
        raise InputError(
            f"{path} unpacks to more than {most / 1e6:,.0f} MB from {path.stat().st_size / 1e6:.3g} MB, which no "
            f"{what} does. If it is sound, unpack it with gunzip"
        )
    return data
