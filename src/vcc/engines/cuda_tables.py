"""A plan of footprints as arrays on the GPU: tables that stay there while the plan is used."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.engines import cuda_footprint_kernels as kernels
from vcc.engines import footprint_tables as tables
from vcc.engines.cuda_arrays import LastUsed, cuda, launch, to_device
from vcc.engines.footprint_samples import FineGrid, on_raster, taps_along, textures
from vcc.plan.footprints.model import Footprints

AT_ONCE = 6
"""Largest number of rows of samples that a thread loads at a time, as a load takes some hundred instructions. If
samples are as large as pixels, four rows of the raster sum six rows of samples."""


@dataclass(frozen=True, eq=False, repr=False)
class Tables(Brief):
    """A plan on the GPU.

    Args:
        core: of the plan.
        fine: the subdivision of its samples.
        weights: (rows of taps, columns of taps) float32.
        divided: (first, shares) of rows and of columns of finer samples, or None.
        along: for separable rows and columns: `kernels.Quads` of rows with the number of rows loaded at a time,
            and (first, shares) of columns; else None.
        places: of samples on the raster and on masks.
        grid: positions of samples there.
        footprint: of a sample.
        textures: of the masks.
        kept: other data made for the plan, see `once`.
        lock: to hold while the buffers are in use.
    """

    core: Footprints
    fine: FineGrid
    weights: Any
    divided: tuple[Any, Any] | None
    along: tuple[tuple[kernels.Quads, int], tuple[Any, Any]] | None
    places: kernels.Places
    grid: tables.Grid
    footprint: tables.Footprint
    textures: tables.Textures
    kept: dict[Any, Any] = field(default_factory=dict)
    lock: Any = field(default_factory=Lock)

    def once(self, key: Any, make: Callable[[], Any]) -> Any:
        """The result of ``make``, which is called once per key."""
        if key not in self.kept:
            self.kept[key] = make()
        return self.kept[key]

    def buffer(self, name: str, shape: tuple[int, ...]) -> Any:
        """A buffer of float32 numbers, reused from run to run: allocating takes longer than many kernels."""
        size, known = math.prod(shape), self.kept.get(name)
        if known is None or known.size < size:
            known = self.kept[name] = cuda.device_array(size, np.float32)
        return known[:size].reshape(shape)

    def bytes_a_column(self, channels: int) -> int:
        """Bytes of GPU memory that a column of view taps needs besides its samples."""
        core, line = self.core, 4 * self.fine.columns * channels
        finer = len(core.view_rows) * self.fine.rows * line if self.divided else 0
        if self.along is None:
            return finer
        lines = sum(len(mask.texture) for mask in core.masks) * 4 * self.fine.columns
        return finer + core.raster_shape[0] * line + lines


def tables_of(core: Footprints) -> Tables:
    """The tables of a plan, from the cache on the GPU or made now."""
    return _last_used.of(core)  # type: ignore[no-any-return]


def _made(core: Footprints) -> Tables:
    fine = FineGrid(core)
    weights = to_device(core.weights.astype(np.float32))
    divided = None
    if fine.divided_as is not None:
        divided = tuple(
            (to_device(part.first), to_device(part.shares.astype(np.float32))) for part in fine.divided_as
        )
    grid, footprint = on_raster(core, fine)
    at = np.zeros((len(core.masks), *core.weights.shape, 2))
    for place, mask in zip(at, core.masks, strict=True):
        place[..., 0], place[..., 1] = mask.column, mask.row
    values, size, step = textures(core)
    return Tables(
        core,
        fine,
        weights,
        divided,  # type: ignore[arg-type]
        _along(core, fine) if core.separable else None,
        kernels.Places(to_device(core.x), to_device(core.y), to_device(at)),
        grid._replace(step=to_device(core.step)),
        footprint,
        tables.Textures(to_device(values), to_device(size), to_device(step)),
    )


_last_used = LastUsed(_made)


def _along(core: Footprints, fine: FineGrid) -> tuple[tuple[kernels.Quads, int], tuple[Any, Any]]:
    """The rows of samples that rows of the raster sum, in fours, and the same for columns one by one."""
    down, across = taps_along(core, fine)
    *quads, batch = _quads(down.first, down.weights)
    return (kernels.Quads(*map(to_device, quads)), batch), (
        to_device(across.first.astype(np.int32)),
        to_device(across.weights),
    )


def _quads(
    first: NDArray[np.int64], shares: NDArray[np.float32]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32], int]:
    """`kernels.Quads` of the rows of samples that rows of the raster sum, and the number of rows to load at a
    time.

    Args:
        first: see `vcc.plan.footprints.shares.Taps`, (taps, rows).
        shares: likewise, (taps, rows, width).
    """
    count, rows, width = shares.shape
    there = shares != 0
    lit = there.any(axis=2)
    low = np.where(lit, first + there.argmax(axis=2), np.iinfo(np.int32).max)
    high = np.where(lit, first + width - there[..., ::-1].argmax(axis=2), 0)
    more = -rows % kernels.ROWS
    fours = (count, -1, kernels.ROWS)
    top = np.pad(low, [(0, 0), (0, more)], constant_values=np.iinfo(np.int32).max).reshape(fours).min(axis=2)
    end = np.pad(high, [(0, 0), (0, more)]).reshape(fours).max(axis=2)
    number = np.maximum(end - top, 0)
    top = np.where(number > 0, top, 0)
    most = max(int(number.max(initial=0)), 1)
    batch = math.ceil(most / math.ceil(most / AT_ONCE))
    made = np.zeros((*top.shape, math.ceil(most / batch) * batch, kernels.ROWS), np.float32)
    tap, row, t = np.nonzero(there)
    quad = row // kernels.ROWS
    made[tap, quad, first[tap, row] + t - top[tap, quad], row % kernels.ROWS] = shares[tap, row, t]
    return top.astype(np.int32), number.astype(np.int32), made.reshape(-1), batch


def mask_rows(tables: Tables, columns: tuple[int, ...], stream: Any) -> kernels.MaskRows:
    """The masks' textures at the columns of samples read by some columns of view taps."""
    core, width = tables.core, tables.fine.columns
    near, off = tables.once("mask rows", lambda: _mask_places(tables))
    groups, total, begin = tables.once(("masks", columns), lambda: _mask_groups(tables, columns))
    lines = tables.buffer("lines", (max(total * width, 1),))
    high = max((len(mask.texture) for mask in core.masks), default=0) + 2 * kernels.DARK
    places = width, high, groups.mask.size
    launch(kernels.mask_lines, places, stream, tables.textures, groups, core.refine, width, lines)
    return kernels.MaskRows(lines, width, begin, near, off)


