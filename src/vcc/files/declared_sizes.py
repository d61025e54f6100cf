"""How much a file may claim to hold: a few bytes must not unfold into all of the memory.

Some packings have no bound of their own (a run of zeros, a frame of a video that repeats the last one), and those
that have one, like deflate's 1032 bytes for one, leave room for bombs. So what a file's header claims is held
against the bytes that there are, before anything is unpacked. What pictures and light fields hold in earnest is
far below: photographs have less than 50 bytes for one, the plainest of rendered views some hundred.
"""

from __future__ import annotations

from vcc.base.errors import InputError

SMALL_FILE = 2**20
"""Bytes up to which what a file may unpack to is no matter of its size."""
PICTURE = 2**26
"""Bytes of samples that a picture in a small file may have: 8192×8192 grey pixels."""
LIGHT_FIELD = 2**27
"""Bytes of samples that a light field in small files may have; as float32, colours take up to four times that."""
TIMES_PACKED = 256
"""How many times its own bytes a larger file may unpack to."""


def check_declared_size(claimed: int, stored: int, what: str, most: int = PICTURE) -> None:
    """Refuse a file that claims more than its bytes may hold.

    Args:
        claimed: bytes of all samples, unpacked.
        stored: bytes of the file or files.
        what: claims them, for the message.
        most: bytes to which a small file may unpack, `PICTURE` or `LIGHT_FIELD`.

    Raises:
        InputError: it claims more.
    """
    allowed = most if stored <= SMALL_FILE else max(most, TIMES_PACKED * stored)
    if claimed > allowed:
        raise InputError(
            f"{what} claims {_count(claimed)} bytes of samples in {stored:,} bytes, and so few may unpack to "
            f"{allowed:,}. Copy it again from where it came from; if it is sound, save it less packed, "
            "as .npy for instance"
        )


def _count(number: int) -> str:
    return f"{number:,}" if number < 10**15 else f"{float(number):.3g}" if number < 10**300 else "endlessly many"
