"""Diffraction of each depth: a defocused point behind a code against the angular spectrum, and two depths."""

import math
import re

import numpy as np
import pytest
import torch

import vcc
from tests.physics.test_diffraction import (
    GREEN,
    NEAR,
    SMALL,
    by_waves,
    camera_of,
    in_pixels,
    star,
)
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves
from vcc.torch import CameraModule
from vcc.units import mm, um


@pytest.mark.filterwarnings("ignore:diffraction=True is exact")
@pytest.mark.parametrize(
    ("kind", "waves", "left", "views"),
    [("disc", 2.0, 0.035, 15), ("code", 2.0, 0.025, 15), ("code", 3.9, 0.03, 14)],
)
def test_a_defocused_point_is_that_of_the_angular_spectrum(kind, waves, left, views):
    """What is left: views average the code over their cells, 1/15 of the stop, and kernels are interpolated over a
    quarter of a wave. By rays and one convolution, more than five times as much, 18 to 28 %. The middle one of 14
    views is beside the axis."""
    distance = 1 / (1 / NEAR - 8 * GREEN * waves / SMALL**2)
    pixel, size = 5, 101
    small = camera_of(kind, distance, pixel * um)
    truth = in_pixels(by_waves(kind, distance), pixel, size)
    light = star(small, side=301, views=views, width=SMALL)
    errors = {}
    for how in (False, True, "depth"):
        image = np.float64(small.capture(light, diffraction=how, scene_distance=math.inf).values)
        errors[how] = np.abs(image / image.sum() - truth / truth.sum()).sum() / 2
    assert errors["depth"] < left < errors[True] / 5


F, FOCUS, PITCH = 50 * mm, 1.0, 5 * um
D = 1 / (1 / F - 1 / FOCUS)
LENS = vcc.Camera([vcc.Lens(F, diameter=6 * mm, name="main")], vcc.Sensor(D, (41, 81), PITCH))
NEAR_PLANE = 1 / (1 / FOCUS + 8 * GREEN * 2 / (6 * mm) ** 2)
"""Two waves of defocus: a blur of 14 pixels."""


def seen(*planes, views=15):
    """A light field of planes, grey, with its disparities."""
    made = PlanesScene(planes).light_field(
        (views, views),
        (111, 151),
        spacing=6 * mm / views,
        slope_per_pixel=PITCH / D,
        focus_distance=FOCUS,
        dtype="f4",
    )
    depth = np.full((111, 151), made.disparity_of(planes[0].distance), np.float32)
    if len(planes) > 1:  # the nearer one covers the columns to the left of the axis
        depth[:, :75] = made.disparity_of(planes[1].distance)
    return vcc.LightField(
        np.ascontiguousarray(made.values[..., :1]), made.frame, wavelengths=[GREEN], disparity=depth
    )


def test_layers_far_from_an_edge_are_those_of_single_planes_and_light_is_conserved():
    """A plane in focus, half of it behind a nearer one: far from the edge, each half is the image of its plane.

    The blur ends 7 pixels from the edge; beyond 20 pixels, kernels have 1 % of their light."""
    period = 24 * PITCH / D
    far = TexturedPlane(Waves(period * FOCUS), FOCUS)
    alone = TexturedPlane(Waves(period * NEAR_PLANE), NEAR_PLANE, width=2.0, middle=(-0.5, 0.0))
    near = TexturedPlane(Waves(period * NEAR_PLANE), NEAR_PLANE, width=1.0, middle=(-0.5, 0.0))
    options = {"diffraction": "depth"}
    both, first, second = (
        np.float64(LENS.capture(light, **options).values[..., 0])
        for light in (seen(far, near), seen(far), seen(alone))
    )
    # Upside down on the sensor: what is on the left is on its right.
    for part, one in ((both[:, :20], first[:, :20]), (both[:, -20:], second[:, -20:])):
        assert np.abs(part - one).max() < 0.01 * one.max()
    stop = np.float64(LENS.capture(seen(far, near), diffraction=True).values)
    assert both.sum() == pytest.approx(stop.sum(), rel=2e-3)
    swept = vcc.sweep(LENS, seen(far, near), {"sensor.z": [D]}, **options)
    assert np.allclose(swept.pictures[0][..., 0], both, rtol=1e-5)
    # In focus there is nothing to change.
    assert np.allclose(first, LENS.capture(seen(far), diffraction=True).values[..., 0], rtol=1e-3)


@pytest.mark.filterwarnings("ignore:ghosting")
def test_what_is_not_by_waves_is_said_with_its_share():
    beyond = seen(TexturedPlane(Waves(1 * mm), 0.3))
    with pytest.warns(vcc.ResultWarning, match=r"100% of the scene is blurred by more than some 16 waves"):
        image = LENS.capture(beyond, diffraction="depth")
    assert np.array_equal(image.values, LENS.capture(beyond, diffraction=True).values)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda light: LENS.compile(light, diffraction="depth"), "belongs to images alone"),
        (lambda light: LENS.operator(light, diffraction="depth"), "belongs to images alone"),
        (lambda light: CameraModule(LENS, light, diffraction="depth"), "belongs to images alone"),
        (lambda light: LENS.capture(light, diffraction="depth", plan=3), "makes its own plan"),
        (
            lambda light: LENS.capture(light.replaced(torch.tensor(light.values)), diffraction="depth"),
            "it passes no gradients",
        ),
        (
            lambda light: LENS.replace(main=vcc.Lens(F, diameter=6 * mm, glass="N-BK7")).capture(
                light, diffraction="depth"
            ),
            "capture one band",
        ),
    ],
)
def test_what_it_cannot_do_is_refused(call, words):
    with pytest.raises(vcc.InputError, match=re.escape(words)):
        call(seen(TexturedPlane(Waves(1 * mm), FOCUS), views=3))
