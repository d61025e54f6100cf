"""What a bomb is, and what bombs of all formats are made with."""

from __future__ import annotations

import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz import readers, seeds
from tests.fuzz.readers import Read
from tests.fuzz.seeds import Maker

Data = bytes | Callable[[], bytes]
Deflated = tuple[bytes, int, int]
"""Raw deflate, and CRC-32 and size of what it unpacks to."""


@dataclass(frozen=True)
class Bomb:
    """A bomb.

    Args:
        make: fills a folder.
        target: what is opened of it; empty for the folder.
        read: opens it.
        options: for that.
        refused: whether it must be; else it may also be read.
    """

    make: Maker
    target: str
    read: Callable[..., Read] = readers.field
    options: dict[str, Any] = field(default_factory=dict)
    refused: bool = True


def written(name: str, data: Data) -> Maker:
    """A single file."""
    return lambda folder: (folder / name).write_bytes(data() if callable(data) else data)


def changed(first: Maker, name: str, data: bytes | Callable[[bytes], bytes]) -> Maker:
    """A seed with a file put in place of another, or made of that."""

    def make(folder: Path) -> None:
        first(folder)
        file = folder / name
        file.write_bytes(data(file.read_bytes()) if callable(data) else data)

    return make


def all_views(data: Data, ending: str) -> Maker:
    """The same file as each of four views."""

    def make(folder: Path) -> None:
        body = data() if callable(data) else data
        for j, i in np.ndindex(2, 2):
            (folder / f"v_{j}_{i}{ending}").write_bytes(body)

    return make


def view() -> np.ndarray:
    """A small picture."""
    picture: np.ndarray = seeds.scene()[0, 0]
    return picture


def npy(shape: Any, kind: str = "<f4") -> bytes:
    """The header of an array."""
    header = f"{{'descr': {kind!r}, 'fortran_order': False, 'shape': {shape!r}, }}".encode()
    header += b" " * (-(len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header


def deflated(data: bytes) -> Deflated:
    """Something packed as it usually is."""
    return zlib.compress(data)[2:-4], zlib.crc32(data), len(data)


def zeros_deflated(megabytes: int, before: bytes = b"", after: bytes = b"") -> Deflated:
    """Zeros between two texts, packed quickly: one block, repeated."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    head = packer.compress(before) + packer.flush(zlib.Z_FULL_FLUSH)
    block = packer.compress(bytes(2**20)) + packer.flush(zlib.Z_FULL_FLUSH)
    crc = zlib.crc32(before)
    for _ in range(megabytes):
        crc = zlib.crc32(bytes(2**20), crc)
    tail = packer.compress(after) + packer.flush()
    return head + block * megabytes + tail, zlib.crc32(after, crc), len(before) + megabytes * 2**20 + len(after)


def zip_of(name: str, members: Callable[[], list[tuple[str, bytes]]]) -> Maker:
    """An archive of these members."""

    def make(folder: Path) -> None:
        with warnings.catch_warnings(), zipfile.ZipFile(folder / name, "w", zipfile.ZIP_DEFLATED) as archive:
            warnings.simplefilter("ignore")  # of two members of a name
            for member, body in members():
                archive.writestr(member, body)

    return make


def zip_of_deflated(name: str, members: Callable[[], dict[str, Deflated]]) -> Maker:
    """An archive of members that are packed already."""

    def make(folder: Path) -> None:
        body, index, packed = b"", b"", members()
        for member, (raw, crc, size) in packed.items():
            common = struct.pack("<HHHHHIIIHH", 20, 0, 8, 0, 0, crc, len(raw), size, len(member), 0)
            index += b"PK\x01\x02\x14\0" + common + struct.pack("<HHHII", 0, 0, 0, 0, len(body)) + member.encode()
            body += b"PK\x03\x04" + common + member.encode() + raw
        sizes = struct.pack("<HHHHIIH", 0, 0, len(packed), len(packed), len(index), len(body), 0)
        (folder / name).write_bytes(body + index + b"PK\x05\x06" + sizes)

    return make
