"""An image follows the position of a mask, and of a lens in front of it, smoothly, whatever the step."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.engines import reference
from vcc.plan.parameters import with_parameters

MASK = 1
SENSOR = vcc.Sensor(52 * mm, (14, 13), 90 * um)
FIELD = vcc.LightField.from_views(
    np.random.default_rng(2).random((5, 5, 12, 12)), 2 * mm, 2e-3, 1.0, disparity_range=(-0.2, 0.2)
)
CELLS = np.random.default_rng(3).random((9, 9)).round()
START = {"z": 33 * mm, "focal_length": 50 * mm}


def camera(changed: dict[str, float]) -> vcc.Camera:
    values = START | changed
    mask = vcc.Mask(CELLS, width=9 * mm, z=values["z"])
    return vcc.Camera([vcc.Lens(values["focal_length"]), mask], SENSOR)


def met(one: vcc.Camera) -> np.ndarray:
    """Where samples (i, j, k, l, 1) meet the mask, metres, (2, 5)."""
    return (one.stages[MASK].arriving @ FIELD.frame).matrix[:2]


PLAN = camera({}).compile(FIELD, method="footprints", between_views="none", refine=1)
SPACING = np.diag(met(camera({}))[:, 2:4]) / np.diag(PLAN.core.masks[0].step)


def places(changed: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Position of sample (0, 0) of each view on the first camera's texture, (column, row) in points, and steps."""
    lookup, moved = PLAN.core.masks[0], met(camera(changed)) - met(camera({}))
    views = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0)), axis=-1)
    start = np.stack([lookup.column, lookup.row], axis=-1) + (views @ moved[:, :2].T + moved[:, 4]) / SPACING
    return start, met(camera(changed))[:, 2:4] / SPACING[:, None]


def picture(changed: dict[str, float], shift: np.ndarray) -> np.ndarray:
    """The image of a changed camera with the texture of the first, shifted by a number of points."""
    start, step = places(changed)
    own = camera(changed).compile(FIELD, method="footprints", between_views="none", refine=1).core
    numbers = {"x": own.x, "y": own.y, "step": own.step, "masks[0].step": step}
    numbers |= {"masks[0].column": start[..., 0] + shift[0], "masks[0].row": start[..., 1] + shift[1]}
    return reference.run(with_parameters(PLAN.core, numbers), FIELD.values, threads=1).values


@pytest.mark.parametrize("border", [0.0, 0.5])
@pytest.mark.parametrize("parameter", list(START))
def test_derivatives_are_the_same_for_steps_of_a_tenth_of_a_micron_to_ten(parameter, border):
    """Sample (6, 4) of view (1, 3) comes over a point of the texture, or the middle between two, 3 µm on: a step
    of 10 µm goes over it, a step of 1 µm does not. Linear look-ups have a kink at points."""
    start, step = places({parameter: START[parameter] + 3 * um})
    shift = border - (start[1, 3] + step @ (6, 4)) % 1

    def slope(by: float) -> np.ndarray:
        over, under = (picture({parameter: START[parameter] + one}, shift) for one in (by, -by))
        return (over - under) / (2 * by)

    coarse, middle, fine = (slope(step) for step in (10 * um, 1 * um, 0.1 * um))
    assert np.abs(fine).max() > 0
    for other in (coarse, middle):
        assert np.abs(other - fine).max() < 1e-3 * np.abs(fine).max()
