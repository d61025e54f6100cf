"""The container of Lytro's files, ``.lfp`` and ``.lfr``: its sections, with checked bytes.

A container is a header, a table of contents in JSON, and blobs that the table names by their SHA-1::

    89 4C 46 50 0D 0A 1A 0A  00 00 00 01  00 00 00 00    the file begins
    89 4C 46 4D 0D 0A 1A 0A  00 00 00 00                 the table of contents; 43 for 4D: a blob
        length, 4 bytes, big-endian
        "sha1-" and 40 hexadecimal digits
        35 zeros
        data, and zeros up to a multiple of 16 bytes
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, BinaryIO

from vcc.base.errors import InputError
from vcc.base.reading import check_file, read_json

_FILE = bytes.fromhex("894C46500D0A1A0A")
_CONTENTS = bytes.fromhex("894C464D0D0A1A0A")
_BLOB = bytes.fromhex("894C46430D0A1A0A")
_FILE_HEADER = 16
_SECTION_HEADER = 96  # magic 8, zeros 4, length 4, name 45, zeros 35
_NAME = slice(16, 61)
_ALIGNMENT = 16


def begins_as_container(path: Path) -> bool:
    """Whether a file begins with the signature of a container; False for an unreadable file."""
    try:
        with path.open("rb") as file:
            return file.read(len(_FILE)) == _FILE
    except OSError:
        return False


class Container:
    """The sections of a file, located by their headers; their bytes are read on access."""

    def __init__(self, path: Path) -> None:
        self.path = path
        check_file(path)
        self._file: BinaryIO = path.open("rb")
        try:
            self._size = path.stat().st_size
            self._blobs: dict[str, tuple[int, int]] = {}
            self._contents = self._walk()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Container:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def fault(self, words: str) -> InputError:
        """An `InputError` for this file."""
        return InputError(f"{self.path}: {words}")

    def contents(self) -> dict[str, Any]:
        """The table of contents."""
        return self.json(self._contents, "its table of contents")

    def length_of(self, name: str) -> int | None:
        """Length of a section in bytes; None if it is not in the file."""
        return self._blobs[name][1] if name in self._blobs else None

    def bytes_of(self, name: str, what: str) -> bytes:
        """The bytes of a section, checked against the SHA-1 in its name."""
        if name not in self._blobs:
            raise self.fault(f"{what} ({name}) is not in the file. Copy it again from where it came from")
        start, length = self._blobs[name]
        self._file.seek(start)
        data = self._file.read(length)
        if "sha1-" + hashlib.sha1(data, usedforsecurity=False).hexdigest() != name:
            raise self.fault(
                f"{what} is damaged: its SHA-1 is not {name}. Copy the file again from where it came from"
            )
        return data

    def json(self, name: str, what: str) -> dict[str, Any]:
        """The JSON object in a section."""
        return read_json(self.bytes_of(name, what).rstrip(b"\0"), f"{self.path}: {what}")

    def _walk(self) -> str:
        """Locate all sections; returns the name of the table of contents."""
        header = self._file.read(_FILE_HEADER)
        if header[: len(_FILE)] != _FILE:
            raise self.fault(
                f"it begins with {header[:8].hex(' ').upper() or 'nothing'}, not with "
                f"{_FILE.hex(' ').upper()}, so it is not a container of a Lytro camera"
            )
        place, contents = _FILE_HEADER, None
        while place < self._size:
            self._file.seek(place)
            header = self._file.read(_SECTION_HEADER)
            if header[:8] not in (_CONTENTS, _BLOB):
                if not header.strip(b"\0"):
                    break  # padding after the last section
                raise self.fault(
                    f"byte {place:,} begins with {header[:8].hex(' ').upper()}, not the start of a section"
                )
            length = int.from_bytes(header[12:16], "big")
            start = place + _SECTION_HEADER
            if start + length > self._size:
                missing = start + length - self._size
                raise self.fault(
                    f"{missing:,} bytes are missing at its end (the section at byte {place:,} has {length:,} "
                    "bytes). Copy it again from where it came from"
                )
            name = header[_NAME].decode("ascii", "replace")
            self._blobs[name] = (start, length)
            if header[:8] == _CONTENTS:
                contents = name
            place = start + -(-length // _ALIGNMENT) * _ALIGNMENT
        if contents is None:
            raise self.fault("it has no table of contents. Copy it again from where it came from")
        return contents
