"""The chunks of a view's file, read and unpacked at once where they are packed as ours are.

Zarr hands each chunk to an event loop that all threads of a process share: about half a millisecond a chunk of
128 KiB, several times what reading and unpacking take, and two threads wait for it as long as one. Here each
thread reads for itself, and only the chunks that it needs. What is packed in any other way Zarr reads.
"""

from __future__ import annotations

import itertools
import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

NOT_THERE = 2**64 - 1
"""How the index of a Zarr shard says that a chunk was never written."""
INDEX, CHECK, BLOSC = 16, 4, 16
"""Bytes: of a chunk in the index of a shard (place, size), of a checksum, of the head of what Blosc packed."""

Range = tuple[int, int]


def sharding(array: Any) -> dict[str, Any]:
    """The configuration of a Zarr array's sharding codec; empty for none."""
    for codec in array.metadata.to_dict()["codecs"]:
        if codec["name"] == "sharding_indexed":
            return dict(codec["configuration"])
    return {}


@dataclass(frozen=True)
class Chunked:
    """How the file of a view is cut into chunks, each packed by itself.

    Args:
        view: (rows, columns[, channels]) of pixels of a view.
        chunk: likewise, of a chunk; those at the end of a view go on beyond it.
        counts: how many chunks there are along each axis.
        at_end: whether the index of the chunks stands at the end of the file, or else at its beginning.
        kind: of the samples as they lie in the file; None where Zarr alone knows how they are packed.
    """

    view: tuple[int, ...]
    chunk: tuple[int, ...]
    counts: tuple[int, ...]
    at_end: bool
    kind: np.dtype[Any] | None

    @classmethod
    def of(cls, array: Any) -> Self | None:
        """How a Zarr array of light-field samples is cut; None where a view is one chunk without an index."""
        if array.shards is None:
            return None
        stated = sharding(array)
        names = [codec["name"] for codec in stated["codecs"]]
        order = stated["codecs"][0].get("configuration", {}).get("endian", "little")
        ours = names == ["bytes", "blosc", "crc32c"]
        chunk = tuple(array.chunks[2:])
        return cls(
            tuple(array.shape[2:]),
            chunk,
            tuple(math.ceil(whole / part) for whole, part in zip(array.shards[2:], chunk, strict=True)),
            stated.get("index_location", "end") == "end",
            np.dtype(array.dtype).newbyteorder("<" if order == "little" else ">") if ours else None,
        )

    def index(self, file: Path) -> NDArray[np.uint64]:
        """(place, size) in bytes of each chunk of a file, (chunks, 2).

        Raises:
            ValueError: it is cut off, or a chunk was never written: Zarr would read zeros there.
        """
        chunks, size = math.prod(self.counts), file.stat().st_size
        index_size = INDEX * chunks + CHECK
        if size < index_size:
            raise ValueError(f"it has {size:,} bytes, and the index of its chunks alone {index_size:,}")
        with file.open("rb") as stream:
            stream.seek(size - index_size if self.at_end else 0)
            packed = stream.read(index_size)
        index = np.frombuffer(packed[:-CHECK], dtype="<u8").reshape(chunks, 2)
        absent = int((index[:, 0] == NOT_THERE).sum())
        if absent:
            raise ValueError(f"{absent} of its {chunks} chunks were never written")
        if self.kind is not None:
            _check(packed, "the index of its chunks")
        return index

    def read(self, file: Path, rows: Range, columns: Range) -> NDArray[Any]:
        """Some pixels of a view, of whose file the chunks that hold them are read and no others.

        Args:
            file: of the view.
            rows: first row of pixels and the row after the last.
            columns: likewise.

        Returns:
            (rows, columns[, channels]), as stored.

        Raises:
            ValueError: the file is cut off or damaged, or holds something else.
        """
        assert self.kind is not None
        index = self.index(file).reshape(*self.counts, 2)
        ends = [rows, columns, *((0, size) for size in self.view[2:])]
        room = np.empty([stop - first for first, stop in ends], self.kind)
        needed = [
            range(first // size, -(-stop // size)) for (first, stop), size in zip(ends, self.chunk, strict=True)
        ]
        with file.open("rb", buffering=0) as stream:
            for place in itertools.product(*needed):
                chunk = self._unpacked(stream, *index[place].tolist())
                _copy(chunk, [at * size for at, size in zip(place, self.chunk, strict=True)], room, ends)
        return room.astype(self.kind.newbyteorder("="), copy=False)

    def _unpacked(self, stream: Any, place: int, size: int) -> NDArray[Any]:
        """The chunk that lies somewhere in a file."""
        import imagecodecs

        assert self.kind is not None
        stream.seek(place)
        packed = stream.read(size) if size <= self._most else b""
        if len(packed) != size or size < BLOSC + CHECK:
            raise ValueError(f"no chunk of {size:,} bytes lies at {place:,}")
        _check(packed, "a chunk")
        samples, _, whole = struct.unpack_from("<III", packed, 4)  # what Blosc says of itself
        bytes_each = math.prod(self.chunk) * self.kind.itemsize
        if samples != bytes_each or whole != size - CHECK:
            raise ValueError(f"a chunk of {bytes_each:,} bytes says that it has {samples:,}, packed {whole:,}")
        return np.frombuffer(imagecodecs.blosc_decode(packed[:-CHECK]), self.kind).reshape(self.chunk)

    @property
    def _most(self) -> int:
        """Bytes that no packed chunk exceeds: what cannot be packed Blosc keeps as it is."""
        assert self.kind is not None
        return math.prod(self.chunk) * self.kind.itemsize + BLOSC + CHECK


def _check(packed: bytes, what: str) -> None:
    """Hold bytes against the checksum at their end.

    Raises:
        ValueError: they are others.
    """
    import google_crc32c

    if google_crc32c.value(packed[:-CHECK]) != int.from_bytes(packed[-CHECK:], "little"):
        raise ValueError(f"the checksum of {what} is another")


def _copy(chunk: NDArray[Any], start: list[int], room: NDArray[Any], ends: list[Range]) -> None:
    """Put into a room, which holds what lies between some ends, what a chunk that begins at a place has of it."""
    shared = [
        (max(at, first), min(at + size, stop))
        for at, size, (first, stop) in zip(start, chunk.shape, ends, strict=True)
    ]
    here = tuple(slice(a - first, b - first) for (a, b), (first, _) in zip(shared, ends, strict=True))
    there = tuple(slice(a - at, b - at) for (a, b), at in zip(shared, start, strict=True))
    room[here] = chunk[there]
