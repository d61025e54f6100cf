"""Views interpolated by depth: a scene far out of focus, as a whole or in part, shows no ghosts.

The oracle is `brute_force`: a closed-form half plane with a sharp border in front of another plane, integrated
over the round stop; samples are means over pixels, as of cameras. Views see planes that move by up to 4 pixels
from one view to the next. Disparities are those of the closed form, so that the remaining error is that of
interpolation.
"""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from tests.physics.brute_force import Layer, Scene, ThinLensCamera, cosines, psnr, round_stop, views
from vcc.base.units import m, mm

FOCAL_LENGTH, SPACING, SLOPE, FOCUS = 50 * mm, 1 * mm, 1e-3, 1 * m
VIEWS, PIXELS, SENSOR = 7, 76, 22
DIAMETER = 6 * mm
MEANS = 5
"""Rays a pixel, each way, whose mean a sample is: cameras' pixels, so that borders are soft as theirs."""
PERIODS = np.array([4.2, 9.0, 30.0])
"""Of the textures, in samples of a view: the shortest is about a gap between views, where copies fall together."""


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
    # Nodes less than half a pixel apart in the widest blur, of 24 pixels across: three times as many change these
    # pictures by less than −77 dB of the peak, 10 dB and more below the errors that are asked for.
    stop = round_stop(DIAMETER, 24, 96)
    return ThinLensCamera(FOCAL_LENGTH, stop, sensor.z, sensor.shape, sensor.pitches[0]).picture(planes(near, far))


LENS = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=DIAMETER)


def decibels(image, expected, where):
    error = (image - expected)[where] / expected.max()
    return float(-10 * np.log10(np.mean(error**2)))


ROW, COLUMN = np.mgrid[:SENSOR, :SENSOR] - (SENSOR - 1) / 2
ACROSS = 0.8 * COLUMN + 0.6 * ROW
"""Pixels from the border's middle, to the side of the far plane (pictures are upside down)."""


def pictures(near, far, focus, ways=("none", "depth")):
    """By some ways; and the truth."""
    sensor = sensor_focused_on(focus)
    camera, lf = vcc.Camera([LENS], sensor), field(near, far)
    made = {how: camera.capture(lf, between_views=how, interpolation="cubic").values for how in ways}
    return made, truth(near, far, sensor)


@pytest.mark.filterwarnings("ignore:ghosting:vcc.errors.ResultWarning")
def test_behind_something_in_focus_there_are_no_ghosts():
    made, expected = pictures(0.0, -4.0, 0.0, ("none", "auto", "depth"))
    behind, before = ACROSS > 4, ACROSS < -4
    # In focus nothing is made in between that is not a view already: there both are the same picture.
    np.testing.assert_allclose(made["depth"][before], made["none"][before], rtol=1e-4)
    found = {how: decibels(image, expected, behind) for how, image in made.items()}
    print(found)
    # Parts of cells are 0.25 mm and a pixel apart: the midpoint rule's (π/4·1/9)²/6 of the 9-pixel wave, of which
    # the blur of 24 pixels leaves a tenth, is far below; cells cut by the rim leave some 1e-4 of the light: 65 dB.
    assert found["depth"] > 64
    assert found["none"] < 50
    np.testing.assert_array_equal(
        made["auto"], made["none"]
    )  # what is in focus forbids filling along one parallax


@pytest.mark.filterwarnings("ignore:ghosting:vcc.errors.ResultWarning")
@pytest.mark.parametrize(
    ("near", "far", "focus", "where"),
    [(4.0, 0.0, 0.0, ACROSS < -4), (2.0, -2.0, 0.3, ACROSS < 99), (4.0, -4.0, 0.0, ACROSS < 99)],
    ids=["far plane in focus: the near one", "little out of focus", "far out of focus"],
)
def test_before_something_else_there_are_no_ghosts_either(near, far, focus, where):
    made, expected = pictures(near, far, focus)
    found = {how: decibels(image, expected, where) for how, image in made.items()}
    print(found)
    # A pixel that a border cuts is taken for one side of it: the mean of the lesser share is ∫₀^½ c dc = 1/8 of a
    # pixel. Times a contrast of 0.2 of the peak, over a blur of 10 pixels (the narrowest here), that is 0.0025 or
    # 52 dB; the cubic's loss of the finest wave, of 1.5 radians a pixel, comes on top, where defocus leaves any.
    assert found["depth"] > 50
    assert found["depth"] > found["none"] + 5


def test_one_plane_out_of_focus_is_as_along_one_parallax():
    made, expected = pictures(2.5, 2.5, 0.0)
    found = {how: psnr(image, expected) for how, image in made.items()}
    print(found)
    assert found["depth"] > 55
    assert found["none"] < 50
