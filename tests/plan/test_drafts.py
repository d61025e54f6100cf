"""Plans made quickly for a drag: how long their decisions last, and how much accuracy they cost."""

import numpy as np
import pytest

import vcc
from vcc.optics.train import Train
from vcc.plan.choice import compile_best
from vcc.plan.following import Draft, Parts
from vcc.run.drive import drive
from vcc.showcase.scene import demo_scene
from vcc.units import mm, um

LENS = vcc.Lens(focal_length=50 * mm, diameter=18 * mm)
SENSOR = vcc.Sensor(z=52 * mm, shape=(60, 60), pitch=200 * um)


@pytest.fixture(scope="module")
def light_field():
    return demo_scene().light_field((7, 7), (60, 60), spacing=2.8 * mm, slope_per_pixel=0.004, focus_distance=1.3)


def with_mask(pattern, width, z):
    return Train((LENS, vcc.Mask(pattern, width=width, z=z)), SENSOR)


def test_a_decision_lasts_for_so_many_drafts_and_only_for_drafts():
    made = []

    def decided(parts, of=1):
        with parts.keeping():
            return parts.decision("a", of, lambda: made.append(of) or len(made))

    drafts = Parts(None, Draft(lasting=3, error=0.01))
    assert [decided(drafts) for _ in range(7)] == [1, 1, 1, 2, 2, 2, 3]
    assert decided(drafts, of=2) == 4  # another kind of camera decides for itself
    assert [decided(Parts()) for _ in range(2)] == [5, 6]
    whole = Parts()
    assert [decided(whole) for _ in range(2)] == [7, 8]


@pytest.mark.parametrize("pattern", [vcc.patterns.mura(13), vcc.patterns.Circle(12 * mm)], ids=["code", "stop"])
def test_drafts_with_decisions_of_a_mask_elsewhere_err_by_less_than_they_may(light_field, pattern):
    # an error of a hundredth of the light in each pixel is 40 dB
    draft = Parts(None, Draft(lasting=20, error=0.01))
    for z in np.linspace(20 * mm, 30 * mm, 8):
        train = with_mask(pattern, 21 * mm, float(z))
        with draft.keeping():
            quick = compile_best(train, light_field.grid, None, draft)
        best = compile_best(train, light_field.grid)
        found, true = (drive(plan, light_field, None, None).values for plan in (quick, best))
        assert np.sqrt(np.mean((found - true) ** 2)) < 0.01 * true.max(), z


def test_drafts_of_a_camera_that_turns_do_not_keep_filters_along_its_rows(light_field):
    draft = Parts(None, Draft(lasting=20, error=0.01))
    for angle in (0.0, 0.1):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turned = vcc.FirstOrder(np.kron(np.eye(2), turn), z=1 * mm)  # of places and of slopes
        train = Train((LENS, turned), SENSOR)
        with draft.keeping():
            quick = compile_best(train, light_field.grid, None, draft)
        best = compile_best(train, light_field.grid)
        found, true = (drive(plan, light_field, None, None).values for plan in (quick, best))
        np.testing.assert_allclose(found, true, atol=1e-6 * true.max())


def test_drafts_through_a_real_lens_share_what_the_sensor_sees_of_its_pupil_and_lose_no_light():
    lens = vcc.load_lens("double-gauss-50mm", model="real", wavelength=540e-9)
    scene = demo_scene().light_field((5, 5), (40, 60), spacing=6 * mm, slope_per_pixel=0.01, focus_distance=1.3)
    even = scene.replaced(np.full(scene.values.shape, 0.5, np.float32))
    draft = Parts(None, Draft(lasting=20, error=0.01))
    camera = vcc.Camera([lens], vcc.Sensor(lens.length + 60 * mm, (24, 36), 1 * mm)).focused_at(1.3)
    for moved in (0.0, 0.3 * mm, 4 * mm):
        sensor = vcc.Sensor(camera.sensor.z + moved, (24, 36), 1 * mm)
        train = Train((lens,), sensor)
        with draft.keeping():
            quick = compile_best(train, even.grid, None, draft)
        best = compile_best(train, even.grid)
        found, true = (drive(plan, even, None, None) for plan in (quick, best))
        noise = 3 * (found.sampling_error + true.sampling_error) / np.sqrt(24 * 36)  # of the mean over pixels
        assert abs(found.values.mean() - true.values.mean()) < noise + 0.01 * true.values.mean()
    assert quick.core.aim.visible is not None
