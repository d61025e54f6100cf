"""Formats that store a whole light field in one file (or in one folder that counts as a file)."""

from __future__ import annotations

import inspect
from pathlib import Path
from types import ModuleType
from typing import Any

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.reading import check_path, expanded, reading
from vcc.formats import arrays, eslf, hci_2013, lftoolbox, lytro_lfp, plenoptomos_vox, video, viewer_zip
from vcc.formats.grid import Decoded

_MODULES = (
    # Each module has `recognised(path: Path) -> bool`, a quick check of extension or first bytes, and
    # `read(path: Path, *, …) -> Decoded`. Keyword arguments of `read` are options that `open_light_field(path,
    # …)` passes on, except `progress`, which is optional. The first module that recognises a path reads it.
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
"""The modules by name."""


def container_of(path: Path) -> ModuleType | None:
    """The module that reads this file or folder; None if there is none.

    Raises:
        InputError: the path does not exist or cannot be read.
    """
    check_path(path, "folder or file")
    return next((module for module in CONTAINERS.values() if module.recognised(path)), None)


def read_container(path: Path, progress: Progress | None = None, **options: Any) -> Decoded:
    """Read the content of a file as stored.

    Args:
        path: the file.
        progress: called as progress(done, total) while it is read.
        options: options of the format's reader, such as ``views=(15, 15)``.

    Raises:
        InputError: no such file, an unknown format, an unsupported option, or as raised by the reader.
    """
    path = expanded(path)
    with reading(path, "a light field"):
        module = container_of(path)
        if module is None:
            raise InputError(f"{path} is not in a supported format")
        return _read(module, path, progress, options)


def _read(module: ModuleType, path: Path, progress: Progress | None, options: dict[str, Any]) -> Decoded:
    parameters = inspect.signature(module.read).parameters
    checks.options_of(module.read, options, ("path", "progress"), "this format")
    if "progress" in parameters:
        options["progress"] = progress
    decoded: Decoded = module.read(path, **options)
    if "progress" not in parameters:
        tell(progress, 1, 1)
    return decoded
