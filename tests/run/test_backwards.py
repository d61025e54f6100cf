"""From weights of a picture back to the samples and to the plan's numbers, in memory and block by block."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.fields.grid import Block
from vcc.plan.how import How
from vcc.plan.parameters import parameters, with_parameters
from vcc.run import backwards
from vcc.run.backwards import Backwards, back
from vcc.run.blocks import Blocks
from vcc.run.drive import Drive
from vcc.shapes.patterns import CosineSum
from vcc.store import save_store

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (3, 3, 8, 10)
FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=7 * mm)
SENSOR = vcc.Sensor(FOCUS, (12, 14), FOCUS * 3e-3)
MASKS = [
    vcc.Mask(pattern=CosineSum((0.5 * mm, 0.6 * mm), 1, 0.3), z=0.96 * FOCUS),
    vcc.Mask(pattern=CosineSum((7 * mm, 5 * mm), 1, 0.3), z=FOCUS / 2),
]
LENSLETS = vcc.LensArray(focal_length=2 * mm, pitch=1 * mm, z=FOCUS - 3 * mm)


def light_field(seed: int = 0, *, frame=None, kind: str = "float32") -> vcc.LightField:
    values = (np.random.default_rng(seed).random(SHAPE) * (255 if kind == "uint8" else 1)).astype(kind)
    given = vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))
    return given if frame is None else given.transformed(vcc.Affine(frame))


def turned(angle: float) -> np.ndarray:
    """A roll about the axis."""
    c, s = np.cos(angle), np.sin(angle)
    frame = np.eye(5)
    frame[:4, :4] = np.kron(np.eye(2), [[c, -s], [s, c]])
    return frame


# --- the whole plan ---

BLURRED = vcc.Diffuser(kernel=vcc.kernels.Gaussian(0.004))
BEFORE_SENSOR = vcc.Mask(pattern=CosineSum((1 * mm, 2 * mm), 1, 0.3), z=FOCUS)
PLANS = {
    "filters on both sides": ([LENS, BLURRED, MASKS[1], BEFORE_SENSOR], {"method": "footprints"}),
    "refined": ([LENS, MASKS[0]], {"refine": 2}),
    "rays": ([LENS, LENSLETS], {"samples": 4}),
}


def weights_of(shape: tuple[int, ...], seed: int = 5) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(shape)


@pytest.mark.parametrize("kind", ["float32", "uint8"])
@pytest.mark.parametrize("name", list(PLANS))
def test_derivatives_through_the_whole_plan(name, kind):
    """Against what a change does to the picture, in double precision.

    A picture is linear in samples, in filters, in the transmission before the sensor and in the scale: there any
    change is as good as a small one. In places it is not: central differences, whose error is of second order.
    """
    elements, options = PLANS[name]
    given, rng = light_field(kind=kind), np.random.default_rng(6)
    # Parts of samples end nowhere at the borders of pixels: what they share out has bends there.
    sensor = replace(SENSOR, pitch=FOCUS * 3.07e-3, decentre=(0.013 * mm, 0.029 * mm))
    plan = vcc.Camera(elements, sensor).compile(given, **options)
    how, weights = How(engine="reference"), weights_of(SENSOR.shape)
    own = plan.parameters()
    linear = [each for each in own if each.startswith(("before", "after")) or each == "core.scale"]
    small = {"core.x": 1e-5, "core.step": 1e-6} if not plan.by_rays else {}
    found = back(plan, given, weights, how, wanted=[*linear, *small])
    assert set(found.gradients) == {*linear, *small}

    def seen(changed, samples=given) -> float:
        drive = Drive(changed, samples, how)
        return float((drive.picture(drive.rounds()) * weights).sum())

    for number in [*linear, *small]:
        step = rng.standard_normal(own[number].shape) * small.get(number, 1.0)
        ahead, behind = (plan.with_parameters({number: own[number] + sign * step}) for sign in (1, -1))
        expected = (seen(ahead) - seen(behind)) / 2
        rounding = 1e-12 * np.abs(weights).sum() * np.abs(own[number]).max() * 10
        assert float((found.gradients[number] * step).sum()) == pytest.approx(expected, rel=1e-5, abs=rounding), (
            number
        )
    # A step of one in each number as it is given: what 8 bits are rounded to on their way is left out.
    if kind == "float32" or not plan.by_rays:
        assert float((found.samples * given.values).sum()) == pytest.approx(seen(plan), rel=1e-12)
    else:
        radiance = light_field().replaced(given.values / 255.0)
        assert float((found.samples * given.values).sum()) == pytest.approx(seen(plan, radiance), rel=1e-12)


CUTS = {"rows of views": (2, 3, 8), "blocks of views": (1, 2, 8), "rows of pixels": (1, 1, 3)}


@pytest.mark.parametrize("engine", ["numba", "reference"])
@pytest.mark.parametrize("name", list(PLANS))
def test_blocks_add_up_to_the_whole(tmp_path, monkeypatch, name, engine):
    elements, options = PLANS[name]
    given = light_field(kind="uint8")
    stored = save_store(given, tmp_path / "a.zarr", chunks=4)
    plan = vcc.Camera(elements, SENSOR).compile(stored, **options)
    how, weights = How(engine=engine), weights_of(SENSOR.shape)
    wanted = [each for each in plan.parameters() if each.startswith(("before", "after"))]
    if engine == "reference":
        wanted += ["core.scale"]
    if engine == "reference" and not plan.by_rays:
        wanted += ["core.x", "core.step", "core.weights", "core.masks[0].step", "core.masks[0].texture"]
    whole = back(plan, given, weights, how, wanted=wanted)
    # Samples of a block are kept in single precision; what 8 bits are blurred to is rounded to it, 6e-8.
    largest = 1e-6 if engine == "reference" else 2e-5
    # Blocks are cut before any engine sees them: the reference, which is slow, has one cut of each plan.
    some = list(CUTS.values())
    for sizes in some if engine == "numba" else [some[list(PLANS).index(name)]]:
        monkeypatch.setattr(
            backwards, "cut_evenly", lambda *_, sizes=sizes: Blocks((0, 3), (0, 3), *SHAPE[2:], *sizes)
        )
        found = back(plan, stored, weights, how, wanted=wanted)
        assert found.samples.dtype == whole.samples.dtype
        np.testing.assert_allclose(
            found.samples, whole.samples, rtol=0, atol=largest * np.abs(whole.samples).max(), err_msg=f"{sizes}"
        )
        for number in wanted:
            expected = whole.gradients[number]
            atol = largest * max(np.abs(expected).max(), 1e-300)
            np.testing.assert_allclose(
                found.gradients[number], expected, rtol=0, atol=atol, err_msg=f"{sizes} {number}"
            )


def test_a_raster_at_hand_is_not_made_again(monkeypatch):
    given = light_field()
    plan = vcc.Camera(PLANS["filters on both sides"][0], SENSOR).compile(given, method="footprints")
    drive, weights = Drive.of_linear(plan, given, How(engine="reference")), weights_of(SENSOR.shape)
    wanted = [each for each in plan.parameters() if each.startswith("after")]
    assert "after[1].transmission" in wanted
    found = drive.rounds()
    expected = Backwards(drive, wanted).gradient(weights, samples_wanted=False)
    assert expected.samples is None
    monkeypatch.setattr(Drive, "rounds", None)
    again = Backwards(drive, wanted).gradient(weights, samples_wanted=False, found=found)
    for name in wanted:
        np.testing.assert_array_equal(again.gradients[name], expected.gradients[name])


def test_samples_are_looked_at_only_where_numbers_follow_from_them(monkeypatch, tmp_path):
    stored = save_store(light_field(), tmp_path / "a.zarr")
    plan = vcc.Camera([LENS, MASKS[1]], SENSOR).compile(stored)
    monkeypatch.setattr(type(stored), "read", None)
    weights = weights_of(SENSOR.shape)
    calls = []
    found = back(plan, stored, weights, How(engine="reference"), progress=lambda *call: calls.append(call))
    assert found.samples.any()
    assert calls[-1][0] == calls[-1][1] > 0
    with pytest.raises(TypeError):
        back(plan, stored, weights, How(engine="reference"), wanted=["core.scale"])


# --- the numbers of a part ---


@pytest.mark.parametrize("method", ["footprints", "rays"])
@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_what_parts_say_of_their_numbers_is_brought_back_to_the_whole(method, angle):
    """A part's numbers are linear in the whole's: ⟨c, part(n + d) − part(n)⟩ = ⟨full_gradients(c), d⟩."""
    rng = np.random.default_rng(1)
    core = vcc.Camera([LENS, *MASKS], SENSOR).compile(light_field(frame=turned(angle)), method=method).core
    rounded = ("texture", "points", "steps", "aim")  # to single precision, or of no part's affair
    own = {name: value for name, value in parameters(core).items() if not any(word in name for word in rounded)}
    steps = {name: rng.standard_normal(value.shape) for name, value in own.items()}
    if method == "rays":
        steps["index_from_ray"][4] = 0  # an affine map stays one
    moved = with_parameters(core, {name: own[name] + step for name, step in steps.items()})
    for block in (Block((0, 2), (1, 3), (0, 8), (0, 10)), Block((2, 3), (0, 1), (3, 6), (2, 10))):
        before, after = parameters(core.part(block)), parameters(moved.part(block))
        assert core.required(own) == set(own)
        weights = {name: rng.standard_normal(before[name].shape) for name in own}
        brought = core.full_gradients(block, weights)
        assert {name: value.shape for name, value in brought.items()} == {n: v.shape for n, v in own.items()}
        expected = sum(float((weights[name] * (after[name] - before[name])).sum()) for name in own)
        found = sum(float((brought[name] * step).sum()) for name, step in steps.items())
        size = sum(np.linalg.norm(weights[name]) * np.linalg.norm(after[name]) for name in own)
        assert found == pytest.approx(expected, abs=1e-14 * size)


def test_steps_need_the_places_that_they_move():
    core = vcc.Camera([LENS, *MASKS], SENSOR).compile(light_field()).core
    assert core.required(["opening"]) == {"opening"}
    assert core.required(["step"]) == {"step", "x", "y"}
    assert core.required(["masks[1].step"]) == {"masks[1].step", "masks[1].column", "masks[1].row"}


# --- refusals ---


def test_what_cannot_be_gone_through_backwards_is_refused():
    camera, given = vcc.Camera([LENS], SENSOR), light_field()
    near = vcc.Camera([LENS], replace(SENSOR, z=40 * mm))
    weights = np.ones(SENSOR.shape)
    by_rays = camera.compile(given, method="rays", samples=4)
    with pytest.raises(vcc.InputError, match=r"tolerance adds rays .* pass samples="):
        back(by_rays, given, weights, How(tolerance=0.1))
    with pytest.raises(vcc.InputError, match=r"between_views='depth' .* pass between_views='auto'"):
        back(near.compile(given, between_views="depth"), given, weights)
    plan = camera.compile(given)
    with pytest.raises(vcc.InputError, match="engine 'array_api' goes backwards by the gradients of"):
        back(plan, given, weights, How(engine="array_api"))
    with pytest.raises(
        vcc.InputError, match=r"weights have the shape \(12, 15\), but the image has the shape \(12, 14\)"
    ):
        back(plan, given, np.ones((12, 15)))
    weights[3, 5] = np.nan
    with pytest.raises(vcc.InputError, match=r"must be finite; at \(3, 5\) there is nan"):
        back(plan, given, weights)
    with pytest.raises(
        vcc.InputError, match=r"the plan has no parameter 'core\.z'; plan\.parameters\(\) lists all"
    ):
        Backwards(Drive.of_linear(plan, given, How()), ["core.x", "core.z"])
