"""The middle row and the middle column of a light field's views, and conventions for their disparities.

Disparities are those of `vcc.fields.parallax`: along u, pixels per view, positive = nearer than the plane on which
the views converge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.grid import Block, Grid, axes_agree
from vcc.fields.parallax import Axis
from vcc.fields.sampled import to_numpy

Array = NDArray[np.float32]

LARGEST_RANGE = 64
"""Pixels per view in either direction; a larger range is assumed to be in other units."""
MARGIN = 0.3
"""Pixels per view by which a measured range is widened, because it excludes the outermost 2 %."""


class Views(Protocol):
    """The part of `vcc.fields.samples.Samples` that is needed here: a grid, and its blocks on request."""

    @property
    def grid(self) -> Grid:
        """The rays of the samples."""

    def read(self, block: Block, /) -> Any:
        """The samples of a block, (v, u, t, s[, channels])."""


@dataclass(frozen=True, eq=False, repr=False)
class Arm(Brief):
    """Views on both sides of one, prepared for matching: the middle row or column of a grid, or scattered views.

    Args:
        views: (views, channels, t, s), the square roots of radiance relative to its bright part. The square root
            makes photon noise uniform, and shadows count like highlights.
        along: the axis of views, ``"u"`` for a row, ``"v"`` for a column.
        steps: place of each view relative to the one that they are compared with, in views along this axis and
            along the other one, (views, 2); None for all views of a row or column, relative to its middle one.
    """

    views: Array
    along: Axis
    steps: NDArray[np.float64] | None = None

    @property
    def places(self) -> NDArray[np.float64]:
        """``steps``, also of a row or column."""
        if self.steps is not None:
            return self.steps
        along = np.arange(len(self.views)) - float(self.middle)
        return np.stack([along, np.zeros_like(along)], axis=1)

    @property
    def middle(self) -> int:
        """The number of the middle view."""
        return (len(self.views) - 1) // 2

    @property
    def axis(self) -> int:
        """The axis of an image, (channel, t, s), along which it moves from view to view."""
        return 2 if self.along == "u" else 1


def check_axes(grid: Grid, fewest: int) -> None:
    """Check that the disparities of a light field can be found.

    Args:
        grid: its view axes must be parallel to its pixel axes.
        fewest: smallest number of views in a row or column.

    Raises:
        InputError: too few views, or a frame that rotates or mixes its axes.
    """
    rows, columns = grid.shape[:2]
    if max(rows, columns) < fewest:
        raise InputError(
            f"depth needs {fewest} views or more in a row or column; this light field has {rows}×{columns}"
        )
    if not axes_agree(grid.frame):
        raise InputError(
            "depth needs a light field whose view axes are along those of its pixels; this frame turns or "
            "mixes them. Resample it first (vcc.LightField.resampled)"
        )


def arms(light_field: Views) -> list[Arm]:
    """The middle row and the middle column of views, if they have at least two views; no other views are read.

    Raises:
        InputError: they are black.
    """
    shape = light_field.grid.shape
    row, column = ((n - 1) // 2 for n in shape[:2])
    whole = Block.all_of(shape)
    found = []
    if shape[1] > 1:
        found.append(Arm(_pictures(light_field.read(replace(whole, rows=(row, row + 1)))), "u"))
    if shape[0] > 1:
        found.append(Arm(_pictures(light_field.read(replace(whole, columns=(column, column + 1)))), "v"))
    bright = max(float(np.percentile(arm.views, 99)) for arm in found)
    if bright == 0:
        raise InputError("the middle views of this light field are black: there is no parallax to see")
    for arm in found:
        np.divide(arm.views, bright, out=arm.views)
        np.sqrt(np.minimum(arm.views, 4), out=arm.views)
    return found


def _pictures(values: Any) -> Array:
    """(views, channels, t, s) of a row or column of views."""
    views = to_numpy(values).astype(np.float32)
    views = views.reshape(-1, *views.shape[2:])
    views = views[..., None] if views.ndim == 3 else views
    return np.ascontiguousarray(np.moveaxis(views, 3, 1))


def range_to_search(grid: Grid, given: tuple[float, float] | None) -> tuple[float, float]:
    """(lowest, highest) disparity along u to be searched, pixels per view.

    Args:
        grid: of a light field, whose own range is used if none is passed, widened by `MARGIN` if it was measured.
        given: by a user.

    Raises:
        InputError: an invalid range, one in other units, or one that cannot be measured.
    """
    if given is None:
        measured = grid.measured_disparity_range()
        if measured is None:
            raise InputError(
                "the range of disparities cannot be measured (too little texture): give "
                "disparity_range=(low, high)"
            )
        widened = 0.0 if grid.disparity_range is not None else MARGIN
        given = (measured[0] - widened, measured[1] + widened)
    low, high = float(given[0]), float(given[1])
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise InputError(f"disparity_range is (lowest, highest), pixels per view, not {given}")
    if max(abs(low), abs(high)) > LARGEST_RANGE:
        raise InputError(
            f"disparity_range {given} reaches beyond {LARGEST_RANGE} pixels per view: it is given in pixels from "
            "one view to the next; light_field.disparity_of(distance) gives it for a distance in metres"
        )
    return low, high


def cubic_weights(f: float) -> tuple[float, float, float, float]:
    """Weights of samples −1, 0, 1 and 2 for the place f between 0 and 1 (Keys 1981, a = −½)."""
    return (
        ((-0.5 * f + 1) * f - 0.5) * f,
        (1.5 * f - 2.5) * f * f + 1,
        ((-1.5 * f + 2) * f + 0.5) * f,
        (0.5 * f - 0.5) * f * f,
    )


def moved(view: Array, shift: float, axis: int) -> Array:
    """A view read at ``shift`` pixels further along an axis, cubic; borders repeated."""
    whole = math.floor(shift)
    length = view.shape[axis]
    low, high = max(0, 1 - whole), max(0, whole + 2)
    padding = [(0, 0)] * view.ndim
    padding[axis] = (low, high)
    padded = np.pad(view, padding, mode="edge")
    start = low + whole - 1
    found = np.zeros_like(view)
    for n, weight in enumerate(cubic_weights(shift - whole)):
        if weight == 0:
            continue
        piece = [slice(None)] * view.ndim
        piece[axis] = slice(start + n, start + n + length)
        found += np.float32(weight) * padded[tuple(piece)]
    return found
