"""Pipes in place of files, and names that no file has."""

from __future__ import annotations

import os
from pathlib import Path

from tests.fuzz import readers, seeds
from tests.fuzz.bombs.bomb import Bomb, changed, written
from tests.fuzz.bombs.texts import camera
from tests.fuzz.seeds import Maker


def _pipe(first: Maker, name: str) -> Maker:
    """A pipe that nobody writes to, in place of a file."""

    def make(folder: Path) -> None:
        first(folder)
        (folder / name).unlink()
        os.mkfifo(folder / name)

    return make


def _views(folder: Path) -> None:
    seeds.grid(folder, "v_{r:02d}_{c:02d}", ".png")


HCI = seeds.with_camera_file("input_Cam{n:03d}")
LONG = b'<scene><include filename="' + b"a" * 5000 + b'"/></scene>'
CONTROL = b'<lightfield><subaperture src="a&#x1;b.png" u="0" v="0"/></lightfield>'

BOMBS = {
    "pipe for a picture": Bomb(_pipe(_views, "v_00_01.png"), ""),
    "pipe for parameters.cfg": Bomb(_pipe(HCI, "parameters.cfg"), ""),
    "pipe for views.csv": Bomb(_pipe(seeds.views_csv, "views.csv"), ""),
    "pipe for a lens": Bomb(_pipe(seeds.camera(".npy"), "lens.dat"), "camera.toml", readers.camera),
    "pipe for a camera": Bomb(_pipe(seeds.camera(".npy"), "camera.toml"), "camera.toml", readers.camera),
    "pipe for a store's json": Bomb(_pipe(seeds.store(), "s.zarr/zarr.json"), "s.zarr", readers.store),
    "pipe for a scene": Bomb(_pipe(seeds.pbrt_scene, "more.pbrt"), "a.pbrt", readers.pbrt),
    "path with NUL": Bomb(seeds.views_csv, "a\0b"),
    "path too long": Bomb(seeds.views_csv, "a" * 5000),
    "path of nobody": Bomb(seeds.views_csv, "~nosuchuser/x"),
    "info of nobody": Bomb(seeds.views_csv, "~nosuchuser/x", readers.info),
    "store path with NUL": Bomb(seeds.views_csv, "a\0b", readers.store),
    "lens path too long": Bomb(seeds.views_csv, "a" * 5000 + ".dat", readers.lens),
    "camera path with NUL": Bomb(seeds.views_csv, "a\0b.toml", readers.camera),
    "camera names NUL": camera("cells.npy", "a\\u0000b.npy"),
    "camera names long": camera("cells.npy", "a" * 5000 + ".npy"),
    "camera names nobody": camera("cells.npy", "~nosuchuser/b.npy"),
    "camera lens NUL": camera("lens.dat", "a\\u0000.dat"),
    "views.csv NUL": Bomb(changed(seeds.views_csv, "views.csv", b"row,col,file\n0,0,v0\0.png\n"), ""),
    "viewer src control": Bomb(written("a.xml", CONTROL), "a.xml"),
    "mitsuba long name": Bomb(
        changed(seeds.mitsuba_scene, "a.xml", LONG), "a.xml", readers.mitsuba, refused=False
    ),
}
