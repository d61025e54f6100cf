"""Masks as textures of what samples average of them, and how well textures show it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.values import content
from vcc.plan.decisions import ANEW, Decisions, Linear, plan_again
from vcc.plan.footprints.means import Boxes, mean_over
from vcc.plan.footprints.means_back import mean_back
from vcc.plan.footprints.model import MaskLookup
from vcc.plan.footprints.planes import Plane, tap_origin
from vcc.plan.sharpening import symmetric
from vcc.shapes.mean_back import holds, is_values
from vcc.shapes.patterns import Cells, Pattern

Array = NDArray[np.float64]

TEXTURE_POINTS_PER_FOOTPRINT = 3
"""Weights are quadratic B-splines of texture points this fine; what those take is given back beforehand."""
LARGEST_TEXTURE = 4096
"""Points a side of a mask texture: 64 MiB."""
POINTS_AT_ONCE = 2**20
"""Points of a texture that are averaged at once, in float64: 8 MiB."""
DIVIDED = 4
"""Samples before the first and after the last at which finer ones may stand."""
GIVEN_BACK = np.polynomial.polynomial.polypow([1, 1 / 6, 3 / 40, 5 / 112, 35 / 1152], 3)[:5]
"""The gain of a texture's filter in powers of sin² πν: a power of arcsin's series, see `_given_back`."""
TEXTURE_FILTER = 5
"""Weights on each side of a texture's filter, beside those that the box of a sample takes."""
AROUND = 2
"""Points of a texture around what is looked up: those of splines, and what the filter leaves beside an edge."""
SPLINE = 1.5
"""Points of a texture on each side that a look-up by quadratic B-splines takes."""
ROUNDING = 1e-6
"""Points or pixels, over a whole view, that are rounding."""
ROOM = 0.1
"""By how much of what samples meet of a mask a texture that is kept reaches beyond it on each side."""
LATTICE = "points of its texture"
"""The decision that holds them."""
COARSER = 1.5
"""By how much the footprint of samples may change before another texture would be made."""


@dataclass(frozen=True, eq=False, repr=False)
class Lattice(Brief):
    """Where the points of a mask's texture stand, on the mask, and how long the filters are that make it.

    Args:
        first: numbers (x, y) of the first point; number 0 stands at the mask's middle.
        last: of the last point.
        spacing: (x, y) of the points, metres.
        by_views: along (x, y), whether the box of a view's part is the wider one, that patterns are averaged over.
        beside: weights of the filters along (x, y) on each side of their middles.
    """

    first: Array
    last: Array
    spacing: Array
    by_views: NDArray[np.bool_]
    beside: tuple[int, int]

    def like(self, other: Lattice) -> bool:
        """Whether one serves as well as the other."""
        ratio = self.spacing / other.spacing
        return bool(np.maximum(ratio, 1 / ratio).max() < COARSER)


def mask_as_met(
    plane: Plane,
    index: Array,
    shift: Array,
    motion: Array,
    samples: tuple[int, int],
    divide: int,
    fine: int,
    over_samples: bool = True,
    decisions: Decisions = ANEW,
) -> tuple[MaskLookup, Textured]:
    """The mask averaged over a sample's footprint: as a texture that each sample reads, and how that was made.

    Args:
        plane: the mask.
        index: of the views, (rows of taps, columns of taps, 2).
        shift: of the taps from them, in views.
        motion: see `tap_origin`.
        samples: (rows, columns) of a view.
        divide: parts of a view's cell, each way.
        fine: parts of a sample, each way.
        over_samples: whether to average over the sample's cell besides that of the view: samples that are points
            meet the mask in a point.
        decisions: where these are kept, the texture stays in double precision, and its points where they are.

    Raises:
        InputError: samples that meet the mask beyond the points that were kept.
    """
    place = tap_origin(plane.at_index, plane.offset, index, shift, motion)
    view_part = np.abs(plane.view_step(motion)).sum(axis=1) / divide
    sample_part = np.abs(plane.sample_step).sum(axis=1) / fine * over_samples
    footprint = np.hypot(view_part, sample_part)
    bound = np.array(plane.pattern.size) / 2 + footprint
    region = _region(place, plane.sample_step, samples, bound)
    boxes = (view_part, sample_part)
    lattice = _lattice(region, bound, boxes, decisions)
    (column, row), spacing = lattice.first * lattice.spacing, lattice.spacing
    texture = decisions.made(
        "texture",
        lambda: (content(plane.pattern), content(lattice), content(boxes)),
        lambda: _texture(plane.pattern, lattice, boxes, decisions),
    )
    kept = Textured(lattice, boxes, decisions)
    decisions.note(
        Linear(
            lambda thing, field: is_values(thing, field) and holds(plane.pattern, thing),
            lambda plan: tuple(
                f"core.masks[{n}].texture" for n, mask in enumerate(plan.core.masks) if mask.texture is texture
            ),
            lambda cells, weights: texture_back(plane, kept, weights[0], cells),
        )
    )
    lookup = MaskLookup(
        texture=texture,
        column=(place[..., 0] - column) / spacing[0],
        row=(place[..., 1] - row) / spacing[1],
        step=cleaned(plane.sample_step / spacing[:, None], samples, decisions),
        label=plane.label,
    )
    return lookup, kept


