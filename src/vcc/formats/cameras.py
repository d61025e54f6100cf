"""Conversion between a frame and the array of cameras that it describes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.fields.grid import Grid, camera_array_frame

Pair = float | tuple[float, float]
"""One number for both axes, or (along rows, along columns)."""

_PRECISION = 1e-9  # of a step: tolerance for a frame of a camera array


@dataclass(frozen=True)
class Cameras:
    """A planar array of parallel cameras, as in `vcc.LightField.from_views`.

    Args:
        spacing: distance (dv, du) between neighbouring views, metres.
        slope_per_pixel: pixel pitch over focal length, (pt, ps).
        focus_distance: distance at which the views converge, metres; infinite if they are parallel.
    """

    spacing: tuple[float, float]
    slope_per_pixel: tuple[float, float]
    focus_distance: float = math.inf

    def frame(self, shape: tuple[int, ...]) -> Affine:
        """The frame of the cameras' images.

        Args:
            shape: (v, u, t, s[, channels]).

        Raises:
            InputError: a spacing, slope or focus distance of zero or less.
        """
        return camera_array_frame(shape, self.spacing, self.slope_per_pixel, self.focus_distance)

    @property
    def are_parallel(self) -> bool:
        """Whether the views are parallel."""
        return math.isinf(self.focus_distance)

    @property
    def are_square(self) -> bool:
        """Whether spacing and slope per pixel are equal along rows and columns."""
        return all(math.isclose(*both, rel_tol=_PRECISION) for both in (self.spacing, self.slope_per_pixel))

    def turned(self) -> Cameras:
        """Copy with rows and columns of views exchanged."""
        return replace(self, spacing=self.spacing[::-1])


def cameras_of(grid: Grid) -> Cameras:
    """The cameras of a light field.

    Raises:
        InputError: the frame is not that of a centred array of parallel or converging cameras.
    """
    linear, (nv, nu, nt, ns) = grid.frame.linear, grid.shape[:4]
    fault = InputError(
        "the frame of this light field is not that of cameras on a grid centred on the axis (it was cropped, "
        "rotated or propagated), so a folder of pictures cannot store it. Write a .zarr, .npz or .mat, which keep "
        "any frame"
    )
    du, dv, ps, pt = map(float, (linear[0, 0], linear[1, 1], -linear[2, 2], -linear[3, 3]))
    if not min(du, dv, ps, pt) > 0:
        raise fault
    vergence = float(linear[2, 0]) / du
    parallel = abs(vergence) * max(nu * du, nv * dv) < _PRECISION * min(ps, pt)
    if vergence < 0 and not parallel:
        raise fault
    cameras = Cameras((dv, du), (pt, ps), math.inf if parallel else 1 / vergence)
    corners = np.array(np.meshgrid((0, nu - 1), (0, nv - 1), (0, ns - 1), (0, nt - 1))).reshape(4, -1).T
    off = (cameras.frame(grid.shape)(corners) - grid.frame(corners)) / (du, dv, ps, pt)
    if np.abs(off).max() > _PRECISION * max(nv, nu, nt, ns):
        raise fault
    return cameras
