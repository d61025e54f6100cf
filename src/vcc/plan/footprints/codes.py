"""Plans of cameras that differ in the cells of one mask: the other plans, or the images, follow from one plan.

The cells of a mask at the views determine the weights of views, the views that are used and the missing rays, and
nothing else in a plan if no mask in mid-path meets light through parts of views' cells. The cells of a mask in
mid-path determine its texture, and how finely cells of views and samples are divided.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.fields.grid import Grid
from vcc.optics.mask import Mask
from vcc.optics.train import Train
from vcc.plan.footprints.batch import Apart, Looks
from vcc.plan.footprints.cells import Detail
from vcc.plan.footprints.compile import ByFootprints, choose_taps
from vcc.plan.footprints.detail import detail_lost, details_lost
from vcc.plan.footprints.diffusers import Blurs
from vcc.plan.footprints.mixtures import Mixture, of_cells, of_views
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.planes import Plane
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.shapes.mean_back import holds
from vcc.shapes.patterns import Bounded, Cells, Pattern
from vcc.shapes.stacked_patterns import Product, Shifted

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Codes(Brief):
    """Cameras that differ in the cells of one mask.

    Args:
        first: the first camera.
        base: the first camera with all of these cells open.
        open: the cells of its mask.
        cells: of each camera's mask.
        number: of the mask among the elements.
    """

    first: Train
    base: Train
    open: Cells
    cells: tuple[Cells, ...]
    number: int

    @classmethod
    def of(cls, trains: Sequence[Train]) -> Codes | None:
        """Compare cameras; None if they differ in anything but the cells of one mask."""
        first, found = trains[0], set[int]()
        for train in trains[1:]:
            if train.sensor != first.sensor or len(train.elements) != len(first.elements):
                return None
            pairs = zip(train.elements, first.elements, strict=True)
            found |= {n for n, (one, other) in enumerate(pairs) if one is not other and one != other}
        if len(found) != 1:
            return None
        (number,) = found
        masks = [train.elements[number] for train in trains]
        cells = [mask.pattern for mask in masks if isinstance(mask, Mask) and _alike(mask, masks[0])]
        listed = tuple(each for each in cells if isinstance(each, Cells))
        if len(listed) < len(masks):
            return None
        opened = replace(listed[0], values=np.ones(listed[0].values.shape))
        elements = [
            replace(one, pattern=opened) if isinstance(one, Mask) and one is masks[0] else one
            for one in first.elements
        ]
        return cls(first, Train(elements, first.sensor), opened, listed, number)

    def plans(self, grid: Grid, how: How) -> list[Plan] | None:
        """The plan of each camera, without its missing light; None if each plan has to be made separately."""
        one = self._at_views(grid, how)
        return None if one is None else [self._plan(one, each) for each in self.cells]

    def mixture(self, grid: Grid, how: How) -> Mixture | None:
        """The images of all cameras, or of many, as sums of fewer images; None if that is not possible."""
        if not self._folded:
            return None
        one = self._at_views(grid, how)
        if one is None:
            return self._of_path(grid, how)
        assert isinstance(one.plan.core, Footprints)
        if one.plan.core.weights.size > len(self.cells):
            return None
        weights = np.zeros((len(self.cells), *one.open_taps.taps.shares.shape))
        known = one.open_aperture.open_shares_of(self.open, np.stack([cells.values for cells in self.cells]))
        for n, cells in enumerate(self.cells):
            taps, found = self._weighed(one, cells, None if known is None else known[n])
            weights[n][taps] = found
        return of_views(one.plan, weights)

    @property
    def _folded(self) -> bool:
        """Whether nothing scatters, bends rays by a function of position, or transmits by place and slope."""
        return all(
            stage.faces.spread is None and stage.faces.bending is None and stage.faces.by_ray is None
            for stage in self.base.stages
        )

    def _at_views(self, grid: Grid, how: How) -> ByFootprints | None:
        """The common plan, with all cells open; None if the mask affects more than the weights of views."""
        if not self._folded:
            return None
        one = ByFootprints(self.base, grid, how, Blurs(None, None))
        at_views = [holds(plane.pattern, self.open) for plane in one.aperture.planes]
        return one if one.alone and any(at_views) else None

    def _of_path(self, grid: Grid, how: How) -> Mixture | None:
        one = ByFootprints(self.first, grid, how, Blurs(None, None))
        core, own, planes = one.plan.core, self.cells[0], one.absorbing.in_path
        masks = [n for n, plane in enumerate(planes) if plane.pattern is own]
        elsewhere = [plane for plane in (*one.absorbing.at_views, *planes) if holds(plane.pattern, own)]
        if len(masks) != 1 or len(elsewhere) != 1 or not (isinstance(core, Footprints) and core.separable):
            return None
        details = _Details(planes[masks[0]], self.cells)
        members = [n for n in range(len(self.cells)) if one.same_by(details.of(n))]
        cells = [self.cells[n] for n in members]
        return of_cells(one.plan, masks[0], one.textures[masks[0]], members, cells, len(members))

    def _weighed(
        self, one: ByFootprints, cells: Cells, shares: Array | None = None
    ) -> tuple[tuple[NDArray[np.intp], ...], Array]:
        """The effect of some cells on the views: an open mesh of the used taps, and their weights.

        Args:
            one: the common plan.
            cells: that replace the open ones.
            shares: open shares of the views, if already computed.
        """
        if shares is None:
            planes = [replace(p, pattern=exchanged(p.pattern, self.open, cells)) for p in one.aperture.planes]
            shares = replace(one.open_aperture, planes=planes).open_shares()
        weights = one.open_taps.taps.shares * shares
        keep = np.ix_(*choose_taps(weights))
        return keep, weights[keep]

    def _plan(self, one: ByFootprints, cells: Cells) -> Plan:
        core, (taps, weights) = one.plan.core, self._weighed(one, cells)
        assert isinstance(core, Footprints)
        rows, columns = (some.ravel() for some in taps)
        changed = replace(
            core,
            view_rows=core.view_rows[rows],
            view_columns=core.view_columns[columns],
            weights=weights,
            x=core.x[taps],
            y=core.y[taps],
        )
        return replace(one.plan, core=changed)


class _Details:
    """Detail of masks that differ in their cells, computed for all of them in one batch.

    Args:
        plane: the mask that differs, with the first of its cells.
        cells: of all masks.
    """

    def __init__(self, plane: Plane, cells: Sequence[Cells]) -> None:
        self.plane, self.cells = plane, np.stack([each.values for each in cells])
        self.found: dict[Any, NDArray[np.float64]] = {}

    def of(self, number: int) -> Detail:
        """The detail of one of the cameras."""
        return _OneOfMany(self, number)

    def lost(self, plane: Plane, known: Array, added: Array) -> Array:
        """`detail_lost` of each camera."""
        key = id(plane), *known.tolist(), *added.tolist()
        if key not in self.found:
            own = self.plane.pattern
            assert isinstance(own, Cells)
            self.found[key] = (
                details_lost(own, self.cells, known, added)
                if plane is self.plane
                else np.full(len(self.cells), detail_lost(plane, known, added))
            )
        return self.found[key]


class _OneOfMany(Detail):
    def __init__(self, details: _Details, number: int) -> None:
        self._details, self._number = details, number

    def lost(self, plane: Plane, known: Array, added: Array) -> float:
        return float(self._details.lost(plane, known, added)[self._number])

    def joint_variation(self, looks: Looks) -> Apart:
        own = self._details.plane
        values = [looks.values(n) for n in range(len(looks.groups))]
        place = next(n for n, group in enumerate(looks.groups) if any(plane is own for plane in group))
        assert isinstance(own.pattern, Cells)
        cells = replace(own.pattern, values=self._details.cells[self._number])
        values[place] = cells(*np.moveaxis(looks.places[place][0], -1, 0))
        return looks.apart(values)


def exchanged(pattern: Pattern, old: Cells, new: Cells) -> Pattern:
    """Replace cells that are a part of a pattern (the same object) by others."""
    if pattern is old:
        return new
    if isinstance(pattern, Product):
        return Product(tuple(exchanged(part, old, new) for part in pattern.patterns))
    if isinstance(pattern, Bounded | Shifted):
        return replace(pattern, pattern=exchanged(pattern.pattern, old, new))
    return pattern


def _alike(one: Mask, other: object) -> bool:
    """Whether both masks are arrays of equally many cells, of the same size and in the same place."""
    if not (isinstance(other, Mask) and isinstance(one.pattern, Cells) and isinstance(other.pattern, Cells)):
        return False
    mine, others = one.pattern, other.pattern
    same_sheet = (mine.values.shape, mine.width, mine.height, mine.middle) == (
        others.values.shape,
        others.width,
        others.height,
        others.middle,
    )
    rest = [each.name for each in fields(one) if each.name not in ("pattern", "source")]
    return same_sheet and all(getattr(one, name) == getattr(other, name) for name in rest)
