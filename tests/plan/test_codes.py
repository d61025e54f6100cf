"""Plans of cameras that differ in a mask's cells equal each camera's own plan. The oracle is `compile_best`."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.plan import choice
from vcc.plan.choice import compile_best, compiled_each
from vcc.plan.footprints.codes import Codes, exchanged
from vcc.plan.how import How
from vcc.shapes.patterns import Bounded, Cells, Circle
from vcc.shapes.stacked_patterns import Product, Shifted
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


@pytest.mark.parametrize(
    ("case", "refine"), [*((case, "auto") for case in CASES), *((case, 1) for case in sorted(SHARED))]
)
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
        numbers = plan.parameters()
        for name, values in alone.parameters().items():
            np.testing.assert_allclose(numbers[name], values, rtol=1e-9, atol=1e-9, err_msg=name)


def test_cameras_that_differ_in_more_are_planned_alone():
    one, other = cameras([vcc.Lens(50 * mm)])[:2]
    moved = vcc.Camera(other.elements, vcc.Sensor(53 * mm, SENSOR.shape, SENSOR.pitch))
    smaller = vcc.Camera([one.elements[0], vcc.Mask(np.eye(3), 8 * mm, name="code")], SENSOR)
    circle = vcc.Camera([one.elements[0], vcc.Mask(vcc.patterns.Circle(5 * mm), 8 * mm, name="code")], SENSOR)
    for different in (moved, smaller, circle):
        first, second = compiled_each([one, different], FIELD.grid, How())
        assert (first, second) == tuple(compile_best(each, FIELD.grid) for each in (one, different))


def test_cells_are_exchanged_wherever_they_stand_in_a_pattern():
    old, new, other = (Cells(RANDOM.random((2, 2)), 1 * mm) for _ in range(3))
    around = Product((other, Bounded(old, 2 * mm, 3 * mm), Shifted(old, (1 * mm, 0.0)), Circle(4 * mm)))
    first, bounded, shifted, circle = exchanged(around, old, new).patterns
    assert (first, circle) == (other, Circle(4 * mm))
    assert bounded.pattern is shifted.pattern is new
    assert (bounded.width, bounded.height, shifted.middle) == (2 * mm, 3 * mm, (1 * mm, 0.0))
    assert exchanged(old, old, new) is new
    assert exchanged(other, old, new) is other
    assert exchanged(Cells(old.values, 1 * mm), old, new) != new  # equal ones are not the same ones


def test_cameras_differ_in_the_cells_of_one_mask_alone():
    lens, code = vcc.Lens(50 * mm), RANDOM.random((2, 5, 6))

    def cameras_of(*masks, lenses=(lens, lens)):
        return [vcc.Camera([one, mask], SENSOR) for one, mask in zip(lenses, masks, strict=True)]

    def mask(n, **changed):
        return vcc.Mask(code[n], **{"width": 8 * mm, "z": 1 * mm, "name": "code", **changed})

    codes = Codes.of(cameras_of(mask(0, source="a"), mask(1, source="b")))
    assert codes is not None
    assert codes.number == 1
    assert (codes.open.values == 1).all()
    assert [cells.values.tolist() for cells in codes.cells] == code.tolist()
    assert codes.base.elements[1].pattern is codes.open
    assert codes.base.elements[0] is lens
    for other in (
        mask(1, width=9 * mm), mask(1, height=9 * mm), mask(1, z=2 * mm), mask(1, name="other"),
        mask(1, decentre=(1 * mm, 0.0)), vcc.Mask(code[1][1:], 8 * mm, z=1 * mm, name="code"),
        vcc.Mask(Cells(code[1], 8 * mm, middle=(1 * mm, 0.0)), z=1 * mm, name="code"), mask(0),
    ):  # fmt: skip
        assert Codes.of(cameras_of(mask(0), other)) is None
    assert Codes.of(cameras_of(mask(0), mask(1), lenses=(lens, vcc.Lens(51 * mm)))) is None
