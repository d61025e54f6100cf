"""Sum rows of samples, and mix the sums, with vector instructions that keep them in registers.

A sample is loaded and converted once for four rows of the raster. Their sums stay in registers until all rows of
samples have been added. Numba does not vectorise these loops. Here they are written in LLVM's intermediate
representation, for any type of samples; LLVM selects the instructions of the processor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import llvmlite.binding
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

ROWS = 4
"""Number of rows of the raster that are summed together."""

RANGES = [(first, last) for first in range(ROWS) for last in range(first, ROWS)]
"""The (first, last) of these rows that a row of samples can reach. Rows are listed range by range."""


def _wide_registers() -> bool:
    try:
        return bool(llvmlite.binding.get_host_cpu_features().get("avx512f"))
    except RuntimeError:  # a processor unknown to LLVM: narrow vectors run everywhere
        return False


LANES, VECTORS = (16, 4) if _wide_registers() else (8, 2)
"""Numbers in a vector, and vectors along a row: the sums of four rows take half of the registers."""
RUN = LANES * VECTORS
"""Sample values of a row that `add_rows` adds at a time."""
RUN_OF_THREES = 3 * LANES
"""The same with masks and three channels: whole pixels."""
SHORTEST = max(RUN, RUN_OF_THREES)
"""Least length of rows; shorter rows are padded with zeros."""

WIDE = ir.VectorType(ir.FloatType(), LANES)
PLACE, NUMBER = ir.IntType(64), ir.IntType(32)
FLAGS = ["contract"]


def aligned_buffer(*shape: int) -> NDArray[np.float32]:
    """An array that begins at a multiple of a vector's size. A vector that crosses two cache lines takes twice as
    long to read, and NumPy's arrays may begin anywhere.
    """
    size = math.prod(shape)
    wide = np.empty(size + LANES, dtype=np.float32)
    start = -wide.ctypes.data // wide.itemsize % LANES
    return wide[start : start + size].reshape(shape)


def data_of(context: Any, builder: Any, signature: Any, arguments: Any, number: int) -> Any:
    """The data of an argument that is an array."""
    return context.make_array(signature.args[number])(context, builder, arguments[number]).data


def constant(number: int) -> Any:
    """An offset or a count as a constant."""
    return ir.Constant(PLACE, number)


def everywhere(builder: Any, scalar: Any, lanes: int = LANES) -> Any:
    """A vector with a scalar in all lanes."""
    empty = ir.Constant(ir.VectorType(scalar.type, lanes), ir.Undefined)
    first = builder.insert_element(empty, scalar, ir.Constant(NUMBER, 0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(NUMBER, lanes), [0] * lanes))


def floats(builder: Any, pointer: Any, lanes: int = LANES) -> Any:
    """Load a vector of float32 from memory."""
    return builder.load(builder.bitcast(pointer, ir.VectorType(ir.FloatType(), lanes).as_pointer()), align=4)


def samples_at(context: Any, builder: Any, pointer: Any, kind: Any, lanes: int = LANES) -> Any:
    """Load a vector of samples of any type from memory, as float32."""
    run, wide = ir.VectorType(context.get_value_type(kind), lanes), ir.VectorType(ir.FloatType(), lanes)
    samples = builder.load(builder.bitcast(pointer, run.as_pointer()), align=kind.bitwidth // 8)
    if isinstance(kind, types.Integer):
        if kind.signed:
            return builder.sitofp(samples, wide)
        if kind.bitwidth < 32:  # with the sign bit clear: the cheap conversion
            return builder.sitofp(builder.zext(samples, ir.VectorType(NUMBER, lanes)), wide)
        return builder.uitofp(samples, wide)
    return builder.fptrunc(samples, wide) if kind.bitwidth == 64 else samples


def plus(builder: Any, total: Any, weight: Any, values: Any) -> Any:
    """total + weight · values."""
    return builder.fadd(total, builder.fmul(weight, values, flags=FLAGS), flags=FLAGS)


def keep(builder: Any, vector: Any, data: Any, place: Any) -> None:
    """Store a vector of float32 in memory."""
    builder.store(vector, builder.bitcast(builder.gep(data, [place]), WIDE.as_pointer()), align=4)


def zeros(builder: Any, rows: int, vectors: int) -> list[list[Any]]:
    """Rows of vectors that sums are kept in, 0 to begin with."""
    totals = [[cgutils.alloca_once(builder, WIDE) for _ in range(vectors)] for _ in range(rows)]
    for total in (total for row in totals for total in row):
        builder.store(ir.Constant(WIDE, [0.0] * LANES), total)
    return totals


def add_behind(builder: Any, vectors: Sequence[Any], out: Any, begin: Any, skipped: Any) -> None:
    """out[begin …] += vectors, except for the first ``skipped`` values."""
    skipped = everywhere(builder, skipped)
    for k, vector in enumerate(vectors):
        place = builder.add(begin, constant(k * LANES))
        lanes = ir.Constant(ir.VectorType(PLACE, LANES), [k * LANES + lane for lane in range(LANES)])
        dark = ir.Constant(WIDE, [0.0] * LANES)
        fresh = builder.select(builder.icmp_signed(">=", lanes, skipped), vector, dark)
        keep(builder, builder.fadd(floats(builder, builder.gep(out, [place])), fresh, flags=FLAGS), out, place)


class _Masks:
    """The product of the masks' weights along a row of samples, vector by vector.

    A mask's weight is a spline of three of its lines, which were sampled at the columns of the samples.
    """

    def __init__(self, context: Any, builder: Any, kinds: Any, masks: Any, repeat: int) -> None:
        lines, places, shares = _arrays(context, builder, kinds, masks)
        self.builder, self.repeat = builder, repeat
        self.lines, self.places, self.shares = lines.data, places.data, shares.data
        self.count = cgutils.unpack_tuple(builder, shares.shape)[1]
        self.narrow = 1 if repeat == 3 else VECTORS
        self.weights = [cgutils.alloca_once(builder, WIDE) for _ in range(self.narrow)]

    def along(self, entry: Any, x: Any) -> list[Any]:
        """Weights of row ``entry`` of the list from sample value ``x`` on, one vector per vector of samples."""
        builder = self.builder
        if self.repeat == 3:
            x = builder.udiv(x, constant(3))
        for weight in self.weights:
            builder.store(ir.Constant(WIDE, [1.0] * LANES), weight)
        first = builder.mul(entry, self.count)
        with cgutils.for_range(builder, self.count, intp=PLACE) as loop:
            at = builder.mul(builder.add(first, loop.index), constant(3))
            shares, lines = [], []
            for n in range(3):
                here = builder.add(at, constant(n))
                shares.append(everywhere(builder, builder.load(builder.gep(self.shares, [here]))))
                begin = builder.load(builder.gep(self.places, [here]))
                lines.append(builder.gep(self.lines, [builder.add(begin, x)]))
            for k, weight in enumerate(self.weights):
                above, level, below = (floats(builder, builder.gep(line, [constant(k * LANES)])) for line in lines)
                mean = builder.fmul(shares[0], above, flags=FLAGS)
                mean = plus(builder, plus(builder, mean, shares[1], level), shares[2], below)
                builder.store(builder.fmul(builder.load(weight), mean, flags=FLAGS), weight)
        weights = [builder.load(weight) for weight in self.weights]
        if self.repeat == 3:  # one weight for the three channels of a pixel
            one = weights[0]
            indices = [[(k * LANES + lane) // 3 for lane in range(LANES)] for k in range(3)]
            threes = [ir.Constant(ir.VectorType(NUMBER, LANES), index) for index in indices]
            weights = [builder.shuffle_vector(one, one, three) for three in threes]
        return weights


def _arrays(context: Any, builder: Any, kinds: Any, arrays: Any) -> list[Any]:
    """The arrays of a named tuple."""
    parts = cgutils.unpack_tuple(builder, arrays)
    return [context.make_array(kind)(context, builder, part) for kind, part in zip(kinds, parts, strict=True)]


def _rows_adder(vectors: int, repeat: int | None = None) -> Any:
    @intrinsic
    def add_rows(typing_context, values, entries, masks, x, skip, sums, line):  # type: ignore[no-untyped-def]
        """sums[line + r, x : x + RUN] += Σ shares[e, r] · values[places[e] + x : … + RUN], for r = 0 … 3.

        With masks, each sample is multiplied by its weight; ``RUN_OF_THREES`` sample values are added if a
        weight applies to three channels.

        Args:
            typing_context: Numba's.
            values: samples of any type, flat.
            entries: `vcc.engines.footprint_tables.Entries`.
            masks: `vcc.engines.footprint_tables.EntryMasks`, or None for `add_rows`.
            x: int64, offset in the rows; a multiple of 3 if a weight applies to three channels.
            skip: int64, number of sample values from ``x`` on to leave out: the last run of a row may begin
                before the end of the run before it.
            sums: float32 (rows, sample values).
            line: int64, the first of the four rows.
        """
        place = types.int64
        signature = types.void(values, entries, masks, place, place, sums, place)

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            found = None
            if repeat is not None:
                found = _Masks(context, builder, signature.args[2], arguments[2], repeat)
            return _add_rows(context, builder, signature, arguments, vectors, found)

        return signature, generate

    return add_rows


def _add_rows(
    context: Any, builder: Any, signature: Any, arguments: Sequence[Any], vectors: int, masks: _Masks | None
) -> Any:
    """The body of `add_rows` and its variants; arguments: see there."""
    values, entries, _, x, skip, sums, line = arguments
    totals = _totals(context, builder, signature, (values, entries, x), vectors, masks)
    sums, pitch = _plane(context, builder, signature.args[5], sums)
    for row, total in enumerate(totals):
        begin = builder.add(builder.mul(builder.add(line, constant(row)), pitch), x)
        add_behind(builder, total, sums, begin, skip)
    return context.get_dummy_value()


def _plane(context: Any, builder: Any, kind: Any, array: Any) -> tuple[Any, Any]:
    """The data of an array (rows, values), and the number of values in a row."""
    made = context.make_array(kind)(context, builder, array)
    return made.data, cgutils.unpack_tuple(builder, made.shape)[1]


def _totals(
    context: Any, builder: Any, signature: Any, arguments: Sequence[Any], vectors: int, masks: _Masks | None
) -> list[list[Any]]:
    """Σ shares[e, r] · values[places[e] + x …] for four rows r, vector by vector.

    signature: its first two arguments are values and entries. arguments: values, entries and x.
    """
    values, entries, x = arguments
    values = context.make_array(signature.args[0])(context, builder, values).data
    order, ends, places, shares = (each.data for each in _arrays(context, builder, signature.args[1], entries))
    totals = zeros(builder, ROWS, vectors)
    start = constant(0)
    for number, (upper, lower) in enumerate(RANGES):
        stop = builder.load(builder.gep(ends, [constant(number)]))
        with cgutils.for_range_slice(builder, start, stop, constant(1), PLACE) as (index, _):
            entry = builder.load(builder.gep(order, [index]))
            begin = builder.add(builder.load(builder.gep(places, [entry])), x)
            weights = None if masks is None else masks.along(entry, x)
            share = {}
            for row in range(upper, lower + 1):
                at = builder.add(builder.mul(entry, constant(ROWS)), constant(row))
                share[row] = everywhere(builder, builder.load(builder.gep(shares, [at])))
            for k in range(vectors):
                pointer = builder.gep(values, [builder.add(begin, constant(k * LANES))])
                samples = samples_at(context, builder, pointer, signature.args[0].dtype)
                if weights is not None:
                    samples = builder.fmul(samples, weights[k], flags=FLAGS)
                for row, each in share.items():
                    total = totals[row][k]
                    builder.store(plus(builder, builder.load(total), each, samples), total)
        start = stop
    return [[builder.load(total) for total in row] for row in totals]


def _whole_rows(vectors: int, repeat: int | None = None, apart: bool = False) -> Any:
    run = vectors * LANES

    @intrinsic
    def sum_whole_rows(typing_context, values, entries, masks, sums, to, length):  # type: ignore[no-untyped-def]
        """sums[r, to + x] = Σ shares[e, r] · values[places[e] + x], for r = 0 … 3 and all x of a row.

        If ``apart``, each run of ``RUN_OF_THREES`` values has the sums of the first channel of its pixels, then
        those of the second and the third channel. Runs are written one after the other; the last run may be read
        from an earlier place, so as to end with the row.

        Args:
            typing_context: Numba's.
            values: samples of any type, flat.
            entries: `vcc.engines.footprint_tables.Entries`.
            masks: `vcc.engines.footprint_tables.EntryMasks`, or None.
            sums: float32 (rows, sample values), overwritten.
            to: int64, offset from the beginning of the first of the four rows.
            length: int64, number of values to sum, at least one run.
        """
        signature = types.void(values, entries, masks, sums, types.int64, types.int64)

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            values, entries, masks, sums, to, length = arguments
            weighed = None
            if repeat is not None:
                weighed = _Masks(context, builder, signature.args[2], masks, repeat)
            sums, pitch = _plane(context, builder, signature.args[3], sums)
            last = builder.sub(length, constant(run))
            with cgutils.for_range_slice(builder, constant(0), length, constant(run), PLACE) as (x, _):
                here = builder.select(builder.icmp_signed("<", x, last), x, last)
                totals = _totals(context, builder, signature, (values, entries, here), vectors, weighed)
                for row, total in enumerate(totals):
                    written = parted(builder, total) if apart else total
                    begin = builder.add(builder.add(to, builder.mul(constant(row), pitch)), x if apart else here)
                    for k, each in enumerate(written):
                        keep(builder, each, sums, builder.add(begin, constant(k * LANES)))
            return context.get_dummy_value()

        return signature, generate

    return sum_whole_rows


def _picked(builder: Any, three: Sequence[Any], lanes: Sequence[int]) -> Any:
    """A vector of some lanes of three vectors, numbered across them."""
    first = [lane if lane < 2 * LANES else 0 for lane in lanes]
    second = [n if lane < 2 * LANES else lane - LANES for n, lane in enumerate(lanes)]
    kind = ir.VectorType(NUMBER, LANES)
    of_two = builder.shuffle_vector(three[0], three[1], ir.Constant(kind, first))
    return builder.shuffle_vector(of_two, three[2], ir.Constant(kind, second))


def parted(builder: Any, three: Sequence[Any]) -> list[Any]:
    """Split pixels of three channels into one vector per channel."""
    return [_picked(builder, three, [3 * n + c for n in range(LANES)]) for c in range(3)]


def joined(builder: Any, three: Sequence[Any]) -> list[Any]:
    """Interleave three channels into pixels: the inverse of `parted`."""
    places = [(i % 3) * LANES + i // 3 for i in range(3 * LANES)]
    return [_picked(builder, three, places[k * LANES : (k + 1) * LANES]) for k in range(3)]


add_rows = _rows_adder(VECTORS)
add_masked_rows = _rows_adder(VECTORS, repeat=1)
add_masked_rows_of_threes = _rows_adder(3, repeat=3)
sum_whole_rows = _whole_rows(VECTORS)
sum_masked_whole_rows = _whole_rows(VECTORS, repeat=1)
sum_masked_whole_rows_of_threes = _whole_rows(3, repeat=3)
part_whole_rows = _whole_rows(3, apart=True)
part_masked_whole_rows = _whole_rows(3, repeat=3, apart=True)


def _fetching(locality: int) -> Any:
    @intrinsic
    def fetch(typing_context, values, place):  # type: ignore[no-untyped-def]
        """Prefetch the cache line of ``values[place]``; the place may be out of bounds."""
        signature = types.void(values, types.int64)

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            data = data_of(context, builder, signature, arguments, 0)
            byte = ir.IntType(8).as_pointer()
            kind = ir.FunctionType(ir.VoidType(), [byte, NUMBER, NUMBER, NUMBER])
            prefetch = builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
            hints = [ir.Constant(NUMBER, hint) for hint in (0, locality, 1)]  # read access; data
            builder.call(prefetch, [builder.bitcast(builder.gep(data, [arguments[1]]), byte), *hints])
            return context.get_dummy_value()

        return signature, generate

    return fetch


fetch = _fetching(2)
"""Into the second-level cache."""
fetch_close = _fetching(3)
"""Into all levels of the cache."""


EIGHT = 8
"""Number of raster rows that `mix_eight` mixes together, next to each other in memory."""


@intrinsic
def mix_eight(typing_context, sums, place, step, shares, row, out, to):  # type: ignore[no-untyped-def]
    """out[to : to + 8] += Σ shares[row, t] · sums[place + t · step : … + 8].

    Args:
        typing_context: Numba's.
        sums: float32, flat.
        place: int64.
        step: int64.
        shares: float32 (rows, width).
        row: int64.
        out: float32, flat.
        to: int64.
    """
    signature = types.void(sums, types.int64, types.int64, shares, types.int64, out, types.int64)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        sums, out = (data_of(context, builder, signature, arguments, n) for n in (0, 5))
        place, step, row, to = (arguments[n] for n in (1, 2, 4, 6))
        shares, width = _plane(context, builder, signature.args[3], arguments[3])
        wide = ir.VectorType(ir.FloatType(), EIGHT)
        here = builder.bitcast(builder.gep(out, [to]), wide.as_pointer())
        total = cgutils.alloca_once(builder, wide)
        builder.store(builder.load(here, align=4), total)
        first = builder.gep(shares, [builder.mul(row, width)])
        with cgutils.for_range(builder, width, intp=PLACE) as loop:
            share = everywhere(builder, builder.load(builder.gep(first, [loop.index])), EIGHT)
            begin = builder.add(place, builder.mul(loop.index, step))
            run = floats(builder, builder.gep(sums, [begin]), EIGHT)
            builder.store(plus(builder, builder.load(total), share, run), total)
        builder.store(builder.load(total), here, align=4)
        return context.get_dummy_value()

    return signature, generate
