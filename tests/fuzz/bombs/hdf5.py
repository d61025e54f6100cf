"""HDF5 files: sizes that were never written, and things of another kind than the format has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tests.fuzz import seeds
from tests.fuzz.bombs.bomb import Bomb
from tests.fuzz.seeds import Maker
from vcc.formats import lftoolbox

GROUP, EXTERNAL, EXTERNAL_BYTES, LOOP = (
    "a group",
    "a link to another file",
    "bytes of another file",
    "a link to itself",
)


def _claims(name: str, shape: tuple[int, ...], **how: Any) -> Maker:
    """A shape, and not a sample written."""

    def make(folder: Path) -> None:
        with h5py.File(folder / name, "w") as file:
            if name.endswith(".vox"):
                file.attrs["description"] = "VoxelDataFormat"
                data = file.create_dataset("/data/image", shape=shape, dtype="u1", **how)
                data.attrs["mode"], data.attrs["axes"] = "light-field", "v:u:t:s:c"
            else:
                file.create_dataset("LF", shape=shape, dtype="u1", **how)
            for key in ("dH", "dV", "focalLength", "shift"):
                file.attrs[key] = 1.0

    return make


def _put(file: Any, key: str, value: Any) -> None:
    if isinstance(value, str) and value == GROUP:
        file.create_group(key)
    elif isinstance(value, str) and value == EXTERNAL:
        file[key] = h5py.ExternalLink("/etc/passwd", "/x")
    elif isinstance(value, str) and value == EXTERNAL_BYTES:
        file.create_dataset(key, shape=(2, 2, 8, 8), dtype="u1", external=[("/etc/passwd", 0, 256)])
    elif isinstance(value, str) and value == LOOP:
        file[key] = h5py.SoftLink(f"/{key}")
    else:
        file.create_dataset(key, data=value)


def _h5(**put: Any) -> Bomb:
    """An HCI 2013 file with other things in it."""

    def make(folder: Path) -> None:
        with h5py.File(folder / "lf.h5", "w") as file:
            values = {"LF": seeds.scene(), "dH": 0.1, "dV": 0.1, "focalLength": 100.0, "shift": 0.5} | put
            for key, value in values.items():
                if key in ("LF", "GT_DEPTH"):
                    _put(file, key, value)
                else:
                    file.attrs[key] = value

    return Bomb(make, "lf.h5")


def _mat(**put: Any) -> Bomb:
    """A Light Field Toolbox file with other things in it; __ stands for /, H for the intrinsics."""

    def make(folder: Path) -> None:
        lftoolbox.save(seeds.light_field(), folder / "a.mat")
        with h5py.File(folder / "a.mat", "r+") as file:
            for key, value in put.items():
                place = {"H": "RectOptions/RectCamIntrinsicsH"}.get(key, key.replace("__", "/"))
                if place in file:
                    del file[place]
                _put(file, place, value)

    return Bomb(make, "a.mat")


def _may_be_read(bomb: Bomb) -> Bomb:
    return Bomb(bomb.make, bomb.target, bomb.read, bomb.options, refused=False)


def _text_intrinsics(folder: Path) -> None:
    with h5py.File(folder / "a.mat", "w", userblock_size=512) as file:
        file.create_dataset("LF", data=seeds.scene().T)
        file.create_dataset("RectOptions/RectCamIntrinsicsH", data=np.array(["a", "b"], dtype=h5py.string_dtype()))


HUGE = (1000, 1000, 1000, 1000, 3)
LARGE = (5, 5, 1000, 1000, 3)
TEXT = np.bytes_(b"\xff\xfe")

BOMBS = {
    "mat claims 1e12": Bomb(_claims("a.mat", HUGE[::-1]), "a.mat"),
    "mat chunk 1 TB": Bomb(_claims("a.mat", (3, 100, 100, 10000, 10000), chunks=(1, 1, 1, 10000, 10000)), "a.mat"),
    "mat never written": Bomb(_claims("a.mat", (3, 5, 5, 1000, 1000), chunks=(1, 1, 1, 1000, 1000)), "a.mat"),
    "h5 claims 1e12": Bomb(_claims("lf.h5", HUGE), "lf.h5"),
    "h5 never written": Bomb(_claims("lf.h5", LARGE, chunks=(1, 1, 1000, 1000, 3)), "lf.h5"),
    "vox claims 1e12": Bomb(_claims("a.vox", HUGE), "a.vox"),
    "vox never written": Bomb(_claims("a.vox", LARGE, chunks=(1, 1, 1000, 1000, 3)), "a.vox"),
    "mat text intrinsics": Bomb(_text_intrinsics, "a.mat"),
    "mat LF group": _mat(LF=GROUP),
    "mat LF complex": _mat(LF=np.ones((3, 4, 4, 2, 2), np.complex64)),
    "mat LF int16": _mat(LF=np.ones((3, 8, 8, 3, 3), np.int16)),
    "mat LF int64": _mat(LF=np.ones((3, 8, 8, 3, 3), np.int64)),
    "mat LF strings": _mat(LF=np.full((3, 8, 8, 3, 3), b"ab")),
    "mat LF bool": _mat(LF=np.ones((3, 8, 8, 3, 3), bool)),
    "mat LF no samples": _mat(LF=np.ones((3, 0, 8, 3, 3), np.uint8)),
    "mat LF no views": _mat(LF=np.ones((3, 8, 8, 0, 3), np.uint8)),
    "mat LF structured": _mat(LF=np.zeros((3, 8, 8, 3, 3), [("a", "u1")])),
    "mat H 3x3": _mat(H=np.eye(3)),
    "mat H scalar": _mat(H=np.float64(3)),
    "mat H group": _mat(H=GROUP),
    "mat H complex": _mat(H=np.eye(5) * 1j),
    "mat H NaN": _mat(H=np.full((5, 5), np.nan)),
    "mat HasWeight empty": _mat(VccLightField__HasWeight=np.zeros((0, 0))),
    "mat HasWeight 1 axis": _mat(VccLightField__HasWeight=np.zeros(1)),
    "mat HasWeight gone": _may_be_read(_mat(VccLightField=GROUP)),
    "mat DisparityRange 1": _mat(VccLightField__DisparityRange=np.zeros((1, 1))),
    "mat DisparityRange NaN": _mat(VccLightField__DisparityRange=np.full((2, 1), np.nan)),
    "mat Transfer 32 bits": _may_be_read(_mat(VccLightField__Transfer=np.full((3, 1), 2**31, np.uint32))),
    "mat LFMetadata number": _may_be_read(_mat(LFMetadata=np.ones((2, 2)))),
    "mat options objects": _may_be_read(_mat(DecodeOptions__OptionalTasks=np.array([b"a", b"b"]))),
    "h5 LF group": _h5(LF=GROUP),
    "h5 LF external link": _h5(LF=EXTERNAL),
    "h5 LF external raw file": _h5(LF=EXTERNAL_BYTES),
    "h5 LF loops": _h5(LF=LOOP),
    "h5 LF int16": _h5(LF=np.ones((3, 3, 8, 8, 3), np.int16)),
    "h5 LF complex": _h5(LF=np.ones((3, 3, 8, 8, 3), np.complex64)),
    "h5 LF strings": _h5(LF=np.full((3, 3, 8, 8, 3), b"x")),
    "h5 LF no samples": _h5(LF=np.ones((3, 3, 0, 8, 3), np.uint8)),
    "h5 LF float NaN": _h5(LF=np.full((3, 3, 8, 8, 3), np.nan)),
    "h5 LF 7 channels": _may_be_read(_h5(LF=np.ones((3, 3, 8, 8, 7), np.uint8))),
    "h5 depth strings": _h5(GT_DEPTH=np.full((3, 3, 24, 32), b"x")),
    "h5 depth group": _h5(GT_DEPTH=GROUP),
    "h5 depth 0": _may_be_read(_h5(GT_DEPTH=np.zeros((3, 3, 24, 32)))),
    "h5 dH text": _h5(dH="abc"),
    "h5 dH bytes": _h5(dH=TEXT, note=TEXT),
    "h5 note bytes": _may_be_read(_h5(note=TEXT)),
    "h5 dH 1e308": _may_be_read(_h5(dH=1e308, dV=1e308)),
    "h5 focal 1e-320": _h5(focalLength=1e-320),
}
