"""Distances on the sensor between neighbouring views' images of a point, as a function of the point's distance.

With x = A·u + B·s on the sensor, a point at distance Z before the entrance plane (s = u/Z) is imaged at
(A + B/Z)·u: neighbouring views' images of it are (A + B/Z)·du apart, and it is in focus if that is 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.plan.parallax_rule import index_motions

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Relative tolerance: values this close to a limit count as equal to it."""


@dataclass(frozen=True, eq=False, repr=False)
class ViewGaps(Brief):
    """Distances on the sensor between neighbouring views' images of a point, as a function of its distance.

    Args:
        frame: of the light field.
        on_sensor: 2×4, pixels (across, down) per metre and per slope of rays at the entrance plane.
        views: (rows, columns) of views.
    """

    frame: Affine
    on_sensor: Array
    views: tuple[int, int]

    def along_axes(self, vergences: Array) -> Array:
        """Pixels between neighbouring views along (u, v), (n, 2), for points at 1/Z = ``vergences``, (n,), 1/m."""
        per_index = self.on_sensor @ self.frame.linear
        steps = per_index[:, :2] - per_index[:, 2:] @ index_motions(self.frame, vergences)
        gaps = np.linalg.norm(steps, axis=1)
        gaps[:, [self.views[1] < 2, self.views[0] < 2]] = 0.0
        return np.where(gaps < ROUNDING, 0.0, gaps)

    def at(self, vergences: Array) -> Array:
        """The larger of the distances along u and v, pixels, (n,)."""
        return np.asarray(self.along_axes(np.asarray(vergences, dtype=np.float64)).max(axis=1))

    @property
    def footprint(self) -> float:
        """Width of a view's sample on the sensor, pixels."""
        return float(np.linalg.norm((self.on_sensor @ self.frame.linear)[:, 2:], axis=0).max())

    @property
    def limit(self) -> float:
        """The largest gap without visible ghosts: a pixel, or a sample if that is wider."""
        return max(1.0, self.footprint)

    @property
    def focus(self) -> float | None:
        """1/Z of the plane in focus, 1/m; None if the sensor sees all depths alike."""
        by_place, by_slope = self.on_sensor[:, :2], self.on_sensor[:, 2:]
        square = float((by_slope**2).sum())
        # Relative to rounding: a sensor at an image of the entrance plane does not separate depths.
        if square <= (ROUNDING * np.abs(by_place).max()) ** 2:
            return None
        return -float((by_place * by_slope).sum()) / square

    def free_of_ghosts(self) -> tuple[float, float] | None:
        """(lowest, highest) 1/Z with gaps within the limit, 1/m; None if there are none."""
        focus = self.focus
        if focus is None or max(self.views) < 2:
            return (-math.inf, math.inf) if self.at(np.zeros(1))[0] <= self.limit * (1 + ROUNDING) else None
        if self.at(np.array([focus]))[0] > self.limit:
            return None
        return self._border(focus, -1.0), self._border(focus, 1.0)

    def _border(self, focus: float, sense: float) -> float:
        """The limit of 1/Z on one side of focus: gaps grow with the distance from focus in 1/Z."""
        inside, step = focus, sense * max(abs(focus), 1.0) * 1e-6
        while self._fine(inside + step):
            inside, step = inside + step, 2 * step
            if abs(step) > 1e12:
                return sense * math.inf
        return self._bisected(inside, inside + step)

    def _bisected(self, inside: float, outside: float) -> float:
        """The last 1/Z with gaps within the limit, by bisection between one inside and one outside."""
        while abs(outside - inside) > 1e-12 * max(abs(inside), abs(outside)):
            middle = (inside + outside) / 2
            if middle in (inside, outside):
                break
            inside, outside = (middle, outside) if self._fine(middle) else (inside, middle)
        return inside

    def _fine(self, vergence: float) -> bool:
        return bool(self.at(np.array([vergence]))[0] <= self.limit)


def distance_of(vergence: float) -> float:
    """The distance in metres for 1/Z = ``vergence``: infinite at 0, negative if light converges."""
    return 1 / vergence if abs(vergence) > ROUNDING else math.inf
