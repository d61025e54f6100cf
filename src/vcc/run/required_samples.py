"""What a picture needs of a light field that is read: of each view the pixels that the sensor sees, no others."""

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
    """A part of the pixels of all views, of which those of each view are read that it needs; others are dark.

    Args:
        samples: of which this is a part.
        block: which part.
        pixels: of each view, as `Plan.used_pixels` has them.
        grid: of the part.
    """

    samples: Samples
    block: Block
    pixels: NDArray[np.intp]
    grid: Grid

    @property
    def stored_bytes(self) -> int:
        """Bytes of all, needed or not."""
        return self.samples.stored_bytes

    def whole(self) -> None:
        """They are read."""

    def check_complete(self) -> None:
        """Refuse a light field of which views are missing."""
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
    """A plan and samples, cut to the pixels that its picture needs: the picture stays as it is.

    Args:
        plan: of pictures. Where views in between are made, for a piece among dark samples, and by rays that may
            look anywhere, it stays.
        samples: for which it is made. Those in memory stay.
    """
    (cut,), part = required_by_all([plan], samples)
    return cut, part


def required_by_all(plans: Sequence[Plan], samples: Samples) -> tuple[list[Plan], Samples]:
    """Several plans and the samples of which they make pictures, cut to the pixels that any of these needs.

    Args:
        plans: as for `required_samples`; where one of them stays, all do.
        samples: likewise.
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
    """Whether a plan is for the light field as it is, as what is done to it before depends on where it ends."""
    return plan.views_between is not None or any(map(any, plan.halo))


def _of_any(several: Sequence[NDArray[np.intp]], shape: tuple[int, ...]) -> NDArray[np.intp]:
    """From where to where the pixels go that any of several needs, as `Plan.used_pixels` has them for one."""
    pixels = np.stack(several)
    none = (pixels[..., 1] <= pixels[..., 0]).any(axis=-1, keepdims=True)
    firsts = np.where(none, shape[2:4], pixels[..., 0]).min(axis=0)
    return np.stack([firsts, np.where(none, 0, pixels[..., 1]).max(axis=0)], axis=-1)
