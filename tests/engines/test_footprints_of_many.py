"""Several rasters in one pass over the samples: each equals the raster of its own core.

Sums have a different order: single precision rounds each to 6e-8 of itself, and hundreds of positive ones to
less than 1e-6 of the largest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engines.test_footprint_gradients import Drawn
from vcc.base.workers import Workers
from vcc.engines import numba_cpu
from vcc.engines.footprints_of_many import rasters, rasters_by_turns
from vcc.engines.many_kernels import SPAN
from vcc.plan.footprints.model import Footprints
from vcc.plan.protocol import Partial

AGREEMENT = 1e-6
COUNT = 5
"""More than the kernels weigh together."""

PLANS = {
    "one mask": Drawn(masks=1),
    "two masks, one channel": Drawn(masks=2, channels=None, interpolation="cubic"),
    "two masks, two channels": Drawn(masks=2, channels=2, seed=1),
    "rows of some spans": Drawn(masks=2, samples=(20, SPAN), seed=2),
    "large samples": Drawn(masks=1, step=3.3, samples=(14, 30), opening=0.7, seed=3),
}


def with_other_weights(core: Footprints) -> list[Footprints]:
    """Each opens and closes different taps; one opens none."""
    draw = np.random.default_rng(5)
    several = [draw.random(core.weights.shape) * draw.integers(0, 2, core.weights.shape) for _ in range(COUNT)]
    several[2] *= 0
    return [replace(core, weights=weights) for weights in several]


def with_other_textures(core: Footprints, n: int) -> list[Footprints]:
    draw = np.random.default_rng(6)
    masks = [replace(core.masks[n], texture=draw.random(core.masks[n].texture.shape)) for _ in range(COUNT)]
    return [replace(core, masks=(*core.masks[:n], mask, *core.masks[n + 1 :])) for mask in masks]


def batch(cores: list[Footprints], values: np.ndarray, threads: int) -> list[Partial]:
    with Workers(threads) as pool:
        return numba_cpu.batch(cores, values, pool=pool, then=lambda _, raster: raster)


def assert_each_as_alone(cores: list[Footprints], values: np.ndarray) -> None:
    assert rasters(cores, values, 1) is not None  # in one pass
    found = batch(cores, values, 1)
    again = batch(cores, values, 3)
    largest = 0.0
    for core, one, other in zip(cores, found, again, strict=True):
        alone = numba_cpu.run(core, values, threads=2).values
        assert one.values.shape == alone.shape
        assert one.values.tobytes() == other.values.tobytes()
        assert np.abs(one.values - alone).max() <= AGREEMENT * np.abs(alone).max()
        largest = max(largest, np.abs(alone).max())
    assert largest > 0


@pytest.mark.parametrize("name", PLANS)
def test_codes_at_the_views(name: str) -> None:
    core, values = PLANS[name].core(), PLANS[name].values()
    assert_each_as_alone(with_other_weights(core), values)


@pytest.mark.parametrize("name", PLANS)
def test_textures_of_a_mask(name: str) -> None:
    core, values = PLANS[name].core(), PLANS[name].values()
    assert_each_as_alone(with_other_textures(core, len(core.masks) - 1), values)


def test_codes_without_masks_in_mid_path() -> None:
    drawn = Drawn(masks=0, kind="uint8")
    assert_each_as_alone(with_other_weights(drawn.core()), drawn.values())


@pytest.mark.parametrize("name", PLANS)
def test_places_by_turns_are_the_same_to_the_bit(name: str) -> None:
    drawn = PLANS[name]
    core, values = drawn.core(), drawn.values()
    rows, columns = core.raster_shape
    moved = replace(core, x=core.x + 0.3, y=core.y - 1.2, step=core.step * 1.01)
    larger = replace(core, raster_shape=(rows + 70, columns + 3), weights=core.weights * 0.5)
    found = rasters_by_turns([core, moved, larger], values)
    assert found is not None
    for one, raster in zip((core, moved, larger), found, strict=True):
        assert raster.tobytes() == numba_cpu.run(one, values, threads=1).values.tobytes()
    assert rasters_by_turns([core, replace(core, view_rows=core.view_rows[::-1])], values) is None
    assert rasters_by_turns([Drawn(refine=3).core()], Drawn(refine=3).values()) is None


def test_what_differs_in_more_is_made_one_by_one() -> None:
    drawn = Drawn(masks=2)
    core, values = drawn.core(), drawn.values()
    textures = with_other_textures(core, 0)
    divided, sheared = Drawn(refine=3), Drawn(shear=0.1)
    for cores, light in (
        ([core], values),
        ([*textures, *with_other_textures(core, 1)], values),
        ([core, replace(core, scale=2.0)], values),
        ([*textures, with_other_weights(core)[0]], values),
        (with_other_weights(divided.core()), divided.values()),
        (with_other_weights(sheared.core()), sheared.values()),
    ):
        assert rasters(cores, light, 1) is None
        for threads in (1, 3):
            found = batch(cores, light, threads)
            for one, each in zip(cores, found, strict=True):
                alone = numba_cpu.run(one, light, threads=1).values
                np.testing.assert_allclose(each.values, alone, rtol=0, atol=AGREEMENT * np.abs(alone).max())
