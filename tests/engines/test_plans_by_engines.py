"""Every engine makes the same image for every kind of plan, in one piece and in any number of blocks.

Oracles: ``reference``, whose sums are written out plainly; for blocks the image of the whole light field, which
is linear in the samples and thus the sum of the images of blocks.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
import torch

import vcc
from vcc.base.units import mm
from vcc.fields.grid import Block, Grid
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.operators import Blur, BlurViews, OnSensor, SharpenViews, SwapPixelAxes
from vcc.run.drive import Drive, drive
from vcc.shapes.kernels import Gaussian
from vcc.shapes.patterns import Circle, CosineSum

# Tests may request any camera: there are no warnings about sampling.
pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (5, 4, 9, 11)
D = 1 / (1 / 50e-3 - 1)
"""Image distance of a lens of 50 mm focused at 1 m, metres."""
LENS = vcc.Lens(focal_length=50 * mm, diameter=6 * mm)
# 0.93: no sample lies on a pixel's border, where rounding decides.
SENSOR = vcc.Sensor(D, (11, 13), D * 2e-3 * 0.93)
AGREEMENT = 1e-5
"""Of the brightest pixel: sums of hundreds of products in single precision, each rounded to 6e-8."""
ENGINES = ("reference", "array_api", "numba")


def mask(z: float, period: float = 5 * mm) -> vcc.Mask:
    return vcc.Mask(pattern=CosineSum((period, 1.4 * period), 2, 0.3), z=z)


def operators_of(plan: Plan) -> set[type]:
    return {type(each) for each in (*plan.before, *plan.after)}


def blurs_by_a_diffuser(plan: Plan) -> bool:
    return any(isinstance(each, Blur) and each.scatters for each in plan.after)


def has_detail(plan: Plan) -> bool:
    return any(isinstance(each, OnSensor) and each.detail is not None for each in plan.after)


@dataclass(frozen=True)
class Case:
    """A camera, the settings of its image, and the required contents of the plan."""

    camera: vcc.Camera
    holds: Callable[[Plan], bool]
    how: How = field(default_factory=How)
    rolled: float = 0.0

    def light_field(self, dtype: str = "float32") -> vcc.LightField:
        """Views of noise, three channels, rolled around the axis."""
        values = np.random.default_rng(0).random((*SHAPE, 3))
        if dtype == "uint8":
            values = values * 255
        flat = vcc.LightField.from_views(values.astype(dtype), 2 * mm, 2e-3, 1.0, (-0.2, 0.2), disparity=DISPARITY)
        c, s = np.cos(self.rolled), np.sin(self.rolled)
        roll = vcc.Affine.from_parts(np.kron(np.eye(2), [[c, -s], [s, c]]), np.zeros(4))
        return flat.transformed(roll) if self.rolled else flat


DISPARITY = np.broadcast_to(np.linspace(-1.5, 1.0, SHAPE[2])[:, None], SHAPE[2:])
CASES = {
    "conventional": Case(vcc.Camera([LENS], SENSOR), lambda plan: not plan.before and plan.smear == (0, 0)),
    "strong defocus": Case(
        vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(44 * mm, (14, 15), 44 * mm * 2e-3)),
        lambda plan: min(plan.smear) > 1,
    ),
    "a diffuser at the sensor": Case(
        vcc.Camera([LENS, vcc.Diffuser(kernel=Gaussian(0.05), z=0.97 * D)], SENSOR), blurs_by_a_diffuser
    ),
    "a diffuser at the views": Case(
        vcc.Camera([LENS, vcc.Diffuser(kernel=Gaussian(0.004)), mask(D / 2)], SENSOR),
        lambda plan: BlurViews in operators_of(plan),
        How(method="footprints"),
    ),
    "a diffuser at the views, turned": Case(
        vcc.Camera([LENS, vcc.Diffuser(kernel=Gaussian(0.004)), mask(D / 2)], SENSOR),
        lambda plan: {BlurViews, SwapPixelAxes} <= operators_of(plan),
        How(method="footprints"),
        np.pi / 2,
    ),
    "turned": Case(
        vcc.Camera([LENS, mask(D / 2)], SENSOR), lambda plan: SwapPixelAxes in operators_of(plan), rolled=np.pi / 2
    ),
    "rolled": Case(
        vcc.Camera([LENS, mask(D / 2)], SENSOR),
        lambda plan: not plan.core.separable and Blur in operators_of(plan),
        rolled=0.3,
    ),
    "a mask against the sensor": Case(vcc.Camera([LENS, mask(D, 0.3 * mm)], SENSOR), has_detail),
    "a mask finer than samples": Case(
        vcc.Camera([LENS, mask(0.98 * D, 0.3 * mm)], SENSOR),
        lambda plan: plan.core.refine > 1 and plan.core.sharpen_samples is not None,
    ),
    "rays": Case(
        vcc.Camera([LENS, vcc.LensArray(focal_length=2 * mm, pitch=1 * mm, z=D - 3 * mm)], SENSOR),
        lambda plan: plan.by_rays and SharpenViews in operators_of(plan),
        How(samples=8),
    ),
    "rays, linear": Case(
        vcc.Camera([LENS], SENSOR),
        lambda plan: plan.by_rays and not plan.before,
        How(method="rays", interpolation="linear", samples=8),
    ),
    "rays, each view its cell": Case(
        vcc.Camera([LENS, mask(D / 2)], SENSOR),
        lambda plan: plan.by_rays and not plan.core.between_views,
        How(method="rays", between_views="none", samples=8, seed=3),
    ),
    "views in between by depth": Case(
        vcc.Camera([LENS], vcc.Sensor(48 * mm, (14, 15), 48 * mm * 1e-3)),
        lambda plan: plan.views_between is not None and max(plan.views_between.times) > 1,
        How(between_views="depth"),
    ),
}


class FromAnArray:
    """Samples read block by block, as if from disk."""

    def __init__(self, light_field: vcc.LightField) -> None:
        self._values, self._grid = light_field.values, light_field.grid
        self.blocks_read = 0

    @property
    def grid(self) -> Grid:
        return self._grid

    @property
    def stored_bytes(self) -> int:
        return int(self._values.nbytes)

    def whole(self) -> None:
        return None

    def check_complete(self) -> None:
        pass

    def read(self, block: Block) -> Any:
        self.blocks_read += 1
        return self._values[block.slices]


def run(name: str, engine: str, samples: Any = None, **options: Any) -> np.ndarray:
    case = CASES[name]
    lf = case.light_field() if samples is None else samples
    found = drive(case.camera.compile(lf, case.how), lf, replace(case.how, engine=engine, **options))
    return np.asarray(found.values, dtype=np.float64)


def assert_same(found: np.ndarray, expected: np.ndarray) -> None:
    assert expected.max() > 0
    assert found.shape == expected.shape
    error = np.abs(found - expected).max() / expected.max()
    assert error < AGREEMENT, f"off by {error:.1e}"


@pytest.mark.parametrize("name", list(CASES))
def test_the_cases_here_are_what_their_names_say(name):
    case = CASES[name]
    assert case.holds(case.camera.compile(case.light_field(), case.how))


@pytest.mark.parametrize("dtype", ["float32", "uint8"])
@pytest.mark.parametrize("name", list(CASES))
def test_engines_agree(name, dtype):
    lf = CASES[name].light_field(dtype)
    expected = run(name, "reference", lf)
    for engine in ("array_api", "numba"):
        assert_same(run(name, engine, lf), expected)
    if dtype == "float32" and CASES[name].how.between_views != "depth":
        assert_same(run(name, "array_api", lf.replaced(torch.asarray(lf.values))), expected)


# --- blocks ---


def limits(plan: Plan, samples: FromAnArray, how: How) -> Iterator[int]:
    """Memory limits that give rows of views, some views of a row, or some rows of pixels of one view."""
    way = Drive(plan, samples, how)
    need, (_, wide, rows, _) = way.need, way.samples.grid.shape[:4]
    whole, border = need.view * need.times, 1 + need.border
    kept = 0.0 if plan.views_between is None else 0.25  # memory for views that are read again
    for samples_there in (whole * border * (wide + need.border), whole * border * border):
        beside = need.fixed + samples_there
        # This limit allows one view at a time, or two, which need more.
        reading = need.with_readers(way.threads, beside + 3 * need.view).reading
        yield int((beside + reading) / (1 - kept)) + 8
    yield int((need.fixed + need.view / rows * 4 * (3 + need.times * border * border)) / (1 - kept)) + 8


IN_BLOCKS_BY_ALL = ("a mask finer than samples", "rays, linear", "views in between by depth")
"""Blocks are cut and summed before any engine sees them: all engines have one case of each core."""


@pytest.mark.parametrize(
    ("name", "engine"),
    [(name, engine) for name in CASES for engine in (ENGINES if name in IN_BLOCKS_BY_ALL else ("numba",))],
)
def test_blocks_add_up_to_the_whole(name, engine):
    """The rays, and so the estimated error, do not depend on the memory limit."""
    case = CASES[name]
    lf = case.light_field()
    how = replace(case.how, engine=engine, threads=2)
    plan = case.camera.compile(lf, how)
    whole = drive(plan, lf, how)
    counts = set()
    for limit in limits(plan, FromAnArray(lf), how):
        read = FromAnArray(lf)
        in_blocks = replace(how, memory_limit=limit)
        counts.add(len(list(Drive(plan, read, in_blocks).blocks)))
        found = drive(plan, read, in_blocks)
        assert read.blocks_read > 0
        assert_same(np.asarray(found.values, np.float64), np.asarray(whole.values, np.float64))
        assert found.missing_rays == pytest.approx(whole.missing_rays, abs=1e-9)
        assert found.sampling_error == pytest.approx(whole.sampling_error, rel=1e-4)
        assert (found.rays, found.samples) == (whole.rays, whole.samples)
    assert len(counts) == 3, f"cut into {counts} blocks"
    assert min(counts) > 1


@pytest.mark.parametrize("engine", ENGINES)
def test_columns_of_views_that_a_stop_keeps_out_are_left_out(engine):
    """A lens of 3 mm before columns of views at ±1 and ±3 mm: the first and last columns contribute nothing."""
    case = CASES["a diffuser at the views"]
    narrow = vcc.Camera([replace(LENS, diameter=3 * mm), *case.camera.elements[1:]], SENSOR)
    lf = case.light_field()
    plan = narrow.compile(lf, case.how)
    np.testing.assert_array_equal(plan.core.used_views(SHAPE).any(axis=0), [False, True, True, False])
    inner = lf.values.copy()
    inner[:, [0, 3]] = 0
    expected = drive(plan, lf.replaced(inner), How(engine="reference")).values.astype(np.float64)
    assert_same(drive(plan, lf, How(engine=engine)).values.astype(np.float64), expected)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_closed_stop_gives_a_dark_picture(engine):
    case = CASES["a diffuser at the views"]
    closed = vcc.Camera([*case.camera.elements, vcc.Mask(Circle(1 * mm), decentre=(40 * mm, 0))], SENSOR)
    lf = case.light_field()
    found = drive(closed.compile(lf, case.how), lf, How(engine=engine)).values
    assert found.shape == (*SENSOR.shape, 3)
    assert not found.any()


@pytest.mark.parametrize("engine", ENGINES)
def test_rounds_of_rays_are_the_same_in_blocks(engine):
    case = CASES["rays"]
    lf = case.light_field()
    how = replace(case.how, engine=engine, tolerance=0.05)
    plan = case.camera.compile(lf, how)
    whole = drive(plan, lf, how)
    limit = next(limits(plan, FromAnArray(lf), how))
    found = drive(plan, FromAnArray(lf), replace(how, memory_limit=limit))
    assert whole.samples > 8
    assert found.samples == whole.samples
    assert_same(np.asarray(found.values, np.float64), np.asarray(whole.values, np.float64))
    assert found.sampling_error <= 0.05 * found.values.mean()


@pytest.mark.parametrize("name", list(CASES))
def test_threads_change_no_bit(name):
    one, three = (run(name, "numba", threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(three, one)


# --- plans as values ---


@pytest.mark.parametrize("name", list(CASES))
def test_compiled_twice_plans_are_equal(name):
    case = CASES[name]
    lf = case.light_field()
    one, two = (case.camera.compile(lf, case.how) for _ in range(2))
    assert one is not two
    assert one == two
    assert hash(one) == hash(two)
    assert {one: "cached"}[two] == "cached"


def with_another_lens(camera: vcc.Camera) -> vcc.Camera:
    lens, *others = camera.elements
    return vcc.Camera([replace(lens, focal_length=50.001 * mm), *others], camera.sensor)


def with_the_sensor_moved(camera: vcc.Camera) -> vcc.Camera:
    return vcc.Camera(camera.elements, replace(camera.sensor, z=camera.sensor.z * (1 + 1e-9)))


CHANGED = {
    "the lens": (with_another_lens, lambda lf: lf),
    "the sensor": (with_the_sensor_moved, lambda lf: lf),
    "the frame": (lambda camera: camera, lambda lf: lf.transformed(vcc.Affine.propagation(1e-9))),
}


@pytest.mark.parametrize("what", list(CHANGED))
@pytest.mark.parametrize(
    "name", ["conventional", "a mask finer than samples", "rays", "views in between by depth"]
)
def test_one_number_changed_makes_another_plan(name, what):
    case = CASES[name]
    lf = case.light_field()
    camera_changed, frame_changed = CHANGED[what]
    changed = camera_changed(case.camera).compile(frame_changed(lf), case.how)
    assert changed != case.camera.compile(lf, case.how)


def test_cameras_are_equal_by_what_they_are_made_of():
    camera = CASES["a mask against the sensor"].camera
    again = vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=6 * mm), mask(D, 0.3 * mm)], SENSOR)
    assert again == camera
    assert hash(again) == hash(camera)
    assert vcc.Camera(camera.elements, replace(SENSOR, shape=(11, 12))) != camera
    assert vcc.Camera([LENS, mask(D, 0.3001 * mm)], SENSOR) != camera
    assert vcc.Camera([LENS], SENSOR) != camera
    coded = [vcc.Camera([vcc.Mask(np.eye(4) * share, width=8 * mm), LENS], SENSOR) for share in (1.0, 1.0, 0.999)]
    assert coded[0] == coded[1]
    assert coded[0] != coded[2]


# --- a plan made before ---


@pytest.mark.parametrize("name", list(CASES))
def test_capture_by_a_plan_made_before_gives_the_same_bits(name):
    case = CASES[name]
    lf = case.light_field()
    plan = case.camera.compile(lf, case.how)
    fresh = case.camera.capture(lf, case.how)
    planned = case.camera.capture(lf, case.how, plan=plan)
    np.testing.assert_array_equal(planned.values, fresh.values)
    assert planned.missing_rays == fresh.missing_rays
    assert planned.sampling_error == fresh.sampling_error


@pytest.mark.parametrize(
    ("name", "dtype"),
    [
        *itertools.product(("conventional", "a diffuser at the views"), ("uint8", "uint16", "float64")),
        (
            "rays",
            "uint8",
        ),  # tests/engines/test_ray_agreement compiles the loops of rays for double precision
        ("rays", "uint16"),
        ("views in between by depth", "uint8"),
    ],
)
def test_a_plan_serves_other_samples_of_the_grid_of_any_type(name, dtype):
    """255 of 8 bits and 65535 of 16 bits both mean radiance 1: the scale is part of the samples."""
    case = CASES[name]
    lf = case.light_field()
    values = lf.values[::-1] * (np.iinfo(dtype).max if dtype != "float64" else 1)
    other = lf.replaced(values.astype(dtype))
    plan = case.camera.compile(lf, case.how)
    assert case.camera.compile(other, case.how) == plan
    by_plan = case.camera.capture(other, case.how, plan=plan).values
    np.testing.assert_array_equal(by_plan, case.camera.capture(other, case.how).values)
    as_floats = case.camera.capture(lf.replaced(lf.values[::-1].copy()), case.how).values
    # Truncation makes each sample up to 1/255 smaller, and filters amplify that by at most 3.4. The brightest
    # pixel of an image of noise is more than half as bright as for radiance 1.
    whole = 8 / np.iinfo(dtype).max if dtype != "float64" else 1e-6
    np.testing.assert_allclose(by_plan, as_floats, rtol=0, atol=whole * as_floats.max())


def test_a_plan_for_something_else_is_refused():
    case = CASES["conventional"]
    lf = case.light_field()
    plan = case.camera.compile(lf)
    larger = vcc.Camera(case.camera.elements, replace(SENSOR, shape=(12, 13)))
    with pytest.raises(vcc.InputError, match=r"sensor of 11×13 pixels .* not 12×13"):
        larger.capture(lf, plan=plan)
    with pytest.raises(vcc.InputError, match=r"5×4×9×11 samples, not .*4×4×9×11: make it anew"):
        case.camera.capture(lf[1:], plan=plan)
    further = vcc.Camera(case.camera.elements, replace(SENSOR, z=SENSOR.z * 1.01))
    with pytest.raises(vcc.InputError, match=r"for another camera: make it anew"):
        further.capture(lf, plan=plan)
    with pytest.raises(vcc.InputError, match=r"for another frame of light field: make it anew"):
        case.camera.capture(lf.scaled(1.01), plan=plan)
    with pytest.raises(vcc.InputError, match="method is fixed when a plan is made: leave it out"):
        case.camera.capture(lf, plan=plan, method="rays")
    with pytest.raises(vcc.InputError, match="tolerance is for pictures made by rays"):
        case.camera.capture(lf, plan=plan, tolerance=0.01)
    equal = vcc.Camera(list(case.camera.elements), replace(case.camera.sensor))
    np.testing.assert_array_equal(equal.capture(lf, plan=plan).values, case.camera.capture(lf).values)
