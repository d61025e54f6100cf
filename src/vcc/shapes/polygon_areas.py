"""What of rectangles lies inside a regular polygon, in closed form."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcc.shapes.patterns import Polygon

Array = NDArray[np.float64]


def polygon_mean(polygon: Polygon, x: Array, y: Array, width: float, height: float) -> Array:
    """The share of rectangles that lies inside a polygon.

    Args:
        polygon: around the origin.
        x: centres, metres; broadcast with ``y``.
        y: centres, metres.
        width: of every rectangle, metres.
        height: of every rectangle, metres.
    """
    floor = polygon.diameter * 1e-5
    width, height = max(width, floor), max(height, floor)
    right, left, bottom, top = x + width / 2, x - width / 2, y + height / 2, y - height / 2
    content = (
        _area(polygon, right, bottom)
        - _area(polygon, left, bottom)
        - _area(polygon, right, top)
        + _area(polygon, left, top)
    )
    return np.clip(content / (width * height), 0.0, None)


def _area(polygon: Polygon, x: Array, y: Array) -> Array:
    """The polygon's area left of x and above y.

    By Green's theorem it is ∮ min(x(b), x) db around what lies above y: less x·∮ db = 0, −∮ max(x − x(b), 0) db,
    side by side a mean of what is linear where it is above 0, times the side's height.
    """
    angle = polygon.rotation + 2 * math.pi * np.arange(polygon.sides + 1) / polygon.sides
    a, b = polygon.diameter / 2 * np.cos(angle), polygon.diameter / 2 * np.sin(angle)
    total = np.zeros(np.broadcast_shapes(x.shape, y.shape))
    for n in range(polygon.sides):
        high = b[n + 1] - b[n]
        if abs(high) < 1e-12 * polygon.diameter:
            continue
        first, last = np.minimum(b[n], y), np.minimum(b[n + 1], y)
        slope = (a[n + 1] - a[n]) / high
        total -= (last - first) * _mean_above_zero(
            x - a[n] - slope * (first - b[n]), x - a[n] - slope * (last - b[n])
        )
    return total


def _mean_above_zero(one: Array, other: Array) -> Array:
    """The mean of max(f, 0) where f goes linearly from one number to another."""
    low, high = np.minimum(one, other), np.maximum(one, other)
    crossing = (low < 0) & (high > 0)
    crossed = np.divide(high * high, 2 * (high - low), out=np.zeros(low.shape), where=crossing)
    return np.where(crossing, crossed, np.maximum((low + high) / 2, 0.0))
