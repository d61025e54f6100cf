"""Arguments of the compiled loops of footprints: named tuples of numbers and arrays, as Numba accepts them.

`vcc.engines.numba_cpu` fills them from a plan, `vcc.engines.numba_kernels` reads them. All arrays are
contiguous. If rows and columns of samples are separable, each view tap has one table of rows and one of columns;
else views are processed one at a time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pair = tuple[float, float]


class Band(NamedTuple):
    """Rows of the image that a thread works on: ``start`` to ``stop`` (exclusive)."""

    start: int
    stop: int


# --- separable rows and columns ---


class Samples(NamedTuple):
    """Samples stored row by row: row l of view tap (b, a) begins at begin[b] + further[a] + l · pitch.

    Args:
        values: flat.
        begin: (rows of taps,) int64.
        further: (columns of taps,) int64.
        pitch: values from one row of samples to the next.
        channels: values per sample.
    """

    values: NDArray[Any]
    begin: NDArray[np.int64]
    further: NDArray[np.int64]
    pitch: int
    channels: int


class Lines(NamedTuple):
    """The rows of samples of one column of view taps: row l of tap b begins at begin[b] + l · pitch.

    Args:
        values: flat.
        begin: (rows of taps,) int64.
        pitch: values in a row.
        jump: offset from these samples to those of the next column of taps.
    """

    values: NDArray[Any]
    begin: NDArray[np.int64]
    pitch: int
    jump: int


class Rows(NamedTuple):
    """The rows of samples that each row of the raster sums: ``shares`` of the rows from ``first`` on.

    Args:
        first: (rows of taps, raster rows) int64.
        shares: (rows of taps, raster rows, width) float32.
        reach: largest number of rows of samples that four raster rows sum.
        advance: number of further rows of samples that the next four raster rows need.
    """

    first: NDArray[np.int64]
    shares: NDArray[np.float32]
    reach: int
    advance: int


class Columns(NamedTuple):
    """The columns of samples that each column of the raster sums; see `Rows`.

    Args:
        first: (columns of taps, raster columns) int64.
        shares: (columns of taps, raster columns, width) float32.
    """

    first: NDArray[np.int64]
    shares: NDArray[np.float32]


class Footprints(NamedTuple):
    """How the samples of all view taps fall on the raster.

    Args:
        weights: (rows of taps, columns of taps) float32, 0 for taps that are skipped.
        rows: see `Rows`.
        columns: see `Columns`.
    """

    weights: NDArray[np.float32]
    rows: Rows
    columns: Columns


class FineSamples(NamedTuple):
    """How samples are subdivided into finer ones, view by view.

    Args:
        first_row: (finer rows,) int64, the first row of samples that contributes to a finer row.
        row_shares: (finer rows, width) float32, shares of the rows from there on.
        first_column: (finer columns,), likewise.
        column_shares: (finer columns, width), likewise.
        pitch: values in a row of finer samples.
    """

    first_row: NDArray[np.int64]
    row_shares: NDArray[np.float32]
    first_column: NDArray[np.int64]
    column_shares: NDArray[np.float32]
    pitch: int


class MaskLines(NamedTuple):
    """Masks, sampled for one column of view taps.

    Args:
        lines: (lines, pixels or values of a row of samples) float32, mask weights at the columns of the samples.
        begin: (masks, taps) int64, the line of row 0 of a mask, even if this row is not stored.
        rows: (masks,) int64, number of rows of each mask.
        row: (masks, taps), mask row of sample row 0.
        row_step: (masks,), mask rows from one row of samples to the next.
        repeat: 3 if a weight applies to three channels, else 1.
    """

    lines: NDArray[np.float32]
    begin: NDArray[np.int64]
    rows: NDArray[np.int64]
    row: Array
    row_step: Array
    repeat: int


class Entries(NamedTuple):
    """Rows of samples that fall on four rows of the raster.

    Args:
        order: int64, the entries e sorted by which of the four rows they reach, as in `vector_sums.RANGES`.
        ends: (10,) int64, number of entries of ``order`` in each range or an earlier one.
        places: (entries,) int64, where each entry's row of samples begins.
        shares: (entries, 4) float32, share of the entry in each of the four rows.
    """

    order: NDArray[np.int64]
    ends: NDArray[np.int64]
    places: NDArray[np.int64]
    shares: NDArray[np.float32]


class EntryMasks(NamedTuple):
    """The masks' weights of entries, from three lines each.

    Args:
        lines: see `MaskLines`.
        places: (entries, masks, 3) int64, where the line above, the nearest line and the line below begin.
        shares: (entries, masks, 3) float32, weight of each line.
    """

    lines: NDArray[np.float32]
    places: NDArray[np.int64]
    shares: NDArray[np.float32]


class ManyLines(NamedTuple):
    """Several textures of equal size for one mask, sampled for one column of view taps.

    Args:
        lines: (textures, padded with zeros to a multiple of four; lines; pixels or values of a row of samples)
            float32.
        taps: int64, rows of taps in groups; taps of a group use neighbouring lines. Group n ends before
            ``ends[n + 1]``.
        ends: (groups + 1,) int64.
        begin: (rows of taps,) int64, the line of row 0 of the mask, even if this row is not stored.
        rows: number of rows of the mask.
        row: (rows of taps,), mask row of sample row 0.
        row_step: mask rows from one row of samples to the next.
        repeat: 3 if a weight applies to three channels, else 1.
    """

    lines: NDArray[np.float32]
    taps: NDArray[np.int64]
    ends: NDArray[np.int64]
    begin: NDArray[np.int64]
    rows: int
    row: Array
    row_step: float
    repeat: int


# --- backward ---


class Spread(NamedTuple):
    """The rows of the raster that a row of samples falls on: ``shares`` of the rows from ``first`` on; or columns.

    Args:
        first: (taps, samples) int64.
        shares: (taps, samples, width) float32; some are zero, always those beyond the raster.
    """

    first: NDArray[np.int64]
    shares: NDArray[np.float32]


class Readers(NamedTuple):
    """The view taps of one column, sorted by the view that they read.

    Args:
        taps: int64, rows of taps with a weight; those that read the n-th view end before ``ends[n + 1]``.
        ends: (views + 1,) int64.
        begin: (views,) int64, where the samples of a view begin.
        weights: (rows of taps,) float32.
        columns: columns of samples in a view.
        channels: values per sample.
    """

    taps: NDArray[np.int64]
    ends: NDArray[np.int64]
    begin: NDArray[np.int64]
    weights: NDArray[np.float32]
    columns: int
    channels: int


# --- sheared rows and columns ---


class View(NamedTuple):
    """One view tap.

    Args:
        samples: (t, s, channels) float32, subdivided if required.
        weight: of the tap.
        x: raster column of sample (0, 0) before subdivision.
        y: raster row.
        masks: (masks, 2), mask column and row of that sample.
    """

    samples: NDArray[np.float32]
    weight: float
    x: float
    y: float
    masks: Array


class Grid(NamedTuple):
    """How samples lie on a sheared raster.

    Args:
        step: 2×2, raster (column, row) from one sample to the next along (k, l).
        shear: raster columns from one raster row to the next.
        row_step: raster rows from one row of samples to the next.
        column_step: raster columns from one column to the next, along a row of the raster.
        refine: finer samples per sample along each axis.
        first_k: index of the first column of finer samples.
        first_l: of the first row.
    """

    step: Array
    shear: float
    row_step: float
    column_step: float
    refine: int
    first_k: float
    first_l: float


class Footprint(NamedTuple):
    """The footprint of a sample along one axis.

    Args:
        interpolation: 0 nearest, 1 linear, 2 cubic, 3 spline, 4 box.
        reach: half-width of the footprint, in samples.
        opening: size of the sensitive part of a pixel, in pixels.
    """

    interpolation: int
    reach: float
    opening: float


class Textures(NamedTuple):
    """The textures of masks.

    Args:
        values: (masks, rows, columns) float32; each mask fills a part of its rows and columns.
        size: (masks, 2) int64, rows and columns of each mask.
        step: (masks, 2, 2), mask (column, row) from one sample to the next along (k, l).
    """

    values: NDArray[np.float32]
    size: NDArray[np.int64]
    step: Array


# --- the finished image ---


class Finish(NamedTuple):
    """How rows of the raster become rows of the image.

    Args:
        down: (odd,) float32, filter along columns.
        across: (odd,) float32, filter along rows.
        channels: values per pixel.
        guard: raster pixels around the image.
        transmission: (rows, columns) of the image, or empty.
    """

    down: NDArray[np.float32]
    across: NDArray[np.float32]
    channels: int
    guard: int
    transmission: NDArray[Any]


# --- backward, to a plan's parameters ---


class Reached(NamedTuple):
    """The rows of the raster that a row of samples reaches, from ``first`` on, with shares of each kind.

    Args:
        first: (rows of taps, rows of samples) int64.
        counts: (rows of taps, rows of samples) int64, number of rows.
        shares: (rows of taps, rows of samples, kinds, width), zero if there is none; the width is a multiple of
            four.
        plain: float32, the shares of the first kind.
        indices: (rows of samples,), index of each row; fractions if samples are subdivided.
        parts: (parts, rows of taps, 2) int64, the rows of samples (start, stop) whose first raster row lies in
            each part of the raster.
    """

    first: NDArray[np.int64]
    counts: NDArray[np.int64]
    shares: Array
    plain: NDArray[np.float32]
    indices: Array
    parts: NDArray[np.int64]


class Pairs(NamedTuple):
    """The kind of row share and the kind of column share of each sum over the samples.

    Args:
        row: int64, the kind in `Reached`.
        column: int64, the kind in `Gathered`, ascending.
        total: int64, index of the sum to which each pair adds.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    total: NDArray[np.int64]


