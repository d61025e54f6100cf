"""Filtering a view's samples along both axes in one pass; see `vcc.engines.sharpening`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.workers import Workers
from vcc.engines.compiled import compiled
from vcc.plan.how import cores
from vcc.plan.operators import KEPT_DIGITS, REACH
from vcc.plan.operators import WEIGHT_DIGITS as DIGITS

_compiled = compiled(fastmath={"contract", "nsz"})
SHIFT = 2 * DIGITS - KEPT_DIGITS


def filtered(weights: tuple[int, int, int], values: NDArray[Any], threads: int | None = None) -> NDArray[Any]:
    """Samples (v, u, t, s[, channels]) filtered: int16 of uint8, else in floating point, double of double."""
    small = values.dtype == np.uint8
    given = np.dtype(np.float32) if values.dtype == np.float16 else values.dtype
    wide = np.float64 if values.dtype == np.float64 else np.float32
    kept = np.empty(values.shape, dtype=np.int16 if small else wide)
    factors = np.array(weights, dtype=np.int32) if small else (np.array(weights) * 2.0**-DIGITS).astype(wide)
    rows, length = values.shape[2], int(np.prod(values.shape[3:]))
    channels = values.shape[4] if values.ndim == 5 else 1

    def sharpen_row(row: int) -> None:
        lines = np.empty((2 * REACH + 2, length), dtype=factors.dtype)
        for column in range(values.shape[1]):
            view = np.ascontiguousarray(values[row, column], dtype=given).reshape(rows, length)
            to = kept[row, column].reshape(rows, length)
            sharpen(view, to, channels, factors, True if small else None, lines)

    with Workers(threads or cores()) as pool:
        list(pool.map(sharpen_row, range(values.shape[0])))
    return kept


def given_back(
    weights: tuple[int, int, int], values: NDArray[Any], threads: int, written_over: bool = False
) -> NDArray[np.float32]:
    """The transpose of `filtered`, float32: what weights of filtered samples say of the samples as given.

    Rounding is left out, and so is the unit of what 8 bits become: see `vcc.plan.protocol.Engine.prepared_back`.
    """
    in_place = written_over and values.dtype == np.float32 and values[0, 0].flags.c_contiguous
    found = values if in_place else np.empty(values.shape, dtype=np.float32)
    factors = (np.array(weights) * 2.0**-DIGITS).astype(np.float32)
    rows, channels = values.shape[2], values.shape[4] if values.ndim == 5 else 1

    def give_row(row: int) -> None:
        for column in range(values.shape[1]):
            view = values[row, column]
            view = view.copy() if in_place else np.ascontiguousarray(view, dtype=np.float32)
            view = view.reshape(rows, -1)
            give_back(view, found[row, column].reshape(rows, -1), channels, factors)

    with Workers(threads) as pool:
        list(pool.map(give_row, range(values.shape[0])))
    return found


@_compiled
def sharpen_across(row, plain, line, channels, weights):  # type: ignore[no-untyped-def]
    """A row of pixels filtered along itself; ``plain`` is room for the row in the type of the sums."""
    length = len(row)
    middle, near, far = weights[0], weights[1], weights[2]
    for q in range(length):
        plain[q] = row[q]
    # Slices, as numbers that are subtracted might be negative for all that the compiler knows.
    inner = length - 2 * REACH * channels
    left2, left, here = plain, plain[channels:], plain[2 * channels :]
    right, right2, found = plain[3 * channels :], plain[4 * channels :], line[2 * channels :]
    for q in range(inner):
        found[q] = middle * here[q] + near * (left[q] + right[q]) + far * (left2[q] + right2[q])
    pixels = length // channels
    for pixel in range(pixels):
        if REACH <= pixel < pixels - REACH:
            continue
        for channel in range(channels):
            last = length - channels + channel
            q = pixel * channels + channel
            line[q] = (
                middle * plain[q]
                + near * (plain[max(q - channels, channel)] + plain[min(q + channels, last)])
                + far * (plain[max(q - 2 * channels, channel)] + plain[min(q + 2 * channels, last)])
            )


@_compiled
def sharpen(view, kept, channels, weights, whole, lines):  # type: ignore[no-untyped-def]
    """A view (rows, samples in a row) filtered along both axes.

    Args:
        view: (rows, samples in a row).
        kept: where to write, likewise.
        channels: numbers a pixel.
        weights: (3,) of the type of the sums: of 8-bit samples int32 in 2⁻¹⁰, for which
            |Σ| ≤ 255·(1398 + 2·207 + 2·20)² < 2³⁰ for means; else real numbers.
        whole: True for 8-bit samples, whose sums are rounded to `KEPT_DIGITS` digits after the point; else None.
        lines: room for six rows of sums.
    """
    rows, half = len(view), 1 << (SHIFT - 1)
    for r in range(-REACH, rows):
        ahead = r + REACH
        if ahead < rows:
            sharpen_across(view[ahead], lines[5], lines[ahead % 5], channels, weights)
        if r < 0:
            continue
        above2, above, here = lines[max(r - 2, 0) % 5], lines[max(r - 1, 0) % 5], lines[r % 5]
        below, below2 = lines[min(r + 1, rows - 1) % 5], lines[min(r + 2, rows - 1) % 5]
        middle, near, far = weights[0], weights[1], weights[2]
        for q in range(view.shape[1]):
            total = middle * here[q] + near * (above[q] + below[q]) + far * (above2[q] + below2[q])
            if whole is None:  # told apart when compiled
                kept[r, q] = total
            else:
                kept[r, q] = np.int32(total + half) >> SHIFT


@_compiled
def give_back(view, found, channels, weights):  # type: ignore[no-untyped-def]
    """The transpose of `sharpen`, for real numbers.

    The filter is even, so that it is its own transpose but at the border: there the last samples went on, and get
    back what was taken from beyond them.
    """
    rows, length = view.shape
    middle, near, far = weights[0], weights[1], weights[2]
    # What lies beyond a border took nothing from anybody: zero, along rows and beyond the first and last of them.
    lines, padded = np.zeros((5, length), view.dtype), np.zeros(length + 2 * REACH * channels, view.dtype)
    left2, left, here = padded, padded[channels:], padded[2 * channels :]
    right, right2 = padded[3 * channels :], padded[4 * channels :]
    for r in range(-REACH, rows):
        ahead = r + REACH
        line = lines[ahead % 5]
        if ahead < rows:
            here[:length] = view[ahead]
            for q in range(length):
                line[q] = middle * here[q] + near * (left[q] + right[q]) + far * (left2[q] + right2[q])
            for channel in range(channels):
                last = length - channels + channel
                line[channel] += (near + far) * here[channel] + far * right[channel]
                line[last] += (near + far) * here[last] + far * left[last]
        else:
            line[:] = 0
        if r < 0:
            continue
        above2, above, level = lines[(r - 2) % 5], lines[(r - 1) % 5], lines[r % 5]
        below, below2 = lines[(r + 1) % 5], lines[(r + 2) % 5]
        for q in range(length):
            found[r, q] = middle * level[q] + near * (above[q] + below[q]) + far * (above2[q] + below2[q])
        if r == 0:
            for q in range(length):
                found[r, q] += (near + far) * level[q] + far * below[q]
        if r == rows - 1:
            for q in range(length):
                found[r, q] += (near + far) * level[q] + far * above[q]
