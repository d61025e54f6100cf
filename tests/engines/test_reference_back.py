"""The backward pass of the reference through footprints: dot tests, and central differences by each parameter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.engines.test_agreement import CAMERAS, field, samples, turned
from tests.physics.random_cameras import AFFINE, drawn
from vcc.engines import reference
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.shares import share_slopes, shares
from vcc.plan.parameters import parameters, with_parameters

# Tests may request any camera: there are no warnings about sampling.
pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SMALL = (3, 2, 5, 6)


def core_of(camera: vcc.Camera, lf: vcc.LightField, **options) -> Footprints:
    """The core of a camera's plan, with textures in double precision."""
    core = camera.compile(lf, method="footprints", **options).core
    masks = tuple(replace(mask, texture=mask.texture.astype(np.float64)) for mask in core.masks)
    return replace(core, masks=masks)


def light_of(core: Footprints, channels: int = 2) -> np.ndarray:
    shape = (core.view_rows.max() + 1, core.view_columns.max() + 1, *core.samples, channels)
    return np.random.default_rng(5).normal(size=shape)


def ahead(core: Footprints, values: np.ndarray) -> np.ndarray:
    return reference.run(core, values, threads=1).values


def weights_of(core: Footprints, values: np.ndarray) -> np.ndarray:
    return np.random.default_rng(6).normal(size=(*core.raster_shape, values.shape[4]))


def assert_adjoint(core: Footprints) -> None:
    values = light_of(core)
    weights, picture = weights_of(core, values), ahead(core, values)
    found = reference.back(core, np.broadcast_to(np.float32(0), values.shape), weights, threads=1)
    assert found.samples.dtype == np.float64
    assert found.gradients == {}
    product = (found.samples * values).sum()
    # Sums of n terms in double precision differ by about √n·1e-16 of the root of the sum of their squares.
    assert abs(product - (weights * picture).sum()) <= 1e-12 * np.linalg.norm(weights) * np.linalg.norm(picture)


@pytest.mark.parametrize("kind", AFFINE)
def test_samples_of_random_cameras_are_the_adjoint(kind):
    case = drawn(kind, 0, 6, 3)
    assert_adjoint(case.camera.compile(case.light_field, refine=1 + AFFINE.index(kind) % 2).core)


@pytest.mark.parametrize("name", list(CAMERAS))
def test_samples_are_the_adjoint(name):
    interpolation = ("nearest", "linear", "cubic", "sharp")[list(CAMERAS).index(name) % 4]
    options = {"interpolation": interpolation, "between_views": "none", "refine": 1}
    assert_adjoint(CAMERAS[name].compile(field(samples(SMALL)), **options).core)


def assert_differences(core: Footprints, names=None, together: bool = False) -> None:
    """Central differences of some 1e-5 along a random direction of each parameter, or of all parameters together.
    Second derivatives jump at the ends of footprints and in textures; such a small step seldom meets a jump."""
    values, draw = light_of(core), np.random.default_rng(7)
    weights, every = weights_of(core, values), parameters(core)
    names = [name for name in names or every if name != "sharpen_samples"]
    found = reference.back(core, values, weights, samples=False, wanted=names, threads=1)
    assert found.samples is None
    assert {name: one.shape for name, one in found.gradients.items()} == {
        name: every[name].shape for name in names
    }
    # A step is multiplied by up to the last sample's index.
    directions = {
        name: 1e-5 * draw.normal(size=every[name].shape) / (max(core.samples) if "step" in name else 1)
        for name in names
    }
    for some in [names] if together else [[name] for name in names]:
        over, under = (
            ahead(with_parameters(core, {name: every[name] + sign * directions[name] for name in some}), values)
            for sign in (1, -1)
        )
        change = (over - under) / 2
        told = sum((found.gradients[name] * directions[name]).sum() for name in some)
        allowed = 1e-6 * np.linalg.norm(weights) * np.linalg.norm(change)
        assert abs(told - (weights * change).sum()) <= allowed, some


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "sharp"])
@pytest.mark.parametrize("name", list(CAMERAS))
def test_numbers_are_central_differences(name, interpolation):
    options = {"interpolation": interpolation, "between_views": "none", "refine": 1}
    core = core_of(CAMERAS[name], field(samples(SMALL)), **options)
    # A mask at the views: all samples of a view fall within 1e-7 of a pixel, so moving them moves hard edges.
    names = ["scale", "weights"] if name == "at the views" else None
    assert_differences(core, names, together=name != "mask half-way")


@pytest.mark.parametrize("kind", AFFINE)
def test_numbers_of_random_cameras(kind):
    case = drawn(kind, 1, 8, 3)
    assert_differences(core_of(case.camera, case.light_field, between_views="none", refine=1), together=True)


@pytest.mark.parametrize(("interpolation", "refine"), [("linear", 2), ("cubic", 1), ("sharp", 1)])
def test_numbers_of_turned_and_divided_plans(interpolation, refine):
    core = core_of(
        CAMERAS["three masks"], turned(field(samples(SMALL)), 0.3), interpolation=interpolation, refine=refine
    )
    assert not core.separable
    assert_adjoint(core)
    # Each number by itself once; what interpolation changes is met by all of them at once as well.
    assert_differences(replace(core, opening=0.7), together=interpolation != "cubic")


def test_numbers_of_divided_plans():
    for interpolation in ("linear", "sharp"):
        core = core_of(CAMERAS["three masks"], field(samples(SMALL)), interpolation=interpolation, refine=2)
        assert_adjoint(core)
        assert_differences(core, together=True)


def test_weights_of_taps_without_light():
    core = core_of(CAMERAS["mask half-way"], field(samples(SMALL)))
    dark = core.weights.copy()
    dark[0, 1] = 0
    assert_differences(replace(core, weights=dark), ["weights", "scale"])


def test_places_have_no_derivative_on_the_nearest_pixel():
    core = core_of(CAMERAS["mask half-way"], field(samples(SMALL)), interpolation="nearest")
    values = light_of(core)
    for name in ("x", "y", "step", "opening"):
        with pytest.raises(vcc.InputError, match=f"'{name}' where each sample falls on the nearest pixel"):
            reference.back(core, values, weights_of(core, values), wanted=[name], threads=1)
    assert_differences(core, [name for name in parameters(core) if name not in ("x", "y", "step", "opening")])


def test_what_there_is_no_derivative_to_is_refused_by_name():
    core = core_of(CAMERAS["three masks"], field(samples(SMALL)), refine=2)
    with pytest.raises(vcc.InputError, match="sharpen_samples"):
        reference.back(core, light_of(core), None, wanted=["sharpen_samples"], threads=1)
    with pytest.raises(vcc.InputError, match=r"no number 'masks\[9\].row'"):
        reference.back(core, light_of(core), None, wanted=["masks[9].row"], threads=1)


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "spline"])
@pytest.mark.parametrize("step", [-0.4, 1.7])
def test_slopes_of_shares(interpolation, step):
    pixel, position = np.arange(-4.0, 5), np.random.default_rng(8).uniform(-1, 1, (50, 1))
    found = share_slopes(interpolation, pixel, position, step, 0.8)
    by, size = 1e-6, np.sign(step)
    nearby = [
        [shares(interpolation, pixel, position + n, step + m * size, 0.8 + o) for n, m, o in np.eye(3) * sign * by]
        for sign in (1, -1)
    ]
    for slope, over, under in zip(found, *nearby, strict=True):
        np.testing.assert_allclose(slope, (over - under) / (2 * by), atol=2e-6)
