"""Lists of views, names and camera files that state grids which are not there, or files that are elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tests.fuzz import readers, seeds
from tests.fuzz.bombs.bomb import Bomb, changed, deflated, view, written, zeros_deflated, zip_of, zip_of_deflated
from tests.fuzz.seeds import Maker

ENTITIES = "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 10}">' for n in range(1, 10))
LAUGHS = f"""<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a0 "ha">{ENTITIES}]>
<lightfield><subaperture src="&a9;" u="0" v="0"/></lightfield>""".encode()
"""An entity of ten entities of ten entities …"""
ELSEWHERE = b"""<?xml version="1.0"?><!DOCTYPE l [<!ENTITY x SYSTEM "file:///etc/passwd">]>
<lightfield><subaperture src="&x;" u="0" v="0"/></lightfield>"""


def _xml(*views: tuple[str, float, float]) -> bytes:
    """The viewer's list of (name, v, u)."""
    lines = "".join(f'<subaperture src="{name}" u="{u}" v="{v}"/>' for name, v, u in views)
    return f"<lightfield>{lines}</lightfield>".encode()


def _csv(*lines: bytes) -> Maker:
    """``views.csv`` of these lines, beside nine views."""
    return changed(seeds.views_csv, "views.csv", b"\n".join([b"row,col,file", b"0,0,v0.png", *lines, b""]))


def _named(*names: str) -> Bomb:
    """A folder of pictures of these names."""

    def make(folder: Path) -> None:
        for name in names:
            (folder / f"{name}.png").write_bytes(seeds.png(view()))

    return Bomb(make, "")


def _outside(kind: str) -> Maker:
    """A list that names a picture outside of its folder."""

    def make(folder: Path) -> None:
        inner, secret = folder / "in", folder / "secret"
        inner.mkdir()
        secret.mkdir()
        views = seeds.scene(2, 2)
        for n in range(4):
            seeds.picture((secret if n == 3 else inner) / f"v{n}.png", views[n // 2, n % 2])
        last = {"absolute": str(secret / "v3.png"), "link": "v3.png"}.get(kind, "../secret/v3.png")
        if kind == "link":
            (inner / last).symlink_to(secret / "v3.png")
        named: Iterable[Any] = [
            (name, n // 2, n % 2) for n, name in enumerate(["v0.png", "v1.png", "v2.png", last])
        ]
        if kind == "xml":
            (inner / "a.xml").write_bytes(_xml(*named))
        else:
            lines = [f"{row},{column},{name}" for name, row, column in named]
            (inner / "views.csv").write_text("\n".join(["row,col,file", *lines]))

    return make


def _slip() -> list[tuple[str, bytes]]:
    pictures = [seeds.png(each) for each in seeds.scene()[0, :2]]
    return [
        ("a.xml", _xml(("../../x.png", 0, 0), ("b.png", 0, 1))),
        ("../../x.png", pictures[0]),
        ("b.png", pictures[1]),
    ]


def _long_picture() -> dict[str, Any]:
    return {"a.xml": deflated(_xml(("x.png", 0, 0), ("x.png", 0, 1))), "x.png": zeros_deflated(2000)}


HCI = seeds.with_camera_file("input_Cam{n:03d}")
FAR = _csv(b"1000000000000,0,v1.png", b"1,1,v2.png")


def _cameras(**numbers: bytes) -> Bomb:
    """HCI's camera file with other numbers of cameras."""

    def other(data: bytes) -> bytes:
        for name, number in numbers.items():
            data = data.replace(f"num_cams_{name} = 3".encode(), f"num_cams_{name} = ".encode() + number)
        return data

    return Bomb(changed(HCI, "parameters.cfg", other), "")


BOMBS = {
    "viewer billion laughs": Bomb(written("a.xml", LAUGHS), "a.xml"),
    "viewer folder laughs": Bomb(written("a.xml", LAUGHS), ""),
    "viewer zip laughs": Bomb(zip_of("a.zip", lambda: [("a.xml", LAUGHS)]), "a.zip"),
    "viewer external entity": Bomb(written("a.xml", ELSEWHERE), "a.xml"),
    "viewer deep xml": Bomb(written("a.xml", b"<lightfield>" + b"<a>" * 200000), "a.xml"),
    "viewer zip slip": Bomb(zip_of("a.zip", _slip), "a.zip"),
    "viewer zip list of 2 GB": Bomb(
        zip_of_deflated("a.zip", lambda: {"a.xml": zeros_deflated(2000, b"<lightfield>", b"</lightfield>")}),
        "a.zip",
    ),
    "viewer zip picture of 2 GB": Bomb(zip_of_deflated("a.zip", _long_picture), "a.zip"),
    "viewer 20000 places": Bomb(written("a.xml", _xml(*(("a.png", n, n) for n in range(20000)))), "a.xml"),
    "viewer far places": Bomb(
        written("a.xml", _xml(("a.png", 0, 0), ("a.png", 0, 1e-6), ("a.png", 1e12, 1e12))), "a.xml"
    ),
    "viewer huge step": Bomb(written("a.xml", _xml(("a.png", 0, -1e308), ("a.png", 0, 1e308))), "a.xml"),
    "viewer src is a folder": Bomb(written("a.xml", _xml((".", 0, 0), ("", 0, 1))), "a.xml"),
    "viewer folder ..": Bomb(_outside("xml"), "in"),
    "views.csv ..": Bomb(_outside("dots"), "in"),
    "views.csv absolute": Bomb(_outside("absolute"), "in"),
    "views.csv ..; told": Bomb(_outside("dots"), "in", options={"files_outside": True}, refused=False),
    "views.csv link": Bomb(_outside("link"), "in", refused=False),
    "views.csv 10^12 rows": Bomb(FAR, ""),
    "views.csv 10^12 rows, info": Bomb(FAR, "", readers.info),
    "views.csv 5000 digits": Bomb(_csv(b"9" * 5000 + b",0,v1.png"), ""),
    "views.csv long name": Bomb(_csv(b"0,1," + b"a" * 5000 + b".png"), ""),
    "views.csv long field": Bomb(_csv(b'0,0,"' + b"a" * 200000), ""),
    "names of 10^9": _named("v_0_0", f"v_0_{10**9}", "v_1_1", f"v_{10**9}_1"),
    "names of 10^30": _named("v_0_0", f"v_0_{10**30}", "v_1_1"),
    "numbered to 10^18": _named("f0", "f1", f"f{10**18}"),
    "numbered to 10^10": _named("f0", "f1", f"f{10**10}"),
    "hci number 10^12": _named("input_Cam000", "input_Cam001", "input_Cam002", f"input_Cam{10**12}"),
    "hci cams 1e9": _cameras(x=b"1000000000", y=b"1000000000"),
    "hci cams 1e300": _cameras(x=b"1e300"),
    "cambridge 1e9": Bomb(
        changed(seeds.cambridge, "param.txt", b"num_x: 1e9\nnum_y: 1e9\nbase_x: 1\nbase_y: 1\n"), ""
    ),
    "centres one line": Bomb(written("c.csv", b"1"), "c.csv", readers.centres),
    "centres ragged": Bomb(written("c.csv", b"1,2\n3\n"), "c.csv", readers.centres),
}
