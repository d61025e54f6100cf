"""Direct reading of the chunks of a view's file, for files in the layout of this package.

Zarr passes each chunk to an event loop that all threads of a process share: about half a millisecond per chunk
of 128 KiB, several times the time for reading and decompression, and without speed-up from two threads. Here
each thread reads only the chunks that it needs. Zarr reads files with other codecs.
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
"""Entry in the index of a Zarr shard for a chunk that was never written."""
INDEX, CHECK, BLOSC = 16, 4, 16
"""Bytes of an index entry (offset, size), of a checksum, and of the header of a Blosc buffer."""

Range = tuple[int, int]


def sharding(array: Any) -> dict[str, Any]:
    """The configuration of a Zarr array's sharding codec; empty if there is none."""
    for codec in array.metadata.to_dict()["codecs"]:
        if codec["name"] == "sharding_indexed":
            return dict(codec["configuration"])
    return {}


@dataclass(frozen=True)
class Chunked:
    """Layout of a view's file in separately compressed chunks.

    Args:
        view: (rows, columns[, channels]) of a view in pixels.
        chunk: likewise for a chunk; the last chunks of a view extend beyond it.
        counts: number of chunks along each axis.
        at_end: whether the index of the chunks is at the end of the file; else at its beginning.
        kind: type of the samples in the file; None if only Zarr can decode the chunks.
    """

    view: tuple[int, ...]
    chunk: tuple[int, ...]
    counts: tuple[int, ...]
    at_end: bool
    kind: np.dtype[Any] | None

    @classmethod
    def of(cls, array: Any) -> Self | None:
        """The layout of a Zarr array of light field samples; None if each view is one chunk without an index."""
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
        """(offset, size) in bytes of each chunk of a file, shape (chunks, 2).

        Raises:
            ValueError: the file is truncated, or a chunk was never written (Zarr would read it as zeros).
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
        """Read some pixels of a view; only the chunks that contain them are read.

        Args:
            file: file of the view.
            rows: first row of pixels and the row after the last.
            columns: likewise.

        Returns:
            Shape (rows, columns[, channels]), as stored.

        Raises:
            ValueError: the file is truncated, damaged or of another format.
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
        """Read and decompress the chunk at an offset."""
        import imagecodecs

        assert self.kind is not None
        stream.seek(place)
        packed = stream.read(size) if size <= self._most else b""
        if len(packed) != size or size < BLOSC + CHECK:
            raise ValueError(f"there is no chunk of {size:,} bytes at {place:,}")
        _check(packed, "a chunk")
        samples, _, whole = struct.unpack_from("<III", packed, 4)  # sizes in Blosc's header
        bytes_each = math.prod(self.chunk) * self.kind.itemsize
        if samples != bytes_each or whole != size - CHECK:
            raise ValueError(f"a chunk of {bytes_each:,} bytes says that it has {samples:,}, packed {whole:,}")
        return np.frombuffer(imagecodecs.blosc_decode(packed[:-CHECK]), self.kind).reshape(self.chunk)

    @property
    def _most(self) -> int:
        """Maximum size of a compressed chunk: Blosc stores incompressible data unchanged."""
        assert self.kind is not None
        return math.prod(self.chunk) * self.kind.itemsize + BLOSC + CHECK


def _check(packed: bytes, what: str) -> None:
    """Compare bytes with the checksum at their end.

    Raises:
        ValueError: the checksum differs.
    """
    import google_crc32c

    if google_crc32c.value(packed[:-CHECK]) != int.from_bytes(packed[-CHECK:], "little"):
        raise ValueError(f"the checksum of {what} does not match")


def _copy(chunk: NDArray[Any], start: list[int], room: NDArray[Any], ends: list[Range]) -> None:
    """Copy the overlap of a chunk that begins at ``start`` into ``room``, which covers the ranges ``ends``."""
    shared = [
        (max(at, first), min(at + size, stop))
        for at, size, (first, stop) in zip(start, chunk.shape, ends, strict=True)
    ]
    here = tuple(slice(a - first, b - first) for (a, b), (first, _) in zip(shared, ends, strict=True))
    there = tuple(slice(a - at, b - at) for (a, b), at in zip(shared, start, strict=True))
    room[here] = chunk[there]
