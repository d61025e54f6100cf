"""The reference engine: the sum of the plan, written out plainly in float64. It defines the correct result.

    I(x, y) = scale · Σ_q L(q) · w(view) · Π T(m(q)) · F(x; x(q)) · F(y; y(q))

If the frame shears the pixel grid, a sample's column on the sensor depends on the pixel row y: it is
x(q) + shear · (y − y(q)). The shares of a sample then still sum to one along both axes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.progress import Progress, tell
from vcc.engines.rays import memory_of_rays, scattered, traced
from vcc.engines.reference_back import divided, footprints_back, indices
from vcc.engines.reference_ray_gradients import ray_gradients
from vcc.plan import operators
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.shares import shares
from vcc.plan.protocol import Gradient, Partial
from vcc.plan.rays.model import Rays

Array = NDArray[np.float64]


def run(
    core: Footprints | Rays,
    values: NDArray[Any],
    *,
    beside: int = 0,
    threads: int,
    progress: Progress | None = None,
) -> Partial:
    """The raster of samples (v, u, t, s[, channels]), float64; see `vcc.plan.protocol.Engine`."""
    if isinstance(core, Rays):
        return traced(core, values, True, beside, progress)
    return footprints(core, values, progress)


def back(
    core: Footprints | Rays,
    values: NDArray[Any],
    raster: NDArray[np.floating],
    *,
    samples: bool = True,
    wanted: Collection[str] = (),
    beside: int = 0,
    threads: int,
    progress: Progress | None = None,
) -> Gradient:
    """Gradients of a weighted raster to samples and parameters, float64; see `vcc.plan.protocol.Engine`.

    If part of a core runs with a border of dark views (`vcc.run.drive`), the border's samples also receive
    gradients from the rays. These belong to the neighbouring parts; the caller drops them.
    """
    if isinstance(core, Footprints):
        return footprints_back(core, values, raster, samples, wanted, progress)
    return Gradient.of(
        partial(scattered, core, values.shape, raster, beside) if samples else None,
        partial(ray_gradients, core, values, raster, wanted, beside, threads) if wanted else None,
        progress,
    )


def footprints(core: Footprints, values: NDArray[Any], progress: Progress | None) -> Partial:
    """The raster of samples by footprints: the sum in the module's docstring."""
    channels = values.shape[4:] or (1,)
    raster = np.zeros((*core.raster_shape, *channels))
    k, l = indices(core)
    total = core.weights.size
    for done, (b, a) in enumerate(np.ndindex(core.weights.shape)):
        tell(progress, done, total)
        if core.weights[b, a] == 0:
            continue
        view = values[core.view_rows[b], core.view_columns[a]].astype(np.float64)
        flux = divided(core, view.reshape(*view.shape[:2], *channels)) * core.weights[b, a]
        for mask in core.masks:
            flux = flux * mask.weights(b, a, k, l)[..., None]
        _spread(core, raster, flux, b, a, k, l)
    tell(progress, total, total)
    return Partial(raster * core.scale)


def prepared(
    before: Sequence[operators.Before],
    values: NDArray[Any],
    threads: int,
    core: Footprints | Rays | None = None,
    check: Callable[[], None] | None = None,
) -> NDArray[Any]:
    """Samples as a core reads them, filtered in double precision; samples of 8 bits are sharpened exactly."""
    for operator in before:
        exact = isinstance(operator, operators.SharpenViews) and values.dtype == np.uint8
        moved = isinstance(operator, operators.SwapPixelAxes | operators.DarkBorder)
        values = operator.apply(values if exact or moved else values.astype(np.float64))
    return values


def prepared_back(
    before: Sequence[operators.Before], values: Array, threads: int, *, written_over: bool = False
) -> Array:
    """The transpose of `prepared`, float64; see `vcc.plan.protocol.Engine.prepared_back`."""
    for operator in reversed(before):
        values = operator.transpose(values)
    return np.asarray(values, dtype=np.float64)


def finished(after: Sequence[operators.After], raster: Array, threads: int) -> Array:
    """The image (rows, columns, channels), float64, from a raster."""
    return np.asarray(operators.finished(after, raster), dtype=np.float64)


def memory(core: Footprints | Rays, channels: int, threads: int) -> int:
    """Bytes that a run needs besides the samples and the raster: the largest measured value, rounded up."""
    if isinstance(core, Rays):
        return memory_of_rays(core)
    rows, columns = (core.refine * count for count in core.samples)
    high, wide = core.raster_shape
    view = 16 * channels * rows * columns  # in double precision, and again multiplied by the weights
    turned = any(mask.step[0, 1] or mask.step[1, 0] for mask in core.masks)  # one lookup per sample
    lookup = (280 if turned else 40) * rows * columns if core.masks else 0
    if core.step[1, 0] == 0 == core.shear:
        spreading = 112 * max(high * rows, wide * columns) + 8 * channels * high * columns
    else:
        spreading = 112 * rows * columns
    return view + max(lookup, spreading)


def _spread(core: Footprints, raster: Array, flux: Array, b: int, a: int, k: Array, l: Array) -> None:
    """Add each sample's light to the pixels under its footprint."""
    rows, columns = core.raster_shape
    row, column = np.arange(rows, dtype=float), np.arange(columns, dtype=float)[:, None]
    row_step, column_step, shear = core.row_step, core.column_step, core.shear
    down = partial(shares, core.interpolation, step=row_step / core.refine, opening=core.opening)
    across = partial(shares, core.interpolation, step=column_step / core.refine, opening=core.opening)
    if (
        core.step[1, 0] == 0 == shear
    ):  # separable: all columns of samples fall on the same rows, all rows on the same columns
        lines = np.tensordot(down(pixel=row[:, None], position=core.y[b, a] + row_step * l), flux, 1)
        raster += across(pixel=column, position=core.x[b, a] + column_step * k) @ lines
        return
    y = core.y[b, a] + core.step[1, 0] * k[None, :] + row_step * l[:, None]
    for r in row:
        share_y = down(pixel=r, position=y)
        if not share_y.any():
            continue
        line = (share_y[..., None] * flux).sum(axis=0)
        x = core.x[b, a] + shear * (r - core.y[b, a]) + column_step * k
        raster[int(r)] += across(pixel=column, position=x) @ line
