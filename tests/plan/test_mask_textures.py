"""Textures of masks: the error of interpolating between their points, in closed form, and its warnings."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.plan.following import Follow
from vcc.plan.footprints.mask_textures import MaskMet, texture_error
from vcc.plan.footprints.planes import Plane
from vcc.plan.footprints.taps import CellDivision, Taps
from vcc.shapes import patterns


@pytest.mark.parametrize("points", [24, 40, 100])
def test_the_error_of_a_cosine_between_points(points):
    """For p points per period, ½·cos θ has third differences of (2 sin(π/p))³/2. For a third derivative d,
    splines err by d·f(¼ − f²)/6 at distance f from a point, d/√30240 root mean square. The largest value is
    1."""
    texture = 0.5 + 0.5 * np.cos(2 * np.pi * np.arange(20 * points + 1) / points)
    expected = (2 * math.sin(math.pi / points)) ** 3 / 2 / math.sqrt(2) / math.sqrt(30240)
    found = texture_error(np.repeat(texture[None], 9, axis=0).astype(np.float32))
    assert found == pytest.approx(expected, rel=0.01)
    assert texture_error(np.repeat(texture[:, None], 9, axis=1).astype(np.float32)) == pytest.approx(found)


@pytest.mark.parametrize("points", [24, 9, 5])
def test_what_is_looked_up_errs_by_what_is_told_of_it(points):
    """A cosine with known means over samples, looked up at random places.

    Splines that reproduce a cosine of ν = 1/p cycles per point add images of it with factors (ν/(ν + m))³, for
    all integers m ≠ 0. The plan reports the leading term, (2πν)³/√30240: 97 % of the error, 88 % and 70 %.
    """
    images = np.arange(-50, 51)[np.arange(-50, 51) != 0] + 1 / points
    told = (2 * np.pi) ** 3 / math.sqrt(30240) / math.sqrt((images**-6.0).sum())
    step, period = 3.0, float(points)  # a sample is as wide as three points, along x alone
    plane = Plane(patterns.CosineSum((period, math.inf)), "", (0, 0), np.diag([0, 0, step, 1e3])[2:], np.zeros(2))
    still = np.zeros((2, 2))
    taps = Taps.of((1, 1), CellDivision(1, False))
    met = MaskMet.of(plane, taps, np.zeros((1, 1, 2)), still, (5, 400), 1)
    lookup, _ = met.look_up(met.choices(Follow()))
    assert lookup.texture.dtype == np.float64
    assert lookup.step[0, 0] == pytest.approx(3)
    k = np.random.default_rng(0).uniform(10, 390, 4000)
    truth = 0.5 + 0.5 * np.sinc(step / period) * np.cos(2 * np.pi * step * k / period)
    error = np.sqrt(np.mean(np.square(lookup.weights(0, 0, k, np.array([2.0]))[0] - truth)))
    assert texture_error(lookup.texture) * lookup.texture.max() == pytest.approx(told * error, rel=0.03)


def test_flat_and_dark_textures_have_none():
    assert texture_error(np.full((8, 8), 0.3, np.float32)) == 0
    assert texture_error(np.zeros((1, 1), np.float32)) == 0


@pytest.mark.parametrize(("period", "told"), [(5 * um, True), (12 * um, False)])
def test_a_mask_too_fine_for_its_texture_is_told(period, told):
    """Of a cosine of 5 µm a period has 4.1 points in a texture of 3795, whose filter has raised its amplitude to
    0.635; of one of 12 µm it has the 9 that it needs."""
    light_field = vcc.LightField.from_views(
        np.ones((2, 2, 4, 1500), np.uint8), 0.1 * mm, 0.06 / 1000, math.inf, disparity_range=(0.0, 0.0)
    )
    mask = vcc.Mask(patterns.CosineSum((period, math.inf)), z=51 * mm, name="fine")
    camera = vcc.Camera([vcc.Lens(50 * mm), mask], vcc.Sensor(52 * mm, (4, 1500), 3 * um))
    cautions = camera.compile(light_field, method="footprints", refine=4).cautions
    notes = [caution for caution in cautions if "its texture" in caution]
    assert bool(notes) is told
    if told:
        assert "fine" in notes[0]
        said = float(notes[0].split(": ")[1].split("%")[0]) / 100
        assert said == pytest.approx(
            0.635 / 1.135 * (2 * math.sin(math.pi / 4.1)) ** 3 / math.sqrt(2 * 30240), rel=0.06
        )
