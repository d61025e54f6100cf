"""Compiled gradients of a weighted raster to the parameters of footprints equal the reference's, on any plan.

`test_reference_back` tests the reference by central differences. Here plans are random, or made for cameras.
Single precision rounds each product to 6e-8 and sums of hundreds of products to some 1e-6 of the largest: 1e-5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import vcc
from tests.physics.random_cameras import drawn
from vcc.engines import numba_cpu, reference
from vcc.engines.footprint_gradients import SPAN, footprint_gradients
from vcc.plan.footprints.model import Footprints, MaskLookup
from vcc.plan.parameters import parameters

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

AGREEMENT = 1e-5


@dataclass(frozen=True)
class Drawn:
    """A random plan.

    Args:
        interpolation: of footprints.
        masks: number of masks.
        refine: parts of each sample along each axis.
        shear: of the samples' rows and columns.
        step: approximate distance of samples in pixels.
        samples: (rows, columns) of a view.
        opening: see `Footprints`.
        channels: of the samples; none without an axis of channels.
        kind: type of the samples.
        seed: of all random numbers.
    """

    interpolation: str = "linear"
    masks: int = 1
    refine: int = 1
    shear: float = 0.0
    step: float = 1.0
    samples: tuple[int, int] = (9, 11)
    opening: float = 1.0
    channels: int | None = 3
    kind: str = "float32"
    seed: int = 0

    def core(self) -> Footprints:
        """Taps at any places; one has weight zero, some meet masks elsewhere than the rest of their column."""
        draw, (rows, columns), (b, a) = np.random.default_rng(self.seed), self.samples, (2, 3)
        raster = (int(rows * self.step), int(columns * self.step) + 2)
        turn = self.shear * np.array([[0.0, 1.0], [-0.7, 0.0]])
        across, down = np.ones((b, 1)), np.ones((1, a))
        off = self.shear * draw.uniform(-1, 1, (2, b, a))
        masks = []
        for n in range(self.masks):
            column = draw.uniform(-2, 4, (1, a)) * across
            column[1, :2] += 0.4
            texture = draw.random((int(0.6 * rows) + 2, columns + n))
            step = np.diag((0.9, -0.6)) + 0.3 * turn
            masks.append(MaskLookup(texture, column, draw.uniform(0.5, 0.7, (b, a)) * rows, step, f"mask {n}"))
        weights = draw.random((b, a))
        weights[0, 1] = 0
        return Footprints(
            raster,
            self.interpolation,
            0.37,
            np.arange(b),
            np.arange(a)[::-1].copy(),
            weights,
            draw.uniform(0.9, 1.1, (1, a)) * raster[1] * across + off[0],
            draw.uniform(-1, 1, (b, 1)) * down + off[1],
            self.step * (np.diag((-0.93, 1.07)) + turn),
            self.samples,
            tuple(masks),
            self.refine,
            self.opening,
            np.array([-0.1, 1.2, -0.1]) if self.refine == 3 else None,
        )

    def values(self) -> np.ndarray:
        """Samples for all views."""
        shape = (2, 3, *self.samples, *(() if self.channels is None else (self.channels,)))
        values = np.random.default_rng(self.seed + 1).random(shape)
        return (values * 255).astype(self.kind) if self.kind == "uint8" else values.astype(self.kind)


def weights_for(core: Footprints, values: np.ndarray) -> np.ndarray:
    channels = values.shape[4] if values.ndim == 5 else 1
    return np.random.default_rng(7).normal(size=(*core.raster_shape, channels)).astype(np.float32)


def wanted_of(core: Footprints) -> list[str]:
    return [name for name in parameters(core) if name != "sharpen_samples"]


def assert_as_the_reference(core: Footprints, values: np.ndarray, wanted: list[str]) -> None:
    weights = weights_for(core, values)
    expected = reference.back(core, values, weights, samples=False, wanted=wanted, threads=1).gradients
    found = footprint_gradients(core, values, weights, wanted, 2)
    assert list(found) == wanted
    for name in wanted:
        assert found[name].dtype == np.float64
        assert found[name].shape == expected[name].shape
        assert np.abs(expected[name]).max() > 0, name
        assert np.abs(found[name] - expected[name]).max() <= AGREEMENT * np.abs(expected[name]).max(), name


PLANS = {
    "one mask": Drawn(),
    "two masks, one channel": Drawn(masks=2, channels=None, interpolation="cubic", opening=0.7),
    "no mask, bytes": Drawn(masks=0, kind="uint8", interpolation="spline"),
    "four channels": Drawn(channels=4, masks=2),
    "samples far apart": Drawn(step=3.3, interpolation="cubic", opening=0.6),
    "samples close together": Drawn(step=0.3),
    "more spans than one": Drawn(samples=(67, SPAN + 9), channels=None),
    "divided": Drawn(refine=2, channels=None),
    "divided and filtered": Drawn(refine=3, masks=2, interpolation="spline", opening=0.8),
    "sheared": Drawn(shear=0.3, masks=2),
    "sheared, bytes": Drawn(shear=-0.4, masks=0, kind="uint8", interpolation="cubic", opening=0.8, channels=None),
    "sheared and divided": Drawn(shear=0.2, refine=2, interpolation="spline"),
}


@pytest.mark.parametrize("name", PLANS)
def test_all_numbers_of_any_plan(name):
    core = PLANS[name].core()
    assert core.separable == (PLANS[name].shear == 0)
    assert_as_the_reference(core, PLANS[name].values(), wanted_of(core))


@pytest.mark.parametrize("part", ["texture", "row"])
def test_one_number_alone(part):
    core = PLANS["one mask"].core()
    assert_as_the_reference(core, PLANS["one mask"].values(), [f"masks[0].{part}"])


@pytest.mark.parametrize(
    ("kind", "seed"),  # 4×4 views show other turned masks black
    [("prisms", 0), ("two masks", 1), ("blur", 0), ("turned lenses", 1), ("turned mask", 4)],
)
def test_random_cameras(kind, seed):
    case = drawn(kind, seed, pixels=10, views=4)
    core = case.camera.compile(case.light_field, method="footprints").core
    # Scenes are smooth: changes by the opening almost cancel in the sum.
    wanted = [name for name in wanted_of(core) if name != "opening"]
    assert_as_the_reference(core, case.light_field.values, wanted)


def test_samples_that_are_no_more_than_one_vector_or_do_not_lie_side_by_side():
    plan = Drawn(samples=(3, 2), step=1.4)
    core, values = plan.core(), plan.values()
    wanted = wanted_of(core)
    assert_as_the_reference(core, values[..., ::-1, :], wanted)
    assert_as_the_reference(core, values.astype(np.float16), wanted)


@pytest.mark.parametrize("name", ["more spans than one", "divided", "sheared"])
def test_the_same_bytes_for_any_number_of_threads(name):
    core, values = PLANS[name].core(), PLANS[name].values()
    wanted, weights = wanted_of(core), weights_for(core, values)
    first = footprint_gradients(core, values, weights, wanted, 1)
    for threads in (1, 2, 3):
        other = footprint_gradients(core, values, weights, wanted, threads)
        assert all(other[name].tobytes() == first[name].tobytes() for name in wanted)


@pytest.mark.parametrize("shear", [0.0, 0.3])
def test_nearest_pixels_say_what_is_linear_and_refuse_places(shear):
    plan = Drawn(interpolation="nearest", shear=shear)
    core, values = plan.core(), plan.values()
    wanted = [name for name in wanted_of(core) if name not in ("x", "y", "step", "opening")]
    assert_as_the_reference(core, values, wanted)
    for name in ("x", "y", "step", "opening"):
        with pytest.raises(vcc.InputError, match=name):
            footprint_gradients(core, values, weights_for(core, values), [name], 1)


def test_there_is_no_derivative_to_a_filter_of_samples():
    plan = PLANS["divided and filtered"]
    core = plan.core()
    with pytest.raises(vcc.InputError, match="sharpen_samples"):
        footprint_gradients(core, plan.values(), weights_for(core, plan.values()), ["sharpen_samples"], 1)


@pytest.mark.parametrize("shear", [0.0, 0.3])
def test_progress_of_samples_and_numbers_is_told_up_to_the_end(shear):
    plan = Drawn(shear=shear)
    core, values, said = plan.core(), plan.values(), []

    def told(done: int, total: int) -> None:
        said.append((done, total))

    options = {"wanted": ["weights"], "threads": 1, "progress": told}
    numba_cpu.back(core, values, weights_for(core, values), **options)
    assert said == sorted(said)
    assert said[-1] == (2 * core.taps_used, 2 * core.taps_used)
