"""Spheres and planes by vectors: an oracle for real lenses, which shares no code with them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

Array = np.ndarray


def traced(
    surfaces: Any, front: float, points: Array, ways: Array, stop: float | None = None
) -> tuple[Array, ...]:
    """Points on the last surface, unit directions behind it, and which rays pass.

    Args:
        surfaces: of a prescription without aspheres.
        front: z of the first vertex.
        points: (n, 3), anywhere on rays before the lens.
        ways: (n, 3), their directions.
        stop: diameter of the stop in place of its surface's.
    """
    ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    passes, before, vertex = np.ones(len(points), dtype=bool), 1.0, front
    for surface in surfaces:
        if math.isinf(surface.radius):
            points = points + ((vertex - points[:, 2]) / ways[:, 2])[:, None] * ways
            normal = np.tile([0.0, 0.0, 1.0], (len(points), 1))
        else:
            centre = np.array([0.0, 0.0, vertex + surface.radius])
            off = points - centre
            along = (off * ways).sum(axis=1)
            root = along**2 - (off**2).sum(axis=1) + surface.radius**2
            passes &= root > 0
            points = points + (-along - np.sign(surface.radius) * np.sqrt(np.maximum(root, 0)))[:, None] * ways
            normal = (centre - points) / surface.radius
        cosine = (ways * normal).sum(axis=1)
        ratio = before / surface.index
        left = 1 - ratio**2 * (1 - cosine**2)
        passes &= left > 0
        ways = ratio * ways + (np.sqrt(np.maximum(left, 0)) - ratio * cosine)[:, None] * normal
        diameter = stop if surface.stop and stop is not None else surface.diameter
        if diameter is not None:
            passes &= np.hypot(points[:, 0], points[:, 1]) <= diameter / 2
        before, vertex = surface.index, vertex + surface.thickness
    return points, ways, passes


def landed(
    lens: Any, sensor_z: float, distance: float, field: tuple[float, float], places: Array
) -> tuple[Array, Array]:
    """Where rays of a point through places of the entrance plane meet the sensor, (n, 2), and their light.

    Light is cos⁴ of the angle at which a ray arrives at the entrance plane, or 0.
    """
    slopes = places / distance - np.array(field)
    ways = np.column_stack([slopes, np.ones(len(slopes))])
    start = np.column_stack([places, np.zeros(len(places))]) - 0.5 * ways
    points, ways, passes = traced(
        lens.prescription.surfaces, lens.z + lens.front, start, ways, lens.first_order.stop_diameter
    )
    ends = points + ((sensor_z - points[:, 2]) / ways[:, 2])[:, None] * ways
    return ends[:, :2], passes / (1 + (slopes**2).sum(axis=1)) ** 2
