"""Formats that hold a whole light field in one file (or in a folder that is one thing)."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vcc.base.errors import InputError
from vcc.formats.grid import Decoded

CONTAINERS = (
    # Each is a module of this package with `recognised(path: Path) -> bool`, quick and by the ending or the first
    # bytes, and `read(path: Path, *, progress=None, …) -> Decoded`; further keyword arguments of `read` are
    # options that `open_light_field(path, …)` passes on. The first that recognises a path reads it.
    "lftoolbox",
    "hci_2013",
    "plenoptomos_vox",
    "lytro_lfp",
    "arrays",
    "video",
    "viewer_zip",
    "eslf",
)


def container_of(path: Path) -> str | None:
    """The name of the module that reads this file or folder; None if none does."""
    for name in CONTAINERS:
        if _module(name).recognised(path):
            return name
    return None


def read_container(path: Path, progress: Callable[[int, int], None] | None = None, **options: Any) -> Decoded:
    """What a file holds, as stored.

    Args:
        path: the file.
        progress: called as progress(done, total) while it is read.
        options: what the format's reader takes, such as ``views=(15, 15)``.

    Raises:
        InputError: no such file, a format that is not known, an option that its reader does not take, or what the
            reader says.
    """
    name = container_of(path)
    if name is None:
        if not path.exists():
            raise InputError(f"there is no file {path}")
        raise InputError(f"{path} is in no format that is known")
    module = _module(name)
    taken = [key for key in inspect.signature(module.read).parameters if key not in ("path", "progress")]
    for option in options:
        if option not in taken:
            takes = f"takes {', '.join(taken)}" if taken else "takes no options"
            raise InputError(f"{path}: {option}= means nothing to this format, which {takes}")
    decoded: Decoded = module.read(path, progress=progress, **options)
    return decoded


def _module(name: str) -> Any:
    return importlib.import_module(f"vcc.formats.{name}")
