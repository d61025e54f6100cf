"""A camera seen from a light field as matrices: where rays go, as far as matrices hold."""

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
    """An optical train and a light field before it, as matrices.

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
        """Of the light field."""
        return self.grid.frame

    @property
    def views(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.grid.shape[0], self.grid.shape[1]

    @property
    def pixels(self) -> tuple[int, int]:
        """(rows, columns) of a view."""
        return self.grid.shape[2], self.grid.shape[3]

    @property
    def pixel(self) -> float:
        """The sensor's smaller pitch, metres."""
        return min(self.train.sensor.pitches)

    # -- as far as matrices hold

    @property
    @cached
    def blocking(self) -> Stage | None:
        """The first stage behind which matrices do not hold."""
        return next((stage for stage in self.train.stages if ends_matrices(stage)), None)

    @property
    @cached
    def reached(self) -> tuple[Stage, ...]:
        """The stages whose ``arriving`` is exact: up to the one that blocks."""
        stages = self.train.stages
        return stages if self.blocking is None else stages[: stages.index(self.blocking) + 1]

    @property
    def to_sensor(self) -> Affine:
        """Rays from the entrance plane to the sensor; exact where nothing blocks."""
        return self.train.arriving_at_sensor

    @property
    def sensor_from_slope(self) -> Array:
        """2×2: place on the sensor per slope at the entrance plane, metres."""
        return self.to_sensor.linear[:2, 2:]

    def onwards(self, stage: Stage) -> Affine | None:
        """Rays from just before a stage to the sensor, itself as if at its middle; None where not affine."""
        behind = self.train.stages[self.train.stages.index(stage) + 1 :]
        if stage not in self.reached or any(map(ends_matrices, behind)):
            return None
        return self.to_sensor @ stage.arriving.inverse()

    # -- of what is seen

    @property
    @cached
    def looked_at(self) -> float:
        """1/Z of what is followed from view to view: what is in focus, or as near to that as the scene is."""
        by_place, by_slope = self.to_sensor.linear[:2, :2], self.sensor_from_slope
        square = float((by_slope**2).sum())
        focus = -float((by_place * by_slope).sum()) / square if square > 0 else 0.0
        low, high = (0.0, math.inf) if self.vergences is None else self.vergences
        return min(max(focus, low), high)

    @property
    @cached
    def gaps(self) -> ViewGaps | None:
        """Between neighbouring views' pictures on the sensor; None where something blocks."""
        if self.blocking is not None:
            return None
        vertical, horizontal = self.train.sensor.pitches
        per_pixel = np.diag([1 / horizontal, 1 / vertical])
        return ViewGaps(self.frame, per_pixel @ self.to_sensor.linear[:2], self.views_let_in)

    @property
    @cached
    def free_of_ghosts(self) -> tuple[float, float] | None:
        """(near, far) before the entrance plane between which no gap is seen, metres; None where there is none."""
        free = None if self.gaps is None else self.gaps.free_of_ghosts()
        return None if free is None or free[1] <= 0 else (1 / free[1], distance_of(max(free[0], 0.0)))

    @property
    @cached
    def stop(self) -> float | None:
        """Half the width at the entrance plane of what stops let in of a point in focus, metres; None for all."""
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
        """(rows, columns) of views of which stops let in some light of a point in focus."""
        if self.stop is None:
            return self.views
        across, down = np.linalg.norm(self.frame.linear[:2, :2], axis=0)
        rows, columns = self.views
        # Views that are directions all come in where any does.
        return (
            min(rows, enough(2 * self.stop / down)) if down > 0 else rows,
            min(columns, enough(2 * self.stop / across)) if across > 0 else columns,
        )

    @property
    def half_width(self) -> float | None:
        """Half the width at the entrance plane of the light of a point in focus, metres: of stops or views."""
        widths = [] if self.stop is None else [self.stop]
        if min(self.views) > 1:
            extent = np.abs(self.frame.linear[:2, :2]).sum(axis=0) * self.views[::-1]
            widths.append(float(extent.min()) / 2)
        return min(widths, default=None)


def ends_matrices(stage: Stage) -> bool:
    """Whether a stage's deflection has another derivative than the matrices of rays say."""
    bending = stage.faces.bending
    if bending is None or isinstance(bending, FacetDeflection):
        return False
    return not (isinstance(bending, CellDeflection) and not bending.powers.any())


def at_vergence(rays: Affine, vergence: float) -> Array:
    """2×2: places at a plane from places at the entrance, of the light of a point at 1/Z: A + B/Z."""
    return np.asarray(rays.linear[:2, :2] + rays.linear[:2, 2:] * vergence)


def stretch(matrix: Array) -> float:
    """By how much a 2×2 makes lengths grow at most."""
    return float(np.linalg.norm(matrix, 2))


def widest(steps: Array) -> float:
    """The longest of the columns of a matrix."""
    return float(np.linalg.norm(steps, axis=0).max())


def singular(matrix: Array) -> bool:
    """Whether a 2×2 cannot be undone, but for its rounding."""
    return bool(abs(np.linalg.det(matrix)) <= ROUNDING * np.abs(matrix).max() ** 2)


def enough(count: float) -> int:
    """The whole number that is no less, but for rounding."""
    return math.ceil(count - ROUNDING)
