"""Absorbing elements as the samples of a light field meet them: where, over what footprint, with what weight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.plan.decisions import ANEW, Decisions
from vcc.plan.footprints.means import Boxes, mean_over
from vcc.plan.footprints.means_back import mean_back
from vcc.shapes.mean_back import holds
from vcc.shapes.patterns import Cells, Pattern, is_grid
from vcc.shapes.sheets import Product, in_one_plane, product_of_means

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Of a cell: less light is what areas that cancel leave, and its middle would jump about."""
ARRAYS_AT_ONCE = 64
"""Arrays of cells that are looked at together."""
PARTS_OF_A_CELL = 6
"""Parts each way by which the open part of a view's cell is found."""


@dataclass(frozen=True, eq=False, repr=False)
class Plane(Brief):
    """An absorbing element as the samples meet it: place = at_index · (i, j, k, l) + offset, metres.

    Places are counted from the element's middle, which stands at ``decentre`` on the axis' plane.
    """

    pattern: Pattern
    label: str
    decentre: tuple[float, float]
    at_index: Array
    offset: Array

    @classmethod
    def at(
        cls,
        place: Array,
        patterns: list[tuple[Pattern, tuple[float, float]]],
        label: str,
        decisions: Decisions = ANEW,
    ) -> Plane:
        """The plane of all patterns that samples meet in one place.

        Args:
            place: (x, y) in metres from index (i, j, k, l, 1), 2×5.
            patterns: each with the place of its middle, metres.
            label: what they are called.
            decisions: by which the place is chosen from which all is counted.
        """
        # About their common middle where they have one, as each of them would be by itself.
        common = decisions.keep("one middle", lambda: len({middle for _, middle in patterns}) == 1)
        decentre = patterns[0][1] if common else (0.0, 0.0)
        pattern = in_one_plane([(one, (x - decentre[0], y - decentre[1])) for one, (x, y) in patterns])
        return cls(pattern, label, decentre, place[:, :4], place[:, 4] - np.array(decentre))

    @classmethod
    def met_by(
        cls, frame: Affine, rays: Affine, pattern: Pattern, decentre: tuple[float, float], label: str
    ) -> Plane:
        """The plane of a pattern as samples of this frame meet it, ``rays`` leading from them to the plane."""
        return cls.at((rays @ frame).matrix[:2], [(pattern, decentre)], label)

    def middle_of_view(self, samples: tuple[int, int]) -> Array:
        """Where the middle of view (0, 0) falls, (x, y) in metres; views have (rows, columns) of samples."""
        rows, columns = samples
        return np.asarray(self.offset + self.sample_step @ np.array([(columns - 1) / 2, (rows - 1) / 2]))

    def boxes(self, index: Array, shift: Array, motion: Array, samples: tuple[int, int], divide: int = 1) -> Boxes:
        """The taps' cells on a plane that tells views apart only; see `tap_origin`."""
        place = tap_origin(self.at_index, self.middle_of_view(samples), index, shift, motion)
        width, height = np.abs(self.view_step(motion)).sum(axis=1) / divide
        x, y = place[..., 0], place[..., 1]
        if (x == x[:1]).all() and (y == y[:, :1]).all() and x.ndim == 2:
            x, y = x[:1], y[:, :1]  # a row and a column of places say it all
        return Boxes(x, y, float(width), float(height))

    def view_step(self, motion: Array) -> Array:
        """2×2: metres moved here per view, a point of the scene being followed."""
        return np.asarray(self.at_index[:, :2] - self.at_index[:, 2:] @ motion)

    @property
    def sample_step(self) -> Array:
        """2×2: metres moved here per sample within a view."""
        return np.asarray(self.at_index[:, 2:])


def depends_on_view_only(plane: Plane, samples: tuple[int, int], motion: Array) -> bool:
    """Whether all samples of a view meet the plane in one place, but for rounding."""
    cell = np.abs(plane.view_step(motion)).sum(axis=1)
    travel = np.abs(plane.sample_step) @ np.array([samples[1], samples[0]])
    return bool((travel <= 1e-6 * cell).all())


def tap_origin(at_index: Array, offset: Array, index: Array, shift: Array, motion: Array) -> Array:
    """Where sample (0, 0) of each tap falls, (rows, columns, 2); shifts follow the scene's parallax."""
    view_step = at_index[:, :2] - at_index[:, 2:] @ motion
    return np.asarray(index @ at_index[:, :2].T + shift @ view_step.T + offset)


@dataclass(frozen=True, eq=False, repr=False)
class OpenParts(Brief):
    """What of each tap's cell of the aperture is open.

    Args:
        weights: the open share of each tap's cell, (rows of taps, columns of taps).
        middle: the middle of the open part, in views from the middle of the cell, (rows, columns, 2) as (i, j).
    """

    weights: Array
    middle: Array


