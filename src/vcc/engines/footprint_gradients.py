"""Gradients of a weighted raster to the parameters of footprints, in compiled loops: see `footprint_gradients`.

With I(y, x) = scale · Σ L · w · Π T · F_y · F_x and weights G of I, the weights are first mixed into the columns
of the samples of one column of view taps, H(y, k) = Σ_x F_x · G, and also with the derivatives of F_x if
gradients of positions along x are requested. A row of samples falls on a few rows y only. Two quantities give
all gradients:

- for weights, positions and steps: sums of L · ΠT · H along a row, one for each y, times F_y or its derivatives;
- for masks: Σ_c L · Σ_y F_y · H at each sample. This is added to the three lines of a mask around the row, and
from
  the lines to the texture once per column of view taps.

Threads take spans of columns of samples. The spans do not depend on the number of threads, nor does the result.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.engines import footprint_gradient_kernels as kernels
from vcc.engines import footprint_tables as tables
from vcc.engines.footprint_axes import axes
from vcc.engines.footprint_columns import in_tiles
from vcc.engines.footprint_samples import (
    FineGrid,
    MaskColumns,
    MaskPiece,
    blocks,
    no_masks,
    on_raster,
    textures,
    view_of,
)
from vcc.engines.vector_sums import EIGHT, LANES, aligned_buffer
from vcc.plan.footprints.model import Footprints

Array = NDArray[np.float64]

SPAN = 128
"""Approximate number of columns of samples that a thread works on at once."""

PART = 64
"""Rows of the raster that all taps process before the next rows."""

TEXTURE_BYTES = 2**26
"""Memory limit for textures of pieces of the raster, if rows and columns are sheared."""
PIECES = 8
"""Largest number of such pieces."""

SUMS: dict[str, tuple[tuple[str, str], ...]] = {
    "weights": (("share", "share"),),
    "y": (("place", "share"),),
    "x": (("share", "place"),),
    "opening": (("opening", "share"), ("share", "opening")),
    "x/k": (("share", "step"),),
    "x/l": (("sheared", "place"),),
    "y/k": (("place", "along"),),
    "y/l": (("step", "share"),),
}
"""Sums over the samples, by kinds of shares along (y, x); two pairs (product rule) if a parameter changes both."""
NEEDED = {
    "scale": ("weights",),
    "weights": ("weights",),
    "x": ("x",),
    "y": ("y",),
    "step": ("x/k", "x/l", "y/k", "y/l"),
    "opening": ("opening",),
}
"""The sums that each parameter needs."""


def footprint_gradients(
    core: Footprints,
    values: NDArray[Any],
    raster: NDArray[np.floating],
    wanted: Collection[str],
    threads: int,
    progress: Progress | None = None,
) -> dict[str, Array]:
    """The derivative of ⟨raster, raster of the samples⟩ to parameters of the core, by name, each of its shape.

    Positions and steps are independent parameters: the derivative to ``x`` is that of each tap alone.
    ``weights`` have a derivative for taps with a weight of zero, too.

    Args:
        core: the footprints.
        values: the samples, (v, u, t, s[, channels]).
        raster: weights of the raster's values, (rows, columns, channels).
        wanted: names of the core's parameters (`vcc.plan.parameters.numbers`).
        threads: number of threads; the bytes do not depend on it.
        progress: called with (done, total).

    Raises:
        InputError: a parameter that has no derivative.
    """
    core.check_wanted(wanted)
    channels = values.shape[4] if values.ndim == 5 else 1
    if "weights" in wanted:  # includes taps with a weight of zero
        core, weights = replace(core, weights=np.ones_like(core.weights)), core.weights
    else:
        weights = core.weights
    masks = _of_masks(core, wanted)
    with Workers(threads) as pool:
        if core.separable:
            back = _ByColumns(core, weights, raster, channels, wanted, pool)
            sums = back.sums_over(values, progress)
        else:
            sums = _sheared(core, weights, values, np.asarray(raster, dtype=np.float64), masks[0], pool, progress)
    return _named(core, weights, wanted, sums)


def _of_masks(core: Footprints, wanted: Collection[str]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The masks with a requested gradient of the texture, and those with one of any place or step."""
    found = [
        [any(f"masks[{n}].{part}" in wanted for part in parts) for n in range(len(core.masks))]
        for parts in (("texture",), ("column", "row", "step"))
    ]
    return np.array(found[0], dtype=bool), np.array(found[1], dtype=bool)


