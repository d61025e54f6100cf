"""Arrays of views in one row or in a grid, and checks for values that are not radiance.

Also the reverse: the samples of a light field as NumPy arrays, for files.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError, warn_of_result
from vcc.fields.grid import Block
from vcc.fields.sampled import to_numpy
from vcc.fields.samples import Samples

NARROWEST = 16
"""Pixels: an array (n, a, b, 3) with a and b at least this large is more likely n images in colour."""
FEWEST_CODES = 16
"""Number of different integers in a view above which they look like 8-bit codes."""


def in_grid(values: Any, shape: tuple[int, ...], grid: tuple[int, int] | None, channels: bool | None) -> Any:
    """Views as (v, u, t, s[, channel]).

    Args:
        values: an array of any library.
        shape: of the array.
        grid: (rows, columns) of views that are stored along one axis, row by row; None if they are in a grid.
        channels: whether the last axis is one of channels; None infers it from the shape.

    Raises:
        InputError: a grid or channels that do not fit; an ambiguous array with four axes.
    """
    if grid is not None:
        if not isinstance(grid, tuple | list) or [isinstance(n, int | np.integer) for n in grid] != [True, True]:  # type: ignore[redundant-expr]
            raise InputError(f"grid is two whole numbers, (rows, columns) of views, not {grid!r}")
        rows, columns = grid
        fits = {3: (None, False), 4: (None, True)}.get(len(shape), ())
        if channels not in fits or rows < 1 or columns < 1 or shape[0] != rows * columns:
            raise InputError(
                f"with grid={rows, columns}, values are {rows}×{columns} = {rows * columns} views along one axis, "
                f"(views, rows of pixels, columns of pixels[, channels]), not the shape {shape}"
            )
        new = (rows, columns, *shape[1:])
        if hasattr(values, "reshape"):
            return values.reshape(new)
        return values.__array_namespace__().reshape(values, new)
    if channels is not None and len(shape) == 4 + (not channels):
        raise InputError(
            f"values of the shape {shape} have {'no' if channels else 'an'} axis of channels behind (v, u, t, s)"
            + ("; for views along one axis give grid=(rows, columns)" if channels else "")
        )
    if (
        channels is None
        and len(shape) == 4
        and shape[0] > 1
        and min(shape[1:3]) >= NARROWEST
        and shape[3] in (3, 4)
    ):
        n, side = shape[0], math.isqrt(shape[0])
        likely = (side, side) if side * side == n else (1, n)
        raise InputError(
            f"values of the shape {shape} are {n}×{shape[1]} views of {shape[2]}×{shape[3]} pixels, or {n} "
            f"pictures of {shape[3]} channels: say grid=(rows, columns), such as grid={likely}, for pictures, or "
            f"channels=False for views {shape[3]} pixels wide"
        )
    return values


def warn_of_codes(values: Any) -> None:
    """Warn if floating-point samples look like 8-bit codes, judging by the middle view.

    Warns:
        ResultWarning: its samples are integers up to 255, many of them different.
    """
    if not isinstance(values, np.ndarray) or values.dtype.kind != "f" or values.ndim < 4 or 0 in values.shape:
        return
    view = values[values.shape[0] // 2, values.shape[1] // 2]
    if not 1.5 < view.max() <= 255 or (view != np.round(view)).any() or len(np.unique(view)) < FEWEST_CODES:
        return
    warn_of_result(
        f"the samples are {values.dtype} and whole numbers up to {view.max():g} (in the middle view), as 8-bit "
        "codes are: taken as radiance, pictures are up to 255 times as bright. Divide by 255, or give uint8, "
        "which is taken as fractions of 255"
    )


# --- the samples of a light field, in memory or not, as NumPy arrays for writing files ---


def all_samples(light_field: Samples) -> NDArray[Any]:
    """All samples, (v, u, t, s[, channels]), read now if they are not in memory.

    Raises:
        InputError: they cannot be read.
    """
    whole = light_field.whole()
    return to_numpy(light_field.read(Block.all_of(light_field.grid.shape)) if whole is None else whole)


def one_view(light_field: Samples, row: int, column: int) -> NDArray[Any]:
    """The samples of one view, (t, s[, channels]); no other view is read.

    Args:
        light_field: of the view.
        row: of views, 0 at the top.
        column: of views, 0 at the left.

    Raises:
        InputError: they cannot be read.
    """
    height, width = light_field.grid.shape[2:4]
    view = Block((row, row + 1), (column, column + 1), (0, height), (0, width))
    samples: NDArray[Any] = to_numpy(light_field.read(view))[0, 0]
    return samples
