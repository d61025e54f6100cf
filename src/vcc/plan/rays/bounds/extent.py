"""Bounds of the places and slopes of all rays of an aim, on their way back from the sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.plan.rays.bounds.windows import Aim, CellWindows
from vcc.plan.rays.path import Leg, Path

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class RayExtent(Brief):
    """All traced rays, in one plane: (x, y, s, t) = middle + basis · ξ + loose · η, all |ξ|, |η| ≤ 1.

    The four ξ are the places on the sensor and in the window; each η is the largest deflection in s or t by an
    array, a plate or a diffuser. Affine optics act on both exactly. So the bounds are valid, and are tight
    if all optics are affine.

    Args:
        middle: (4,).
        basis: (4, 4).
        loose: (4, any number).
    """

    middle: Array
    basis: Array
    loose: Array

    @classmethod
    def between(
        cls, sensor_middle: Array, sensor_half: Array, slopes: Array, slope_from_sensor: Array
    ) -> RayExtent:
        """Rays from a rectangle on the sensor.

        Args:
            sensor_middle: (x, y).
            sensor_half: half its (width, height).
            slopes: (2, 3): columns are the slopes' change along the two coordinates of the window, and the slope
                at the middle of the window from the origin of the sensor.
            slope_from_sensor: 2×2.
        """
        basis = np.zeros((4, 4))
        basis[:2, :2] = np.diag(sensor_half)
        basis[2:, :2] = slope_from_sensor @ np.diag(sensor_half)
        basis[2:, 2:] = slopes[:, :2]
        middle = np.concatenate([sensor_middle, slopes[:, 2] + slope_from_sensor @ sensor_middle])
        return cls(middle, basis, np.zeros((4, 0)))

    def moved(self, before_from_behind: Affine) -> RayExtent:
        """The rays in another plane."""
        linear, offset = before_from_behind.linear, before_from_behind.offset
        return RayExtent(linear @ self.middle + offset, linear @ self.basis, linear @ self.loose)

    def loosened(self, changes: tuple[float, ...]) -> RayExtent:
        """The rays after an element that changes slopes by up to (|δs|, |δt|), or all of (x, y, s, t)."""
        added = np.diag(changes) if len(changes) == 4 else np.vstack([np.zeros((2, 2)), np.diag(changes)])
        return RayExtent(self.middle, self.basis, np.concatenate([self.loose, added], axis=1))

    @property
    def half(self) -> Array:
        """Half the extent of (x, y, s, t)."""
        return np.asarray(np.abs(self.basis).sum(axis=1) + np.abs(self.loose).sum(axis=1))


def extent_towards(path: Path, aim: Aim, half: Array | None = None) -> RayExtent:
    """All rays of an aim, at the sensor; from the whole sensor, or a rectangle of half sizes (x, y)."""
    sensor = path.train.sensor
    middle = np.array(sensor.decentre)
    half = np.array(sensor.size[::-1]) / 2 if half is None else half
    if isinstance(aim, CellWindows):
        return _through_cells(aim, middle, half)
    slopes = np.column_stack([aim.slope_from_point, aim.offset])
    extent = RayExtent.between(middle, half, slopes, aim.slope_from_sensor)
    uniform = [scatter for scatter in path.scatters if scatter.uniform]
    # Diffusers beyond the window are not compensated: there are as many terms as diffusers before it.
    for scatter, (_, slope_from_scatter) in zip(uniform, aim.slope_from_scatter, strict=False):
        s, t = np.abs(slope_from_scatter) @ np.array(scatter.reach)
        extent = extent.loosened((float(s), float(t)))
    return extent


def _through_cells(aim: CellWindows, middle: Array, half: Array) -> RayExtent:
    """Rays through all cells that are used: those around (stop − offset − factor·x) / beyond."""
    sight = aim.sight
    pitch = np.full(2, aim.cells.lattice.pitch)
    reach = np.array(aim.reach[::-1]) * pitch * math.sqrt(2) + 2 * pitch
    slope = 1 / sight.place_from_slope
    from_sensor = slope * (-sight.beyond_from_sensor / sight.beyond - sight.place_from_sensor)
    at_origin = slope * ((aim.stop.middle - sight.beyond_offset) / sight.beyond - sight.offset)
    slopes = np.column_stack([np.diag(slope * reach), at_origin])
    return RayExtent.between(middle, half, slopes, np.diag(from_sensor))


def footprint(path: Path, aim: Aim, leg: Leg) -> Array | None:
    """(width, height) in metres over which the rays of one pixel spread on a leg, by pixel or by window.

    None if unknown: if an element on the way, other than lenses and prisms, bends rays.
    """
    nearer = path.legs[: leg.number]
    if isinstance(aim, CellWindows) or any(other.stage.faces.bending is not None for other in nearer):
        return None
    extent = extent_towards(path, aim, path.pixel / 2).moved(leg.from_sensor)
    return np.asarray(2 * np.abs(extent.basis[:2]).max(axis=1))
