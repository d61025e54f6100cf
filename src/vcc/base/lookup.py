"""Interpolation between the points of a grid."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def bilinear(values: NDArray[Any], row: ArrayLike, column: ArrayLike) -> NDArray[Any]:
    """Values between the points of a grid, linear along rows and along columns.

    Args:
        values: at integer rows and columns, shape (rows, columns, ...): one number or several at a point.
            Several are interpolated fastest if each is contiguous in memory (`numpy.moveaxis` of planes).
        row: places as fractional rows; broadcast with ``column`` to a shape S.
        column: likewise as fractional columns. Beyond the outermost points, values are constant.

    Returns:
        Shape (*S, ...): float32 for values of float32 and small integers, else float64.
    """
    from scipy.ndimage import map_coordinates

    rows, columns = values.shape[:2]
    down, across = np.broadcast_arrays(np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1))
    places = [down.ravel(), across.ravel()]
    maps = np.moveaxis(values.reshape(rows, columns, -1), 2, 0)
    found = np.empty((len(maps), down.size), np.result_type(values.dtype, np.float32))
    for each, out in zip(maps, found, strict=True):
        map_coordinates(each, places, out, order=1, mode="nearest")
    return found.T.reshape((*down.shape, *values.shape[2:]))


def three_around(
    place: ArrayLike, points: int
) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
    """The three points of a line that a quadratic B-spline uses at a place, with zeros beyond the line's ends.

    With c the point nearest to a place p and f = p − c, the points c − 1, c, c + 1 have the weights ½(½ − f)²,
    ¾ − f², ½(½ + f)²: their sum is 1, and the interpolated value has a continuous slope.

    Args:
        place: as a fractional number of points, shape S.
        points: number of points of the line.

    Returns:
        The points, their weights, and the derivatives of the weights to the place, each of shape (3, ...S). Points
        beyond the ends are replaced by existing ones with weight 0.
    """
    held = np.clip(np.asarray(place, dtype=np.float64), -2.0, points + 1.0)  # further out, the result is 0, too
    middle = np.floor(held + 0.5)
    f = held - middle
    point = middle.astype(np.intp) + np.arange(-1, 2).reshape(3, *(1,) * f.ndim)
    there = (point >= 0) & (point < points)
    counts = np.stack([(0.5 - f) ** 2 / 2, 0.75 - f * f, (0.5 + f) ** 2 / 2])
    slopes = np.stack([f - 0.5, -2 * f, f + 0.5])
    return np.clip(point, 0, points - 1), counts * there, slopes * there


def smooth(values: NDArray[Any], row: ArrayLike, column: ArrayLike) -> NDArray[np.float64]:
    """Values between the points of a grid by quadratic B-splines, with zeros around it; see `three_around`.

    Args:
        values: (rows, columns). The splines do not pass through them: their blur is compensated beforehand.
        row: places as fractional rows; broadcast with ``column`` to a shape S.
        column: likewise as fractional columns.

    Returns:
        Shape S.
    """
    down, across = (three_around(place, n) for place, n in zip((row, column), values.shape, strict=True))
    return np.asarray(
        sum(down[1][m] * across[1][n] * values[down[0][m], across[0][n]] for m in range(3) for n in range(3))
    )


def smooth_back(
    values: NDArray[Any], row: ArrayLike, column: ArrayLike, weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The derivatives of Σ weights · `smooth` (values, row, column) to each value, row and column.

    Args:
        values: see `smooth`.
        row: see `smooth`.
        column: see `smooth`.
        weights: shape S, to which ``row`` and ``column`` broadcast.

    Returns:
        (rows, columns); S; S.
    """
    at_row, at_column = (np.broadcast_to(place, weights.shape) for place in (row, column))
    (r, down, steep), (c, across, along) = (
        three_around(place, n) for place, n in zip((at_row, at_column), values.shape, strict=True)
    )
    of_values = np.zeros(values.shape)
    of_row, of_column = np.zeros(weights.shape), np.zeros(weights.shape)
    for m, n in np.ndindex(3, 3):
        here = values[r[m], c[n]]
        np.add.at(of_values, (r[m], c[n]), weights * down[m] * across[n])
        of_row += weights * steep[m] * across[n] * here
        of_column += weights * down[m] * along[n] * here
    return of_values, of_row, of_column
