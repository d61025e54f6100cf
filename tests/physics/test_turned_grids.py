"""Grids of views that are rotated or sheared, and rims outside their plane.

Oracles: areas in closed form, and integrals over the stop. A stop inside the grid transmits light in proportion
to its area, whatever the orientation of the grid: cells of views cover the plane once.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.shapes.patterns import CosineSum, Polygon

FOCAL_LENGTH = 50 * mm


def turned(views: int, angle: float, shear: float, spacing: float = 1 * mm) -> vcc.LightField:
    """Ones before a grid of views turned by an angle and sheared, views converging far away."""
    frame = np.eye(5)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    frame[:2, :2] = turn @ np.array([[1.0, shear], [0.0, 1.0]]) * spacing
    frame[2:4, 2:4] = -2e-3 * np.eye(2)
    frame[:4, 4] = -frame[:4, :4] @ np.array([(views - 1) / 2, (views - 1) / 2, 19.5, 19.5])
    values = np.ones((views, views, 40, 40), np.float32)
    return vcc.LightField(values, vcc.Affine(frame), disparity_range=(0.0, 0.0))


@pytest.mark.parametrize("stop", [vcc.patterns.Circle(2.3 * mm), Polygon(4, 3 * mm, 0.3), Polygon(6, 2.5 * mm)])
@pytest.mark.parametrize(("angle", "shear"), [(0.3, 0.0), (math.pi / 4, 0.0), (-0.4, 0.25), (0.0, 0.3)])
def test_light_of_a_stop_is_its_area_however_the_grid_lies(stop, angle, shear):
    side = vcc.Sensor(FOCAL_LENGTH, (10, 10), 0.1 * mm)
    area = (
        math.pi * stop.diameter**2 / 4
        if not isinstance(stop, Polygon)
        else stop.sides / 2 * (stop.diameter / 2) ** 2 * math.sin(2 * math.pi / stop.sides)
    )
    for views in (5, 6, 9):
        camera = vcc.Camera([vcc.Lens(FOCAL_LENGTH), vcc.Mask(stop, decentre=(0.2 * mm, -0.1 * mm))], side)
        image = camera.capture(turned(views, angle, shear), method="footprints")
        np.testing.assert_allclose(image.values, area / FOCAL_LENGTH**2, rtol=1e-6)


@pytest.mark.parametrize("z", [0.0, 0.01 * mm, 2 * mm])
@pytest.mark.parametrize("views", [9, 13])
def test_a_smooth_mask_behind_a_rim_anywhere_meets_its_integral(views, z):
    """Even light through a round rim and a cosine: at each pixel the mean of the cosine over the rim's shadow."""
    diameter, at, period = 6.3 * mm, 40 * mm, 7 * mm
    lf = vcc.LightField.from_views(
        np.ones((views, views, 60, 60), np.float32), 9 * mm / views, 2e-3, disparity_range=(0.0, 0.0)
    )
    lens = vcc.Lens(FOCAL_LENGTH, diameter=diameter, z=z)
    sensor = vcc.Sensor(FOCAL_LENGTH + z, (20, 22), 0.1 * mm)
    mask = vcc.Mask(CosineSum((period, math.inf), 1, 0.4), z=at)
    image = vcc.Camera([lens, mask], sensor).capture(lf).values
    x = (np.arange(22) - 10.5) * sensor.pitches[1]
    # Through the rim's point u a pixel at x sees the mask at u + (x − u)·share; chords of a circle weigh u.
    share = (at - z) / FOCAL_LENGTH
    angle = (np.arange(400) + 0.5) / 400 * math.pi
    u, weight = diameter / 2 * np.cos(angle), np.sin(angle) ** 2
    place = u[:, None] * (1 - share) + x * share
    passed = weight @ mask.faces().pattern(place, np.zeros_like(place)) / weight.sum()
    expected = math.pi * diameter**2 / 4 / FOCAL_LENGTH**2 * passed
    error = np.sqrt(np.mean((image - expected) ** 2)) / expected.max()
    assert -20 * math.log10(error) >= 60
    assert image.mean() == pytest.approx(expected.mean(), rel=1e-3)


def test_samples_that_lie_turned_are_divided_whatever_more_is_asked_for():
    frame = np.eye(5)
    turn = np.array([[math.cos(0.6), -math.sin(0.6)], [math.sin(0.6), math.cos(0.6)]])
    frame[:2, :2], frame[2:4, 2:4] = turn * mm, turn * 2e-3
    frame[:4, 4] = -frame[:4, :4] @ np.array([2, 2, 19.5, 19.5])
    values = np.random.default_rng(3).random((5, 5, 40, 40), np.float32)
    field = vcc.LightField(values, vcc.Affine(frame), disparity_range=(-0.5, 0.5))
    camera = vcc.Camera([vcc.Lens(FOCAL_LENGTH, diameter=4 * mm)], vcc.Sensor(51 * mm, (24, 24), 0.1 * mm))
    assert "samples divided 2×2: they lie turned on the sensor" in camera.explain(field)
    image = camera.capture(field)
    np.testing.assert_array_equal(image.values, camera.capture(field, refine=8).values)
    assert "samples divided" not in camera.explain(field, refine=1)