def _mask_places(tables: Tables) -> tuple[Any, Any]:
    """`kernels.MaskRows.near` and ``off``."""
    core, fine = tables.core, tables.fine
    row, step = np.zeros((len(core.masks), *core.weights.shape)), np.zeros(len(core.masks))
    for m, mask in enumerate(core.masks):
        row[m], step[m] = mask.row + mask.step[1, 1] * fine.first_row, mask.step[1, 1] / core.refine
    rows = np.array([len(mask.texture) for mask in core.masks], np.int32)
    shape = (*row.shape, fine.rows)
    near, off = cuda.device_array(shape, np.int32), cuda.device_array(shape, np.float32)
    given = to_device(row), to_device(step), to_device(rows), near, off
    launch(kernels.mask_places, (shape[3], shape[2], shape[0] * shape[1]), 0, *given)
    return near, off


def _mask_groups(tables: Tables, columns: tuple[int, ...]) -> tuple[kernels.MaskGroups, int, Any]:
    """The lines of masks for some columns of view taps, their number, and `kernels.MaskRows.begin`.

    Most taps of a column sample a mask at the same columns; taps of cut cells do not. Lines are made once for
    all taps with equal columns.
    """
    core = tables.core
    begin = np.zeros((len(core.masks), *core.weights.shape), np.int32)
    used = np.zeros(core.weights.shape, dtype=bool)
    used[:, columns] = core.weights[:, columns] != 0
    groups: list[tuple[int, float, int]] = []
    total = 0
    for m, mask in enumerate(core.masks):
        high = len(mask.texture) + 2 * kernels.DARK
        places, which = np.unique(np.round(mask.column[used], 7), return_inverse=True)
        begin[m][used] = total + which * high + kernels.DARK
        for place in places:
            groups.append((m, float(place + mask.step[0, 0] * tables.fine.first_column), total))
            total += high
    kinds = np.int32, np.float64, np.int64
    made = kernels.MaskGroups(*(to_device(np.array([g[n] for g in groups], kind)) for n, kind in enumerate(kinds)))
    return made, total, to_device(begin)
