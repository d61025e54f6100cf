"""Data sets as WebDataset shards.

A shard is a tar file ``pairs-000000.tar`` with the files of each pair one after the other:
``00000017.recording.npy`` and so on, and its numbers in ``00000017.json``
(https://github.com/webdataset/webdataset).
"""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import check_path, read_json, reading
from vcc.dataset.destination import Destination
from vcc.dataset.recording_pairs import Pair
from vcc.files.atomic import atomic_path
from vcc.files.npy import write_npy


@dataclass(frozen=True, eq=False, repr=False)
class Shards(Destination):
    """A data set in WebDataset shards; see `Destination`."""

    kind: ClassVar[str] = "webdataset"
    how_to_read: ClassVar[str] = (
        "The .tar files are WebDataset shards: `webdataset.WebDataset(urls, shardshuffle=100).decode()`."
    )

    def mark(self, shard: int) -> Path:
        """See `Destination`."""
        return self.path / f"pairs-{shard:06d}.tar"

    def write(self, shard: int, pairs: Iterable[Pair]) -> None:
        """See `Destination`."""
        with atomic_path(self.mark(shard)) as part, tarfile.open(part, "w", format=tarfile.USTAR_FORMAT) as tar:
            for pair in pairs:
                key = f"{pair.numbers['pair']:08d}"
                for name, values in pair.arrays.items():
                    stream = io.BytesIO()
                    write_npy(values, stream)
                    _add(tar, f"{key}.{name}.npy", stream)
                _add(tar, f"{key}.json", io.BytesIO(json.dumps(pair.numbers).encode()))

    def read(self, pair: int) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """See `Destination`."""
        shard, key = pair // self.card["pairs_per_shard"], f"{pair:08d}"
        file, found = self.mark(shard), {}
        check_path(file, "shard")
        with reading(file, "a shard of pairs"):
            if shard not in self._opened:
                with tarfile.open(file, "r:") as tar:
                    self._opened[shard] = {
                        each.name: (each.offset_data, each.size) for each in tar if each.isreg()
                    }
            size = file.stat().st_size
            with file.open("rb") as stream:
                for name in [*(f"{each}.npy" for each in self.card["arrays"]), "json"]:
                    place = self._opened[shard].get(f"{key}.{name}")
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
