"""Textures of masks, averaged over the footprints of samples, and the error of looking them up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.values import content
from vcc.plan.following import NONE_KEPT, Follow, Linear, Parts, choice, plan_again
from vcc.plan.footprints.means import Boxes, MeanChoice, choose_mean, mean_back, mean_over
from vcc.plan.footprints.model import MaskLookup
from vcc.plan.footprints.planes import Plane, along_axes, tap_origin
from vcc.plan.footprints.taps import Taps
from vcc.plan.sharpening import symmetric, symmetric_plane
from vcc.shapes.mean_back import holds, is_values
from vcc.shapes.patterns import Cells, Pattern

Array = NDArray[np.float64]
Means = tuple[tuple[MeanChoice | None, ...], ...]
"""How means are computed, by level, and by blocks of rows that are averaged at once."""

TEXTURE_POINTS_PER_FOOTPRINT = 3
"""Looked-up values are quadratic B-splines of texture points this fine; the loss is compensated beforehand."""
LARGEST_TEXTURE = 4096
"""Points a side of a mask texture: 64 MiB."""
POINTS_AT_ONCE = 2**20
"""Points of a texture that are averaged at once, in float64: 8 MiB."""
DIVIDED = 4
"""Samples before the first and after the last at which finer samples may stand."""
GIVEN_BACK = np.polynomial.polynomial.polypow([1, 1 / 6, 3 / 40, 5 / 112, 35 / 1152], 3)[:5]
"""Gain of a texture's filter in powers of sin² πν: a power of the arcsin series, see `_given_back`."""
TEXTURE_FILTER = 5
"""Weights on each side of a texture's filter, in addition to the box of a sample."""
AROUND = 2
"""Points of a texture around the looked-up region: for splines, and for what the filter leaves next to an edge."""
APART = 4
"""Rows between the region of a texture that a tap looks up and the texture of taps of another level."""
SPLINE = 1.5
"""Points of a texture on each side that a look-up by quadratic B-splines reads."""
ROUNDING = 1e-6
"""Deviations over a whole view, in points or pixels, below which they count as rounding."""
ROOM = 0.1
"""Margin of a kept texture on each side, as a share of the region of the mask that samples meet."""
COARSER = 1.5
"""Factor by which the footprint of samples may change before another texture would be made."""


@dataclass(frozen=True, eq=False, repr=False)
class Footing(Brief):
    """How a mask is averaged over the footprints of samples in taps of one level.

    A footprint is the convolution of two parallelograms, a part of a view's cell and a sample's cell: a mean along
    four sides. If all sides lie along the axes, it is a mean over two boxes: the pattern's own mean averages
    over the wider box, filters of the texture over the other. Otherwise a filter does everything.

    Args:
        by_views: along (x, y), whether the box of a view's part is the wider one; None if sides are rotated.
        beside: weights of the filters along (x, y) on each side of their middles.
        top: row of the texture at which the texture of these taps begins.
    """

    by_views: NDArray[np.bool_] | None
    beside: tuple[int, int]
    top: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class Lattice(Brief):
    """Places of the points of a mask's texture on the mask, and the lengths of the filters that make it.

    Args:
        first: numbers (x, y) of the first point; number 0 is at the mask's middle.
        last: numbers of the last point.
        spacing: (x, y) of the points, metres.
        footings: of the taps of each level; their textures are stacked vertically.
    """

    first: Array
    last: Array
    spacing: Array
    footings: tuple[Footing, ...]

    def like(self, other: Lattice) -> bool:
        """Whether the two lattices are interchangeable."""
        ratio = self.spacing / other.spacing
        return len(self.footings) == len(other.footings) and bool(np.maximum(ratio, 1 / ratio).max() < COARSER)


@dataclass(frozen=True, eq=False, repr=False)
class TextureChoices(Brief):
    """How the texture of a mask is made and read.

    Args:
        means: how its means are computed, for taps of each level, by blocks of rows that are averaged at once;
            None: by the pattern itself, in single precision, if no parameter follows a camera.
        lattice: places of its points.
        straight: which steps from sample to sample across it (2×2) are rounding.
    """

    means: tuple[tuple[MeanChoice | None, ...], ...] | None
    lattice: Lattice = choice("points of its texture", Lattice.like)
    straight: NDArray[np.bool_] = choice("steps that are rounding")


