"""All formats that are read: for each a seed, and what opens it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import vcc.formats.arrays
import vcc.formats.lftoolbox
from tests.fuzz import readers, seeds
from tests.fuzz.readers import Read
from tests.fuzz.seeds import Maker
from tests.fuzz.texts import CODEV, LENS, OPTILAND, RAYOPTICS, ZEMAX


@dataclass(frozen=True)
class Format:
    """A format.

    Args:
        seed: makes a valid file or folder.
        target: what is opened of it; empty for the folder.
        read: opens it.
        options: for that.
        checked: whether single bits are under a checksum, so that none may change unnoticed.
    """

    seed: Maker
    target: str
    read: Callable[..., Read] = readers.field
    options: dict[str, Any] = field(default_factory=dict)
    checked: bool = False


def _views(name: str, kind: Any = np.uint8) -> Maker:
    stem, ending = name.rsplit(".", 1)
    return lambda folder: seeds.grid(folder, stem, f".{ending}", kind)


def _mask(name: str) -> Maker:
    return lambda folder: seeds.picture(folder / name, seeds.scene(1, 1, channels=None)[0, 0])


BLOCKS = {"views": (3, 3), "layout": "eslf"}
TILES = {"views": (3, 3), "layout": "mosaic"}
NUMBERED = {"views": (3, 3), "order": "row-major"}

FORMATS = {
    "png views": Format(_views("v_{r:02d}_{c:02d}.png"), "", checked=True),
    "png16 views": Format(_views("v_{r:02d}_{c:02d}.png", np.uint16), "", checked=True),
    "jpg views": Format(_views("v_{r:02d}_{c:02d}.jpg"), ""),
    "tif views": Format(_views("v_{r:02d}_{c:02d}.tif"), ""),
    "exr views": Format(_views("v_{r:02d}_{c:02d}.exr", np.float32), ""),
    "ppm views": Format(_views("v_{r:02d}_{c:02d}.ppm", np.uint16), ""),
    "bmp views": Format(_views("v_{r:02d}_{c:02d}.bmp"), ""),
    "hci 2016": Format(seeds.with_camera_file("input_Cam{n:03d}"), "", checked=True),
    "inria": Format(seeds.with_camera_file("lf_{r}_{c}"), "", checked=True),
    "cambridge": Format(seeds.cambridge, "", checked=True),
    "stanford names": Format(_views("out_{r:02d}_{c:02d}_{y}_{x}.png"), "", checked=True),
    "blender names": Format(_views("a_{r:02d}_{c:02d}_{y}_{x}_30.0_36.0.png"), "", checked=True),
    "numbered": Format(_views("frame_{n:03d}.png"), "", options=NUMBERED, checked=True),
    "views.csv": Format(seeds.views_csv, "", checked=True),
    "colmap text": Format(seeds.colmap(".txt"), "", readers.poses),
    "colmap binary": Format(seeds.colmap(".bin"), "", readers.poses),
    "transforms.json": Format(seeds.transforms, "", readers.poses),
    "viewer folder": Format(seeds.viewer_folder, "", checked=True),
    "viewer zip": Format(seeds.viewer_zip, "field.zip", checked=True),
    "npy": Format(lambda f: np.save(f / "f.npy", seeds.scene(kind=np.float32)), "f.npy"),
    "npz": Format(lambda f: vcc.formats.arrays.save(seeds.light_field(), f / "f.npz"), "f.npz", checked=True),
    "npz other": Format(seeds.npz_other, "f.npz", checked=True),
    "lftoolbox mat": Format(lambda f: vcc.formats.lftoolbox.save(seeds.light_field(), f / "f.mat"), "f.mat"),
    "hci 2013 h5": Format(seeds.h5, "lf.h5"),
    "vox": Format(seeds.vox, "f.vox"),
    "eslf png": Format(seeds.eslf("a.png"), "a.png", options=BLOCKS, checked=True),
    "eslf tif": Format(seeds.eslf("a.tif"), "a.tif", options=BLOCKS),
    "eslf jpg": Format(seeds.eslf("a.jpg"), "a.jpg", options=BLOCKS),
    "mosaic png": Format(seeds.mosaic, "a.png", options=TILES, checked=True),
    "lytro": Format(seeds.lytro, "a.lfr", readers.lytro, checked=True),
    "lytro first": Format(seeds.lytro_first, "a.lfp", readers.lytro, checked=True),
    "lytro resigned": Format(seeds.lytro, "a.lfr", readers.lytro),  # mutations.RESIGNED
    "mp4": Format(seeds.video("a.mp4"), "a.mp4"),
    "mkv": Format(seeds.video("a.mkv"), "a.mkv"),
    "avi": Format(seeds.video("a.avi"), "a.avi"),
    "zarr": Format(seeds.store(), "s.zarr", readers.store, checked=True),
    "zarr float": Format(seeds.store(kind=np.float32), "s.zarr", readers.store, checked=True),
    "zarr jpegxl": Format(seeds.store("jpegxl"), "s.zarr", readers.store, checked=True),
    "zarr avif": Format(seeds.store("avif"), "s.zarr", readers.store, checked=True),
    "zarr disparity": Format(seeds.store_with_depth, "s.zarr", readers.store_with_depth, checked=True),
    "zarr video": Format(seeds.light_field_video, "v.zarr", readers.light_field_video, checked=True),
    "dataset": Format(seeds.dataset, "pairs", readers.dataset),
    "dataset zarr": Format(seeds.zarr_dataset, "pairs", readers.dataset, checked=True),
    "sweep": Format(seeds.sweep, "s.zarr", readers.sweep),
    "camera npy": Format(seeds.camera(".npy"), "camera.toml", readers.camera),
    "camera csv": Format(seeds.camera(".csv"), "camera.toml", readers.camera),
    "camera png": Format(seeds.camera(".png"), "camera.toml", readers.camera),
    "camera moving": Format(seeds.moving_camera, "camera.toml", readers.moving_camera),
    "lens dat": Format(seeds.text("a.dat", LENS), "a.dat", readers.lens),
    "lens zmx": Format(seeds.text("a.zmx", ZEMAX), "a.zmx", readers.lens),
    "lens seq": Format(seeds.text("a.seq", CODEV), "a.seq", readers.lens_2),
    "lens json": Format(seeds.text("a.json", OPTILAND), "a.json", readers.lens),
    "lens roa": Format(seeds.text("a.roa", RAYOPTICS), "a.roa", readers.lens),
    "truth pfm": Format(seeds.pfm, "", readers.truth),
    "truth npy": Format(seeds.inria_truth, "", readers.truth),
    "truth cambridge": Format(seeds.cambridge, "", readers.truth),
    "mask png": Format(_mask("m.png"), "m.png", readers.mask, checked=True),
    "mask bmp": Format(_mask("m.bmp"), "m.bmp", readers.mask),
    "centres mat": Format(seeds.centres_mat, "c.mat", readers.centres),
    "centres csv": Format(seeds.centres_csv, "c.csv", readers.centres),
    "pbrt scene": Format(seeds.pbrt_scene, "a.pbrt", readers.pbrt),
    "mitsuba scene": Format(seeds.mitsuba_scene, "a.xml", readers.mitsuba),
    "obj mesh": Format(seeds.mesh, "a.obj", readers.mesh),
    "splats ply": Format(seeds.splats("a.ply"), "a.ply", readers.splats),
    "splats packed ply": Format(seeds.splats("packed.ply"), "packed.ply", readers.splats),
    "splats splat": Format(seeds.splats("a.splat"), "a.splat", readers.splats),
    "splats spz 2": Format(seeds.splats("a.spz", 2), "a.spz", readers.splats),
    "splats spz 4": Format(seeds.splats("a.spz", 4), "a.spz", readers.splats),
    "splats glb": Format(seeds.splats("a.glb"), "a.glb", readers.splats),
    "cameras of transforms": Format(seeds.text("a.json", seeds.POSES), "a.json", readers.scene_cameras),
    "cameras of splats": Format(seeds.text("a.json", seeds.CAMERAS), "a.json", readers.scene_cameras),
    "info": Format(seeds.views_csv, "", readers.info),
    "info video": Format(seeds.light_field_video, "v.zarr", readers.info),
}
