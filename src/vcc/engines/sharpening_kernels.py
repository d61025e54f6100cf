"""Filtering a view's samples along both axes in one pass; see `vcc.engines.sharpening`."""

from __future__ import annotations

import numpy as np
from numba import njit

from vcc.engines.sharpening import KEPT_DIGITS
from vcc.plan.rays.sharpening import DIGITS, REACH

OPTIONS = {"nogil": True, "cache": True, "fastmath": {"contract", "nsz"}, "error_model": "numpy"}
SHIFT = 2 * DIGITS - KEPT_DIGITS


@njit(**OPTIONS)
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


@njit(**OPTIONS)
def sharpen_whole(view, kept, channels, weights, lines):  # type: ignore[no-untyped-def]
    """A view of 8-bit samples (rows, samples in a row) into 16 bits with `KEPT_DIGITS` digits after the point.

    Args:
        view: (rows, samples in a row).
        kept: where to write, likewise.
        channels: numbers a pixel.
        weights: (3,) int32 in 2⁻¹⁰: |Σ| ≤ 255·(1398 + 2·207 + 2·20)² < 2³⁰ for means.
        lines: room for six rows.
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
            kept[r, q] = np.int32(total + half) >> SHIFT


@njit(**OPTIONS)
def sharpen_real(view, kept, channels, weights, lines):  # type: ignore[no-untyped-def]
    """A view of other samples, in floating point; arguments as those of `sharpen_whole`, weights as they are."""
    rows = len(view)
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
            kept[r, q] = middle * here[q] + near * (above[q] + below[q]) + far * (above2[q] + below2[q])
