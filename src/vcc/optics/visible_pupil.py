"""The part of a real lens's exit pupil that a place on the sensor sees: a disc on the axis, a cat's eye beside it.

Rays that are aimed at the whole pupil are stopped by rims wherever the lens vignettes, and those that are left are
too few and unevenly many from pixel to pixel. So the unit disc that points are drawn from is mapped on the visible
part: for a place at distance h from the axis in the direction e, with a along e and b across,

    a' = middle + half · ρ · a,    b' = across · ρ · b,

where ρ depends on the direction of (a, b) only, so that each ray stands for half · across · ρ² times the area of
the disc. The four numbers are tables over h, and ρ over the direction too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief

Array = NDArray[np.float64]
Passes = Callable[[Array], NDArray[np.bool_]]
"""Whether light passes, for (n, 3): h in metres, a and b in units of the disc's radius."""

HEIGHTS = 17
"""Nodes from the axis to the farthest corner of the sensor."""
DIRECTIONS = 65
"""Nodes of half a turn."""
ACROSS = 25
"""Points across the disc in the first look at the part."""
ROOM = 1.001
"""Factor by which the part is enlarged, beside its bends between nodes."""
CHECKS = 3000
"""Random rays that hold the tables against the lens."""
WORTH = 0.95
"""Share of the disc's area above which the disc is used as it is."""


@dataclass(frozen=True, eq=False, repr=False)
class VisiblePupil(Brief):
    """Tables of the visible part, and how places on the sensor are found in them.

    They are constants of a plan, not parameters: the rays drawn from them make the same image for any tables that
    enclose the visible part.

    Args:
        table: (heights, 3 + directions): middle, half, across, ρ … in units of the disc's radius. Directions go by
            a / (|a| + |b|), from −1 to 1.
        axis: place (x, y) on the sensor where h is 0, metres.
        step: from height to height, metres.
    """

    table: Array = field(metadata={"constant": True})
    axis: tuple[float, float] = field(default=(0.0, 0.0), metadata={"constant": True})
    step: float = field(default=1.0, metadata={"constant": True})

    def mapped(self, x: Array, y: Array, a: Array, b: Array) -> tuple[Array, Array, Array]:
        """Points of the unit disc mapped on the visible part, and the factor of the area that each stands for.

        Args:
            x: places on the sensor, metres.
            y: likewise.
            a: points along x, of the same shape.
            b: along y.
        """
        x, y = (x - self.axis[0]) / self.step, (y - self.axis[1]) / self.step
        height = np.hypot(x, y)
        cosine, sine = np.where(height > 0, x / np.maximum(height, 1e-300), 1.0), y / np.maximum(height, 1e-300)
        along, aside = cosine * a + sine * b, cosine * b - sine * a
        middle, half, across = self.ellipse(height)
        out = self.outward(height, along, aside)
        factor = half * across * out**2
        along, aside = middle + half * out * along, across * out * aside
        return cosine * along - sine * aside, sine * along + cosine * aside, factor

    def ellipse(self, height: Array) -> tuple[Array, Array, Array]:
        """Middle, half and across for heights in steps."""
        low, at = _node(height, len(self.table))
        middle, half, across = ((1 - at) * self.table[low, n] + at * self.table[low + 1, n] for n in range(3))
        return middle, half, across

    def outward(self, height: Array, along: Array, aside: Array) -> Array:
        """ρ for heights in steps and directions of points."""
        low, at = _node(height, len(self.table))
        directions = self.table.shape[1] - 3
        left, beside = _node(_turn(along, aside) * (directions - 1), directions)
        one, other = (
            (1 - beside) * self.table[row, 3 + left] + beside * self.table[row, 4 + left] for row in (low, low + 1)
        )
        return np.asarray((1 - at) * one + at * other)

    def area(self) -> float:
        """Of the visible part, as a share of the disc's, a mean over a sensor that reaches to the last height."""
        angle = np.linspace(0, np.pi, 181)
        height = np.arange(len(self.table), dtype=np.float64)
        out = self.outward(height[:, None], np.cos(angle), np.sin(angle))
        return float(np.average(self.table[:, 1] * self.table[:, 2] * (out**2).mean(axis=1), weights=height + 0.5))


def _turn(along: Array, aside: Array) -> Array:
    """The direction of points as a number that grows from 0 at −a to 1 at +a."""
    return np.asarray(0.5 + 0.5 * along / np.maximum(np.abs(along) + np.abs(aside), 1e-300))


def _node(place: Array, count: int) -> tuple[NDArray[np.int64], Array]:
    """The node below a place in steps, and the rest; the last interval goes on beyond both ends, held there."""
    place = np.clip(place, 0, count - 1)
    low = np.minimum(place.astype(np.int64), count - 2)
    return low, place - low


