"""A camera from the sensor back to the light field: the elements that rays meet, and their bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.fields.grid import Grid
from vcc.optics.aberrations import Aberrations
from vcc.optics.scatter import Scatter
from vcc.optics.train import Stage, Train
from vcc.plan.rays.points import FIRST_COLUMNS, columns_of

Array = NDArray[np.float64]

STEEPEST = 1.0
"""Slope of 45°: a stop that transmits steeper light does not bound the light of a camera."""


@dataclass(frozen=True, eq=False, repr=False)
class Leg(Brief):
    """A stage, the inverse map from the sensor to just behind it, and the stop in its plane.

    Args:
        number: 0 for the stage nearest to the sensor.
        stage: that rays meet.
        undone: rays just behind it from rays just behind the following stage (or on the sensor), with the lens or
            prism there undone.
        from_sensor: rays just behind it from rays on the sensor, through affine optics only.
        stop: (low x, low y), (high x, high y) of the opening in this plane, infinite if nothing bounds it.
        column: of the table of points, where the numbers of its diffuser begin.
    """

    number: int
    stage: Stage
    undone: Affine
    from_sensor: Affine
    stop: tuple[Array, Array]
    column: int


@dataclass(frozen=True, eq=False, repr=False)
class Path(Brief):
    """A camera from the sensor back to the light field, and the bounds of its rays.

    Args:
        train: whose elements rays meet.
        grid: in which rays end.
        motion: 2×2, along which views are interpolated (`Rays.motion`).
        samples: rays a pixel.
        rounds: for each leg, whether its stop stays round when it is widened by the deviation of rays; None: if
            the round one is smaller.
    """

    train: Train
    grid: Grid
    motion: Array
    samples: int
    rounds: tuple[bool, ...] | None = None

    @property
    @cached
    def legs(self) -> tuple[Leg, ...]:
        """The stages as rays meet them, the last one of the train first."""
        stages, stops = self.train.stages, _stops(self.train.stages)
        undone, entrance_from_sensor = self.train.approach_to_sensor.inverse(), self._entrance_from_sensor
        legs: list[Leg] = []
        column = FIRST_COLUMNS
        for number, (stage, stop) in enumerate(zip(reversed(stages), reversed(stops), strict=True)):
            legs.append(Leg(number, stage, undone, stage.leaving @ entrance_from_sensor, stop, column))
            undone = _undone(stage)
            column += 0 if stage.faces.spread is None else columns_of(stage.faces.spread)
        return tuple(legs)

    @property
    @cached
    def scatters(self) -> tuple[Scatter, ...]:
        """All scatterers, in the order in which rays meet them."""
        met = (stage.faces.spread for stage in reversed(self.train.stages))
        return tuple(spread for spread in met if spread is not None)

    @property
    @cached
    def _entrance_from_sensor(self) -> Affine:
        return self.train.arriving_at_sensor.inverse()

    @property
    @cached
    def entrance_from_last(self) -> Affine:
        """Rays in the entrance plane from rays just behind the stage that is nearest to it."""
        stages = self.train.stages
        return _undone(stages[0]) if stages else self.train.approach_to_sensor.inverse()

    @property
    @cached
    def index_from_entrance(self) -> Affine:
        """Indices (i, j, k, l) of the light field from rays in the entrance plane."""
        return self.grid.frame.inverse()

    @property
    @cached
    def index_from_sensor(self) -> Affine:
        """Indices (i, j, k, l) of the light field from rays on the sensor, through affine optics only."""
        return self.index_from_entrance @ self._entrance_from_sensor

    def index_from_slope(self, leg: Leg) -> Array | None:
        """(4, 2): samples of the light field by which a ray moves for a slope (s, t) behind a leg.

        None if unknown: if an element beyond it, other than lenses and prisms, bends rays.
        """
        if any(beyond.stage.faces.bending is not None for beyond in self.legs[leg.number + 1 :]):
            return None
        return (self.index_from_entrance @ leg.stage.leaving.inverse()).linear[:, 2:]

    @property
    def pixel(self) -> Array:
        """Size (x, y) of a pixel's sensitive area, metres."""
        return np.array(self.train.sensor.sensitive_pitches[::-1])

    @property
    def size(self) -> Array:
        """Number of samples along (i, j, k, l)."""
        nv, nu, nt, ns = self.grid.shape[:4]
        return np.array([nu, nv, ns, nt], dtype=np.float64)

    @property
    def finds(self) -> Array:
        """Half the range in which rays find light along each of (i, j, k, l).

        Linear interpolation fades to zero half a cell beyond the border of a view, and the views on both sides
        of a ray are read up to one view's motion away.
        """
        faded = np.concatenate([np.zeros(2), 0.5 + np.abs(self.motion).sum(axis=1)])
        return np.asarray(self.size / 2 + faded)

    @property
    @cached
    def stops_bound(self) -> bool:
        """Whether stops bound the slopes of rays, so that they rather than the grid of views define the aperture.

        A stop so near the sensor that slopes of more than `STEEPEST` pass it is not a bound within paraxial
        optics.
        """
        return any(map(_bounds_slopes, self.legs))


