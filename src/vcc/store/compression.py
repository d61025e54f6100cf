"""Compression of a store's samples: lossless by default, lossy picture codecs on request."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from vcc.base import checks, lazy_import
from vcc.base.errors import InputError
from vcc.store.attributes import PICTURES

CHUNK_BYTES = 2**17
"""Approximate size of an inner chunk's samples in bytes: some rows of pixels of one view."""

FLAT = {"name": "default", "separator": "."}
"""Chunk keys for one folder of all views, c.2.3.0.0: five nested folders a view are slower to write and remove."""


@dataclass(frozen=True)
class Lossless:
    """Lossless compression: shuffled bytes, compressed by Blosc.

    Compression factor and write speed in MB/s, measured once on a slow shared core, 64 rows of 500 pixels at a
    time: the demo's scene as float32 3.0 and 170 (lz4: 2.6 and 530), as float16 3.9 and 150 (2.8 and 990);
    ``hci_antinous``, 8 bits, 2.2 and 90 (1.3 and 580). Reading ran at 580 to 1070 MB/s. Level 1 wrote up to 2.7
    times as fast and was 5 to 28 % larger, level 5 about half as fast and 0.5 to 7 % smaller. Shuffling bits
    instead of bytes made all but one larger (``stanford_cards_9x9``: 5 % smaller).

    Args:
        codec: ``"zstd"``, or ``"lz4"``, which is faster and compresses less.
        level: 0 (fastest) to 9 (smallest).

    Raises:
        InputError: another codec or level.
    """

    codec: Literal["zstd", "lz4"] = "zstd"
    level: int = 3

    def __post_init__(self) -> None:
        checks.one_of("the codec of lossless compression", self.codec, ("zstd", "lz4"))
        checks.whole_number_between("the level of compression", self.level, 0, 9)

    @property
    def words(self) -> str:
        """Text for people."""
        return f"lossless ({self.codec}, level {self.level})"


@dataclass(frozen=True)
class Lossy:
    """Lossy compression: each view is stored as a picture; the loss is measured and recorded (PSNR).

    For 8 bits (JPEG XL also 16), grey or three channels. The codecs assume sRGB codes: store sRGB
    (``transfer="srgb"``), or dark regions lose quality. Reading a part of a view decodes the whole view.

    Args:
        codec: ``"jpegxl"`` or ``"avif"`` (8 bits, three channels).
        quality: 1 (small) to 99 (hardly changed), on the scale of the codec.

    Raises:
        InputError: another codec or quality.
    """

    codec: Literal["jpegxl", "avif"] = "jpegxl"
    quality: int = 90

    def __post_init__(self) -> None:
        checks.one_of("the codec of lossy compression", self.codec, ("jpegxl", "avif"))
        exact = "to keep samples exactly leave it out"
        checks.whole_number_between("the quality of lossy compression", self.quality, 1, 99, way_out=exact)

    @property
    def words(self) -> str:
        """Text for people."""
        return f"{'JPEG XL' if self.codec == 'jpegxl' else 'AVIF'}, quality {self.quality}"

    def check(self, kind: np.dtype[Any], channels: int | None) -> None:
        """Raise for samples that the codec does not support.

        Raises:
            InputError: an unsupported type or number of channels.
        """
        if kind.name not in ("uint8", "uint16"):
            raise InputError(
                f'lossy compression is for 8- and 16-bit codes, not {kind}: pass dtype="uint16", or compress '
                "without loss"
            )
        if self.codec == "avif" and kind.name != "uint8":
            raise InputError('AVIF holds 8 bits here, not 16: take "jpegxl"')
        if channels not in ((3,) if self.codec == "avif" else (None, 1, 3)):
            what = "three channels" if self.codec == "avif" else "grey views or three channels"
            raise InputError(f"{self.words} holds {what}, not {channels or 1}: compress without loss")


Compression = Lossless | Lossy


Pixels = int | tuple[int, int]
"""Size of a chunk in pixels: rows, or (rows, columns)."""


def chunk_pixels(view: tuple[int, ...], bytes_each: int, wanted: Pixels | None) -> tuple[int, int]:
    """(rows, columns) of pixels in an inner chunk.

    Args:
        view: (rows, columns[, channels]) of a view.
        bytes_each: bytes of a number.
        wanted: the requested size; None for whole rows in chunks of nearly equal height, see `CHUNK_BYTES`.

    Raises:
        InputError: a number below 1.
    """
    rows, columns = view[:2]
    if wanted is None:
        target = min(max(CHUNK_BYTES // (math.prod(view[1:]) * bytes_each), 8), rows)
        return math.ceil(rows / math.ceil(rows / target)), columns
    down, across = wanted if isinstance(wanted, tuple) else (wanted, columns)
    checks.whole_number_between("chunks", down, 1, of="rows of pixels that are packed together")
    checks.whole_number_between("chunks", across, 1, of="columns of pixels that are packed together")
    return min(down, rows), min(across, columns)


def know_pictures() -> None:
    """Register the picture codec with Zarr. The codec derives from a class of Zarr, so this imports Zarr."""
    lazy_import.module("vcc.store.picture_codec")


def layout(
    shape: tuple[int, ...], kind: np.dtype[Any], compression: Compression, chunks: Pixels | None
) -> dict[str, Any]:
    """Chunks and codecs for an array of this shape, as arguments of `zarr.Group.create_array`."""
    from zarr.codecs import BloscCodec, Crc32cCodec

    if isinstance(compression, Lossy):
        if chunks is not None:
            raise InputError("chunks is for lossless compression: a picture is packed as a whole")
        view = (1, 1, *shape[2:])
        know_pictures()
        codec = {"name": PICTURES, "configuration": asdict(compression)}
        return {"chunks": view, "chunk_key_encoding": FLAT, "serializer": codec, "compressors": [Crc32cCodec()]}
    inner = chunk_pixels(shape[2:], kind.itemsize, chunks)
    whole = (math.ceil(size / part) * part for size, part in zip(shape[2:4], inner, strict=True))
    blosc = BloscCodec(
        cname=compression.codec,
        clevel=compression.level,
        shuffle="shuffle" if kind.itemsize > 1 else "noshuffle",
        typesize=kind.itemsize,
    )
    return {
        "chunks": (1, 1, *inner, *shape[4:]),
        "shards": (1, 1, *whole, *shape[4:]),
        "chunk_key_encoding": FLAT,
        "compressors": [blosc, Crc32cCodec()],  # the checksum detects damaged data
    }
