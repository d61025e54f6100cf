"""Checks that an open store or video has not been replaced.

A Zarr folder may be replaced, or removed and rewritten, while it is read; metadata and samples would then come
from different light fields. Each folder states an identity, drawn when it was made, which stays the same when a
writer continues it. Older folders without an identity are identified by all their attributes.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vcc.base.errors import InputError
from vcc.base.reading import read_bytes, read_json, value_at

IDENTITY = "identity"
"""The attribute for the identity."""

Stamp = tuple[int, ...]


def drawn() -> str:
    """A new random identity."""
    return secrets.token_hex(16)


@dataclass
class Held:
    """The content of a folder as it was when it was opened.

    A check is one call of ``stat``; the metadata file is read again only if ``stat`` shows a change.

    Args:
        folder: folder of a Zarr group.
        what: noun for messages.
        states: function that returns the identifying attributes of a folder.
        attributes: a hash of these attributes when the folder was opened.
    """

    folder: Path
    what: str
    states: Callable[[Path], Any]
    attributes: str
    _seen: Stamp | None = None

    @classmethod
    def now(cls, folder: Path, what: str, states: Callable[[Path], Any]) -> Held:
        """The current content of a folder."""
        seen = _stamp(folder)  # stat before reading, so that a later change is noticed
        return cls(folder, what, states, _described(folder, states), seen)

    def check(self) -> None:
        """Raise if the folder was removed or has other content.

        Raises:
            InputError: the folder was replaced, removed or became unreadable.
        """
        seen = _stamp(self.folder)
        if seen is not None and seen == self._seen:
            return
        if seen is None:
            raise InputError(
                f"{self.folder} is gone: the {self.what} that was opened was removed, renamed or is being "
                "replaced. Open it again where it is"
            )
        if _described(self.folder, self.states) != self.attributes:
            raise InputError(
                f"{self.folder} holds another {self.what} than the one that was opened: it was replaced or "
                "changed since. Open it again"
            )
        self._seen = seen

    @contextmanager
    def through(self) -> Iterator[None]:
        """Context for reading: raises on exit, or in place of an error within, if the folder was replaced.

        Raises:
            InputError: as in `check`; else the error raised within.
        """
        try:
            yield
        except InputError:
            self.check()
            raise
        self.check()  # after reading: a check before it proves nothing


def attributes_of(folder: Path, key: str, array: str | None = None, but: tuple[str, ...] = ()) -> Any:
    """The constant attributes of a Zarr group under a key, and the constant metadata of an array in it.

    Args:
        folder: folder of the group.
        key: key in the attributes of the group.
        array: name of an array whose metadata do not change; its own attributes are left out. None for no array.
        but: names that a continuing writer changes.
    """
    group = value_at(read_json(read_bytes(folder / "zarr.json"), f"{folder / 'zarr.json'}"), "attributes", key)
    stays = _without(group, *but) if isinstance(group, dict) else None
    if array is None:
        return stays
    file = folder / array / "zarr.json"
    return stays, _without(read_json(read_bytes(file), f"{file}"), "attributes")


def _without(stated: dict[str, Any], *but: str) -> dict[str, Any]:
    """Drop the given names, and entries that are null."""
    return {name: value for name, value in stated.items() if name not in but and value is not None}


def _stamp(folder: Path) -> Stamp | None:
    """A value that changes when the metadata file is rewritten or replaced; None if there is no file."""
    try:
        found = os.stat(f"{folder}{os.sep}zarr.json")  # noqa: PTH116  (called often; text is twice as fast)
    except (OSError, ValueError):
        return None
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


def _described(folder: Path, states: Callable[[Path], Any]) -> str:
    """A hash of the identifying attributes; invalid attributes are reported elsewhere."""
    try:
        stated = states(folder)
    except InputError:
        stated = None
    return hashlib.sha256(json.dumps(stated, sort_keys=True).encode("utf-8", "surrogatepass")).hexdigest()
