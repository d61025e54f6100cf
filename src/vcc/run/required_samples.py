"""Restrict a stored light field to the pixels of each view that the sensor sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.fields.disparity import Disparities
from vcc.fields.grid import Block, Grid
from vcc.fields.samples import Samples
from vcc.plan.model import Plan


@dataclass(frozen=True, eq=False, repr=False)
class RequiredSamples(Brief):
    """A rectangle of pixels of all views; in each view only the needed pixels are read, others are 0.

    Args:
        samples: the full samples.
        block: the rectangle.
        pixels: needed pixels of each view, as in `Plan.used_pixels`.
        grid: of the part.
    """

    samples: Samples
    block: Block
    pixels: NDArray[np.intp]
    grid: Grid

    @property
    def stored_bytes(self) -> int:
        """Bytes of all stored samples, needed or not."""
        return self.samples.stored_bytes

    def whole(self) -> None:
        """None: the samples are not in memory."""

    def check_complete(self) -> None:
        """Raise an error if views are missing."""
        self.samples.check_complete()

    def read(self, block: Block) -> Any:
        """The samples of a block of the part, (v, u, t, s[, channels])."""
        values = np.zeros((*block.shape, *self.grid.shape[4:]), self.grid.kind)
        corner, end = (np.array(block.ranges[2:]) + np.array(self.block.ranges[2:])[:, :1]).T
        for place in np.ndindex(*block.shape[:2]):
            row, column = block.rows[0] + place[0], block.columns[0] + place[1]
            first, stop = np.clip(self.pixels[row, column].T, corner, end)
            if (stop <= first).any():
                continue
            one = Block(
                (row, row + 1), (column, column + 1), *map(tuple, np.stack([first, stop], axis=-1).tolist())
            )
            (top, left), (bottom, right) = first - corner, stop - corner
            values[place][top:bottom, left:right] = self.samples.read(one)[0, 0]
        return values


def required_samples(plan: Plan, samples: Samples) -> tuple[Plan, Samples]:
    """A plan and samples, cut to the pixels that the image needs; the image does not change.

    Args:
        plan: of images. It is returned as it is if it interpolates views, has a halo of dark samples, or has rays
            that may use any pixel.
        samples: of the plan's grid. Samples in memory are returned as they are.
    """
    (cut,), part = required_by_all([plan], samples)
    return cut, part


def required_by_all(plans: Sequence[Plan], samples: Samples) -> tuple[list[Plan], Samples]:
    """Several plans and their samples, cut to the pixels that any of the plans needs.

    Args:
        plans: as for `required_samples`; if one of them cannot be cut, none is.
        samples: as for `required_samples`.
    """
    if samples.whole() is not None or any(map(_stays, plans)):
        return list(plans), samples
    grid = samples.grid
    pixels = _of_any([plan.used_pixels(grid.shape) for plan in plans], grid.shape)
    some = (pixels[..., 1] > pixels[..., 0]).all(axis=-1)
    if not some.any() or (pixels[some] == [[0, grid.shape[2]], [0, grid.shape[3]]]).all():
        return list(plans), samples
    (top, bottom), (left, right) = zip(
        pixels[some][..., 0].min(axis=0), pixels[some][..., 1].max(axis=0), strict=True
    )
    block = replace(
        Block.all_of(grid.shape), pixel_rows=(int(top), int(bottom)), pixel_columns=(int(left), int(right))
    )
    piece, _ = replace(grid, disparities=Disparities()).piece(block.slices)
    cut = [replace(plan, core=plan.core.part(plan.block(block)), grid_shape=piece.shape[:4]) for plan in plans]
    return cut, RequiredSamples(samples, block, pixels, piece)


def _stays(plan: Plan) -> bool:
    """Whether a plan cannot be cut, since operators before the core depend on the borders of the light field."""
    return plan.views_between is not None or any(map(any, plan.halo))


def _of_any(several: Sequence[NDArray[np.intp]], shape: tuple[int, ...]) -> NDArray[np.intp]:
    """The union of the pixel ranges of several plans, as in `Plan.used_pixels`."""
    pixels = np.stack(several)
    none = (pixels[..., 1] <= pixels[..., 0]).any(axis=-1, keepdims=True)
    firsts = np.where(none, shape[2:4], pixels[..., 0]).min(axis=0)
    return np.stack([firsts, np.where(none, 0, pixels[..., 1]).max(axis=0)], axis=-1)
