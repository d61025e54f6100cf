"""A camera whose lenses form no image says so: what capture warns of, and what explain says besides."""

import re
import warnings

import numpy as np
import pytest

import vcc
from vcc.analysis import sampling_advice
from vcc.optics import FirstOrder
from vcc.units import mm, um

SENSOR = vcc.Sensor(z=52 * mm, shape=(10, 15), pitch=0.9 * mm)
FIELD = vcc.LightField.from_views(np.full((5, 5, 8, 12), 0.5, np.float32), 4 * mm, 0.03)
NOTHING = "this camera forms no image"


def said(elements, sensor=SENSOR):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        vcc.Camera(elements, sensor).capture(FIELD)
    return "\n".join(str(each.message) for each in told)


DIVERGING = {
    "one lens": [vcc.Lens(-50 * mm, diameter=16 * mm)],
    "two lenses": [vcc.Lens(100 * mm, diameter=16 * mm), vcc.Lens(-40 * mm, z=5 * mm)],
    "a matrix": [FirstOrder(((1, 0), (20, 1)), entrance_diameter=16 * mm)],
    "one that magnifies": [vcc.Lens(60 * mm, diameter=16 * mm), vcc.Lens(-30 * mm, z=20 * mm)],
}


@pytest.mark.parametrize("case", DIVERGING)
def test_lenses_that_diverge_form_no_image(case):
    """1/f = 1/f₁ + 1/f₂ − d/(f₁f₂) below 0, and no intermediate image: light of no point meets behind them."""
    told = said(DIVERGING[case])
    assert NOTHING in told
    assert "Take a lens of positive focal length" in told
    assert ("was 50 mm meant?" in told) == (case in ("one lens", "a matrix"))
    explained = str(vcc.Camera(DIVERGING[case], SENSOR).explain(FIELD))
    assert "nothing before the camera is in focus" in explained
    assert NOTHING in explained
    # A distant point's light, 16 mm wide, is |A|·16 mm wide on the sensor: A = 1 + d/|f| = 2.04.
    assert case != "one lens" or "over 33 mm of the sensor's 13.5 mm × 9 mm" in told


FORMING = {
    "no lens": [vcc.Mask(vcc.patterns.Circle(16 * mm))],
    "a lens": [vcc.Lens(50 * mm, diameter=16 * mm)],
    "a telephoto": [vcc.Lens(60 * mm, diameter=16 * mm), vcc.Lens(-60 * mm, z=20 * mm)],
    "a relay, whose focal length is negative": [vcc.Lens(10 * mm, diameter=16 * mm), vcc.Lens(10 * mm, z=40 * mm)],
    "a pinhole": [vcc.Lens(-50 * mm), vcc.Mask(vcc.patterns.Circle(0.4 * mm))],
    "a code": [vcc.Lens(-50 * mm), vcc.Mask(np.eye(5), 16 * mm)],
    "lenslets": [
        vcc.Lens(-50 * mm, diameter=16 * mm),
        vcc.LensArray(pitch=2 * mm, focal_length=8 * mm, z=40 * mm),
    ],
    "a cylinder": [FirstOrder(np.eye(4) + np.diag([-20.0, 0], -2)), vcc.Lens(-100 * mm, diameter=16 * mm)],
}


@pytest.mark.parametrize("case", FORMING)
def test_cameras_that_form_one_are_left_alone(case):
    assert NOTHING not in said(FORMING[case])


def test_a_sensor_too_near_is_told_where_to_stand():
    camera = vcc.Camera(
        [vcc.Lens(50 * mm, diameter=16 * mm)], vcc.Sensor(z=48 * mm, shape=(10, 15), pitch=90 * um)
    )
    for text in (str(camera.explain(FIELD)), str(sampling_advice(camera, FIELD))):
        plain = re.sub(r"\s+", " ", text).lower()
        assert "the sensor stands 2 mm before the plane in which distant points are sharp, z = 50 mm" in plain
