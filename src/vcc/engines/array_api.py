"""The array-API engine: the plan as products of matrices, on arrays of any library that follows the standard.

Gradients and GPUs come from the library. The shares along rows and columns form two banded matrices for
each view; where the frame shears the pixel grid they are gathered tap by tap instead. The sum is linear in
the samples, so its transpose is its adjoint.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from array_api_compat import array_namespace, device
from numpy.typing import NDArray

from vcc.engines.smear import band_matrix, finishing_terms
from vcc.fields.sampled import to_dtype
from vcc.plan.footprints.model import MaskLookup, Plan
from vcc.plan.footprints.shares import reach_in_pixels, shares


def run(plan: Plan, values: Any, progress: Callable[[int, int], None] | None = None) -> Any:
    """The picture of samples (v, u, t, s[, channels]) by a plan, float32; see `vcc.engines.run_plan`."""
    return _Run(plan, values).picture(progress)


class _Run:
    """One run of a plan: the arrays' namespace, device and working type, and the steps."""

    def __init__(self, plan: Plan, values: Any) -> None:
        self.plan, self.values = plan, values
        self.xp = array_namespace(values)
        self.device = device(values)
        self.float = self.xp.float64 if to_dtype(values) == np.float64 else self.xp.float32
        self.channels = values.shape[4] if values.ndim == 5 else 1

    def constant(self, numbers: Any) -> Any:
        """NumPy numbers as an array of this run's library, type and device."""
        return self.xp.asarray(np.ascontiguousarray(numbers), dtype=self.float, device=self.device)

    def picture(self, progress: Callable[[int, int], None] | None) -> Any:
        plan, xp = self.plan, self.xp
        raster = None
        total = len(plan.view_columns)
        for a in range(total):
            if progress is not None:
                progress(a, total)
            part = self.separable_column(a) if plan.separable else self.sheared_column(a)
            raster = part if raster is None else raster + part
        if progress is not None:
            progress(total, total)
        assert raster is not None  # a plan has at least one column of taps
        raster = raster * plan.scale
        around = 0 if plan.sensor_detail is None else 1  # pixels that are needed beyond the sensor
        if plan.guard:
            finished = None
            high, wide = (pixels + 2 * around for pixels in plan.sensor_shape)
            for down, across in finishing_terms(plan):
                rows = self.constant(band_matrix(down, high, plan.guard - around))
                columns = self.constant(band_matrix(across, wide, plan.guard - around))
                part = self.rows_mixed(columns, xp.permute_dims(self.rows_mixed(rows, raster), (1, 0, 2)))
                finished = part if finished is None else finished + part
            raster = xp.permute_dims(finished, (1, 0, 2))
        neighbours, (high, wide) = raster, plan.sensor_shape
        raster = raster[around : around + high, around : around + wide, :]
        if plan.sensor_transmission is not None:
            raster = raster * self.constant(plan.sensor_transmission)[:, :, None]
        if plan.sensor_detail is not None:
            for dy, dx in np.ndindex(3, 3):
                share = self.constant(plan.sensor_detail[dy, dx])[:, :, None]
                raster = raster + share * neighbours[dy : dy + high, dx : dx + wide, :]
        raster = xp.astype(raster, xp.float32)
        return raster if self.values.ndim == 5 else raster[:, :, 0]

    def rows_mixed(self, matrix: Any, block: Any) -> Any:
        """matrix (n, m) times the rows of block (m, columns, channels)."""
        _, columns, channels = block.shape
        return self.xp.reshape(matrix @ self.xp.reshape(block, (-1, columns * channels)), (-1, columns, channels))

    def weighted_view(self, b: int, a: int) -> tuple[Any, NDArray[Any], NDArray[Any]]:
        """A tap's samples times all weights, (rows, columns, channels), with their indices k and l."""
        plan, xp = self.plan, self.xp
        view = self.values[int(plan.view_rows[b]), int(plan.view_columns[a]), ...]
        view = xp.reshape(xp.astype(view, self.float), (*plan.samples, self.channels))
        l, k = (np.arange(n, dtype=np.float64) for n in plan.samples)
        if plan.refine > 1:
            rows, columns = plan.samples
            down = plan.division(rows)
            across = plan.division(columns)
            view = self.rows_mixed(self.constant(down.matrix(rows)), view)
            view = self.rows_mixed(self.constant(across.matrix(columns)), xp.permute_dims(view, (1, 0, 2)))
            view = xp.permute_dims(view, (1, 0, 2))
            k = across.start + np.arange(len(across.first)) / plan.refine
            l = down.start + np.arange(len(down.first)) / plan.refine
        view = view * float(plan.weights[b, a])
        for mask in plan.masks:
            view = view * self.mask_weights(mask, b, a, k, l)[:, :, None]
        return view, k, l

    def mask_weights(self, mask: MaskLookup, b: int, a: int, k: Any, l: Any) -> Any:
        xp = self.xp
        column = mask.column[b, a] + mask.step[0, 0] * k[None, :] + mask.step[0, 1] * l[:, None]
        row = mask.row[b, a] + mask.step[1, 0] * k[None, :] + mask.step[1, 1] * l[:, None]
        rows, columns = mask.texture.shape
        padded = xp.reshape(self.constant(np.pad(mask.texture, (1, 2))), (-1,))
        column, row = np.clip(column + 1, 0, columns + 1), np.clip(row + 1, 0, rows + 1)
        c, r = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
        fc, fr = self.constant(column - c), self.constant(row - r)

        def at(r: NDArray[Any], c: NDArray[Any]) -> Any:
            flat = xp.asarray((r * (columns + 3) + c).reshape(-1), device=self.device)
            return xp.reshape(xp.take(padded, flat, axis=0), c.shape)

        above = at(r, c) * (1 - fc) + at(r, c + 1) * fc
        below = at(r + 1, c) * (1 - fc) + at(r + 1, c + 1) * fc
        return above * (1 - fr) + below * fr

    def separable_column(self, a: int) -> Any:
        """All taps of one column: rows mixed tap by tap and summed, then columns mixed once."""
        plan, xp = self.plan, self.xp
        pixels = [np.arange(n, dtype=np.float64)[:, None] for n in plan.raster_shape]
        total, k = None, np.arange(plan.samples[1], dtype=np.float64)
        for b in range(len(plan.view_rows)):
            if plan.weights[b, a] == 0:
                continue
            view, k, l = self.weighted_view(b, a)
            y = plan.y[b, a] + plan.row_step * l
            down = shares(plan.interpolation, pixels[0], y[None, :], plan.row_step / plan.refine, plan.opening)
            part = self.rows_mixed(self.constant(down), view)
            total = part if total is None else total + part
        if total is None:
            return xp.zeros((*plan.raster_shape, self.channels), dtype=self.float, device=self.device)
        x = plan.x[0, a] + plan.column_step * k
        across = shares(plan.interpolation, pixels[1], x[None, :], plan.column_step / plan.refine, plan.opening)
        mixed = self.rows_mixed(self.constant(across), xp.permute_dims(total, (1, 0, 2)))
        return xp.permute_dims(mixed, (1, 0, 2))

    def sheared_column(self, a: int) -> Any:
        """All taps of one column where rows and columns do not part: each is gathered tap by tap."""
        plan, xp = self.plan, self.xp
        rows, columns = plan.raster_shape
        total = xp.zeros((rows, columns, self.channels), dtype=self.float, device=self.device)
        row, column = np.arange(rows, dtype=np.float64), np.arange(columns, dtype=np.float64)
        for b in range(len(plan.view_rows)):
            if plan.weights[b, a] == 0:
                continue
            view, k, l = self.weighted_view(b, a)
            # Down: raster row y of sample column k gathers samples near l(y, k).
            start_y = plan.y[b, a] + plan.step[1, 0] * k + plan.row_step * l[0]
            lines = self.gathered(view, row[:, None], start_y[None, :], plan.row_step / plan.refine)
            # Across: raster column x of raster row y gathers samples near k(x, y).
            start_x = plan.x[b, a] + plan.shear * (row - plan.y[b, a]) + plan.column_step * k[0]
            lines = xp.permute_dims(lines, (1, 0, 2))
            part = self.gathered(lines, column[:, None], start_x[None, :], plan.column_step / plan.refine)
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
        reach = reach_in_pixels(self.plan.interpolation, size)
        middle = (pixel - start) / step
        first = np.clip(np.ceil(middle - reach / size), 0, samples - 1).astype(np.int64)
        last = np.clip(np.floor(middle + reach / size), 0, samples - 1).astype(np.int64)
        total = xp.zeros((len(pixel), width, block.shape[2]), dtype=self.float, device=self.device)
        flat = xp.reshape(block, (samples * width, -1))
        for tap in range(int((last - first).max()) + 1):
            index = np.minimum(first + tap, samples - 1)
            share = shares(self.plan.interpolation, pixel, start + step * index, step, self.plan.opening)
            share = np.where(first + tap <= last, share, 0.0)
            place = xp.asarray((index * width + np.arange(width)).reshape(-1), device=self.device)
            values = xp.reshape(xp.take(flat, place, axis=0), total.shape)
            total = total + values * self.constant(share)[:, :, None]
        return total
