"""How far apart on the sensor neighbouring views' pictures of a point are, by the point's distance.

With x = A·u + B·s on the sensor, a point at distance Z before the entrance plane (s = u/Z) reaches it at
(A + B/Z)·u: neighbouring views' pictures of it lie (A + B/Z)·du apart, and it is in focus where that is 0.
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
"""Of a limit: what differs from it by less is at it."""


@dataclass(frozen=True, eq=False, repr=False)
class ViewGaps(Brief):
    """How far apart on the sensor neighbouring views' pictures of a point are, by the point's distance.

    Args:
        frame: of the light field.
        on_sensor: 2×4, pixels (across, down) per metre and per slope of rays at the entrance plane.
        views: (rows, columns).
    """

    frame: Affine
    on_sensor: Array
    views: tuple[int, int]

    def along_axes(self, vergences: Array) -> Array:
        """Pixels from each view to the next along (u, v), (n, 2), for points at 1/Z = ``vergences``, (n,), 1/m."""
        per_index = self.on_sensor @ self.frame.linear
        steps = per_index[:, :2] - per_index[:, 2:] @ index_motions(self.frame, vergences)
        gaps = np.linalg.norm(steps, axis=1)
        gaps[:, [self.views[1] < 2, self.views[0] < 2]] = 0.0
        return np.where(gaps < ROUNDING, 0.0, gaps)

    def at(self, vergences: Array) -> Array:
        """The larger of both, pixels, (n,)."""
        return np.asarray(self.along_axes(np.asarray(vergences, dtype=np.float64)).max(axis=1))

    @property
    def footprint(self) -> float:
        """How wide a sample of a view is on the sensor, pixels."""
        return float(np.linalg.norm((self.on_sensor @ self.frame.linear)[:, 2:], axis=0).max())

    @property
    def limit(self) -> float:
        """The gap up to which no ghosts are seen: a pixel, or a sample where that is wider."""
        return max(1.0, self.footprint)

    @property
    def focus(self) -> float | None:
        """1/Z of what is in focus, 1/m; None where the sensor sees all depths alike."""
        by_place, by_slope = self.on_sensor[:, :2], self.on_sensor[:, 2:]
        square = float((by_slope**2).sum())
        # Against its rounding: a sensor at an image of the entrance plane has no slopes to tell depths by.
        if square <= (ROUNDING * np.abs(by_place).max()) ** 2:
            return None
        return -float((by_place * by_slope).sum()) / square

    def free_of_ghosts(self) -> tuple[float, float] | None:
        """(lowest, highest) 1/Z between which gaps keep to the limit, 1/m; None where they do nowhere."""
        focus = self.focus
        if focus is None or max(self.views) < 2:
            return (-math.inf, math.inf) if self.at(np.zeros(1))[0] <= self.limit * (1 + ROUNDING) else None
        if self.at(np.array([focus]))[0] > self.limit:
            return None
        return self._border(focus, -1.0), self._border(focus, 1.0)

    def _border(self, focus: float, sense: float) -> float:
        """How far from focus gaps stay within the limit: gaps grow with the distance from focus in 1/Z."""
        inside, step = focus, sense * max(abs(focus), 1.0) * 1e-6
        while self._fine(inside + step):
            inside, step = inside + step, 2 * step
            if abs(step) > 1e12:
                return sense * math.inf
        return self._bisected(inside, inside + step)

    def _bisected(self, inside: float, outside: float) -> float:
        """The last 1/Z at which gaps keep to the limit, between one at which they do and one at which not."""
        while abs(outside - inside) > 1e-12 * max(abs(inside), abs(outside)):
            middle = (inside + outside) / 2
            if middle in (inside, outside):
                break
            inside, outside = (middle, outside) if self._fine(middle) else (inside, middle)
        return inside

    def _fine(self, vergence: float) -> bool:
        return bool(self.at(np.array([vergence]))[0] <= self.limit)


def distance_of(vergence: float) -> float:
    """The distance in metres of what lies at 1/Z = ``vergence``: infinite at 0, below 0 if light converges."""
    return 1 / vergence if abs(vergence) > ROUNDING else math.inf
