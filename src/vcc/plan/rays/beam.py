"""How far rays can stray: bounds of places and slopes on the way back from the sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Beam:
    """All rays that are traced, in one plane: (x, y, s, t) = middle + basis · ξ + loose · η, all |ξ|, |η| ≤ 1.

    The four ξ are the places on the sensor and in the window aimed at; each η is what an array, a plate or a
    diffuser can add at most to s or to t. Affine optics act on both exactly. So the bounds hold, and are tight
    where all is affine.

    Args:
        middle: (4,).
        basis: (4, 4).
        loose: (4, any number).
    """

    middle: Array
    basis: Array
    loose: Array

    @classmethod
    def between(cls, sensor_middle: Array, sensor_half: Array, slopes: Array, slope_from_sensor: Array) -> Beam:
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

    def moved(self, before_from_behind: Affine) -> Beam:
        """The rays in another plane."""
        linear = before_from_behind.linear
        return Beam(linear @ self.middle + before_from_behind.offset, linear @ self.basis, linear @ self.loose)

    def loosened(self, slopes: tuple[float, float]) -> Beam:
        """The rays after something that changes slopes by up to (|δs|, |δt|)."""
        added = np.zeros((4, 2))
        added[2, 0], added[3, 1] = slopes
        return Beam(self.middle, self.basis, np.concatenate([self.loose, added], axis=1))

    @property
    def half(self) -> Array:
        """Half the extent of (x, y, s, t)."""
        return np.asarray(np.abs(self.basis).sum(axis=1) + np.abs(self.loose).sum(axis=1))
