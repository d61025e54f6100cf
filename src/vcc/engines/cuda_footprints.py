"""Footprints on the GPU, forward: the tables of a plan, samples piece by piece, and the kernels that are started.

A piece is some columns of view taps. Samples that are on the GPU are taken where they lie; those in main memory
are copied there piece by piece through two places of pinned memory, in a stream of their own, so that a piece is
on its way while the one before is summed. Tables stay on the GPU while their plan is used.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from threading import Lock
from typing import Any

import numpy as np
from numba import cuda
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.progress import Progress, tell
from vcc.engines import cuda_footprint_kernels as kernels
from vcc.engines import footprint_tables as tables
from vcc.engines.cuda_arrays import arranged, given_back, is_on_gpu, launch, sent, taken, zeros
from vcc.engines.footprint_samples import FineGrid, on_raster, textures
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.shares import taps

ROOM = 2**28
"""Bytes of the GPU's memory that sums of a piece may take, finer samples and lines of masks among them."""
SENT_AT_ONCE = 2**26
"""Bytes of samples that are sent to the GPU at once: enough for the full speed of the way there."""
KEPT = 4
"""Plans whose tables stay on the GPU: those that were used last."""


def raster_on_gpu(core: Footprints, values: Any, progress: Progress | None = None) -> Any:
    """The raster (rows, columns, channels) of samples, float32, on the GPU.

    Args:
        core: the footprints.
        values: samples (v, u, t, s[, channels]), of NumPy or on the GPU.
        progress: called with (done, total) in view taps.
    """
    channels = values.shape[4] if len(values.shape) == 5 else 1
    tables, done = tables_of(core), 0
    reading = Pieces(tables, values)
    run = _Run(tables, core.scale, channels, reading.stream)
    with reading as pieces:
        for piece in pieces:
            tell(progress, done, core.taps_used)
            run.add(piece)
            done += int(np.count_nonzero(core.weights[:, piece.start : piece.stop]))
    tell(progress, core.taps_used, core.taps_used)
    return run.raster


def raster_of(core: Footprints, values: Any, progress: Progress | None = None) -> Any:
    """The same in the library of the samples."""
    return given_back(raster_on_gpu(core, values, progress), values)


# --- samples, piece by piece ---


@dataclass(frozen=True, eq=False, repr=False)
class Piece(Brief):
    """Samples that some columns of view taps read.

    Args:
        source: on the GPU.
        start: the first column of taps.
        stop: after the last.
        stream: in which kernels are started.
    """

    source: kernels.Source
    start: int
    stop: int
    stream: Any


