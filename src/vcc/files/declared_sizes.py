"""Limits on the size that a file declares, against decompression bombs.

Some compressions have no bound (a run of zeros, a video frame that repeats the last one), and a bound like
deflate's 1032:1 is still too high. The size that a header declares is compared with the size of the file before
anything is decompressed. Real files stay far below the limit: photographs decompress to less than 50 times
their size, the simplest rendered views to some hundred times.
"""

from __future__ import annotations

from vcc.base.errors import InputError

SMALL_FILE = 2**20
"""Bytes; files up to this size may decompress to a fixed limit, whatever their size."""
PICTURE = 2**26
"""Bytes of samples allowed for a picture in a small file: 8192×8192 grey pixels."""
LIGHT_FIELD = 2**27
"""Bytes of samples allowed for a light field in small files; as float32, colours take up to four times as much."""
TIMES_PACKED = 256
"""Limit of the expansion of a larger file: decompressed bytes over stored bytes."""


def check_declared_size(claimed: int, stored: int, what: str, most: int = PICTURE) -> None:
    """Raise if a file declares more samples than its size allows.

    Args:
        claimed: bytes of all samples, decompressed.
        stored: bytes of the file or files.
        what: name of the file in the message.
        most: bytes to which a small file may decompress, `PICTURE` or `LIGHT_FIELD`.

    Raises:
        InputError: the declared size is too large.
    """
    allowed = most if stored <= SMALL_FILE else max(most, TIMES_PACKED * stored)
    if claimed > allowed:
        raise InputError(
            f"{what} claims {_count(claimed)} bytes of samples in {stored:,} bytes; files of this size may unpack "
            f"to {allowed:,}. Copy it again from where it came from; if it is valid, save it with less "
            "compression, for instance as .npy"
        )


def _count(number: int) -> str:
    return f"{number:,}" if number < 10**15 else f"{float(number):.3g}" if number < 10**300 else "endlessly many"
