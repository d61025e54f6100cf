"""The array-API engine: the plan as matrix products, on arrays of any library that follows the standard.

Gradients and GPU support come from the library. The shares along rows and columns are two banded matrices for
each column of views (`vcc.engines.bands`). If the frame shears the pixel grid, shares are gathered tap by tap
instead. The sum is linear in the samples, so its transpose is its adjoint.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from array_api_compat import array_namespace, device, is_torch_array
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.lookup import three_around
from vcc.base.progress import Progress, tell
from vcc.engines.bands import Bands
from vcc.engines.rays import memory_of_rays, traced
from vcc.fields.sampled import to_dtype
from vcc.plan import operators
from vcc.plan.footprints.model import Footprints, MaskLookup
from vcc.plan.footprints.shares import Division, Taps, reach_in_pixels, shares, taps
from vcc.plan.protocol import Partial
from vcc.plan.rays.model import Rays

Array = NDArray[np.float64]


def run(
    core: Footprints | Rays, values: Any, *, beside: int = 0, threads: int, progress: Progress | None = None
) -> Partial:
    """The raster of samples (v, u, t, s[, channels]); see `vcc.plan.protocol.Engine`."""
    if isinstance(core, Rays):
        return traced(core, values, False, beside, progress)
    return Partial(_Run(core, values).raster(progress))


def prepared(
    before: Sequence[operators.Before],
    values: Any,
    threads: int,
    core: Footprints | Rays | None = None,
    check: Callable[[], None] | None = None,
) -> Any:
    """Samples as a core reads them."""
    for operator in before:
        values = operator.apply(values)
    return values


def finished(after: Sequence[operators.After], raster: Any, threads: int) -> Any:
    """The image (rows, columns, channels), float32, from a raster."""
    return array_namespace(raster).astype(
        operators.finished(tuple(operators.merged(after)), raster), array_namespace(raster).float32
    )


def memory(core: Footprints | Rays, channels: int, threads: int) -> int:
    """Estimated bytes of a run besides the samples and the raster: matrices of shares and a few views."""
    if isinstance(core, Rays):
        return memory_of_rays(core)
    (rows, columns), (high, wide) = core.samples, core.raster_shape
    # Dense matrices for a column of views (libraries without banded sums), and its samples, twice with masks.
    taps, fine = len(core.view_rows), core.refine**2
    shares = 8 * core.refine * (taps * rows * high + columns * wide)
    return shares + 12 * channels * (taps * rows * columns * fine + columns * core.refine * high)


@dataclass(frozen=True)
class _FineAxis:
    """The samples along an axis, subdivided if the plan does so.

    Args:
        count: number of samples.
        start: index of the first, in units of the original samples.
        refine: finer samples per original sample.
        division: how they are computed, or None.
    """

    count: int
    start: float
    refine: int
    division: Division | None

    @classmethod
    def of(cls, core: Footprints, samples: int) -> _FineAxis:
        """The samples of a core along an axis."""
        if core.refine == 1:
            return cls(samples, 0.0, 1, None)
        division = core.division(samples)
        return cls(len(division.first), division.start, core.refine, division)

    @property
    def index(self) -> Array:
        """Index of each, in units of the original samples."""
        return self.start + np.arange(self.count) / self.refine


def _separable_weights(mask: MaskLookup, b: int, a: int, l: Array, k: Array) -> Array:
    """A mask at the samples of a tap, if their rows and columns are parallel to the mask's: (rows, columns)."""
    rows, columns = mask.texture.shape
    down, across, _ = three_around(mask.row[b, a] + mask.step[1, 1] * l, rows)
    lines = Bands(down.T, across.T).of(mask.texture)
    down, across, _ = three_around(mask.column[b, a] + mask.step[0, 0] * k, columns)
    return np.asarray(Bands(down.T, across.T).of(np.ascontiguousarray(lines.T)).T)


