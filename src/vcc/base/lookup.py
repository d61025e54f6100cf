"""Numbers between the points of a grid."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray


def bilinear(
    values: NDArray[Any], row: ArrayLike, column: ArrayLike, outside: Literal["edge", "zero"] = "edge"
) -> NDArray[Any]:
    """What stands between the points of a grid, linear along rows and along columns.

    Args:
        values: at whole numbers of rows and columns, shape (rows, columns, ...): one number or several at a point.
        row: places in numbers of rows, fractions between them; broadcast with ``column`` to a shape S.
        column: likewise in numbers of columns.
        outside: beyond the outermost points values stay as they are there (``"edge"``), or fall to 0 within one
            row or column (``"zero"``).

    Returns:
        Shape (*S, ...), of the type that floating-point weights give the values.
    """
    down, across = np.broadcast_arrays(np.asarray(row), np.asarray(column))
    if outside == "zero":
        values = np.pad(values, [(1, 1), (1, 1), *[(0, 0)] * (values.ndim - 2)])
        down, across = down + 1, across + 1
    top, bottom, below = _around(down, values.shape[0])
    left, right, beyond = _around(across, values.shape[1])
    many = (..., *[None] * (values.ndim - 2))
    below, beyond = below[many], beyond[many]
    upper = values[top, left] * (1 - beyond) + values[top, right] * beyond
    lower = values[bottom, left] * (1 - beyond) + values[bottom, right] * beyond
    return np.asarray(upper * (1 - below) + lower * below)


def _around(place: NDArray[Any], count: int) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[Any]]:
    """The points before and after places, held within the grid, and the share of the latter."""
    held = np.clip(place, 0, count - 1)
    before = np.minimum(held.astype(np.intp), max(count - 2, 0))
    return before, np.minimum(before + 1, count - 1), held - before
