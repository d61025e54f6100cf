"""Several rasters of one light field in one pass over the samples, for cameras that differ in one mask only.

Coded apertures at the views differ in the weights of view taps: the rows of each view are summed once, and each
set of weights mixes the sums of a column of views. Masks in mid-path differ in their textures: the samples that
reach a row of the raster through the same line of a texture are summed once, and each texture weighs the sum.
See `many_kernels`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.engines import footprint_tables as tables
from vcc.engines import many_kernels
from vcc.engines import numba_kernels as kernels
from vcc.engines.footprint_columns import ByColumns, bands
from vcc.engines.footprint_samples import FineGrid, MaskColumns, MaskPiece, blocks
from vcc.engines.vector_sums import EIGHT, SHORTEST
from vcc.engines.vector_weights import MASKS
from vcc.plan.footprints.model import Footprints

IN_CACHE = 32
"""Approximate number of image rows for which all views of a column stay in the second-level cache."""
FEWEST = 2
"""Least number of rasters for which one pass pays."""


def differing_mask(cores: Sequence[Footprints]) -> int | None:
    """The difference between rasters that one pass can compute: −1 for weights of views, n for the texture of
    mask n.

    None if one pass cannot compute them: rows and columns are not separable, samples are subdivided, or the
    cores differ in anything else.
    """
    first = cores[0]
    if len(cores) < FEWEST or not first.separable or first.refine > 1:
        return None
    if all(replace(core, weights=first.weights) == first for core in cores[1:]):
        return -1
    for n in range(len(first.masks)):
        if all(_with_texture_of(core, first, n) == first for core in cores[1:]):
            return n
    return None


def _with_texture_of(core: Footprints, other: Footprints, n: int) -> Footprints:
    """A core with the texture of another core's mask n, if the sizes are equal; else the core itself."""
    if len(core.masks) != len(other.masks) or core.masks[n].texture.shape != other.masks[n].texture.shape:
        return core
    mask = replace(core.masks[n], texture=other.masks[n].texture)
    return replace(core, masks=(*core.masks[:n], mask, *core.masks[n + 1 :]))


def rasters(
    cores: Sequence[Footprints], values: NDArray[Any], threads: int, progress: Progress | None = None
) -> list[NDArray[np.float32]] | None:
    """The raster (rows, columns, channels) of each core; None if one pass cannot compute them.

    Args:
        cores: the footprints; see `differing_mask`.
        values: the samples, (v, u, t, s[, channels]).
        threads: number of threads; the bytes do not depend on it.
        progress: called with (done, total).
    """
    differing = differing_mask(cores)
    if differing is None:
        return None
    channels = values.shape[4] if values.ndim == 5 else 1
    with Workers(threads) as pool:
        made: _Many = (
            _OfWeights(cores, channels, pool) if differing < 0 else _OfTextures(cores, differing, channels, pool)
        )
        return made.rasters(values, progress)


