"""Densities on a lattice: the share of a kernel at each lattice point, for linear interpolation between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FULL_STEP = 1e-9
"""Share of a lattice step that counts as rounding."""


def axes_of(matrix: Array, reach: tuple[float, float]) -> tuple[int, int] | None:
    """The axis of slope (0: s, 1: t) that moves along x, and along y; None if one moves along both."""
    moved = np.abs(matrix) * np.array(reach)
    for axes in ((0, 1), (1, 0)):
        if moved[0, 1 - axes[0]] <= FULL_STEP and moved[1, 1 - axes[1]] <= FULL_STEP:
            return axes
    return None


def separable(
    mean_distance: Callable[[int, Array], Array],
    reach: tuple[float, float],
    matrix: Array,
    half_width: int,
    half_height: int,
) -> Array | None:
    """The weights of an even kernel that is a product of its axes, if these lie along the lattice's axes.

    Since |δ − x|'' = 2·Dirac(δ − x), the mean of a tent is a second difference of means of distances:
    E tent(n − x) = ½ (E|x − n − 1| − 2 E|x − n| + E|x − n + 1|).

    Args:
        mean_distance: E|δ − x| along an axis of slope (0: s, 1: t) for |x| within the reach.
        reach: of the kernel, (|δs|, |δt|).
        matrix: lattice steps per slope.
        half_width: of the lattice, steps.
        half_height: of the lattice, steps.
    """
    axes = axes_of(matrix, reach)
    if axes is None:
        return None
    lines = []
    for n, (axis, half) in enumerate(zip(axes, (half_width, half_height), strict=True)):
        scale, place = abs(float(matrix[n, axis])), np.arange(-half - 1.0, half + 2.0)
        distance = np.abs(place)
        if scale * reach[axis] > FULL_STEP:
            inside = distance < scale * reach[axis]
            distance[inside] = scale * mean_distance(axis, place[inside] / scale)
        lines.append(np.maximum(np.diff(distance, 2) / 2, 0.0))  # rounding must not make light negative
    return np.outer(lines[1], lines[0])


def cells_on_lattice(cells: int, step: float, half: int) -> Array:
    """Means of the tents of a lattice over cells side by side around 0: shape (2·half + 1, cells).

    Args:
        cells: number of cells.
        step: width of a cell in lattice steps; negative if cells are counted in the opposite direction.
        half: lattice places run from −half to half.
    """
    place = np.arange(-half, half + 1.0)[:, None]
    edges = np.clip((np.arange(cells + 1) - cells / 2) * step, -half, half)

    def tent_integral(x: Array) -> Array:
        x = np.clip(x, -1, 1)
        return x - x * np.abs(x) / 2

    if abs(step) < 1e-6:  # differences of the integral would be rounding errors: cells are treated as points
        return np.asarray(np.maximum(1 - np.abs((edges[1:] + edges[:-1]) / 2 - place), 0.0))
    return np.asarray(np.diff(tent_integral(edges - place), axis=1) / np.diff(edges))


def deposited(places: Array, shares: Array, half_width: int, half_height: int) -> Array:
    """Points on a lattice, each divided among the four lattice points around it.

    Args:
        places: (x, y) in lattice steps relative to the middle, shape (n, 2).
        shares: of the points, shape (n,).
        half_width: of the lattice, steps.
        half_height: of the lattice, steps.
    """
    rows, columns = 2 * half_height + 1, 2 * half_width + 1
    x = np.clip(places[:, 0] + half_width, 0, columns - 1)
    y = np.clip(places[:, 1] + half_height, 0, rows - 1)
    left = np.minimum(x.astype(np.int64), max(columns - 2, 0))
    top = np.minimum(y.astype(np.int64), max(rows - 2, 0))
    across, down = x - left, y - top
    right, below = min(1, columns - 1), min(1, rows - 1) * columns
    corner = top * columns + left
    weights: Array = np.zeros(rows * columns)
    for offset, part in (
        (0, (1 - across) * (1 - down)),
        (right, across * (1 - down)),
        (below, (1 - across) * down),
        (below + right, across * down),
    ):
        weights += np.bincount(corner + offset, shares * part, rows * columns)
    return weights.reshape(rows, columns)


def refined(coarse: Array, factor: int) -> Array:
    """Weights on a lattice ``factor`` times as fine, interpolated linearly: their sum and mean are unchanged."""

    def finer(places: int) -> Array:
        half = places // 2
        fine = np.arange(-(half + 1) * factor + 1, (half + 1) * factor)
        distance = np.abs(fine[:, None] / factor - np.arange(-half, half + 1))
        return np.asarray(np.maximum(1 - distance, 0) / factor)

    rows, columns = coarse.shape
    return np.asarray(finer(rows) @ coarse @ finer(columns).T)
