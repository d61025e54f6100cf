"""The array-API engine: the plan as products of matrices, on arrays of any library that follows the standard.

Gradients and GPUs come from the library. The shares along rows and columns form two banded matrices for
each view; where the frame shears the pixel grid they are gathered tap by tap instead. The sum is linear in
the samples, so its transpose is its adjoint.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from array_api_compat import array_namespace, device
from numpy.typing import NDArray

from vcc.base.lookup import three_around
from vcc.base.progress import Progress, tell
from vcc.engines.rays import memory_of_rays, traced
from vcc.fields.sampled import to_dtype
from vcc.plan import operators
from vcc.plan.footprints.model import Footprints, MaskLookup
from vcc.plan.footprints.shares import reach_in_pixels, shares
from vcc.plan.protocol import Partial
from vcc.plan.rays.model import Rays

copies = True
"""Samples are converted as a whole; see `vcc.plan.protocol.Engine`."""
double = False
"""See there."""


def footprints(
    core: Footprints, values: Any, *, beside: int = 0, threads: int, progress: Progress | None = None
) -> Partial:
    """The raster of samples (v, u, t, s[, channels]); see `vcc.plan.protocol.Runner`."""
    return Partial(_Run(core, values).raster(progress))


def rays(core: Rays, values: Any, *, beside: int = 0, threads: int, progress: Progress | None = None) -> Partial:
    """The raster of samples (v, u, t, s[, channels]) by the plan's own rays."""
    return traced(core, values, False, beside, progress)


def prepared(before: Sequence[operators.Before], values: Any, threads: int) -> Any:
    """Samples as a core takes them."""
    for operator in before:
        values = operator.apply(values)
    return values


def finished(after: Sequence[operators.After], raster: Any, threads: int) -> Any:
    """The picture (rows, columns, channels), float32, of a raster."""
    return array_namespace(raster).astype(
        operators.finished(tuple(operators.merged(after)), raster), array_namespace(raster).float32
    )


def memory(core: Footprints | Rays, channels: int, threads: int) -> int:
    """Bytes that a run takes beside the samples and the raster, estimated: matrices of shares and a few views."""
    if isinstance(core, Rays):
        return memory_of_rays(core)
    (rows, columns), (high, wide) = core.samples, core.raster_shape
    shares = 8 * core.refine * (rows * high + columns * wide)
    return shares + 12 * channels * (rows * columns * core.refine**2 + columns * core.refine * high)


