"""Formats that hold a whole light field in one file (or in a folder that is one thing)."""

from __future__ import annotations

import inspect
from pathlib import Path
from types import ModuleType
from typing import Any

from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.reading import check_path, expanded, reading
from vcc.formats import arrays, eslf, hci_2013, lftoolbox, lytro_lfp, plenoptomos_vox, video, viewer_zip
from vcc.formats.grid import Decoded

_MODULES = (
    # Each is a module with `recognised(path: Path) -> bool`, quick and by the ending or the first bytes, and
    # `read(path: Path, *, …) -> Decoded`; keyword arguments of `read` are options that `open_light_field(path, …)`
    # passes on, but for `progress`, which it takes if it has something to say. The first that recognises a path
    # reads it.
    lftoolbox,
    hci_2013,
    plenoptomos_vox,
    lytro_lfp,
    arrays,
    video,
    viewer_zip,
    eslf,
)
CONTAINERS = {module.__name__.rpartition(".")[2]: module for module in _MODULES}
"""The modules that read them, by their names."""


def container_of(path: Path) -> ModuleType | None:
    """The module that reads this file or folder; None if none does.

    Raises:
        InputError: there is no such file or folder, or it cannot be read.
    """
    check_path(path, "folder or file")
    return next((module for module in CONTAINERS.values() if module.recognised(path)), None)


def read_container(path: Path, progress: Progress | None = None, **options: Any) -> Decoded:
    """What a file holds, as stored.

    Args:
        path: the file.
        progress: called as progress(done, total) while it is read.
        options: what the format's reader takes, such as ``views=(15, 15)``.

    Raises:
        InputError: no such file, a format that is not known, an option that its reader does not take, or what the
            reader says.
    """
    path = expanded(path)
    with reading(path, "a light field"):
        module = container_of(path)
        if module is None:
            raise InputError(f"{path} is in no format that is known")
        return _read(module, path, progress, options)


def _read(module: ModuleType, path: Path, progress: Progress | None, options: dict[str, Any]) -> Decoded:
    parameters = inspect.signature(module.read).parameters
    taken = [key for key in parameters if key not in ("path", "progress")]
    for option in options:
        if option not in taken:
            takes = f"takes {', '.join(taken)}" if taken else "takes no options"
            raise InputError(f"{path}: {option}= means nothing to this format, which {takes}")
    if "progress" in parameters:
        options["progress"] = progress
    decoded: Decoded = module.read(path, **options)
    if "progress" not in parameters:
        tell(progress, 1, 1)
    return decoded
