"""Filter a view's samples along both axes in one pass; see `vcc.plan.operators.SharpenViews`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.workers import Workers
from vcc.engines.compiled import ordered_loop
from vcc.engines.vector_sums import fetch_close
from vcc.plan.how import cores
from vcc.plan.operators import KEPT_DIGITS, REACH
from vcc.plan.operators import WEIGHT_DIGITS as DIGITS

LINE = 64
"""Bytes of a cache line."""
SHIFT = 2 * DIGITS - KEPT_DIGITS
AT_ONCE = 32
"""Numbers that vectorised loops process at a time: multiples of it leave no remainder loop."""


def filtered(
    weights: tuple[int, int, int],
    values: NDArray[Any],
    threads: int | None = None,
    check: Callable[[], None] | None = None,
) -> NDArray[Any]:
    """Filter samples (v, u, t, s[, channels]): uint8 gives int16, float64 stays, all others give float32.

    ``check`` is called after each row of views; an exception that it raises ends the work.
    """
    given, wide = _kinds(values.dtype)
    kept = np.empty(values.shape, dtype=wide)
    factors, whole = _factors(weights, values.dtype)
    rows, length = values.shape[2], int(np.prod(values.shape[3:]))
    channels = values.shape[4] if values.ndim == 5 else 1

    corner = np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64)

    def sharpen_row(row: int) -> None:
        line = _line(factors, length, channels)
        for column in range(values.shape[1]):
            view = np.ascontiguousarray(values[row, column], dtype=given).reshape(1, 1, rows, length)
            to = kept[row, column].reshape(-1)
            sharpen(view, None, corner, (rows, length // channels), to, channels, factors, whole, line)

    with Workers(threads or cores()) as pool:
        for _ in pool.map(sharpen_row, range(values.shape[0])):
            if check is not None:
                check()
    return kept


class ToSharpen:
    """Samples that are filtered when they are read, in parts or as a whole.

    Args:
        weights: of the filter.
        values: samples (v, u, t, s[, channels]).
    """

    def __init__(self, weights: tuple[int, int, int], values: NDArray[Any]) -> None:
        self._weights, self._values = weights, values
        self._whole: NDArray[Any] | None = None
        self.shape = values.shape

    @property
    def bytes_kept(self) -> int:
        """Bytes of a pixel in filtered parts."""
        return _kept_in_parts(self._values.dtype).itemsize * (self.shape[4] if len(self.shape) == 5 else 1)

    def parts(self, size: tuple[int, int]) -> Parts:
        """Parts with this number of rows and columns of pixels."""
        return Parts(self._weights, self._values, size)

    def whole(self, threads: int) -> NDArray[Any]:
        """All samples filtered, once for several rounds of rays."""
        if self._whole is None:
            self._whole = filtered(self._weights, self._values, threads)
        return self._whole


class Parts:
    """Parts of all views, filtered when they are read.

    Args:
        weights: of the filter.
        values: samples (v, u, t, s[, channels]).
        size: rows and columns of pixels of a part.
    """

    def __init__(self, weights: tuple[int, int, int], values: NDArray[Any], size: tuple[int, int]) -> None:
        given, _ = _kinds(values.dtype)
        self.channels = values.shape[4] if values.ndim == 5 else 1
        self._views = np.ascontiguousarray(values, dtype=given).reshape(*values.shape[:3], -1)
        self._factors, self._whole = _factors(weights, values.dtype)
        self.kind, self.size = _kept_in_parts(values.dtype), size

    def buffers(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Buffers for the parts, flat and `AT_ONCE` numbers longer than needed, and for a row that is filtered."""
        length = self.size[1] * self.channels
        count = int(np.prod(self._views.shape[:2])) * self.size[0] * length
        return np.zeros(count + AT_ONCE, dtype=self.kind), _line(self._factors, length, self.channels)

    def fill(
        self,
        rows: NDArray[np.int64],
        columns: NDArray[np.int64],
        parts: NDArray[Any],
        line: NDArray[Any],
    ) -> None:
        """Filter the part of each view that begins at its row of views' ``rows`` and its column's ``columns``.

        Args:
            rows: (v,).
            columns: (u,).
            parts: buffer for the parts, from `buffers`.
            line: buffer for a row, from `buffers`.
        """
        views, filtering = self._views, (self.channels, self._factors, self._whole)
        sharpen(views, views.reshape(-1), (rows, columns), self.size, parts, *filtering, line)


def _kinds(kind: np.dtype[Any]) -> tuple[np.dtype[Any], np.dtype[Any]]:
    """The types in which samples of a type are filtered, and in which the results are stored."""
    if kind == np.uint8:
        return kind, np.dtype(np.int16)
    wide = np.dtype(np.float64 if kind == np.float64 else np.float32)
    return (np.dtype(np.float32) if kind == np.float16 else kind), wide


def _kept_in_parts(kind: np.dtype[Any]) -> np.dtype[Any]:
    """The type in which filtered parts are stored; rays read them directly."""
    return np.dtype(np.int16 if kind == np.uint8 else np.float32)


