"""Limits of the memory of an operation, checked before it starts."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vcc.base.errors import InputError

MEMORY_LIMIT = 4 * 2**30
"""Default limit of the memory of one operation, bytes."""


def check_memory(needed: int, limit: int | None, what: str, way_out: str) -> None:
    """Raise an error for work that takes more memory than allowed.

    Args:
        needed: bytes.
        limit: bytes; None uses `MEMORY_LIMIT`.
        what: subject of the message.
        way_out: a solution, for the message.

    Raises:
        InputError: with the bytes needed, the bytes allowed and the solution.
    """
    allowed = MEMORY_LIMIT if limit is None else limit
    if needed > allowed:
        raise InputError(
            f"{what} needs {_size(needed)}, and {_size(allowed)} are allowed: {way_out}, or pass memory_limit= in "
            "bytes"
        )


def check_samples(shape: Sequence[int], limit: int | None, what: str, way_out: str = "", each: int = 4) -> None:
    """Raise an error for samples that take more memory than allowed.

    Args:
        shape: of the samples.
        limit: bytes; None uses `MEMORY_LIMIT`.
        what: name of the samples, for the message.
        way_out: a solution; empty for a part or a coarser grid of a light field.
        each: bytes of a sample: 4 for float32, 8 for complex64.

    Raises:
        InputError: as `check_memory`.
    """
    way_out = way_out or "work on a piece (lf[:, :, ::4, ::4]), choose a coarser grid"
    needed = each * math.prod(int(n) for n in shape)
    check_memory(needed, limit, f"{what} of shape {'×'.join(map(str, shape))}", way_out)


def _size(number: float) -> str:
    for unit in ("bytes", "KiB", "MiB"):
        if number < 1024:
            return f"{number:.4g} {unit}"
        number /= 1024
    return f"{number:.4g} GiB"
