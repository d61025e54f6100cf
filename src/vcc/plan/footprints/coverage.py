"""Which of the rays that a camera asks for lie beside the light field, where footprints are summed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcc.plan.footprints.planes import Plane

Array = NDArray[np.float64]


def missing_rays(
    view_planes: list[Plane],
    shape: tuple[int, ...],
    samples: tuple[int, int],
    weights: Array,
    tap: Array,
    step: Array,
    sensor_shape: tuple[int, int],
) -> tuple[float, str]:
    """The share of rays that the open aperture sends to the sensor and the light field does not hold."""
    outside_views = _aperture_outside_views(view_planes, shape)
    outside_pictures = _sensor_outside_views(samples, weights, tap, step, sensor_shape)
    missing = 1 - (1 - outside_views) * (1 - outside_pictures)
    reasons = []
    if outside_views > 1e-3:
        reasons.append(f"{outside_views:.1%} of the aperture lies outside the grid of views")
    if outside_pictures > 1e-3:
        reasons.append(f"{outside_pictures:.1%} of what the sensor sees lies outside the views' pictures")
    return (missing if missing > 1e-9 else 0.0), "; ".join(reasons)


def _aperture_outside_views(planes: list[Plane], shape: tuple[int, ...]) -> float:
    bounded = [plane for plane in planes if np.isfinite(plane.pattern.size).all()]
    if not bounded:
        return 0.0
    plane = min(bounded, key=lambda p: p.pattern.size[0] * p.pattern.size[1])
    points = (np.arange(128) + 0.5) / 128 - 0.5
    x, y = points * plane.pattern.size[0], points * plane.pattern.size[1]
    if all(not (p.at_index[0, 1] or p.at_index[1, 0]) for p in planes):
        x, y = x[None, :], y[:, None]  # a row and a column of places say it all
    else:
        x, y = np.meshgrid(x, y)
    to_view = np.linalg.inv(plane.at_index[:, :2])
    samples = (shape[2], shape[3])
    view = _through(to_view, x - plane.middle_of_view(samples)[0], y - plane.middle_of_view(samples)[1])
    open_here = np.ones((128, 128))
    for other in planes:
        across, down = _through(other.at_index[:, :2], *view)
        middle = other.middle_of_view(samples)
        open_here = open_here * other.pattern(across + middle[0], down + middle[1])
    # Half a raster step of grace: an aperture as wide as the grid misses nothing.
    inside = np.logical_and(
        *(abs(v - (n - 1) / 2) <= n / 2 for v, n in zip(view, (shape[1], shape[0]), strict=True))
    )
    total = open_here.sum()
    return float(1 - (open_here * inside).sum() / total) if total > 0 else 0.0


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
