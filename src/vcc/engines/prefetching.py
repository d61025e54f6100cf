"""Asking for memory before it is looked at, for loops that would wait for it."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

LINE = 64
"""Bytes that memory brings at a time."""


@intrinsic
def prefetch(typing_context, values, at):  # type: ignore[no-untyped-def]
    """Ask for the line of memory that holds a number of a contiguous array, in bounds or not."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        place = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [place.type, number, number, number])
        function: Any = builder.module.declare_intrinsic("llvm.prefetch", [place.type], kind)
        # to read, to be kept in all caches, data
        builder.call(function, [place, *(ir.Constant(number, n) for n in (0, 3, 1))])
        return context.get_dummy_value()

    return types.void(values, types.int64), generate