class Gathered(NamedTuple):
    """The columns of the raster from which a column of samples gathers its weight, by kind of share.

    Args:
        first: (columns of samples,) int64.
        shares: (kinds, columns of samples, width) float32.
    """

    first: NDArray[np.int64]
    shares: NDArray[np.float32]


class Span(NamedTuple):
    """Columns of samples that a thread works on: ``start`` to ``stop`` (exclusive), a multiple of ``LANES``.

    Args:
        start: the first column.
        stop: after the last column.
        fresh: the first column that is not in an earlier span.
        to: where these columns begin in the lines of `Sought.lines`.
        indices: float32, of all columns of samples.
    """

    start: int
    stop: int
    fresh: int
    to: int
    indices: NDArray[np.float32]


class Sought(NamedTuple):
    """The requested gradients of masks, and the buffers for them.

    Args:
        lines: like `MaskLines.lines`, but for the columns of all spans: gradients of the lines are added here.
        slopes: like `MaskLines.lines`: the derivative of each weight along the mask's columns.
        texture: (masks,) whether gradients of lines are requested.
        place: (masks,) whether gradients of places are requested.
        places: (taps, masks, 6) sums for the gradients of places: of the slope along columns, times k, times l,
            and the same for the slope along rows.
    """

    lines: NDArray[np.float32]
    slopes: NDArray[np.float32]
    texture: NDArray[np.bool_]
    place: NDArray[np.bool_]
    places: Array
