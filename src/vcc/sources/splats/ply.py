"""PLY files of Gaussian splats: those of 3D Gaussian splatting, and the compressed ones of PlayCanvas.

Sources: the layout of point_cloud.ply in the code release of Kerbl et al. 2023; PlayCanvas' documentation of
"compressed PLY": for each 256 splats the ranges of positions, logarithms of sizes and colours, and for each splat
four 32-bit words.
"""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.files.atomic import atomic_path
from vcc.sources.splats.cloud import DEGREE_0, Floats, Splats, unit_quaternions

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_LONGEST_HEADER = 2**16
_NEEDED = ("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
           *(f"scale_{n}" for n in range(3)), *(f"rot_{n}" for n in range(4)))  # fmt: skip


_RANGES = [f"{end}_{kind}{axis}" for kind in ("", "scale_") for end in ("min", "max") for axis in "xyz"]
_COLOURS = [f"{end}_{axis}" for end in ("min", "max") for axis in "rgb"]
_WORDS = ("packed_position", "packed_rotation", "packed_scale", "packed_color")


def read_ply(path: Path) -> Splats:
    """The splats of a PLY, in the axes of the file (y down by convention).

    Args:
        path: a file .ply.

    Raises:
        InputError: not a PLY, text, truncated, other fields or types, or invalid numbers.
    """
    tables = _tables(path)
    if "vertex" not in tables:
        raise InputError("the PLY has no element vertex before its lists: it holds no splats")
    names = tables["vertex"].dtype.names or ()
    with np.errstate(over="ignore", invalid="ignore"):  # checked by Splats
        return _unpacked(tables) if _WORDS[0] in names else _plain(tables["vertex"])


def _tables(path: Path) -> dict[str, NDArray[Any]]:
    """The elements as arrays of records, up to the first one with lists; mapped, not read."""
    with path.open("rb") as file:
        order, elements, start = _header(file.read(_LONGEST_HEADER))
    size, tables = path.stat().st_size, dict[str, NDArray[Any]]()
    for name, count, fields in elements:
        if any(kind == "list" for _, kind in fields):
            break
        if len({field for field, _ in fields}) < len(fields) or name in tables:
            raise InputError(f"the PLY has an element or a field of {name} twice")
        layout = np.dtype([(field, order + kind) for field, kind in fields])
        if start + count * layout.itemsize > size:
            raise InputError(
                f"the PLY is truncated: its header states {count} entries {name} of {layout.itemsize} bytes, and "
                f"there are {max(size - start, 0)} bytes for them"
            )
        some = count * layout.itemsize > 0
        tables[name] = np.memmap(path, layout, "r", start, (count,)) if some else np.zeros(0, layout)
        start += count * layout.itemsize
    return tables


