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
    _check_target(target)
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


def _check_target(target: Path) -> None:
    folder = target.parent
    check_name(target)
    if not folder.exists():
        raise InputError(
            f"{target.name} cannot be written: the folder {folder} does not exist. "
            f'Make it first (mkdir -p "{folder}") or choose another'
        )
    if not folder.is_dir():
        raise InputError(f"{target} cannot be written: {folder} is a file, not a folder")
    if target.is_dir():
        raise InputError(f"{target} is a folder: give the name of a file in it")
    if not os.access(folder, os.W_OK):
        raise InputError(
            f"{target.name} cannot be written: there is no permission to write to the folder "
            f"{folder}. Choose another folder"
        )
