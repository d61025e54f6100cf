"""Camera files, lenses, scenes and Lytro's metadata with numbers, nesting and includes that nobody expects."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.fuzz import readers, seeds
from tests.fuzz.bombs.bomb import Bomb, changed, npy, written, zeros_deflated
from tests.fuzz.bombs.lists import LAUGHS
from tests.fuzz.seeds import LYTRO_META, Maker
from tests.fuzz.texts import CODEV, LENS, OPTILAND, PBRT_SCENE, RAYOPTICS, ZEMAX

CELLS = "[[0, 1], [1, 0.5]]"
SHAPE = "shape = [50, 50]"


def camera(old: str, new: str, refused: bool = True) -> Bomb:
    """The camera file with something else in it."""
    change = changed(seeds.camera(".npy"), "camera.toml", lambda data: data.replace(old.encode(), new.encode()))
    return Bomb(change, "camera.toml", readers.camera, refused=refused)


def _moving(old: str, new: str, refused: bool = True) -> Bomb:
    """The file of a moving camera with something else in it."""
    change = changed(seeds.moving_camera, "camera.toml", lambda data: data.replace(old.encode(), new.encode()))
    return Bomb(change, "camera.toml", readers.moving_camera, refused=refused)


def _cells(name: str, data: bytes) -> Bomb:
    """A mask's file with something else in it."""
    return Bomb(changed(seeds.camera(Path(name).suffix), name, data), "camera.toml", readers.camera)


def _nested(depth: int) -> str:
    return "[" * depth + "1" + "]" * depth


def _lens(name: str, text: str, refused: bool = True) -> Bomb:
    return Bomb(written(name, text.encode()), name, readers.lens, refused=refused)


def _lytro(change: Callable[[Any], Any], refused: bool = True) -> Bomb:
    """A Lytro file whose metadata say something else, signed."""

    def make(folder: Path) -> None:
        meta = json.loads(json.dumps(LYTRO_META))
        change(meta)
        (folder / "a.lfr").write_bytes(seeds.lytro_bytes(*seeds.lytro_parts(meta)))

    return Bomb(make, "a.lfr", readers.lytro, refused=refused)


def _including_packed(data: Callable[[], bytes]) -> Maker:
    """A scene that includes a packed file."""

    def make(folder: Path) -> None:
        (folder / "a.pbrt").write_text(PBRT_SCENE.replace("more.pbrt", "more.pbrt.gz"))
        (folder / "more.pbrt.gz").write_bytes(data())

    return make


def _gzip_of_zeros(megabytes: int) -> bytes:
    raw, crc, size = zeros_deflated(megabytes)
    return b"\x1f\x8b\x08" + bytes(7) + raw + struct.pack("<II", crc, size % 2**32)


def _doubling(folder: Path) -> None:
    """Each of 30 files includes the next twice."""
    seeds.pbrt_scene(folder)
    for n in range(30):
        (folder / f"more{n}.pbrt").write_text(f'Include "more{n + 1}.pbrt"\n' * 2)
    (folder / "more30.pbrt").write_text("")
    (folder / "more.pbrt").write_text('Include "more0.pbrt"\n')


