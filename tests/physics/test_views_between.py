"""Views made in between by depth: scenes far out of focus, in part or as a whole, without ghosts.

The oracle is `brute_force`: closed-form planes integrated over the round stop, with the sharp border of the nearer
one. Views 1 mm apart see the planes move by several pixels from one to the next. Disparities are those of the
closed form, so that what is left is what warping costs.
"""

from __future__ import annotations

import numpy as np
import pytest
from brute_force import Layer, Scene, ThinLensCamera, cosines, psnr, round_stop, views

import vcc
from vcc.units import m, mm

FOCAL_LENGTH, SPACING, SLOPE, FOCUS = 50 * mm, 1 * mm, 1e-3, 1 * m
VIEWS, PIXELS, SENSOR = 7, 88, 40
DIAMETER = 6 * mm
MEANS = 5
"""Rays a pixel, each way, whose mean a sample is: cameras' pixels, so that borders are soft as theirs."""
PERIODS = np.array([9.0, 14.0, 30.0])
"""Of the textures, in samples of a view: the shortest is about two gaps between views."""


def distance_with(disparity: float) -> float:
    return 1 / (disparity * SLOPE / SPACING + 1 / FOCUS)


def planes(near: float, far: float) -> Scene:
    """A half plane with a sharp, oblique border before a whole one; disparities of both."""
    layers = [
        Layer(distance_with(d), cosines(seed, PERIODS * SLOPE * distance_with(d)), opacity)
        for d, seed, opacity in ((near, 1, lambda x, y: (0.8 * x + 0.6 * y > 0) * 1.0), (far, 2, None))
    ]
    return Scene(layers)


def field(near: float, far: float, shape=(VIEWS, VIEWS, PIXELS, PIXELS)) -> vcc.LightField:
    fine = views(
        planes(near, far), (*shape[:2], shape[2] * MEANS, shape[3] * MEANS), SPACING, SLOPE / MEANS, FOCUS
    )
    samples = fine.reshape(*shape[:2], shape[2], MEANS, shape[3], MEANS).mean(axis=(3, 5)).astype(np.float32)
    # The same tracer, asked for disparities in place of radiance.
    known = Scene(
        [
            Layer(
                layer.distance, lambda x, y, d=d: np.full(np.broadcast_shapes(x.shape, y.shape), d), layer.opacity
            )
            for layer, d in zip(planes(near, far).layers, (near, far), strict=True)
        ]
    )
    disparity = views(known, shape, SPACING, SLOPE, FOCUS)
    return vcc.LightField.from_views(samples, SPACING, SLOPE, FOCUS, disparity=disparity)


def sensor_focused_on(disparity: float) -> vcc.Sensor:
    distance = 1 / (1 / FOCAL_LENGTH - 1 / distance_with(disparity))
    return vcc.Sensor(z=distance, shape=(SENSOR, SENSOR), pitch=SLOPE * distance)


def truth(near: float, far: float, sensor: vcc.Sensor) -> np.ndarray:
    # Nodes about a quarter of a pixel apart in the widest blur, of 24 pixels across.
    stop = round_stop(DIAMETER, 40, 160)
    return ThinLensCamera(FOCAL_LENGTH, stop, sensor.z, sensor.shape, sensor.pitches[0]).picture(planes(near, far))


LENS = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=DIAMETER)


@pytest.mark.parametrize(
    ("near", "far", "focus"), [(0.0, -4.0, 0.0), (4.0, 0.0, 0.0), (2.0, -2.0, 0.3)], ids=["far", "near", "both"]
)
def test_what_is_out_of_focus_shows_no_ghosts(near, far, focus):
    sensor = sensor_focused_on(focus)
    camera, lf, expected = vcc.Camera([LENS], sensor), field(near, far), truth(near, far, sensor)
    found = {
        how: psnr(camera.capture(lf, between_views=how, interpolation="cubic").values, expected)
        for how in ("none", "auto", "depth")
    }
    print(found)
    assert found["depth"] > found["none"] + 10
