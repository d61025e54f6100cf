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
            Several are looked up fastest where each is a plane in memory (`numpy.moveaxis` of planes).
        row: places in numbers of rows, fractions between them; broadcast with ``column`` to a shape S.
        column: likewise in numbers of columns.
        outside: beyond the outermost points values stay as they are there (``"edge"``), or fall to 0 within one
            row or column (``"zero"``).

    Returns:
        Shape (*S, ...): float32 for values of float32 and small integers, else float64.
    """
    from scipy.ndimage import map_coordinates

    mode, beyond = ("nearest", 0) if outside == "edge" else ("grid-constant", 1)
    rows, columns = values.shape[:2]
    down, across = np.broadcast_arrays(
        np.clip(row, -beyond, rows - 1 + beyond), np.clip(column, -beyond, columns - 1 + beyond)
    )
    places = [down.ravel(), across.ravel()]
    maps = np.moveaxis(values.reshape(rows, columns, -1), 2, 0)
    found = np.empty((len(maps), down.size), np.result_type(values.dtype, np.float32))
    for each, out in zip(maps, found, strict=True):
        map_coordinates(each, places, out, order=1, mode=mode)
    return found.T.reshape((*down.shape, *values.shape[2:]))
