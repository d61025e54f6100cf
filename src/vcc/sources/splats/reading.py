"""Files of Gaussian splats: PLY of 3D Gaussian splatting, .splat, .spz and GLB with KHR_gaussian_splatting.

Sources: .splat as the viewer by Kevin Kwok
defines it; the README of nianticlabs/spz for versions 2 to 4; the glTF extension KHR_gaussian_splatting (Khronos,
ratified). Coordinates stay those of the file.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import check_file, expanded, most_unpacked, read_bytes, reading, unpacked_gzip
from vcc.sources.splats.cloud import DEGREE_0, UP_OF_GLTF, Floats, Splats, degree_kept, unit_quaternions
from vcc.sources.splats.glb import read_glb
from vcc.sources.splats.ply import read_ply

SPLAT_ENDINGS = (".ply", ".splat", ".spz", ".glb")
"""Supported file extensions."""


def read_splats(path: str | PathLike[str]) -> Splats:
    """Read a cloud of Gaussian splats.

    Args:
        path: a file .ply, .splat, .spz or .glb.

    Returns:
        The splats, in the axes of the file: y down by convention in PLY and .splat, up in .spz and glTF.

    Raises:
        InputError: another ending; a file that is missing, truncated or damaged, has other fields or types, or
            contains invalid numbers.
    """
    found = expanded(path)
    ending = found.suffix.lower()
    if ending not in SPLAT_ENDINGS:
        raise InputError(
            f'{found} has the ending "{found.suffix}"; splats are read from {", ".join(SPLAT_ENDINGS)}. '
            "splat-transform of PlayCanvas converts other formats to .ply"
        )
    check_file(found, "file of splats")
    with reading(found, "Gaussian splats"):
        if ending == ".ply":
            return read_ply(found)
        if ending == ".splat":
            return _read_splat(found)
        if ending == ".spz":
            return _read_spz(found)
        return read_glb(found)


# --- .splat ---

_SPLAT = np.dtype([("place", "<f4", 3), ("size", "<f4", 3), ("colour", "u1", 4), ("rotation", "u1", 4)])


def _read_splat(path: Path) -> Splats:
    data = read_bytes(path)
    if len(data) % _SPLAT.itemsize:
        raise InputError(
            f"a .splat has {_SPLAT.itemsize} bytes for each splat, and this file has {len(data)}, with "
            f"{len(data) % _SPLAT.itemsize} left over: it is truncated or something else"
        )
    table = np.frombuffer(data, _SPLAT)
    colour = np.asarray(table["colour"] / 255, dtype=np.float32)
    return Splats(
        table["place"].astype(np.float32),
        table["size"].astype(np.float32),
        unit_quaternions((table["rotation"].astype(np.float64) - 128) / 128),
        colour[:, 3].copy(),
        ((colour[:, None, :3] - 0.5) / DEGREE_0).astype(np.float32),
    )


# --- .spz ---

_MAGIC = 0x5053474E
_HARMONICS_OF_DEGREE = (0, 3, 8, 15, 24)
_COLOUR_SCALE = 0.15
_ANTIALIASED = 1


def _read_spz(path: Path) -> Splats:
    """A packed cloud; version 4 has independent Zstandard streams, versions 2 and 3 one gzip stream."""
    with path.open("rb") as file:
        first = file.read(4)
    packed = first == struct.pack("<I", _MAGIC)
    data = read_bytes(path) if packed else unpacked_gzip(path, "file of splats")
    if len(data) < 16:
        raise InputError(f"the .spz is truncated: it unpacks to {len(data)} bytes, and its header has 16")
    magic, version, count, degree, fraction, flags, streams = struct.unpack_from("<IIIBBBB", data)
    if magic != _MAGIC or version not in ((4,) if packed else (2, 3)):
        raise InputError(f"the .spz has the version {version}; versions 2, 3 and 4 are supported")
    if degree >= len(_HARMONICS_OF_DEGREE) or fraction > 23:
        raise InputError(f"the .spz states harmonics of degree {degree} and {fraction} bits of fractions")
    rest = _HARMONICS_OF_DEGREE[degree]
    widths = [9, 1, 3, 3, 3 if version == 2 else 4, 3 * rest]
    sizes = [count * width for width in widths]
    parts = _streams(path, data, streams, sizes) if packed else _consecutive(data[16:], sizes)
    place, alpha, colour, size, turned, rest_of = (
        np.frombuffer(part, np.uint8).reshape(count, width) for part, width in zip(parts, widths, strict=True)
    )
    positions = np.empty((count, 3), np.float32)
    for axis in range(3):
        low, middle, high = (place[:, 3 * axis + n].astype(np.int32) for n in range(3))
        positions[:, axis] = ((low | middle << 8 | high << 16) << 8 >> 8) / 2.0**fraction
    kept = degree_kept(degree)
    harmonics = np.empty((count, (kept + 1) ** 2, 3), np.float32)
    harmonics[:, 0] = (colour / 255 - 0.5) / _COLOUR_SCALE
    harmonics[:, 1:] = (rest_of.reshape(count, rest, 3)[:, : (kept + 1) ** 2 - 1].astype(np.float32) - 128) / 128
    return Splats(
        positions,
        np.exp(size.astype(np.float32) / 16 - 10),
        _three_of_four(turned) if version == 2 else _smallest_three(turned),
        np.asarray(alpha[:, 0] / 255, dtype=np.float32),
        harmonics,
        antialiased=bool(flags & _ANTIALIASED),
        up=UP_OF_GLTF,
    )


def _consecutive(data: bytes, sizes: Sequence[int]) -> list[bytes]:
    if sum(sizes) > len(data):
        raise InputError(
            f"the .spz is truncated: its header states {sizes[1]} splats, which have {sum(sizes)} bytes, and "
            f"after it there are {len(data)}"
        )
    ends = np.cumsum(sizes).tolist()
    return [data[end - size : end] for end, size in zip(ends, sizes, strict=True)]


def _streams(path: Path, data: bytes, streams: int, sizes: Sequence[int]) -> list[bytes]:
    """The unpacked streams of version 4; none is unpacked before its size has been checked."""
    import imagecodecs

    wanted = [size for size in sizes if size]
    table = struct.unpack_from("<I", data, 16)[0] if len(data) >= 32 else len(data)
    start = table + 16 * streams
    if table < 32 or start > len(data) or streams != len(wanted):
        raise InputError(f"the .spz is truncated or damaged: {streams} streams from byte {table} of {len(data)}")
    if sum(sizes) > most_unpacked(len(data)):
        raise InputError(
            f"the .spz states {sizes[1]} splats, {sum(sizes)} bytes, in {len(data)} bytes: no file packs as well"
        )
    found = []
    for number, size in enumerate(wanted):
        packed, unpacked = struct.unpack_from("<QQ", data, table + 16 * number)
        if unpacked != size or packed > len(data) - start:
            raise InputError(
                f"stream {number} of the .spz states {packed} bytes that unpack to {unpacked}; its splats have "
                f"{size}, and {len(data) - start} bytes are left"
            )
        out = imagecodecs.zstd_decode(data[start : start + packed], out=size)
        if len(out) != size:
            raise InputError(f"stream {number} of the .spz unpacks to {len(out)} bytes, not {size}")
        found.append(bytes(out))
        start += packed
    left = iter(found)
    return [next(left) if size else b"" for size in sizes]


def _three_of_four(packed: NDArray[np.uint8]) -> Floats:
    """Quaternions (w, x, y, z) of x, y and z as bytes, with w ≥ 0."""
    xyz = packed.astype(np.float64) / 127.5 - 1
    w = np.sqrt(np.maximum(1 - np.einsum("ij,ij->i", xyz, xyz), 0))
    return unit_quaternions(np.concatenate([w[:, None], xyz], axis=1))


def _smallest_three(packed: NDArray[np.uint8]) -> Floats:
    """Quaternions (w, x, y, z) of 32 bits: the index of the largest part, and 10 bits for each other part."""
    word = packed.astype(np.uint32) @ (1 << np.arange(0, 32, 8, dtype=np.uint32))
    largest = (word >> 30).astype(np.intp)
    xyzw = np.zeros((len(word), 4))
    for part in (3, 2, 1, 0):
        stored = largest != part
        sign = np.where(word >> 9 & 1, -1.0, 1.0)
        xyzw[:, part] = np.where(stored, sign * (word & 511) / 511 * math.sqrt(0.5), 0)
        word = np.where(stored, word >> 10, word)
    rows = np.arange(len(word))
    xyzw[rows, largest] = np.sqrt(np.maximum(1 - np.einsum("ij,ij->i", xyzw, xyzw), 0))
    return unit_quaternions(xyzw[:, [3, 0, 1, 2]])
