"""The reference engine: the sum of the plan written out plainly, in float64. It defines what is correct.

    I(x, y) = scale · Σ_q L(q) · w(view) · Π T(m(q)) · F(x; x(q)) · F(y; y(q))

The one subtlety: where the frame shears the pixel grid, a sample's column on the sensor is taken at the row
that is looked at, x(q) + shear · (y − y(q)), so that the shares still sum to one both ways.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.engines.smear import finish
from vcc.plan.footprints.model import Plan
from vcc.plan.footprints.shares import shares

Array = NDArray[np.float64]


def run(plan: Plan, values: NDArray[Any], progress: Callable[[int, int], None] | None = None) -> NDArray[Any]:
    """The picture of samples (v, u, t, s[, channels]) by a plan, float32; see `vcc.engines.run_plan`."""
    channels = values.shape[4:] or (1,)
    rows, columns = plan.raster_shape
    raster = np.zeros((rows, columns, *channels))
    total = plan.weights.size
    for done, (b, a) in enumerate(np.ndindex(plan.weights.shape)):
        if progress is not None:
            progress(done, total)
        if plan.weights[b, a] == 0:
            continue
        view = values[plan.view_rows[b], plan.view_columns[a]].astype(np.float64)
        flux, k, l = _samples_of(plan, view.reshape(*view.shape[:2], *channels))
        flux = flux * plan.weights[b, a]
        for mask in plan.masks:
            flux = flux * mask.weights(b, a, k, l)[..., None]
        _spread(plan, raster, flux, b, a, k, l)
    if progress is not None:
        progress(total, total)
    picture = finish(plan, raster * plan.scale)
    return picture if values.ndim == 5 else picture[..., 0]


def _samples_of(plan: Plan, view: Array) -> tuple[Array, Array, Array]:
    """The samples of a view, divided where the plan says so, with their column and row indices k, l."""
    if plan.refine == 1:
        return view, np.arange(view.shape[1], dtype=float), np.arange(view.shape[0], dtype=float)
    rows, columns = view.shape[:2]
    down = plan.division(rows)
    across = plan.division(columns)
    fine = np.einsum("al,bk,lkc->abc", down.matrix(rows), across.matrix(columns), view, optimize=True)
    k = across.start + np.arange(fine.shape[1]) / plan.refine
    l = down.start + np.arange(fine.shape[0]) / plan.refine
    return fine, k, l


def _spread(plan: Plan, raster: Array, flux: Array, b: int, a: int, k: Array, l: Array) -> None:
    """Add each sample's light to the pixels under its footprint."""
    rows, columns = plan.raster_shape
    fine = plan.refine
    pixel = np.arange(columns, dtype=float)
    y = plan.y[b, a] + plan.step[1, 0] * k[None, :] + plan.step[1, 1] * l[:, None]
    for row in range(rows):
        share_y = shares(plan.interpolation, float(row), y, plan.row_step / fine, plan.opening)
        if not share_y.any():
            continue
        line = (share_y[..., None] * flux).sum(axis=0)
        x = plan.x[b, a] + plan.shear * (row - plan.y[b, a]) + plan.column_step * k
        across = shares(plan.interpolation, pixel[:, None], x[None, :], plan.column_step / fine, plan.opening)
        raster[row] += across @ line