class _Run:
    """One run of a plan: the arrays' namespace, device and working type, and the steps."""

    def __init__(self, core: Footprints, values: Any) -> None:
        self.core, self.values = core, values
        self.xp = array_namespace(values)
        self.device = device(values)
        self.float = self.xp.float64 if to_dtype(values) == np.float64 else self.xp.float32
        self.channels = values.shape[4] if values.ndim == 5 else 1

    def constant(self, numbers: Any) -> Any:
        """NumPy values as an array of this run's library, type and device."""
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

    def weighted_view(self, b: int, a: int) -> tuple[Any, Array, Array]:
        """A tap's samples times all weights, (rows, columns, channels), with their indices k and l."""
        core = self.core
        down, across = (_FineAxis.of(core, n) for n in core.samples)
        view = self.divided(np.array([b]), a, down, across)[0, ...] * float(core.weights[b, a])
        for mask in core.masks:
            view = view * self.mask_weights(mask, b, a, across.index, down.index)[:, :, None]
        return view, across.index, down.index

    def mask_weights(self, mask: MaskLookup, b: int, a: int, k: Any, l: Any) -> Any:
        xp = self.xp
        row, column = mask.places(b, a, k, l)
        rows, columns = mask.texture.shape
        texture = xp.reshape(self.constant(mask.texture), (-1,))
        (r, down, _), (c, across, _) = three_around(row, rows), three_around(column, columns)
        total = 0
        for m, n in np.ndindex(3, 3):
            at = r[m] * columns + c[n]
            flat = xp.asarray(at.reshape(-1), device=self.device)
            values = xp.reshape(xp.take(texture, flat, axis=0), at.shape)
            total = total + values * self.constant(down[m] * across[n])
        return total

    def separable_column(self, a: int) -> Any:
        """The sum of all taps of one column: first along rows of samples, then along columns."""
        core, xp = self.core, self.xp
        rows, columns = core.raster_shape
        used = np.flatnonzero(core.weights[:, a])
        if used.size == 0:
            return xp.zeros((rows, columns, self.channels), dtype=self.float, device=self.device)
        down, across = (_FineAxis.of(core, n) for n in core.samples)
        if core.masks or core.refine > 1:
            block, begin = self.weighted_column(used, a, down, across), np.arange(used.size) * down.count
        else:
            block, begin = self.columns[int(core.view_columns[a])], core.view_rows[used] * down.count
        shares = self.spread(down, core.y[used, a], core.row_step, rows)
        bands = Bands.of_taps(shares, down.count, core.weights[used, a], begin)
        total = bands.of(xp.reshape(block, (-1, across.count * self.channels)))
        total = xp.reshape(total, (rows, across.count, self.channels))
        shares = self.spread(across, core.x[:1, a], core.column_step, columns)
        return self.along_columns(Bands.of_taps(shares, across.count, np.ones(1), np.zeros(1, np.int64)), total)

    @property
    @cached
    def columns(self) -> list[Any]:
        """The samples of each column of views, (rows of views, t, s, channels)."""
        nv, nu, nt, ns = self.values.shape[:4]
        whole = self.xp.reshape(self.xp.astype(self.values, self.float), (nv, nu, nt, ns, self.channels))
        if is_torch_array(whole):  # one gradient for all columns, not an array of all samples for each
            return list(whole.unbind(1))
        return [whole[:, i, ...] for i in range(nu)]

    def spread(self, axis: _FineAxis, origin: Array, step: float, pixels: int) -> Taps:
        """The shares along an axis of samples that begin at ``origin``, before subdivision."""
        core, first = self.core, origin + step * axis.start
        apart = step / core.refine
        return taps(core.interpolation, first, apart, axis.count, pixels, core.opening, np.float64)

    def weighted_column(self, used: NDArray[np.intp], a: int, down: _FineAxis, across: _FineAxis) -> Any:
        """The samples that taps of a column read, subdivided, times the masks: (taps, rows, columns, channels)."""
        block = self.divided(used, a, down, across)
        for mask in self.core.masks:
            weights = np.stack([_separable_weights(mask, b, a, down.index, across.index) for b in used])
            block = block * self.constant(weights[..., None])
        return block

    def divided(self, used: NDArray[np.intp], a: int, down: _FineAxis, across: _FineAxis) -> Any:
        """The samples that taps of a column read, (taps, rows, columns, channels), subdivided if required."""
        core, xp = self.core, self.xp
        where = xp.asarray(core.view_rows[used], device=self.device)
        block = xp.take(self.columns[int(core.view_columns[a])], where, axis=0)
        if down.division is None or across.division is None:
            return block
        rows = xp.reshape(xp.permute_dims(block, (1, 0, 2, 3)), (core.samples[0], -1))
        rows = xp.reshape(Bands.of_division(down.division, core.samples[0]).of(rows), (-1, *block.shape[2:]))
        fine = self.along_columns(Bands.of_division(across.division, core.samples[1]), rows)
        return xp.permute_dims(xp.reshape(fine, (down.count, used.size, across.count, -1)), (1, 0, 2, 3))

    def along_columns(self, bands: Bands, block: Any) -> Any:
        """Multiply the columns of a block (rows, columns, channels) by a banded matrix."""
        rows, columns, channels = block.shape
        turned = self.xp.reshape(self.xp.permute_dims(block, (1, 0, 2)), (columns, -1))
        return self.xp.permute_dims(self.xp.reshape(bands.of(turned), (-1, rows, channels)), (1, 0, 2))

    def sheared_column(self, a: int) -> Any:
        """The sum of all taps of one column, gathered tap by tap, if rows and columns are sheared."""
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
        """Mix the rows of block (m, n, channels): pixel (p, 1) sums the rows near it, separately for each column
        n.

        Args:
            block: samples; row 0 lies at pixel coordinate ``start`` (1, n), the rows are ``step`` apart.
            pixel: pixel indices (p, 1).
            start: see ``block``.
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
