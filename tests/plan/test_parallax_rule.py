"""The plan's choice between views, which does not depend on the plane in which the light field is given."""

import numpy as np
import pytest

import vcc
from vcc.base.units import mm


def light_field(disparity_range) -> vcc.LightField:
    values = np.random.default_rng(3).random((5, 5, 24, 24)).astype(np.float32)
    return vcc.LightField.from_views(values, 1 * mm, 0.01, 1.3, disparity_range)


@pytest.mark.parametrize("z", [45 * mm, 52 * mm, 120 * mm])
@pytest.mark.parametrize("disparity_range", [(-1.0, 1.0), (-2.5, -0.6), (0.3, 4.0)])
def test_a_field_taken_to_the_sensor_is_summed_as_the_camera_does(z, disparity_range):
    """The same rays in a plane behind the lens, where the scene's images lie on both sides of infinity."""
    field = light_field(disparity_range)
    sensor = vcc.Sensor(z=z, shape=(24, 24), pitch=0.01 * z)
    camera = vcc.Camera([vcc.Lens(50 * mm)], sensor)
    at_sensor = field.transformed(camera.rays_at(z))
    plan = camera.compile(field)
    moved = vcc.Camera([], vcc.Sensor(z=0.0, shape=(24, 24), pitch=0.01 * z)).compile(at_sensor)
    assert moved.smear == pytest.approx(plan.smear, abs=1e-9)
    assert moved.expected_ghosting == pytest.approx(plan.expected_ghosting, abs=1e-9)
    assert np.allclose(moved.core.x, plan.core.x)


def test_gaps_are_the_difference_between_disparity_and_focus():
    """Samples one pixel apart: the gap is |disparity − disparity in focus| pixels, here 0 in focus."""
    z = 52 * mm
    camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(z=z, shape=(24, 24), pitch=0.01 * z))
    field = light_field((-3.0, -2.0))
    in_focus = field.disparity_of(1 / (1 / (50 * mm) - 1 / z))
    plan = camera.compile(field)
    nearest, farthest = abs(-2.0 - in_focus), abs(-3.0 - in_focus)
    assert plan.smear[0] == pytest.approx(np.sqrt(nearest * farthest), rel=0.02)  # of 33 distances tried
    assert plan.smear[1] == pytest.approx(plan.smear[0], rel=1e-9)
