"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from vcc.base.errors import InputError


@contextmanager
def atomic_path(path: str | PathLike[str]) -> Iterator[Path]:
    """A temporary path beside ``path`` to write to; it becomes ``path`` if all goes well.

    ::

        with atomic_path("picture.png") as temporary:
            temporary.write_bytes(data)

    If the block fails, nothing is left behind and an older file of that name stays as it was. The
    temporary file is in the same folder (a rename across disks is not atomic) and has the same
    ending.

    Raises:
        InputError: the folder does not exist or cannot be written to, ``path`` is a folder, or the
            system refuses to write (no space, no permission).
    """
    target = Path(os.path.realpath(path))  # a link stays a link: what it points to is replaced
    _check_target(target)
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(4)}.part{target.suffix}")
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise InputError(
            f"{target} could not be written: {error.strerror or error}. "
            "Write to another folder or make room on the disk"
        ) from error
    finally:
        temporary.unlink(missing_ok=True)


def _check_target(target: Path) -> None:
    folder = target.parent
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
