"""Textures of masks: how much linear interpolation between their points loses, in closed form, and who is told."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.plan.footprints.mask_textures import texture_error
from vcc.shapes import patterns


@pytest.mark.parametrize("points", [24, 40, 100])
def test_the_error_of_a_cosine_between_points(points):
    """Of p points a period, ½·cos θ has the curvature (1 − cos(2π/p))·cos θ; of a curvature c, c/12 − c·a(1 − a)/2
    is left a of the way between two points, c/√720 root mean square. The largest value is 1."""
    texture = 0.5 + 0.5 * np.cos(2 * np.pi * np.arange(20 * points + 1) / points)
    expected = (1 - math.cos(2 * math.pi / points)) / math.sqrt(2) / math.sqrt(720)
    found = texture_error(np.repeat(texture[None], 9, axis=0).astype(np.float32))
    assert found == pytest.approx(expected, rel=0.01)
    assert texture_error(np.repeat(texture[:, None], 9, axis=1).astype(np.float32)) == pytest.approx(found)


def test_flat_and_dark_textures_have_none():
    assert texture_error(np.full((8, 8), 0.3, np.float32)) == 0
    assert texture_error(np.zeros((1, 1), np.float32)) == 0


@pytest.mark.parametrize(("period", "told"), [(12 * um, True), (400 * um, False)])
def test_a_mask_too_fine_for_its_texture_is_told(period, told):
    """1500 pixels of 3 µm in 3235 texture points: a cosine of 12 µm has 8.8 of them, whose curvature of 0.24
    leaves 0.64 % root mean square; one of 130 samples has all it needs."""
    light_field = vcc.LightField.from_views(
        np.ones((2, 2, 4, 1500), np.uint8), 0.1 * mm, 0.06 / 1000, math.inf, disparity_range=(0.0, 0.0)
    )
    mask = vcc.Mask(patterns.CosineSum((period, math.inf)), z=51 * mm, name="fine")
    camera = vcc.Camera([vcc.Lens(50 * mm), mask], vcc.Sensor(52 * mm, (4, 1500), 3 * um))
    notes = [note for note in camera.compile(light_field, method="footprints").notes if "its texture" in note]
    assert bool(notes) is told
    if told:
        assert "fine" in notes[0]
        said = float(notes[0].split(": ")[1].split("%")[0]) / 100
        assert said == pytest.approx((1 - math.cos(2 * math.pi / 8.8)) / math.sqrt(2 * 720), rel=0.15)
