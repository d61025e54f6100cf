"""Masks at the views as the taps of a plan meet them: the open share of each cell, and its place."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.values import content
from vcc.plan.following import NONE_KEPT, Parts, choice
from vcc.plan.footprints.means import Boxes, MeanChoice, choose_mean, mean_back, mean_over
from vcc.plan.footprints.planes import Plane
from vcc.plan.footprints.taps import Mesh, Taps
from vcc.shapes.mean_back import holds
from vcc.shapes.patterns import Cells, is_grid

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Share of a cell: less light is the residue of areas that cancel, and its middle would jump."""
PARTS_OF_A_CELL = 6
"""Parts each way by which the place of the open part of a view's cell is estimated."""


@dataclass(frozen=True, eq=False, repr=False)
class OpenParts(Brief):
    """The open part of each tap's cell of the aperture.

    Args:
        weights: the open share of each tap's cell, (rows of taps, columns of taps).
        middle: the middle of the open part, in views from the middle of the cell, (rows, columns, 2) as (i, j).
    """

    weights: Array
    middle: Array


Tiles = tuple[tuple[MeanChoice | None, ...], ...]
"""How means are computed, by plane, and by the rectangles that stand for a cell there."""


@dataclass(frozen=True, eq=False, repr=False)
class CellChoices(Brief):
    """Choices for the cells of taps of one level.

    Args:
        whole: how means over cells are computed.
        parts: how means over parts of cells are computed.
        lit: which taps are lit.
    """

    whole: Tiles
    parts: Tiles
    lit: NDArray[np.bool_] = choice("taps that are lit")


@dataclass(frozen=True, eq=False, repr=False)
class Aperture(Brief):
    """Planes on which each view falls into one point, as the taps of a plan meet them.

    Args:
        planes: one or several.
        taps: of the plan.
        motion: of the scene.
        samples: (rows, columns) of a view.
        chosen: for taps of each level, if parameters follow a camera.
    """

    planes: list[Plane]
    taps: Taps
    motion: Array
    samples: tuple[int, int]
    chosen: tuple[CellChoices, ...] | None = None

    def choices(self) -> tuple[CellChoices, ...]:
        """Choose how the cells of taps of each level are averaged so that parameters follow a camera."""
        return tuple(cells.choices() for cells in self._cells())

    def open_parts(self, parts: Parts = NONE_KEPT) -> OpenParts:
        """The open part of each tap's cell.

        If a rim cuts a cell, light passes a part of the cell. Other masks act on this light at the middle of
        that part.

        Args:
            parts: cached parts of nearby plans.
        """
        return parts.part(
            "what is open of views",
            lambda: content(
                (
                    [
                        (each.pattern, each.at_index, each.offset, each.view_step(self.motion))
                        for each in self.planes
                    ],
                    (self.taps.index, self.taps.shift, self.samples),
                )
            ),
            self._open_parts,
        )

    def _open_parts(self) -> OpenParts:
        weights = np.ones(self.taps.shares.shape)
        middle = np.zeros((*weights.shape, 2))
        for cells in self._cells() if self.planes else ():
            shares = _product(cells.parts())
            light, lit = cells.light(shares)
            here = np.zeros((*light.shape, 2))
            here[lit] = (shares[..., None] * cells.inside).sum(axis=(2, 3))[lit] / light[lit][:, None]
            middle[cells.mesh], weights[cells.mesh] = here, cells.open_shares(shares)
        return OpenParts(weights, middle)

    def open_shares(self) -> Array:
        """The weights of `open_parts` alone."""
        weights = np.ones(self.taps.shares.shape)
        for cells in self._cells():
            weights[cells.mesh] = cells.open_shares()
        return weights

    def open_shares_of(self, cells: Cells, values: Array) -> Array | None:
        """`open_shares` for several arrays (arrays, rows, columns) in place of the only plane's cells.

        Returns:
            (arrays, rows of taps, columns of taps); None if they have to be computed one by one.
        """
        (here, *others) = self._cells()
        if others or not here.closed or self.planes[0].pattern is not cells:
            return None
        ((boxes, _),) = here.whole(0)
        if not is_grid(boxes.x, boxes.y):
            return None
        return cells.means(values, boxes.x.ravel(), boxes.y.ravel(), boxes.width, boxes.height)

    def back(self, weights: OpenParts, cells: Cells) -> Array:
        """From weights of `open_parts` to weights of the cells of one of the planes (the same object)."""
        total, middles = np.zeros(cells.values.shape), self.open_parts().middle
        for here in self._cells():
            shares = here.parts()
            light, lit = here.light(_product(shares))
            middle, to_middle = middles[here.mesh], weights.middle[here.mesh]
            from_middle = ((here.inside - middle[:, :, None, None]) * to_middle[:, :, None, None]).sum(axis=-1)
            of_shares = np.where(
                lit[..., None, None], from_middle / np.where(lit, light, 1.0)[..., None, None], 0.0
            )
            if not here.closed:
                of_shares = of_shares + weights.weights[here.mesh][..., None, None] / PARTS_OF_A_CELL**2
            for n, plane in enumerate(self.planes):
                if not holds(plane.pattern, cells):
                    continue
                others = _product([share for m, share in enumerate(shares) if m != n])
                total += here.back(n, of_shares * others, cells, whole=False)
                if here.closed:
                    total += here.back(n, weights.weights[here.mesh], cells, whole=True)
        return total

    def _cells(self) -> list[_Cells]:
        """The cells of the taps of each level."""
        levels = list(self.taps.levels())
        chosen = self.chosen or (None,) * len(levels)
        return [_Cells(self, *level, its) for level, its in zip(levels, chosen, strict=True)]


