"""Files of splats, written byte by byte."""

from __future__ import annotations

import gzip
import json
import struct
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np

from tests.sources.splat_clouds import cloud
from vcc.sources.splats import Splats


def spz_parts(version: int, degree: int = 1, fraction: int = 12) -> list[bytes]:
    """Two splats: at (1.5, −0.25, 2) and elsewhere; half opaque; log sizes −6, −4, −2; turned about x."""
    place = b"".join(int(v * 2**fraction).to_bytes(3, "little", signed=True) for v in (1.5, -0.25, 2, -7, 0, 1))
    colour = bytes([255, 0, 128] * 2)
    sizes = bytes([(n + 10) * 16 for n in (-6, -4, -2)] * 2)
    if version == 2:  # (x, y, z) around 127.5
        turns = bytes([round((0.6 + 1) * 127.5), 128, 127] * 2)
    else:  # the largest is w (3); then x, y, z, each a sign and nine bits of 1/√2, x in the highest bits
        x = round(0.6 / np.sqrt(0.5) * 511)
        turns = struct.pack("<I", 3 << 30 | x << 20) + struct.pack("<I", 3 << 30 | (x | 512) << 20)
    rest = bytes([128, 192, 0] * ((degree + 1) ** 2 - 1) * 2)
    return [place, bytes([128, 255]), colour, sizes, turns, rest]


def spz(version: int, degree: int = 1, count: int = 2, flags: int = 1, parts: list[bytes] | None = None) -> bytes:
    """A packed cloud of `spz_parts`."""
    streams = spz_parts(version, degree) if parts is None else parts
    head = struct.pack("<4sIIBBB", b"NGSP", version, count, degree, 12, flags)
    if version < 4:
        return gzip.compress(head + b"\0" + b"".join(streams), mtime=0)
    streams = [part for part in streams if part]
    packed = [imagecodecs.zstd_encode(part) for part in streams]
    sizes = b"".join(struct.pack("<QQ", len(p), len(part)) for p, part in zip(packed, streams, strict=True))
    return head + struct.pack("<BI12x", len(streams), 32) + sizes + b"".join(packed)


def packed_ply(degree: int = 1, coloured: bool = True) -> bytes:
    """300 splats in two chunks of 256, as PlayCanvas compresses them."""
    ends = [f"{end}_{kind}{axis}" for kind in ("", "scale_") for end in ("min", "max") for axis in "xyz"]
    ends += [f"{end}_{axis}" for end in ("min", "max") for axis in "rgb"] if coloured else []
    words = [f"packed_{name}" for name in ("position", "rotation", "scale", "color")]
    lines = ["ply", "format binary_little_endian 1.0", "element chunk 2", *(f"property float {n}" for n in ends)]
    lines += ["element vertex 300", *(f"property uint {name}" for name in words)]
    rest = 3 * ((degree + 1) ** 2 - 1)
    lines += ["element sh 300", *(f"property uchar f_rest_{n}" for n in range(rest))] if degree else []
    sizes_and_colours = [-6] * 3 + [-2] * 3 + ([-0.5] * 3 + [1.5] * 3 if coloured else [])
    chunks = b"".join(
        struct.pack(f"<{len(ends)}f", *[low] * 3, *[low + 4] * 3, *sizes_and_colours) for low in (-1, 9)
    )
    place = 2047 << 21 | 0 << 11 | 1024
    turn = 2 << 30 | 1023 << 20 | 512 << 10 | 256
    splat = struct.pack("<4I", place, turn, place, 255 << 24 | 0 << 16 | 51 << 8 | 204)
    harmonics = bytes([0] * (rest // 3) + [128] * (rest // 3) + [255] * (rest // 3))
    return "\n".join([*lines, "end_header\n"]).encode() + chunks + splat * 300 + harmonics * 300


def gltf(folder: Path, name: str = "a.glb", edit: Any = None, node: Any = None) -> tuple[Path, Splats]:
    """A GLB of a cloud, and the cloud; its JSON can be edited, and its node moved."""
    splats = cloud(7, degree=1)
    prefix = "KHR_gaussian_splatting:"
    arrays = {
        "POSITION": splats.positions, f"{prefix}SCALE": splats.sizes,
        f"{prefix}ROTATION": splats.rotations[:, [1, 2, 3, 0]], f"{prefix}OPACITY": splats.opacities,
        f"{prefix}SH_DEGREE_0_COEF_0": splats.harmonics[:, 0],
        **{f"{prefix}SH_DEGREE_1_COEF_{n}": splats.harmonics[:, 1 + n] for n in range(3)},
    }  # fmt: skip
    binary, accessors, views = b"", [], []
    for values in arrays.values():
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes})
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[1 if values.ndim == 1 else values.shape[1]]
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": 5126, "count": len(splats.positions), "type": kind}
        )
        binary += np.ascontiguousarray(values).tobytes()
    attributes = {each: n for n, each in enumerate(arrays)}
    stated = {"kernel": "ellipse", "colorSpace": "lin_rec709_display"}
    primitive = {"attributes": attributes, "mode": 0, "extensions": {"KHR_gaussian_splatting": stated}}
    tree = {
        "asset": {"version": "2.0"}, "buffers": [{"byteLength": len(binary)}], "bufferViews": views,
        "accessors": accessors, "meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0} | (node or {})],
    }  # fmt: skip
    if edit:
        edit(tree)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = (
        struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    )
    path = folder / name
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path, splats