class Pieces:
    """The samples of a light field in pieces; within ``with``, which waits for the GPU at its end.

    Args:
        tables: of what reads them.
        values: (v, u, t, s[, channels]).
    """

    def __init__(self, tables: Tables, values: Any) -> None:
        self.tables, self.core, self.values = tables, tables.core, values
        self.on_gpu = is_on_gpu(values)
        column = 0 if self.on_gpu else values[:, :1].nbytes
        each = tables.bytes_a_column(values.shape[4] if len(values.shape) == 5 else 1)
        at_once = min(ROOM // max(each, 1), SENT_AT_ONCE // column if column else ROOM)
        self.columns = int(max(at_once, 1))
        self.stream: Any = 0 if self.on_gpu else cuda.stream()

    def __enter__(self) -> Iterator[Piece]:
        total = len(self.core.view_columns)
        spans = [(a, min(a + self.columns, total)) for a in range(0, total, self.columns)]
        used = [(a, b) for a, b in spans if self.core.weights[:, a:b].any()]
        return self._there(used) if self.on_gpu else self._sent(used)

    def __exit__(self, *error: object) -> None:
        if not self.on_gpu:
            self.stream.synchronize()

    def _there(self, spans: list[tuple[int, int]]) -> Iterator[Piece]:
        values = arranged(taken(self.values))
        for start, stop in spans:
            yield Piece(self._source(values, 0, ()), start, stop, self.stream)

    def _sent(self, spans: list[tuple[int, int]]) -> Iterator[Piece]:
        copying, places = cuda.stream(), (_Place(), _Place())
        for n, (start, stop) in enumerate(spans):
            place = places[n % 2]
            columns = self.core.view_columns[start:stop]
            first = int(columns.min())
            part = self.values[:, first : int(columns.max()) + 1]
            values = place.filled(part if self.values.ndim == 5 else part[..., None], copying, self.stream)
            yield Piece(self._source(values, first, (start, stop)), start, stop, self.stream)
            place.left(self.stream)

    def _source(self, values: Any, first: int, span: tuple[int, ...]) -> kernels.Source:
        """Samples on the GPU from a column of views on; span: of taps that read them, where not all do."""
        _, nu, nt, ns, channels = values.shape
        view = nt * ns * channels

        def places() -> tuple[Any, Any]:
            further = (self.core.view_columns - first) * view
            return sent(self.core.view_rows * (nu * view)), sent(further)

        begin, further = self.tables.once((*span, *values.shape), places)
        return kernels.Source(values.reshape(math.prod(values.shape)), begin, further, ns * channels)


class _Place:
    """Pinned memory, and as much on the GPU, through which pieces are sent one after the other."""

    def __init__(self) -> None:
        self.pinned = np.zeros(0, np.uint8)
        self.there: Any = None
        self.free = cuda.event()

    def filled(self, part: NDArray[Any], copying: Any, working: Any) -> Any:
        """A piece of samples on the GPU, once kernels that are started in ``working`` from now on see it."""
        kind = np.dtype(np.float32) if part.dtype == np.float16 else part.dtype
        self.free.synchronize()  # what was here before is summed
        if self.pinned.shape != part.shape or self.pinned.dtype != kind:
            self.pinned, self.there = cuda.pinned_array(part.shape, kind), cuda.device_array(part.shape, kind)
        self.pinned[...] = part
        self.there.copy_to_device(self.pinned, stream=copying)
        copied = cuda.event()
        copied.record(copying)
        copied.wait(working)
        return self.there

    def left(self, working: Any) -> None:
        """All kernels that look here are started."""
        self.free.record(working)


# --- what plans say, as arrays on the GPU ---


@dataclass(frozen=True, eq=False, repr=False)
class Tables(Brief):
    """A plan on the GPU.

    Args:
        core: the plan's.
        fine: how its samples are divided.
        weights: (rows of taps, columns of taps) float32.
        divided: (first, shares) of rows and of columns of finer samples, or None.
        along: where rows and columns part: `kernels.Quads` of rows, and (first, shares) of columns; or None.
        textures: where they part, each mask's; else all of them, `tables.Textures`.
        sheared: where they do not: (`kernels.Sheared`, `tables.Grid`, `tables.Footprint`); or None.
        kept: what else was made for it, see `once`.
    """

    core: Footprints
    fine: FineGrid
    weights: Any
    divided: tuple[Any, Any] | None
    along: tuple[kernels.Quads, tuple[Any, Any]] | None
    textures: Any
    sheared: tuple[kernels.Sheared, tables.Grid, tables.Footprint] | None
    kept: dict[Any, Any] = field(default_factory=dict)

    def once(self, key: Any, make: Callable[[], Any]) -> Any:
        """What ``make`` makes, made once."""
        if key not in self.kept:
            self.kept[key] = make()
        return self.kept[key]

    def bytes_a_column(self, channels: int) -> int:
        """Of the GPU's memory that a column of view taps takes beside its samples."""
        core, line = self.core, 4 * self.fine.columns * channels
        finer = len(core.view_rows) * self.fine.rows * line if self.divided else 0
        if self.along is None:
            return finer
        lines = sum(len(mask.texture) for mask in core.masks) * 4 * self.fine.columns
        return finer + core.raster_shape[0] * line + lines


_kept: deque[Tables] = deque(maxlen=KEPT)
_lock = Lock()


def tables_of(core: Footprints) -> Tables:
    """The tables of a plan: made now, or those that are on the GPU already.

    A plan's arrays are never written to: plans that share all of them are alike, but for what a sample stands for.
    """
    with _lock:
        for known in _kept:
            if _alike(known.core, core):
                return known
        made = _made(core)
        _kept.append(made)
        return made


def _alike(one: Footprints, other: Footprints) -> bool:
    for each in fields(Footprints):
        a, b = getattr(one, each.name), getattr(other, each.name)
        if each.name == "scale" or a is b:
            continue
        if isinstance(a, np.ndarray) or isinstance(b, np.ndarray) or each.name == "masks" or a != b:
            return False
    return True


def _made(core: Footprints) -> Tables:
    fine = FineGrid(core)
    weights = sent(core.weights.astype(np.float32))
    divided = None
    if fine.divided_as is not None:
        divided = tuple((sent(part.first), sent(part.shares.astype(np.float32))) for part in fine.divided_as)
    if core.separable:
        masks = [sent(mask.texture.astype(np.float32, copy=False)) for mask in core.masks]
        return Tables(core, fine, weights, divided, _along(core, fine), masks, None)  # type: ignore[arg-type]
    grid, footprint = on_raster(core, fine)
    places = np.zeros((len(core.masks), *core.weights.shape, 2))
    for place, mask in zip(places, core.masks, strict=True):
        place[..., 0], place[..., 1] = mask.column, mask.row
    sheared = kernels.Sheared(sent(core.x), sent(core.y), sent(places))
    values, size, step = textures(core)
    masks_there = tables.Textures(sent(values), sent(size), sent(step))
    grid = grid._replace(step=sent(core.step))
    return Tables(core, fine, weights, divided, None, masks_there, (sheared, grid, footprint))  # type: ignore[arg-type]


def _along(core: Footprints, fine: FineGrid) -> tuple[kernels.Quads, tuple[Any, Any]]:
    """How rows of the raster gather rows of samples, by fours, and columns columns."""
    rows, columns = core.raster_shape
    start_y = core.y[:, 0] + core.row_step * fine.first_row
    start_x = core.x[0] + core.column_step * fine.first_column
    row_step, column_step = core.row_step / core.refine, core.column_step / core.refine
    down = taps(core.interpolation, start_y, row_step, fine.rows, rows, core.opening)
    across = taps(core.interpolation, start_x, column_step, fine.columns, columns, core.opening)
    quads = kernels.Quads(*map(sent, _quads(down.first, down.weights)))
    return quads, (sent(across.first.astype(np.int32)), sent(across.weights))


def _quads(
    first: NDArray[np.int64], shares: NDArray[np.float32]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]:
    """`kernels.Quads` of the rows of samples that each row of the raster gathers: `Taps` of rows."""
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
    made = np.zeros((*top.shape, max(int(number.max(initial=0)), 1), kernels.ROWS), np.float32)
    tap, row, t = np.nonzero(there)
    quad = row // kernels.ROWS
    made[tap, quad, first[tap, row] + t - top[tap, quad], row % kernels.ROWS] = shares[tap, row, t]
    return top.astype(np.int32), number.astype(np.int32), made


# --- the run ---


class _Run:
    """A raster as it grows."""

    def __init__(self, tables: Tables, scale: float, channels: int, stream: Any) -> None:
        self.tables, self.scale, self.channels = tables, np.float32(scale), channels
        self.raster = zeros((*tables.core.raster_shape, channels), stream)

    def add(self, piece: Piece) -> None:
        """Add what some columns of view taps read."""
        source = piece.source
        if self.tables.divided is not None:
            source = divided(self.tables, piece, self.channels, self.tables.weights)
        (self._by_columns if self.tables.along is not None else self._sheared)(piece, source)

    def _by_columns(self, piece: Piece, source: kernels.Source) -> None:
        assert self.tables.along is not None
        core, channels = self.tables.core, self.channels
        quads, across = self.tables.along
        rows, columns = core.raster_shape
        fours = quads.first.shape[1]
        masked = bool(core.masks)
        words = not masked and source.values.dtype == np.uint8 and _in_words(source, core)
        each = channels if masked else 4 if words else 1
        if words:
            source = source._replace(values=source.values.view(np.uint32))
        shape = (piece.stop - piece.start, fours * kernels.ROWS, source.pitch)
        sums = cuda.device_array(shape, np.float32, stream=piece.stream)
        masks = mask_rows(self.tables, piece)
        launch(
            kernels.sum_rows(each, words, masked),
            (source.pitch // each, fours, shape[0]),
            piece.stream,
            *(source, self.tables.weights, quads, masks, piece.start, sums),
        )
        flat = self.raster.reshape(rows, columns * channels)
        launch(
            kernels.mix_columns,
            flat.shape,
            piece.stream,
            *(sums, *across, channels, piece.start, self.scale, flat),
        )

    def _sheared(self, piece: Piece, source: kernels.Source) -> None:
        assert self.tables.sheared is not None
        fine, (places, grid, footprint) = self.tables.fine, self.tables.sheared
        launch(
            kernels.gather(self.channels),
            self.tables.core.raster_shape[::-1],
            piece.stream,
            *(source, self.tables.weights, places, grid, footprint, self.tables.textures),
            *((fine.rows, fine.columns), piece.start, piece.stop, self.scale, self.raster),
        )


def _in_words(source: kernels.Source, core: Footprints) -> bool:
    """Whether all rows of samples begin at a whole word and end at one."""
    view = source.pitch * core.samples[0]
    aligned = _address(source.values) % 4 == 0
    return aligned and source.pitch % 4 == 0 and view % 4 == 0 and source.values.size % 4 == 0


def _address(values: Any) -> int:
    return int(values.__cuda_array_interface__["data"][0]) if hasattr(values, "__cuda_array_interface__") else 0


def divided(tables: Tables, piece: Piece, channels: int, used: Any) -> kernels.Source:
    """The finer samples of each view tap of a piece, by themselves."""
    assert tables.divided is not None
    core, fine = tables.core, tables.fine
    line, count = fine.columns * channels, len(core.view_rows)
    shape = (piece.stop - piece.start, count, fine.rows, line)
    made = cuda.device_array(shape, np.float32, stream=piece.stream)
    launch(
        kernels.divide,
        (line, fine.rows, shape[0] * count),
        piece.stream,
        *(piece.source, used, *tables.divided, channels, piece.start, made),
    )

    def places() -> tuple[Any, Any]:
        further = (np.arange(len(core.view_columns)) - piece.start) * (count * fine.rows * line)
        return sent(np.arange(count) * (fine.rows * line)), sent(further)

    begin, further = tables.once(("divided", piece.start, line), places)
    return kernels.Source(made.reshape(math.prod(shape)), begin, further, line)


def mask_rows(tables: Tables, piece: Piece) -> kernels.MaskRows:
    """The masks' textures at the columns of samples of a piece."""
    core, fine = tables.core, tables.fine
    groups, total, given = tables.once(
        ("masks", piece.start, piece.stop), lambda: _mask_groups(tables, piece.start, piece.stop)
    )
    lines = cuda.device_array((max(total, 1), fine.columns if groups else 1), np.float32, stream=piece.stream)
    for m, place, at in groups:
        texture = tables.textures[m]
        part = lines[at : at + texture.shape[0]]
        across = core.masks[m].step[0, 0] / core.refine
        launch(kernels.mask_lines, part.shape[::-1], piece.stream, texture, place, across, part)
    return kernels.MaskRows(lines, *given)


def _mask_groups(
    tables: Tables, start: int, stop: int
) -> tuple[list[tuple[int, float, int]], int, tuple[Any, ...]]:
    """Which lines of masks a piece needs: (mask, its column at the first sample, where its lines begin), how many
    lines that are, and `kernels.MaskRows` but for them.

    Most taps of a column look a mask up in the same columns, those of cut cells elsewhere: lines are made once for
    all taps that agree.
    """
    core, fine = tables.core, tables.fine
    shape = (len(core.masks), *core.weights.shape)
    begin, row = np.zeros(shape, np.int32), np.zeros(shape)
    step = np.zeros(len(core.masks))
    used = np.zeros(core.weights.shape, dtype=bool)
    used[:, start:stop] = core.weights[:, start:stop] != 0
    groups: list[tuple[int, float, int]] = []
    total = 0
    for m, mask in enumerate(core.masks):
        step[m] = mask.step[1, 1] / core.refine
        row[m] = mask.row + mask.step[1, 1] * fine.first_row
        places, which = np.unique(np.round(mask.column[used], 7), return_inverse=True)
        begin[m][used] = total + which * len(mask.texture)
        for place in places:
            groups.append((m, float(place + mask.step[0, 0] * fine.first_column), total))
            total += len(mask.texture)
    rows = np.array([len(mask.texture) for mask in core.masks], np.int32)
    return groups, total, tuple(map(sent, (begin, rows, row, step)))