class _Run:
    """One run of a plan: the arrays' namespace, device and working type, and the steps."""

    def __init__(self, core: Footprints, values: Any) -> None:
        self.core, self.values = core, values
        self.xp = array_namespace(values)
        self.device = device(values)
        self.float = self.xp.float64 if to_dtype(values) == np.float64 else self.xp.float32
        self.channels = values.shape[4] if values.ndim == 5 else 1

    def constant(self, numbers: Any) -> Any:
        """NumPy numbers as an array of this run's library, type and device."""
        return self.xp.asarray(np.ascontiguousarray(numbers), dtype=self.float, device=self.device)

    def raster(self, progress: Progress | None) -> Any:
        """The sum over all samples, (rows, columns, channels)."""
        core = self.core
        raster = None
        total = len(core.view_columns)
        for a in range(total):
            tell(progress, a, total)
            part = self.separable_column(a) if core.separable else self.sheared_column(a)
            raster = part if raster is None else raster + part
        tell(progress, total, total)
        assert raster is not None  # a plan has at least one column of taps
        return raster * core.scale

    def rows_mixed(self, matrix: Any, block: Any) -> Any:
        """matrix (n, m) times the rows of block (m, columns, channels)."""
        _, columns, channels = block.shape
        return self.xp.reshape(matrix @ self.xp.reshape(block, (-1, columns * channels)), (-1, columns, channels))

    def weighted_view(self, b: int, a: int) -> tuple[Any, NDArray[Any], NDArray[Any]]:
        """A tap's samples times all weights, (rows, columns, channels), with their indices k and l."""
        core, xp = self.core, self.xp
        view = self.values[int(core.view_rows[b]), int(core.view_columns[a]), ...]
        view = xp.reshape(xp.astype(view, self.float), (*core.samples, self.channels))
        l, k = (np.arange(n, dtype=np.float64) for n in core.samples)
        if core.refine > 1:
            rows, columns = core.samples
            down = core.division(rows)
            across = core.division(columns)
            view = self.rows_mixed(self.constant(down.matrix(rows)), view)
            view = self.rows_mixed(self.constant(across.matrix(columns)), xp.permute_dims(view, (1, 0, 2)))
            view = xp.permute_dims(view, (1, 0, 2))
            k = across.start + np.arange(len(across.first)) / core.refine
            l = down.start + np.arange(len(down.first)) / core.refine
        view = view * float(core.weights[b, a])
        for mask in core.masks:
            view = view * self.mask_weights(mask, b, a, k, l)[:, :, None]
        return view, k, l

    def mask_weights(self, mask: MaskLookup, b: int, a: int, k: Any, l: Any) -> Any:
        xp = self.xp
        column = mask.column[b, a] + mask.step[0, 0] * k[None, :] + mask.step[0, 1] * l[:, None]
        row = mask.row[b, a] + mask.step[1, 0] * k[None, :] + mask.step[1, 1] * l[:, None]
        rows, columns = mask.texture.shape
        texture = xp.reshape(self.constant(mask.texture), (-1,))
        (r, down, _), (c, across, _) = three_around(row, rows), three_around(column, columns)
        total = 0
        for m, n in np.ndindex(3, 3):
            flat = xp.asarray((r[m] * columns + c[n]).reshape(-1), device=self.device)
            values = xp.reshape(xp.take(texture, flat, axis=0), row.shape)
            total = total + values * self.constant(down[m] * across[n])
        return total

    def separable_column(self, a: int) -> Any:
        """All taps of one column: rows mixed tap by tap and summed, then columns mixed once."""
        core, xp = self.core, self.xp
        pixels = [np.arange(n, dtype=np.float64)[:, None] for n in core.raster_shape]
        total, k = None, np.arange(core.samples[1], dtype=np.float64)
        for b in range(len(core.view_rows)):
            if core.weights[b, a] == 0:
                continue
            view, k, l = self.weighted_view(b, a)
            y = core.y[b, a] + core.row_step * l
            down = shares(core.interpolation, pixels[0], y[None, :], core.row_step / core.refine, core.opening)
            part = self.rows_mixed(self.constant(down), view)
            total = part if total is None else total + part
        if total is None:
            return xp.zeros((*core.raster_shape, self.channels), dtype=self.float, device=self.device)
        x = core.x[0, a] + core.column_step * k
        across = shares(core.interpolation, pixels[1], x[None, :], core.column_step / core.refine, core.opening)
        mixed = self.rows_mixed(self.constant(across), xp.permute_dims(total, (1, 0, 2)))
        return xp.permute_dims(mixed, (1, 0, 2))

    def sheared_column(self, a: int) -> Any:
        """All taps of one column where rows and columns do not part: each is gathered tap by tap."""
        core, xp = self.core, self.xp
        rows, columns = core.raster_shape
        total = xp.zeros((rows, columns, self.channels), dtype=self.float, device=self.device)
        row, column = np.arange(rows, dtype=np.float64), np.arange(columns, dtype=np.float64)
        for b in range(len(core.view_rows)):
            if core.weights[b, a] == 0:
                continue
            view, k, l = self.weighted_view(b, a)
            # Down: raster row y of sample column k gathers samples near l(y, k).
            start_y = core.y[b, a] + core.step[1, 0] * k + core.row_step * l[0]
            lines = self.gathered(view, row[:, None], start_y[None, :], core.row_step / core.refine)
            # Across: raster column x of raster row y gathers samples near k(x, y).
            start_x = core.x[b, a] + core.shear * (row - core.y[b, a]) + core.column_step * k[0]
            lines = xp.permute_dims(lines, (1, 0, 2))
            part = self.gathered(lines, column[:, None], start_x[None, :], core.column_step / core.refine)
            total = total + xp.permute_dims(part, (1, 0, 2))
        return total

    def gathered(self, block: Any, pixel: NDArray[Any], start: NDArray[Any], step: float) -> Any:
        """block (m, n, channels) mixed along its rows: pixel (p, 1) gathers rows near it, per column n.

        Args:
            block: samples whose row 0 lies at pixel coordinate ``start`` (1, n), and the others ``step`` apart.
            pixel: pixel indices (p, 1).
            start: see above.
            step: pixels.
        """
        xp = self.xp
        samples, width, _ = block.shape
        size = abs(step)
        reach = reach_in_pixels(self.core.interpolation, size)
        middle = (pixel - start) / step
        first = np.clip(np.ceil(middle - reach / size), 0, samples - 1).astype(np.int64)
        last = np.clip(np.floor(middle + reach / size), 0, samples - 1).astype(np.int64)
        total = xp.zeros((len(pixel), width, block.shape[2]), dtype=self.float, device=self.device)
        flat = xp.reshape(block, (samples * width, -1))
        for tap in range(int((last - first).max()) + 1):
            index = np.minimum(first + tap, samples - 1)
            share = shares(self.core.interpolation, pixel, start + step * index, step, self.core.opening)
            share = np.where(first + tap <= last, share, 0.0)
            place = xp.asarray((index * width + np.arange(width)).reshape(-1), device=self.device)
            values = xp.reshape(xp.take(flat, place, axis=0), total.shape)
            total = total + values * self.constant(share)[:, :, None]
        return total
