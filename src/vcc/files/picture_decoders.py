"""Decoding of pictures by libraries, after checks of the declared sizes.

A header may declare more than its file holds; libraries then allocate that memory, read past their input, or
fill with black. Sizes are compared with the file before a library decodes it.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.files import jpeg_headers
from vcc.files.declared_sizes import check_declared_size
from vcc.files.envi import ENDINGS as ENVI
from vcc.files.envi import read_envi
from vcc.files.netpbm import read_netpbm
from vcc.files.npy import read_npy
from vcc.files.spectral import bands_of, ome

NOT_OPAQUE = (
    "this picture is not opaque everywhere, and its background is unknown: flatten it (remove its alpha channel)"
)

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_CHANNELS = {0: 1, 2: 3, 3: 4, 4: 2, 6: 4}  # by the type of colour; a palette may have opacity
_SCANS = 16  # a progressive JPEG has about ten, and each covers the whole picture
_TIFF_JPEG = 7
_PALETTE_NOT_GREY = ("P", "1")
_PLAIN_BMP = (0, 3)  # uncompressed; with bit fields


class Unsuitable(Exception):
    """A file that its library can read but this package does not support."""


def read_png(path: Path) -> NDArray[Any]:
    """The samples of a PNG with all channels, including alpha."""
    return decode_png(path.read_bytes())


def decode_png(data: bytes, out: NDArray[Any] | None = None) -> NDArray[Any]:
    """Decode a PNG with all channels, into ``out`` if given.

    Raises:
        Exception: of any type, if the data are damaged.
    """
    import imagecodecs

    _check_png(data)
    samples: NDArray[Any] = imagecodecs.png_decode(data, out=out)
    return samples


def read_exr_channels(path: Path) -> dict[str, NDArray[Any]]:
    """All channels of an OpenEXR file by name; of its first part if it has several.

    Raises:
        Exception: of any type, if the file is damaged.
    """
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
        for part in file.parts:
            header = part.header
            if header.get("type") not in (None, OpenEXR.scanlineimage, OpenEXR.tiledimage):
                raise Unsuitable("this OpenEXR file has several samples for a pixel (deep); flatten it")
            first, last = (np.asarray(corner, np.int64) for corner in header["dataWindow"])
            width, height = (max(0, int(n)) for n in last - first + 1)
            check_declared_size(4 * width * height * len(header["channels"]), path.stat().st_size, "it")
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}


def _check_png(data: bytes) -> None:
    """Raise for a PNG that declares too much or is truncated."""
    place = len(_PNG)
    while data.startswith(_PNG):
        length = int.from_bytes(data[place : place + 4], "big")
        name = data[place + 4 : place + 8]
        if place + 12 + length > len(data):
            break
        if place == len(_PNG):
            if name != b"IHDR" or length < 13:
                break
            width, height = (int.from_bytes(data[n : n + 4], "big") for n in (place + 8, place + 12))
            bits, colour = data[place + 16], data[place + 17]
            channels = _PNG_CHANNELS.get(colour, 4)
            check_declared_size(width * height * channels * (2 if bits > 8 else 1), len(data), "it")
        if name == b"IEND":
            return
        place += 12 + length
    raise ValueError("it is not a PNG, or its end is missing")


def _read_jpeg(path: Path) -> NDArray[Any]:
    samples = _decode_jpeg(path.read_bytes())
    if samples.ndim == 3 and samples.shape[2] == 4:
        raise Unsuitable("this JPEG has four inks (CMYK); convert it to RGB")
    return samples


def _decode_jpeg(data: bytes, tables: bytes | None = None) -> NDArray[Any]:
    """Decode a JPEG; its tables may be given separately."""
    import imagecodecs

    jpeg = jpeg_headers.parsed(data)
    claimed = jpeg.height * jpeg.width * len(jpeg.sampling) * (1 if jpeg.bits == 8 else 2)
    check_declared_size(claimed, len(data), "it")
    check_declared_size(claimed * len(jpeg.scans) // _SCANS, len(data), f"it, in {len(jpeg.scans)} scans,")
    if jpeg_headers.least_bytes(jpeg) > len(data):
        raise ValueError(f"{jpeg.width}×{jpeg.height} pixels take more than its {len(data):,} bytes")
    samples: NDArray[Any] = imagecodecs.jpeg8_decode(data, tables=tables)
    if jpeg.coding == "lossless" or (samples[-1, -1] == 1 << (jpeg.bits - 1)).all():
        # The last sample is the library's fill colour. The decoder ignores extra data after a complete picture,
        # and
        # reads them in place of missing data.
        filled = imagecodecs.jpeg8_decode(jpeg_headers.longer(jpeg, data, _FILLING), tables=tables)
        if not np.array_equal(samples, filled):
            raise ValueError("the end of the picture is missing")
    return samples


_FILLING = bytes(
    np.random.default_rng(8).integers(0, 255, 256, dtype=np.uint8)
)  # without 255, the first byte of markers


def _read_tiff(path: Path) -> NDArray[Any]:
    import tifffile

    with tifffile.TiffFile(path) as file:
        if file.is_ome and len(file.pages) > 1:
            return _read_ome(file, path)
        if len(file.pages) != 1:
            raise Unsuitable(f"this TIFF holds {len(file.pages)} pictures; only one is supported")
        page = file.pages.first
        _check_tiff(page, path)
        samples: NDArray[Any] = page.asarray()
        if page.photometric == tifffile.PHOTOMETRIC.MINISWHITE:
            if samples.dtype.kind != "u":
                raise Unsuitable("this TIFF stores white as 0 in floating point; invert it")
            samples = np.iinfo(samples.dtype).max - samples
        elif page.photometric == tifffile.PHOTOMETRIC.PALETTE:
            samples = np.moveaxis(np.asarray(page.colormap)[:, samples], 0, -1)
        if samples.ndim == 3 and page.planarconfig == tifffile.PLANARCONFIG.SEPARATE:
            samples = np.moveaxis(samples, 0, -1)
    return samples


def _read_ome(file: Any, path: Path) -> NDArray[Any]:
    """The channels of an OME-TIFF with a page for each; other files that it may name are not opened."""
    sizes = [
        {axis: int(one.get(f"Size{axis}", "0")) for axis in "ZCT"} for one in ome(file.ome_metadata, "Pixels")
    ]
    count = len(file.pages)
    if sizes != [{"Z": 1, "C": count, "T": 1}]:
        raise Unsuitable(
            f"this OME-TIFF holds {count} pictures of {str(sizes)[:80]}: only one with a picture for each channel "
            "is supported"
        )
    first = file.pages.first
    check_declared_size(count * math.prod(first.shaped) * first.dtype.itemsize, path.stat().st_size, "it")
    planes = []
    for page in file.pages:
        if len(page.shape) != 2 or (page.shape, page.dtype) != (first.shape, first.dtype):
            raise Unsuitable("the channels of this OME-TIFF differ in size or type")
        _check_tiff(page, path)
        planes.append(page.asarray())
    return np.stack(planes, axis=-1)


def _check_tiff(page: Any, path: Path) -> None:
    """Raise for a TIFF that declares too much, or whose strips or tiles are partly missing from the file.

    The library leaves missing ones black.
    """
    size, width = path.stat().st_size, page.dtype.itemsize
    palette = 3 if page.colormap is not None else 1
    check_declared_size(math.prod(page.shaped) * palette * width, size, "it")
    if page.is_tiled:
        check_declared_size(math.prod(page.chunked) * math.prod(page.chunks) * width, size, "its tiles")
    places = list(zip(page.dataoffsets, page.databytecounts, strict=False))
    wanted = math.prod(page.chunked)
    there = [place for place in places[:wanted] if place[0] > 0 < place[1] and sum(place) <= size]
    if len(there) < wanted:
        raise ValueError(f"{wanted - len(there):,} of its {wanted:,} strips or tiles are missing")
    if page.compression == 1 and isinstance(page.bitspersample, int):
        *rows, across, channels = page.shaped
        needed = math.prod(rows) * -(-across * channels * page.bitspersample // 8)
        if sum(count for _, count in there) < needed:
            raise ValueError(f"its strips or tiles have less than the {needed:,} bytes of its pixels")
    if page.compression == _TIFF_JPEG:
        with path.open("rb") as file:
            for start, count in there:
                file.seek(start)
                _decode_jpeg(file.read(count), page.jpegtables)


def _read_bmp(path: Path) -> NDArray[Any]:
    from PIL import Image

    data = path.read_bytes()
    with Image.open(io.BytesIO(data), formats=("BMP",)) as picture:
        check_declared_size(3 * picture.width * picture.height, len(data), "it")
        if picture.info["compression"] not in _PLAIN_BMP:
            raise Unsuitable("this BMP is compressed, which is not supported; save it as PNG")
        if picture.mode == "P":
            palette: Any = picture.palette  # colours as stored in the file
            colours = len(palette.palette) // len(palette.rawmode)
            if np.asarray(picture).max() >= colours:
                raise ValueError(f"it has colours beyond the {colours} of its palette")
        return np.asarray(picture.convert("RGB") if picture.mode in _PALETTE_NOT_GREY else picture)


def _read_exr(path: Path) -> NDArray[Any]:
    channels = read_exr_channels(path)
    if bands := bands_of(channels):
        picked = [channels[name] for name in bands]
    elif {"R", "G", "B"} <= channels.keys():
        picked = [channels[name] for name in "RGB"]
    elif len(channels) == 1:
        picked = list(channels.values())
    elif "Y" in channels and channels.keys() <= {"Y", "A"}:
        picked = [channels["Y"]]
    else:
        raise Unsuitable(
            f"this OpenEXR file has the channels {', '.join(sorted(channels))[:200]}; "
            "R, G, B, bands such as S0.550nm, or a single one is wanted"
        )
    alpha = channels.get("A")
    if alpha is not None and not (alpha >= 1).all():
        raise Unsuitable(NOT_OPAQUE)
    samples = np.stack(picked, axis=-1) if len(picked) > 1 else np.array(picked[0])
    return samples.astype(np.float32, copy=False)


DECODERS: dict[str, Callable[[Path], NDArray[Any]]] = {
    ".png": read_png,
    ".jpg": _read_jpeg,
    ".jpeg": _read_jpeg,
    ".tif": _read_tiff,
    ".tiff": _read_tiff,
    ".bmp": _read_bmp,
    ".exr": _read_exr,
    ".npy": read_npy,
    ".ppm": read_netpbm,
    ".pgm": read_netpbm,
    **dict.fromkeys(ENVI, read_envi),
}
"""The decoder for each extension; a decoder may raise any exception."""
