"""Pictures whose headers claim what their bytes do not hold: refused before a library unpacks them."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import imagecodecs
import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image

from vcc.base.errors import InputError
from vcc.files import jpeg_headers
from vcc.files.declared_sizes import PICTURE, SMALL_FILE, TIMES_PACKED, check_declared_size
from vcc.files.pictures import read_picture, read_png_into

RANDOM = np.random.default_rng(3)
COLOUR = RANDOM.integers(0, 256, (40, 50, 3), dtype=np.uint8)
GREY = np.ascontiguousarray(COLOUR[..., 0])


def refused(path: Path, data: bytes, message: str) -> None:
    path.write_bytes(data)
    with pytest.raises(InputError, match=message) as said:
        read_picture(path)
    assert path.name in str(said.value)
    assert len(str(said.value)) < 600


# Claims


def test_a_claim_is_held_against_the_bytes() -> None:
    check_declared_size(PICTURE, 10, "it")
    check_declared_size(TIMES_PACKED * 2 * SMALL_FILE, 2 * SMALL_FILE, "it")
    with pytest.raises(InputError, match=r"it claims 67,108,865 bytes of samples in 10 bytes.*67,108,864"):
        check_declared_size(PICTURE + 1, 10, "it")
    with pytest.raises(InputError, match="claims endlessly many bytes"):
        check_declared_size(10**400, 10, "it")


# PNG


def png(width: int, height: int, packed: bytes, end: bool = True) -> bytes:
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", packed) + (chunk(b"IEND", b"") if end else b"")


def test_png(tmp_path: Path) -> None:
    rows = zlib.compress(bytes(40 * 151))
    path = tmp_path / "a.png"
    path.write_bytes(png(50, 40, rows))
    assert read_picture(path)[0].shape == (40, 50, 3)
    refused(path, png(100_000, 100_000, rows), "claims 30,000,000,000 bytes")
    refused(path, png(50, 41, rows), "truncated, damaged")
    refused(path, png(50, 40, rows, end=False), "end is missing")
    out = np.empty((40, 50, 3), np.uint8)
    assert not read_png_into(path, out)
    assert not read_png_into(tmp_path, out)  # a folder


# JPEG


def jpeg_of_height(data: bytes, height: int) -> bytes:
    place = next(data.find(bytes((255, marker))) for marker in (0xC0, 0xC2) if bytes((255, marker)) in data)
    return data[: place + 5] + struct.pack(">H", height) + data[place + 7 :]


def jpeg(values: np.ndarray, **how: object) -> bytes:
    out = io.BytesIO()
    Image.fromarray(values).save(out, "JPEG", **how)
    return out.getvalue()


@pytest.mark.parametrize("values", [COLOUR, GREY], ids=["colour", "grey"])
@pytest.mark.parametrize("how", [{}, {"progressive": True}, {"restart_marker_rows": 1}, {"subsampling": 0}])
def test_a_jpeg_whose_data_end_early_is_not_painted_grey(
    values: np.ndarray, how: dict[str, object], tmp_path: Path
) -> None:
    path = tmp_path / "a.jpg"
    data = jpeg(values, **how)
    path.write_bytes(data)
    np.testing.assert_array_equal(read_picture(path)[0], np.asarray(Image.open(path)))
    refused(path, jpeg_of_height(data, 120), "missing")
    refused(path, jpeg_of_height(data, 65500), "take more than its|missing")


@pytest.mark.parametrize("how", [{}, {"progressive": True}])
def test_a_jpeg_that_is_grey_at_its_end_opens(how: dict[str, object], tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    values = GREY.copy()
    values[20:] = 128
    path.write_bytes(jpeg(values, **how))
    assert (read_picture(path)[0][-8:] == 128).all()


def test_jpegs_with_many_scans_and_unknown_codings(tmp_path: Path) -> None:
    data = jpeg(GREY)
    path = tmp_path / "a.jpg"
    large = jpeg(np.zeros((4096, 4096), np.uint8), progressive=True)
    again = large[large.rfind(b"\xff\xda") : -2]
    refused(path, large[:-2] + 80 * again + b"\xff\xd9", r"in \d+ scans, claims 9\d,\d+,\d+ bytes")
    refused(path, data.replace(b"\xff\xc0", b"\xff\xc9"), "coding is not known")
    refused(path, jpeg_of_height(data, 0), "states 50×0 pixels")
    refused(path, data[: data.find(b"\xff\xda")] + b"\xff\xd9", "end of the picture is missing")


def test_blocks_of_a_jpeg_are_counted() -> None:
    found = jpeg_headers.parsed(jpeg(COLOUR, subsampling=2))  # 40×50 pixels: units of 16×16, colour at half
    assert (found.height, found.width, found.bits, found.coding) == (40, 50, 8, "sequential")
    assert found.units(found.scans[0]) == 3 * 4
    assert [found.blocks(number, True) for number in (1, 2, 3)] == [(5, 7), (3, 4), (3, 4)]
    assert jpeg_headers.least_bytes(found) == (35 + 12 + 12) // 8


# TIFF


def tiff(values: np.ndarray, **how: object) -> bytes:
    out = io.BytesIO()
    photometric = "rgb" if values.ndim == 3 else "minisblack"
    tifffile.imwrite(out, values, **({"photometric": photometric, "metadata": None} | how))
    return out.getvalue()


def with_tags(data: bytes, **values: int) -> bytes:
    """A TIFF with the first number of some tags changed."""
    changed = bytearray(data)
    with tifffile.TiffFile(io.BytesIO(data)) as file:
        for tag in file.pages.first.tags.values():
            if tag.name in values:
                size = {3: 2, 4: 4, 16: 8}[int(tag.dtype)]
                changed[tag.valueoffset : tag.valueoffset + size] = values[tag.name].to_bytes(size, "little")
    return bytes(changed)


@pytest.mark.parametrize(
    "how",
    [
        {},
        {"compression": "zlib", "predictor": True},
        {"compression": "lzw"},
        {"compression": "packbits", "rowsperstrip": 7},
        {"tile": (16, 16)},
        {"tile": (16, 32), "compression": "zlib"},
        {"compression": "jpeg", "rowsperstrip": 16},
        {"planarconfig": "separate"},
        {"byteorder": ">"},
    ],
)
def test_tiffs_of_all_kinds_open(how: dict[str, object], tmp_path: Path) -> None:
    values = np.moveaxis(COLOUR, -1, 0).copy() if "planarconfig" in how else COLOUR
    path = tmp_path / "a.tif"
    path.write_bytes(tiff(values, **how))
    difference = np.abs(read_picture(path)[0].astype(int) - COLOUR).max()
    assert difference <= (0 if how.get("compression") != "jpeg" else 255)


@pytest.mark.parametrize(
    ("how", "tags", "message"),
    [
        (
            {"compression": "zlib", "rowsperstrip": 8},
            {"StripByteCounts": 0},
            "1 of its 5 strips or tiles are missing",
        ),
        ({"compression": "zlib", "rowsperstrip": 8}, {"StripOffsets": 0}, "1 of its 5 strips"),
        ({"compression": "zlib", "rowsperstrip": 8}, {"StripOffsets": 2**31}, "1 of its 5 strips"),
        ({"compression": "zlib", "rowsperstrip": 8}, {"ImageLength": 4000}, "495 of its 500 strips"),
        ({"compression": "zlib", "rowsperstrip": 8}, {"RowsPerStrip": 4}, "5 of its 10 strips"),
        ({"rowsperstrip": 40}, {"StripByteCounts": 5999}, "less than the 6,000 bytes"),
        ({"tile": (16, 16)}, {"TileByteCounts": 0}, "1 of its 12 strips or tiles"),
        ({"tile": (16, 16)}, {"TileWidth": 2**15, "TileLength": 2**15}, "its tiles claims"),
        ({}, {"ImageWidth": 60000, "ImageLength": 60000}, "claims 10,800,000,000 bytes"),
    ],
)
def test_tiffs_that_lack_some_of_their_pixels(
    how: dict[str, object], tags: dict[str, int], message: str, tmp_path: Path
) -> None:
    refused(tmp_path / "a.tif", with_tags(tiff(COLOUR, **how), **tags), message)


def test_a_stack_is_no_picture(tmp_path: Path) -> None:
    stack = tiff(np.zeros((4, 20, 30), np.uint8), photometric="minisblack", metadata={"axes": "ZYX"})
    refused(tmp_path / "a.tif", stack, "holds 4 pictures")


# BMP


def bmp(width: int, height: int, bits: int, palette: bytes = b"", packing: int = 0) -> bytes:
    body = RANDOM.bytes((width * bits + 31) // 32 * 4 * abs(height))
    start = 54 + len(palette)
    head = struct.pack("<2sIHHI", b"BM", start + len(body), 0, 0, start)
    info = struct.pack("<IiiHHIIiiII", 40, width, height, 1, bits, packing, len(body), 1, 1, len(palette) // 4, 0)
    return head + info + palette + body


RAMP = b"".join(bytes((n, n, n, 0)) for n in range(256))
COLOURS = RANDOM.bytes(1024)


@pytest.mark.parametrize(
    ("data", "shape"),
    [
        (bmp(5, 4, 24), (4, 5, 3)),
        (bmp(5, -4, 24), (4, 5, 3)),
        (bmp(5, 4, 32), (4, 5, 3)),
        (bmp(5, 4, 16), (4, 5, 3)),
        (bmp(5, 4, 8, RAMP), (4, 5)),
        (bmp(5, 4, 8, COLOURS), (4, 5, 3)),
        (bmp(5, 4, 4, COLOURS[:64]), (4, 5, 3)),
        (bmp(13, 4, 1, b"\0\0\0\0\xff\xff\xff\0"), (4, 13, 3)),
    ],
)
def test_bmps_of_all_kinds_open(data: bytes, shape: tuple[int, ...], tmp_path: Path) -> None:
    path = tmp_path / "a.bmp"
    path.write_bytes(data)
    samples, bits = read_picture(path)
    assert (samples.shape, bits) == (shape, 8)
    np.testing.assert_array_equal(samples, imagecodecs.bmp_decode(data))  # another library, of sound files
    refused(path, data[:-8], "truncated")
    refused(path, data[:22] + struct.pack("<i", 100_000) + data[26:], "truncated, damaged|samples")
    refused(path, data[:22] + struct.pack("<i", 6) + data[26:], "truncated")


def test_bmps_beyond_their_palette_and_packed(tmp_path: Path) -> None:
    refused(tmp_path / "a.bmp", bmp(50, 40, 8, COLOURS[:40]), "beyond the 10 of its palette")
    refused(tmp_path / "a.bmp", bmp(50, 40, 8, COLOURS, packing=1), "compressed|truncated")


# OpenEXR, .npy, .ppm


def test_exr(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"Y": GREY.astype(np.float32)}) as file:
        file.write(str(path))
    np.testing.assert_array_equal(read_picture(path)[0], GREY)
    data = path.read_bytes()

    def of_size(width: int, height: int) -> bytes:
        changed = bytearray(data)
        for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
            place = data.find(name) + len(name) + 12
            changed[place : place + 8] = struct.pack("<ii", width - 1, height - 1)
        return bytes(changed)

    refused(path, of_size(30_000, 30_000), "claims 3,600,000,000 bytes")
    refused(path, of_size(50, 400), "truncated, damaged")


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda: npy((10**6, 10**6)), "larger than|greater than"),
        (lambda: npy((2, 3), "'|O'"), "[oO]bject"),
        (lambda: b"\x93NUMPY\x01\x00\x10\x00" + b"(" * 16, "truncated, damaged"),
        (lambda: b"PK\x03\x04" + bytes(60), "several, an .npz"),
    ],
)
def test_npy(write: Callable[[], bytes], message: str, tmp_path: Path) -> None:
    refused(tmp_path / "a.npy", write(), message)


def npy(shape: tuple[int, ...], kind: str = "'<f4'") -> bytes:
    header = f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(100)


def test_netpbm(tmp_path: Path) -> None:
    refused(tmp_path / "a.ppm", b"P6 1000000000 1000000000 255\n" + bytes(100), "not a binary Netpbm|truncated")
    refused(tmp_path / "a.ppm", b"P6 " + b"9" * 5000 + b" 2 255\n" + bytes(100), "not a binary Netpbm")
