"""How much a file may claim to hold: a few bytes must not unfold into all of the memory.

Some packings have no bound of their own (a run of zeros, a frame of a video that repeats the last one), and those
that have one, like deflate's 1032 bytes for one, leave room for bombs. So samples are counted as a file's header
claims them, before anything is unpacked, and held against the bytes that there are. What pictures and light fields
hold in earnest is far below: photographs have less than 50 samples for a byte, the plainest of rendered views some
hundred. A sample of 4 or 8 bytes counts as two or four.
"""

from __future__ import annotations

from vcc.base.errors import InputError

SMALL_FILE = 2**20
"""Bytes up to which a file's bound is a number of samples and no ratio."""
PICTURE = 2**26
"""Samples that a picture in a small file may have: 8192×8192 grey pixels."""
LIGHT_FIELD = 2**27
"""Samples that a light field in small files may have: 512 MiB as float32."""
SAMPLES_PER_BYTE = 256
"""Samples that a larger file may have for each of its bytes."""


def check_claim(claimed: int, width: int, stored: int, what: str, most: int = PICTURE) -> None:
    """Refuse a file that claims more samples than its bytes may hold.

    Args:
        claimed: samples, over all channels.
        width: bytes of a sample, unpacked.
        stored: bytes of the file or files.
        what: claims them, for the message.
        most: samples that a small file may hold, `PICTURE` or `LIGHT_FIELD`.

    Raises:
        InputError: it claims more.
    """
    allowed = most if stored <= SMALL_FILE else max(most, SAMPLES_PER_BYTE * stored)
    each = max(1, width // 2)
    if claimed * each > allowed:
        raise InputError(
            f"{what} claims {_count(claimed)} samples in {stored:,} bytes, and so few bytes may hold "
            f"{allowed // each:,}. Copy it again from where it came from; if it is sound, save it less packed, as "
            ".npy for instance"
        )


def _count(number: int) -> str:
    return f"{number:,}" if number < 10**15 else f"{float(number):.3g}" if number < 10**300 else "endlessly many"
