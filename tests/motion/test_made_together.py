"""Moments that share their work, here or elsewhere: the picture is the mean of those that still cameras capture.

Oracle: brute force, a capture of each midpoint by `vcc.Camera.capture` of the camera of that time, and their mean.
Single precision sums in another order differ by about 1e-7 of the brightest pixel; 1e-6 is asked for.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import vcc
from tests.physics.random_cameras import drawn
from vcc.learn.parameters import keys
from vcc.motion import LightFieldVideo, Lines, MovingCamera, Steps, moving_camera
from vcc.patterns import Circle, mura
from vcc.run import serialization
from vcc.store import save_store
from vcc.units import mm, ms

pytestmark = pytest.mark.filterwarnings("ignore::vcc.ResultWarning")

EXPOSURE = 8 * ms
NINE = 1e6
"""A tolerance that nine moments always meet."""
CAMERA = vcc.Camera(
    [vcc.Lens(50 * mm, name="main"), vcc.Mask(mura(5), width=8 * mm, name="code")],
    vcc.Sensor(52 * mm, (16, 20), 0.4 * mm),
)
SWEEP = MovingCamera(CAMERA, {"sensor.z": Lines([0, EXPOSURE], [51 * mm, 53 * mm])})
GLIDE = MovingCamera(CAMERA, {"code.decentre": lambda t: (t / EXPOSURE * mm, 0.0)})


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    values = np.random.default_rng(4).random((5, 5, 20, 22, 3), dtype=np.float32)
    made = vcc.LightField.from_views(values, spacing=2.4 * mm, slope_per_pixel=0.01)
    return save_store(made, tmp_path_factory.mktemp("motion") / "a.zarr")


def mean_of_captures(moving, light_field, **options):
    """Of nine midpoints: those of one, of three, of nine parts, each by rays of its own where there are any."""
    ninths = [4, 1, 7, 0, 2, 3, 5, 6, 8]
    pictures = [
        moving.at((n + 0.5) / 9 * EXPOSURE).capture(light_field, seed=seed, **options).values.astype(np.float64)
        for seed, n in enumerate(ninths)
    ]
    return np.mean(pictures, axis=0)


def assert_same(found, truth):
    np.testing.assert_allclose(found.values, truth, rtol=0, atol=1e-6 * truth.max())


def noted(monkeypatch):
    """The cameras that are captured together, or alone, from now on."""
    made, together, alone = [], moving_camera.captured_in_batches, vcc.Camera.capture

    def several(cameras, *given, **named):
        made.append(cameras)
        return together(cameras, *given, **named)

    monkeypatch.setattr(moving_camera, "captured_in_batches", several)
    monkeypatch.setattr(vcc.Camera, "capture", lambda one, *a, **n: made.append([one]) or alone(one, *a, **n))
    return made


def sizes(made):
    return [len(cameras) for cameras in made]


@pytest.mark.parametrize(("kind", "seed"), [("one mask", 2), ("two masks", 1), ("plate", 1)])
def test_random_cameras_that_move_are_the_mean_of_still_ones(kind, seed):
    case, random = drawn(kind, seed, pixels=8, views=5), np.random.default_rng(seed)
    courses = {"sensor.z": Lines([0, EXPOSURE], case.camera.sensor.z + random.uniform(0, 2 * mm, 2))}
    for name, element in keys(case.camera).items():
        if hasattr(element, "decentre"):
            ends = element.decentre + random.uniform(-1 * mm, 1 * mm, (2, 2))
            courses[f"{name}.decentre"] = Lines([0, EXPOSURE], ends)
    assert len(courses) > 1
    moving = MovingCamera(case.camera, courses)
    options = {"samples": 4} if case.camera.compile(case.light_field).by_rays else {}
    found = moving.capture(case.light_field, EXPOSURE, time_tolerance=NINE, **options)
    assert_same(found, mean_of_captures(moving, case.light_field, **options))


@pytest.mark.parametrize("options", [{}, {"method": "rays", "samples": 4}])
def test_an_executor_makes_the_same_picture(stored, options):
    here = GLIDE.capture(stored, EXPOSURE, time_tolerance=NINE, **options)
    assert_same(here, mean_of_captures(GLIDE, stored, **options))
    with ThreadPoolExecutor(2) as pool:
        found = GLIDE.capture(stored, EXPOSURE, time_tolerance=NINE, executor=pool, **options)
    assert_same(found, here.values)
    assert found.sampling_error == pytest.approx(here.sampling_error, rel=1e-3)
    assert found.missing_rays == pytest.approx(here.missing_rays, abs=1e-6)


def test_an_executor_takes_frames_of_a_video_and_small_light_fields_in_memory(stored):
    later = stored.read().replaced(stored.read().values[::-1].copy())
    video = LightFieldVideo([stored, later], [0, EXPOSURE])
    here = SWEEP.capture(video, EXPOSURE, time_tolerance=NINE)
    with ThreadPoolExecutor(1) as pool:
        found = SWEEP.capture(video, EXPOSURE, time_tolerance=NINE, executor=pool)
    assert_same(found, here.values)


def test_what_an_executor_cannot_do_is_refused(stored, monkeypatch):
    monkeypatch.setattr(serialization, "SENT", 1000)
    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(vcc.InputError, match="save_store"):
            SWEEP.capture(stored.read(), EXPOSURE, executor=pool)
        with pytest.raises(vcc.InputError, match="save_store"):
            SWEEP.capture(lambda t: stored.read(), EXPOSURE, executor=pool)
    with pytest.raises(vcc.InputError, match="not shut down"):
        SWEEP.capture(stored, EXPOSURE, executor=pool)
    with pytest.raises(vcc.InputError, match=r"concurrent\.futures\.Executor"):
        SWEEP.capture(stored, EXPOSURE, executor=2)


def test_a_store_is_read_once_for_moments_made_together(stored, monkeypatch):
    read, views = type(stored).linear_view, []
    monkeypatch.setattr(type(stored), "linear_view", lambda *given: views.append(1) or read(*given))
    whole = SWEEP.capture(stored, EXPOSURE, time_tolerance=NINE)
    once = 25
    assert len(views) <= 2 * once  # for the first moment, and for the eight others
    views.clear()
    in_pieces = SWEEP.capture(stored, EXPOSURE, time_tolerance=NINE, memory_limit=2.5e5)
    assert len(views) > 4 * once  # there is no room for all of it, and each moment reads what it looks at
    assert_same(in_pieces, whole.values)


def test_what_is_kept_and_made_together_is_bounded(stored, monkeypatch):
    field, made = stored.read(), noted(monkeypatch)
    whole = SWEEP.capture(field, EXPOSURE, time_tolerance=NINE)
    assert sizes(made) == [1, 8]
    made.clear()
    monkeypatch.setattr(moving_camera, "KEPT", 6 * 8 * whole.values.size)
    assert_same(SWEEP.capture(field, EXPOSURE, time_tolerance=NINE), whole.values)
    assert sizes(made) == [1, 3, 3, 2]
    monkeypatch.setattr(moving_camera, "KEPT", 0)
    assert_same(SWEEP.capture(field, EXPOSURE, time_tolerance=NINE), whole.values)


def test_states_that_come_again_are_made_once_in_whatever_company(stored, monkeypatch):
    """Three masks take turns while a video of two frames goes on: six pictures."""
    field, made = stored.read(), noted(monkeypatch)
    codes = [mura(5), Circle(6 * mm), 1 - mura(5)]
    moving = MovingCamera(CAMERA, {"code.pattern": Steps(np.arange(12) * ms, codes * 4)})
    moving.capture(LightFieldVideo([field, field.replaced(2 * field.values)], [0, 12 * ms]), 12 * ms)
    assert sum(sizes(made)) == 6
    assert len({camera for cameras in made for camera in cameras}) == 3
