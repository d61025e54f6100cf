"""Functions of position as textures, as coarse as a picture allows.

What a ray meets is looked up linearly between the points of a texture. Bends are sampled where points are, and may
err by what moves rays by a thousandth of a sample. Masks are averaged around each point, so that no light is lost
between points, and may be as coarse as what a pixel's rays spread over allows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vcc.plan.rays.steps import Texture
from vcc.shapes.patterns import Pattern

Array = NDArray[np.float64]

SIZES = (513, 1025, 2049)
"""Points a side of textures, tried until they are fine enough."""
COARSE_SIZES = (257, *SIZES)
"""The same where coarse ones may do."""
FINE_ENOUGH = 1e-6
"""Error of a texture between its points, root mean square as a share of the largest value."""
SHIFT_ENOUGH = 1e-3
"""The same of a texture of slopes, in samples of the light field by which rays then miss their place."""
POINTS_PER_FOOTPRINT = 32
"""Points of a mask's texture across what one pixel's rays spread over. A box that wide is then blurred by a tent
and a box of 1/32 of it, a standard deviation of 1/64: at both ends of the ramp that it makes of an edge, over an
eighth of it, the picture is off by up to 0.4/64 of the edge, 0.6 %; no light is lost."""
WORTH_SAYING = 1e-3
"""Error of a texture, as `FINE_ENOUGH`, from which on a plan says it."""
POINTS_AT_ONCE = 2**17


def textured(
    sampled: Callable[[Array, Array, tuple[float, float]], Array],
    region: tuple[Array, Array],
    sizes: tuple[int, ...] = SIZES,
    *,
    itself: Callable[[Array, Array], Array] | None = None,
    spacing_enough: Array | None = None,
    index_from_value: Array | None = None,
) -> tuple[Texture, float]:
    """The coarsest texture that is fine enough for a function over a region, and its error anywhere.

    Args:
        sampled: the numbers that points of the texture hold, a function of (x, y, spacing), places (1, columns)
            and (rows, 1) in metres.
        region: lowest and highest (x, y), metres.
        sizes: points a side. After the first, the first one is tried that should do: interpolation errs as the
            square of the spacing. The last one is taken if none should.
        itself: the function of (x, y) that the texture stands for, where that is not ``sampled``.
        spacing_enough: distance (x, y) of points that is fine enough whatever the error, metres; None: none is.
        index_from_value: (4, numbers), by how many samples of the light field rays move for an error of the
            numbers; None where that is not known, and the error counts alone.

    Returns:
        The texture, and its root mean square error as a share of its largest value.
    """
    low, high = region
    extent = np.maximum(high - low, 1e-9)
    generator = np.random.default_rng(0)
    x, y = (low[n] + extent[n] * generator.random(4096) for n in (0, 1))
    left = list(sizes)
    while True:
        size = left.pop(0)
        spacing = (float(extent[0] / (size - 1)), float(extent[1] / (size - 1)))
        column, row = low[0] + spacing[0] * np.arange(size), low[1] + spacing[1] * np.arange(size)
        parts = np.array_split(row, -(-size * size // POINTS_AT_ONCE))
        first = np.asarray(sampled(column[None, :], parts[0][:, None], spacing))
        values = np.empty((size, size, first.shape[-1]))
        values[: len(parts[0])] = first
        done = len(parts[0])
        for rows in parts[1:]:
            values[done : done + len(rows)] = sampled(column[None, :], rows[:, None], spacing)
            done += len(rows)
        texture = Texture(values, (float(low[0]), float(low[1])), spacing)
        truth = np.asarray(sampled(x, y, spacing) if itself is None else itself(x, y))
        off = texture(x, y) - truth
        largest = float(np.abs(values).max())
        error = float(np.sqrt(np.mean(off**2))) / largest if largest > 0 else 0.0
        excess = error / FINE_ENOUGH
        if index_from_value is not None:
            moved = np.sqrt(np.mean((off @ index_from_value.T) ** 2, axis=0)).max()
            excess = min(excess, float(moved) / SHIFT_ENOUGH)

        def does(finer: int, excess: float = excess, size: int = size) -> bool:
            even = spacing_enough is not None and bool((extent / (finer - 1) <= spacing_enough).all())
            return even or excess * (size / finer) ** 2 < 1

        if does(size) or not left:
            return texture, error
        while len(left) > 1 and not does(left[0]):
            left.pop(0)


def means_around(pattern: Pattern, x: Array, y: Array, spacing: tuple[float, float]) -> Array:
    """A pattern's mean over the cell around each point of a lattice: in closed form where it has one.

    Else over 4×4 places in each cell, 2×2 on the finest lattices.

    Args:
        pattern: what is averaged.
        x: places of the columns, (1, columns), metres from the pattern's middle.
        y: places of the rows, (rows, 1).
        spacing: of the lattice, (x, y).
    """
    if type(pattern).mean is not Pattern.mean:
        return pattern.mean(x, y, *spacing)
    each = 4 if x.size <= SIZES[1] else 2
    within = (np.arange(each) + 0.5) / each - 0.5
    columns = (x.reshape(-1, 1) + spacing[0] * within).reshape(1, -1)
    rows = (y.reshape(-1, 1) + spacing[1] * within).reshape(-1, 1)
    values = np.broadcast_to(np.asarray(pattern(columns, rows)), (rows.size, columns.size))
    return np.asarray(values.reshape(y.size, each, x.size, each).mean(axis=(1, 3)))
