"""Functions of position as textures, as coarse as the accuracy of the image allows.

Elements are looked up linearly between the points of a texture. Deflections are sampled at the points; their error
may move rays by a thousandth of a sample. Masks are averaged around each point, so that no light is lost
between points; their spacing may be as coarse as the area over which a pixel's rays spread allows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.values import content
from vcc.plan.following import Parts, plan_again
from vcc.plan.rays.steps import Texture
from vcc.shapes.patterns import Pattern

Array = NDArray[np.float64]
Box = tuple[Array, Array]
Function = Callable[[Array, Array, tuple[float, float]], Array]
"""Values at points of a texture, of (x, y, spacing)."""

SIZES = (513, 1025, 2049)
"""Points a side of textures, tried until they are fine enough."""
COARSE_SIZES = (257, *SIZES)
"""The same if coarse textures may be sufficient."""
FINE_ENOUGH = 1e-6
"""Error of a texture between its points, root mean square as a share of the largest value."""
SHIFT_ENOUGH = 1e-3
"""Error of a texture of slopes, in samples of the light field by which rays then miss their place."""
POINTS_PER_FOOTPRINT = 32
"""Points of a mask's texture across the area over which one pixel's rays spread. A box of this width is then
blurred by a tent and a box of 1/32 of it, a standard deviation of 1/64. At both ends of the ramp that the box
makes of an edge, over an eighth of it, the image is wrong by up to 0.4/64 of the edge, 0.6 %; no light is
lost."""
WORTH_SAYING = 1e-3
"""Error of a texture, as `FINE_ENOUGH`, above which a plan reports it."""
POINTS_AT_ONCE = 2**17
ROOM = 0.1
"""Margin of a kept texture on each side, as a share of the region, within the opening."""


@dataclass(frozen=True, eq=False, repr=False)
class Region(Brief):
    """The part of an element that rays meet.

    Args:
        middle: place (x, y) of the element, metres.
        ends: lowest and highest (x, y) at which rays meet it, metres.
        passes: lowest and highest (x, y) of the opening in its plane; infinite if nothing bounds it.
    """

    middle: tuple[float, float]
    ends: Box
    passes: Box

    def from_middle(self) -> Box:
        """Its ends, relative to the element's middle."""
        low, high = self.ends
        return low - self.middle, high - self.middle

    def with_room(self) -> Region:
        """The same with a margin."""
        (low, high), (lowest, highest) = self.ends, self.passes
        room = ROOM * (high - low)
        low, high = (
            np.maximum(low - room, np.minimum(lowest, low)),
            np.minimum(high + room, np.maximum(highest, high)),
        )
        return replace(self, ends=(low, high))


@dataclass(frozen=True, eq=False, repr=False)
class Sampled(Brief):
    """A function of position to sample, of an element.

    Args:
        values: the values at points of a texture, a function of (x, y, spacing), places (1, columns) and
            (rows, 1) in metres from the element's middle.
        region: where rays meet the element.
        of: the object that the values belong to; equal objects have equal values.
        itself: the function of (x, y) that the texture approximates, if different from ``values``.
    """

    values: Function
    region: Region
    of: object
    itself: Callable[[Array, Array], Array] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Enough(Brief):
    """Criteria for a fine enough texture, in addition to its own error.

    Args:
        spacing: distance (x, y) of points that is sufficient for any error, metres; None: none is.
        index_from_value: (4, numbers), samples of the light field by which rays move for an error of the
            values; None if unknown, and only the error counts.
    """

    spacing: Array | None = None
    index_from_value: Array | None = None


EXACT = Enough()
"""Only the error of the texture counts."""


@dataclass(frozen=True, eq=False, repr=False)
class Points(Brief):
    """Places of the points of a texture on its element.

    Args:
        size: points a side.
        start: place (x, y) of the first, metres from the element's middle.
        spacing: (x, y), metres.
        error: of the texture, root mean square as a share of the largest value.
    """

    size: int
    start: tuple[float, float]
    spacing: tuple[float, float]
    error: float

    @property
    def box(self) -> Box:
        """Lowest and highest (x, y) of the points."""
        low = np.array(self.start)
        return low, low + np.array(self.spacing) * (self.size - 1)

    def holds(self, low: Array, high: Array) -> bool:
        """Whether a region lies within the points, or at most one spacing outside, with constant values."""
        last = np.array(self.start) + np.array(self.spacing) * self.size
        return bool((low >= np.array(self.start) - self.spacing).all() and (high <= last).all())

    def like(self, other: Points) -> bool:
        """Whether they are equally many, with similar spacing."""
        return self.size == other.size and np.allclose(self.spacing, other.spacing, rtol=0.5, atol=0)