def _parts(first: NDArray[np.int64], rows: int) -> NDArray[np.int64]:
    """(parts, taps, 2): the rows of samples that begin in each part of the raster; first ascends or descends."""
    part = first // PART
    parts = np.zeros((-(-rows // PART), len(first), 2), dtype=np.int64)
    for n, tap in np.ndindex(parts.shape[:2]):
        inside = np.flatnonzero(part[tap] == n)
        if inside.size:
            parts[n, tap] = inside[0], inside[-1] + 1
    return parts


def _spans(index: Array) -> list[tables.Span]:
    """Spans of equal length over the columns of samples with these indices; the last two may overlap."""
    columns = max(index.size, LANES)
    number = -(-columns // SPAN)
    length = min(-(-columns // (number * LANES)), columns // LANES) * LANES
    padded = np.pad(index, (0, columns - index.size)).astype(np.float32)
    return [
        tables.Span(min(low, columns - length), min(low, columns - length) + length, low, n * length, padded)
        for n, low in enumerate(range(0, columns, length))
    ]


class _ByColumns:
    """Plans with separable rows and columns: tables, and the loop over columns of views and spans."""

    def __init__(
        self,
        core: Footprints,
        weights: Array,
        raster: NDArray[np.floating],
        channels: int,
        wanted: Collection[str],
        pool: Workers,
    ) -> None:
        self.core, self.weights, self.channels, self.wanted, self.pool = core, weights, channels, wanted, pool
        self.fine = fine = FineGrid(core)
        self.sums = [each for each in SUMS if any(each in NEEDED.get(name, ()) for name in wanted)]
        pairs = [(*pair, number) for number, each in enumerate(self.sums) for pair in SUMS[each]]
        # "share" comes first, as masks need it.
        down = list(dict.fromkeys(["share", *(y for y, _, _ in pairs)]))
        across = list(dict.fromkeys(["share", *(x for _, x, _ in pairs)]))
        ordered = sorted((across.index(x), down.index(y), number) for y, x, number in pairs)
        columns, rows, totals = np.array(ordered, dtype=np.int64).reshape(-1, 3).T
        self.pairs = tables.Pairs(*map(np.ascontiguousarray, (rows, columns, totals)))
        along_y, along_x = axes(core, fine)
        first, counts, shares = along_y.table(down, multiple=4)
        plain, parts = np.ascontiguousarray(shares[:, :, 0], dtype=np.float32), _parts(first, core.raster_shape[0])
        self.reached = tables.Reached(first, counts, shares, plain, along_y.index, parts)
        self.first, _, gathered = along_x.table(across)
        self.gathered = np.ascontiguousarray(np.moveaxis(gathered, 2, 1), dtype=np.float32)
        """(columns of taps, kinds, columns of samples, width)"""
        self.tiles = in_tiles(raster, self.gathered.shape[-1], pool)
        self.masks = MaskColumns(core, fine, 1, 1, pool)
        self.texture, self.place = _of_masks(core, wanted)
        self.textures: list[Array | None] = [
            np.zeros(mask.texture.shape) if self.texture[n] else None for n, mask in enumerate(core.masks)
        ]
        self.lines, self.slopes = (np.zeros((0, 0), dtype=np.float32) for _ in range(2))
        self.spans = _spans(along_x.index)
        # The columns of samples in the spans, one span after the other.
        held = np.concatenate([np.arange(span.start, span.stop) for span in self.spans])
        self.held = np.minimum(held, fine.columns - 1)

    def sums_over(self, values: NDArray[Any], progress: Progress | None) -> _Sums:
        """The sums over all samples."""
        core = self.core
        totals = np.zeros((*core.weights.shape, len(self.sums)))
        places = np.zeros((*core.weights.shape, len(core.masks), 6))
        done, total = 0, int(np.count_nonzero(self.weights))
        for samples, (a, _) in blocks(core, values, True):
            used = np.flatnonzero(core.weights[:, a])
            if used.size == 0:
                continue
            masks, sought = self.masks_at(a)
            add = partial(self.add, samples, a, used, masks, sought)
            for of_span, place in self.pool.map(add, self.spans):
                totals[:, a] += of_span
                places[:, a] += place
            self.give_back()
            done += int(np.count_nonzero(self.weights[:, a]))
            tell(progress, done, total)
        tell(progress, total, total)
        return _Sums({each: totals[..., number] for number, each in enumerate(self.sums)}, places, self.textures)

    def add(
        self,
        samples: tables.Samples,
        a: int,
        used: NDArray[np.intp],
        masks: tables.MaskLines,
        sought: tables.Sought,
        span: tables.Span,
    ) -> tuple[Array, Array]:
        """The sums over a span of the columns of samples, and the sums for the masks' places."""
        taps = len(self.core.view_rows)
        totals, places = np.zeros((taps, len(self.sums))), np.zeros((taps, len(self.core.masks), 6))
        some = slice(span.start, span.stop)
        fine = None
        if self.core.refine > 1:
            whole = self.fine.tables((span.stop - span.start) * self.channels)
            fine = whole._replace(first_column=whole.first_column[some], column_shares=whole.column_shares[some])
        shares = self.gathered[a]
        length = (span.stop - span.start) * self.channels
        height = EIGHT * len(self.tiles) + self.reached.shares.shape[3]
        mixed = aligned_buffer(len(shares), height, length)
        kernels.mix(self.tiles, tables.Gathered(self.first[a], shares), span, self.channels, mixed)
        given = mixed, self.reached, self.pairs, self.weights[:, a] * self.core.scale
        kernels.add_gradients(
            samples, a, used, fine, given, masks, sought._replace(places=places), self.channels, span, totals
        )
        return totals, places

    def masks_at(self, a: int) -> tuple[tables.MaskLines, tables.Sought]:
        """The masks' lines for a column of view taps, and buffers for the masks' gradients."""
        met = self.masks.at(a, self.held.size) or no_masks()
        if self.texture.any():
            if len(self.lines) < len(met.lines):
                self.lines = aligned_buffer(*met.lines.shape)
            self.lines[:] = 0
        if self.place.any():
            if len(self.slopes) < len(met.lines):
                self.slopes = aligned_buffer(*met.lines.shape)
                self.slopes[:] = 0  # zero beyond the samples' last column
            list(self.pool.map(self.look_up, self.masks.pieces))
        return met, tables.Sought(self.lines, self.slopes, self.texture, self.place, np.zeros((0, 0, 6)))

    def look_up(self, piece: MaskPiece) -> None:
        """Sample the slopes of some lines of a mask."""
        some = self.masks.textures[piece.mask][piece.start : piece.stop]
        kernels.slopes_at_columns(some, piece.columns, self.slopes[piece.to : piece.to + len(some)])

    def give_back(self) -> None:
        """Add the gradients of the masks' lines to those of their textures."""
        groups: dict[tuple[int, int], list[MaskPiece]] = {}
        for piece in self.masks.pieces:
            if self.texture[piece.mask]:
                groups.setdefault((piece.mask, piece.to - piece.start), []).append(piece)
        for group in groups.values():  # pieces of a group are different rows
            list(self.pool.map(self.give_back_piece, group))

    def give_back_piece(self, piece: MaskPiece) -> None:
        """Add the gradients of some lines to the texture's gradient."""
        texture = self.textures[piece.mask]
        assert texture is not None
        some = texture[piece.start : piece.stop]
        kernels.give_back_columns(self.lines[piece.to : piece.to + len(some)], piece.columns[self.held], some)


@dataclass(frozen=True, eq=False, repr=False)
class _Sums(Brief):
    """Sums over all samples of each tap, without the tap's weight.

    Args:
        of: by the names of `SUMS`, each (rows of taps, columns of taps).
        places: (rows of taps, columns of taps, masks, 6), see `vcc.engines.footprint_tables.Sought`.
        textures: gradient of each mask's texture, including all weights; None if it is not requested.
    """

    of: Mapping[str, Array]
    places: Array
    textures: Sequence[Array | None]


def _named(core: Footprints, weights: Array, wanted: Collection[str], sums: _Sums) -> dict[str, Array]:
    """The derivatives to parameters, by name, from the sums over each tap's samples."""
    of, light = sums.of, weights * core.scale

    def number(name: str) -> Any:
        if name.startswith("masks["):
            n = int(name[len("masks[") : name.index("]")])
            column, column_k, column_l, row, row_k, row_l = light * np.moveaxis(sums.places[..., n, :], -1, 0)
            return {
                "texture": sums.textures[n],
                "column": column,
                "row": row,
                "step": [[column_k.sum(), column_l.sum()], [row_k.sum(), row_l.sum()]],
            }[name.rpartition(".")[2]]
        if name == "step":
            return [[np.sum(light * of[f"{i}/{j}"]) for j in "kl"] for i in "xy"]
        if name == "weights":
            return core.scale * of["weights"]
        if name == "scale":
            return np.sum(weights * of["weights"])
        return np.sum(light * of[name]) if name == "opening" else light * of[name]

    return {name: np.asarray(number(name), dtype=np.float64) for name in wanted}


def _sheared(
    core: Footprints,
    weights: Array,
    values: NDArray[Any],
    raster: Array,
    texture: NDArray[np.bool_],
    pool: Workers,
    progress: Progress | None,
) -> _Sums:
    """The sums if rows and columns are sheared, one view tap at a time."""
    fine = FineGrid(core)
    grid, footprint = on_raster(core, fine)
    masks = textures(core)
    # Each piece of the raster has its own textures, as many as the memory limit allows.
    pieces = int(np.clip(TEXTURE_BYTES // (8 * max(masks.values.size, 1)), 1, PIECES))
    ends = np.linspace(0, len(raster), pieces + 1).astype(int)
    bands = [tables.Band(int(low), int(high)) for low, high in pairwise(ends)]
    gradients = np.zeros((pieces, *masks.values.shape) if texture.any() else (pieces, 0, 0, 0))
    found = np.zeros((pieces, *core.weights.shape, kernels.SHEARED))
    places = np.zeros((pieces, *core.weights.shape, len(core.masks), 6))
    done, total = 0, int(np.count_nonzero(weights))
    for b, a in zip(*np.nonzero(core.weights), strict=True):
        tell(progress, done, total)
        done += int(weights[b, a] != 0)
        samples = fine.divided(values[core.view_rows[b], core.view_columns[a]].reshape(*core.samples, -1))
        view = view_of(core, b, a, samples, weights)

        def add(piece: int, view: tables.View = view, b: int = b, a: int = a) -> None:
            to = found[piece, b, a], places[piece, b, a], gradients[piece]
            kernels.add_sheared(view, grid, footprint, masks, raster, bands[piece], *to)

        list(pool.map(add, range(pieces)))
    tell(progress, total, total)
    whole = gradients.sum(axis=0)
    return _Sums(
        _of_shears(core, *np.moveaxis(found.sum(axis=0), -1, 0)),
        places.sum(axis=0),
        [
            whole[n, : mask.texture.shape[0], : mask.texture.shape[1]] if texture[n] else None
            for n, mask in enumerate(core.masks)
        ],
    )


def _of_shears(
    core: Footprints,
    light: Array,
    x: Array,
    x_k: Array,
    x_rows: Array,
    width: Array,
    y: Array,
    y_k: Array,
    y_l: Array,
    height: Array,
    opening: Array,
) -> dict[str, Array]:
    """The sums by the names of `SUMS`, from the sums of `kernels.add_sheared`.

    A sample lies at x + shear·(row − y) + column_step·k, with shear = x/l : y/l, column_step = x/k − shear ·
    y/k.
    """
    (_, xl), (yk, yl) = core.step
    column_step = x_k + np.sign(core.column_step) / core.refine * width
    shear = x_rows - yk * column_step
    return {
        "weights": light,
        "x": x,
        "y": y - core.shear * x,
        "opening": opening,
        "x/k": column_step,
        "x/l": shear / yl,
        "y/k": y_k - core.shear * column_step,
        "y/l": y_l + np.sign(yl) / core.refine * height - shear * xl / yl**2,
    }
