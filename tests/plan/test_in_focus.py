"""Views are not blurred where the camera's own image of the near object shows that only it is seen."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.units import mm

PIXELS, SPACING, SLOPE = (60, 80), 5 * mm, 1e-3
FOCAL_LENGTH, FAR, NEAR = 50 * mm, 4.0, 4.0 / 3.0
"""Images of near points move by 2.5 pixels from view to view, those of far points not at all."""


def light_field(views: int = 5) -> tuple[vcc.LightField, vcc.LightField]:
    """A near rectangle, left of the middle and above it, in front of a far plane; and where it is alone."""
    moves = SPACING / SLOPE * (1 / NEAR - 1 / FAR)
    row, column = np.mgrid[: PIXELS[0], : PIXELS[1]]
    disparity = np.zeros((views, views, *PIXELS), np.float32)
    for j, i in np.ndindex(views, views):
        left, top = 20 - moves * (i - views // 2), 10 - moves * (j - views // 2)
        inside = (abs(column - left - 8) < 8) & (abs(row - top - 6) < 6)
        disparity[j, i][inside] = moves
    values = np.random.default_rng(2).random((views, views, *PIXELS)).astype(np.float32)
    near = (disparity > 0).astype(np.float32)
    whole = vcc.LightField.from_views(values, SPACING, SLOPE, FAR, disparity=disparity)
    return whole, vcc.LightField.from_views(near, SPACING, SLOPE, FAR, disparity=disparity)


def camera(distance: float, diameter: float = 25 * mm) -> vcc.Camera:
    to_sensor = 1 / (1 / FOCAL_LENGTH - 1 / distance)
    sensor = vcc.Sensor(to_sensor, (50, 66), to_sensor * SLOPE)
    return vcc.Camera([vcc.Lens(FOCAL_LENGTH, diameter)], sensor)


@pytest.mark.parametrize("diameter", [15 * mm, 25 * mm])
def test_what_is_veiled_by_something_near_is_not_in_focus(diameter):
    whole, near = light_field()
    plan = camera(FAR, diameter).compile(whole, between_views="depth")
    share = plan.in_focus.share
    veil = camera(FAR, diameter).capture(near, between_views="none").values
    assert share[veil > 0.02 * veil.max()].max() < 1e-6
    # As far as views at the corners of the stop would throw it, and some pixels.
    radius = int(np.ceil(2.5 * math.sqrt(2) * diameter / SPACING / 2)) + 3
    close = np.zeros_like(veil, bool)
    for row, column in np.argwhere(veil > 0.5 * veil.max()):
        close[max(row - radius, 0) : row + radius + 1, max(column - radius, 0) : column + radius + 1] = True
    assert 0.1 < (~close).mean() < 0.9
    assert share[~close].min() > 1 - 1e-6


def test_what_is_near_and_in_focus_is_and_what_is_behind_it_is_not():
    whole, near = light_field()
    share = camera(NEAR).compile(whole, between_views="depth").in_focus.share
    seen = camera(NEAR).capture(near, between_views="none", interpolation="linear").values
    seen /= seen.max()
    assert (share[seen > 0.99] == 1).all()
    border = (seen > 0.01) & (seen < 0.99)
    assert (share[(seen < 0.01)].mean()) < 0.1  # a sample beside the border counts with it
    assert border.mean() < 0.1


def test_the_picture_is_taken_from_either():
    whole, _ = light_field()
    optics = camera(NEAR)
    plan = optics.compile(whole, between_views="depth")
    assert f"{plan.in_focus.share.mean():.0%} of the picture is in focus" in " ".join(plan.notes)
    image = optics.capture(whole, between_views="depth").values
    plain = optics.capture(whole, between_views="none").values
    only = plan.in_focus.share == 1
    np.testing.assert_allclose(image[only], plain[only], atol=1e-6 * plain.max())
    assert np.abs(image - plain)[plan.in_focus.share == 0].max() > 0.01 * plain.max()


def test_a_scene_out_of_focus_has_nothing_of_it():
    whole, _ = light_field()
    assert camera(0.5).compile(whole, between_views="depth").in_focus is None
