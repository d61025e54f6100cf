"""Photographs with poses that claim more entries than their files hold, or cameras that none has."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

from tests.fuzz import readers, seeds
from tests.fuzz.bombs.bomb import Bomb, changed
from tests.fuzz.seeds import Maker


def _counted(name: str) -> Bomb:
    """A file of COLMAP whose first number, of entries, is as large as possible."""
    count = struct.pack("<Q", 2**64 - 1)
    return Bomb(changed(seeds.colmap(".bin"), name, lambda data: count + data[8:]), "", readers.poses)


def _said(change: dict[str, Any]) -> Maker:
    """A transforms.json that says something else."""

    def make(folder: Path) -> None:
        seeds.transforms(folder)
        file = folder / "transforms.json"
        file.write_text(json.dumps(json.loads(file.read_text()) | change))

    return make


def _points(data: bytes) -> bytes:
    return data[:-16] + struct.pack("<Q", 2**63) + data[-8:]  # of the photographs that show the last one


BOMBS = {
    "colmap cameras": _counted("cameras.bin"),
    "colmap images": _counted("images.bin"),
    "colmap points": _counted("points3D.bin"),
    "colmap track": Bomb(changed(seeds.colmap(".bin"), "points3D.bin", _points), "", readers.poses),
    "transforms size": Bomb(_said({"w": 1e12, "h": 1e12}), "", readers.poses),
    "transforms angle": Bomb(_said({"camera_angle_x": 0}), "", readers.poses),
    "transforms frames": Bomb(_said({"frames": [[]] * 10}), "", readers.poses),
    "transforms bent": Bomb(_said({"k1": 1e300}), "", readers.poses, refused=False),
}
"""Bombs of photographs with poses."""
