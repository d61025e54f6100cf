"""What the compiled loops of footprints are given: numbers and arrays under names, as Numba takes them.

`vcc.engines.numba_cpu` fills these from a plan, `vcc.engines.numba_kernels` reads them. All arrays are contiguous.
Where rows and columns of samples part, each tap of views has rows and columns of its own; else each view is taken
by itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pair = tuple[float, float]


class Band(NamedTuple):
    """Rows of the picture that a thread works on: from ``start`` to before ``stop``."""

    start: int
    stop: int


# --- where rows and columns part ---


class Samples(NamedTuple):
    """Samples that lie in memory row by row: row l of view tap (b, a) begins at begin[b] + further[a] + l · pitch.

    Args:
        values: flat.
        begin: (rows of taps,) int64.
        further: (columns of taps,) int64.
        pitch: values from one row of samples to the next.
        channels: values a sample.
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
        jump: from here to the samples of the next column.
    """

    values: NDArray[Any]
    begin: NDArray[np.int64]
    pitch: int
    jump: int


class Rows(NamedTuple):
    """Which rows of samples a row of the raster gathers: ``shares`` of those from ``first`` on.

    Args:
        first: (rows of taps, raster rows) int64.
        shares: (rows of taps, raster rows, width) float32.
        reach: the most rows of samples that four raster rows gather.
        advance: rows of samples that the next four raster rows need anew.
    """

    first: NDArray[np.int64]
    shares: NDArray[np.float32]
    reach: int
    advance: int


class Columns(NamedTuple):
    """Which columns of samples a column of the raster gathers, likewise.

    Args:
        first: (columns of taps, raster columns) int64.
        shares: (columns of taps, raster columns, width) float32.
    """

    first: NDArray[np.int64]
    shares: NDArray[np.float32]


class Footprints(NamedTuple):
    """How the samples of all view taps fall on the raster.

    Args:
        weights: (rows of taps, columns of taps) float32, 0 of taps that are not added.
        rows: see `Rows`.
        columns: see `Columns`.
    """

    weights: NDArray[np.float32]
    rows: Rows
    columns: Columns


class FineSamples(NamedTuple):
    """How samples are divided into finer ones, view by view.

    Args:
        first_row: (finer rows,) int64, the first row of samples that makes a finer one.
        row_shares: (finer rows, width) float32, of the rows from there on.
        first_column: (finer columns,), likewise.
        column_shares: (finer columns, width), likewise.
        pitch: values of a row of finer samples.
    """

    first_row: NDArray[np.int64]
    row_shares: NDArray[np.float32]
    first_column: NDArray[np.int64]
    column_shares: NDArray[np.float32]
    pitch: int


class MaskLines(NamedTuple):
    """Masks as the samples of one column of view taps meet them.

    Args:
        lines: (lines, pixels or values of a row of samples) float32, masks' weights at the columns of the samples.
        begin: (masks, taps) int64, the line of a mask's row 0, or where it would be.
        rows: (masks,) int64, how many a mask has.
        row: (masks, taps), mask row of sample row 0.
        row_step: (masks,), mask rows from one row of samples to the next.
        repeat: 3 where a weight counts for three channels, else 1.
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
        ends: (10,) int64, how many entries of ``order`` reach each of the ranges or one before it.
        places: (entries,) int64, where each entry's row of samples begins.
        shares: (entries, 4) float32, what each of the four rows takes of it.
    """

    order: NDArray[np.int64]
    ends: NDArray[np.int64]
    places: NDArray[np.int64]
    shares: NDArray[np.float32]


class EntryMasks(NamedTuple):
    """The masks' weights of entries, by three lines each.

    Args:
        lines: see `MaskLines`.
        places: (entries, masks, 3) int64, where in them the line above, the nearest and the one below begin.
        shares: (entries, masks, 3) float32, what each counts.
    """

    lines: NDArray[np.float32]
    places: NDArray[np.int64]
    shares: NDArray[np.float32]


class ManyLines(NamedTuple):
    """The textures of one mask, several of a size, as the samples of one column of view taps meet them.

    Args:
        lines: (textures, and some of zero to a multiple of four; lines; pixels or values of a row of samples)
            float32.
        taps: int64, rows of taps; those of a group look up lines side by side and end before ``ends[n + 1]``.
        ends: (groups + 1,) int64.
        begin: (rows of taps,) int64, the line of the mask's row 0, or where it would be.
        rows: how many the mask has.
        row: (rows of taps,), mask row of sample row 0.
        row_step: mask rows from one row of samples to the next.
        repeat: 3 where a weight counts for three channels, else 1.
    """

    lines: NDArray[np.float32]
    taps: NDArray[np.int64]
    ends: NDArray[np.int64]
    begin: NDArray[np.int64]
    rows: int
    row: Array
    row_step: float
    repeat: int


# --- and backwards ---


class Spread(NamedTuple):
    """Which rows of the raster a row of samples falls on: ``shares`` of those from ``first`` on; columns likewise.

    Args:
        first: (taps, samples) int64.
        shares: (taps, samples, width) float32, some of them zero, those beyond the raster always.
    """

    first: NDArray[np.int64]
    shares: NDArray[np.float32]


class Readers(NamedTuple):
    """The view taps of one column, sorted by the view that they read.

    Args:
        taps: int64, rows of taps that are added; those that read the n-th view end before ``ends[n + 1]``.
        ends: (views + 1,) int64.
        begin: (views,) int64, where the samples of a view begin.
        weights: (rows of taps,) float32.
        columns: of samples in a view.
        channels: values a sample.
    """

    taps: NDArray[np.int64]
    ends: NDArray[np.int64]
    begin: NDArray[np.int64]
    weights: NDArray[np.float32]
    columns: int
    channels: int


# --- where they do not ---


class View(NamedTuple):
    """One view tap.

    Args:
        samples: (t, s, channels) float32, divided if need be.
        weight: of the tap.
        x: raster column of sample (0, 0) before division.
        y: raster row.
        masks: (masks, 2), mask column and row of that sample.
    """

    samples: NDArray[np.float32]
    weight: float
    x: float
    y: float
    masks: Array


class Grid(NamedTuple):
    """How samples lie on the raster, sheared.

    Args:
        step: 2×2, raster (column, row) from one sample to the next along (k, l).
        shear: raster columns from one raster row to the next.
        row_step: raster rows from one row of samples to the next.
        column_step: raster columns from one column to the next, along a row of the raster.
        refine: finer samples for each one, each way.
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
    """What a sample's footprint is along an axis.

    Args:
        interpolation: 0 nearest, 1 linear, 2 cubic, 3 a spline, 4 a box.
        reach: samples to each side.
        opening: size of a pixel's sensitive part, in pixels.
    """

    interpolation: int
    reach: float
    opening: float


