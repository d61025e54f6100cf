"""Parsing of JPEG headers, and a check that the coded data are complete.

libjpeg fills missing data with grey without a warning, and decodes as many scans as the file declares. Source
of the structure: ITU-T T.81 (1992), annex B.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_MARKER = re.compile(rb"\xff+[^\x00\xff]")
_RESTART = re.compile(rb"\xff[\xd0-\xd7]")
_FRAMES = {0xC0: "sequential", 0xC1: "sequential", 0xC2: "progressive", 0xC3: "lossless"}
_OTHER_FRAMES = frozenset(range(0xC5, 0xD0)) - {0xC8, 0xCC}
_ALONE = frozenset({0x01, *range(0xD0, 0xD9)})  # markers without a segment
_SCAN, _RESTARTS, _END = 0xDA, 0xDD, 0xD9


class NotThere(Exception):
    """A fault of a JPEG, as text for people."""


@dataclass(frozen=True)
class Scan:
    """One pass over the picture.

    Args:
        components: identifiers of the components in the scan.
        restarts: number of units between restart markers; 0 for none.
        start: offset of the first byte of coded data.
        end: offset of the byte after the coded data.
    """

    components: tuple[int, ...]
    restarts: int
    start: int
    end: int


@dataclass(frozen=True)
class Jpeg:
    """The size and the scans of a JPEG.

    Args:
        coding: "sequential", "progressive" or "lossless".
        bits: bits of a sample.
        height: rows.
        width: columns.
        sampling: (down, across) of each component by its identifier: blocks of the component in a unit.
        scans: all of them.
    """

    coding: str
    bits: int
    height: int
    width: int
    sampling: dict[int, tuple[int, int]]
    scans: tuple[Scan, ...]

    def blocks(self, component: int, alone: bool) -> tuple[int, int]:
        """(rows, columns) of a component's blocks: in a scan of this component alone, or padded to whole units."""
        most_down, most_across = (max(each[axis] for each in self.sampling.values()) for axis in (0, 1))
        side = 1 if self.coding == "lossless" else 8
        down, across = self.sampling[component]
        if alone:
            rows, columns = -(-self.height * down // most_down), -(-self.width * across // most_across)
            return -(-rows // side), -(-columns // side)
        units = -(-self.height // (side * most_down)), -(-self.width // (side * most_across))
        return units[0] * down, units[1] * across

    def units(self, scan: Scan) -> int:
        """Number of units in a scan."""
        first = scan.components[0]
        alone = len(scan.components) == 1
        rows, columns = self.blocks(first, alone)
        down, across = (1, 1) if alone else self.sampling[first]
        return rows * columns // (down * across)


def parsed(data: bytes) -> Jpeg:
    """Parse the header and the scans of a JPEG.

    Raises:
        NotThere: not a JPEG, no end marker, several frames, no size, an unsupported coding, or missing restart
            markers.
    """
    if not data.startswith(b"\xff\xd8"):
        raise NotThere("it does not begin as one")
    head: tuple[str, int, int, int, dict[int, tuple[int, int]]] | None = None
    scans: list[Scan] = []
    restarts, place, ends = 0, 2, None
    while found := _MARKER.search(data, place):
        marker, place = data[found.end() - 1], found.end()
        if marker == _END and scans and head is not None:
            jpeg = Jpeg(*head, tuple(scans))
            _check_restarts(jpeg, data)
            return jpeg
        if marker in _ALONE or marker == _END:
            continue
        length = int.from_bytes(data[place : place + 2], "big")
        segment = data[place + 2 : place + length]
        if length < 2 or len(segment) != length - 2:
            break
        place += length
        if marker in _FRAMES or marker in _OTHER_FRAMES:
            if head is not None or marker not in _FRAMES:
                raise NotThere("its coding is not known (arithmetic or hierarchical)")
            head = _frame(_FRAMES[marker], segment)
        elif marker == _RESTARTS:
            restarts = int.from_bytes(segment[:2], "big")
        elif marker == _SCAN:
            if head is None:
                break
            ends = _ends_of_scans(data) if ends is None else ends
            end = int(ends[np.searchsorted(ends, place)])
            scans.append(_scan(segment, head[4], restarts, place, end))
            place = scans[-1].end
    raise NotThere("the end of the picture is missing")


def _ends_of_scans(data: bytes) -> NDArray[np.intp]:
    """Offsets at which coded data may end: markers other than restarts, and the end of the file."""
    codes = np.frombuffer(data, np.uint8)
    found = np.flatnonzero(codes[:-1] == 255)
    after = codes[found + 1]
    ends = found[(after != 0) & (after != 255) & (after & 0xF8 != 0xD0)]
    return np.append(ends, len(data))


def longer(jpeg: Jpeg, data: bytes, filling: bytes) -> bytes:
    """The same JPEG with extra bytes after each scan: a decoder reads them only if data are missing."""
    parts, last = [], 0
    for scan in jpeg.scans:
        parts += [data[last : scan.end], filling]
        last = scan.end
    return b"".join([*parts, data[last:]])


def least_bytes(jpeg: Jpeg) -> int:
    """Lower bound for the size of the data: each block takes at least one bit in its first scan."""
    counted = [jpeg.blocks(component, True) for component in jpeg.sampling]
    return sum(rows * columns for rows, columns in counted) // 8


def _frame(coding: str, segment: bytes) -> tuple[str, int, int, int, dict[int, tuple[int, int]]]:
    bits, height, width, count = (
        segment[0] if segment else 0,
        int.from_bytes(segment[1:3], "big"),
        int.from_bytes(segment[3:5], "big"),
        segment[5] if len(segment) > 5 else 0,
    )
    listed = [segment[6 + 3 * n : 9 + 3 * n] for n in range(count)]
    sampling = {each[0]: (each[1] & 15, each[1] >> 4) for each in listed if len(each) == 3}
    if not (height and width and count and len(sampling) == count and all(map(all, sampling.values()))):
        raise NotThere(f"it states {width}×{height} pixels of {count} components")
    return coding, bits, height, width, sampling


def _scan(segment: bytes, sampling: dict[int, tuple[int, int]], restarts: int, start: int, end: int) -> Scan:
    count = segment[0] if segment else 0
    components = tuple(segment[1 : 1 + 2 * count : 2])
    if not components or len(components) != count or not set(components) <= sampling.keys():
        raise NotThere("a scan is of components that it does not have")
    return Scan(components, restarts, start, end)


def _check_restarts(jpeg: Jpeg, data: bytes) -> None:
    """Raise if restart markers are missing: after a missing one, the library continues in grey."""
    for scan in jpeg.scans:
        if scan.restarts:
            wanted = -(-jpeg.units(scan) // scan.restarts) - 1
            there = sum(1 for _ in _RESTART.finditer(data, scan.start, scan.end))
            if there < wanted:
                raise NotThere(f"{wanted - there} of the {wanted} parts of a scan are missing")