@dataclass(frozen=True, eq=False, repr=False)
class _Cells(Brief):
    """The cells of taps of one level, and their open parts.

    Args:
        aperture: of the taps.
        mesh: an open mesh of their (rows, columns).
        divide: parts into which a view's cell is divided each way; each cell is one part.
        chosen: for these cells; None if parameters follow no camera.
    """

    aperture: Aperture
    mesh: Mesh
    divide: int
    chosen: CellChoices | None

    def choices(self) -> CellChoices:
        """Choose how the cells are averaged so that parameters follow a camera."""
        planes = [plane.pattern for plane in self.aperture.planes]
        whole, parts = (
            tuple(tuple(choose_mean(pattern, box) for box, _ in boxes(n)) for n, pattern in enumerate(planes))
            for boxes in (self.whole, self._divided)
        )
        own = CellChoices(whole, parts, np.ones(self.shift.shape[:2], dtype=np.bool_))
        if not planes:
            return own
        return replace(own, lit=replace(self, chosen=own).light(_product(replace(self, chosen=own).parts()))[1])

    def light(self, shares: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The light through each cell, and which taps are lit; ``shares``: the product of `parts`."""
        light = shares.sum(axis=(2, 3))
        if self.chosen is None:
            return light, light > 0
        return light, self.chosen.lit & (light > ROUNDING)

    @property
    def inside(self) -> Array:
        """Middles of the parts of a cell, in views from the cell's middle, (parts, parts, 2)."""
        part = ((np.arange(PARTS_OF_A_CELL) + 0.5) / PARTS_OF_A_CELL - 0.5) / self.divide
        return np.stack(np.meshgrid(part, part), axis=-1)

    @property
    def closed(self) -> bool:
        """Whether the open share of a whole cell is a single mean: of one plane, with cells along its axes.

        The open share through several planes is not the product of their shares. For a rotated cell, the means
        over the rectangles that stand for it come from its parts.
        """
        return len(self.aperture.planes) == 1 and len(self.whole(0)) == 1

    def open_shares(self, shares: Array | None = None) -> Array:
        """The open share of each cell, (rows, columns); ``shares``: the product of `parts` if already computed."""
        if self.closed:
            return self._means(0, whole=True)
        return np.asarray((_product(self.parts()) if shares is None else shares).mean(axis=(2, 3)))

    def parts(self) -> list[Array]:
        """Each plane's open share of the parts of cells, (rows, columns, parts down, parts across)."""
        return [self._means(n, whole=False) for n in range(len(self.aperture.planes))]

    def back(self, n: int, weights: Array, cells: Cells, whole: bool) -> Array:
        """From weights of the open shares of whole cells, or of their parts, to weights of a plane's cells."""
        pattern = self.aperture.planes[n].pattern
        found = [
            mean_back(pattern, box, its, share * weights, cells) for box, share, its in self._rectangles(n, whole)
        ]
        return np.asarray(np.sum(found, axis=0))

    def whole(self, n: int) -> list[tuple[Boxes, float]]:
        """The cells on a plane."""
        return self._boxes(n, self.index, self.shift, self.divide)

    def _divided(self, n: int) -> list[tuple[Boxes, float]]:
        """The parts of the cells on a plane."""
        shift = self.shift[:, :, None, None] + self.inside
        index = np.broadcast_to(self.index[:, :, None, None], shift.shape)
        return self._boxes(n, index, shift, self.divide * PARTS_OF_A_CELL)

    @property
    def index(self) -> Array:
        """Of the views; see `Taps`."""
        return self.aperture.taps.index[self.mesh]

    @property
    def shift(self) -> Array:
        """Of the taps from the views; see `Taps`."""
        return self.aperture.taps.shift[self.mesh]

    def _boxes(self, n: int, index: Array, shift: Array, parts: int) -> list[tuple[Boxes, float]]:
        aperture = self.aperture
        return aperture.planes[n].boxes(index, shift, aperture.motion, aperture.samples, parts)

    def _rectangles(self, n: int, whole: bool) -> list[tuple[Boxes, float, MeanChoice | None]]:
        """The rectangles of cells, or of their parts, with their shares and how means over them are computed."""
        boxes = self.whole(n) if whole else self._divided(n)
        if self.chosen is None:
            return [(box, share, None) for box, share in boxes]
        chosen = (self.chosen.whole if whole else self.chosen.parts)[n]
        return [(*box, its) for box, its in zip(boxes, chosen, strict=True)]

    def _means(self, n: int, whole: bool) -> Array:
        pattern = self.aperture.planes[n].pattern
        means = [share * mean_over(pattern, box, its) for box, share, its in self._rectangles(n, whole)]
        return np.asarray(sum(means[1:], start=means[0]))


def _product(shares: list[Array]) -> Array:
    return reduce(np.multiply, shares, np.ones(1))
