"""A data set on disk: a folder with its card, and pairs in shards, each complete or absent."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.dataset.card import CAMERA
from vcc.dataset.recording_pairs import Pair
from vcc.files.atomic import atomic_folder
from vcc.files.parts import clear_folder

CARD, README = "dataset.json", "README.md"


@dataclass(frozen=True, eq=False, repr=False)
class Destination(Brief, ABC):
    """A data set on disk whose card is known. A shard is what one task writes.

    Args:
        path: folder.
        card: see `vcc.dataset.card`.
    """

    path: Path
    card: dict[str, Any]
    _opened: dict[Any, Any] = field(default_factory=dict)

    kind: ClassVar[str]
    """As in `vcc.dataset.make_dataset`."""
    how_to_read: ClassVar[str]
    """A sentence for the card."""

    def __reduce__(self) -> tuple[Any, ...]:
        """What this process has opened is not sent to others."""
        return type(self), (self.path, self.card)

    @abstractmethod
    def mark(self, shard: int) -> Path:
        """The file that exists if a shard is complete; those of all shards are in one folder."""

    @abstractmethod
    def write(self, shard: int, pairs: Iterable[Pair]) -> None:
        """Write a shard.

        Raises:
            InputError: the disk reports an error.
        """

    @abstractmethod
    def read(self, pair: int) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """The arrays and numbers of a pair.

        Raises:
            InputError: a missing or damaged file.
        """

    def prepare(self, part: Path, first: Pair) -> None:
        """Write what all shards need into the folder while it has a temporary name.

        Args:
            part: the folder.
            first: a pair, whose arrays and numbers have the shapes of all.
        """

    def pairs_of(self, shard: int) -> range:
        """The numbers of the pairs of a shard."""
        count = self.card["pairs_per_shard"]
        return range(shard * count, min((shard + 1) * count, self.card["pairs"]))

    def left(self) -> list[int]:
        """The shards that are missing."""
        folder = self.mark(0).parent
        there = {each.name for each in folder.iterdir()} if folder.is_dir() else set()
        return [shard for shard in range(self.card["shards"]) if self.mark(shard).name not in there]

    def create(self, text: str, camera: Camera, first: Pair) -> None:
        """Make the folder with its card, under a temporary name until it is complete.

        Args:
            text: of README.md.
            camera: the first one; left out if no camera file can contain it.
            first: see `prepare`.

        Raises:
            InputError: the disk reports an error.
        """
        with atomic_folder(self.path) as part:
            part.mkdir()
            (part / CARD).write_text(json.dumps(self.card, indent=1, ensure_ascii=False), encoding="utf-8")
            (part / README).write_text(text, encoding="utf-8")
            with suppress(InputError):
                camera.save(part / CAMERA)
            self.prepare(part, first)

    def clear(self, patience: float) -> None:
        """Remove what killed writers left in the folder; see `vcc.files.parts.clear_folder`."""
        clear_folder(self.path, patience)
