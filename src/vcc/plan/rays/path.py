"""A camera from the sensor back to the light field: what rays meet on their way, and what of it bounds them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.fields.grid import Grid
from vcc.optics.scatter import Scatter
from vcc.optics.train import Stage, Train
from vcc.plan.decisions import ANEW, Decisions
from vcc.plan.rays.points import FIRST_COLUMNS, columns_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Leg(Brief):
    """A stage, the way from behind it to the sensor undone, and the stop in its plane.

    Args:
        number: 0 for the stage nearest to the sensor.
        stage: what is met.
        undone: rays just behind it from rays just behind what comes after it (or on the sensor), lenses and prisms
            there undone.
        from_sensor: rays just behind it from rays on the sensor, through affine optics alone.
        stop: (low x, low y), (high x, high y) of what passes in this plane, infinite where nothing bounds it.
        column: of the table of points, where the numbers of its diffuser begin.
    """

    number: int
    stage: Stage
    undone: Affine
    from_sensor: Affine
    stop: tuple[Array, Array]
    column: int

    @property
    def bounds_rays(self) -> bool:
        """Whether the stop is finite along both axes."""
        return bool(np.isfinite(self.stop[1] - self.stop[0]).all())


@dataclass(frozen=True, eq=False, repr=False)
class Path(Brief):
    """A camera from the sensor back to the light field, and what bounds its rays.

    Args:
        train: whose elements rays meet.
        grid: that they end in.
        motion: 2×2, along which they are interpolated between views (`Rays.motion`).
        samples: rays a pixel.
        decisions: where these are kept, what bounds the rays is.
    """

    train: Train
    grid: Grid
    motion: Array
    samples: int
    decisions: Decisions = ANEW

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        """The stages as rays meet them, the last one of the train first."""
        stages, stops = self.train.stages, _stops(self.train.stages, self.decisions)
        undone, entrance_from_sensor = self.train.approach_to_sensor.inverse(), self._entrance_from_sensor
        legs: list[Leg] = []
        column = FIRST_COLUMNS
        for number, (stage, stop) in enumerate(zip(reversed(stages), reversed(stops), strict=True)):
            legs.append(Leg(number, stage, undone, stage.leaving @ entrance_from_sensor, stop, column))
            undone = _undone(stage)
            column += 0 if stage.faces.spread is None else columns_of(stage.faces.spread)
        return tuple(legs)

    @cached_property
    def scatters(self) -> tuple[Scatter, ...]:
        """All that scatters rays, in the order in which they meet it."""
        met = (stage.faces.spread for stage in reversed(self.train.stages))
        return tuple(spread for spread in met if spread is not None)

    @cached_property
    def _entrance_from_sensor(self) -> Affine:
        return self.train.arriving_at_sensor.inverse()

    @cached_property
    def entrance_from_last(self) -> Affine:
        """Rays in the entrance plane from rays just behind the stage that is nearest to it."""
        stages = self.train.stages
        return _undone(stages[0]) if stages else self.train.approach_to_sensor.inverse()

    @cached_property
    def index_from_entrance(self) -> Affine:
        """Indices (i, j, k, l) of the light field from rays in the entrance plane."""
        return self.grid.frame.inverse()

    @cached_property
    def index_from_sensor(self) -> Affine:
        """Indices (i, j, k, l) of the light field from rays on the sensor, through affine optics alone."""
        return self.index_from_entrance @ self._entrance_from_sensor

    def index_from_slope(self, leg: Leg) -> Array | None:
        """(4, 2): by how many samples of the light field a ray moves for a slope (s, t) behind a leg.

        None where that is not known: where something beyond it bends otherwise than lenses and prisms do.
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
        """How many samples there are along (i, j, k, l)."""
        nv, nu, nt, ns = self.grid.shape[:4]
        return np.array([nu, nv, ns, nt], dtype=np.float64)

    @property
    def finds(self) -> Array:
        """Half of what finds light along each of (i, j, k, l).

        Half a cell beyond the border of a view linear interpolation has faded to nothing, and the views on both
        sides of a ray are looked at up to one view's motion away.
        """
        faded = np.concatenate([np.zeros(2), 0.5 + np.abs(self.motion).sum(axis=1)])
        return np.asarray(self.size / 2 + faded)

    @cached_property
    def stop_at_views(self) -> bool:
        """Whether a stop stands where each view is a point, so that it says which views are wanted."""
        there = any(leg.bounds_rays and self._tells_views_apart(leg) for leg in self.legs)
        return self.decisions.hold("a stop at the views", there)

    def _tells_views_apart(self, leg: Leg) -> bool:
        """Whether all rays of a view meet a leg in one place, but for rounding."""
        place_from_index = (leg.stage.leaving @ self.grid.frame).linear[:2]
        cell = np.abs(place_from_index[:, :2]).sum(axis=1)
        if not (np.abs(place_from_index[:, 2:]) @ self.size[2:] <= 1e-6 * cell).all():
            return False
        for before in self.legs[leg.number + 1 :]:  # what bends or scatters there moves rays of a view apart
            faces = before.stage.faces
            onward = (leg.from_sensor @ before.from_sensor.inverse()).linear[:2, 2:]
            if (faces.bending is not None or faces.spread is not None) and onward.any():
                return False
        return True


def _undone(stage: Stage) -> Affine:
    """Rays just behind the stage before from rays just behind this one, its lens or prism undone."""
    approach = stage.approach.inverse()
    return approach if stage.centred is None else approach @ stage.centred.inverse()


def _stops(stages: tuple[Stage, ...], decisions: Decisions) -> list[tuple[Array, Array]]:
    """For each stage what passes in its plane: bounded by all that stands in that plane."""
    stops = [_own_stop(stage) for stage in stages]
    same = [n for n, stage in enumerate(stages) if n and np.array_equal(stage.approach.matrix, np.eye(5))]
    if any(faces.pattern is not None for faces in (stages[m].faces for n in same for m in (n - 1, n))):
        decisions.hold("which stops stand in one plane", same)
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
