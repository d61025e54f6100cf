"""Adding up what a ray finds, eight memory rows at a time, as vector instructions.

A ray interpolates between two by two views, and in each between two by two pixels. In memory the two pixels of
a row are neighbours, channels and all, so that one vector load brings both. Numba does not vectorise such short
runs by itself; here they are written in its intermediate language, for one, three and four channels and any
sample type.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

ROWS = 8
"""Rows of two pixels that one ray reads: two in each of four views."""
LANES = 8
"""Numbers that a sum holds; the channels of the left pixel come first, then those of the right."""


def _add_rows(channels: int) -> Any:
    """The intrinsic for a number of channels: sums[at : at + 8] += Σ over rows of weights × samples."""
    lanes = 2 if channels == 1 else LANES

    @intrinsic
    def add_rows(typing_context, values, offsets, weights, sums, at):  # type: ignore[no-untyped-def]
        """Sums of eight rows of two neighbouring pixels.

        Args:
            typing_context: Numba's.
            values: flat samples; ``LANES`` of them can be read from every offset.
            offsets: (8,) int64, where each row's left pixel begins.
            weights: (16,) float32, of the left and the right pixel of each row.
            sums: flat float32.
            at: where in ``sums`` the eight numbers stand.
        """
        signature = types.void(values, offsets, weights, sums, types.int64)

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            data = [
                context.make_array(kind)(context, builder, argument).data
                for kind, argument in zip(signature.args[:4], arguments[:4], strict=True)
            ]
            number = ir.IntType(32)
            wide = ir.VectorType(ir.FloatType(), lanes)
            sample = context.get_value_type(values.dtype)
            place = builder.gep(data[3], [arguments[4]])
            place = builder.bitcast(place, wide.as_pointer())
            total = builder.load(place, align=4)
            left_right = ir.Constant(
                ir.VectorType(number, lanes), [min(lane // channels, 1) for lane in range(lanes)]
            )
            pair = ir.VectorType(ir.FloatType(), 2)
            for row in range(ROWS):
                offset = builder.load(builder.gep(data[1], [ir.Constant(ir.IntType(64), row)]))
                run = builder.bitcast(builder.gep(data[0], [offset]), ir.VectorType(sample, lanes).as_pointer())
                run = builder.load(run, align=values.dtype.bitwidth // 8)
                if isinstance(values.dtype, types.Integer):
                    if values.dtype.bitwidth < 32:
                        run = builder.zext(run, ir.VectorType(number, lanes))
                        run = builder.sitofp(run, wide)  # 32 bits with the sign bit clear: the cheap conversion
                    else:
                        run = builder.uitofp(run, wide)
                elif values.dtype.bitwidth == 64:
                    run = builder.fptrunc(run, wide)
                weight = builder.bitcast(
                    builder.gep(data[2], [ir.Constant(ir.IntType(64), 2 * row)]), pair.as_pointer()
                )
                weight = builder.load(weight, align=4)
                weight = builder.shuffle_vector(weight, ir.Constant(pair, ir.Undefined), left_right)
                total = builder.fadd(total, builder.fmul(weight, run, flags=["contract"]), flags=["contract"])
            builder.store(total, place, align=4)
            return context.get_dummy_value()

        return signature, generate

    return add_rows


add_rows_of_1 = _add_rows(1)
add_rows_of_3 = _add_rows(3)
add_rows_of_4 = _add_rows(4)
