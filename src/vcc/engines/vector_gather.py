"""Sum the samples of a ray in four views with vector instructions.

A ray interpolates between 2×2 views, and in each view between 2×2 pixels. The two pixels of a row are neighbours
in memory, with all channels, so one vector load reads both. Numba does not vectorise such short runs. Here they
are written in LLVM's intermediate representation, for one, three and four channels and any sample type.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from vcc.engines.vector_sums import FLAGS, NUMBER, data_of, everywhere, plus, samples_at

LANES = 8
"""Numbers in a sum: first the channels of the left pixel, then those of the right one."""


def _add_views(channels: int) -> Any:
    """The intrinsic for a number of channels: sums[at : at + 8] += the interpolated values of four views."""
    lanes = 2 if channels == 1 else LANES

    @intrinsic
    def add_views(typing_context, values, corners, line, rows, columns, sums, at):  # type: ignore[no-untyped-def]
        """Interpolate 2×2 pixels in each of 2×2 views at the place of a ray.

        Views of one row read the same rows of pixels, views of one column the same columns: the weight of a
        sample is the weight of its row times that of its column.

        Args:
            typing_context: Numba's.
            values: flat samples; ``LANES`` of them must be readable from every place read.
            corners: (4,) where the upper left pixel begins in the upper left, upper right, lower left and lower
                right view.
            line: samples in a row of pixels.
            rows: (4,) float32, weights of the upper and the lower row of pixels in the upper views, and in the
                lower views.
            columns: (4,) float32, weights of the left and the right column of pixels in the left views, and in
                the right views.
            sums: contiguous float32.
            at: offset of the eight numbers in ``sums``.
        """
        place, weights = types.int64, types.UniTuple(types.float32, 4)
        signature = types.void(values, types.UniTuple(place, 4), place, weights, weights, sums, place)

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            data, kept = (data_of(context, builder, signature, arguments, n) for n in (0, 5))
            corners, rows, columns = (cgutils.unpack_tuple(builder, arguments[n]) for n in (1, 3, 4))
            line, wide = arguments[2], ir.VectorType(ir.FloatType(), lanes)

            def weighed(total: Any, weight: Any, offset: Any) -> Any:
                run = samples_at(context, builder, builder.gep(data, [offset]), values.dtype, lanes)
                return (
                    builder.fmul(weight, run, flags=FLAGS) if total is None else plus(builder, total, weight, run)
                )

            rows = [everywhere(builder, weight, lanes) for weight in rows]
            left_or_right = ir.Constant(
                ir.VectorType(NUMBER, lanes),
                [lane if lane < channels else lanes + lane for lane in range(lanes)],
            )
            place = builder.bitcast(builder.gep(kept, [arguments[6]]), wide.as_pointer())
            total = builder.load(place, align=4)
            for column in range(2):
                found = None
                for row in range(2):
                    offset = corners[2 * row + column]
                    found = weighed(found, rows[2 * row], offset)
                    found = weighed(found, rows[2 * row + 1], builder.add(offset, line))
                sides = (everywhere(builder, weight, lanes) for weight in columns[2 * column : 2 * column + 2])
                total = plus(builder, total, builder.shuffle_vector(*sides, left_or_right), found)
            builder.store(total, place, align=4)
            return context.get_dummy_value()

        return signature, generate

    return add_views


add_views_of_1 = _add_views(1)
add_views_of_3 = _add_views(3)
add_views_of_4 = _add_views(4)


# --- the transpose: add the gradient of a ray to samples of four views ---


def _spread_views(channels: int) -> Any:
    """The intrinsic for a number of channels: values of four views += gradients of a pixel."""
    lanes = 2 * channels

    @intrinsic
    def spread_views(typing_context, values, corners, line, rows, columns, weights, pixel):  # type: ignore[no-untyped-def]
        """Add a pixel's gradient to 2×2 pixels of 2×2 views; the transpose of `add_views`.

        Nothing else is written: other threads may write to neighbouring samples.

        Args:
            typing_context: Numba's.
            values: flat float32 or float64, to add to.
            corners: (4,) where the upper left pixel begins in the upper left, upper right, lower left and lower
                right view.
            line: samples in a row of pixels.
            rows: (4,) float32, weights of the upper and the lower row of pixels in the upper views, and in the
                lower views.
            columns: (4,) float32, weights of the left and the right column of pixels in the left views, and in
                the right views.
            weights: flat float32.
            pixel: where the pixel's weights begin in ``weights``, one for each channel.
        """
        place, four = types.int64, types.UniTuple(types.float32, 4)
        signature = types.void(values, types.UniTuple(place, 4), place, four, four, weights, place)

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            data, given = (data_of(context, builder, signature, arguments, n) for n in (0, 5))
            corners, rows, columns = (cgutils.unpack_tuple(builder, arguments[n]) for n in (1, 3, 4))
            line, pixel = arguments[2], arguments[6]
            wide = ir.VectorType(ir.FloatType(), lanes)
            kept = ir.VectorType(context.get_value_type(values.dtype), lanes)

            def lined_up(scalars: list[Any]) -> Any:
                vector = ir.Constant(wide, ir.Undefined)
                for lane, scalar in enumerate(scalars):
                    vector = builder.insert_element(vector, scalar, ir.Constant(NUMBER, lane))
                return vector

            carried = [
                builder.load(builder.gep(given, [builder.add(pixel, ir.Constant(pixel.type, channel))]))
                for channel in range(channels)
            ]
            both = lined_up(carried + carried)

            def add_at(offset: Any, share: Any) -> None:
                to = builder.bitcast(builder.gep(data, [offset]), kept.as_pointer())
                share = builder.fpext(share, kept) if values.dtype.bitwidth == 64 else share
                total = builder.fadd(builder.load(to, align=values.dtype.bitwidth // 8), share, flags=FLAGS)
                builder.store(total, to, align=values.dtype.bitwidth // 8)

            for column in range(2):
                left, right = columns[2 * column : 2 * column + 2]
                across = builder.fmul(lined_up([left] * channels + [right] * channels), both)
                for row in range(2):
                    above = corners[2 * row + column]
                    upper, lower = (lined_up([weight] * lanes) for weight in rows[2 * row : 2 * row + 2])
                    add_at(above, builder.fmul(upper, across, flags=FLAGS))
                    add_at(builder.add(above, line), builder.fmul(lower, across, flags=FLAGS))
            return context.get_dummy_value()

        return signature, generate

    return spread_views


spread_views_of_1 = _spread_views(1)
spread_views_of_3 = _spread_views(3)
spread_views_of_4 = _spread_views(4)
