"""The samples that rays read, in closed form: for affine optics that do not mix x and y."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.plan.rays.bounds.windows import Aim, Window
from vcc.plan.rays.steps import Disc, Move, Rectangle, Step

Array = NDArray[np.float64]
Pair = tuple[float, float]

MARGIN = 1e-6
"""Margin in samples that is added to the reach of rays for rounding errors."""


@dataclass(frozen=True, eq=False, repr=False)
class Reach(Brief):
    """The range of the rays of pixels in a light field. All pairs are along (x, y).

    Args:
        index_from_ray: 5×5, indices (i, j, k, l) from rays (x, y, s, t, 1) at the sensor.
        window: the aim of the rays.
        motion: see `vcc.plan.rays.model.Rays`, also for the following.
        first_pixel: see there.
        pitch: see there.
        sensitive: see there.
        raster_shape: see there.
    """

    index_from_ray: Array
    window: Window
    motion: Array
    first_pixel: Pair
    pitch: Pair
    sensitive: Pair
    raster_shape: tuple[int, int]

    def places(self, axis: int, first: NDArray[np.int64], last: NDArray[np.int64]) -> Array:
        """The lowest and the highest place covered by pixels ``first`` to ``last``, (numbers, 2)."""
        places = self.first_pixel[axis] + self.pitch[axis] * np.stack([first, last], axis=-1)
        half = self.sensitive[axis] / 2
        return np.stack([places.min(axis=-1) - half, places.max(axis=-1) + half], axis=-1)

    def samples(
        self, axis: int, first: NDArray[np.int64], last: NDArray[np.int64], views: int
    ) -> tuple[Array, Array] | None:
        """The range of indices k (or l) that rays from pixels ``first`` to ``last`` read in views.

        Args:
            axis: 0 along x, 1 along y.
            first: (numbers,).
            last: likewise.
            views: number of views along the axis.

        Returns:
            Lowest and highest, (numbers, views) each; None if rays from one place all meet one view.
        """
        view_from_place, view_from_slope, view_offset = self.index_from_ray[axis, [axis, 2 + axis, 4]]
        from_place, from_slope, offset = self.index_from_ray[2 + axis, [axis, 2 + axis, 4]]
        if view_from_slope == 0:
            return None
        # Rays read a view that they pass at a distance of less than one view, and half a view beyond the
        # outermost.
        view = np.arange(views)
        passed = np.clip(np.stack([view - 1.0, view + 1.0]), -0.5, views - 0.5)  # (2, views)
        # At place x and view index i the slope is (i − a·x − c)/b: indices are linear in x and i.
        per_view = from_slope / view_from_slope
        places = self.places(axis, first, last)
        at = (
            (from_place - per_view * view_from_place) * places[:, :, None, None]
            + per_view * (passed - view_offset)
            + offset
            + self.motion[axis, axis] * (passed - view)
        ).reshape(len(first), 4, views)
        return at.min(axis=1) - MARGIN, at.max(axis=1) + MARGIN

    def views(self, axis: int) -> tuple[float, float]:
        """The range of indices i (or j) in which all rays pass the views."""
        across, down = (
            self.places(each, np.array([0]), np.array([self.raster_shape[1 - each] - 1]))[0] for each in (0, 1)
        )
        from_point = self.window.slope_from_point[axis]
        half = float(np.hypot(*from_point) if self.window.disc else np.abs(from_point).sum())
        corners = np.array([(x, y) for x in across for y in down])
        slopes = corners @ self.window.slope_from_sensor[axis] + self.window.offset[axis]
        from_place, from_slope, offset = self.index_from_ray[axis, [axis, 2 + axis, 4]]
        met = from_place * corners[:, axis] + from_slope * slopes + offset
        return (
            float(met.min() - abs(from_slope) * half - MARGIN),
            float(met.max() + abs(from_slope) * half + MARGIN),
        )


def index_from_sensor(aim: Aim, steps: Sequence[Step], index_from_ray: Affine, motion: Array) -> Array | None:
    """Indices from rays at the sensor, 5×5; None if this is not an affine map, or if x and y mix in it."""
    if not isinstance(aim, Window) or aim.slope_from_scatter or motion[0, 1] or motion[1, 0]:
        return None
    total = Affine.identity()
    for step in steps:
        if isinstance(step, Move):
            total = step.before_from_behind @ total
        elif not isinstance(step, Disc | Rectangle):
            return None
    matrix = (index_from_ray @ total).matrix
    return None if matrix[[0, 0, 2, 2, 1, 1, 3, 3], [1, 3, 1, 3, 0, 2, 0, 2]].any() else np.asarray(matrix)
