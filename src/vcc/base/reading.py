"""The boundary to files that others wrote: whatever goes wrong while they are read is an `InputError` in words.

Every public reader does its reading within `reading`, and what it opens passes `check_file` first: a pipe that
nobody writes to would be waited for, and a device has no end.
"""

from __future__ import annotations

import gzip
import json
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
"""Characters of a refusal: what a file holds is quoted in it, and may have any length."""
MOST_UNPACKED = 2**26
"""Bytes to which a packed text or picture may unpack, however small it is."""
MOST_TIMES_PACKED = 100
"""How many times its packed size it may have if it is larger; text and pictures pack 2 to 20 times smaller."""

_FAULTS_OF_PROGRAMS = (AssertionError, ImportError, NameError)

_SPECIAL = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


@contextmanager
def reading(path: str | PathLike[str], what: str) -> Iterator[None]:
    """Reading what others wrote stands within this: anything that it raises becomes a refusal that names the file.

    What cannot come from a file passes: assertions of ours, names and packages that are not there, warnings that
    are raised, and what a `Progress` raises. The error that was raised is the ``__cause__`` of the refusal.

    Args:
        path: the file or folder.
        what: it is read as, such as "a light field".

    Raises:
        InputError: as raised within, with the name of the file if that is not in it, at most `LONGEST_MESSAGE`
            long; or in place of any other exception.
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
    """A text fit to be shown: characters that steer terminals as their codes, the middle of a long one left out.

    Args:
        text: any.
        most: characters of what is returned.
    """

    def plain(part: str) -> str:
        return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in part)

    if len(text) <= most and len(whole := plain(text)) <= most:
        return whole
    first, last = plain(text[:most]), plain(text[-most:])
    head = most * 2 // 3
    return f"{first[:head]} … {last[head + 3 - most :]}"


def in_words(error: BaseException) -> str:
    """What was raised, for people who know nothing of Python."""
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
        InputError: neither text nor a path; there is no such user, or a NUL in it, which no name has.
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
    """Refuse what is neither a file nor a folder, or is not there.

    Args:
        path: any.
        what: is wanted, such as "picture file".

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
    """Refuse what is no file that can be read; as `check_path`.

    Raises:
        InputError: also for a folder.
    """
    if check_path(path, what):
        raise InputError(shown(f"there is no {what} {path}: it is a folder"))


def is_file(path: Path) -> bool:
    """Whether there is such a file; False for what cannot be a path, too."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_bytes(path: Path, what: str = "file") -> bytes:
    """What a file holds.

    Raises:
        InputError: as `check_file`; or the disk refuses.
    """
    check_file(path, what)
    with reading(path, f"a {what}"):
        return path.read_bytes()


def read_text(path: Path, what: str = "text file") -> str:
    """What a file in UTF-8 holds, a byte order mark taken off.

    Raises:
        InputError: as `read_bytes`; or it is not UTF-8.
    """
    data = read_bytes(path, what)
    with reading(path, f"a {what}"):
        return data.decode("utf-8-sig")


def read_json(data: bytes, name: str) -> dict[str, Any]:
    """The object in a text of JSON.

    Args:
        data: the text.
        name: of the file, or of its part, for an error.

    Raises:
        InputError: it is no JSON, nested too deeply, or no object.
    """
    try:
        found = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        reason = in_words(error) if isinstance(error, RecursionError | UnicodeError) else error
        raise InputError(shown(f"{name} is not JSON: {reason}")) from None
    if not isinstance(found, dict):
        raise InputError(f"{name} is not a JSON object")
    return found


def value_at(tree: Any, *keys: str) -> Any:
    """What stands in a tree of JSON under these keys; None if nothing does."""
    for key in keys:
        tree = tree.get(key) if isinstance(tree, dict) else None
    return tree


def most_unpacked(packed: int) -> int:
    """Bytes to which a text or a picture of so many packed bytes may unpack; arrays may to more."""
    return max(MOST_UNPACKED, MOST_TIMES_PACKED * packed)


def unpacked_gzip(path: Path, what: str = "file") -> bytes:
    """What a file of gzip holds.

    Raises:
        InputError: as `read_bytes`; it is damaged, or unpacks to more than `most_unpacked` says.
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