def _plain(table: NDArray[Any]) -> Splats:
    names = table.dtype.names or ()
    missing = [field for field in _NEEDED if field not in names]
    if missing:
        raise InputError(
            f"the PLY has no {', '.join(missing[:4])}{' …' if len(missing) > 4 else ''}, which 3D Gaussian "
            "splatting writes: it holds a mesh, points or splats of another kind"
        )
    rest = sum(field.startswith("f_rest_") for field in names)
    if rest not in (0, 9, 24, 45) or any(f"f_rest_{n}" not in names for n in range(rest)):
        raise InputError(
            f"the PLY has {rest} fields f_rest_…: 0, 9, 24 or 45 for harmonics up to degree 0, 1, 2 or 3"
        )
    wrong = [
        field for field in names if field.startswith((*_NEEDED, "f_rest_")) and table.dtype[field].kind != "f"
    ]
    if wrong:
        raise InputError(f"the PLY has integers in its fields {', '.join(wrong[:4])}: splats have floats")
    harmonics = np.empty((len(table), 1 + rest // 3, 3), np.float32)
    for channel in range(3):
        harmonics[:, 0, channel] = table[f"f_dc_{channel}"]
        for n in range(rest // 3):  # channel by channel
            harmonics[:, 1 + n, channel] = table[f"f_rest_{channel * (rest // 3) + n}"]
    return Splats(
        _columns(table, "x", "y", "z"),
        np.exp(_columns(table, "scale_0", "scale_1", "scale_2")),
        unit_quaternions(_columns(table, "rot_0", "rot_1", "rot_2", "rot_3")),
        np.asarray(1 / (1 + np.exp(-_columns(table, "opacity")[:, 0])), dtype=np.float32),
        harmonics,
    )


def _columns(table: NDArray[Any], *names: str) -> Floats:
    out = np.empty((len(table), len(names)), np.float32)
    for n, name in enumerate(names):
        out[:, n] = table[name]
    return out


def _unpacked(tables: dict[str, NDArray[Any]]) -> Splats:
    """The splats of a compressed PLY."""
    words, ranges, rest = tables["vertex"], tables.get("chunk"), tables.get("sh")
    count = len(words)
    if (
        any(name not in (words.dtype.names or ()) or words.dtype[name].kind != "u" for name in _WORDS)
        or ranges is None
        or any(name not in (ranges.dtype.names or ()) or ranges.dtype[name].kind != "f" for name in _RANGES)
        or len(ranges) != -(-count // 256)
    ):
        raise InputError("the PLY is compressed, but has no words for each splat, and ranges for each 256 of them")
    bytes_of = 0 if rest is None else len(rest.dtype.names or ())
    if rest is not None and (
        len(rest) != count
        or bytes_of not in (9, 24, 45)
        or rest.dtype != np.dtype([(f"f_rest_{n}", "u1") for n in range(bytes_of)])
    ):
        raise InputError("the element sh of the compressed PLY has not 9, 24 or 45 bytes f_rest_… for each splat")
    chunk = np.arange(count) // 256

    def within(word: str, bits: tuple[int, ...], names: list[str]) -> NDArray[Any]:
        """Shares of a word, from the highest bits down, between the ends that their ranges state."""
        shares, shift = np.empty((count, len(bits))), 32
        for n, width in enumerate(bits):
            shift -= width
            shares[:, n] = (words[word] >> np.uint32(shift) & np.uint32(2**width - 1)) / (2**width - 1)
        if not names:
            return shares
        low, high = np.split(_columns(ranges, *names)[chunk].astype(np.float64), 2, axis=1)
        shares[:, : low.shape[1]] *= high - low
        shares[:, : low.shape[1]] += low
        return shares

    coloured = all(name in (ranges.dtype.names or ()) for name in _COLOURS)
    colour = within("packed_color", (8, 8, 8, 8), _COLOURS if coloured else [])
    turn = (within("packed_rotation", (2, 10, 10, 10), [])[:, 1:] - 0.5) * math.sqrt(2)
    largest = (words["packed_rotation"] >> np.uint32(30)).astype(np.intp)
    wxyz = np.empty((count, 4))
    for n in range(3):
        wxyz[np.arange(count), np.where(n < largest, n, n + 1)] = turn[:, n]
    wxyz[np.arange(count), largest] = np.sqrt(np.maximum(1 - np.einsum("ij,ij->i", turn, turn), 0))
    harmonics = np.empty((count, 1 + bytes_of // 3, 3), np.float32)
    harmonics[:, 0] = (colour[:, :3] - 0.5) / DEGREE_0
    if rest is not None:
        codes = rest.view((np.uint8, bytes_of)).reshape(count, 3, bytes_of // 3).transpose(0, 2, 1)
        shares = np.select([codes == 0, codes == 255], [0.0, 1.0], (codes + 0.5) / 256)
        harmonics[:, 1:] = (shares - 0.5) * 8
    return Splats(
        within("packed_position", (11, 10, 11), _RANGES[:6]).astype(np.float32),
        np.exp(within("packed_scale", (11, 10, 11), _RANGES[6:])).astype(np.float32),
        unit_quaternions(wxyz),
        colour[:, 3].astype(np.float32),
        harmonics,
    )


def _header(head: bytes) -> tuple[str, list[tuple[str, int, list[tuple[str, str]]]], int]:
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
