"""Splats that are claimed and not there, and files that unpack to much."""

from __future__ import annotations

import gzip
import json
import struct
from typing import Any

from tests.fuzz import readers, seeds
from tests.fuzz.bombs.bomb import Bomb, written
from tests.sources.splat_bytes import gltf, spz


def _ply(count: str, more: str = "") -> bytes:
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", *(f"scale_{n}" for n in range(3))]
    fields = "".join(f"property float {name}\n" for name in [*names, *(f"rot_{n}" for n in range(4))])
    return f"ply\nformat binary_little_endian 1.0\n{more}element vertex {count}\n{fields}end_header\n".encode()


def _zstd_of_4_gb() -> bytes:
    """Streams whose table is as the header has it, and whose Zstandard frames state 4 GB."""
    whole = bytearray(spz(4))
    frame = bytes.fromhex("28B52FFD") + b"\xe0" + struct.pack("<Q", 2**32)
    start = 32 + 16 * 6
    struct.pack_into("<Q", whole, 32, len(frame))
    return bytes(whole[:start]) + frame + bytes(whole[start:])


def _accessor(**changed: Any) -> seeds.Maker:
    def make(folder: Any) -> None:
        gltf(folder, edit=lambda tree: tree["accessors"][0].update(changed))

    return make


def _splats(data: Any, name: str) -> Bomb:
    return Bomb(written(name, data), name, readers.splats)


BOMBS = {
    "ply of 10^15 splats": _splats(_ply("999999999999999"), "a.ply"),
    "ply of 5000 digits": _splats(_ply("9" * 5000), "a.ply"),
    "ply after 10^15 others": _splats(_ply("1", "element other 999999999999999\nproperty double a\n"), "a.ply"),
    "ply of no fields, 10^15 others": _splats(_ply("1", "element other 999999999999999\n"), "a.ply"),
    "ply without an end": _splats(b"ply\n" + b"comment a\n" * 100000, "a.ply"),
    "spz 3 of 4 billion": _splats(spz(3, count=2**32 - 1), "a.spz"),
    "spz 4 of 4 billion": _splats(spz(4, count=2**32 - 1), "a.spz"),
    "spz 3 of 300 MB": _splats(lambda: gzip.compress(bytes(300 * 2**20), 9), "a.spz"),
    "spz 4, frame of 4 GB": _splats(_zstd_of_4_gb, "a.spz"),
    "glb count 10^18": Bomb(_accessor(count=10**18), "a.glb", readers.splats),
    "glb offset 10^30": Bomb(_accessor(byteOffset=10**30), "a.glb", readers.splats),
    "glb deep": _splats(struct.pack("<4sIIII", b"glTF", 2, 200020, 200000, 0x4E4F534A) + b"[" * 200000, "a.glb"),
    "cameras deep": Bomb(written("a.json", b"[" * 200000), "a.json", readers.scene_cameras),
    "cameras 10^400": Bomb(
        written("a.json", json.dumps({"w": 10**400, "fl_x": 10**400, "frames": [{}]}).encode()),
        "a.json",
        readers.scene_cameras,
    ),
}
