"""The backward pass of footprints on the GPU: from the weights of a raster to samples, mask textures and view
weights.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.engines import cuda_back_kernels as kernels
from vcc.engines.cuda_arrays import brought, cuda, given_back, is_on_gpu, launch, to_device, zeros
from vcc.engines.cuda_footprint_kernels import Source
from vcc.engines.cuda_footprints import ROOM, Piece, Pieces, divided
from vcc.engines.cuda_tables import Tables, mask_rows, tables_of
from vcc.engines.footprint_axes import Axis, axes
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.shares import Taps

PARTS = 8
"""Number of groups of rows of view taps whose sums for a mask's texture are computed in parallel: small textures
have too few points to keep a GPU busy."""

Array = NDArray[np.float64]


def samples_back(
    core: Footprints, values: Any, raster: NDArray[np.floating], progress: Progress | None = None
) -> Any:
    """The derivative of ⟨raster, raster of the samples⟩ to the samples, float32, in their library.

    Args:
        core: the footprints.
        values: samples; only their shape is used.
        raster: weights of the raster's values, (rows, columns, channels).
        progress: called with (done, total) in view taps.
    """
    is_on_gpu(values)  # raises an error for unsupported arrays
    return given_back(samples_back_on_gpu(core, tuple(values.shape), raster, progress), values)


def samples_back_on_gpu(
    core: Footprints, shape: tuple[int, ...], raster: Any, progress: Progress | None = None
) -> Any:
    """As `samples_back`, on the GPU, from the shape of the samples; weights may be on the GPU, too, float32."""
    tables, channels = tables_of(core), raster.shape[2]
    back = _Back(tables, raster)
    gradient = zeros(shape)
    order = np.argsort(core.view_columns, kind="stable")
    views, begins = np.unique(core.view_columns[order], return_index=True)
    ends = np.append(begins, len(order))
    line = 4 * tables.fine.columns * channels
    each = (core.raster_shape[0] + (shape[0] * tables.fine.rows if tables.divided else 0)) * line
    at_once = max(ROOM // max(each * int(np.diff(ends).max(initial=1)), 1), 1)
    done = 0
    with tables.lock:
        for first in range(0, len(views), at_once):
            tell(progress, done, core.taps_used)
            some = slice(first, min(first + at_once, len(views)))
            columns = order[begins[some][0] : ends[some.stop]]
            back.add(columns, ends[first : some.stop + 1] - begins[first], views[some], shape, gradient)
            done += int(np.count_nonzero(core.weights[:, columns]))
    tell(progress, core.taps_used, core.taps_used)
    return gradient


def check_known(core: Footprints, wanted: Collection[str]) -> None:
    """Raise an error for parameters to which this engine has no derivative.

    Raises:
        InputError: a parameter other than mask textures, weights of views and the scale.
    """
    core.check_wanted(wanted)
    for name in wanted:
        if name not in ("weights", "scale") and not name.endswith(".texture"):
            raise InputError(
                "engine 'cuda' has derivatives to textures of masks, weights and scale of footprints, and none "
                f"to {name!r}: use engine='numba'"
            )


def footprint_gradients(
    core: Footprints,
    values: Any,
    raster: NDArray[np.floating],
    wanted: Collection[str],
    progress: Progress | None = None,
    threads: int = 1,
) -> dict[str, Array]:
    """The derivative of ⟨raster, raster of the samples⟩ to some of the core's parameters, float64.

    Args:
        core: the footprints.
        values: the samples, NumPy or on the GPU.
        raster: weights of the raster's values, (rows, columns, channels).
        wanted: names of mask textures, ``weights`` and ``scale``.
        progress: called with (done, total) in view taps.
        threads: number of threads that fill pieces of samples in main memory.
    """
    tables = tables_of(core)
    back = _Back(tables, raster)
    masks = [n for n in range(len(core.masks)) if f"masks[{n}].texture" in wanted]
    of_taps = np.zeros(core.weights.shape) if {"weights", "scale"} & set(wanted) else None
    textures = {n: zeros((PARTS, *core.masks[n].texture.shape)) for n in masks}
    line = tables.fine.rows * tables.fine.columns
    opened, more = of_taps is not None, 4 * len(core.view_rows) * line
    with tables.lock, Pieces(tables, values, more, opened, threads) as pieces:
        for done, piece in enumerate(pieces):
            tell(progress, done, len(core.view_columns))
            source = back.source(piece, of_taps is not None)
            if of_taps is not None:
                of_taps[:, piece.start : piece.stop] = back.tap_sums(piece, back.agreeing(piece, source, -1))
            for n, texture in textures.items():
                given = tables.weights, tables.places, tables.grid, tables.textures.step, n, piece.start, texture
                products = back.agreeing(piece, source, n)
                launch(kernels.texture_back, texture.shape[::-1], piece.stream, products, *given)
    tell(progress, 1, 1)
    found = {f"masks[{n}].texture": core.scale * _summed(texture) for n, texture in textures.items()}
    if of_taps is not None:
        found |= {"weights": core.scale * of_taps, "scale": np.asarray((core.weights * of_taps).sum())}
    return {name: found[name] for name in wanted}


class _Back:
    """A raster's weights on the GPU, and gradients from them.

    Args:
        tables: of the footprints.
        raster: weights, (rows, columns, channels), NumPy, or float32 on the GPU.
    """

    def __init__(self, tables: Tables, raster: Any) -> None:
        self.tables, self.core, self.fine = tables, tables.core, tables.fine
        self.channels = raster.shape[2]
        self.raster = to_device(raster.astype(np.float32)) if isinstance(raster, np.ndarray) else raster
        self.scale = np.float32(self.core.scale)
        self.n = self.fine.columns * self.channels
        """Values in a row of finer samples."""

    # --- to samples ---

    def add(
        self,
        columns: NDArray[np.intp],
        ends: NDArray[np.intp],
        views: NDArray[np.int64],
        shape: tuple[int, ...],
        gradient: Any,
    ) -> None:
        """Add the gradients of the samples in some columns of views.

        Args:
            columns: of view taps, sorted by the column of views that they read.
            ends: where the taps of each column of views end, preceded by 0.
            views: the columns of views.
            shape: of the samples.
            gradient: of the samples, on the GPU.
        """
        tables, fine, channels = self.tables, self.fine, self.channels
        nv, nu, nt, ns = shape[:4]
        view, finer_view = nt * ns * channels, fine.rows * self.n

        def placed() -> tuple[Any, ...]:
            rows = np.argsort(self.core.view_rows, kind="stable")
            row_ends = np.searchsorted(self.core.view_rows[rows], np.arange(nv + 1))
            each = np.arange(nv), np.arange(len(views))
            to_finer = each[0] * finer_view, each[1] * nv * finer_view
            return tuple(
                map(to_device, (rows, row_ends, columns, ends, each[0] * nu * view, views * view, *to_finer))
            )

        *taps, begin, further, finer_begin, finer_further = tables.once(
            ("readers", shape, tuple(views.tolist())), placed
        )
        readers, flat = kernels.Readers(*taps), gradient.reshape(math.prod(shape))
        into = target = kernels.Target(flat, begin, further, ns * channels)
        if tables.divided is not None:
            finer = tables.buffer("divided", (len(views), nv, fine.rows, self.n))
            into = kernels.Target(finer.reshape(math.prod(finer.shape)), finer_begin, finer_further, self.n)
        places = fine.columns, fine.rows, nv * len(views)
        if tables.along is None:
            masks = tables.places, tables.grid, tables.footprint, tables.textures
            given = self.raster, tables.weights, self.scale, *masks, fine.rows, readers, into
            launch(kernels.sheared_back(channels), places, 0, *given)
        else:
            masks_rows = mask_rows(tables, tuple(map(int, columns)), 0)
            mixed = self._mixed(readers.columns, 0)
            given_rows = mixed, tables.weights, self.scale, *self._spread[0], masks_rows, readers, into
            each, width = channels if self.core.masks else 1, self._spread[0][1].shape[2]
            kernel = kernels.rows_back(each, bool(self.core.masks), width)
            launch(kernel, (self.n // each, fine.rows, nv * len(views)), 0, *given_rows)
        if tables.divided is not None:
            given_back_to = finer, *self._undivided, channels, target
            launch(kernels.give_back, (ns * channels, nt, nv * len(views)), 0, *given_back_to)

    def _mixed(self, columns: Any, stream: Any) -> Any:
        """See `kernels.mix_back`; columns: of view taps, on the GPU."""
        rows, wide = self.core.raster_shape
        mixed = self.tables.buffer("mixed", (columns.shape[0], rows, self.n))
        flat = self.raster.reshape(rows, wide * self.channels)
        kernel = kernels.mix_back(self._spread[1][1].shape[2])
        launch(kernel, mixed.shape[::-1], stream, flat, columns, *self._spread[1], self.channels, mixed)
        return mixed

    @property
    def _spread(self) -> tuple[Any, Any]:
        """(first, shares) of the rows of the raster that a row of samples falls on; the same for columns."""
        return self.tables.once("spread", lambda: tuple(map(_on_pixels, axes(self.core, self.fine))))  # type: ignore[no-any-return]

    @property
    def _undivided(self) -> tuple[Any, Any]:
        """(first, shares) of the finer rows made from a row of samples; the same for columns."""

        def made() -> Any:
            assert self.fine.divided_as is not None
            turned = [
                Taps(part.first, part.shares).by_sample(n)
                for part, n in zip(self.fine.divided_as, self.core.samples, strict=True)
            ]
            return tuple((to_device(one.first), to_device(one.weights)) for one in turned)

        return self.tables.once("undivided", made)  # type: ignore[no-any-return]

    # --- to parameters ---

    def source(self, piece: Piece, opened: bool) -> Source:
        """The samples of a piece, subdivided if required; opened: also those of taps with a weight of zero."""
        if self.tables.divided is None:
            return piece.source
        used = to_device(np.ones(self.core.weights.shape, np.float32)) if opened else self.tables.weights
        return divided(self.tables, piece, self.channels, used)

    def agreeing(self, piece: Piece, source: Source, left_out: int) -> Any:
        """Products of samples with the raster's weights, through all masks but one, in a buffer of the tables."""
        tables, fine = self.tables, self.fine
        columns = piece.stop - piece.start
        products = tables.buffer("products", (columns, len(self.core.view_rows), fine.rows, fine.columns))
        places = fine.columns, fine.rows, columns * len(self.core.view_rows)
        if tables.along is None:
            given = source, self.raster, tables.places, tables.grid, tables.footprint, tables.textures
            launch(
                kernels.met_sheared(self.channels), places, piece.stream, *given, left_out, piece.start, products
            )
            return products
        here = tables.once(
            ("columns", piece.start, piece.stop), lambda: to_device(np.arange(piece.start, piece.stop))
        )
        mixed = self._mixed(here, piece.stream)
        along = source, mixed, *self._spread[0], tables.places, tables.grid, tables.textures
        launch(kernels.met_in_rows(self.channels), places, piece.stream, *along, left_out, piece.start, products)
        return products

    def tap_sums(self, piece: Piece, products: Any) -> Array:
        """Sums over the samples of each view tap of a piece, (rows of taps, columns of taps)."""
        lines = cuda.device_array(products.shape[:3], np.float64)
        launch(
            kernels.sum_lines,
            (products.shape[2], products.shape[0] * products.shape[1]),
            piece.stream,
            products,
            lines,
        )
        return np.asarray(brought(lines, piece.stream).sum(axis=2).T)


def _on_pixels(axis: Axis) -> tuple[Any, Any]:
    first, _, shares = axis.table()
    return to_device(first), to_device(shares[:, :, 0].astype(np.float32))


def _summed(parts: Any) -> Array:
    return np.asarray(brought(parts).sum(axis=0, dtype=np.float64))
