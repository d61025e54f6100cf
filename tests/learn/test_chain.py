"""The chain rule from a plan's numbers to a camera's parameters.

The oracle is what a lens does: places in closed form; and for random cameras differences of the picture itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.physics.random_cameras import drawn
from vcc.learn.chain import Chain
from vcc.learn.parameters import names as all_names
from vcc.learn.parameters import read
from vcc.learn.scales import scale
from vcc.plan.how import How
from vcc.plan.operators import finished
from vcc.run.backwards import back
from vcc.run.drive import Drive
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
    numbers = chain.plan().parameters()
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


def test_a_rim_at_the_views_may_leave_them():
    """By footprints it is a mask in mid-path from the first, and the picture is the same within its texture."""
    lens = vcc.Lens(50 * mm, diameter=7 * mm, name="main")
    train = vcc.Camera([lens], camera().sensor)
    how = How(engine="reference", refine=1, between_views="none")
    still, chain = Chain(train, LIGHT_FIELD.grid, how), Chain(train, LIGHT_FIELD.grid, how, ["main.z"])
    assert [mask.label for mask in chain.plan().core.masks] == ['lens "main"']
    one, other = (picture(each.plan(), LIGHT_FIELD, how) for each in (still, chain))
    np.testing.assert_allclose(other, one, atol=0.01 * one.max())
    weights = np.random.default_rng(4).standard_normal(one.shape)
    found = back(chain.plan(), LIGHT_FIELD, weights[..., 0], how, wanted=chain.followed()["main.z"]).gradients
    near, far = ((weights * picture(chain.plan({"main.z": z}), LIGHT_FIELD, how)).sum() for z in (1e-7, 2e-7))
    slope = (-3 * (weights * other).sum() + 4 * near - far) / 2e-7
    assert chain.pull({}, found)["main.z"] == pytest.approx(slope, rel=1e-3)


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
    here, there = chain.plan().parameters(), chain.plan({"code.z": 41 * mm, "code.pattern": CELLS**2}).parameters()
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
    slopes = np.random.default_rng(0).uniform(-1e-3, 1e-3, (21, 20, 2))
    many = vcc.PrismArray(slopes, 0.5 * mm, name="prisms", z=1 * mm)
    with pytest.raises(vcc.InputError, match=r"linear in prisms\.slopes .* has 840 numbers"):
        Chain(camera(many), LIGHT_FIELD.grid, None, ["prisms.slopes"])


def test_rays_that_move_against_a_hard_edge_are_refused():
    array = vcc.LensArray(0.5 * mm, 3 * mm, name="array", z=55 * mm)
    how = How(samples=16)
    with pytest.raises(vcc.InputError, match=r"no derivative to array\.offset .*border between cells of .*code"):
        Chain(camera(code(z=30 * mm), array), LIGHT_FIELD.grid, how, ["array.offset"])
    Chain(camera(code(z=30 * mm), array), LIGHT_FIELD.grid, how, ["code.pattern"])  # which weighs rays alone


# --- pictures


def picture(plan, light_field, how) -> np.ndarray:
    """In double precision, (rows, columns, channels)."""
    drive = Drive(plan, light_field, how)
    return np.asarray(finished(plan.after, drive.summed(drive.blocks).values), dtype=np.float64)


def check_derivatives(camera: vcc.Camera, light_field: vcc.LightField, names: list[str], how: How) -> None:
    """⟨G, picture⟩ by the chain and the way back of the reference, against its differences over two decades."""
    chain = Chain(camera, light_field.grid, how, names)
    plan = chain.plan()
    weights = np.random.default_rng(4).standard_normal(picture(plan, light_field, how).shape)
    numbers = {number for followed in chain.followed().values() for number in followed}
    wanted = [number for number in numbers if not number.endswith("half_widths")]  # which say what tents are
    given = weights if light_field.values.ndim == 5 else weights[..., 0]
    back_to_numbers = back(plan, light_field, given, how, samples_wanted=False, wanted=wanted).gradients
    pulled = chain.pull({}, back_to_numbers)
    # What rounding leaves of a sum over the picture: 1e-16 of its terms, divided by the step.
    rounding = 1e-14 * np.abs(weights * picture(plan, light_field, how)).sum()
    for name in names:
        here, unit = read(camera, name), scale(camera, name)
        for index in np.ndindex(here.shape):
            for step in (1e-6, 1e-5, 1e-4):
                sides = []
                for side in (1, -1):
                    there = here.copy()
                    there[index] += side * step * unit
                    sides.append((weights * picture(chain.plan({name: there}), light_field, how)).sum())
                slope = (sides[0] - sides[1]) / (2 * step)
                found = pulled[name][index] * unit
                assert found == pytest.approx(slope, rel=1e-3, abs=rounding / step), (name, index, step)


@pytest.mark.parametrize(
    ("kind", "seed", "kinds_of_names"),
    [
        ("one mask", 0, ("decentre", "focal_length", "diameter", "pitch")),
        ("blur", 3, ("sigma", "width", "sensor.z")),
        ("prisms", 3, ("deflection", "sensor.z")),
    ],
)
def test_derivatives_of_pictures_by_footprints_are_those_of_their_differences(kind, seed, kinds_of_names):
    case = drawn(kind, seed, pixels=8, views=4)
    named = [replace(element, name=f"e{n}") for n, element in enumerate(case.camera.elements)]
    camera = vcc.Camera(named, case.camera.sensor)
    values = case.light_field.values.astype(np.float64)
    light_field = vcc.LightField(values, case.light_field.frame, case.disparities, case.sample)
    names = [
        name
        for name in all_names(camera)
        if any(part in name for part in kinds_of_names) and read(camera, name).size <= 2
    ]
    assert len(names) >= 2
    check_derivatives(camera, light_field, names, How(engine="reference"))


def test_derivatives_of_pictures_by_rays_are_those_of_their_differences():
    """A plate in the plane of the stop that rays are aimed at: no edge cuts them. In the light field's linear
    stretches, so that no ray comes over a bend of what is interpolated."""
    plate = vcc.PhasePlate(
        vcc.surfaces.Zernike((0.0, 0.0, 0.0, 2e-6, 0.0, 0.0, 1e-6), 12 * mm), z=5 * mm, name="plate"
    )
    lens = vcc.Lens(50 * mm, diameter=6 * mm, z=5 * mm, name="main")
    camera = vcc.Camera([lens, plate], vcc.Sensor(56 * mm, shape=(6, 6), pitch=60 * um))
    v, u, t, s = np.meshgrid(*(np.arange(n) - (n - 1) / 2 for n in (8, 8, 30, 30)), indexing="ij", sparse=True)
    values = 5 + 0.02 * u - 0.03 * v + 0.05 * s + 0.04 * t
    light_field = vcc.LightField(values, vcc.LightField.from_views(values, 2 * mm, 2e-3).frame, (0.0, 0.0))
    how = How(engine="reference", samples=16, interpolation="linear")
    names = ["plate.surface.coefficients", "main.focal_length", "main.diameter", "sensor.z"]
    check_derivatives(camera, light_field, names, how)