def _factors(weights: tuple[int, int, int], kind: np.dtype[Any]) -> tuple[NDArray[Any], bool | None]:
    """Weights as `sharpen` expects them; True if they are integers, else None."""
    if kind == np.uint8:
        return np.array(weights, dtype=np.int32), True
    return (np.array(weights) * 2.0**-DIGITS).astype(_kinds(kind)[1]), None


def _line(factors: NDArray[Any], length: int, channels: int) -> NDArray[Any]:
    """A buffer for a row of sums, with `REACH` pixels on each side, and `AT_ONCE` further numbers."""
    return np.zeros(length + 2 * REACH * channels + AT_ONCE, dtype=factors.dtype)


def given_back(
    weights: tuple[int, int, int], values: NDArray[Any], threads: int, written_over: bool = False
) -> NDArray[np.float32]:
    """The transpose of `filtered`, float32: gradients of filtered samples to the samples.

    Rounding and the unit of filtered 8-bit samples are left out: see `vcc.plan.protocol.Engine.prepared_back`.
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


@ordered_loop
def sharpen(views, others, begin, size, kept, channels, weights, whole, line):  # type: ignore[no-untyped-def]
    """Filter a part of each view along both axes.

    Args:
        views: (v, u, rows, samples in a row).
        others: the same, flat, for parts; None for whole views. With parts, up to `AT_ONCE` numbers may be
            written after the last one, as a remainder loop for each short row takes longer.
        begin: (v,), the first row of the parts of a row of views; (u,), the first pixel of a row of the parts of
            a column of views.
        size: rows, and pixels in a row, of a part.
        kept: output, flat, in the order (v, u, row, sample).
        channels: values per pixel.
        weights: (3,) of the type of the sums: int32 in units of 2⁻¹⁰ for 8-bit samples, with
            |Σ| ≤ 255·(1398 + 2·207 + 2·20)² < 2³⁰ for means; else real numbers.
        whole: True for 8-bit samples, whose sums are rounded to `KEPT_DIGITS` digits after the point; else None.
        line: buffer for a row of sums, with `REACH` pixels on each side and `AT_ONCE` further numbers.
    """
    _, nu, rows, row = views.shape
    pixels, half, kind = row // channels, 1 << (SHIFT - 1), weights.dtype.type
    middle, near, far = weights[0], weights[1], weights[2]
    first_rows, first_columns = begin
    length, per_line = size[1] * channels, LINE // views.itemsize
    end, across = length + 2 * REACH * channels, length
    if others is not None:
        across = (length + AT_ONCE - 1) // AT_ONCE * AT_ONCE
    # Slices, because the compiler cannot rule out that an index with a subtraction is negative.
    left2, left1, here = line, line[channels:], line[2 * channels :]
    right1, right2 = line[3 * channels :], line[4 * channels :]
    for part in range(views.shape[0] * nu):
        j, i = part // nu, part % nu
        view, first, left = views[j, i], first_rows[j], first_columns[i]
        low, high = max(left - REACH, 0), min(left + size[1] + REACH, pixels)
        before, inner = (low - left + REACH) * channels, (high - low) * channels
        sums, down = line[before:], inner
        if others is not None:
            down = (inner + AT_ONCE - 1) // AT_ONCE * AT_ONCE
        for r in range(first, first + size[0]):
            if others is not None and i + 1 < nu:  # the same row of the next part, elsewhere in memory
                place = ((part + 1) * rows + r) * row + max(first_columns[i + 1] - REACH, 0) * channels
                for q in range(place, place + inner + per_line, per_line):
                    fetch_close(others, q)
            # Beyond a border, its last samples are repeated.
            lowest = min(r + 2, rows - 1)
            above2, above, level = view[max(r - 2, 0)], view[max(r - 1, 0)], view[r]
            below, below2 = view[min(r + 1, rows - 1)], view[lowest]
            above2, above, level = above2[low * channels :], above[low * channels :], level[low * channels :]
            below, below2 = below[low * channels :], below2[low * channels :]
            if down > (rows - lowest) * row - low * channels:  # stay in bounds
                down = inner
            for q in range(down):
                sums[q] = (
                    middle * kind(level[q])
                    + near * (kind(above[q]) + kind(below[q]))
                    + far * (kind(above2[q]) + kind(below2[q]))
                )
            for q in range(before):
                line[q] = line[before + q % channels]
            for q in range(before + inner, end):
                line[q] = line[before + inner - channels + q % channels]
            to = kept[(part * size[0] + r - first) * length :]
            for q in range(across):
                total = middle * here[q] + near * (left1[q] + right1[q]) + far * (left2[q] + right2[q])
                if whole is None:  # resolved at compile time
                    to[q] = total
                else:
                    to[q] = np.int32(total + half) >> SHIFT


@ordered_loop
def give_back(view, found, channels, weights):  # type: ignore[no-untyped-def]
    """The transpose of `sharpen`, for real numbers.

    The filter is even: it is its own transpose, except at the border. There the last samples were repeated, so
    they also receive the gradients of the samples beyond them.
    """
    rows, length = view.shape
    middle, near, far = weights[0], weights[1], weights[2]
    # Gradients beyond a border are zero, along rows and beyond the first and last row.
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
