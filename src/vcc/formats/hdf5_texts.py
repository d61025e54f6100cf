"""Variable-length texts in attributes of HDF5 files, read without the library.

Such a text is in a global heap collection, and the attribute contains its length and address. The library (up
to 2.0) hangs at a collection with an object of length zero, and allocates as much memory as the length states.
Source of the structure: "HDF5 File Format Specification", version 3.0, The HDF Group: III.E (collections),
IV.A.1 (object headers), IV.A.2.m (attributes).
"""

from __future__ import annotations

import itertools
import mmap
from collections.abc import Iterator
from pathlib import Path

from vcc.formats.hdf5 import BEGINNINGS, MAGIC

_CONTINUED, _ATTRIBUTE = 0x10, 0x0C  # types of header messages
_SHARED = 2  # flag of a message stored elsewhere
_TIMES, _PHASES, _ORDERED = 0x20, 0x10, 0x04  # flags of a version 2 header
_PLACE = 16  # bytes of a text's length, the address of its collection and its index there
_HEADER = 16  # bytes: of a collection, and of each object in it
_MOST_MESSAGES = 10_000


class NotReadable(Exception):
    """A fault of a text, for messages."""


def texts(path: Path, header: int, name: str | bytes, count: int) -> list[str]:
    """Read the texts of an attribute.

    Args:
        path: the file.
        header: address of the object with the attribute, as the library counts it.
        name: name of the attribute; bytes if it is not UTF-8.
        count: number of texts.

    Raises:
        NotReadable: the attribute is damaged or missing.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        start = next(place for place in BEGINNINGS if data[place : place + len(MAGIC)] == MAGIC)
        content = _Bytes(data, start)
        wanted = name if isinstance(name, bytes) else name.encode("utf-8", "surrogateescape")
        listed = (at for kind, at in _messages(content, header) if kind == _ATTRIBUTE)
        for at in itertools.chain(listed, _anywhere(content, wanted)):
            places = _data(content, at, wanted, _PLACE * count)
            if places is not None:
                return [_text(content, places[_PLACE * n : _PLACE * (n + 1)]) for n in range(count)]
    raise NotReadable("it is not there")


class _Bytes:
    """A file's bytes by address; raises for addresses outside the file."""

    def __init__(self, data: mmap.mmap, start: int) -> None:
        self._data, self._start = data, start

    def __call__(self, at: int, size: int) -> bytes:
        found = self._data[self._start + at : self._start + at + size] if at < len(self._data) else b""
        if len(found) != size:
            raise NotReadable("it is outside the file")
        return found

    def number(self, at: int, size: int) -> int:
        return int.from_bytes(self(at, size), "little")

    def find(self, wanted: bytes) -> Iterator[int]:
        """Addresses of these bytes."""
        at = self._data.find(wanted, self._start)
        while at >= 0:
            yield at - self._start
            at = self._data.find(wanted, at + 1)


def _messages(content: _Bytes, header: int) -> Iterator[tuple[int, int]]:
    """(type, address) of the messages of a header."""
    blocks, flags = [_first_block(content, header)], 0
    new = content(header, 4) == b"OHDR"
    if new:
        flags = content.number(header + 5, 1)
    count = 0
    for at, size in blocks:  # grows during the loop
        end = at + size
        head = (6 if flags & _ORDERED else 4) if new else 8
        while at + head <= end:
            kind = content.number(at, 1 if new else 2)
            length, shared = content.number(at + (1 if new else 2), 2), content.number(at + (3 if new else 4), 1)
            at += head
            count += 1
            if count > _MOST_MESSAGES or at + length > end:
                raise NotReadable("the header of its object is damaged")
            if kind == _CONTINUED:
                place, extent = content.number(at, 8), content.number(at + 8, 8)
                blocks.append(
                    (place + 4, extent - 8) if new else (place, extent)
                )  # between signature and checksum
            elif not shared & _SHARED:
                yield kind, at
            at += length


def _first_block(content: _Bytes, header: int) -> tuple[int, int]:
    """(address, size) of the messages in the header's first block."""
    if content(header, 4) != b"OHDR":
        return header + 16, content.number(header + 8, 4)
    flags = content.number(header + 5, 1)
    at = header + 6 + (16 if flags & _TIMES else 0) + (4 if flags & _PHASES else 0)
    width = 1 << (flags & 3)
    return at + width, content.number(at, width)


def _anywhere(content: _Bytes, name: bytes) -> Iterator[int]:
    """Addresses in the file at which messages of an attribute of this name may begin.

    If an object has more than eight attributes, they may be in a separate heap (since version 1.8), message by
    message.
    """
    for at in content.find(name + b"\0"):
        for before in (8, 9):
            if at >= before and content.number(at - before + 2, 2) == len(name) + 1:
                yield at - before


def _data(content: _Bytes, at: int, name: bytes, size: int) -> bytes | None:
    """The first bytes of the data of an attribute's message; None if the name differs."""
    version = content.number(at, 1)
    sizes = [content.number(at + 2 + 2 * n, 2) for n in range(3)]  # of name, type and shape
    step = 8 if version == 1 else 1
    begin = at + (9 if version == 3 else 8)
    if version not in (1, 2, 3) or content(begin, sizes[0]).rstrip(b"\0") != name:
        return None
    return content(begin + sum(-(-each // step) * step for each in sizes), size)


def _text(content: _Bytes, place: bytes) -> str:
    """The text at an address in a collection."""
    length, address, number = (int.from_bytes(place[a:b], "little") for a, b in ((0, 4), (4, 12), (12, 16)))
    if length == 0:
        return ""
    if content(address, 4) != b"GCOL":
        raise NotReadable("its address is not a collection of texts")
    end = address + content.number(address + 8, 8)
    at = address + _HEADER
    while at + _HEADER <= end:
        found, size = content.number(at, 2), content.number(at + 8, 8)
        if found == number != 0 and length <= size:
            return content(at + _HEADER, length).rstrip(b"\0").decode("utf-8", "replace")
        if found == 0:  # the rest is free space
            break
        at += _HEADER + -(-size // 8) * 8
    raise NotReadable("it is not at its address")
