"""Single rays through a camera, for drawing: where they go, and where they end."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.affine import Affine
from vcc.camera import Camera

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Paths:
    """Where rays cross planes, and what is left of them.

    Args:
        z: of each plane, metres: (planes,). The last one is the sensor's.
        positions: (x, y) of each ray at each plane, metres: (rays, planes, 2).
        shares: what is left of each ray on arrival at each plane, 0 to 1: (rays, planes).
    """

    z: Array
    positions: Array
    shares: Array


def trace(camera: Camera, rays: ArrayLike, start: float = 0.0) -> Paths:
    """The paths of rays from a plane before the camera through its elements to the sensor.

    Args:
        camera: whose elements bend and absorb.
        rays: (u, v, s, t) of each ray at the entrance plane z = 0: (rays, 4), metres and slopes.
        start: where to start drawing, metres, 0 or less.
    """
    rays = np.asarray(rays, dtype=np.float64)
    share = np.ones(len(rays))
    places, positions, shares = [start], [Affine.propagation(start)(rays)[:, :2]], [share]
    for stage in camera.stages:
        rays = stage.approach(rays)
        places.append(stage.z)
        positions.append(rays[:, :2])
        shares.append(share)
        x, y = (rays[:, :2] - stage.element.decentre).T
        if stage.faces.pattern is not None:
            share = share * stage.faces.pattern(x, y)
        if stage.centred is not None:
            rays = stage.centred(rays)
        elif stage.faces.bending is not None:
            rays = rays + np.column_stack([np.zeros((len(rays), 2)), *stage.bent(*rays[:, :2].T)])
    rays = camera.approach_to_sensor(rays)
    places.append(camera.sensor.z)
    positions.append(rays[:, :2])
    shares.append(share)
    return Paths(np.array(places), np.stack(positions, axis=1), np.stack(shares, axis=1))


def fan(positions: ArrayLike, distance: float, offset: float, axis: int, cross: float = 0.0) -> Array:
    """Rays from a point of the scene through places on the entrance plane.

    Args:
        positions: places along the drawn axis, metres.
        distance: of the point from the entrance plane, metres; infinite for parallel light.
        offset: of the point from the axis as a slope, X/Z.
        axis: 0 for x, 1 for y.
        cross: place along the other axis, metres.

    Returns:
        (u, v, s, t) of each ray at z = 0, (rays, 4).
    """
    positions = np.asarray(positions, dtype=np.float64)
    rays = np.zeros((len(positions), 4))
    rays[:, axis] = positions
    rays[:, 1 - axis] = cross
    rays[:, 2:] = 0.0 if math.isinf(distance) else rays[:, :2] / distance
    rays[:, 2 + axis] -= offset
    return rays