def choose_points(sampled: Sampled, sizes: tuple[int, ...], enough: Enough) -> Points:
    """Choose the points of a texture that follows a camera: fixed on the element, with a margin around the region.

    Args:
        sampled: the function.
        sizes: see `made_fine_enough`.
        enough: see `made_fine_enough`.
    """
    texture, error = made_fine_enough(replace(sampled, region=sampled.region.with_room()), sizes, enough)
    x, y = (start - middle for start, middle in zip(texture.start, sampled.region.middle, strict=True))
    return Points(texture.values.shape[0], (x, y), texture.spacing, error)


def at_points(sampled: Sampled, points: Points, parts: Parts) -> Texture:
    """The texture at the chosen points.

    Args:
        sampled: the function.
        points: on the element.
        parts: cached parts of nearby plans.

    Raises:
        InputError: a region beyond the points.
    """
    if not points.holds(*sampled.region.from_middle()):
        raise plan_again("where rays meet an element")
    values = parts.part(
        "texture met by rays",
        lambda: (content(sampled.of), content(points)),
        lambda: _values(sampled, points.start, points.spacing, points.size),
    )
    x, y = (start + middle for start, middle in zip(points.start, sampled.region.middle, strict=True))
    return Texture(values, (x, y), points.spacing)


def made_fine_enough(sampled: Sampled, sizes: tuple[int, ...], enough: Enough = EXACT) -> tuple[Texture, float]:
    """The coarsest texture that is fine enough for a function over a region, and its error.

    Args:
        sampled: the function and its region.
        sizes: points a side. After the first, the next one is the first that is expected to be sufficient: the
            interpolation error grows as the square of the spacing. The last one is used if none is.
        enough: the criteria.

    Returns:
        The texture, and its root mean square error as a share of its largest value.
    """
    (low, high), middle = sampled.region.ends, sampled.region.middle
    extent = np.maximum(high - low, 1e-9)
    generator = np.random.default_rng(0)
    x, y = (low[n] + extent[n] * generator.random(4096) for n in (0, 1))
    left = list(sizes)
    while True:
        size = left.pop(0)
        spacing = (float(extent[0] / (size - 1)), float(extent[1] / (size - 1)))
        start = float(low[0]), float(low[1])
        values = _values(sampled, start, spacing, size, middle)
        texture = Texture(values, start, spacing)
        from_middle = x - middle[0], y - middle[1]
        truth = np.asarray(
            sampled.values(*from_middle, spacing) if sampled.itself is None else sampled.itself(*from_middle)
        )
        off = texture(x, y) - truth
        largest = float(np.abs(values).max())
        error = float(np.sqrt(np.mean(off**2))) / largest if largest > 0 else 0.0
        excess = error / FINE_ENOUGH
        if enough.index_from_value is not None:
            moved = np.sqrt(np.mean((off @ enough.index_from_value.T) ** 2, axis=0)).max()
            excess = min(excess, float(moved) / SHIFT_ENOUGH)

        def does(finer: int, excess: float = excess, size: int = size) -> bool:
            close = enough.spacing
            even = close is not None and bool((extent / (finer - 1) <= close).all())
            return even or excess * (size / finer) ** 2 < 1

        if does(size) or not left:
            return texture, error
        while len(left) > 1 and not does(left[0]):
            left.pop(0)


def _values(
    sampled: Sampled,
    start: tuple[float, float],
    spacing: tuple[float, float],
    size: int,
    middle: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """Values at the points of a texture, (size, size, numbers); ``start`` has the same origin as ``middle``."""
    column, row = start[0] + spacing[0] * np.arange(size), start[1] + spacing[1] * np.arange(size)
    across = np.asarray(column[None, :] - middle[0], dtype=np.float64)
    parts: list[Array] = np.array_split(row, -(-size * size // POINTS_AT_ONCE))
    first = np.asarray(sampled.values(across, parts[0][:, None] - middle[1], spacing))
    values = np.empty((size, size, first.shape[-1]))
    values[: len(parts[0])] = first
    done = len(parts[0])
    for rows in parts[1:]:
        values[done : done + len(rows)] = sampled.values(across, rows[:, None] - middle[1], spacing)
        done += len(rows)
    return values


def means_around(pattern: Pattern, x: Array, y: Array, spacing: tuple[float, float]) -> Array:
    """A pattern's mean over the cell around each point of a lattice, in closed form if it has one.

    Else the mean of 4×4 places in each cell, 2×2 on the finest lattices.

    Args:
        pattern: to average.
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
