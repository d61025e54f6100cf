"""Images of cameras that differ in a mask's cells, as sums of a few images weighted by the cells' transmission.

An image is linear in the cells. For a mask at the views, each view's image is weighted by the view's open share.
For a mask in mid-path, each pixel sees only a window of the cells: cells at least a window apart are opened
together in one image, and the light of each pixel passes only one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.plan.coverage import Missing
from vcc.plan.footprints.mask_textures import Textured
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.shares import reach_in_pixels
from vcc.plan.model import Plan
from vcc.plan.operators import OnSensor
from vcc.shapes.patterns import Cells

Array = NDArray[np.float64]

NEAR = 1e-6
"""Share of a cell: borders this near count as reached."""


@dataclass(frozen=True, eq=False, repr=False)
class Mixture(Brief):
    """Images as sums: pixel (y, x) of image n is the sum over p and q of
    numbers[n, down[y, p], across[x, q]] · (pixel (y, x) of the image by plan p · (columns of ``across``) + q).

    Args:
        members: numbers of the cameras.
        plans: that make the few images.
        numbers: weights of each camera, (members, rows, columns).
        down: for each row of pixels, the row of ``numbers`` that weights each plan's image, (rows, plans down).
        across: for each column, likewise, (columns, plans across).
        missing: of each member: what its light field lacks; filled in by the caller.
    """

    members: tuple[int, ...]
    plans: tuple[Plan, ...]
    numbers: Array
    down: NDArray[np.int64]
    across: NDArray[np.int64]
    missing: tuple[Missing, ...] = ()


def of_views(plan: Plan, weights: Array) -> Mixture:
    """Images by a plan with other weights of its views.

    Args:
        plan: by footprints.
        weights: (images, rows of taps, columns of taps).
    """
    core = plan.core
    assert isinstance(core, Footprints)
    used = np.flatnonzero(weights.any(axis=0))
    each = np.eye(core.weights.size)[used].reshape(-1, *core.weights.shape)
    rows, columns = plan.sensor_shape
    return Mixture(
        tuple(range(len(weights))),
        tuple(replace(plan, core=replace(core, weights=one)) for one in each),
        weights.reshape(len(weights), 1, -1)[:, :, used],
        np.zeros((rows, 1), dtype=np.int64),
        np.tile(np.arange(len(used)), (columns, 1)),
    )


def of_cells(
    plan: Plan, mask: int, made: Textured, members: Sequence[int], cells: Sequence[Cells], most: int
) -> Mixture | None:
    """Images by a plan with other cells of a mask in mid-path; None if more than ``most`` plans would be needed.

    Args:
        plan: by footprints, with separable rows and columns.
        mask: number of the mask.
        made: how its texture was made.
        members: see `Mixture`.
        cells: of each member, all of one size.
        most: plans.
    """
    core, shape = plan.core, cells[0].values.shape
    assert isinstance(core, Footprints)
    guard = next((operator.guard for operator in plan.after if isinstance(operator, OnSensor)), 0)
    firsts, counts = zip(
        *(_windows(core, mask, made, cells[0], axis, plan.sensor_shape[axis], guard) for axis in (0, 1)),
        strict=True,
    )
    if counts[0] * counts[1] > most:
        return None
    opened = np.zeros((*counts, *shape))
    for p, q in np.ndindex(*counts):
        opened[p, q, p :: counts[0], q :: counts[1]] = 1.0
    textures = [made.of(replace(cells[0], values=values)) for values in opened.reshape(-1, *shape)]
    lookups = [replace(core.masks[mask], texture=texture) for texture in textures]
    masks = [(*core.masks[:mask], lookup, *core.masks[mask + 1 :]) for lookup in lookups]
    down, across = (
        # For each class of cells, the cell within the window.
        first[:, None] + (np.arange(count) - first[:, None]) % count
        for first, count in zip(firsts, counts, strict=True)
    )
    return Mixture(
        tuple(members),
        tuple(replace(plan, core=replace(core, masks=each)) for each in masks),
        np.stack([each.values for each in cells]),
        down,
        across,
    )


def _windows(
    core: Footprints, mask: int, made: Textured, cells: Cells, axis: int, pixels: int, guard: int
) -> tuple[NDArray[np.int64], int]:
    """The first cell that each row (axis 0) or column (1) of pixels sees, and the largest number that any sees.

    A pixel sees the light on all raster pixels that filters read around it.
    """
    lookup, used = core.masks[mask], core.weights != 0
    met, of_tap, step, met_step = (
        (lookup.row, core.y, core.row_step, lookup.step[1, 1])
        if axis == 0
        else (lookup.column, core.x, core.column_step, lookup.step[0, 0])
    )
    along = met_step / step  # points of the texture for each pixel
    start = (met - made.tops * (axis == 0) - along * of_tap)[used] if used.any() else np.zeros(1)
    beside = abs(along) * (guard + reach_in_pixels(core.interpolation, abs(step) / core.refine))
    place = along * (np.arange(pixels) + guard)
    (low, _), (_, high) = (
        made.seen(1 - axis, place + end) for end in (start.min() - beside, start.max() + beside)
    )
    count = cells.values.shape[axis]
    pitch = (cells.size[1] - 2 * abs(cells.middle[1]), cells.width)[axis] / count
    low, high = ((end - cells.middle[1 - axis]) / pitch + count / 2 for end in (low, high))
    first, last = np.floor(low - NEAR), np.floor(high + NEAR)
    wide = int(min((last - first).max() + 1, count))
    return np.clip(first, 0, count - wide).astype(np.int64), wide