def tables_of(passes: Passes, farthest: float) -> Array | None:
    """The tables of a lens; None if nearly the whole disc is visible everywhere, or no table encloses the part.

    Args:
        passes: whether light passes.
        farthest: h of the sensor's farthest corner, metres.
    """
    heights = np.linspace(0, farthest, HEIGHTS)
    table = np.zeros((HEIGHTS, 3 + DIRECTIONS))
    ellipses = _ellipses(passes, heights)
    lit = np.flatnonzero(np.isfinite(ellipses[:, 0]))
    if not len(lit):
        return None
    # The coarse points they were found at must not show: bends from height to height cost room.
    smooth = np.polynomial.polynomial.polyfit(heights[lit] / farthest, ellipses[lit], min(4, len(lit) - 1))
    ellipses = np.asarray(np.polynomial.polynomial.polyval(heights[lit] / farthest, smooth).T, dtype=np.float64)
    if (ellipses[:, 1:] <= 0).any():
        return None
    table[lit, :3] = ellipses
    table[lit, 3:] = _outlines(passes, heights[lit], ellipses)
    # Where no light arrives, the part that the nearest height sees does no harm.
    table = table[lit[np.abs(lit - np.arange(HEIGHTS)[:, None]).argmin(axis=1)]]
    found = _enclosing(VisiblePupil(table), passes, farthest)
    return None if found is None or found.area() > WORTH else found.table


def _ellipses(passes: Passes, heights: Array) -> Array:
    """(heights, 3): middle, half and across of the ellipse around the visible part; NaN if none is visible."""
    across, aside = np.linspace(-1, 1, ACROSS), np.linspace(0, 1, ACROSS // 2 + 1)
    h, a, b = np.meshgrid(heights, across, aside, indexing="ij")
    inside = np.hypot(a, b) <= 1
    passed = np.zeros(h.shape, dtype=np.bool_)
    passed[inside] = passes(np.stack([h, a, b], axis=-1)[inside])
    found, step = np.full((len(heights), 3), np.nan), 2 / (ACROSS - 1)
    for n, seen in enumerate(passed):
        if seen.any():
            low, high = a[n][seen].min() - step, a[n][seen].max() + step
            found[n] = (low + high) / 2, (high - low) / 2, b[n][seen].max() + step
    return found


def _outlines(passes: Passes, heights: Array, ellipses: Array) -> Array:
    """(heights, directions): ρ, the farthest point that light passes through in each direction, with room."""
    middle, half, across = (ellipses[:, n, None] for n in range(3))

    def passed(out: Array, turn: Array) -> NDArray[np.bool_]:
        aside = 1 - np.abs(turn)  # see `_turn`, here from −1 to 1
        size = np.hypot(turn, aside)
        a, b = middle + half * out * turn / size, across * out * aside / size
        points = np.stack([np.broadcast_to(heights[:, None], a.shape), a, b], axis=-1)
        return passes(points.reshape(-1, 3)).reshape(a.shape)

    coarse, turn = np.linspace(-1, 1, DIRECTIONS // 4 + 1), np.linspace(-1, 1, DIRECTIONS)
    first = np.zeros((len(heights), len(coarse)))
    for out in np.arange(1, 13) / 8:
        first = np.where(passed(np.full(first.shape, out), coarse), out, first)
    low = np.array([np.interp(turn, coarse, row) for row in first])
    low, high = np.maximum(low - 1 / 8, 0.02), low + 1 / 4
    for _ in range(9):
        out = (low + high) / 2
        here = passed(out, turn)
        low, high = np.where(here, out, low), np.where(here, high, out)
    bent = np.zeros_like(high)
    # Between nodes a corner is off by up to a half of the second difference, a smooth line by an eighth.
    for axis, share in ((0, 0.25), (1, 0.5)):
        if high.shape[axis] > 2:
            second = share * np.abs(np.diff(high, 2, axis=axis))
            bent += np.pad(second, [(1, 1) if n == axis else (0, 0) for n in (0, 1)], mode="edge")
    return np.asarray(ROOM * high + bent)


def _enclosing(found: VisiblePupil, passes: Passes, farthest: float) -> VisiblePupil | None:
    """The tables, enlarged around random rays that pass outside them; None if these are far outside."""
    draw = np.random.default_rng(0)
    height = farthest * np.sqrt(draw.uniform(size=CHECKS))
    away, angle = np.sqrt(draw.uniform(size=CHECKS)), draw.uniform(0, np.pi, CHECKS)
    a, b = away * np.cos(angle), away * np.sin(angle)
    lit = passes(np.stack([height, a, b], axis=-1))
    place = height[lit] / farthest * (HEIGHTS - 1)
    middle, half, across = found.ellipse(place)
    along, aside = (a[lit] - middle) / half, b[lit] / across
    low, _ = _node(place, HEIGHTS)
    left, _ = _node(_turn(along, aside) * (DIRECTIONS - 1), DIRECTIONS)
    for _ in range(8):
        beyond = ROOM * np.hypot(along, aside) / found.outward(place, along, aside)
        if beyond.max(initial=0.0) > 1.25:
            return None
        outside = beyond > 1
        if not outside.any():
            return found
        larger = np.ones(found.table.shape)
        for row, column in ((0, 3), (0, 4), (1, 3), (1, 4)):
            np.maximum.at(larger, (low[outside] + row, left[outside] + column), ROOM * beyond[outside])
        found = replace(found, table=found.table * larger)
    return None
