"""Temporary names of files and folders, and cleaning up after killed writers.

Until it is complete, output has a temporary name next to its target. The name contains the machine and the
process of the writer, so the next writer of the same target can distinguish leftovers from work in progress.
"""

from __future__ import annotations

import ctypes
import errno
import functools
import os
import platform
import re
import secrets
import shutil
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.reading import shown

DAY = 86400.0
"""Seconds after which a temporary file of another machine's process (state unknown) counts as abandoned."""


def part_of(target: Path) -> Path:
    """Temporary name next to a target, with its extension, for new content."""
    return _named(target, "part")


def set_aside(target: Path) -> Path:
    """Temporary name next to a target for its old content during replacement."""
    return _named(target, "old")


def check_name(target: Path) -> None:
    """Raise for a name that the file system does not allow.

    Raises:
        InputError: the name is too long.
    """
    size, most = len(os.fsencode(target.name)), _longest_name(target.parent)
    if size > most:
        raise InputError(
            f"{shown(target.name, 60)} cannot be written: the name has {size} bytes, and the disk allows {most}. "
            "Choose a shorter name"
        )


def lock_of(target: Path) -> Path:
    """Name of the lock file next to a target."""
    stem, suffix = stem_and_ending(target)
    return target.with_name(f".{stem}{suffix}.lock")


def _named(target: Path, state: str) -> Path:
    writer = f"{_machine()}-{os.getpid()}-{secrets.token_hex(4)}"
    stem, suffix = stem_and_ending(target)
    return target.with_name(f".{stem}.{writer}.{state}{suffix}")


_LONGEST_ENDING = 16
"""Bytes of the longest extension; a longer suffix counts as part of the name."""
_ADDED = len(f"..{'.'}{'0' * 8}-{'0' * 10}-{'0' * 8}.part.lock")
"""Most characters that temporary names add to the target's name: the lock of a part."""


def stem_and_ending(target: Path) -> tuple[str, str]:
    """Stem and extension of a target; a stem too long for temporary names is cut and gets a checksum."""
    stem, suffix = target.stem, target.suffix
    if len(os.fsencode(suffix)) > _LONGEST_ENDING:
        stem, suffix = target.name, ""
    whole = os.fsencode(stem)
    most = _longest_name(target.parent) - _ADDED - len(os.fsencode(suffix))
    if len(whole) <= most:
        return stem, suffix
    mark = f"~{zlib.crc32(whole):08x}"
    return whole[: most - len(mark)].decode(errors="ignore") + mark, suffix


def _longest_name(folder: Path) -> int:
    """Bytes that a name in a folder may have."""
    try:
        return os.pathconf(folder, "PC_NAME_MAX")
    except (AttributeError, OSError, ValueError):  # Windows; no such folder
        return 255


def clear_leftovers(target: Path, patience: float = DAY) -> None:
    """Remove temporary files of a target whose writers are dead.

    Args:
        target: file or folder to be written.
        patience: seconds that a temporary file must be untouched if the state of its writer, a process of
            another machine or container, is unknown; 0 if only this process can write.
    """
    for left in _left(target, "part", patience):
        _remove(left)
    if os.path.lexists(target):
        for left in _left(target, "old", patience):
            _remove(left)


def clear_folder(folder: Path, patience: float) -> int:
    """Remove temporary files of all targets in a folder whose writers are dead; see `clear_leftovers`.

    Returns:
        The number of removed files and folders.
    """
    found = list(_parts(folder, r".+", "part", r"(\.[^.]*)?", patience))
    for left in found:
        _remove(left)
    return sum(left.suffix != ".lock" for left in found)


def settle(folder: Path) -> None:
    """Flush a folder and its content to the disk, so that a later rename survives a power cut.

    Raises:
        OSError: the write fails.
    """
    for root, _, names in os.walk(folder):
        for name in names:
            _settle(os.path.join(root, name), os.O_RDWR)  # noqa: PTH118  (of many)
        settle_names(Path(root))


