"""Names of files and folders in the making, and what killed writers left of them.

What is written stands under a temporary name beside its target until it is whole. The name says which process of
which machine writes it, so that the next writer of the same target can tell what is dead from what is at work.
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
"""Seconds after which a part of another machine's process, of which nothing is known, counts as left behind."""


def part_of(target: Path) -> Path:
    """A name beside a target, with its ending, for what will become it."""
    return _named(target, "part")


def set_aside(target: Path) -> Path:
    """A name beside a target for what stood there, while another takes its place."""
    return _named(target, "old")


def check_name(target: Path) -> None:
    """Refuse a name that no file can have.

    Raises:
        InputError: it is too long.
    """
    size, most = len(os.fsencode(target.name)), _longest_name(target.parent)
    if size > most:
        raise InputError(
            f"{shown(target.name, 60)} cannot be written: the name has {size} bytes, and the disk allows {most}. "
            "Choose a shorter name"
        )


def lock_of(target: Path) -> Path:
    """A name beside a target, for the lock of who writes it."""
    stem, suffix = stem_and_ending(target)
    return target.with_name(f".{stem}{suffix}.lock")


def _named(target: Path, state: str) -> Path:
    writer = f"{_machine()}-{os.getpid()}-{secrets.token_hex(4)}"
    stem, suffix = stem_and_ending(target)
    return target.with_name(f".{stem}.{writer}.{state}{suffix}")


_LONGEST_ENDING = 16
"""Bytes of what is an ending; more are part of a name."""
_ADDED = len(f"..{'.'}{'0' * 8}-{'0' * 10}-{'0' * 8}.part.lock")
"""Characters that names made of a target's have more than it, at most: those of the lock of a part."""


def stem_and_ending(target: Path) -> tuple[str, str]:
    """Stem and ending of a target; the stem cut, and marked, where names made of it would be too long."""
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
    """Remove the parts of a target whose writers are dead.

    Args:
        target: file or folder that is about to be written.
        patience: seconds that a part must have been untouched where nobody can tell whether its writer lives,
            because that is a process of another machine or container; 0 where this process alone may write.
    """
    for left in _left(target, "part", patience):
        _remove(left)
    if os.path.lexists(target):
        for left in _left(target, "old", patience):
            _remove(left)


def clear_folder(folder: Path, patience: float) -> int:
    """Remove the parts of all targets in a folder whose writers are dead; see `clear_leftovers`.

    Returns:
        How many there were.
    """
    found = list(_parts(folder, r".+", "part", r"(\.[^.]*)?", patience))
    for left in found:
        _remove(left)
    return sum(left.suffix != ".lock" for left in found)


def settle(folder: Path) -> None:
    """Have the disk hold a folder and all that is in it: what is renamed then is whole after a power cut, too.

    Raises:
        OSError: the disk refuses.
    """
    for root, _, names in os.walk(folder):
        for name in names:
            _settle(os.path.join(root, name), os.O_RDWR)  # noqa: PTH118  (of many)
        settle_names(Path(root))


def settle_names(folder: Path) -> None:
    """Have the disk hold the names in a folder.

    Raises:
        OSError: the disk refuses.
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
    """Give a finished folder its name; what stood there is then gone.

    Where the system can exchange two names in one step (Linux, on most file systems), one or the other stands
    there at every moment. Elsewhere there is one between two renames in which none does: `put_back` repairs what a
    kill leaves then.

    Args:
        part: the finished folder.
        target: its name.
        replace: whether a folder may stand there; else the disk refuses one that is not empty.

    Raises:
        OSError: the disk refuses. What stood there stands there.
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
"""What a system or file system says that does not exchange names."""


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange two names in one step, if that can be; see renameat2(2)."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):  # another system
        return False
    here, exchange = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
    if rename(here, os.fsencode(one), here, os.fsencode(other), exchange) == 0:
        return True
    number = ctypes.get_errno()
    if number in _CANNOT:
        return False
    raise OSError(number, os.strerror(number), str(other))


def put_back(target: Path) -> bool:
    """Put back what stood under a name, where a writer died between taking it away and replacing it.

    Returns:
        Whether it was.

    Raises:
        OSError: it is there, and the disk refuses.
    """
    if os.path.lexists(target) or not target.parent.is_dir():
        return False
    left = sorted(_left(target, "old", 60.0), key=lambda path: path.lstat().st_ctime)
    if not left:
        return False
    left[-1].rename(target)
    return True


def _left(target: Path, state: str, patience: float) -> Iterator[Path]:
    """What writers that are dead left of a target."""
    stem, suffix = stem_and_ending(target)
    return _parts(target.parent, re.escape(stem), state, re.escape(suffix), patience)


def _parts(folder: Path, stem: str, state: str, suffix: str, patience: float) -> Iterator[Path]:
    """What writers that are dead left of targets of such names, as regular expressions."""
    pattern = re.compile(rf"\.?\.{stem}\.([0-9a-f]{{8}})-(\d+)-[0-9a-f]{{8}}\.{state}{suffix}(\.lock)?")
    try:
        names = os.listdir(folder)  # noqa: PTH208  (of thousands of names, paths are made of few)
    except OSError:  # what is written next says so, where that cannot be written either
        return
    for name in names:
        match, path = pattern.fullmatch(name), folder / name
        if match and _dead(match[1], int(match[2]), path, patience):
            yield path


def _dead(machine: str, process: int, path: Path, patience: float) -> bool:
    """Whether the writer of a part is known to be dead, or left it alone for long enough."""
    if machine == _machine():
        return process != os.getpid() if patience == 0 else not _runs(process)  # a zombie runs, too
    try:
        touched = max(each.lstat().st_ctime for each in (path, *path.rglob("*")))
    except OSError:  # somebody is at work there
        return False
    return time.time() - touched > patience


def _runs(process: int) -> bool:
    if os.name != "posix":  # os.kill would end it there
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
    """Eight digits for the machine since it started, and the container: where a process has its number."""
    known = [platform.node()]
    for name, read in (("/proc/sys/kernel/random/boot_id", _text), ("/proc/self/ns/pid", os.readlink)):
        try:
            known.append(read(name))
        except OSError:  # no Linux
            known.append("")
    return f"{zlib.crc32(' '.join(known).encode()):08x}"


def _text(name: str) -> str:
    return Path(name).read_text(encoding="ascii").strip()


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
