"""sRGB to linear light and back, IEC 61966-2-1: the exact piecewise curve, not a power of 2.2.

Stored samples of 8 or 16 bits are decoded through a table of all 256 or 65536 values: as exact as the formula,
and much faster.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.errors import InputError


def to_linear(encoded: ArrayLike) -> NDArray[np.float32]:
    """Linear light of sRGB-encoded values, IEC 61966-2-1: both without unit, 1 = full scale.

    Values below 0 follow the linear part of the curve, values above 1 the power.

    Args:
        encoded: numbers of any shape.

    Returns:
        float32, the same shape.
    """
    code = np.asarray(encoded, dtype=np.float64)
    power = ((np.maximum(code, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(code <= 0.04045, code / 12.92, power).astype(np.float32)


def from_linear(linear: ArrayLike) -> NDArray[np.float32]:
    """The sRGB encoding of linear light, IEC 61966-2-1: both without unit, 1 = full scale.

    Args:
        linear: numbers of any shape; for values outside 0 to 1 see `to_linear`.

    Returns:
        float32, the same shape.
    """
    light = np.asarray(linear, dtype=np.float32)
    power = np.float32(1.055) * np.maximum(light, np.float32(0.0031308)) ** np.float32(1 / 2.4)
    return np.where(light <= np.float32(0.0031308), light * np.float32(12.92), power - np.float32(0.055))


@functools.cache
def table(bits: int) -> NDArray[np.float32]:
    """Linear light, 0 to 1, of the 2^bits sRGB code values: 256 or 65536 entries, read-only.

    Raises:
        InputError: bits other than 8 or 16.
    """
    if bits not in (8, 16):
        raise InputError(f"stored sRGB samples have 8 or 16 bits, not {bits}")
    entries = to_linear(np.arange(2**bits) / (2**bits - 1))
    entries.flags.writeable = False
    return entries


_AT_ONCE = 65536  # chunk length: the indices, which NumPy widens to 8 bytes each, stay in the cache


@functools.cache
def _pairs() -> NDArray[np.uint64]:
    """The 8-bit table for two samples at a time: two float32 for each pair of adjacent bytes."""
    both = table(8)[np.arange(65536, dtype=np.uint16).view(np.uint8)]
    entries = both.view(np.uint64)
    entries.flags.writeable = False
    return entries


def decode(samples: NDArray[Any], out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """Linear light of stored sRGB samples; floating-point samples are linear and are only copied.

    Args:
        samples: uint8, uint16 or floating point, any shape.
        out: output array of the same shape; a new array if None.

    Returns:
        float32 of the same shape; integers give 0 to 1.

    Raises:
        InputError: samples of another type.
    """
    if out is None:
        out = np.empty(samples.shape, np.float32)
    if samples.dtype.kind == "f":
        out[...] = samples
    elif samples.dtype == np.uint8 and samples.size % 2 == 0 and _are_contiguous(samples, out):
        # Pairs of samples: twice as fast, with the same result.
        codes, light = samples.reshape(-1).view(np.uint16), out.reshape(-1).view(np.uint64)
        for start in range(0, len(codes), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            np.take(_pairs(), codes[part], out=light[part], mode="clip")
    elif samples.dtype == np.uint16 and _are_contiguous(samples, out):
        numbers, values = samples.reshape(-1), out.reshape(-1)
        for start in range(0, len(numbers), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            np.take(table(16), numbers[part], out=values[part], mode="clip")
    elif samples.dtype in (np.uint8, np.uint16):
        # Every code is inside the table, so "clip" changes nothing; it avoids a buffered copy in NumPy.
        np.take(table(samples.dtype.itemsize * 8), samples, out=out, mode="clip")
    else:
        raise InputError(f"sRGB samples are uint8, uint16 or floating point, not {samples.dtype}")
    return out


def _are_contiguous(*arrays: NDArray[Any]) -> bool:
    return all(array.flags.c_contiguous for array in arrays)


def encode(linear: NDArray[np.floating[Any]], bits: int) -> NDArray[Any]:
    """Encode linear light as stored sRGB samples, clipped to 0…1 and rounded.

    Args:
        linear: any shape, 1 = full scale.
        bits: 8 or 16.

    Returns:
        uint8 or uint16, the same shape.

    Raises:
        InputError: bits other than 8 or 16.
    """
    if bits not in (8, 16):
        raise InputError(f"stored sRGB samples have 8 or 16 bits, not {bits}")
    codes: NDArray[Any] = np.rint(from_linear(np.clip(linear, 0, 1)) * (2**bits - 1))
    return codes.astype(f"uint{bits}")
