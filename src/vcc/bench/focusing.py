"""The distance of the object at a pixel of an image, from the depth of the light field."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.light_field import LightField
from vcc.optics.train import Train
from vcc.recover.depth import depth_by_structure_tensor

PATCH = 24
"""Pixels each way around the pixel of the view, in which depth is estimated."""
NEAR = 2
"""Pixels each way whose depth is averaged."""


def distance_at(train: Train, light_field: LightField, share: tuple[float, float]) -> float:
    """The distance of the object at a position of the image, metres before the entrance plane.

    The ray through the middle view that lands there selects one of its pixels. The disparity at this pixel
    gives the distance.

    Args:
        train: the camera; elements that do not act by matrices are ignored.
        light_field: the light field before it.
        share: the position on the sensor, (down, across), 0 to 1, in the orientation of the sensor.

    Raises:
        InputError: a single view, a position outside the middle view, or no texture there that shows depth.
    """
    nv, nu, nt, ns = light_field.shape[:4]
    if nv * nu == 1:
        raise InputError("a single view has no parallax: its depth cannot be estimated")
    row, column = _pixel_of_middle_view(train, light_field, share)
    if not (0 <= row < nt and 0 <= column < ns):
        raise InputError("this point lies outside the light field's middle view")
    rows, first_row = _around(row, nt)
    columns, first_column = _around(column, ns)
    depth = depth_by_structure_tensor(light_field[:, :, rows, columns])
    down, across = row - first_row, column - first_column
    part = np.s_[max(down - NEAR, 0) : down + NEAR + 1, max(across - NEAR, 0) : across + NEAR + 1]
    weights = depth.confidence[part].astype(np.float64)
    if not weights.sum() > 0:
        raise InputError("no depth can be estimated there: click where there is some detail")
    disparity = float((depth.disparity[part] * weights).sum() / weights.sum())
    distance = light_field.grid.distance_of(disparity)
    return distance if distance > 0 else math.inf


def _around(middle: int, size: int) -> tuple[slice, int]:
    first, stop = max(middle - PATCH, 0), min(middle + PATCH + 1, size)
    return slice(first, stop), first


def _pixel_of_middle_view(train: Train, light_field: LightField, share: tuple[float, float]) -> tuple[int, int]:
    """(row, column) of the middle view's pixel whose ray lands at a place of the sensor."""
    rows, columns = train.sensor.shape
    place = np.asarray(train.sensor.frame([share[1] * columns - 0.5, share[0] * rows - 0.5]))
    ray = train.rays_at(train.sensor.z, before=True) @ light_field.frame
    j, i = light_field.grid.middle_view
    by_pixel, fixed = _of_pixels(ray.linear, ray.offset, i, j)
    if abs(np.linalg.det(by_pixel)) < 1e-12 * np.abs(by_pixel).max() ** 2:
        raise InputError("all pixels of a view land at one point here: a click does not identify an object")
    column, row = np.linalg.solve(by_pixel, place - fixed)
    return round(float(row)), round(float(column))


def _of_pixels(
    linear: NDArray[np.float64], offset: NDArray[np.float64], i: int, j: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The affine map from (column, row) of a view's pixels to the sensor: its matrix, and the image of (0, 0)."""
    return linear[:2, 2:], linear[:2, :2] @ np.array([i, j], dtype=np.float64) + offset[:2]
