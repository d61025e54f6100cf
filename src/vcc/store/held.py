"""What a reader holds on to: that what stands under a name is still what it opened.

A folder of Zarr may be replaced, or removed and written again, while it is read: metadata that were read and
samples that are read next would then belong to two. Each states an identity, drawn when it was made, which
stays while a writer goes on with it; what is older is told by all that it states.
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
"""The attribute that says which one it is."""

Stamp = tuple[int, ...]


def drawn() -> str:
    """An identity for what is made now."""
    return secrets.token_hex(16)


@dataclass
class Held:
    """What stands in a folder, as it was when it was opened.

    Looked at is the file that states it, and read only where that is another file than before: a look costs one
    question to the disk.

    Args:
        folder: of a group of Zarr.
        what: it is, for messages.
        states: what tells one from another, of a folder.
        attributes: a hash of the folder's attributes when it was opened.
    """

    folder: Path
    what: str
    states: Callable[[Path], Any]
    attributes: str
    _seen: Stamp | None = None

    @classmethod
    def now(cls, folder: Path, what: str, states: Callable[[Path], Any]) -> Held:
        """What stands there now."""
        seen = _stamp(folder)  # before it is read: what comes in between is then looked at
        return cls(folder, what, states, _described(folder, states), seen)

    def check(self) -> None:
        """Refuse another one, or none, in its place.

        Raises:
            InputError: there is; or it cannot be read any more.
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
        """Read within this: all that was read is of what was opened, and faults are told by their cause.

        Raises:
            InputError: as `check`; else as raised within.
        """
        try:
            yield
        except InputError:
            self.check()
            raise
        self.check()  # once it is read: that it was there before says nothing


def attributes_of(folder: Path, key: str, array: str | None = None, but: tuple[str, ...] = ()) -> Any:
    """What a group of Zarr states under a key, and an array in it, as far as that stays the same.

    Args:
        folder: of the group.
        key: of its attributes.
        array: its name, where it is as it was made; its own attributes are left out.
        but: what writers that go on change.
    """
    group = value_at(read_json(read_bytes(folder / "zarr.json"), f"{folder / 'zarr.json'}"), "attributes", key)
    stays = _without(group, *but) if isinstance(group, dict) else None
    if array is None:
        return stays
    file = folder / array / "zarr.json"
    return stays, _without(read_json(read_bytes(file), f"{file}"), "attributes")


def _without(stated: dict[str, Any], *but: str) -> dict[str, Any]:
    """What is stated; null is as good as nothing."""
    return {name: value for name, value in stated.items() if name not in but and value is not None}


def _stamp(folder: Path) -> Stamp | None:
    """What is another where a file was written again or replaced; None where there is none."""
    try:
        found = os.stat(f"{folder}{os.sep}zarr.json")  # noqa: PTH116  (asked often, and text takes half the time)
    except (OSError, ValueError):
        return None
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


def _described(folder: Path, states: Callable[[Path], Any]) -> str:
    """A word for what a folder tells; what is wrong with it others say."""
    try:
        stated = states(folder)
    except InputError:
        stated = None
    return hashlib.sha256(json.dumps(stated, sort_keys=True).encode("utf-8", "surrogatepass")).hexdigest()
