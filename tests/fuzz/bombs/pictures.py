"""Pictures and arrays that state sizes which they do not have."""

from __future__ import annotations

import io
import os
import struct
import tempfile
import zlib
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import tifffile

from tests.fuzz import readers, seeds
from tests.fuzz.bombs.bomb import Bomb, all_views, npy, view, written, zeros_deflated, zip_of, zip_of_deflated
from tests.fuzz.seeds import Maker


def _png(width: int, height: int, bits: int = 8, colour: int = 2, body: bytes = b"") -> bytes:
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0)
    samples = body or zlib.compress(bytes(100))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", samples) + chunk(b"IEND", b"")


def _black_png(side: int, megabytes: int) -> bytes:
    raw, _, size = zeros_deflated(megabytes)
    adler = (size % 65521) << 16 | 1  # of as many zeros
    return _png(side, side, 8, 0, b"\x78\xda" + raw + struct.pack(">I", adler))


def _jpeg(width: int, height: int) -> bytes:
    data = bytearray(imagecodecs.jpeg8_encode(view(), level=90))
    place = data.find(b"\xff\xc0")
    data[place + 5 : place + 9] = struct.pack(">HH", height, width)
    return bytes(data)


def _bmp(rows: int) -> bytes:
    """24 rows that say they are more."""
    data = bytearray(imagecodecs.bmp_encode(view()))
    struct.pack_into("<i", data, 22, rows)
    return bytes(data)


def _exr(x: int, y: int) -> bytes:
    with tempfile.TemporaryDirectory() as room:
        file = Path(room) / "a.exr"
        seeds.picture(file, seeds.scene(kind=np.float32)[0, 0])
        data = bytearray(file.read_bytes())
    for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        place = data.find(name) + len(name) + 4
        data[place + 8 : place + 16] = struct.pack("<ii", x, y)
    return bytes(data)


def _tiff(**stated: int) -> Maker:
    """Tags that say something else."""

    def data() -> bytes:
        out = io.BytesIO()
        tifffile.imwrite(out, view(), photometric="rgb", compression="zlib", metadata=None, rowsperstrip=8)
        data = bytearray(out.getvalue())
        with tifffile.TiffFile(io.BytesIO(data)) as file:
            tags = {tag.name: tag for tag in file.pages.first.tags.values()}
        for name, value in stated.items():
            tag = tags[name]
            size = {3: 2, 4: 4, 16: 8}[int(tag.dtype)]
            data[tag.valueoffset : tag.valueoffset + size] = (value % 2 ** (8 * size)).to_bytes(size, "little")
        return bytes(data)

    return all_views(data, ".tif")


def _endless(folder: Path) -> None:
    all_views(lambda: seeds.png(view()), ".png")(folder)
    (folder / "v_0_1.png").unlink()
    (folder / "v_0_1.png").symlink_to("/dev/zero")


def _pickled() -> bytes:
    class Evil:
        def __reduce__(self) -> Any:
            return os.mkdir, ("pwned",)

    out = io.BytesIO()
    np.save(out, np.array([Evil()] * 4, dtype=object), allow_pickle=True)
    return out.getvalue()


def _unpacks_to_4_gb() -> dict[str, Any]:
    return {"values.npy": zeros_deflated(4095, npy((2, 2, 2**15, 2**15 - 8), "|u1"))}


TERABYTES = (1000, 1000, 1000, 1000)
PPM = b"P6 1000000000 1000000000 255\n" + bytes(100)
LONG_PPM = b"P6 " + b"9" * 5000 + b" 2 255\n" + bytes(100)
PFM = b"Pf\n1000000000000 2\n-1.0\n" + bytes(100)
LONG_PFM = b"Pf\n" + b"9" * 5000 + b" 2\n-1.0\n" + bytes(100)

BOMBS = {
    "png 100000x100000": Bomb(all_views(_png(100000, 100000), ".png"), ""),
    "png 2^31-1": Bomb(all_views(_png(2**31 - 1, 2**31 - 1, 16, 6), ".png"), ""),
    "png 20000^2 deflated": Bomb(all_views(lambda: _black_png(20000, 400), ".png"), "", refused=False),
    "png is /dev/zero": Bomb(_endless, ""),
    "eslf 100000x100000": Bomb(written("a.png", _png(100000, 100000)), "a.png", options={"views": (10, 10)}),
    "jpeg 65500x65500": Bomb(all_views(lambda: _jpeg(65500, 65500), ".jpg"), ""),
    "tif width 2^31": Bomb(_tiff(ImageWidth=2**31 - 1), ""),
    "tif 60000x60000": Bomb(_tiff(ImageWidth=60000, ImageLength=60000), ""),
    "tif length 2^16": Bomb(_tiff(ImageLength=65535), ""),
    "tif strip of 0 bytes": Bomb(_tiff(StripByteCounts=0), ""),
    "tif strip nowhere": Bomb(_tiff(StripOffsets=0), ""),
    "exr 2^30": Bomb(all_views(lambda: _exr(2**30, 2**30), ".exr"), ""),
    "exr 100000": Bomb(all_views(lambda: _exr(99999, 99999), ".exr"), ""),
    "exr negative": Bomb(all_views(lambda: _exr(-5, -5), ".exr"), ""),
    "bmp of 100000 rows": Bomb(all_views(lambda: _bmp(100000), ".bmp"), ""),
    "bmp of 60 rows": Bomb(all_views(lambda: _bmp(60), ".bmp"), ""),
    "ppm 10^9": Bomb(all_views(PPM, ".ppm"), ""),
    "ppm 5000 digits": Bomb(all_views(LONG_PPM, ".ppm"), ""),
    "pfm 5000 digits": Bomb(written("gt_disp_lowres.pfm", LONG_PFM), "", readers.truth),
    "pfm 10^12": Bomb(written("gt_disp_lowres.pfm", PFM), "", readers.truth),
    "npy terabytes": Bomb(written("a.npy", npy(TERABYTES)), "a.npy"),
    "npy pickled": Bomb(written("a.npy", _pickled), "a.npy"),
    "npy truth terabytes": Bomb(written("disp.npy", npy((10**6, 10**6))), "disp.npy", readers.truth),
    "npz terabytes": Bomb(zip_of("a.npz", lambda: [("values.npy", npy(TERABYTES))]), "a.npz"),
    "npz unpacks to 4 GB": Bomb(zip_of_deflated("a.npz", _unpacks_to_4_gb), "a.npz"),
}
