"""Data sets on disk: a folder of WebDataset shards, each complete or absent, and the card.

A shard is a tar file ``pairs-000000.tar`` with the files of each pair one after the other:
``00000017.recording.npy`` and so on, and its numbers in ``00000017.json``
(https://github.com/webdataset/webdataset).
"""

from __future__ import annotations

import io
import json
import shutil
import tarfile
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import check_path, read_bytes, read_json, reading
from vcc.camera import Camera
from vcc.dataset.card import CAMERA, FORMAT_VERSION
from vcc.dataset.recipe import MOST_PAIRS
from vcc.dataset.recording_pairs import Pair
from vcc.files.atomic import atomic_path, refusal
from vcc.files.npy import write_npy
from vcc.files.parts import part_of

CARD, README = "dataset.json", "README.md"


@dataclass(frozen=True, eq=False, repr=False)
class Shards(Brief):
    """The shards of a data set whose card is known.

    Args:
        path: folder.
        card: see `vcc.dataset.card`.
    """

    path: Path
    card: dict[str, Any]
    _places: dict[int, dict[str, tuple[int, int]]] = field(default_factory=dict)

    def __reduce__(self) -> tuple[Any, ...]:
        """Places in shards are not sent to other processes."""
        return type(self), (self.path, self.card)

    def file(self, shard: int) -> Path:
        """The file of a shard."""
        return self.path / f"pairs-{shard:06d}.tar"

    def pairs_of(self, shard: int) -> range:
        """The numbers of the pairs of a shard."""
        count = self.card["pairs_per_shard"]
        return range(shard * count, min((shard + 1) * count, self.card["pairs"]))

    def left(self) -> list[int]:
        """The shards that are missing."""
        there = {each.name for each in self.path.iterdir()}
        return [shard for shard in range(self.card["shards"]) if self.file(shard).name not in there]

    def create(self, text: str, camera: Camera) -> None:
        """Make the folder with its card, under a temporary name until it is complete.

        Args:
            text: of README.md.
            camera: the first one; left out if no camera file can contain it.

        Raises:
            InputError: the disk reports an error.
        """
        part = part_of(self.path)
        try:
            part.mkdir()
            (part / CARD).write_text(json.dumps(self.card, indent=1, ensure_ascii=False), encoding="utf-8")
            (part / README).write_text(text, encoding="utf-8")
            with suppress(InputError):
                camera.save(part / CAMERA)
            part.rename(self.path)
        except OSError as error:
            raise InputError(f"{self.path} cannot be made: {refusal(error, part)}") from error
        finally:
            shutil.rmtree(part, ignore_errors=True)

    def write(self, shard: int, pairs: Iterable[Pair]) -> None:
        """Write a shard.

        Raises:
            InputError: the disk reports an error.
        """
        with atomic_path(self.file(shard)) as part, tarfile.open(part, "w", format=tarfile.USTAR_FORMAT) as tar:
            for pair in pairs:
                key = f"{pair.numbers['pair']:08d}"
                for name, values in pair.arrays.items():
                    stream = io.BytesIO()
                    write_npy(values, stream)
                    _add(tar, f"{key}.{name}.npy", stream)
                _add(tar, f"{key}.json", io.BytesIO(json.dumps(pair.numbers).encode()))

    def read(self, pair: int) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """The arrays and numbers of a pair.

        Raises:
            InputError: a missing or damaged shard.
        """
        shard, key = pair // self.card["pairs_per_shard"], f"{pair:08d}"
        file, found = self.file(shard), {}
        check_path(file, "shard")
        with reading(file, "a shard of pairs"):
            if shard not in self._places:
                with tarfile.open(file, "r:") as tar:
                    self._places[shard] = {
                        each.name: (each.offset_data, each.size) for each in tar if each.isreg()
                    }
            size = file.stat().st_size
            with file.open("rb") as stream:
                for name in [*(f"{each}.npy" for each in self.card["arrays"]), "json"]:
                    place = self._places[shard].get(f"{key}.{name}")
                    if place is None or sum(place) > size:
                        raise InputError(
                            f"{file} is damaged and lacks {key}.{name}: remove it, and make the set again"
                        )
                    stream.seek(place[0])
                    found[name] = stream.read(place[1])
            numbers = read_json(found.pop("json"), f"{file}: {key}.json")
            if lacking := self.card["numbers"].keys() - numbers.keys():
                raise InputError(f"{file} is damaged: {key}.json lacks {', '.join(sorted(lacking))}")
            return {name.removesuffix(".npy"): self._array(name, data) for name, data in found.items()}, numbers

    def _array(self, name: str, data: bytes) -> NDArray[Any]:
        """The array of a file, whose header must state what the card states."""
        stated, stream = self.card["arrays"][name.removesuffix(".npy")], io.BytesIO(data)
        np.lib.format.read_magic(stream)
        shape, _, kind = np.lib.format.read_array_header_1_0(stream)
        if list(shape) != stated["shape"] or kind.name != stated["dtype"] or kind.hasobject:
            raise InputError(f"{name} is {shape} {kind}, and the card states {stated['shape']} {stated['dtype']}")
        return np.frombuffer(data, kind, offset=stream.tell()).reshape(shape).copy()


def _add(tar: tarfile.TarFile, name: str, data: io.BytesIO) -> None:
    """Add a file with nothing in its header that differs between runs."""
    header = tarfile.TarInfo(name)
    header.size = data.getbuffer().nbytes
    data.seek(0)
    tar.addfile(header, data)


def shards_at(path: Path) -> Shards:
    """The data set in a folder.

    Raises:
        InputError: none is there, or its card is damaged or of a newer version.
    """
    check_path(path, "data set")
    file = path / CARD
    if not file.is_file():
        raise InputError(
            f"{path} is no data set of vcc: it contains no {CARD}. Give the folder of one, or a new name"
        )
    card = read_json(read_bytes(file), str(file))
    counts = [card.get(name) for name in ("format_version", "pairs", "pairs_per_shard", "shards")]
    if not all(type(each) is int and each > 0 for each in counts):
        raise InputError(f"{file} is not the card of a data set, or is damaged: its counts are {counts}")
    version, pairs, per_shard, shards = (each or 0 for each in counts)
    if version > FORMAT_VERSION:
        raise InputError(
            f"{file} has format_version {version}, and this vcc reads {FORMAT_VERSION}: use a newer vcc"
        )
    arrays = card.get("arrays")
    stated = isinstance(arrays, dict) and all(
        isinstance(each, dict) and "shape" in each for each in arrays.values()
    )
    stated = stated and "recording" in arrays and isinstance(card.get("numbers"), dict)  # type: ignore[operator]
    if shards != -(-pairs // per_shard) or pairs > MOST_PAIRS or not stated:
        raise InputError(f"{file} is damaged: pairs, shards and arrays do not fit together")
    return Shards(path, card)