@dataclass(frozen=True, eq=False, repr=False)
class MaskMet(Brief):
    """A mask in mid-path as the samples of taps meet it.

    Args:
        plane: the mask.
        taps: of the plan.
        samples: (rows, columns) of a view.
        place: where sample (0, 0) of each tap meets it, (rows of taps, columns of taps, 2), metres.
        sides: of the footprints of samples in taps of each level, (2, 4): of a view's part, and of a sample.
        finest: sides for the finest level, which a piece of a light field may lack.
    """

    plane: Plane
    taps: Taps
    samples: tuple[int, int]
    place: Array
    sides: tuple[Array, ...]
    finest: Array

    @classmethod
    def of(
        cls,
        plane: Plane,
        taps: Taps,
        off_middle: Array,
        motion: Array,
        samples: tuple[int, int],
        fine: int,
        over_samples: bool = True,
    ) -> MaskMet:
        """The mask as taps meet it.

        Args:
            plane: the mask.
            taps: of the plan.
            off_middle: how far the open part of each tap's cell lies from its middle, in views,
                (rows, columns, 2).
            motion: see `tap_origin`.
            samples: (rows, columns) of a view.
            fine: parts of a sample, each way.
            over_samples: whether to average over the sample's cell in addition to the view's cell: point samples
                meet the mask in a point.
        """
        place = tap_origin(plane.at_index, plane.offset, taps.index, taps.shift + off_middle, motion)
        sample_sides = plane.sample_step / fine * over_samples
        sides = tuple(np.hstack([plane.view_step(motion) / parts, sample_sides]) for _, parts in taps.levels())
        finest = np.hstack([plane.view_step(motion) / taps.parts[-1], sample_sides])
        return cls(plane, taps, samples, place, sides, finest)

    def choices(self, follow: Follow | None = None) -> TextureChoices:
        """Choose how the mask's texture is made, with a margin around the region read if it follows a camera."""
        lattice = self._lattice(0.0 if follow is None else ROOM)
        tiny = np.abs(self.plane.sample_step / lattice.spacing[:, None]) * max(self.samples) < ROUNDING
        if follow is None:
            return TextureChoices(None, lattice, tiny)
        averaged = (_Averaging.of(lattice, *level) for level in zip(lattice.footings, self.sides, strict=True))
        means = tuple(
            tuple(choose_mean(self.plane.pattern, boxes) for _, boxes in each.rectangles()) for each in averaged
        )
        # Only the cross terms between rows and columns count as rounding: the others may begin to grow.
        return TextureChoices(means, lattice, tiny & ~np.eye(2, dtype=bool))

    def look_up(self, choices: TextureChoices, parts: Parts = NONE_KEPT) -> tuple[MaskLookup, Textured]:
        """The mask averaged over a sample's footprint, as a texture for samples to read, and how it was made.

        Args:
            choices: how.
            parts: cached parts of nearby plans.

        Raises:
            InputError: samples meet the mask beyond the chosen points, or no longer along them.
        """
        plane, lattice, sides = self.plane, choices.lattice, self.sides
        first, last = _ends(lattice.spacing, *self._region)
        if (first < lattice.first).any() or (last > lattice.last).any():
            raise plan_again("where samples meet a mask")
        texture = parts.part(
            "texture",
            lambda: content((plane.pattern, lattice, sides)),
            lambda: _texture(plane.pattern, lattice, sides, choices.means, parts),
        )
        tops = np.zeros((*self.place.shape[:2], 1))
        for (mesh, _), footing in zip(self.taps.levels(), lattice.footings, strict=True):
            tops[mesh] = footing.top
        kept = Textured(lattice, sides, tops[..., 0], choices.means)
        lookup = MaskLookup(
            texture=texture,
            column=self.place[..., 0] / lattice.spacing[0] - lattice.first[0],
            row=self.place[..., 1] / lattice.spacing[1] - lattice.first[1] + kept.tops,
            step=cleaned(plane.sample_step / lattice.spacing[:, None], self.samples, choices.straight),
            label=plane.label,
        )
        return lookup, kept

    @property
    def _bound(self) -> Array:
        """Half the size (x, y) of the mask and of the footprints around it, metres."""
        return np.asarray(np.array(self.plane.pattern.size) / 2 + np.max(self._footprints, axis=0))

    @property
    def _footprints(self) -> list[Array]:
        """Sizes (x, y) of the footprints of samples, of each level and the finest."""
        return [np.sqrt((each**2).sum(axis=1)) for each in (*self.sides, self.finest)]

    @property
    def _region(self) -> tuple[Array, Array]:
        return _region(self.place, self.plane.sample_step, self.samples, self._bound)

    def _lattice(self, room: float) -> Lattice:
        """The lattice of the texture, independent of the part that is read: pieces of a light field read alike.

        Args:
            room: margin around what is read, as a share of it.
        """
        bound, (low, high) = self._bound, self._region
        spacing = _spacing(self._footprints[-1], np.minimum(2 * bound, high - low))
        low, high = (
            np.maximum(low - room * (high - low), -(1 + room) * bound),
            np.minimum(high + room * (high - low), (1 + room) * bound),
        )
        first, last = _ends(spacing, low, high)
        footings = [_footing(each, spacing, 1 + room) for each in self.sides]
        ends = float(first[1]), float(last[1])
        tops = _tops(self.place, self.plane.sample_step, self.samples, self.taps, spacing[1], ends)
        return Lattice(
            first, last, spacing, tuple(replace(f, top=top) for f, top in zip(footings, tops, strict=True))
        )


