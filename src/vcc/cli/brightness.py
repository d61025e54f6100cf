"""The brightness of a light field: its range of linear light."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.files import transfer as curves

_LOW, _HIGH = 0.1, 99.9  # per cent of the samples between which the dynamic range is measured
MOST_SAMPLES = 4_000_000
"""Limit on the floating-point samples that are sorted for the range."""


def brightness(views: Iterable[NDArray[Any]], transfer: str) -> str:
    """The dynamic range of linear light, and the share that is black or at the end of the scale, as text."""
    levels, counts = histogram(views, transfer)
    shares = np.cumsum(counts) / counts.sum()
    low, high = (float(levels[np.searchsorted(shares, share / 100)]) for share in (_LOW, _HIGH))
    dark = float(counts[levels <= 0].sum() / counts.sum())
    if high <= 0:
        return "black everywhere"
    if low <= 0:
        low = float(levels[levels > 0].min())  # the darkest that is not black
    words = (
        f"{low:.3g} to {high:.3g} in linear light ({_LOW} % and {_HIGH} % of the samples): "
        f"a range of 1 : {_rounded(high / low)}, {math.log2(high / low):.1f} stops"
    )
    full = float(counts[levels >= 1].sum() / counts.sum()) if levels.max() == 1 else 0.0
    if dark > 0:
        words += f"; {dark:.2%} of the samples are black"
    if full > 0:
        words += f"; {full:.2%} are at the end of the scale, so perhaps clipped"
    return words


def _rounded(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.3g}"


def histogram(
    views: Iterable[NDArray[Any]], transfer: str, most: int = MOST_SAMPLES
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The distinct levels of linear light, ascending, and their counts.

    Args:
        views: samples, one view at a time; at least one.
        transfer: "srgb" or "linear": the encoding of integers.
        most: floating-point samples that are sorted; if there are more, a part of them is used.
    """
    counts: NDArray[np.float64] | None = None
    some: list[NDArray[Any]] = []
    kept, step = 0, 1
    for view in views:
        if view.dtype in (np.uint8, np.uint16):
            bits = 8 * view.dtype.itemsize
            found = np.bincount(view.ravel(), minlength=2**bits).astype(np.float64)
            counts = found if counts is None else counts + found
        else:
            some.append(view.ravel()[::step])
            kept += some[-1].size
            if kept > most:
                step *= 2
                some = [samples[::2] for samples in some]
                kept = sum(samples.size for samples in some)
    if counts is not None:
        bits = int(math.log2(counts.size))
        levels = curves.table(bits) if transfer == "srgb" else np.arange(counts.size) / (counts.size - 1)
        there = counts > 0
        return levels.astype(np.float64)[there], counts[there]
    values, number = np.unique(np.concatenate(some), return_counts=True)
    return values.astype(np.float64), number.astype(np.float64)
