"""The transpose of the fast engine's sum by footprints: weights of a raster to samples, in compiled gather loops.

    L̄(q) = scale · w(view) · Π T(m(q)) · Σ_y F(y; y(q)) Σ_x F(x; x(q)) G(x, y)

For each column of view taps, the raster's weights G are mixed across once, into the columns of the samples. A
row of samples is then a sum of the few mixed rows on which it falls. It is computed in place and written once,
band by band, so that the mixed rows stay in the second-level cache. Every sum has a fixed order: the bytes do
not depend on the number of threads.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.engines import footprint_back_kernels as kernels
from vcc.engines import footprint_tables as tables
from vcc.engines.footprint_axes import Axis, axes
from vcc.engines.footprint_columns import bands, in_tiles
from vcc.engines.footprint_samples import FineGrid, MaskColumns, no_masks, on_raster, textures, view_of
from vcc.engines.vector_sums import aligned_buffer
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.shares import Taps

BAND_BYTES = 2**19
"""Size of the mixed rows for the rows of samples of one band: they stay in the second-level cache."""
LEAST, MOST = 32, 256
"""Limits of the rows of samples in a band: fewer are subdivided too often, more leave threads without work."""
TASKS = 3
"""Least number of tasks per thread, if there is enough work."""

Weights = NDArray[np.float32]


def samples_back(
    core: Footprints,
    shape: tuple[int, ...],
    raster: NDArray[np.floating],
    threads: int,
    progress: Progress | None = None,
) -> Weights:
    """The derivative of ⟨raster, raster of the samples⟩ to the samples.

    Args:
        core: the footprints.
        shape: of the samples, (v, u, t, s[, channels]).
        raster: weights of the raster's values, (rows, columns, channels).
        threads: number of threads.
        progress: called with (done, total).

    Returns:
        Float32 of this shape; zero for views that no tap reads.
    """
    # np.zeros costs no more than np.empty for new memory.
    gradient = np.zeros(shape, dtype=np.float32)
    weights = np.ascontiguousarray(raster, dtype=np.float32)
    with Workers(threads) as pool:
        back = _ByColumns if core.separable else _Sheared
        back(core, gradient, weights, pool, threads).run(progress)
    return gradient


class _Back:
    """Common parts of both cases: the samples' gradient, their subdivision, and bands of their rows."""

    def __init__(self, core: Footprints, gradient: Weights, raster: Weights, pool: Workers, threads: int) -> None:
        self.core, self.gradient, self.raster, self.pool, self.threads = core, gradient, raster, pool, threads
        self.channels = raster.shape[2]
        self.fine = fine = FineGrid(core)
        self.n = fine.columns * self.channels
        """Values in a row of finer samples."""
        self.divided, self.across = _division(fine, self.n)

        self.height = int(np.clip(BAND_BYTES // (4 * self.n), LEAST, MOST))
        """Rows of samples in a band."""

    def pieces(self, rows: int, parts: int = 1) -> list[tables.Band]:
        """Divide rows into bands: enough of them for all threads, given the number of parts."""
        count = -(-TASKS * self.threads // parts)
        return bands(rows, -(-rows // count))


class _ByColumns(_Back):
    """Separable rows and columns: one column of view taps at a time."""

    def run(self, progress: Progress | None) -> None:
        """Fill the gradient."""
        core, fine = self.core, self.fine
        self.down, self.sideways = (_spread(axis) for axis in axes(core, fine))
        self.tiles = in_tiles(self.raster, self.sideways.shares.shape[2], self.pool)
        self.mixed = aligned_buffer(core.raster_shape[0], self.n)
        self.masks = MaskColumns(core, fine, 1, 1, self.pool)
        self.weights = (core.weights * core.scale).astype(np.float32)
        done = 0
        for a in map(int, np.flatnonzero((core.weights != 0).any(axis=0))):
            tell(progress, done, core.taps_used)
            self.column(a)
            done += int(np.count_nonzero(core.weights[:, a]))
        tell(progress, core.taps_used, core.taps_used)

    def column(self, a: int) -> None:
        """Add the gradients of a column of view taps."""
        mix = partial(kernels.mix_back, self.tiles, self.sideways, a, self.channels)
        list(self.pool.map(lambda band: mix(band, self.mixed), self.pieces(len(self.tiles))))
        masks = self.masks.at(a, self.fine.columns) or no_masks()
        flat = self.gradient.reshape(-1)

        def add(piece: tuple[tables.Readers, tables.Band]) -> None:
            readers, rows = piece
            fine = self.divided, self.across
            kernels.add_rows_back(self.mixed, readers, self.down, masks, *fine, rows, self.height, flat)

        # Whole views if there are enough: two threads that write to one new page of memory both clear it.
        parts = self.readers(a)
        pieces = self.pieces(self.core.samples[0], len(parts))
        list(self.pool.map(add, [(readers, band) for readers in parts for band in pieces]))

    def readers(self, a: int) -> list[tables.Readers]:
        """The taps of a column, sorted by the views that they read, in parts."""
        core = self.core
        used = np.flatnonzero(core.weights[:, a])
        views, which = np.unique(core.view_rows[used], return_inverse=True)
        view = math.prod(self.gradient.shape[2:])
        begin = (views * self.gradient.shape[1] + core.view_columns[a]) * view
        in_order = np.argsort(which, kind="stable")
        sizes = core.samples[1], self.channels
        found = []
        for some in np.array_split(np.arange(len(views)), min(TASKS * self.threads, len(views))):
            chosen = in_order[(which[in_order] >= some[0]) & (which[in_order] <= some[-1])]
            ends = np.searchsorted(which[chosen], np.arange(some[0], some[-1] + 2))
            found.append(tables.Readers(used[chosen], ends, begin[some], self.weights[:, a].copy(), *sizes))
        return found


class _Sheared(_Back):
    """Sheared rows and columns: one view tap at a time."""

    def run(self, progress: Progress | None) -> None:
        """Fill the gradient."""
        core, fine = self.core, self.fine
        grid, footprint = on_raster(core, fine)
        masks = textures(core)
        mixed = np.empty((len(self.raster), fine.columns, self.channels), dtype=np.float32)
        lines = self.pieces(len(self.raster))
        pieces = bands(core.samples[0], min(self.height, -(-core.samples[0] // (TASKS * self.threads))))
        nothing = np.zeros((1, 1, 1), dtype=np.float32)
        for done, (b, a) in enumerate(zip(*np.nonzero(core.weights), strict=True)):
            tell(progress, done, core.taps_used)
            view = view_of(core, b, a, nothing, core.weights)
            mix = partial(kernels.mix_sheared_back, self.raster, view, grid, footprint, fine.columns)
            list(self.pool.map(lambda band, mix=mix: mix(band, mixed), lines))
            flat = self.gradient[core.view_rows[b], core.view_columns[a]].reshape(-1)
            add = partial(kernels.add_sheared_back, mixed, view, grid, footprint, masks, self.divided, self.across)
            list(self.pool.map(lambda band, add=add, to=flat: add(band, to), pieces))
        tell(progress, core.taps_used, core.taps_used)


def _spread(axis: Axis) -> tables.Spread:
    """The pixels that each sample falls on, along an axis."""
    first, _, shares = axis.table()
    return tables.Spread(first, np.ascontiguousarray(shares[:, :, 0], dtype=np.float32))


def _division(fine: FineGrid, pitch: int) -> tuple[tables.FineSamples, tables.Spread]:
    """The subdivision of samples, and the finer columns of each sample; empty if samples are not subdivided."""
    if fine.divided_as is None:
        rows, nothing = np.arange(fine.rows), np.zeros((0, 1), dtype=np.float32)
        none = np.zeros(0, dtype=np.int64)
        whole = np.ones((fine.rows, 1), dtype=np.float32)
        return tables.FineSamples(rows, whole, none, nothing, pitch), tables.Spread(none, nothing)
    across = fine.divided_as[1]
    of_samples = Taps(across.first, across.shares).by_sample(fine.samples[1])
    return fine.tables(pitch), tables.Spread(of_samples.first, of_samples.weights)