BOMBS = {
    "camera npy terabytes": _cells("cells.npy", npy((10**6, 10**6))),
    "camera npy 3 axes": _cells("cells.npy", npy((2, 2, 2), "|u1") + bytes(8)),
    "camera csv of text": _cells("cells.csv", b"a,b\nc,d\n"),
    "camera nested 100000": camera(CELLS, _nested(100000)),
    "camera nested 500": camera(CELLS, _nested(500)),
    "camera sensor 1e9": camera(SHAPE, "shape = [1000000000, 1000000000]", refused=False),
    "camera 5000 digits": camera(SHAPE, f"shape = [{'9' * 5000}, 2]"),
    "camera sensor negative": camera(SHAPE, "shape = [-5, 5]"),
    "camera mura 10^9+7": camera(CELLS, '{ name = "mura", prime = 1000000007 }'),
    "camera harmonics 10^9": camera("harmonics = 2", "harmonics = 1000000000"),
    "moving nested 500": _moving('["151 mm", "153 mm"]', _nested(500)),
    "moving tables 5000": _moving("[moving]", f"[moving]\n{'a.' * 5000}b = 1"),
    "moving code of 10^6": _moving("1101001", "01" * 5 * 10**5, refused=False),
    "moving times 1e999": _moving('"90 ms"]', '"1e999 ms"]'),
    "lens dat 20000 lines": _lens("a.dat", LENS + "0.0001 0 1.5 1\n" * 20000, refused=False),
    "lens dat tiny radius": _lens("a.dat", "1e-320 1 1.5 10\n-1e-320 1 1 10\n"),
    "lens dat huge": _lens("a.dat", "1e308 1e308 1e308 1e308\n-1e308 1 1 1e308\n", refused=False),
    "lens zmx huge curve": _lens("a.zmx", ZEMAX.replace("CURV 0.02", "CURV 1e308")),
    "lens zmx parameter 10^9": _lens("a.zmx", ZEMAX.replace("STOP", "STOP\n TYPE EVENASPH\n PARM 1000000000 1")),
    "lens zmx 10^9 terms": _lens(
        "a.zmx",
        ZEMAX.replace("STOP", "STOP\n TYPE XASPHERE\n XDAT 1 1e9\n XDAT 2 1e-300\n XDAT 99 1"),
        refused=True,
    ),
    "lens zmx 1e999 configurations": _lens("a.zmx", ZEMAX + "MNUM 1e999 1e999\n", refused=False),
    "lens zmx 1e999 fields": _lens("a.zmx", ZEMAX.replace("ENPD", "FTYP 0 0 1e999 1e999\nENPD"), refused=False),
    "lens seq surface 10^9": _lens("a.seq", CODEV.replace("S -60.0", "S999999999 -60.0")),
    "lens seq 1e999 positions": _lens("a.seq", CODEV.replace("ZOO 2", "ZOO 1e999"), refused=False),
    "lens seq reference 1e999": _lens("a.seq", CODEV.replace("REF 2", "REF 1e999"), refused=False),
    "lens seq 10^6 continued": _lens("a.seq", "RDM &\n" * 10**5),
    "lens seq quotes": _lens("a.seq", CODEV.replace("'test'", "'" * 10**5), refused=False),
    "lens json deep": _lens("a.json", "[" * 200000),
    "lens json 10^400": _lens("a.json", OPTILAND.replace("-50.0", "1" + "0" * 400)),
    "lens roa 10^6 terms": _lens("a.roa", RAYOPTICS.replace("[0.0, 1e-06]", "[" + "0," * 10**6 + "1]")),
    "lens zmx stop as list": _lens("a.zmx", ZEMAX.replace("ENPD 10", "ENPD"), refused=False),
    "lytro 1e9 pixels": _lytro(lambda meta: meta["image"].update(width=10**9, height=10**9)),
    "lytro deep json": Bomb(written("a.lfr", seeds.lytro_bytes(b"[" * 200000, [])), "a.lfr", readers.lytro),
    "lytro level 1e400": _lytro(lambda meta: meta["image"]["pixelFormat"]["white"].update(r=10**400)),
    "lytro pitch 10^400": _lytro(lambda meta: meta["devices"]["mla"].update(lensPitch=10**400)),
    "lytro corner a list": _lytro(lambda meta: meta["image"]["mosaic"].update(upperLeftPixel=["r"])),
    "lytro bits a list": _lytro(lambda meta: meta["image"]["pixelPacking"].update(bitsPerPixel=[10])),
    "lytro odd rows": _lytro(lambda meta: meta["image"].update(width=128, height=1), refused=False),
    "lytro matrix text": _lytro(lambda meta: meta["image"]["color"].update(ccmRgbToSrgbArray=["a"] * 9)),
    "mitsuba laughs": Bomb(changed(seeds.mitsuba_scene, "a.xml", LAUGHS), "a.xml", readers.mitsuba),
    "mitsuba includes itself": Bomb(
        changed(seeds.mitsuba_scene, "more.xml", b'<scene><include filename="more.xml"/></scene>'),
        "a.xml",
        readers.mitsuba,
    ),
    "pbrt includes itself": Bomb(
        changed(seeds.pbrt_scene, "more.pbrt", b'Include "more.pbrt"\n'), "a.pbrt", readers.pbrt
    ),
    "pbrt includes 2^30": Bomb(_doubling, "a.pbrt", readers.pbrt),
    "pbrt gz bomb": Bomb(_including_packed(lambda: _gzip_of_zeros(2000)), "a.pbrt", readers.pbrt),
    "pbrt gz damaged": Bomb(_including_packed(lambda: b"\x1f\x8bxxxxxxxxxxxx"), "a.pbrt", readers.pbrt),
}
