"""Weigh rows of sums by lines of several masks together, with vector instructions (`vcc.engines.vector_sums`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from vcc.engines.vector_sums import (
    LANES,
    PLACE,
    VECTORS,
    add_behind,
    constant,
    data_of,
    floats,
    joined,
    plus,
    zeros,
)

MASKS = 4
"""Number of masks that weigh sums together."""


def _weigher(vectors: int, parted: bool) -> Any:
    run = vectors * LANES

    @intrinsic
    def weigh_rows(typing_context, sums, pitch, count, lines, at, line, plane, out, to, step, length):  # type: ignore[no-untyped-def]
        """out[to + n · step + x] += Σ_r lines[at + n · plane + r · line + x] · sums[r · pitch + x], for all x.

        For four masks n. If ``parted``, three channels share a weight: the offset in the lines is x / 3, and
        sums are in the layout of `vcc.engines.vector_sums.part_whole_rows`.

        Args:
            typing_context: Numba's.
            sums: float32, flat.
            pitch: int64, offset from a row of sums to the next.
            count: int64, number of rows.
            lines: float32, flat.
            at: int64, where the line of row 0 begins.
            line: int64, offset from a line to the next.
            plane: int64, offset from a mask to the next.
            out: float32, flat.
            to: int64, where the first mask's values begin.
            step: int64, offset from a mask to the next.
            length: int64, number of values to weigh, at least one run.
        """
        whole = types.int64
        signature = types.void(sums, whole, whole, lines, whole, whole, whole, out, whole, whole, whole)

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            sums, lines, out = (data_of(context, builder, signature, arguments, n) for n in (0, 3, 7))
            _, pitch, count, _, at, line, plane, _, to, step, length = arguments
            last = builder.sub(length, constant(run))
            with cgutils.for_range_slice(builder, constant(0), length, constant(run), PLACE) as (x, _):
                here = builder.select(builder.icmp_signed("<", x, last), x, last)
                of_line = builder.add(at, builder.udiv(here, constant(3)) if parted else here)
                rows = (sums, x if parted else here, pitch, count), (lines, of_line, line, plane)
                skipped = builder.sub(x, here)
                for n, total in enumerate(_weighed(builder, *rows, vectors, parted)):
                    begin = builder.add(builder.add(to, builder.mul(constant(n), step)), here)
                    add_behind(builder, joined(builder, total) if parted else total, out, begin, skipped)
            return context.get_dummy_value()

        return signature, generate

    return weigh_rows


def _weighed(
    builder: Any, of_sums: Sequence[Any], of_lines: Sequence[Any], vectors: int, parted: bool
) -> list[list[Any]]:
    """One run of the weighed sums of four masks: ``vectors`` vectors for each mask.

    of_sums: (data, where the run begins, offset from a row to the next, number of rows). of_lines: (data, where
    the run begins, offset from a line to the next, offset from a mask to the next).
    """
    sums, place, pitch, count = of_sums
    lines, at, line, plane = of_lines
    totals = zeros(builder, MASKS, vectors)
    with cgutils.for_range(builder, count, intp=PLACE) as loop:
        begin = builder.add(place, builder.mul(loop.index, pitch))
        places = [builder.add(begin, constant(k * LANES)) for k in range(vectors)]
        values = [floats(builder, builder.gep(sums, [each])) for each in places]
        below = builder.add(at, builder.mul(loop.index, line))
        for n in range(MASKS):
            here = builder.add(below, builder.mul(constant(n), plane))
            different = 1 if parted else vectors
            places = [builder.add(here, constant(k * LANES)) for k in range(different)]
            weights = [floats(builder, builder.gep(lines, [each])) for each in places]
            for k, value in enumerate(values):
                total = totals[n][k]
                builder.store(plus(builder, builder.load(total), weights[k % different], value), total)
    return [[builder.load(total) for total in mask] for mask in totals]


weigh_rows = _weigher(VECTORS, parted=False)
weigh_parted_rows = _weigher(3, parted=True)
