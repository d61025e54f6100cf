"""Functions of position as textures, as coarse as a picture allows.

What a ray meets is looked up linearly between the points of a texture. Bends are sampled where points are, and may
err by what moves rays by a thousandth of a sample. Masks are averaged around each point, so that no light is lost
between points, and may be as coarse as what a pixel's rays spread over allows.
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
ROOM = 0.1
"""By how much of a region a texture that is kept reaches beyond it on each side, within what passes."""


@dataclass(frozen=True, eq=False, repr=False)
class Sampled(Brief):
    """What is sampled of an element.

    Args:
        values: the numbers that points of a texture hold, a function of (x, y, spacing), places (1, columns) and
            (rows, 1) in metres from the element's middle.
        middle: place (x, y) of the element, metres.
        region: lowest and highest (x, y) at which rays meet it, metres.
        passes: the same of what passes in its plane; infinite where nothing bounds it.
        of: what the values are of; equal things have equal values.
        itself: the function of (x, y) that a texture stands for, where that is not ``values``.
    """

    values: Callable[[Array, Array, tuple[float, float]], Array]
    middle: tuple[float, float]
    region: tuple[Array, Array]
    passes: tuple[Array, Array]
    of: object
    itself: Callable[[Array, Array], Array] | None = None

    def from_middle(self) -> tuple[Array, Array]:
        """The region, counted from the element's middle."""
        low, high = self.region
        return low - self.middle, high - self.middle

    def with_room(self) -> Sampled:
        """The same with room around the region."""
        (low, high), (lowest, highest) = self.region, self.passes
        room = ROOM * (high - low)
        region = (
            np.maximum(low - room, np.minimum(lowest, low)),
            np.minimum(high + room, np.maximum(highest, high)),
        )
        return replace(self, region=region)


@dataclass(frozen=True, eq=False, repr=False)
class Enough(Brief):
    """What is fine enough of a texture, beside its own error.

    Args:
        spacing: distance (x, y) of points that is whatever the error, metres; None: none is.
        index_from_value: (4, numbers), by how many samples of the light field rays move for an error of the
            numbers; None where that is not known, and the error counts alone.
    """

    spacing: Array | None = None
    index_from_value: Array | None = None


EXACT = Enough()
"""Nothing but that a texture errs little."""


@dataclass(frozen=True, eq=False, repr=False)
class Points(Brief):
    """Where the points of a texture stand on its element.

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

    def holds(self, low: Array, high: Array) -> bool:
        """Whether a region lies within them, but for one spacing, over which the outermost values are held."""
        last = np.array(self.start) + np.array(self.spacing) * self.size
        return bool((low >= np.array(self.start) - self.spacing).all() and (high <= last).all())

    def like(self, other: Points) -> bool:
        """Whether they are as many and almost as close."""
        return self.size == other.size and np.allclose(self.spacing, other.spacing, rtol=0.5, atol=0)


def choose_points(sampled: Sampled, sizes: tuple[int, ...], enough: Enough) -> Points:
    """The points of a texture that follows a camera: on the element, with room around the region.

    Args:
        sampled: what is sampled.
        sizes: see `made_fine_enough`.
        enough: likewise.
    """
    texture, error = made_fine_enough(sampled.with_room(), sizes, enough)
    x, y = (start - middle for start, middle in zip(texture.start, sampled.middle, strict=True))
    return Points(texture.values.shape[0], (x, y), texture.spacing, error)


def at_points(sampled: Sampled, points: Points, parts: Parts) -> Texture:
    """The texture whose points were chosen.

    Args:
        sampled: what is sampled.
        points: on the element.
        parts: what is kept of plans nearby.

    Raises:
        InputError: a region beyond the points.
    """
    if not points.holds(*sampled.from_middle()):
        raise plan_again("where rays meet an element")
    values = parts.part(
        "texture met by rays",
        lambda: (content(sampled.of), content(points)),
        lambda: _values(sampled, points.start, points.spacing, points.size),
    )
    x, y = (start + middle for start, middle in zip(points.start, sampled.middle, strict=True))
    return Texture(values, (x, y), points.spacing)


def made_fine_enough(sampled: Sampled, sizes: tuple[int, ...], enough: Enough = EXACT) -> tuple[Texture, float]:
    """The coarsest texture that is fine enough for a function over a region, and its error anywhere.

    Args:
        sampled: what is sampled, and where.
        sizes: points a side. After the first, the first one is tried that should do: interpolation errs as the
            square of the spacing. The last one is taken if none should.
        enough: what is fine enough.

    Returns:
        The texture, and its root mean square error as a share of its largest value.
    """
    low, high = sampled.region
    extent = np.maximum(high - low, 1e-9)
    generator = np.random.default_rng(0)
    x, y = (low[n] + extent[n] * generator.random(4096) for n in (0, 1))
    left = list(sizes)
    while True:
        size = left.pop(0)
        spacing = (float(extent[0] / (size - 1)), float(extent[1] / (size - 1)))
        start = float(low[0]), float(low[1])
        values = _values(sampled, start, spacing, size, sampled.middle)
        texture = Texture(values, start, spacing)
        from_middle = x - sampled.middle[0], y - sampled.middle[1]
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
    """What the points of a texture hold, (size, size, numbers); ``start`` counted from where ``middle`` is."""
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
