"""Footprints on the GPU, forward: samples piece by piece, and the kernel launches for each piece.

A piece is some columns of view taps. Samples on the GPU are read in place. Samples in main memory are copied to
the GPU piece by piece, through two buffers of pinned memory and in a separate stream, so that a piece is copied
while the piece before it is summed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.engines import cuda_footprint_kernels as kernels
from vcc.engines.cuda_arrays import (
    DEFAULT_STREAM,
    arranged,
    cuda,
    given_back,
    is_on_gpu,
    launch,
    taken,
    this_gpu,
    to_device,
    wait_for,
    zeros,
)
from vcc.engines.cuda_tables import Tables, mask_rows, tables_of
from vcc.plan.footprints.model import Footprints

ROOM = 2**28
"""Limit, in bytes, of the GPU memory for sums of a piece, including finer samples and lines of masks."""
SENT_AT_ONCE = 2**25
"""Bytes of samples sent to the GPU at a time: enough for the full transfer rate."""


COPYING = 4
"""Largest number of threads that fill a pinned buffer: more would be limited by memory."""


def raster_on_gpu(core: Footprints, values: Any, progress: Progress | None = None, threads: int = 1) -> Any:
    """The raster (rows, columns, channels) of samples, float32, on the GPU.

    Args:
        core: the footprints.
        values: samples (v, u, t, s[, channels]), NumPy or on the GPU.
        progress: called with (done, total) in view taps.
        threads: number of threads that fill pieces of samples in main memory.
    """
    channels = values.shape[4] if len(values.shape) == 5 else 1
    tables, done = tables_of(core), 0
    reading = Pieces(tables, values, threads=threads)
    run = _Run(tables, core.scale, channels, reading.stream)
    with tables.lock, reading as pieces:
        for piece in pieces:
            tell(progress, done, core.taps_used)
            run.add(piece)
            done += int(np.count_nonzero(core.weights[:, piece.start : piece.stop]))
    tell(progress, core.taps_used, core.taps_used)
    return run.raster


def raster_of(core: Footprints, values: Any, progress: Progress | None = None, threads: int = 1) -> Any:
    """As `raster_on_gpu`, in the library of the samples."""
    return given_back(raster_on_gpu(core, values, progress, threads), values)


# --- samples, piece by piece ---


@dataclass(frozen=True, eq=False, repr=False)
class Piece(Brief):
    """Samples for some columns of view taps.

    Args:
        source: on the GPU.
        start: the first column of taps.
        stop: after the last.
        stream: for kernels on the piece.
    """

    source: kernels.Source
    start: int
    stop: int
    stream: Any


class Pieces:
    """The samples of a light field in pieces, as a context manager that waits for the GPU at its end.

    Args:
        tables: of the plan that reads the samples.
        values: (v, u, t, s[, channels]).
        more: bytes of GPU memory that a column of view taps needs besides the tables.
        opened: whether to include columns in which all taps have a weight of zero.
        threads: number of threads that copy samples to pinned memory.
    """

    def __init__(self, tables: Tables, values: Any, more: int = 0, opened: bool = False, threads: int = 1) -> None:
        self.tables, self.core, self.values = tables, tables.core, values
        self.on_gpu = is_on_gpu(values)
        column = 0 if self.on_gpu else values[:, :1].nbytes
        self.used = (tables.core.weights != 0).any(axis=0) | opened
        each = more + tables.bytes_a_column(values.shape[4] if len(values.shape) == 5 else 1)
        at_once = min(ROOM // max(each, 1), SENT_AT_ONCE // column if column else ROOM)
        self.columns = int(max(at_once, 1))
        self.stream: Any = DEFAULT_STREAM if self.on_gpu else cuda.stream()
        self.threads = min(threads, COPYING)

    def __enter__(self) -> Iterator[Piece]:
        total = len(self.core.view_columns)
        spans = [(a, min(a + self.columns, total)) for a in range(0, total, self.columns)]
        used = [(a, b) for a, b in spans if self.used[a:b].any()]
        if self.on_gpu:
            return self._there(used)
        self.places, self.pool, self.copying = _free_places(), Workers(self.threads), cuda.stream()
        return self._sent(used)

    def __exit__(self, *error: Any) -> None:
        if not self.on_gpu:
            self.pool.__exit__(*error)
            self.copying.synchronize()
            self.stream.synchronize()
            if error[0] is None:  # else a thread may still be writing to them
                _keep(self.places)

    def _there(self, spans: list[tuple[int, int]]) -> Iterator[Piece]:
        values = arranged(taken(self.values))
        for start, stop in spans:
            yield Piece(self._source(values, 0, ()), start, stop, self.stream)

    def _sent(self, spans: list[tuple[int, int]]) -> Iterator[Piece]:
        for n, (start, stop) in enumerate(spans):
            place = self.places[n % 2]
            columns = self.core.view_columns[start:stop]
            first = int(columns.min())
            part = self.values[:, first : int(columns.max()) + 1]
            part = part if self.values.ndim == 5 else part[..., None]
            values = place.filled(part, self.pool, self.copying, self.stream)
            yield Piece(self._source(values, first, (start, stop)), start, stop, self.stream)
            place.left(self.stream)

    def _source(self, values: Any, first: int, span: tuple[int, ...]) -> kernels.Source:
        """Samples on the GPU from a column of views on; span: the taps that read them, or () for all."""
        _, nu, nt, ns, channels = values.shape
        view = nt * ns * channels

        def places() -> tuple[Any, Any]:
            further = (self.core.view_columns - first) * view
            return to_device(self.core.view_rows * (nu * view)), to_device(further)

        begin, further = self.tables.once((*span, *values.shape), places)
        return kernels.Source(values.reshape(math.prod(values.shape)), begin, further, ns * channels)


class _Place:
    """A buffer of pinned memory and one of equal size on the GPU, through which pieces are sent one by one."""

    def __init__(self) -> None:
        self.pinned = np.zeros(0, np.uint8)
        self.there: Any = None
        self.free = cuda.event()

    def filled(self, part: NDArray[Any], pool: Workers, copying: Any, working: Any) -> Any:
        """Copy a piece of samples to the GPU; later kernels in stream ``working`` wait for it.

        Args:
            part: samples (v, u, t, s, channels) in main memory.
            pool: threads that copy them.
            copying: stream of the transfer.
            working: stream of the sums.
        """
        kind = np.dtype(np.float32) if part.dtype == np.float16 else part.dtype
        size = part.size * kind.itemsize
        self.free.synchronize()  # the piece before is summed
        if self.pinned.size < size:
            self.pinned, self.there = cuda.pinned_array(size, np.uint8), cuda.device_array(size, np.uint8)
        pinned = self.pinned[:size].view(kind).reshape(part.shape)
        list(pool.map(lambda v: np.copyto(pinned[v], part[v]), range(len(part))))
        there = self.there[:size]
        there.copy_to_device(self.pinned[:size], stream=copying)
        wait_for(copying, working)
        return there.view(kind).reshape(part.shape)

    def left(self, working: Any) -> None:
        """Mark that all kernels that read the buffer are launched."""
        self.free.record(working)


_kept: dict[int, tuple[_Place, _Place]] = {}
"""Two buffers on each GPU, reused from run to run: pinning memory takes longer than a transfer through it."""


def _free_places() -> tuple[_Place, _Place]:
    return _kept.pop(this_gpu(), None) or (_Place(), _Place())


def _keep(places: tuple[_Place, _Place]) -> None:
    """Store the buffers for the next run; of several pairs, from concurrent runs, one is kept."""
    _kept[this_gpu()] = places


# --- the run ---


class _Run:
    """A raster while it is summed."""

    def __init__(self, tables: Tables, scale: float, channels: int, stream: Any) -> None:
        self.tables, self.scale, self.channels = tables, np.float32(scale), channels
        self.raster = zeros((*tables.core.raster_shape, channels), stream)

    def add(self, piece: Piece) -> None:
        """Add the samples of some columns of view taps."""
        source = piece.source
        if self.tables.divided is not None:
            source = divided(self.tables, piece, self.channels, self.tables.weights)
        (self._by_columns if self.tables.along is not None else self._sheared)(piece, source)

    def _by_columns(self, piece: Piece, source: kernels.Source) -> None:
        assert self.tables.along is not None
        core, channels = self.tables.core, self.channels
        (quads, batch), across = self.tables.along
        rows, columns = core.raster_shape
        fours = quads.first.shape[1]
        masked = bool(core.masks)
        words = not masked and source.values.dtype == np.uint8 and _in_words(source, core)
        each = channels if masked else 4 if words else 1
        if words:
            source = source._replace(values=source.values.view(np.uint32))
        shape = (piece.stop - piece.start, fours * kernels.ROWS, source.pitch)
        sums = self.tables.buffer("sums", shape)
        masks = mask_rows(self.tables, tuple(range(piece.start, piece.stop)), piece.stream)
        launch(
            kernels.sum_rows(each, words, masked, batch),
            (source.pitch // each, fours, shape[0]),
            piece.stream,
            *(source, self.tables.weights, quads, masks, piece.start, self.tables.fine.rows, sums),
        )
        flat = self.raster.reshape(rows, columns * channels)
        launch(
            kernels.mix_columns(across[1].shape[2]),
            flat.shape,
            piece.stream,
            *(sums, *across, channels, piece.start, self.scale, flat),
        )

    def _sheared(self, piece: Piece, source: kernels.Source) -> None:
        tables, fine = self.tables, self.tables.fine
        launch(
            kernels.gather(self.channels),
            tables.core.raster_shape[::-1],
            piece.stream,
            *(source, tables.weights, tables.places, tables.grid, tables.footprint, tables.textures),
            *((fine.rows, fine.columns), piece.start, piece.stop, self.scale, self.raster),
        )


def _in_words(source: kernels.Source, core: Footprints) -> bool:
    """Whether all rows of samples begin and end at a word boundary."""
    view = source.pitch * core.samples[0]
    aligned = _address(source.values) % 4 == 0
    return aligned and source.pitch % 4 == 0 and view % 4 == 0 and source.values.size % 4 == 0


def _address(values: Any) -> int:
    return int(values.__cuda_array_interface__["data"][0]) if hasattr(values, "__cuda_array_interface__") else 0


def divided(tables: Tables, piece: Piece, channels: int, used: Any) -> kernels.Source:
    """The finer samples of each view tap of a piece, in a buffer of their own."""
    assert tables.divided is not None
    core, fine = tables.core, tables.fine
    line, count = fine.columns * channels, len(core.view_rows)
    shape = (piece.stop - piece.start, count, fine.rows, line)
    made = tables.buffer("divided", shape)
    launch(
        kernels.divide,
        (line, fine.rows, shape[0] * count),
        piece.stream,
        *(piece.source, used, *tables.divided, channels, piece.start, made),
    )

    def places() -> tuple[Any, Any]:
        further = (np.arange(len(core.view_columns)) - piece.start) * (count * fine.rows * line)
        return to_device(np.arange(count) * (fine.rows * line)), to_device(further)

    begin, further = tables.once(("divided", piece.start, line), places)
    return kernels.Source(made.reshape(math.prod(shape)), begin, further, line)