def _lattice(
    region: tuple[Array, Array], bound: Array, boxes: tuple[Array, Array], decisions: Decisions
) -> Lattice:
    """The lattice for a region: one, whatever part of the mask is needed: pieces of a light field read alike.

    Args:
        region: lowest and highest (x, y) that are read, metres.
        bound: half the size (x, y) of what there is to read.
        boxes: sizes (x, y) over which patterns are averaged: of a view's part, and of a sample's.
        decisions: the lattice is kept, with room around the region.
    """

    def ends(spacing: Array, low: Array, high: Array) -> tuple[Array, Array]:
        first = np.floor(low / spacing) - AROUND
        return first, np.maximum(np.ceil(high / spacing) + AROUND, first + 2)

    def decided() -> Lattice:
        low, high = region
        room = ROOM * decisions.lasting
        spacing = _spacing(np.hypot(*boxes), np.minimum(2 * bound, high - low))
        low, high = (
            np.maximum(low - room * (high - low), -(1 + room) * bound),
            np.minimum(high + room * (high - low), (1 + room) * bound),
        )
        wider = boxes[0] >= boxes[1]
        narrow = np.minimum(*boxes) * (1 + room) / spacing
        beside = (TEXTURE_FILTER + math.ceil(narrow[0] / 2), TEXTURE_FILTER + math.ceil(narrow[1] / 2))
        return Lattice(*ends(spacing, low, high), spacing, wider, beside)

    lattice = decisions.keep(LATTICE, decided, Lattice.like)
    if decisions.lasting:
        first, last = ends(lattice.spacing, *region)
        if (first < lattice.first).any() or (last > lattice.last).any():
            raise plan_again("where samples meet a mask")
    return lattice