def rasters_by_turns(cores: Sequence[Footprints], values: NDArray[Any]) -> list[NDArray[np.float32]] | None:
    """The raster (rows, columns, channels) of each core, on this thread, with the same bytes as `run`.

    All cores process a band of samples, interleaved, while the samples are in the cache.

    Args:
        cores: the footprints.
        values: the samples, (v, u, t, s[, channels]).

    Returns:
        None if rows and columns are not separable, samples are subdivided, or the cores read different views.
    """
    first, channels = cores[0], values.shape[4] if values.ndim == 5 else 1
    for core in cores:
        same = np.array_equal(core.view_rows, first.view_rows) and np.array_equal(
            core.view_columns, first.view_columns
        )
        if not (same and core.separable and core.refine == 1):
            return None
    pitch = max(first.samples[1], -(-SHORTEST // channels)) * channels
    with Workers(1) as pool:
        made = [ByColumns(core, channels, pool) for core in cores]
        shape = [(-(-core.raster_shape[0] // EIGHT), core.raster_shape[1] * channels, EIGHT) for core in cores]
        tiles = [np.zeros(each, dtype=np.float32) for each in shape]
        turns = [bands(core.raster_shape[0], IN_CACHE) for core in cores]
        for samples, taken in blocks(first, values, True):
            masks = [each.masks.at(taken[0], pitch) for each in made]
            for n in range(max(map(len, turns))):
                for one, own, met, out in zip(made, turns, masks, tiles, strict=True):
                    if n < len(own):
                        one.add(samples, taken, None, met, out, own[n])
        found = [one.untiled(out) for one, out in zip(made, tiles, strict=True)]
    return [raster.reshape(*core.raster_shape, channels) for raster, core in zip(found, cores, strict=True)]


class _Many:
    """Several rasters: the loop over columns of views and bands.

    Args:
        core: the common part; its weights are 0 for taps that no raster uses.
        count: number of rasters.
        channels: values per sample.
        pool: the threads.
    """

    def __init__(self, core: Footprints, count: int, channels: int, pool: Workers) -> None:
        self.core, self.count, self.channels, self.pool = core, count, channels, pool
        self.columns = ByColumns(core, channels, pool)

    def rasters(self, values: NDArray[Any], progress: Progress | None) -> list[NDArray[np.float32]]:
        """The rasters, (rows, columns, channels) each."""
        (rows, columns), done = self.core.raster_shape, 0
        tiles = np.zeros((self.count, -(-rows // EIGHT), columns * self.channels, EIGHT), dtype=np.float32)
        pitch = max(self.core.samples[1], -(-SHORTEST // self.channels)) * self.channels
        for samples, (a, _) in blocks(self.core, values, True):
            used = int(np.count_nonzero(self.core.weights[:, a]))
            if used == 0:
                continue
            add = partial(self.adder(a, pitch), samples, a)
            list(self.pool.map(lambda band, add=add: add(band, tiles), bands(rows)))
            done += used
            tell(progress, done, self.core.taps_used)
        return [self.columns.untiled(each).reshape(rows, columns, self.channels) for each in tiles]

    def adder(self, a: int, pitch: int) -> Any:
        """A function of samples, column, band and tiles that adds column ``a`` of view taps."""
        raise NotImplementedError


class _OfWeights(_Many):
    """Rasters with different weights of views."""

    def __init__(self, cores: Sequence[Footprints], channels: int, pool: Workers) -> None:
        several = np.stack([core.weights * core.scale for core in cores]).astype(np.float32)
        any_light = (several != 0).any(axis=0).astype(np.float64)
        super().__init__(replace(cores[0], weights=any_light), len(cores), channels, pool)
        self.several = np.pad(several, [(0, -len(cores) % MASKS), (0, 0), (0, 0)])

    def adder(self, a: int, pitch: int) -> Any:
        """See `_Many`."""
        weights = np.ascontiguousarray(self.several[:, :, a])
        masks = self.columns.masks.at(a, pitch)

        def add(samples: tables.Samples, a: int, band: tables.Band, tiles: NDArray[np.float32]) -> None:
            many_kernels.add_column_of_views(samples, a, self.columns.footprints, weights, masks, band, tiles)

        return add


class _OfTextures(_Many):
    """Rasters with different textures of one mask."""

    def __init__(self, cores: Sequence[Footprints], number: int, channels: int, pool: Workers) -> None:
        first = cores[0]
        others = tuple(mask for n, mask in enumerate(first.masks) if n != number)
        super().__init__(replace(first, masks=others), len(cores), channels, pool)
        shared, repeated = (3, 1) if channels == 3 else (1, channels)
        self.repeated = repeated
        met = replace(first, masks=(first.masks[number],))
        self.met = MaskColumns(met, FineGrid(met), repeated, shared, pool)
        self.textures = [core.masks[number].texture.astype(np.float32, copy=False) for core in cores]
        self.lines = np.zeros((0, 0, 0), dtype=np.float32)

    def adder(self, a: int, pitch: int) -> Any:
        """See `_Many`."""
        masks = self.columns.masks.at(a, pitch)
        many = self.lines_at(a, pitch)

        def add(samples: tables.Samples, a: int, band: tables.Band, tiles: NDArray[np.float32]) -> None:
            many_kernels.add_column_of_textures(samples, a, self.columns.footprints, many, masks, band, tiles)

        return add

    def lines_at(self, a: int, pitch: int) -> tables.ManyLines:
        """Lines of all textures, sampled for column ``a``."""
        one = self.met.at(a, pitch)
        assert one is not None
        if self.lines.shape[1:] != one.lines.shape:
            self.lines = np.zeros((self.count + -self.count % MASKS, *one.lines.shape), dtype=np.float32)

        def sample(task: tuple[int, MaskPiece]) -> None:
            n, piece = task
            out = self.lines[n, piece.to : piece.to + piece.stop - piece.start]
            texture = self.textures[n][piece.start : piece.stop]
            kernels.sample_mask_columns(texture, piece.columns, self.repeated, out)

        list(self.pool.map(sample, [(n, piece) for n in range(self.count) for piece in self.met.pieces]))
        used, begin = np.flatnonzero(self.core.weights[:, a]), one.begin[0]
        taps = used[np.argsort(begin[used], kind="stable")]
        _, starts = np.unique(begin[taps], return_index=True)
        ends = np.append(starts, len(taps))
        return tables.ManyLines(
            self.lines, taps, ends, begin, int(one.rows[0]), one.row[0], float(one.row_step[0]), one.repeat
        )
