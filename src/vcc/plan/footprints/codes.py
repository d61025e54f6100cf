"""Plans of cameras that differ in the cells of one mask: one is made, and others or their pictures follow from it.

What the cells of a mask at the views let through decides the weights of views, which of these are looked at, and
which rays are missing; nothing else in a plan, as long as no mask in mid-path meets light through parts of views'
cells. Those of a mask in mid-path decide its texture, and how finely cells of views and samples are divided.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.fields.grid import Grid
from vcc.optics.mask import Mask
from vcc.optics.train import Train
from vcc.plan.footprints.compile import Compiled, compiled, used_taps
from vcc.plan.footprints.coverage import missing_rays, outside_views_of
from vcc.plan.footprints.diffusers import Blurs
from vcc.plan.footprints.mixtures import Mixture, of_cells, of_views
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.planes import Aperture, Plane, detail_lost, details_lost
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.shapes.mean_back import holds
from vcc.shapes.patterns import Bounded, Cells, Pattern
from vcc.shapes.sheets import Product, Shifted


@dataclass(frozen=True, eq=False, repr=False)
class Codes(Brief):
    """Cameras that differ in the cells of one mask.

    Args:
        first: the first camera.
        base: it with all of these cells open.
        open: the cells of its mask.
        cells: those of each camera.
    """

    first: Train
    base: Train
    open: Cells
    cells: tuple[Cells, ...]

    @classmethod
    def of(cls, trains: Sequence[Train]) -> Codes | None:
        """What cameras differ in; None where that is anything but the cells of one mask."""
        first, found = trains[0], set[int]()
        for train in trains[1:]:
            if train.sensor != first.sensor or len(train.elements) != len(first.elements):
                return None
            pairs = zip(train.elements, first.elements, strict=True)
            found |= {n for n, (one, other) in enumerate(pairs) if one is not other and one != other}
        if len(found) != 1:
            return None
        masks = [train.elements[next(iter(found))] for train in trains]
        cells = [mask.pattern for mask in masks if isinstance(mask, Mask) and _alike(mask, masks[0])]
        listed = tuple(each for each in cells if isinstance(each, Cells))
        if len(listed) < len(masks):
            return None
        opened = replace(listed[0], values=np.ones(listed[0].values.shape))
        elements = [
            replace(one, pattern=opened) if isinstance(one, Mask) and one is masks[0] else one
            for one in first.elements
        ]
        return cls(first, Train(elements, first.sensor), opened, listed)

    def plans(self, grid: Grid, how: How) -> list[Plan] | None:
        """The plan of each camera; None where each has to be made by itself."""
        one = self._at_views(grid, how)
        return None if one is None else [self._plan(one, grid, each) for each in self.cells]

    def mixture(self, grid: Grid, how: How) -> Mixture | None:
        """The pictures of all cameras, or of many, as sums of fewer; None where that is not so."""
        if not self._folded:
            return None
        one = self._at_views(grid, how)
        if one is None:
            return self._of_path(grid, how)
        assert isinstance(one.plan.core, Footprints)
        if one.plan.core.weights.size > len(self.cells):
            return None
        weights, missing = np.zeros((len(self.cells), *one.shares.shape)), []
        known = _Known.of(one.aperture, self.open, np.stack([cells.values for cells in self.cells]), grid)
        for n, cells in enumerate(self.cells):
            found = self._weighed(one, grid, cells, known[n] if known else None)
            weights[n][found.taps] = found.weights
            missing.append(found.missing)
        return of_views(one.plan, weights, missing)

    @property
    def _folded(self) -> bool:
        """Whether nothing scatters, and nothing bends rays by a function of position."""
        return all(stage.faces.spread is None and stage.faces.bending is None for stage in self.base.stages)

    def _at_views(self, grid: Grid, how: How) -> Compiled | None:
        """The plan from which all follow, with all cells open; None where the mask is not at the views alone."""
        if not self._folded:
            return None
        one = compiled(self.base, grid, how, Blurs(None, None))
        at_views = [holds(plane.pattern, self.open) for plane in one.aperture.planes]
        return one if one.alone and any(at_views) else None

    def _of_path(self, grid: Grid, how: How) -> Mixture | None:
        one = compiled(self.first, grid, how, Blurs(None, None))
        core, own, path = one.plan.core, self.cells[0], one.in_path
        masks = [n for n, plane in enumerate(path.planes) if plane.pattern is own]
        elsewhere = [plane for plane in path.all if holds(plane.pattern, own)]
        if len(masks) != 1 or len(elsewhere) != 1 or not (isinstance(core, Footprints) and core.separable):
            return None
        lost = _Lost(path.planes[masks[0]], self.cells)
        members = [n for n in range(len(self.cells)) if path.same_by(lost.of(n), how)]
        cells = [self.cells[n] for n in members]
        return of_cells(one.plan, masks[0], path.textures[masks[0]], members, cells, len(members))

    def _weighed(self, one: Compiled, grid: Grid, cells: Cells, known: _Known | None = None) -> _Weighed:
        """What some cells leave of the views; what is known of it already need not be found."""
        core, aperture = one.plan.core, one.aperture
        assert isinstance(core, Footprints)
        planes = [replace(p, pattern=exchanged(p.pattern, self.open, cells)) for p in aperture.planes]
        shares = known.shares if known else replace(aperture, planes=planes).open_shares()
        weights = one.shares * shares
        rows, columns = used_taps(weights)
        keep = np.ix_(rows, columns)
        weights = weights[keep]
        missing = missing_rays(
            planes,
            grid.shape,
            aperture.samples,
            weights,
            one.tap[keep],
            core.step,
            one.plan.sensor_shape,
            known.outside if known else None,
        )
        return _Weighed(keep, weights, missing)

    def _plan(self, one: Compiled, grid: Grid, cells: Cells) -> Plan:
        core, found = one.plan.core, self._weighed(one, grid, cells)
        assert isinstance(core, Footprints)
        rows, columns = (taps.ravel() for taps in found.taps)
        changed = replace(
            core,
            view_rows=core.view_rows[rows],
            view_columns=core.view_columns[columns],
            weights=found.weights,
            x=core.x[found.taps],
            y=core.y[found.taps],
        )
        missing, reason = found.missing
        return replace(one.plan, core=changed, missing_rays=missing, missing_reason=reason)


@dataclass(frozen=True, eq=False, repr=False)
class _Known(Brief):
    """What is found for all cameras at once.

    Args:
        shares: the open shares of views.
        outside: the share of the aperture outside the grid of views.
    """

    shares: NDArray[np.float64]
    outside: float

    @classmethod
    def of(cls, aperture: Aperture, cells: Cells, values: NDArray[np.float64], grid: Grid) -> list[_Known]:
        """For each array in the place of cells; nothing where it has to be found one by one."""
        shares = aperture.open_shares_of(cells, values)
        if shares is None:
            return []
        outside = outside_views_of(aperture.planes[0], cells, values, grid.shape)
        return [] if outside is None else [cls(*each) for each in zip(shares, outside, strict=True)]


class _Lost:
    """What averaging takes of the detail of masks that differ in their cells: found for all of them at once.

    Args:
        plane: the mask that differs, with the first of its cells.
        cells: all of them.
    """

    def __init__(self, plane: Plane, cells: Sequence[Cells]) -> None:
        self.plane, self.cells = plane, np.stack([each.values for each in cells])
        self.found: dict[Any, NDArray[np.float64]] = {}

    def of(self, number: int) -> Callable[[Plane, NDArray[np.float64], NDArray[np.float64]], float]:
        """`detail_lost` for one of the cameras."""

        def lost(plane: Plane, known: NDArray[np.float64], added: NDArray[np.float64]) -> float:
            key = id(plane), *known.tolist(), *added.tolist()
            if key not in self.found:
                own = self.plane.pattern
                assert isinstance(own, Cells)
                self.found[key] = (
                    details_lost(own, self.cells, known, added)
                    if plane is self.plane
                    else np.full(len(self.cells), detail_lost(plane, known, added))
                )
            return float(self.found[key][number])

        return lost


@dataclass(frozen=True, eq=False, repr=False)
class _Weighed(Brief):
    """What a camera's cells leave of the views.

    Args:
        taps: those that are looked at, an open mesh of their (rows, columns).
        weights: of these.
        missing: the share of the rays that are missing, and why.
    """

    taps: tuple[NDArray[np.intp], ...]
    weights: NDArray[np.float64]
    missing: tuple[float, str]


def exchanged(pattern: Pattern, old: Cells, new: Cells) -> Pattern:
    """A pattern with other cells in the place of some that are a part of it, this very object."""
    if pattern is old:
        return new
    if isinstance(pattern, Product):
        return Product(tuple(exchanged(part, old, new) for part in pattern.patterns))
    if isinstance(pattern, Bounded | Shifted):
        return replace(pattern, pattern=exchanged(pattern.pattern, old, new))
    return pattern


def _alike(one: Mask, other: object) -> bool:
    """Whether masks are arrays of as many cells of one size in one place."""
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
