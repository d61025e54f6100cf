"""How samples fall on pixels along one axis: a table per sample, for the backward pass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.engines.footprint_samples import FineGrid
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.shares import reach_in_pixels, share_slopes, shares

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Axis(Brief):
    """Samples along one axis, and the pixels that they reach.

    Args:
        origin: pixel coordinate of sample 0 of each tap, (taps,).
        step: pixels from a sample to the next, before subdivision.
        index: index of each sample, (samples,): fractions if samples are subdivided.
        refine: finer samples per sample.
        pixels: number of pixels.
        opening: see `Footprints`.
        interpolation: see `Footprints`.
    """

    origin: Array
    step: float
    index: Array
    refine: int
    pixels: int
    opening: float
    interpolation: str

    def table(
        self, kinds: Sequence[str] = ("share",), multiple: int = 1
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
        """First pixel and count (taps, samples), and shares (taps, samples, kinds, width) of each kind.

        Args:
            kinds: ``"share"`` is F; the others are its derivatives to a parameter.
            multiple: the width is a multiple of this; shares beyond the count are zero.
        """
        step = self.step / self.refine
        position = self.origin[:, None] + self.step * self.index
        reach = reach_in_pixels(self.interpolation, abs(step))
        low = np.clip(np.ceil(position - reach), 0, self.pixels).astype(np.int64)
        high = np.clip(np.floor(position + reach), -1, self.pixels - 1).astype(np.int64)
        count = np.maximum(high - low + 1, 0)
        first = np.minimum(low, self.pixels - 1)
        width = -(-max(int(count.max(initial=0)), 1) // multiple) * multiple
        pixel = (first[..., None] + np.arange(width)).astype(np.float64)
        there = np.arange(width) < count[..., None]
        made = np.zeros((*first.shape, len(kinds), width))
        for number, share in enumerate(self.shares(kinds, pixel, position[..., None])):
            made[..., number, :] = np.where(there, share, 0.0)
        return first, count, made

    def shares(self, kinds: Sequence[str], pixel: Array, position: Array) -> list[Array]:
        """F of samples at positions in pixels, or its derivative to a parameter, by kind."""
        given = self.interpolation, pixel, position, self.step / self.refine, self.opening
        share, index = shares(*given), self.index[:, None]
        place = size = opening = np.zeros(())
        if set(kinds) - {"share", "along"}:
            place, size, opening = share_slopes(*given)
        found: dict[str, Callable[[], Array]] = {
            "share": lambda: share,
            "along": lambda: index * share,
            "place": lambda: place,
            "step": lambda: index * place + np.sign(self.step) / self.refine * size,
            "opening": lambda: opening,
            "sheared": lambda: share * (pixel - self.origin[:, None, None]) / self.step,
        }
        return [found[kind]() for kind in kinds]


def axes(core: Footprints, fine: FineGrid) -> tuple[Axis, Axis]:
    """The axes of rows and of columns of samples, if they are separable."""
    index = [
        first + np.arange(n) / core.refine
        for first, n in ((fine.first_row, fine.rows), (fine.first_column, fine.columns))
    ]
    rows, columns = core.raster_shape
    given = core.opening, core.interpolation
    return (
        Axis(core.y[:, 0], core.row_step, index[0], core.refine, rows, *given),
        Axis(core.x[0], core.column_step, index[1], core.refine, columns, *given),
    )
