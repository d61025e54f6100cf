"""Looking up a grid between its points, for all compiled kernels but `ray_kernels.add_view`, in single precision.

Inlined before compiling: an array that is handed on has its references counted, by all threads at once.
"""

from __future__ import annotations

from vcc.engines.compiled import compiled

_inlined = compiled(inline="always")


@_inlined
def around(place, size):  # type: ignore[no-untyped-def]
    """(first point, next point, way from the one to the other) of a place on points 0 … size − 1; ends go on."""
    place = min(max(place, 0.0), size - 1.0)
    first = min(int(place), max(size - 2, 0))
    return first, min(first + 1, size - 1), place - first


@_inlined
def bilinear(above, above_next, below, below_next, right, down):  # type: ignore[no-untyped-def]
    """What lies between four points, 0 … 1 of the way to the right and down."""
    upper = above * (1 - right) + above_next * right
    lower = below * (1 - right) + below_next * right
    return upper * (1 - down) + lower * down