def _bounds_slopes(leg: Leg) -> bool:
    """Whether a stop bounds the slopes of rays from a place on the sensor."""
    by_slope = leg.from_sensor.linear[:2, 2:]
    half = (leg.stop[1] - leg.stop[0]) / 2
    if not np.isfinite(half).all() or abs(np.linalg.det(by_slope)) <= 1e-12 * np.abs(by_slope).max() ** 2:
        return False
    return bool((np.abs(np.linalg.inv(by_slope)) @ half <= STEEPEST).all())


def mixes_axes(ray_map: Affine) -> bool:
    """Whether x and y mix."""
    return bool(ray_map.matrix[[0, 0, 1, 1, 2, 2, 3, 3], [1, 3, 0, 2, 1, 3, 0, 2]].any())


def _undone(stage: Stage) -> Affine:
    """Rays just behind the previous stage from rays just behind this one, with its lens or prism undone."""
    approach = stage.approach.inverse()
    return approach if stage.centred is None else approach @ stage.centred.inverse()


def in_one_plane(stages: tuple[Stage, ...]) -> list[int]:
    """The numbers of stages in the same plane as the stage before."""
    return [
        n
        for n, stage in enumerate(stages)
        if n
        and np.array_equal(stage.approach.matrix, np.eye(5))
        # Surfaces of a lens move rays within the plane: behind them the stop before them has another shape.
        and not isinstance(stage.faces.bending, Aberrations)
    ]


def stops_in_one_plane(stages: tuple[Stage, ...]) -> tuple[int, ...]:
    """The same if any of them stops light, else none."""
    same = in_one_plane(stages)
    stops = any(stages[m].faces.pattern is not None for n in same for m in (n - 1, n))
    return tuple(same) if stops else ()


def _stops(stages: tuple[Stage, ...]) -> list[tuple[Array, Array]]:
    """For each stage the opening in its plane: bounded by all stages in that plane."""
    stops, same = [_own_stop(stage) for stage in stages], in_one_plane(stages)
    for n in [*same, *reversed(same)]:  # forwards, then backwards
        low = np.maximum(stops[n][0], stops[n - 1][0])
        high = np.minimum(stops[n][1], stops[n - 1][1])
        stops[n] = stops[n - 1] = (low, high)
    return stops


def _own_stop(stage: Stage) -> tuple[Array, Array]:
    """The rectangle around a stage's own mask; infinite without one."""
    if stage.faces.pattern is None:
        return np.full(2, -np.inf), np.full(2, np.inf)
    half = np.array(stage.faces.pattern.size) / 2
    return stage.element.decentre - half, stage.element.decentre + half
