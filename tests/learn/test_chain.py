"""The chain rule from a plan's numbers to a camera's parameters.

The oracle is what a lens does: places in closed form; and for random cameras differences of the picture itself.
"""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.learn.chain import Chain
from vcc.plan.how import How
from vcc.units import mm, um

LIGHT_FIELD = vcc.LightField.from_views(
    np.random.default_rng(0).random((4, 5, 12, 14)).astype(np.float32), 2 * mm, 2e-3, disparity_range=(0, 0)
)
CELLS = np.random.default_rng(1).uniform(0.2, 0.8, (3, 4))


def camera(*more: vcc.Element, z: float = 5 * mm) -> vcc.Camera:
    lens = vcc.Lens(50 * mm, z=z, name="main")
    return vcc.Camera([lens, *more], vcc.Sensor(58 * mm, shape=(10, 12), pitch=60 * um))


def code(**options) -> vcc.Mask:
    return vcc.Mask(CELLS, width=4 * mm, **{"z": 40 * mm, "name": "code", **options})


def test_places_follow_the_focal_length_as_a_lens_bends():
    """A ray through x at a lens lands b·x/f² further for each metre of focal length, b behind it."""
    chain = Chain(camera(z=0.0), LIGHT_FIELD.grid, None, ["main.focal_length", "sensor.z"])
    numbers = chain.plan().numbers()
    weights = np.random.default_rng(2).random(numbers["core.x"].shape)
    pulled = chain.pull({}, {"core.x": weights})
    # Sample (0, 0) of view i: u = 2 mm · (i − 2), s = −2 mrad · (0 − 6.5)
    u, s = 2 * mm * (np.arange(5) - 2), 2e-3 * 6.5
    assert pulled["main.focal_length"] == pytest.approx((weights * 58 * mm * u / (50 * mm) ** 2 / (60 * um)).sum())
    assert pulled["sensor.z"] == pytest.approx((weights * (s - u / (50 * mm)) / (60 * um)).sum(), rel=1e-7)


def test_a_lens_at_the_entrance_plane_moves_away_from_it():
    """It cannot stand before it; u + z·s is bent, and the way behind gets shorter: no difference but that."""
    chain = Chain(camera(z=0.0), LIGHT_FIELD.grid, None, ["main.z"])
    weights = np.random.default_rng(2).random(chain.plan().core.y.shape)
    t, f, b = 2e-3 * 5.5, 50 * mm, 58 * mm
    v = 2 * mm * (np.arange(4) - 1.5)[:, None]
    # y = v + b·t − (b − z)·(v + z·t)/f, to z at 0
    expected = (weights * (v - b * t) / f / (60 * um)).sum()
    assert chain.pull({}, {"core.y": weights})["main.z"] == pytest.approx(expected, rel=1e-7)


def test_only_what_follows_a_parameter_is_named():
    chain = Chain(camera(code()), LIGHT_FIELD.grid, None, ["code.decentre", "main.focal_length", "code.pattern"])
    followed = chain.followed()
    assert set(followed["code.decentre"]) == {"core.masks[0].column", "core.masks[0].row"}
    assert followed["code.pattern"] == ("core.masks[0].texture",)
    assert {"core.x", "core.step", "core.masks[0].texture", "core.masks[0].step"} <= set(
        followed["main.focal_length"]
    )


def test_values_are_put_and_all_plans_have_one_form():
    chain = Chain(camera(code()), LIGHT_FIELD.grid, None, ["code.z", "code.pattern"])
    here, there = chain.plan().numbers(), chain.plan({"code.z": 41 * mm, "code.pattern": CELLS**2}).numbers()
    assert {name: one.shape for name, one in here.items()} == {name: one.shape for name, one in there.items()}
    assert np.abs(here["core.masks[0].texture"] - there["core.masks[0].texture"]).max() > 0.05
    pulled = chain.pull(
        {"code.z": 41 * mm}, {"core.masks[0].texture": np.ones(here["core.masks[0].texture"].shape)}
    )
    assert pulled["code.z"].shape == ()
    assert pulled["code.pattern"].shape == CELLS.shape


def test_planning_again_tells_what_it_would_decide():
    chain = Chain(camera(code()), LIGHT_FIELD.grid, None, ["sensor.pitch", "code.z"])
    assert chain.replanned({"code.z": 40.2 * mm}) == ()
    assert "weights of the filters that give sharpness back" in chain.replanned({"sensor.pitch": 6 * um})


def test_what_cannot_follow_is_refused_by_name():
    with pytest.raises(vcc.InputError, match=r"no derivative to code\.z: which masks stand against the sensor"):
        Chain(camera(code(z=58 * mm)), LIGHT_FIELD.grid, None, ["code.z"]).pull({}, {})
    many = vcc.Mask(np.full((30, 30), 0.5), width=4 * mm, z=40 * mm, name="code")
    with pytest.raises(vcc.InputError, match=r"code\.pattern .* has 900 numbers"):
        Chain(camera(many), LIGHT_FIELD.grid, None, ["code.pattern"])


def test_rays_that_move_against_a_hard_edge_are_refused():
    array = vcc.LensArray(0.5 * mm, 3 * mm, name="array", z=55 * mm)
    how = How(samples=16)
    with pytest.raises(vcc.InputError, match=r"no derivative to array\.offset .*against .*code"):
        Chain(camera(code(z=30 * mm), array), LIGHT_FIELD.grid, how, ["array.offset"])
    Chain(camera(code(z=30 * mm), array), LIGHT_FIELD.grid, how, ["code.pattern"])  # which weighs rays alone


# --- pictures


def weights_of(plan, seed: int = 4) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((*plan.sensor_shape, 1))
