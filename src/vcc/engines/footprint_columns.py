"""Footprints with separable rows and columns, by columns of view taps: tables, and the loop over bands."""

from __future__ import annotations

import itertools
import math
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.progress import Progress
from vcc.base.workers import Workers
from vcc.engines import footprint_tables as tables
from vcc.engines import numba_kernels as kernels
from vcc.engines.footprint_samples import FineGrid, MaskColumns, blocks, taps_along
from vcc.engines.vector_sums import EIGHT, ROWS, SHORTEST, aligned_buffer
from vcc.plan.footprints.model import Footprints

BAND = 64
"""Largest number of image rows that a thread works on at once."""
BAND_BYTES = 3 * 2**17
"""Largest size of their sums, which stay in the second-level cache."""
AT_ONCE = 2**22
"""Samples up to which a thread adds several columns of views to a band: handing over small work takes longer."""


def bands(rows: int, height: int = BAND) -> list[tables.Band]:
    """Divide the rows of the image into bands of this height."""
    return [tables.Band(start, min(start + height, rows)) for start in range(0, rows, height)]


def band_height(line: int) -> int:
    """Rows of the image in a band, if one row of sums has ``line`` bytes: a multiple of eight."""
    return int(np.clip(BAND_BYTES // line, EIGHT, BAND)) // EIGHT * EIGHT


def in_tiles(raster: NDArray[np.floating], beyond: int, pool: Workers) -> NDArray[np.float32]:
    """A raster (rows, columns, channels) as tiles (rows / 8, values, 8), with columns of zeros beyond its last."""
    lines = np.ascontiguousarray(raster, dtype=np.float32).reshape(len(raster), -1)
    tiles = aligned_buffer(-(-len(lines) // EIGHT), lines.shape[1] + beyond * raster.shape[2], EIGHT)
    tiles[:] = 0
    list(pool.map(lambda tile: kernels.turned(lines, tile, tiles), range(len(tiles))))
    return tiles


class ByColumns:
    """Tables for plans with separable rows and columns, and the loop over columns of views and bands."""

    def __init__(self, core: Footprints, channels: int, pool: Workers) -> None:
        self.core, self.channels, self.pool = core, channels, pool
        self.fine = fine = FineGrid(core)
        down, across = taps_along(core, fine)
        row_step, column_step = core.row_step / core.refine, core.column_step / core.refine
        # Rows of samples that four rows of the raster sum, and rows that the next four need in addition.
        count, rows = down.first.shape
        ends = np.pad(down.first, [(0, 0), (0, -rows % ROWS)], mode="edge").reshape(count, -1, ROWS)
        reach = int(np.ptp(ends, axis=2).max(initial=0)) + down.weights.shape[2]
        advance = min(math.ceil(ROWS / abs(row_step)), reach) if core.refine == 1 else 0
        self.mirrored = column_step < 0
        if self.mirrored:
            across = across.mirrored()
        self.footprints = tables.Footprints(
            (core.weights * core.scale).astype(np.float32),
            tables.Rows(down.first, down.weights, reach, advance),
            tables.Columns(across.first, across.weights),
        )
        # A mask's weight applies to all channels of a sample: three channels share a looked-up value; for any
        # other number of channels the value is repeated.
        shared, repeated = (3, 1) if channels == 3 else (1, channels)
        self.masks = MaskColumns(core, fine, repeated, shared, pool)

    def raster(self, values: NDArray[Any], progress: Progress | None) -> NDArray[np.float32]:
        """The sum over all samples: the raster (rows, columns × channels)."""
        core, fine, done = self.core, self.fine, 0
        rows, columns = core.raster_shape
        tiles = np.zeros((-(-rows // EIGHT), columns * self.channels, EIGHT), dtype=np.float32)
        # Values in a row of samples: at least as many as kernels add at once.
        pitch = max(fine.columns, -(-SHORTEST // self.channels)) * self.channels
        divided = fine.tables(pitch) if core.refine > 1 else None
        pieces = blocks(core, values, bool(core.masks) or core.refine > 1 or progress is not None)
        several = max(AT_ONCE // (len(core.view_rows) * fine.rows * pitch), 1)

        def add(band: tables.Band) -> None:
            for one in adding:
                one(band)

        while taken := list(itertools.islice(pieces, several)):
            adding = []
            for samples, each in taken:
                used = int(np.count_nonzero(self.footprints.weights[:, slice(*each)]))
                if used:
                    masks = self.masks.at(each[0], pitch, again=several == 1)
                    adding.append(partial(self.add, samples, each, divided, masks, tiles))
                    done += used
            list(self.pool.map(add, bands(rows, band_height(4 * pitch))))
            if progress is not None and adding:
                progress(done, core.taps_used)
        return self.untiled(tiles)

    def untiled(self, tiles: NDArray[np.float32]) -> NDArray[np.float32]:
        """The raster (rows, columns × channels) from its tiles (rows / 8, columns · channels, 8)."""
        rows, columns = self.core.raster_shape
        raster = np.empty((rows, columns * self.channels), dtype=np.float32)

        def write(band: tables.Band) -> None:
            # The columns of a real image run against those of its samples: its raster is computed mirrored.
            kernels.raster_of(tiles, self.channels, self.mirrored, band, raster)

        list(self.pool.map(write, bands(rows)))
        return raster

    def add(
        self,
        samples: tables.Samples,
        columns: tuple[int, int],
        divided: tables.FineSamples | None,
        masks: tables.MaskLines | None,
        tiles: NDArray[np.float32],
        band: tables.Band,
    ) -> None:
        """Add columns of view taps to a band of raster rows."""
        if divided is None:
            kernels.add_columns(samples, columns, self.footprints, masks, band, tiles)
            return
        for a in range(*columns):
            kernels.add_divided_column(samples, a, self.footprints, divided, masks, band, tiles)
