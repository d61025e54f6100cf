"""Files of Gaussian splats: PLY of 3D Gaussian splatting, .splat, .spz and GLB with KHR_gaussian_splatting.

Sources: the layout of point_cloud.ply in the code release of Kerbl et al. 2023; .splat as the viewer by Kevin Kwok
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
from vcc.files.atomic import atomic_path
from vcc.sources.splats.cloud import DEGREE_0, HIGHEST_DEGREE, UP_OF_GLTF, Floats, Splats, unit_quaternions
from vcc.sources.splats.glb import read_glb

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
            return _read_ply(found)
        if ending == ".splat":
            return _read_splat(found)
        if ending == ".spz":
            return _read_spz(found)
        return read_glb(found)


# --- PLY ---

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_LONGEST_HEADER = 2**16
_NEEDED = ("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
           *(f"scale_{n}" for n in range(3)), *(f"rot_{n}" for n in range(4)))  # fmt: skip


def _read_ply(path: Path) -> Splats:
    with path.open("rb") as file:
        head = file.read(_LONGEST_HEADER)
    order, elements, start = _ply_header(head)
    if "vertex" not in [name for name, _, _ in elements]:
        raise InputError("the PLY has no element vertex: it holds no splats")
    for name, count, fields in elements:
        if name == "vertex":
            break
        if any(kind == "list" for _, kind in fields):
            raise InputError(f"the PLY has lists in its element {name} before the splats, which is not supported")
        start += count * sum(np.dtype(kind).itemsize for _, kind in fields)
    names = [field for field, _ in fields]
    if "packed_position" in names:
        raise InputError(
            "the PLY is compressed (PlayCanvas), which is not supported: convert it with splat-transform to .ply"
        )
    missing = [field for field in _NEEDED if field not in names]
    if missing:
        kind = "a mesh or points" if "f_dc_0" in missing and "rot_0" in missing else "splats of another kind"
        raise InputError(
            f"the PLY has no {', '.join(missing[:4])}{' …' if len(missing) > 4 else ''}, which 3D Gaussian "
            f"splatting writes: it holds {kind}"
        )
    wrong = [field for field, kind in fields if field in _NEEDED and kind not in ("f4", "f8")]
    if wrong or len(set(names)) < len(names):
        raise InputError(
            f"the PLY has integers, lists or a name twice in its fields ({', '.join(wrong or names)})"
        )
    layout = np.dtype([(field, order + kind) for field, kind in fields])
    size = path.stat().st_size
    if start + count * layout.itemsize > size:
        raise InputError(
            f"the PLY is truncated: its header states {count} splats of {layout.itemsize} bytes, and after it "
            f"there are {max(size - start, 0)} bytes"
        )
    rest = sum(field.startswith("f_rest_") for field in names)
    if rest not in (0, 9, 24, 45) or any(f"f_rest_{n}" not in names for n in range(rest)):
        raise InputError(
            f"the PLY has {rest} fields f_rest_…: 0, 9, 24 or 45 for harmonics up to degree 0, 1, 2 or 3"
        )
    table = np.memmap(path, layout, "r", start, (count,)) if count else np.zeros(0, layout)

    def columns(*wanted: str) -> Floats:
        out = np.empty((count, len(wanted)), np.float32)
        for n, field in enumerate(wanted):
            out[:, n] = table[field]
        return out

    harmonics = np.empty((count, 1 + rest // 3, 3), np.float32)
    for channel in range(3):
        harmonics[:, 0, channel] = table[f"f_dc_{channel}"]
        for n in range(rest // 3):  # channel by channel
            harmonics[:, 1 + n, channel] = table[f"f_rest_{channel * (rest // 3) + n}"]
    with np.errstate(over="ignore"):  # checked by Splats
        return Splats(
            columns("x", "y", "z"),
            np.exp(columns("scale_0", "scale_1", "scale_2")),
            unit_quaternions(columns("rot_0", "rot_1", "rot_2", "rot_3")),
            np.asarray(1 / (1 + np.exp(-columns("opacity")[:, 0])), dtype=np.float32),
            harmonics,
        )


def _ply_header(head: bytes) -> tuple[str, list[tuple[str, int, list[tuple[str, str]]]], int]:
    """Byte order, elements as (name, count, fields as (name, type)), and the offset of the data."""
    end = head.find(b"end_header")
    newline = head.find(b"\n", end) if end >= 0 else -1
    if not head.startswith(b"ply") or newline < 0:
        raise InputError("this is not a PLY: it has no header from ply to end_header")
    order = ""
    elements: list[tuple[str, int, list[tuple[str, str]]]] = []
    for line in head[:end].decode("ascii", "replace").splitlines()[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) > 1:
            if words[1] == "ascii":
                raise InputError("the PLY is text (format ascii): save it as binary_little_endian")
            order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(words[1], "")
        elif words[0] == "element" and len(words) == 3 and words[2].isdigit() and len(words[2]) < 16:
            elements.append((words[1], int(words[2]), []))
        elif words[0] == "property" and len(words) == 3 and elements and words[1] in _PLY_TYPES:
            elements[-1][2].append((words[2], _PLY_TYPES[words[1]]))
        elif words[0] == "property" and len(words) == 5 and elements and words[1] == "list":
            elements[-1][2].append((words[4], "list"))
        else:
            raise InputError(f'the header of the PLY has the line "{line[:60]}", which is not PLY')
    if not order:
        raise InputError("the header of the PLY states no format")
    return order, elements, newline + 1


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
    kept = min(degree, HIGHEST_DEGREE)
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


def write_ply(splats: Splats, path: str | PathLike[str]) -> None:
    """Write splats as a PLY of 3D Gaussian splatting, in single precision.

    Args:
        splats: opacities are written at least 1e-6 away from 0 and 1, sizes of 0 as 1e-12.
        path: the file, replaced if it exists. The transfer, the low-pass and the axes are not part of the format.

    Raises:
        InputError: the file cannot be written.
    """
    rest = splats.harmonics[:, 1:].transpose(0, 2, 1).reshape(len(splats.positions), -1)
    opacity = np.clip(splats.opacities.astype(np.float64), 1e-6, 1 - 1e-6)
    named = {
        **{name: splats.positions[:, n] for n, name in enumerate("xyz")},
        **{f"f_dc_{n}": splats.harmonics[:, 0, n] for n in range(3)},
        **{f"f_rest_{n}": rest[:, n] for n in range(rest.shape[1])},
        "opacity": np.log(opacity / (1 - opacity)),
        **{f"scale_{n}": np.log(np.maximum(splats.sizes[:, n], 1e-12)) for n in range(3)},
        **{f"rot_{n}": splats.rotations[:, n] for n in range(4)},
    }
    table = np.empty(len(splats.positions), [(name, "<f4") for name in named])
    for name, values in named.items():
        table[name] = values
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}"]
    lines += [*(f"property float {name}" for name in named), "end_header", ""]
    with atomic_path(path) as part:
        part.write_bytes("\n".join(lines).encode() + table.tobytes())
