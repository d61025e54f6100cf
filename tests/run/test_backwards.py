"""From weights of a picture back to the samples and to the plan's numbers, in memory and block by block."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.fields.grid import Block
from vcc.plan.how import How
from vcc.plan.numbers import numbers, with_numbers
from vcc.run.backwards import Backwards, back
from vcc.run.drive import Drive
from vcc.shapes.patterns import CosineSum

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (4, 5, 14, 16)
FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=7 * mm)
SENSOR = vcc.Sensor(FOCUS, (12, 14), FOCUS * 3e-3)
MASKS = [
    vcc.Mask(pattern=CosineSum((0.5 * mm, 0.6 * mm), 1, 0.3), z=0.96 * FOCUS),
    vcc.Mask(pattern=CosineSum((7 * mm, 5 * mm), 1, 0.3), z=FOCUS / 2),
]
LENSLETS = vcc.LensArray(focal_length=2 * mm, pitch=1 * mm, z=FOCUS - 3 * mm)


def light_field(seed: int = 0, *, frame=None) -> vcc.LightField:
    values = np.random.default_rng(seed).random(SHAPE).astype(np.float32)
    given = vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))
    return given if frame is None else given.transformed(vcc.Affine(frame))


def turned(angle: float) -> np.ndarray:
    """A roll about the axis."""
    c, s = np.cos(angle), np.sin(angle)
    frame = np.eye(5)
    frame[:4, :4] = np.kron(np.eye(2), [[c, -s], [s, c]])
    return frame


# --- the numbers of a part ---


@pytest.mark.parametrize("method", ["footprints", "rays"])
@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_what_parts_say_of_their_numbers_is_brought_back_to_the_whole(method, angle):
    """A part's numbers are linear in the whole's: ⟨c, part(n + d) − part(n)⟩ = ⟨whole_numbers(c), d⟩."""
    rng = np.random.default_rng(1)
    core = vcc.Camera([LENS, *MASKS], SENSOR).compile(light_field(frame=turned(angle)), method=method).core
    rounded = ("texture", "points", "steps", "aim")  # to single precision, or of no part's affair
    own = {name: value for name, value in numbers(core).items() if not any(word in name for word in rounded)}
    steps = {name: rng.standard_normal(value.shape) for name, value in own.items()}
    if method == "rays":
        steps["index_from_ray"][4] = 0  # an affine map stays one
    moved = with_numbers(core, {name: own[name] + step for name, step in steps.items()})
    for block in (Block((1, 3), (2, 5), (0, 14), (0, 16)), Block((3, 4), (0, 1), (5, 9), (2, 16))):
        before, after = numbers(core.part(block)), numbers(moved.part(block))
        assert core.needed(own) == set(own)
        weights = {name: rng.standard_normal(before[name].shape) for name in own}
        brought = core.whole_numbers(block, weights)
        assert {name: value.shape for name, value in brought.items()} == {n: v.shape for n, v in own.items()}
        expected = sum(float((weights[name] * (after[name] - before[name])).sum()) for name in own)
        found = sum(float((brought[name] * step).sum()) for name, step in steps.items())
        size = sum(np.linalg.norm(weights[name]) * np.linalg.norm(after[name]) for name in own)
        assert found == pytest.approx(expected, abs=1e-14 * size)


def test_steps_need_the_places_that_they_move():
    core = vcc.Camera([LENS, *MASKS], SENSOR).compile(light_field()).core
    assert core.needed(["opening"]) == {"opening"}
    assert core.needed(["step"]) == {"step", "x", "y"}
    assert core.needed(["masks[1].step"]) == {"masks[1].step", "masks[1].column", "masks[1].row"}


# --- refusals ---


def test_what_cannot_be_gone_through_backwards_is_refused():
    camera, given = vcc.Camera([LENS], SENSOR), light_field()
    near = vcc.Camera([LENS], replace(SENSOR, z=40 * mm))
    weights = np.ones(SENSOR.shape)
    by_rays = camera.compile(given, method="rays", samples=4)
    with pytest.raises(vcc.InputError, match=r"tolerance takes more rays .* pass samples="):
        back(by_rays, given, weights, How(tolerance=0.1))
    with pytest.raises(vcc.InputError, match=r"between_views='depth' .* pass between_views='auto'"):
        back(near.compile(given, between_views="depth"), given, weights)
    plan = camera.compile(given)
    with pytest.raises(vcc.InputError, match="engine 'array_api' goes backwards by the gradients of"):
        back(plan, given, weights, How(engine="array_api"))
    with pytest.raises(vcc.InputError, match=r"weights of the shape \(12, 15\) are not for .* shape \(12, 14\)"):
        back(plan, given, np.ones((12, 15)))
    weights[3, 5] = np.nan
    with pytest.raises(vcc.InputError, match=r"finite numbers; at \(3, 5\) there is nan"):
        back(plan, given, weights)
    with pytest.raises(vcc.InputError, match=r"the plan has no number 'core\.z': plan\.numbers\(\) names those"):
        Backwards(Drive.of_linear(plan, given, How()), ["core.x", "core.z"])
