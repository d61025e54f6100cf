"""Places of the samples of a light field on the sensor: affine in their indices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.fields.grid import Grid
from vcc.optics.train import Train
from vcc.plan.following import check_unchanged, choice, plan_again
from vcc.plan.footprints.mask_textures import ROUNDING
from vcc.plan.footprints.shares import SMALLEST_STEP

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LandingChoices:
    """How samples are brought to the sensor.

    Args:
        swapped: whether the order of the pixel axes is swapped relative to the light field.
        straight: which of the cross steps (x from l, y from k) are rounding.
        points: along (x, y), whether views fall into points.
    """

    swapped: bool = choice("order of the axes of pixels")
    straight: tuple[bool, bool] = choice("steps across the sensor that are rounding")
    points: tuple[bool, bool] = choice("views that fall into points")


def choose_landing(train: Train, grid: Grid) -> LandingChoices:
    """Choose how samples are brought to the sensor."""
    down = (train.arriving_at_sensor @ grid.frame).linear[1]
    swapped = bool(abs(down[3]) < abs(down[2]))
    found = _Places.of(train, grid, swapped)
    crossing, along = found.crossing < ROUNDING, np.abs(np.diag(found.pixels[:, 2:])) < SMALLEST_STEP
    return LandingChoices(swapped, (bool(crossing[0]), bool(crossing[1])), (bool(along[0]), bool(along[1])))


@dataclass(frozen=True, eq=False, repr=False)
class _Places(Brief):
    """Places of samples for one order of the pixel axes; see `Landing`."""

    frame: Affine
    samples: tuple[int, int]
    metres: Array
    pixels: Array
    origin: Array

    @classmethod
    def of(cls, train: Train, grid: Grid, swapped: bool) -> _Places:
        frame, (nt, ns) = grid.frame, grid.shape[2:4]
        if swapped:
            frame, nt, ns = frame @ Affine(np.eye(5)[[0, 1, 3, 2, 4]]), ns, nt
        metres = (train.arriving_at_sensor @ frame).matrix[:2]
        pixels_from_metres = train.sensor.frame.inverse()
        pixels = pixels_from_metres.linear @ metres[:, :4]
        return cls(frame, (nt, ns), metres, pixels, pixels_from_metres(metres[:, 4]))

    @property
    def crossing(self) -> Array:
        """Largest deviation of a view from its row along x, and from its column along y, pixels."""
        return np.asarray(np.abs(self.pixels[[0, 1], [3, 2]]) * max(self.samples))


@dataclass(frozen=True, eq=False, repr=False)
class Landing(Brief):
    """Places of samples on the sensor.

    Args:
        frame: of the light field, its pixel axes in the order in which rows of samples land on rows of the sensor.
        samples: (rows, columns) of a view in that order.
        swapped: whether this order differs from the light field's.
        metres: 2×5, places (x, y) on the sensor's plane from indices (i, j, k, l, 1).
        pixels: 2×4, pixels of the sensor per index step (i, j, k, l).
        origin: where sample (0, 0) of view (0, 0) falls, pixels.
        step: 2×2, pixels per index step (k, l), without rounding errors and zeros.
    """

    frame: Affine
    samples: tuple[int, int]
    swapped: bool
    metres: Array
    pixels: Array
    origin: Array
    step: Array

    @classmethod
    def of(cls, train: Train, grid: Grid, choices: LandingChoices) -> Landing:
        """The places on the sensor to which a train brings the samples of a grid.

        Raises:
            InputError: rows of samples no longer land as chosen.
        """
        found = _Places.of(train, grid, choices.swapped)
        step = _cleaned(found.pixels[:, 2:], found.crossing, choices)
        return cls(found.frame, found.samples, choices.swapped, found.metres, found.pixels, found.origin, step)


def _cleaned(step: Array, crossing: Array, choices: LandingChoices) -> Array:
    """Steps with rounding errors in cross terms set to zero, and zeros along the axes replaced.

    Args:
        step: 2×2, pixels per index step (k, l).
        crossing: see `_Places.crossing`.
        choices: which steps are rounding.
    """
    step, straight = step.copy(), np.array(choices.straight)
    if (straight & (crossing >= ROUNDING)).any():
        raise plan_again("rows of samples that land on rows of pixels")
    step[[0, 1], [1, 0]] = np.where(straight, 0.0, step[[0, 1], [1, 0]])
    for axis, point in enumerate(choices.points):
        now = bool(abs(step[axis, axis]) < SMALLEST_STEP)
        check_unchanged(f"views that fall into points, axis {axis}", point, now)
        if point:
            step[axis, axis] = np.copysign(SMALLEST_STEP, step[axis, axis])
    return step
