"""Products of rows of samples and rows of weights, as vector instructions: `vcc.engines.vector_sums` transposed.

All arrays are flat and float32, except samples, which have any type; offsets are int64. The length of rows is a
multiple of ``LANES``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from vcc.engines.vector_sums import (
    FLAGS,
    LANES,
    NUMBER,
    PLACE,
    constant,
    data_of,
    everywhere,
    floats,
    keep,
    parted,
    plus,
    samples_at,
    zeros,
)


def _run(builder: Any, data: Any, place: Any) -> Any:
    return floats(builder, builder.gep(data, [place]))


def _along(builder: Any, start: Any, length: Any, step: int, body: Callable[[Any], None]) -> None:
    """Run ``body`` for each place from ``start`` to before ``length``, in steps."""
    with cgutils.for_range_slice(builder, start, length, constant(step), PLACE) as (x, _):
        body(x)


def _four_rows(fresh: bool, last: bool = False, channels: int = 1) -> Any:
    @intrinsic
    def four_rows(typing_context, planes, place, step, shares, values, at, length, out):  # type: ignore[no-untyped-def]
        """out[x] = Σ shares[t] · planes[place + t · step + x] over four rows t, or added to ``out``.

        For more than four rows, the last four also multiply the sum by samples. With three channels they add
        these up, into out[x / 3].

        Args:
            typing_context: Numba's.
            planes: rows of weights.
            place: where the first row begins.
            step: offset from a row to the next.
            shares: four float32.
            values: samples.
            at: where their row begins.
            length: number of values.
            out: the result. With three channels, out[x / 3] is written after out[x] has been read.
        """
        place_kind, four = types.int64, types.UniTuple(types.float32, 4)
        signature = types.void(planes, place_kind, place_kind, four, values, place_kind, place_kind, out)

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            rows, samples, to = (data_of(context, builder, signature, arguments, n) for n in (0, 4, 7))
            _, begin, step, shares, _, at, length, _ = arguments
            counts = [everywhere(builder, each) for each in cgutils.unpack_tuple(builder, shares)]
            begins = [builder.add(begin, builder.mul(constant(t), step)) for t in range(4)]

            def mixed(x: Any) -> Any:
                runs = [_run(builder, rows, builder.add(each, x)) for each in begins]
                total = builder.fmul(counts[0], runs[0], flags=FLAGS)
                for count, run in zip(counts[1:], runs[1:], strict=True):
                    total = plus(builder, total, count, run)
                if not fresh:
                    total = builder.fadd(total, _run(builder, to, x), flags=FLAGS)
                if last:
                    here = builder.gep(samples, [builder.add(at, x)])
                    sample = samples_at(context, builder, here, signature.args[4].dtype)
                    total = builder.fmul(total, sample, flags=FLAGS)
                return total

            def mix(x: Any) -> None:
                runs = [mixed(builder.add(x, constant(n * LANES))) for n in range(channels)]
                if channels == 3:
                    one, two, three = parted(builder, runs)
                    both = builder.fadd(one, two, flags=FLAGS)
                    keep(builder, builder.fadd(both, three, flags=FLAGS), to, builder.udiv(x, constant(3)))
                else:
                    keep(builder, runs[0], to, x)

            _along(builder, constant(0), length, channels * LANES, mix)
            return context.get_dummy_value()

        return signature, generate

    return four_rows


first_four_rows = _four_rows(fresh=True)
more_four_rows = _four_rows(fresh=False)
last_four_rows = _four_rows(fresh=False, last=True)
only_four_rows = _four_rows(fresh=True, last=True)
last_four_rows_of_threes = _four_rows(fresh=False, last=True, channels=3)
only_four_rows_of_threes = _four_rows(fresh=True, last=True, channels=3)


@intrinsic
def four_dots(typing_context, values, planes, place, step, length):  # type: ignore[no-untyped-def]
    """Σ values[x] · planes[place + t · step + x] for four rows t; see `_four_rows`."""
    signature = types.UniTuple(types.float32, 4)(values, planes, types.int64, types.int64, types.int64)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        run, rows = (data_of(context, builder, signature, arguments, n) for n in (0, 1))
        _, _, begin, step, length = arguments
        begins = [builder.add(begin, builder.mul(constant(t), step)) for t in range(4)]
        # Two vectors at a time: each addition to a sum waits for the one before it.
        totals = zeros(builder, 2, 4)

        def add(vectors: int) -> Callable[[Any], None]:
            def dots(x: Any) -> None:
                for n in range(vectors):
                    here = builder.add(x, constant(n * LANES))
                    value = _run(builder, run, here)
                    for t, each in enumerate(begins):
                        found = _run(builder, rows, builder.add(each, here))
                        total = totals[n][t]
                        builder.store(plus(builder, builder.load(total), value, found), total)

            return dots

        pairs = builder.and_(length, constant(-2 * LANES))
        _along(builder, constant(0), pairs, 2 * LANES, add(2))
        _along(builder, pairs, length, LANES, add(1))
        sums = []
        for t in range(4):
            total = builder.fadd(builder.load(totals[0][t]), builder.load(totals[1][t]))
            lanes = LANES
            while lanes > 1:  # add halves
                lanes //= 2
                halves = [
                    builder.shuffle_vector(
                        total, total, ir.Constant(ir.VectorType(NUMBER, lanes), list(range(n, n + lanes)))
                    )
                    for n in (0, lanes)
                ]
                total = builder.fadd(*halves)
            sums.append(builder.extract_element(total, ir.Constant(NUMBER, 0)))
        return context.make_tuple(builder, signature.return_type, sums)

    return signature, generate


def _weighed(repeat: int) -> Any:
    @intrinsic
    def weigh(typing_context, values, at, weights, length, out):  # type: ignore[no-untyped-def]
        """out[k · channels + c] = values[at + k · channels + c] · weights[k], for one channel or three.

        Args:
            typing_context: Numba's.
            values: samples.
            at: where their row begins.
            weights: one per sample.
            length: number of weights.
            out: the result.
        """
        signature = types.void(values, types.int64, weights, types.int64, out)

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            samples, light, to = (data_of(context, builder, signature, arguments, n) for n in (0, 2, 4))
            _, at, _, length, _ = arguments

            def weigh(k: Any) -> None:
                one = _run(builder, light, k)
                x = builder.mul(k, constant(repeat))
                for n in range(repeat):
                    here = builder.add(x, constant(n * LANES))
                    index = [(n * LANES + lane) // repeat for lane in range(LANES)]
                    weight = builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(NUMBER, LANES), index))
                    place = builder.gep(samples, [builder.add(at, here)])
                    sample = samples_at(context, builder, place, signature.args[0].dtype)
                    keep(builder, builder.fmul(sample, weight, flags=FLAGS), to, here)

            _along(builder, constant(0), length, LANES, weigh)
            return context.get_dummy_value()

        return signature, generate

    return weigh


weigh_ones = _weighed(1)
weigh_threes = _weighed(3)


@intrinsic
def to_three_rows(typing_context, values, shares, places, length, out):  # type: ignore[no-untyped-def]
    """out[places[t] + x] += shares[t] · values[x] for three rows t, one after the other at each x."""
    signature = types.void(
        values, types.UniTuple(types.float32, 3), types.UniTuple(types.int64, 3), types.int64, out
    )

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        run, to = (data_of(context, builder, signature, arguments, n) for n in (0, 4))
        counts = [everywhere(builder, each) for each in cgutils.unpack_tuple(builder, arguments[1])]
        begins = cgutils.unpack_tuple(builder, arguments[2])

        def give(x: Any) -> None:
            value = _run(builder, run, x)
            for count, begin in zip(counts, begins, strict=True):
                here = builder.add(begin, x)
                keep(builder, plus(builder, _run(builder, to, here), count, value), to, here)

        _along(builder, constant(0), arguments[3], LANES, give)
        return context.get_dummy_value()

    return signature, generate