class Textures(NamedTuple):
    """The masks themselves.

    Args:
        values: (masks, rows, columns) float32, of which each mask fills a part.
        size: (masks, 2) int64, its rows and columns.
        step: (masks, 2, 2), mask (column, row) from one sample to the next along (k, l).
    """

    values: NDArray[np.float32]
    size: NDArray[np.int64]
    step: Array


# --- the finished picture ---


class Finish(NamedTuple):
    """How rows of the raster become rows of the picture.

    Args:
        down: (odd,) float32, filter along columns.
        across: (odd,) float32, along rows.
        channels: values a pixel.
        guard: raster pixels around the picture.
        transmission: (rows, columns) of the picture, or empty.
    """

    down: NDArray[np.float32]
    across: NDArray[np.float32]
    channels: int
    guard: int
    transmission: NDArray[Any]


# --- backwards, to a plan's numbers ---


class Reached(NamedTuple):
    """Which rows of the raster a row of samples reaches, from ``first`` on, and how much by each kind of share.

    Args:
        first: (rows of taps, rows of samples) int64.
        counts: (rows of taps, rows of samples) int64, how many rows.
        shares: (rows of taps, rows of samples, kinds, width), zero where there is none; the width a multiple of
            four.
        plain: float32, those of the first kind.
        indices: (rows of samples,), of each: fractions where samples are divided.
        parts: (parts, rows of taps, 2) int64, the rows of samples, from and to before, whose first row lies in
            each
            part of the raster.
    """

    first: NDArray[np.int64]
    counts: NDArray[np.int64]
    shares: Array
    plain: NDArray[np.float32]
    indices: Array
    parts: NDArray[np.int64]


class Pairs(NamedTuple):
    """Which share of rows and which of columns make up each sum over the samples.

    Args:
        row: int64, the kind in `Reached`.
        column: int64, the kind in `Gathered`, ascending.
        total: int64, to which sum each pair adds.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    total: NDArray[np.int64]


class Gathered(NamedTuple):
    """Which columns of the raster a column of samples gathers its weight from, by each kind of share.

    Args:
        first: (columns of samples,) int64.
        shares: (kinds, columns of samples, width) float32.
    """

    first: NDArray[np.int64]
    shares: NDArray[np.float32]


class Span(NamedTuple):
    """Columns of samples that a thread works on: from ``start`` to before ``stop``, a multiple of ``LANES``.

    Args:
        start: the first.
        stop: after the last.
        fresh: the first that no span before it has.
        to: where in lines of `Sought.lines` they begin.
        indices: float32, of all columns of samples.
    """

    start: int
    stop: int
    fresh: int
    to: int
    indices: NDArray[np.float32]


class Sought(NamedTuple):
    """What is wanted of masks, and where it goes.

    Args:
        lines: like those of `MaskLines`, but by the columns of all spans: to which is added what they say.
        slopes: like those of `MaskLines`, by how much they grow from a column of theirs to the next.
        texture: (masks,) whether lines are wanted.
        place: (masks,) whether places are.
        places: (taps, masks, 6) sums that places follow from: of the slope along columns, times k, times l, and
            the same of the slope along rows.
    """

    lines: NDArray[np.float32]
    slopes: NDArray[np.float32]
    texture: NDArray[np.bool_]
    place: NDArray[np.bool_]
    places: Array
