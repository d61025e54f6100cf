"""Where the samples of a light field fall on the sensor: affine in their indices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.fields.grid import Grid
from vcc.optics.train import Train
from vcc.plan.decisions import Decisions, plan_again
from vcc.plan.footprints.mask_textures import ROUNDING
from vcc.plan.footprints.shares import SMALLEST_STEP

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Landing(Brief):
    """Where samples fall on the sensor.

    Args:
        frame: of the light field, its pixel axes in the order in which rows of samples land on rows of the sensor.
        samples: (rows, columns) of a view in that order.
        swapped: whether that is the other order than the light field's.
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
    def of(cls, train: Train, grid: Grid, decisions: Decisions) -> Landing:
        """Where a train brings the samples of a grid.

        Raises:
            InputError: rows of samples no longer land where they were decided to.
        """
        frame, samples, swapped = _without_transposition(grid, train.arriving_at_sensor, decisions)
        metres = (train.arriving_at_sensor @ frame).matrix[:2]
        pixels_from_metres = train.sensor.frame.inverse()
        pixels = pixels_from_metres.linear @ metres[:, :4]
        origin = pixels_from_metres(metres[:, 4])
        return cls(frame, samples, swapped, metres, pixels, origin, _cleaned(pixels[:, 2:], samples, decisions))


def _without_transposition(
    grid: Grid, at_sensor: Affine, decisions: Decisions
) -> tuple[Affine, tuple[int, int], bool]:
    """The frame with its pixel axes in the order in which rows of samples land on rows of the sensor."""
    frame, (nt, ns) = grid.frame, grid.shape[2:4]
    down = (at_sensor @ frame).linear[1]
    swapped = decisions.keep("order of the axes of pixels", lambda: bool(abs(down[3]) < abs(down[2])))
    if not swapped:
        return frame, (nt, ns), False
    exchange = Affine(np.eye(5)[[0, 1, 3, 2, 4]])
    return frame @ exchange, (ns, nt), True


def _cleaned(step: Array, samples: tuple[int, int], decisions: Decisions) -> Array:
    """Steps without cross terms that are rounding errors, and without zeros on the way to the pixels."""
    step = step.copy()
    crossing = np.abs(step[[0, 1], [1, 0]]) * max(samples)
    straight = decisions.keep("steps across the sensor that are rounding", lambda: crossing < ROUNDING)
    if (straight & (crossing >= ROUNDING)).any():
        raise plan_again("rows of samples that land on rows of pixels")
    step[[0, 1], [1, 0]] = np.where(straight, 0.0, step[[0, 1], [1, 0]])
    for axis in (0, 1):
        if decisions.hold(
            f"views that fall into points, axis {axis}", bool(abs(step[axis, axis]) < SMALLEST_STEP)
        ):
            step[axis, axis] = np.copysign(SMALLEST_STEP, step[axis, axis])
    return step