def _ends(spacing: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Numbers of the first and the last point of a texture that is read from low to high."""
    first = np.floor(low / spacing) - AROUND
    return first, np.maximum(np.ceil(high / spacing) + AROUND, first + 2)


def _footing(sides: Array, spacing: Array, room: float) -> Footing:
    """How a texture is averaged over footprints of these sides."""
    if not along_axes(sides):
        reach = np.abs(sides).sum(axis=1) / 2 / spacing * room
        return Footing(None, (TEXTURE_FILTER + math.ceil(reach[0]), TEXTURE_FILTER + math.ceil(reach[1])))
    view, sample = _boxes(sides)
    narrow = np.minimum(view, sample) * room / spacing
    beside = (TEXTURE_FILTER + math.ceil(narrow[0] / 2), TEXTURE_FILTER + math.ceil(narrow[1] / 2))
    return Footing(view >= sample, beside)


def _boxes(sides: Array) -> tuple[Array, Array]:
    """Sizes (x, y) of the boxes of a view's part and of a sample, whose sides lie along the axes."""
    return np.abs(sides[:, :2]).sum(axis=1), np.abs(sides[:, 2:]).sum(axis=1)


def _tops(
    place: Array, step: Array, samples: tuple[int, int], taps: Taps, spacing: float, ends: tuple[float, float]
) -> list[int]:
    """Rows at which the textures of taps of each level begin, spaced so that no tap reads those of other levels.

    Args:
        place: see `MaskMet`.
        step: 2×2, from sample to sample.
        samples: (rows, columns) of a view.
        taps: of the plan.
        spacing: of rows of the texture.
        ends: numbers of its first and its last row.
    """
    rows, tops = round(ends[1] - ends[0]) + 1, [0]
    reads = []
    for mesh, _ in taps.levels():
        (_, low), (_, high) = _region(place[mesh], step, samples, np.full(2, np.inf))
        room = ROOM * (high - low)
        reads.append(((low - room) / spacing - ends[0], (high + room) / spacing - ends[0]))
    for (_, highest), (lowest, _) in pairwise(reads):
        tops.append(tops[-1] + APART + math.ceil(max(highest, rows - min(lowest, 0.0))))
    return tops


def _region(place: Array, step: Array, samples: tuple[int, int], bound: Array) -> tuple[Array, Array]:
    """The lowest and the highest (x, y) at which samples, and finer ones around them, read within ± bound.

    Args:
        place: of sample (0, 0) of each tap, (..., 2).
        step: 2×2, from sample to sample.
        samples: (rows, columns) of a view.
        bound: half the size (x, y) of the readable region.
    """
    rows, columns = samples
    ends = [[k, l] for k in (-DIVIDED, columns - 1 + DIVIDED) for l in (-DIVIDED, rows - 1 + DIVIDED)]
    corners = place.reshape(-1, 2)[:, None] + np.array(ends) @ step.T
    return np.maximum(corners.min(axis=(0, 1)), -bound), np.minimum(corners.max(axis=(0, 1)), bound)


def _spacing(footprint: Array, extent: Array) -> Array:
    """Distance between texture points along (x, y): a share of the footprint, doubled until the texture fits."""
    spacing = np.where(footprint > 0, footprint / TEXTURE_POINTS_PER_FOOTPRINT, np.maximum(extent, 1e-9) / 1024)
    too_many = np.maximum(extent / spacing / (LARGEST_TEXTURE - 4), 1.0)
    return np.asarray(spacing * 2 ** np.ceil(np.log2(too_many)))


def _texture(
    pattern: Pattern,
    lattice: Lattice,
    sides: Sequence[Array],
    chosen: Means | None,
    parts: Parts = NONE_KEPT,
) -> NDArray[np.floating]:
    """Means of a pattern over footprints of samples, at points of a lattice: (rows, columns).

    Args:
        pattern: of the mask.
        lattice: its points.
        sides: see `MaskMet`.
        chosen: see `TextureChoices.means`.
        parts: cached parts of nearby plans.
    """
    found: list[NDArray[np.floating]] = []
    for level, (footing, each) in enumerate(zip(lattice.footings, sides, strict=True)):
        means = _Averaging.of(lattice, footing, each).means(
            pattern, None if chosen is None else chosen[level], parts
        )
        gap = footing.top - sum(map(len, found))
        found += [np.zeros((gap, means.shape[1]), dtype=means.dtype), means]
    return np.concatenate(found[1:]) if len(found) > 2 else found[1]


@dataclass(frozen=True, eq=False, repr=False)
class Textured(Brief):
    """How a mask's texture was made.

    Args:
        lattice: its points.
        sides: of the footprints over which the pattern was averaged, of taps of each level, metres.
        tops: row at which the texture of each tap begins, (rows of taps, columns of taps).
        means: see `TextureChoices`.
    """

    lattice: Lattice
    sides: tuple[Array, ...]
    tops: Array
    means: Means | None

    def of(self, pattern: Pattern) -> NDArray[np.floating]:
        """The texture of another pattern, (rows, columns)."""
        return _texture(pattern, self.lattice, self.sides, self.means)

    def seen(self, axis: int, place: Array) -> tuple[Array, Array]:
        """The range of a pattern that affects what is looked up at places of the texture.

        Args:
            axis: 0 for x, 1 for y.
            place: columns of the texture, or rows, counted from where a tap's texture begins.

        Returns:
            The lowest and the highest x, or y, on the mask, metres.
        """
        spacing = self.lattice.spacing[axis]
        middle = (place + self.lattice.first[axis]) * spacing
        wide = max(float(np.abs(each[axis]).sum()) for each in self.sides)
        beside = max(footing.beside[axis] for footing in self.lattice.footings)
        reach = (SPLINE + beside) * spacing + wide / 2
        return middle - reach, middle + reach


def by_mask_in_path(n: int, plane: Plane, kept: Textured) -> Linear:
    """The linear map from the cells of its pattern to the texture of the n-th mask in mid-path.

    Args:
        n: its number.
        plane: the mask.
        kept: how its texture was made.
    """
    return Linear(
        lambda thing, field: is_values(thing, field) and holds(plane.pattern, thing),
        lambda plan: (f"core.masks[{n}].texture",),
        lambda cells, weights: texture_back(plane, kept, weights[0], cells),
    )


def texture_back(plane: Plane, kept: Textured, weights: Array, cells: Cells) -> Array:
    """From weights of a mask's texture to weights of the cells of its pattern.

    Args:
        plane: the mask.
        kept: how its texture was made.
        weights: of the texture's points, (rows, columns).
        cells: the same object as in the pattern.
    """
    total = np.zeros(cells.values.shape)
    rows = round(kept.lattice.last[1] - kept.lattice.first[1]) + 1
    for level, (footing, each) in enumerate(zip(kept.lattice.footings, kept.sides, strict=True)):
        averaging = _Averaging.of(kept.lattice, footing, each)
        own = weights[footing.top : footing.top + rows]
        total += averaging.back(plane.pattern, own, None if kept.means is None else kept.means[level], cells)
    return total


@dataclass(frozen=True, eq=False, repr=False)
class _Averaging(Brief):
    """Means of a pattern over rectangles at places, filtered.

    Args:
        x: places, metres.
        y: likewise.
        size: (width, height) of the rectangles.
        filters: (across, down), or a single 2-D filter, (rows, columns), all symmetric about their middles.
    """

    x: Array
    y: Array
    size: tuple[float, float]
    filters: tuple[Array, ...]

    @classmethod
    def of(cls, lattice: Lattice, footing: Footing, sides: Array) -> _Averaging:
        """The averaging that makes the texture of taps of one level."""
        x, y = (
            np.arange(first - beside, last + beside + 1) * apart
            for first, last, beside, apart in zip(
                lattice.first, lattice.last, footing.beside, lattice.spacing, strict=True
            )
        )
        if footing.by_views is None:
            width, height = map(float, lattice.spacing)
            return cls(
                x, y, (width, height), (_filter_of_plane(sides / lattice.spacing[:, None], footing.beside),)
            )
        boxes = _boxes(sides)
        wide, narrow = (np.where(footing.by_views == views, *boxes) for views in (True, False))
        across, down = (
            _filter(float(width), beside)
            for width, beside in zip(narrow / lattice.spacing, footing.beside, strict=True)
        )
        return cls(x, y, (float(wide[0]), float(wide[1])), (across, down))

    def rectangles(self) -> list[tuple[NDArray[np.int64], Boxes]]:
        """Blocks of rows that are averaged at once, and their rectangles."""
        pieces = _rows_at_once(self.y.size, self.x.size)
        return [(rows, Boxes(self.x[None, :], self.y[rows, None], *self.size)) for rows in pieces]

    def means(
        self, pattern: Pattern, chosen: tuple[MeanChoice | None, ...] | None, parts: Parts
    ) -> NDArray[np.floating]:
        """The means, without the margin that the filters consume."""
        found = np.empty((self.y.size, self.x.size), dtype=np.float32 if chosen is None else np.float64)
        for n, (rows, boxes) in enumerate(self.rectangles()):
            found[rows] = mean_over(pattern, boxes, None if chosen is None else chosen[n], parts)
        return _filtered(found, self.filters)

    def back(
        self, pattern: Pattern, weights: Array, chosen: tuple[MeanChoice | None, ...] | None, cells: Cells
    ) -> Array:
        """From weights of the means to weights of the cells of a pattern."""
        # Filters are symmetric: a mean affects all points that its own filter reaches.
        beside = [(n // 2,) * 2 for n in _reach(self.filters)]
        wide = np.pad(weights, [(2 * low, 2 * high) for low, high in beside])
        means = np.asarray(_filtered(wide, self.filters), dtype=np.float64)
        total = np.zeros(cells.values.shape)
        for n, (rows, boxes) in enumerate(self.rectangles()):
            total += mean_back(pattern, boxes, None if chosen is None else chosen[n], means[rows], cells)
        return total


def _reach(filters: tuple[Array, ...]) -> tuple[int, ...]:
    """(rows, columns) that the filters span together."""
    return filters[0].shape if len(filters) == 1 else (len(filters[1]), len(filters[0]))


def _rows_at_once(rows: int, columns: int) -> list[NDArray[np.int64]]:
    """Rows of a texture in blocks that are averaged at once."""
    return np.array_split(np.arange(rows), -(-rows * columns // POINTS_AT_ONCE))


def _filter(box: float, beside: int) -> Array:
    """The filter of a texture along one axis: a mean over a box, and compensation of the look-up by splines.

    Args:
        box: its width in points of the texture.
        beside: weights on each side of its middle.
    """
    return symmetric(lambda frequency: np.sinc(box * frequency) * _given_back(frequency), beside)


def _filter_of_plane(sides: Array, beside: tuple[int, int]) -> Array:
    """The filter (rows, columns) that turns means over the cells of a texture into means over parallelograms.

    Args:
        sides: (2, any number), along which to average, one after the other, in points of the texture.
        beside: weights on each side of its middle along (x, y).
    """

    def wanted(fx: Array, fy: Array) -> Array:
        means = np.sinc(fx[:, None] * sides[0] + fy[:, None] * sides[1]).prod(axis=1)
        return np.asarray(means * _given_back(fx) * _given_back(fy) / np.sinc(fx) / np.sinc(fy))

    return symmetric_plane(wanted, beside)


def _given_back(frequency: Array) -> Array:
    """The gain that compensates for a look-up by quadratic B-splines.

    B-splines reduce a cosine of ν cycles a point to sinc³(ν). With s = sin² πν, the compensation is
    (arcsin(√s)/√s)³. `GIVEN_BACK` has the first terms of its series; the terms left out are smaller than the
    splines' aliasing.

    Args:
        frequency: ν.
    """
    return np.asarray(np.polynomial.polynomial.polyval(np.sin(np.pi * frequency) ** 2, GIVEN_BACK))


def _filtered(means: NDArray[np.floating], filters: tuple[Array, ...]) -> NDArray[np.floating]:
    """Means (rows, columns) filtered, without the margin that the filters consume."""
    from scipy.ndimage import convolve1d

    if len(filters) == 1:
        from scipy.signal import oaconvolve  # slow to import

        return np.ascontiguousarray(oaconvolve(means, filters[0].astype(means.dtype), mode="valid"))
    (across, down) = filters
    down_done = convolve1d(means, down, axis=0, mode="constant")[len(down) // 2 : len(means) - len(down) // 2]
    wide = convolve1d(down_done, across, axis=1, mode="constant")
    return np.ascontiguousarray(wide[:, len(across) // 2 : wide.shape[1] - len(across) // 2])


def texture_error(texture: NDArray[np.floating]) -> float:
    """Root mean square error of values looked up between points of a texture, over all places.

    Compensated splines reproduce parabolas. With a third derivative d, in points, the value at distance f from a
    point is wrong by d·f(¼ − f²)/6, root mean square |d|/√30240. This is the leading term: too low by a tenth at
    nine points a period, by a third at five. Each derivative is estimated from four points, at every second
    point.

    Args:
        texture: (rows, columns).

    Returns:
        A share of the largest value.
    """
    largest = float(texture.max(initial=0.0))
    if largest == 0:
        return 0.0
    squares = 0.0
    for along in (texture, texture.T):
        if along.shape[1] >= 4:
            a, b, c, d = (along[:, n : along.shape[1] - 3 + n : 2] for n in range(4))
            squares += float(np.mean(np.square(d - a - 3 * (c - b), dtype=np.float64)))
    return math.sqrt(squares / 30240) / largest


def cleaned(step: Array, samples: tuple[int, int], straight: NDArray[np.bool_]) -> Array:
    """Steps across a texture, in points from sample to sample, with the rounding errors set to zero.

    Raises:
        InputError: steps that were rounding no longer are.
    """
    if (straight & (np.abs(step) * max(samples) >= ROUNDING)).any():
        raise plan_again("rows of samples that lie along rows of a mask")
    return np.where(straight, 0.0, step)
