"""Atomic writing: a file appears complete or not at all."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from vcc.base.errors import InputError
from vcc.files.parts import check_name, clear_leftovers, part_of


@contextmanager
def atomic_path(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path next to ``path``; rename it to ``path`` if the block succeeds.

    ::

        with atomic_path("picture.png") as temporary:
            temporary.write_bytes(data)

    If the block fails, no file is left behind and an existing file of that name stays unchanged. The temporary
    file is in the same folder (a rename across disks is not atomic) and has the same extension. Leftovers of
    killed writers of the same file are removed.

    Raises:
        InputError: the folder does not exist or is not writable, ``path`` is a folder, or the system refuses to
            write (no space, no permission).
    """
    target = Path(os.path.realpath(path))  # a symbolic link stays; its target is replaced
    check_target(target)
    temporary = part_of(target)
    try:
        clear_leftovers(target)
        yield temporary
        temporary.replace(target)
    except OSError as error:
        kept = "An older file of that name stays as it was" if target.exists() else "Nothing of it is kept"
        raise InputError(f"{target} could not be written: {refusal(error, temporary)}. {kept}") from error
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(target: Path) -> Iterator[Path]:
    """Yield a name for a new folder next to ``target``; rename the folder to ``target`` if the block succeeds.

    The block makes the folder. If it fails, nothing is left behind. An empty folder at ``target`` is replaced.

    Raises:
        InputError: there is no parent folder, or the system refuses to write.
    """
    check_parent(target)
    part = part_of(target)
    try:
        yield part
        if target.is_dir():
            target.rmdir()
        part.replace(target)
    except OSError as error:
        reason = refusal(error, part)
        raise InputError(f"{target} could not be written: {reason}. Nothing of it is kept") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def refusal(error: OSError, part: Path) -> str:
    """Text for a failed write: the reason, the free space on the disk and a remedy.

    Args:
        error: the exception that was raised.
        part: the partly written file or folder, which must still exist.
    """
    reason = error.strerror or str(error)
    if error.errno not in (errno.ENOSPC, errno.EDQUOT):
        return f"{reason}. {_WAYS_OUT.get(error.errno, 'Write to another folder')}"
    files = part.rglob("*") if part.is_dir() else [part]
    written = sum(_taken(file) for file in files if file.is_file())
    free = shutil.disk_usage(part.parent).free
    return (
        f"{reason}. {_megabytes(written)} MB of it were written, and {_megabytes(free)} MB are free there: make "
        "room on the disk, or write to another"
    )


_NOT_ALLOWED = "Write to another folder, or get permission"
_WAYS_OUT: dict[int | None, str] = {
    errno.EACCES: _NOT_ALLOWED,
    errno.EPERM: _NOT_ALLOWED,
    errno.EROFS: _NOT_ALLOWED,
    errno.EFBIG: "Write to another disk, or allow larger files (ulimit -f)",
    errno.ENAMETOOLONG: "Choose a shorter name",
}


def said_by_disk(words: str) -> OSError:
    """An `OSError` from the error text of a library, with the ``errno`` that the text stands for if known."""
    known = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS, errno.EACCES, errno.EPERM)
    number = next((number for number in known if os.strerror(number) in words), None)
    return OSError(words) if number is None else OSError(number, os.strerror(number))


def _taken(file: Path) -> int:
    """Bytes allocated on the disk; holes of sparse files do not count."""
    found = file.stat()
    return min(found.st_size, 512 * found.st_blocks) if hasattr(found, "st_blocks") else found.st_size


def _megabytes(count: int) -> str:
    return f"{count / 1e6:.3g}"


def check_target(target: Path) -> None:
    """Check that a file can be written.

    Raises:
        InputError: the folder does not exist or is not writable, or ``target`` is a folder or has too long a name.
    """
    check_name(target)
    check_parent(target)
    if target.is_dir():
        raise InputError(f"{target} is a folder: give the name of a file in it")
    if not os.access(target.parent, os.W_OK):
        raise InputError(
            f"{target.name} cannot be written: there is no permission to write to the folder "
            f"{target.parent}. Choose another folder"
        )


def check_parent(target: Path) -> None:
    """Raise if the folder of a target does not exist.

    Raises:
        InputError: it does not, or it is a file.
    """
    folder = target.parent
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{target} cannot be written: {folder} is a file, not a folder")
    if not folder.is_dir():
        raise InputError(
            f"{target} cannot be written: there is no folder {folder}; make it first, or choose another"
        )
