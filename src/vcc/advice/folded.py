"""A camera and a light field as ray matrices, as far as matrices are exact."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.advice.view_gaps import ROUNDING, ViewGaps, distance_of
from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.fields.grid import Grid
from vcc.optics.deflections import CellDeflection, FacetDeflection
from vcc.optics.train import Stage, Train

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Folded:
    """An optical train and a light field before it, as ray matrices.

    Args:
        train: any.
        grid: of the light field, at the entrance plane.
        vergences: 1/Z of the (farthest, nearest) part of the scene, 1/m, 0 for infinity; None where unknown.
    """

    train: Train
    grid: Grid
    vergences: tuple[float, float] | None

    @property
    def frame(self) -> Affine:
        """Frame of the light field."""
        return self.grid.frame

    @property
    def views(self) -> tuple[int, int]:
        """(rows, columns) of views."""
        return self.grid.shape[0], self.grid.shape[1]

    @property
    def pixels(self) -> tuple[int, int]:
        """(rows, columns) of a view."""
        return self.grid.shape[2], self.grid.shape[3]

    @property
    def pixel(self) -> float:
        """The sensor's smaller pitch, metres."""
        return min(self.train.sensor.pitches)

    # -- as far as matrices are exact

    @property
    @cached
    def blocking(self) -> Stage | None:
        """The first stage behind which matrices are not exact; None if there is none."""
        return next((stage for stage in self.train.stages if ends_matrices(stage)), None)

    @property
    @cached
    def reached(self) -> tuple[Stage, ...]:
        """The stages whose ``arriving`` is exact: up to and including the blocking one."""
        stages = self.train.stages
        return stages if self.blocking is None else stages[: stages.index(self.blocking) + 1]

    @property
    def to_sensor(self) -> Affine:
        """Map of rays from the entrance plane to the sensor; exact if no stage blocks."""
        return self.train.arriving_at_sensor

    @property
    def sensor_from_slope(self) -> Array:
        """2×2: position on the sensor per slope at the entrance plane, metres."""
        return self.to_sensor.linear[:2, 2:]

    def onwards(self, stage: Stage) -> Affine | None:
        """Map of rays from just before a stage to the sensor, for the stage's centre; None if not affine."""
        behind = self.train.stages[self.train.stages.index(stage) + 1 :]
        if stage not in self.reached or any(map(ends_matrices, behind)):
            return None
        return self.to_sensor @ stage.arriving.inverse()

    # -- the scene

    @property
    @cached
    def looked_at(self) -> float:
        """1/Z of the points followed between views: in focus, or the part of the scene nearest to focus."""
        by_place, by_slope = self.to_sensor.linear[:2, :2], self.sensor_from_slope
        square = float((by_slope**2).sum())
        focus = -float((by_place * by_slope).sum()) / square if square > 0 else 0.0
        low, high = (0.0, math.inf) if self.vergences is None else self.vergences
        return min(max(focus, low), high)

    @property
    @cached
    def gaps(self) -> ViewGaps | None:
        """Distances on the sensor between images of neighbouring views; None if a stage blocks."""
        if self.blocking is not None:
            return None
        vertical, horizontal = self.train.sensor.pitches
        per_pixel = np.diag([1 / horizontal, 1 / vertical])
        return ViewGaps(self.frame, per_pixel @ self.to_sensor.linear[:2], self.views_let_in)

    @property
    @cached
    def free_of_ghosts(self) -> tuple[float, float] | None:
        """(near, far) before the entrance plane, the range without visible gaps, metres; None if there is none."""
        free = None if self.gaps is None else self.gaps.free_of_ghosts()
        return None if free is None or free[1] <= 0 else (1 / free[1], distance_of(max(free[0], 0.0)))

    @property
    @cached
    def stop(self) -> float | None:
        """Half the width at the entrance plane that stops pass for a point in focus, metres; None if all."""
        widths = []
        for stage in self.reached:
            if stage.faces.pattern is None:
                continue
            size = min(stage.faces.pattern.size)
            grown = stretch(at_vergence(stage.arriving, self.looked_at))
            if math.isfinite(size) and grown > 0:
                widths.append(size / 2 / grown)
        return min(widths, default=None)

    @property
    def views_let_in(self) -> tuple[int, int]:
        """(rows, columns) of views of which stops pass some light of a point in focus."""
        if self.stop is None:
            return self.views
        across, down = np.linalg.norm(self.frame.linear[:2, :2], axis=0)
        rows, columns = self.views
        # Views that are directions either all pass or none does.
        return (
            min(rows, enough(2 * self.stop / down)) if down > 0 else rows,
            min(columns, enough(2 * self.stop / across)) if across > 0 else columns,
        )

    @property
    def half_width(self) -> float | None:
        """Half the width at the entrance plane of light of a point in focus, metres, limited by stops or views."""
        widths = [] if self.stop is None else [self.stop]
        if min(self.views) > 1:
            extent = np.abs(self.frame.linear[:2, :2]).sum(axis=0) * self.views[::-1]
            widths.append(float(extent.min()) / 2)
        return min(widths, default=None)


def ends_matrices(stage: Stage) -> bool:
    """Whether a stage's deflection has a derivative that the ray matrices do not contain."""
    bending = stage.faces.bending
    if bending is None or isinstance(bending, FacetDeflection):
        return False
    return not (isinstance(bending, CellDeflection) and not bending.powers.any())


def at_vergence(rays: Affine, vergence: float) -> Array:
    """2×2: positions at a plane from positions at the entrance, for light of a point at 1/Z: A + B/Z."""
    return np.asarray(rays.linear[:2, :2] + rays.linear[:2, 2:] * vergence)


def stretch(matrix: Array) -> float:
    """The largest factor by which a 2×2 matrix stretches lengths."""
    return float(np.linalg.norm(matrix, 2))


def widest(steps: Array) -> float:
    """The largest norm of the columns of a matrix."""
    return float(np.linalg.norm(steps, axis=0).max())


def singular(matrix: Array) -> bool:
    """Whether a 2×2 matrix is singular, to rounding."""
    return bool(abs(np.linalg.det(matrix)) <= ROUNDING * np.abs(matrix).max() ** 2)


def enough(count: float) -> int:
    """The next larger integer, with a tolerance for rounding."""
    return math.ceil(count - ROUNDING)
