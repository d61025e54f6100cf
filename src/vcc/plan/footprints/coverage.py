"""Which of the rays that a camera asks for lie beside the light field, where footprints are summed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcc.plan.footprints.planes import Plane
from vcc.shapes.patterns import Cells, is_grid

Array = NDArray[np.float64]


def missing_rays(
    view_planes: list[Plane],
    shape: tuple[int, ...],
    samples: tuple[int, int],
    weights: Array,
    tap: Array,
    step: Array,
    sensor_shape: tuple[int, int],
    outside_views: float | None = None,
) -> tuple[float, str]:
    """The share of rays that the open aperture sends to the sensor and the light field does not hold.

    Args:
        view_planes: masks at the views.
        shape: of the light field.
        samples: (rows, columns) of a view.
        weights: of the taps.
        tap: where their samples (0, 0) fall on the sensor.
        step: from sample to sample there.
        sensor_shape: (rows, columns).
        outside_views: the share of the aperture outside the grid of views, if it is known; else it is found.
    """
    if outside_views is None:
        outside_views = _aperture_outside_views(view_planes, shape)
    outside_pictures = _sensor_outside_views(samples, weights, tap, step, sensor_shape)
    missing = 1 - (1 - outside_views) * (1 - outside_pictures)
    reasons = []
    if outside_views > 1e-3:
        reasons.append(f"{outside_views:.1%} of the aperture lies outside the grid of views")
    if outside_pictures > 1e-3:
        reasons.append(f"{outside_pictures:.1%} of what the sensor sees lies outside the views' pictures")
    return (missing if missing > 1e-9 else 0.0), "; ".join(reasons)


def outside_views_of(plane: Plane, cells: Cells, values: Array, shape: tuple[int, ...]) -> list[float] | None:
    """The share of each of several apertures that lies outside the grid of views.

    Args:
        plane: the only one at the views.
        cells: its pattern.
        values: several arrays in their place, (arrays, rows, columns).
        shape: of the light field.

    Returns:
        None where they have to be found one by one.
    """
    (x, y), *_ = _looked_at([plane], shape)
    if not is_grid(x, y):
        return None
    across, down = _inside([plane], shape)
    # Each cell is met by some of the places: by so many along columns, times so many along rows.
    rows, columns = cells.cells_at(x.ravel(), y.ravel())
    (all_down, in_down), (all_across, in_across) = (
        (np.bincount(at[at >= 0], minlength=n), np.bincount(at[(at >= 0) & inside.ravel()], minlength=n))
        for at, inside, n in ((rows, down, values.shape[1]), (columns, across, values.shape[2]))
    )
    total, held = values @ all_across @ all_down, values @ in_across @ in_down
    return [float(1 - part / all) if all > 0 else 0.0 for part, all in zip(held, total, strict=True)]


def _aperture_outside_views(planes: list[Plane], shape: tuple[int, ...]) -> float:
    if not any(np.isfinite(plane.pattern.size).all() for plane in planes):
        return 0.0
    open_here = np.ones((128, 128))
    for plane, (x, y) in zip(planes, _looked_at(planes, shape), strict=True):
        open_here = open_here * plane.pattern(x, y)
    across, down = _inside(planes, shape)
    total = open_here.sum()
    return float(1 - (open_here * (across & down)).sum() / total) if total > 0 else 0.0


def _views_looked_at(planes: list[Plane], shape: tuple[int, ...]) -> tuple[Array, Array]:
    """Views (across, down) by which 128×128 places of the smallest of planes are met."""
    bounded = [plane for plane in planes if np.isfinite(plane.pattern.size).all()]
    plane = min(bounded, key=lambda p: p.pattern.size[0] * p.pattern.size[1])
    points = (np.arange(128) + 0.5) / 128 - 0.5
    x, y = points * plane.pattern.size[0], points * plane.pattern.size[1]
    if all(not (p.at_index[0, 1] or p.at_index[1, 0]) for p in planes):
        x, y = x[None, :], y[:, None]  # a row and a column of places say it all
    else:
        x, y = np.meshgrid(x, y)
    middle = plane.middle_of_view((shape[2], shape[3]))
    return _through(np.linalg.inv(plane.at_index[:, :2]), x - middle[0], y - middle[1])


def _looked_at(planes: list[Plane], shape: tuple[int, ...]) -> list[tuple[Array, Array]]:
    """Places (x, y) on each plane that are looked at."""
    view = _views_looked_at(planes, shape)
    places = []
    for plane in planes:
        across, down = _through(plane.at_index[:, :2], *view)
        middle = plane.middle_of_view((shape[2], shape[3]))
        places.append((across + middle[0], down + middle[1]))
    return places


def _inside(planes: list[Plane], shape: tuple[int, ...]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which of these places lie within the grid of views, (across, down)."""
    across, down = _views_looked_at(planes, shape)
    # Half a raster step of grace: an aperture as wide as the grid misses nothing.
    return abs(across - (shape[1] - 1) / 2) <= shape[1] / 2, abs(down - (shape[0] - 1) / 2) <= shape[0] / 2


def _through(matrix: NDArray[np.floating], x: Array, y: Array) -> tuple[Array, Array]:
    """Places (x, y) mapped by a 2×2 matrix; without cross terms a row of x and a column of y stay such."""
    (xx, xy), (yx, yy) = matrix
    return x * xx + (y * xy if xy else 0.0), y * yy + (x * yx if yx else 0.0)


def _sensor_outside_views(
    samples: tuple[int, int], weights: Array, tap: Array, step: Array, sensor_shape: tuple[int, int]
) -> float:
    """The share of pixels and open views that meet outside the views' pictures, on a grid of sensor points."""
    total = weights.sum()
    if total <= 0:
        return 1.0
    if abs(np.linalg.det(step)) < 1e-9:
        return 0.0  # every view falls into a point: no pixel asks for a particular sample
    if not (step[0, 1] or step[1, 0] or np.ptp(tap[..., 0], axis=0).any() or np.ptp(tap[..., 1], axis=1).any()):
        across = _covered_share(tap[0, :, 0], step[0, 0], samples[1], sensor_shape[1])
        down = _covered_share(tap[:, 0, 1], step[1, 1], samples[0], sensor_shape[0])
        return float(1 - down @ weights @ across / total)
    rows = (np.arange(24) + 0.5) / 24 * sensor_shape[0] - 0.5
    columns = (np.arange(24) + 0.5) / 24 * sensor_shape[1] - 0.5
    points = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    used = weights > 0
    index = (points[None] - tap[used][:, None]) @ np.linalg.inv(step).T
    size = np.array([samples[1], samples[0]])
    inside = ((index >= -0.5) & (index <= size - 0.5)).all(axis=-1)
    return float(1 - (weights[used][:, None] * inside).sum() / (total * len(points)))


def _covered_share(first: Array, step: float, samples: int, pixels: int) -> Array:
    """The share of the sensor's extent that each view's picture covers, along one axis."""
    ends = np.stack([first - step / 2, first + step * (samples - 0.5)])
    low, high = ends.min(axis=0), ends.max(axis=0)
    covered = np.minimum(high, pixels - 0.5) - np.maximum(low, -0.5)
    return np.asarray(np.clip(covered, 0, None) / pixels)