@dataclass(frozen=True, eq=False, repr=False)
class Aperture(Brief):
    """Planes that tell views apart only, as the taps of a plan meet them; for places see `tap_origin`.

    Args:
        planes: one or several.
        index: of the views, (rows of taps, columns of taps, 2).
        shift: of the taps from them, in views.
        motion: of the scene.
        samples: (rows, columns) of a view.
        divide: parts of a view's cell, each way.
        decisions: by which means are taken.
    """

    planes: list[Plane]
    index: Array
    shift: Array
    motion: Array
    samples: tuple[int, int]
    divide: int
    decisions: Decisions = ANEW

    def whole_cells(self) -> list[Array]:
        """Each plane's open share of each tap's cell, (rows, columns)."""
        return [
            mean_over(plane.pattern, *self._boxes(plane), self._of_cells(n)) for n, plane in enumerate(self.planes)
        ]

    def parts(self) -> list[Array]:
        """The same of parts of the cells, (rows, columns, parts down, parts across)."""
        return [
            mean_over(plane.pattern, *self._boxes(plane, self._inside), self._of_parts(n))
            for n, plane in enumerate(self.planes)
        ]

    def open_parts(self) -> OpenParts:
        """What of each tap's cell is open.

        A cell that a rim cuts is lit through a part of it, and what other masks do to that light they do around
        the middle of that part.
        """
        weights = np.ones(self.index.shape[:2])
        middle = np.zeros((*self.index.shape[:2], 2))
        if not self.planes:
            return OpenParts(weights, middle)
        shares = _product(self.parts())
        light, lit = self._light(shares)
        middle[lit] = (shares[..., None] * self._inside).sum(axis=(2, 3))[lit] / light[lit][:, None]
        return OpenParts(self._open_shares(shares), middle)

    def open_shares(self) -> Array:
        """The weights of `open_parts` alone."""
        return self._open_shares(_product(self.parts()) if len(self.planes) > 1 else np.ones(1))

    def open_shares_of(self, cells: Cells, values: Array) -> Array | None:
        """`open_shares` with several arrays (arrays, rows, columns) in the place of the only plane's cells.

        Returns:
            (arrays, rows of taps, columns of taps); None where they have to be found one by one.
        """
        if len(self.planes) != 1 or self.planes[0].pattern is not cells:
            return None
        x, y, width, height = self._boxes(self.planes[0])
        return cells.means(values, x.ravel(), y.ravel(), width, height) if is_grid(x, y) else None

    def _open_shares(self, shares: Array) -> Array:
        # Apart from each other: what several leave of a cell is not the product of their shares.
        return shares.mean(axis=(2, 3)) if len(self.planes) > 1 else self.whole_cells()[0]

    def back(self, weights: OpenParts, cells: Cells) -> Array:
        """From weights of `open_parts` to weights of the cells of one of the planes, this very object."""
        shares = self.parts()
        light, lit = self._light(_product(shares))
        middle = self.open_parts().middle
        from_middle = ((self._inside - middle[:, :, None, None]) * weights.middle[:, :, None, None]).sum(axis=-1)
        of_shares = np.where(lit[..., None, None], from_middle / np.where(lit, light, 1.0)[..., None, None], 0.0)
        if len(self.planes) > 1:
            of_shares = of_shares + weights.weights[..., None, None] / PARTS_OF_A_CELL**2
        total = np.zeros(cells.values.shape)
        for n, plane in enumerate(self.planes):
            if not holds(plane.pattern, cells):
                continue
            others = _product([share for m, share in enumerate(shares) if m != n])
            boxes = self._boxes(plane, self._inside)
            total += mean_back(plane.pattern, boxes, self._of_parts(n), of_shares * others, cells)
            if len(self.planes) == 1:
                boxes = self._boxes(plane)
                total += mean_back(plane.pattern, boxes, self._of_cells(n), weights.weights, cells)
        return total

    @property
    def _inside(self) -> Array:
        """Middles of the parts of a cell, in views from its own, (parts, parts, 2)."""
        part = ((np.arange(PARTS_OF_A_CELL) + 0.5) / PARTS_OF_A_CELL - 0.5) / self.divide
        return np.stack(np.meshgrid(part, part), axis=-1)

    def _boxes(self, plane: Plane, inside: Array | None = None) -> Boxes:
        """The taps' cells on a plane, or with ``inside`` parts of them."""
        index, shift, divide = self.index, self.shift, self.divide
        if inside is not None:
            shift = shift[:, :, None, None] + inside
            index = np.broadcast_to(index[:, :, None, None], shift.shape)
            divide *= PARTS_OF_A_CELL
        return plane.boxes(index, shift, self.motion, self.samples, divide)

    def _of_cells(self, n: int) -> Decisions:
        return self.decisions.of(f"mask {n + 1} at the views")

    def _of_parts(self, n: int) -> Decisions:
        return self.decisions.of(f"parts of mask {n + 1} at the views")

    def _light(self, shares: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The light through each tap's cell, and which taps are lit."""
        light = shares.sum(axis=(2, 3))
        least = ROUNDING if self.decisions.lasting else 0.0
        return light, self.decisions.keep("taps that are lit", lambda: light > least) & (light > least)


def _product(shares: list[Array]) -> Array:
    return reduce(np.multiply, shares, np.ones(1))


def _fine_means(pattern: Pattern, x: Array, y: Array, width: float, height: float) -> Array:
    """Means over cells so fine that two edges hardly share one: of a product, the product of means."""
    if isinstance(pattern, Product) and len(pattern.factors) > 1:
        return product_of_means(pattern.factors, x, y, width, height)
    return pattern.mean(x, y, width, height)


def _means_around(values: Array, length: float) -> Array:
    """Means over so many rows, 1 or more, around each row; zeros beyond the first and the last."""
    if length == 1:
        return values
    rows, whole = len(values), int((length - 1) / 2)
    cut = (length - 1) / 2 - whole  # what counts of the rows at the ends
    padded = np.zeros((rows + 2 * whole + 2, *values.shape[1:]))
    padded[whole + 1 : whole + 1 + rows] = values
    means = padded[:rows] + padded[2 * whole + 2 :]
    means *= cut
    for above, sums in pairwise(padded):
        sums += above  # NumPy's own running sums go down column by column, which takes several times as long
    means += padded[2 * whole + 1 : -1]
    means -= padded[:rows]
    means /= length
    return means


def detail_lost(plane: Plane, known: Array, added: Array) -> float:
    """The share of a pattern's variance that averaging over ``added`` takes away after ``known``, metres."""

    def looked_at(x: Array, y: Array, cell: tuple[float, float]) -> Array:
        return np.broadcast_to(_fine_means(plane.pattern, x[None, :], y[:, None], *cell), (y.size, x.size))[None]

    return float(_details_lost(plane.pattern.size, looked_at, known, added)[0])


def details_lost(cells: Cells, values: Array, known: Array, added: Array) -> Array:
    """`detail_lost` of each of several arrays, (arrays, rows, columns), in the place of an array of cells."""

    def of_some(some: Array) -> Array:
        return _details_lost(cells.size, lambda x, y, cell: cells.means(some, x, y, *cell), known, added)

    return np.concatenate([of_some(some) for some in np.array_split(values, -(-len(values) // ARRAYS_AT_ONCE))])


def _details_lost(
    size_of_pattern: tuple[float, float],
    looked_at: Callable[[Array, Array, tuple[float, float]], Array],
    known: Array,
    added: Array,
) -> Array:
    """`detail_lost` of patterns of one size; ``looked_at`` finds means over small cells, (patterns, y, x)."""
    if (added <= 0).all():
        return np.zeros(len(looked_at(np.zeros(1), np.zeros(1), (1.0, 1.0))))
    bounded = np.isfinite(size_of_pattern)
    size = np.minimum(size_of_pattern, 1.0) if bounded.all() else np.full(2, 64 * max(*known, *added))
    fine = np.maximum(np.maximum(known, added) / 8, size / 512)
    counts = np.maximum(np.ceil(size / fine).astype(int), 8)
    cell = size / counts
    x, y = (((np.arange(count) + 0.5) / count - 0.5) * side for count, side in zip(counts, size, strict=True))
    # Averaged once as finely as it is looked at, and these means averaged further.
    values = looked_at(x, y, (float(cell[0]), float(cell[1])))
    whole = values.var(axis=(1, 2))
    by_row = np.clip(values, 0.0, 1.0).transpose(1, 0, 2)
    # A pattern without bounds goes on beyond what is looked at: only what lies within is compared.
    reach = np.ceil(np.where(bounded, 0.0, np.hypot(known, added) / 2 / cell)).astype(int)
    across, down = (slice(n, max(count - n, n + 1)) for n, count in zip(reach, counts, strict=True))

    def variance(box: Array) -> Array:
        # What is twice as wide as the pattern holds all of it wherever it lies: what is wider has less on average.
        wide, high = np.clip(box, cell, 2 * size) / cell
        share = float(np.prod(np.minimum(1.0, 2 * size / np.maximum(box, cell))))
        down_done = _means_around(by_row, float(high))[down]
        means = _means_around(down_done.transpose(2, 1, 0), float(wide))[across]
        return np.asarray(share**2 * means.var(axis=(0, 2)))

    even = whole < 1e-12
    return np.where(even, 0.0, (variance(known) - variance(np.hypot(known, added))) / np.where(even, 1.0, whole))
