"""Plans of cameras that differ in a mask's cells: the same as each camera's own. The oracle is `compile_best`."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.plan import choice
from vcc.plan.choice import compile_best, compiled_each
from vcc.plan.how import How
from vcc.units import mm

RANDOM = np.random.default_rng(3)
FIELD = vcc.LightField.from_views(
    RANDOM.random((6, 7, 10, 12), dtype=np.float32), spacing=(1.3 * mm, 1.1 * mm), slope_per_pixel=0.01
)
SENSOR = vcc.Sensor(52 * mm, (9, 11), 0.5 * mm, decentre=(0.2 * mm, 0.0))


def codes():
    half = RANDOM.random((5, 6))
    half[:, :3] = 0  # columns of views that nothing reaches
    return [RANDOM.random((5, 6)), half, np.eye(5, 6), np.ones((5, 6))]


def cameras(elements, at=0.0, decentre=(0.0, 0.0), cells=None):
    masks = [vcc.Mask(code, 8 * mm, z=at, decentre=decentre, name="code") for code in cells or codes()]
    return [vcc.Camera([*elements, mask], SENSOR) for mask in masks]


CASES = {
    "lens": ([vcc.Lens(50 * mm)], {}),
    "a lens with a rim in the mask's plane": ([vcc.Lens(50 * mm, diameter=6 * mm)], {}),
    "a rim elsewhere": ([vcc.Lens(50 * mm, z=3 * mm, diameter=7 * mm)], {}),
    "off axis": ([vcc.Lens(50 * mm), vcc.Prism((0.001, 0.002))], {"decentre": (0.7 * mm, -0.4 * mm)}),
    "mid-path": ([vcc.Lens(50 * mm)], {"at": 20 * mm}),
    "a mask in mid-path besides": ([vcc.Lens(50 * mm), vcc.Mask(np.eye(3), 9 * mm, z=20 * mm)], {}),
    "a diffuser": ([vcc.Lens(50 * mm), vcc.Diffuser(vcc.kernels.Gaussian(0.002), z=40 * mm)], {}),
    "an array": ([vcc.Lens(50 * mm), vcc.LensArray(1 * mm, 5 * mm, z=45 * mm)], {}),
}
SHARED = {"lens", "a lens with a rim in the mask's plane", "off axis"}


@pytest.mark.parametrize("refine", ["auto", 1])
@pytest.mark.parametrize("case", CASES)
def test_plans_made_together_are_those_made_alone(case, refine, monkeypatch):
    elements, where = CASES[case]
    listed, how, anew = cameras(elements, **where), How(refine=refine if case != "an array" else "auto"), []
    monkeypatch.setattr(choice, "compile_best", lambda *given: anew.append(given) or compile_best(*given))
    together = list(compiled_each(listed, FIELD.grid, how))
    assert (not anew) == (case in SHARED)
    for camera, plan in zip(listed, together, strict=True):
        alone = compile_best(camera, FIELD.grid, how)
        plan.check_fits(camera, FIELD.grid)
        assert (plan.notes, plan.missing_reason, plan.cautions) == (
            alone.notes,
            alone.missing_reason,
            alone.cautions,
        )
        # Masks are looked at in single precision where rays meet them.
        assert plan.missing_rays == pytest.approx(alone.missing_rays, rel=1e-6, abs=1e-9)
        numbers = plan.numbers()
        for name, values in alone.numbers().items():
            np.testing.assert_allclose(numbers[name], values, rtol=1e-9, atol=1e-9, err_msg=name)


def test_cameras_that_differ_in_more_are_planned_alone():
    one, other = cameras([vcc.Lens(50 * mm)])[:2]
    moved = vcc.Camera(other.elements, vcc.Sensor(53 * mm, SENSOR.shape, SENSOR.pitch))
    smaller = vcc.Camera([one.elements[0], vcc.Mask(np.eye(3), 8 * mm, name="code")], SENSOR)
    circle = vcc.Camera([one.elements[0], vcc.Mask(vcc.patterns.Circle(5 * mm), 8 * mm, name="code")], SENSOR)
    for different in (moved, smaller, circle):
        first, second = compiled_each([one, different], FIELD.grid, How())
        assert (first, second) == tuple(compile_best(each, FIELD.grid) for each in (one, different))
