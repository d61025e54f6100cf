"""Plans of cameras that differ in the cells of one mask at the views: one is made, the others follow from it.

What the cells let through decides the weights of views, which of these are looked at, and which rays are missing;
nothing else in a plan, as long as no mask in mid-path meets light through parts of views' cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from vcc.base.describe import Brief
from vcc.fields.grid import Grid
from vcc.optics.mask import Mask
from vcc.optics.train import Train
from vcc.plan.footprints.compile import Compiled, compiled, used_taps
from vcc.plan.footprints.coverage import missing_rays
from vcc.plan.footprints.diffusers import Blurs
from vcc.plan.footprints.model import Footprints
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.shapes.mean_back import holds
from vcc.shapes.patterns import Bounded, Cells, Pattern
from vcc.shapes.sheets import Product, Shifted


@dataclass(frozen=True, eq=False, repr=False)
class Codes(Brief):
    """Cameras that differ in the cells of one mask.

    Args:
        base: the first camera, with all of these cells open.
        open: the cells of its mask.
        cells: those of each camera.
    """

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
        return cls(Train(elements, first.sensor), opened, listed)

    def plans(self, grid: Grid, how: How) -> list[Plan] | None:
        """The plan of each camera; None where each has to be made by itself."""
        if any(stage.faces.spread is not None or stage.faces.bending is not None for stage in self.base.stages):
            return None
        one = compiled(self.base, grid, how, Blurs(None, None))
        at_views = [holds(plane.pattern, self.open) for plane in one.aperture.planes]
        if not (one.alone and any(at_views)):
            return None
        return [self._plan(one, grid, each) for each in self.cells]

    def _plan(self, one: Compiled, grid: Grid, cells: Cells) -> Plan:
        core, aperture = one.plan.core, one.aperture
        assert isinstance(core, Footprints)
        planes = [replace(p, pattern=exchanged(p.pattern, self.open, cells)) for p in aperture.planes]
        weights = one.shares * replace(aperture, planes=planes).open_shares()
        rows, columns = used_taps(weights)
        keep = np.ix_(rows, columns)
        weights = weights[keep]
        missing, reason = missing_rays(
            planes, grid.shape, aperture.samples, weights, one.tap[keep], core.step, one.plan.sensor_shape
        )
        changed = replace(
            core,
            view_rows=core.view_rows[rows],
            view_columns=core.view_columns[columns],
            weights=weights,
            x=core.x[keep],
            y=core.y[keep],
        )
        return replace(one.plan, core=changed, missing_rays=missing, missing_reason=reason)


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