def _region(place: Array, step: Array, samples: tuple[int, int], bound: Array) -> tuple[Array, Array]:
    """The lowest and the highest (x, y) at which samples, and finer ones around them, read within ± bound.

    Args:
        place: of sample (0, 0) of each tap, (..., 2).
        step: 2×2, from sample to sample.
        samples: (rows, columns) of a view.
        bound: half the size (x, y) of what there is to read.
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
    pattern: Pattern, lattice: Lattice, boxes: tuple[Array, Array], decisions: Decisions
) -> NDArray[np.floating]:
    """Means of a pattern over two boxes, one after the other, at points of a lattice: (rows, columns).

    The wider box is taken by the pattern's own means, the other by a filter of the texture.

    Args:
        pattern: of the mask.
        lattice: its points.
        boxes: sizes (x, y) of that of a view's part and of that of a sample's, metres.
        decisions: where these are kept, in double precision.
    """
    x, y, (width, height), filters = _averaged(lattice, boxes)
    means = np.empty((y.size, x.size), dtype=np.float64 if decisions.lasting else np.float32)
    across = x[None, :]
    for n, some in enumerate(_rows_at_once(y.size, x.size)):
        part = decisions.of(f"part {n}")
        means[some] = mean_over(pattern, across, y[some, None], width, height, part)
    return _filtered(means, filters)


def mask_in_path(n: int) -> str:
    """What decisions are about that concern the n-th mask in mid-path."""
    return f"mask {n + 1} in mid-path"


@dataclass(frozen=True, eq=False, repr=False)
class Textured(Brief):
    """How a mask's texture was made.

    Args:
        lattice: its points.
        boxes: sizes (x, y) over which the pattern was averaged: of a view's part, and of a sample's, metres.
        decisions: about it.
    """

    lattice: Lattice
    boxes: tuple[Array, Array]
    decisions: Decisions

    def of(self, pattern: Pattern) -> NDArray[np.floating]:
        """The texture of another pattern, (rows, columns)."""
        return _texture(pattern, self.lattice, self.boxes, self.decisions)

    def seen(self, axis: int, place: Array) -> tuple[Array, Array]:
        """From where to where a pattern counts in what is looked up at places of the texture.

        Args:
            axis: 0 of (x, y), or 1.
            place: columns of the texture, or rows.

        Returns:
            The lowest and the highest x, or y, on the mask, metres.
        """
        spacing = self.lattice.spacing[axis]
        middle = (place + self.lattice.first[axis]) * spacing
        wide = max(self.boxes[0][axis], self.boxes[1][axis])
        reach = (SPLINE + self.lattice.beside[axis]) * spacing + wide / 2
        return middle - reach, middle + reach


def texture_back(plane: Plane, kept: Textured, weights: Array, cells: Cells) -> Array:
    """From weights of a mask's texture to weights of the cells of its pattern.

    Args:
        plane: the mask.
        kept: how its texture was made.
        weights: of the texture's points, (rows, columns).
        cells: the very object.
    """
    from scipy.ndimage import convolve1d

    x, y, size, (across, down) = _averaged(kept.lattice, kept.boxes)
    # Filters are symmetric: a mean counts in all points that its own filter reaches.
    wide = np.pad(weights, [(len(along) // 2,) * 2 for along in (down, across)])
    means = convolve1d(convolve1d(wide, across, axis=1, mode="constant"), down, axis=0, mode="constant")
    total = np.zeros(cells.values.shape)
    for n, some in enumerate(_rows_at_once(y.size, x.size)):
        part = kept.decisions.of(f"part {n}")
        boxes = Boxes(x[None, :], y[some, None], *size)
        total += mean_back(plane.pattern, boxes, part, means[some], cells)
    return total


def _averaged(
    lattice: Lattice, boxes: tuple[Array, Array]
) -> tuple[Array, Array, tuple[float, float], list[Array]]:
    """Places x and y at which a pattern is averaged, over what size, and the filters that means go through."""
    wide, narrow = (np.where(lattice.by_views == views, *boxes) for views in (True, False))
    filters = [
        _filter(float(width), beside)
        for width, beside in zip(narrow / lattice.spacing, lattice.beside, strict=True)
    ]
    x, y = (
        np.arange(first - beside, last + beside + 1) * apart
        for first, last, beside, apart in zip(
            lattice.first, lattice.last, lattice.beside, lattice.spacing, strict=True
        )
    )
    return x, y, (float(wide[0]), float(wide[1])), filters


def _rows_at_once(rows: int, columns: int) -> list[NDArray[np.int64]]:
    """Rows of a texture in pieces that are averaged at once."""
    return np.array_split(np.arange(rows), -(-rows * columns // POINTS_AT_ONCE))


def _filter(box: float, beside: int) -> Array:
    """The filter of a texture along one axis: a mean over a box, and what looking it up by splines takes.

    Args:
        box: its width in points of the texture.
        beside: weights on each side of its middle.
    """
    return symmetric(lambda frequency: np.sinc(box * frequency) * _given_back(frequency), beside)


def _given_back(frequency: Array) -> Array:
    """The gain before a look-up by quadratic B-splines.

    Of a cosine of ν cycles a point these leave sinc³(ν). With s = sin² πν, what gives it back is (arcsin(√s)/√s)³,
    of whose series `GIVEN_BACK` has the first terms: they lack less than splines add at other frequencies.

    Args:
        frequency: ν.
    """
    return np.asarray(np.polynomial.polynomial.polyval(np.sin(np.pi * frequency) ** 2, GIVEN_BACK))


def _filtered(means: NDArray[np.floating], filters: list[Array]) -> NDArray[np.floating]:
    """Means (rows, columns) filtered along columns and rows, without the margin that this takes."""
    from scipy.ndimage import convolve1d

    (across, down) = filters
    down_done = convolve1d(means, down, axis=0, mode="constant")[len(down) // 2 : len(means) - len(down) // 2]
    wide = convolve1d(down_done, across, axis=1, mode="constant")
    return np.ascontiguousarray(wide[:, len(across) // 2 : wide.shape[1] - len(across) // 2])


def texture_error(texture: NDArray[np.floating]) -> float:
    """By how much what is looked up between points of a texture errs, root mean square over all places.

    Splines whose losses are given back follow parabolas. Where the third derivative is d, in points, what is
    looked up f beside a point errs by d·f(¼ − f²)/6, root mean square |d|/√30240: the leading term, too low by a
    tenth where a period has nine points, by a third where it has five. The derivative is taken from four points
    each, two points on from one to the next.

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


def cleaned(step: Array, samples: tuple[int, int], decisions: Decisions = ANEW) -> Array:
    """Steps across a texture, in points from sample to sample, without what is rounding over a whole view.

    Where decisions are kept only what leads from rows to columns and back is, for all else may begin to grow.
    """
    tiny = np.abs(step) * max(samples) < ROUNDING
    if not decisions.lasting:
        return np.where(tiny, 0.0, step)
    crossing = ~np.eye(2, dtype=bool)
    cleared = decisions.keep("steps that are rounding", lambda: tiny & crossing)
    if (cleared & ~tiny).any():
        raise plan_again("rows of samples that lie along rows of a mask")
    return np.where(cleared, 0.0, step)
