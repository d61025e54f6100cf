"""Gradients of a weighted raster to the samples: the transpose of an engine's `run`.

Oracles: the dot test ⟨A x, y⟩ = ⟨x, Aᵀ y⟩ for random x and y, with the raster by the fast engine and by the
plain one; and the matrix A itself, which the plain engine gives if each sample is a separate channel.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.physics.random_cameras import AFFINE, drawn
from vcc.base.units import mm
from vcc.engines import engine
from vcc.plan.choice import compile_best
from vcc.plan.footprints.model import Footprints
from vcc.plan.how import How
from vcc.plan.operators import BlurViews, SharpenViews, SwapPixelAxes
from vcc.shapes.patterns import CosineSum

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

NUMBA, REFERENCE = engine("numba"), engine("reference")
ROUNDING = 1e-6
"""Fraction of ‖A x‖·‖y‖: single precision rounds each product to 6e-8, and errors of long sums mostly cancel."""

FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=6 * mm)
SENSOR = vcc.Sensor(FOCUS, (11, 13), FOCUS * 2e-3 * 0.93)
MASKS = (
    vcc.Mask(pattern=CosineSum((5 * mm, 7 * mm), 2, 0.3), z=20 * mm, decentre=(0.5 * mm, -0.3 * mm)),
    vcc.Mask(pattern=np.random.default_rng(1).random((5, 4)), width=6 * mm, z=40 * mm),  # dark beyond its border
)
BOARD = vcc.Mask(pattern=np.indices((7, 7)).sum(axis=0) % 2, width=9 * mm)  # finer than a view's cell
FAR = vcc.Sensor(44 * mm, (14, 15), 90e-6)
CAMERAS = {
    "plain": vcc.Camera([LENS], SENSOR),
    "masks": vcc.Camera([LENS, *MASKS], SENSOR),
    "large samples": vcc.Camera([LENS], vcc.Sensor(FOCUS, (14, 15), FOCUS * 2e-3 / 3.1)),
    "small samples": vcc.Camera([LENS, *MASKS], vcc.Sensor(FOCUS, (4, 3), FOCUS * 2e-3 * 2.9)),
    "divided views": vcc.Camera([vcc.Lens(focal_length=50 * mm), BOARD], FAR),
}


def random(*shape: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(shape).astype(np.float32)


def field(shape: tuple[int, ...], roll: float = 0.0) -> vcc.LightField:
    lf = vcc.LightField.from_views(np.zeros(shape, np.float32), 2 * mm, 2e-3, 1.0, disparity_range=(-0.2, 0.2))
    return rolled(lf, roll)


def rolled(lf: vcc.LightField, angle: float) -> vcc.LightField:
    c, s = np.cos(angle), np.sin(angle)
    return lf.transformed(vcc.Affine.from_parts(np.kron(np.eye(2), [[c, -s], [s, c]]), np.zeros(4)))


def core_of(camera: vcc.Camera, lf: vcc.LightField, **options) -> Footprints:
    core = compile_best(camera, lf.grid, How(method="footprints", **options)).core
    assert isinstance(core, Footprints)
    return core


def refined(core: Footprints, times: int) -> Footprints:
    """The same with subdivided samples and unfiltered views: a plan does one or the other."""
    return replace(core, refine=times)


def of_some_taps(core: Footprints) -> Footprints:
    """Divided views: several taps for each, and none in some rows and columns."""
    assert len(core.view_rows) > len(np.unique(core.view_rows))
    kept = np.random.default_rng(4).random(core.weights.shape) < 50 / core.taps_used
    return replace(core, weights=core.weights * kept)


def back(core: Footprints, shape: tuple[int, ...], raster: np.ndarray, threads: int = 2, **options) -> np.ndarray:
    without_content = np.broadcast_to(np.float32(0), shape)
    gradient = NUMBA.back(core, without_content, raster, threads=threads, **options)
    assert gradient.gradients == {}
    return gradient.samples


def weights_for(core: Footprints, shape: tuple[int, ...]) -> np.ndarray:
    return random(*core.raster_shape, *(shape[4:] or (1,)), seed=1)


def assert_transposed(core: Footprints, *channels: int) -> None:
    views = int(core.view_rows.max()) + 2, int(core.view_columns.max()) + 1  # the last row of views is never read
    shape = (*views, *core.samples, *channels)
    x, y = random(*shape), weights_for(core, shape)
    gradient = back(core, shape, y)
    assert gradient.shape == shape
    assert gradient.dtype == np.float32
    assert not gradient[-1].any()
    plain = REFERENCE.back(core, x, y, threads=1).samples
    assert np.abs(gradient - plain).max() <= 2 * ROUNDING * np.abs(plain).max()
    right = np.vdot(x.astype(float), gradient)
    for each in (NUMBA, REFERENCE):
        raster = each.run(core, x, threads=2).values.astype(float)
        size = np.linalg.norm(raster) * np.linalg.norm(y)
        assert size > 0
        assert abs(np.vdot(raster, y) - right) <= ROUNDING * size


@pytest.mark.parametrize("kind", AFFINE)
def test_random_cameras(kind):
    # Each kind by one of the four ways to share out samples, with one channel or three.
    seed = AFFINE.index(kind) % 4
    case = drawn(kind, seed + 4 * (kind in ("turned mask", "two terms")), pixels=8, views=4)  # others are black
    way = [None, "nearest", "linear", "cubic"][seed]
    core = core_of(case.camera, case.light_field, **({} if way is None else {"interpolation": way}))
    assert core.separable or kind.startswith("turned")
    assert_transposed(core, *([], [3])[seed % 2])


@pytest.mark.parametrize("kind", AFFINE)
def test_random_cameras_before_light_fields_that_are_turned_or_divided(kind):
    case = drawn(kind, 5, pixels=7, views=3)
    turned = rolled(case.light_field, 0.3)
    # Each of these ways has three kinds, and each kind as it is drawn is above.
    ways = [(case.light_field, {"refine": 2}, 3), (turned, {"refine": 2}), (turned, {}, 3)]
    lf, options, *channels = ways[AFFINE.index(kind) % 3]
    assert_transposed(core_of(case.camera, lf, **options), *channels)


@pytest.mark.parametrize(("refine", "roll"), [(1, 0.0), (3, 0.0), (1, -0.7), (2, -0.7)])
@pytest.mark.parametrize("name", CAMERAS)
def test_the_transpose_is_that_of_the_matrix(name, refine, roll):
    """Every entry of the matrix, for any number of channels."""
    shape = (3, 2, 4, 5)
    core = refined(core_of(CAMERAS[name], field(shape, roll)), refine)
    assert core.separable == (roll == 0)
    if name == "divided views":
        core = of_some_taps(core)
    count = math.prod(shape)
    matrix = REFERENCE.run(core, np.eye(count).reshape(*shape, count), threads=1).values
    for channels in ((), (1,), (3,), (4,)):
        y = weights_for(core, (*shape, *channels))
        expected, size = (
            np.einsum("yxn,yxc->nc", a, b).reshape(*shape, *channels)
            for a, b in ((matrix, y), (abs(matrix), abs(y)))
        )
        # Single precision rounds products of weights, shares and masks, and sums with one term per pixel.
        assert (abs(back(core, expected.shape, y) - expected) <= 4e-6 * size + 1e-7 * size.max()).all()


@pytest.mark.parametrize("shape", [(1, 1, 1, 1), (1, 3, 1, 9), (2, 1, 7, 1, 3), (1, 1, 2, 3, 4)])
def test_tiny_views(shape):
    for roll in (0.0, 0.2):
        core = core_of(CAMERAS["masks"], field(shape, roll))
        assert_transposed(core, *shape[4:])


@pytest.mark.parametrize(("refine", "roll"), [(1, 0.0), (2, 0.0), (1, 0.3), (2, 0.3)])
@pytest.mark.parametrize("name", ["masks", "divided views"])
def test_any_number_of_threads_gives_the_same_bytes(name, refine, roll):
    shape = (4, 3, 70, 9, 3)
    core = refined(core_of(CAMERAS[name], field(shape, roll)), refine)
    if name == "divided views":
        core = of_some_taps(core)
    y = weights_for(core, shape)
    first = back(core, shape, y, threads=1)
    assert first.any()
    for threads in (3, 16):
        assert back(core, shape, y, threads=threads).tobytes() == first.tobytes()


def test_samples_that_nobody_asks_for_are_not_made():
    core = core_of(CAMERAS["plain"], field((2, 2, 3, 4)))
    assert back(core, (2, 2, 3, 4), weights_for(core, (2, 2, 3, 4)), samples=False) is None


def test_light_that_is_taken_away_altogether_leaves_nothing():
    core = core_of(CAMERAS["masks"], field((2, 2, 3, 4)))
    none = replace(core, weights=np.zeros_like(core.weights))
    assert not back(none, (2, 2, 3, 4), weights_for(core, (2, 2, 3, 4))).any()


@pytest.mark.parametrize("roll", [0.0, 0.3])
def test_progress_gets_to_the_total_and_never_goes_back(roll):
    core, calls = core_of(CAMERAS["masks"], field((3, 2, 5, 6), roll)), []
    y = weights_for(core, (3, 2, 5, 6))
    back(core, (3, 2, 5, 6), y, progress=lambda *call: calls.append(call))
    done, totals = zip(*calls, strict=True)
    assert set(totals) == {core.taps_used}
    assert list(done) == sorted(done)
    assert done[-1] == core.taps_used


# --- operators before the core ---

BEFORE = {
    "sharpened": [SharpenViews.of("point")],
    "blurred": [BlurViews(np.random.default_rng(2).standard_normal((3, 5)))],
    "swapped and sharpened": [SwapPixelAxes(), SharpenViews.of("mean")],
    "swapped and blurred": [SwapPixelAxes(), BlurViews(np.random.default_rng(3).standard_normal((1, 7)))],
}


@pytest.mark.parametrize(
    "shape", [(2, 3, 9, 11), (1, 2, 1, 1), (1, 1, 2, 2, 3), (2, 1, 3, 1, 4), (2, 2, 1, 6, 3), (1, 1, 4, 5, 1)]
)
@pytest.mark.parametrize("name", BEFORE)
def test_the_way_back_through_what_is_done_before(name, shape):
    x = random(*shape)
    ahead = NUMBA.prepared(BEFORE[name], x, 2)
    y = random(*ahead.shape, seed=1)
    found = NUMBA.prepared_back(BEFORE[name], y, 2)
    plain = REFERENCE.prepared_back(BEFORE[name], y.astype(float), 2)
    assert found.shape == plain.shape == shape
    assert (found.dtype, plain.dtype) == (np.float32, np.float64)
    size = np.linalg.norm(ahead) * np.linalg.norm(y)
    assert abs(np.vdot(ahead.astype(float), y) - np.vdot(x.astype(float), plain)) <= ROUNDING * size
    assert np.abs(found - plain).max() <= 1e-6 * np.abs(plain).max()
    assert NUMBA.prepared_back(BEFORE[name], y, 3).tobytes() == found.tobytes()
    assert NUMBA.prepared_back(BEFORE[name], y, 3, written_over=True).tobytes() == found.tobytes()


def test_bytes_are_weighed_by_the_caller_with_what_their_numbers_stand_for():
    """⟨A x, y⟩ for bytes x; their sharpened values are in units of 2⁻⁵ of a sample's, rounded to half a unit."""
    before = BEFORE["sharpened"]
    x = np.random.default_rng(0).integers(0, 256, (2, 2, 20, 30), dtype=np.uint8)
    ahead = NUMBA.prepared(before, x, 2)
    kind, unit = before[0].kept_as(x.dtype)
    assert (ahead.dtype, kind) == (np.int16, np.int16)
    y = random(*ahead.shape, seed=1)
    right = np.vdot(x.astype(float), NUMBA.prepared_back(before, y, 2) / unit)
    assert abs(np.vdot(ahead.astype(float), y) - right) <= 0.5 * np.abs(y).sum()
    assert abs(right) > 0.5 * np.abs(y).sum()