def settle_names(folder: Path) -> None:
    """Flush the names in a folder to the disk.

    Raises:
        OSError: the write fails.
    """
    if os.name == "posix":  # elsewhere folders cannot be opened
        _settle(folder, os.O_RDONLY)


def _settle(path: str | Path, how: int) -> None:
    opened = os.open(path, how)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)


def put_in_place(part: Path, target: Path, replace: bool) -> None:
    """Rename a finished folder to its target; existing content is removed.

    If the system can exchange two names in one step (Linux, on most file systems), the target exists at every
    moment. Elsewhere it is missing between two renames; `put_back` repairs the state after a kill at that
    moment.

    Args:
        part: the finished folder.
        target: the final name.
        replace: whether to replace an existing folder; if False, one that is not empty raises.

    Raises:
        OSError: the write fails. Existing content stays in place.
    """
    if not (replace and target.exists()):
        part.rename(target)
    elif _exchanged(part, target):
        _remove(part)
    else:
        old = set_aside(target)
        target.rename(old)
        try:
            part.rename(target)
        except BaseException:
            old.rename(target)
            raise
        _remove(old)


_CANNOT = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}
"""Errors of a system or file system that cannot exchange names."""


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange two names in one step and return True; False if not supported. See renameat2(2)."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):  # not Linux
        return False
    here, exchange = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
    if rename(here, os.fsencode(one), here, os.fsencode(other), exchange) == 0:
        return True
    number = ctypes.get_errno()
    if number in _CANNOT:
        return False
    raise OSError(number, os.strerror(number), str(other))


def put_back(target: Path) -> bool:
    """Restore the old content of a target whose writer died while replacing it.

    Returns:
        Whether content was restored.

    Raises:
        OSError: the old content exists and cannot be renamed.
    """
    if os.path.lexists(target) or not target.parent.is_dir():
        return False
    left = sorted(_left(target, "old", 60.0), key=lambda path: path.lstat().st_ctime)
    if not left:
        return False
    left[-1].rename(target)
    return True


def _left(target: Path, state: str, patience: float) -> Iterator[Path]:
    """Temporary names of a target whose writers are dead."""
    stem, suffix = stem_and_ending(target)
    return _parts(target.parent, re.escape(stem), state, re.escape(suffix), patience)


def _parts(folder: Path, stem: str, state: str, suffix: str, patience: float) -> Iterator[Path]:
    """Temporary names of all targets that match the regular expressions, whose writers are dead."""
    pattern = re.compile(rf"\.?\.{stem}\.([0-9a-f]{{8}})-(\d+)-[0-9a-f]{{8}}\.{state}{suffix}(\.lock)?")
    try:
        names = os.listdir(folder)  # noqa: PTH208  (thousands of names; paths are made for few)
    except OSError:  # the next write reports an inaccessible folder
        return
    for name in names:
        match, path = pattern.fullmatch(name), folder / name
        if match and _dead(match[1], int(match[2]), path, patience):
            yield path


def _dead(machine: str, process: int, path: Path, patience: float) -> bool:
    """Whether the writer of a temporary file is dead, or did not touch it for ``patience`` seconds."""
    if machine == _machine():
        return process != os.getpid() if patience == 0 else not _runs(process)  # a zombie counts as running
    try:
        touched = max(each.lstat().st_ctime for each in (path, *path.rglob("*")))
    except OSError:  # files vanish: a writer is active
        return False
    return time.time() - touched > patience


def _runs(process: int) -> bool:
    if os.name != "posix":  # os.kill would end the process
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


@functools.cache
def _machine() -> str:
    """Eight hex digits for the machine since its last start and the container: the scope of process numbers."""
    known = [platform.node()]
    for name, read in (("/proc/sys/kernel/random/boot_id", _text), ("/proc/self/ns/pid", os.readlink)):
        try:
            known.append(read(name))
        except OSError:  # not Linux
            known.append("")
    return f"{zlib.crc32(' '.join(known).encode()):08x}"


def _text(name: str) -> str:
    return Path(name).read_text(encoding="ascii").strip()


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
