"""Rays that a plan traces back from the sensor, traced forward through the elements' definitions: they reach the
pixel from which they were traced, and have the weight that the elements' own patterns give them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc import patterns, surfaces
from vcc.base.units import mm
from vcc.plan.following import Follow
from vcc.plan.how import How
from vcc.plan.rays.aim import found
from vcc.plan.rays.bounds.windows import CellWindows, Window
from vcc.plan.rays.compile import ByRays
from vcc.plan.rays.path import Path

RANDOM = np.random.default_rng(6)
FIELD = vcc.LightField.from_views(
    RANDOM.random((7, 7, 9, 11)), 1 * mm, 2e-3, focus_distance=1.0, disparity_range=(-0.2, 0.4)
)
SENSOR = vcc.Sensor(52 * mm, (5, 6), (0.13 * mm, 0.1 * mm), decentre=(0.11 * mm, -0.04 * mm), fill_factor=0.5)
LENS = vcc.Lens(50 * mm, 6 * mm, z=1 * mm, decentre=(0.3 * mm, -0.2 * mm))
COS, SIN = math.cos(0.4), math.sin(0.4)
TURN = vcc.FirstOrder(np.kron(np.eye(2), np.array([[COS, -SIN], [SIN, COS]])), z=0.5 * mm)


def board(x, y):
    return 0.6 + 0.3 * np.sin(900 * x) * np.cos(700 * y)


CAMERAS = {
    "masks": [
        LENS,
        vcc.Mask(RANDOM.random((5, 4)), 5 * mm, 4.5 * mm, z=20 * mm, decentre=(0.4 * mm, -0.3 * mm)),
        vcc.Mask(patterns.CosineSum((2 * mm, 1.3 * mm), 2, 0.3), z=30 * mm, decentre=(0.2 * mm, 0.1 * mm)),
        vcc.Mask(board, 4 * mm, 3 * mm, z=35 * mm, decentre=(-0.2 * mm, 0.15 * mm)),
        vcc.Mask(patterns.Circle(2.2 * mm), z=40 * mm, decentre=(0.1 * mm, -0.1 * mm)),
    ],
    "cells off the middle of their sheet": [
        LENS,
        vcc.Mask(patterns.Cells(RANDOM.random((6, 3)), 4 * mm, 5 * mm, (0.3 * mm, -0.7 * mm)), z=20 * mm),
    ],
    "in one plane": [
        LENS,
        vcc.Mask(patterns.Circle(3 * mm), z=20 * mm, decentre=(0.5 * mm, 0.0)),
        vcc.Mask(np.ones((2, 2)), 2.5 * mm, z=20 * mm, decentre=(0.0, 0.6 * mm)),
        vcc.Biprism(0.004, 0.3, z=20 * mm),
        vcc.Mask(np.ones((2, 3)), 3.5 * mm, z=20 * mm, decentre=(0.1 * mm, 0.0)),
    ],
    "facets": [
        LENS,
        vcc.Biprism(0.01, 0.3, z=15 * mm, decentre=(0.4 * mm, -0.3 * mm)),
        vcc.Pyramid(5, -0.02, 0.2, 5 * mm, z=30 * mm, decentre=(-0.2 * mm, 0.3 * mm)),
    ],
    "prisms": [
        LENS,
        vcc.PrismArray(
            RANDOM.uniform(-0.01, 0.01, (3, 4, 2)),
            1.4 * mm,
            "hexagonal",
            0.2,
            0.2,
            z=10 * mm,
            decentre=(0.2 * mm, 0),
        ),
    ],
    "lenslets": [
        LENS,
        vcc.LensArray(
            0.4 * mm,
            (5 * mm, 7 * mm),
            "hexagonal",
            0.2,
            (0.1 * mm, 0.05 * mm),
            0.6,
            z=47 * mm,
            decentre=(0.1 * mm, 0.0),
        ),
    ],
    "round lenslets": [LENS, vcc.LensArray(0.4 * mm, 5 * mm, circular=True, fill_factor=0.5, z=47 * mm)],
    "plate": [LENS, vcc.PhasePlate(surfaces.Cubic(20.0), 6 * mm, z=10 * mm, decentre=(0.3 * mm, 0.2 * mm))],
    "thick lens": [
        vcc.FirstOrder.thick_lens((31 * mm, -47 * mm), 6 * mm, 1.5168, diameter=5 * mm, z=2 * mm),
        vcc.Prism((0.002, -0.001), z=12 * mm),
        vcc.Mask(RANDOM.random((5, 4)), 5 * mm, z=20 * mm),
    ],
    "turned": [TURN, LENS, vcc.Mask(RANDOM.random((5, 4)), 5 * mm, z=20 * mm), vcc.Biprism(0.01, z=15 * mm)],
}


LIT = {
    "masks": 1.0, "cells off the middle of their sheet": 0.995, "in one plane": 0.94, "facets": 0.42,
    "prisms": 0.23, "lenslets": 0.095, "round lenslets": 0.19, "plate": 0.99, "thick lens": 1.0, "turned": 0.96,
}  # fmt: skip
"""Least share of the rays that passes everything they are aimed through: aims are no wider than that."""


def sent_forward(camera, rays, places=None):
    """Positions on the sensor of rays (n, 4) from the entrance plane, and the share that the elements transmit."""
    passed = np.ones(len(rays))
    places = [] if places is None else places
    for stage in camera.stages:
        rays = stage.approach(rays)
        places.append(rays[:, :2])
        if stage.faces.pattern is not None:
            x, y = (rays[:, :2] - stage.element.decentre).T
            passed = passed * stage.faces.pattern(x, y)
        rays = stage.deflected(rays)
    return camera.approach_to_sensor(rays), passed


@pytest.mark.parametrize("kept", [False, True])
@pytest.mark.parametrize("name", CAMERAS)
def test_rays_come_to_their_pixels_and_weigh_what_elements_let_pass(name, kept):
    camera = vcc.Camera(CAMERAS[name], SENSOR)
    options = {"follow": Follow()} if kept else {}
    core = ByRays(camera, FIELD.grid, How(samples=128, method="rays"), **options).plan.core
    pixel = np.arange(30)
    index, share = core.looked_up(pixel, core.block(pixel))
    there, passed = sent_forward(camera, FIELD.frame(index.reshape(-1, 4)))
    there, passed = there.reshape(*index.shape[:3], 4), passed.reshape(share.shape)
    middle = SENSOR.frame(np.stack([pixel % 6, pixel // 6], axis=-1))[:, None, None]
    lit = share > 0
    assert lit.any(axis=(1, 2)).mean() > 0.2
    off = np.abs(there[..., :2] - middle)[lit]
    half = np.array([0.1, 0.13]) * mm * math.sqrt(0.5) / 2
    bent = name == "plate"  # a texture of its slopes
    assert (off < half * (1.01 if bent else 1 + 1e-6)).all()
    assert (off.max(axis=0) > 0.9 * half).all()
    # A ray on an edge, or beside it by what a texture errs, falls on either side.
    edges = (lit != (passed > 0)).mean()
    if isinstance(core.aim, Window):
        assert edges < 2e-3
        both = lit & (passed > 0)
        np.testing.assert_allclose(share[both] * 128, core.aim.solid_angle * passed[both], rtol=3e-3)
    else:
        assert isinstance(core.aim, CellWindows)
        assert (passed[lit] > 0).mean() > 0.995


@pytest.mark.parametrize("name", CAMERAS)
def test_rays_are_aimed_no_wider_than_light_comes_and_meet_elements_where_that_is_foretold(name):
    """Places of rays on elements against the regions in which textures of them are made."""
    camera = vcc.Camera(CAMERAS[name], SENSOR)
    core = ByRays(camera, FIELD.grid, How(samples=128, method="rays")).plan.core
    index, share = core.looked_up(np.arange(30), core.block(np.arange(30)))
    lit = share.reshape(-1) > 0
    assert lit.mean() >= LIT[name]
    places: list[np.ndarray] = []
    sent_forward(camera, FIELD.frame(index.reshape(-1, 4)), places)
    path = Path(camera, FIELD.grid, core.motion, 128)
    for leg, (low, high) in zip(path.legs, found(path).regions, strict=True):
        met = places[len(path.legs) - 1 - leg.number][lit]
        np.testing.assert_array_less(low - 1e-9, met.min(axis=0))
        np.testing.assert_array_less(met.max(axis=0), high + 1e-9)
        if name in ("masks", "thick lens", "cells off the middle of their sheet"):
            # rays of all pixels, drawn at random, nearly fill the rectangle around a disc's light
            np.testing.assert_array_less(high - low, 1.12 * np.ptp(met, axis=0))


def test_what_a_diffuser_adds_to_slopes_is_spread_as_its_kernel():
    """A disc of slopes of width w adds w²/16 to the variance of slopes: what is left of a ray's way to its pixel.

    A pixel of 10 um is seen from there under 1/70 of the kernel's width; 30 pixels' evenly spread rays tell a
    variance to 3 %.
    """
    diffuser = vcc.Diffuser(vcc.kernels.TopHat(0.06), z=40 * mm)
    sensor = vcc.Sensor(52 * mm, (5, 6), 10e-6)
    for elements in ([LENS, diffuser], [LENS, diffuser, vcc.Mask(patterns.CosineSum(9 * mm), z=30 * mm)]):
        camera = vcc.Camera(elements, sensor)
        core = ByRays(camera, FIELD.grid, How(samples=1024, method="rays")).plan.core
        pixel = np.arange(30)
        index, share = core.looked_up(pixel, core.block(pixel))
        assert (share > 0).all()
        met = camera.rays_at(40 * mm, before=True)(FIELD.frame(index.reshape(-1, 4)))
        middle = np.repeat(sensor.frame(np.stack([pixel % 6, pixel // 6], axis=-1)), 1024, axis=0)
        added = (middle - met[:, :2]) / (12 * mm) - met[:, 2:]
        assert np.abs(added).max() < 0.03 + 5e-6 / (12 * mm)
        np.testing.assert_allclose(added.mean(axis=0), 0, atol=1e-3)
        np.testing.assert_allclose(added.var(axis=0), 0.06**2 / 16, rtol=0.03)


def test_what_stands_in_one_plane_bounds_light_together():
    """The rectangles around three stops of one plane have one in common, wherever they are listed."""
    camera = vcc.Camera(CAMERAS["in one plane"], SENSOR)
    path = Path(camera, FIELD.grid, np.zeros((2, 2)), 64)
    low, high = np.array([-1.0, -0.65]) * mm, np.array([1.25, 7 / 6]) * mm
    for leg in path.legs[:4]:
        np.testing.assert_allclose(leg.stop, (low, high), rtol=1e-9)
    np.testing.assert_allclose(path.legs[4].stop, ([-2.7 * mm, -3.2 * mm], [3.3 * mm, 2.8 * mm]), rtol=1e-9)
    assert [leg.number for leg in path.legs] == [0, 1, 2, 3, 4]
    assert [leg.stage.element for leg in path.legs] == list(camera.elements[::-1])
    np.testing.assert_allclose(path.pixel, np.array([0.1, 0.13]) * mm * math.sqrt(0.5))
    assert path.size.tolist() == [7, 7, 11, 9]
    assert path.finds.tolist() == [3.5, 3.5, 6, 5]
    moving = Path(camera, FIELD.grid, np.array([[0.3, -0.1], [0.2, 0.6]]), 64)
    np.testing.assert_allclose(moving.finds, [3.5, 3.5, 6.4, 5.8])


@pytest.mark.parametrize(("diameter", "bound"), [(1.99, True), (2.01, False)])
def test_a_stop_bounds_light_that_is_less_steep_than_45_degrees(diameter, bound):
    """Of free flight over 1 m, a stop of ±1 m."""
    camera = vcc.Camera([vcc.Mask(np.ones((1, 1)), diameter)], vcc.Sensor(1.0, (2, 2), 1 * mm))
    assert Path(camera, FIELD.grid, np.zeros((2, 2)), 64).stops_bound is bound
    assert not Path(vcc.Camera([vcc.Lens(1.0)], camera.sensor), FIELD.grid, np.zeros((2, 2)), 64).stops_bound
    against = vcc.Camera([vcc.Mask(np.ones((1, 1)), 1 * mm, z=1.0)], camera.sensor)
    assert not Path(against, FIELD.grid, np.zeros((2, 2)), 64).stops_bound
