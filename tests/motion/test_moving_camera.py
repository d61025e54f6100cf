"""Exposures of cameras and light that change, against closed forms of the integral over time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

import vcc
from vcc.motion import Function, LightFieldVideo, Lines, MovingCamera, Steps, coded
from vcc.patterns import Circle, mura
from vcc.sources import PlanesScene, TexturedPlane
from vcc.units import mm, ms

SENSOR = vcc.Sensor(z=52 * mm, shape=(20, 24), pitch=0.4 * mm)
MASK = vcc.Mask(mura(5), width=8 * mm, name="code")
CAMERA = vcc.Camera([vcc.Lens(50 * mm, name="main"), MASK], SENSOR)
COARSE = pytest.mark.filterwarnings("ignore::vcc.ResultWarning")  # a light field of noise in few views


def noise(seed):
    values = np.random.default_rng(seed).random((5, 5, 24, 26, 3), dtype=np.float32)
    return vcc.LightField.from_views(values, spacing=2.4 * mm, slope_per_pixel=0.01)


@pytest.fixture(scope="module")
def field():
    return noise(2)


def with_sensor_at(z):
    return vcc.Camera(CAMERA.elements, vcc.Sensor(z, SENSOR.shape, SENSOR.pitch))


# --- what is known of any exposure ---


@COARSE
def test_what_stands_still_is_the_picture_of_capture_to_the_last_bit(field):
    picture = MovingCamera(CAMERA).capture(field, 7 * ms)
    np.testing.assert_array_equal(picture.values, CAMERA.capture(field).values)
    assert picture.sampling_error == 0
    assert picture.camera == CAMERA
    traced = MovingCamera(CAMERA).capture(field, 7 * ms, method="rays", samples=4)
    alone = CAMERA.capture(field, method="rays", samples=4)
    np.testing.assert_array_equal(traced.values, alone.values)
    assert traced.sampling_error == pytest.approx(alone.sampling_error)
    assert traced.missing_rays == pytest.approx(alone.missing_rays)


@COARSE
def test_an_exposure_of_no_length_is_the_picture_of_its_moment(field):
    moving = MovingCamera(CAMERA, {"sensor.z": lambda t: 52 * mm + t}, Steps([0], [0.25]))
    moment = moving.capture(field, 0)
    np.testing.assert_array_equal(moment.values, CAMERA.capture(field).values / 4)
    video = LightFieldVideo([field, noise(3)], [0, 1 * ms])
    between = MovingCamera(CAMERA).capture(video, 0, start=0.25 * ms).values
    one, other = (CAMERA.capture(frame).values.astype(np.float64) for frame in video.frames)
    np.testing.assert_allclose(between, 0.75 * one + 0.25 * other, rtol=1e-6)
    with pytest.raises(vcc.InputError, match=r"0\.002 s is not within the video, from 0 s to 0\.001 s"):
        MovingCamera(CAMERA).capture(video, 0, start=2 * ms)


@COARSE
def test_a_mask_that_switches_gives_the_mean_of_both_pictures(field):
    codes = [mura(5), Circle(6 * mm)]
    moving = MovingCamera(CAMERA, {"code.pattern": Steps([0, 5 * ms], codes)})
    one, other = (vcc.sweep(CAMERA, field, {"code.pattern": [code]})[0].values for code in codes)
    mean = (one.astype(np.float64) + other) / 2
    np.testing.assert_allclose(moving.capture(field, 10 * ms).values, mean, rtol=1e-6)
    # A quarter of the time the first, and then the shutter is shut for the last tenth.
    shut = MovingCamera(CAMERA, moving.courses, Steps([0, 18 * ms], [1, 0])).capture(field, 20 * ms)
    np.testing.assert_allclose(shut.values, 0.25 * one + 0.65 * other.astype(np.float64), rtol=1e-6)


@COARSE
def test_what_switches_is_made_once_for_each_state(field, monkeypatch):
    made, capture = [], vcc.Camera.capture
    monkeypatch.setattr(vcc.Camera, "capture", lambda *given, **named: made.append(1) or capture(*given, **named))
    codes = [mura(5), Circle(6 * mm)] * 10
    MovingCamera(CAMERA, {"code.pattern": Steps(np.arange(20) * ms, codes)}, coded("0110", 20 * ms)).capture(
        field, 20 * ms
    )
    assert len(made) == 2


@COARSE
def test_a_sensor_that_moves_is_the_integral_over_its_places(field):
    moving = MovingCamera(CAMERA, {"sensor.z": lambda t: (51 + 100 * t) * mm})
    found = moving.capture(field, 20 * ms, time_tolerance=1e-3)
    # By Simpson's rule with another, finer spacing: the picture bends where pixels cross the edges of samples.
    places = np.linspace(51 * mm, 53 * mm, 51)
    weights = np.array([1, *[4, 2] * 24, 4, 1]) / 150
    simpson = sum(
        w * with_sensor_at(z).capture(field).values.astype(np.float64)
        for z, w in zip(places, weights, strict=True)
    )
    error = float(np.sqrt(np.mean((found.values - simpson) ** 2)))
    assert 0 < found.sampling_error <= 1e-3 * found.values.mean()
    assert error <= found.sampling_error + 1e-4 * found.values.mean()  # what Simpson's rule is off, and float32


@COARSE
def test_light_is_conserved(field):
    """All that passes the opening falls on a sensor that is large enough, wherever it goes meanwhile."""
    hole = vcc.Mask(Circle(4 * mm), name="hole")
    wide = vcc.Sensor(52 * mm, (60, 60), 0.4 * mm)
    camera = vcc.Camera([vcc.Lens(50 * mm, name="main"), hole], wide)
    still = camera.capture(field).values.sum(dtype=np.float64)
    moving = MovingCamera(camera, {"sensor.z": lambda t: 52 * mm + t / 5}, coded("1011", 10 * ms))
    swept = moving.capture(field, 10 * ms).values.sum(dtype=np.float64)
    assert swept == pytest.approx(0.75 * still, rel=1e-5)  # float32 pixels


# --- what moves before the camera ---

PERIOD, SPEED, DISTANCE = 60 * mm, 2.0, 1.0
PINHOLE = vcc.Camera([vcc.Mask(Circle(1 * mm)), vcc.Lens(50 * mm)], vcc.Sensor(50 * mm / 0.95, (4, 96), 0.1 * mm))


def wave_at(time):
    """Light of a plane of stripes that goes to the right, seen by 2×2 views that converge on it: all are alike."""
    slope = 0.1 / 50
    x = (np.arange(130) - 64.5) * slope * DISTANCE
    # The mean of stripes over a pixel
    k = 2 * math.pi / PERIOD
    contrast = math.sin(k * slope * DISTANCE / 2) / (k * slope * DISTANCE / 2)
    row = 0.5 + 0.5 * contrast * np.cos(k * (x - SPEED * time))
    views = np.broadcast_to(row.astype(np.float32), (2, 2, 12, 130))
    return vcc.LightField.from_views(np.ascontiguousarray(views), 1 * mm, slope, DISTANCE, (0.0, 0.0))


def contrast_of(picture):
    """Amplitude over mean, of stripes with a whole number of periods in the columns looked at."""
    row = picture.values[2].astype(np.float64)
    x = -PINHOLE.sensor.column_places * DISTANCE / PINHOLE.sensor.z
    k = 2 * math.pi / PERIOD
    basis = np.stack([np.ones_like(x), np.cos(k * x), np.sin(k * x)], axis=1)
    mean, cosine, sine = np.linalg.lstsq(basis, row, rcond=None)[0]
    return (cosine + 1j * sine) / mean


@pytest.mark.parametrize("code", ["1", "1101001"])
def test_what_moves_is_blurred_by_the_shutter(code):
    exposure = 20 * ms
    still = contrast_of(PINHOLE.capture(wave_at(0.0)))
    moving = MovingCamera(PINHOLE, shutter=coded(code, exposure))
    blurred = contrast_of(moving.capture(wave_at, exposure, start=3 * ms, time_tolerance=5e-4))
    # The transfer function of the shutter at the frequency with which stripes pass: a sum of boxes.
    w, chop = 2 * math.pi * SPEED / PERIOD, exposure / len(code)
    starts = 3 * ms + chop * np.array([n for n, letter in enumerate(code) if letter == "1"])
    transfer = np.mean((np.exp(1j * w * (starts + chop)) - np.exp(1j * w * starts)) / (1j * w * chop))
    # The tolerance is of the mean, and amplitudes are fitted to 96 pixels.
    assert blurred / still == pytest.approx(transfer, abs=1.5e-3 / abs(still))


def test_frames_in_between_are_mixed_exactly():
    """A video that is linear between frames: its exposure is the trapezoid rule over the frames, whole ones."""
    times = [0.0, 4 * ms, 10 * ms, 12 * ms]
    frames = [wave_at(time) for time in times]
    pictures = [PINHOLE.capture(frame).values.astype(np.float64) for frame in frames]
    found = MovingCamera(PINHOLE).capture(LightFieldVideo(frames, times), 10 * ms, start=1 * ms)
    # From 1 ms to 4 ms the share of frame 0 goes from 3/4 to 0; from 10 ms to 11 ms that of frame 3 from 0 to 1/2.
    by_hand = np.array([3 * 0.375, 3 * 0.625 + 6 * 0.5, 6 * 0.5 + 1 * 0.75, 1 * 0.25]) / 10
    assert by_hand.sum() == pytest.approx(1)
    truth = sum(share * picture for share, picture in zip(by_hand, pictures, strict=True))
    np.testing.assert_allclose(found.values, truth, rtol=1e-6)
    held = MovingCamera(PINHOLE).capture(LightFieldVideo(frames, times, "held"), 14 * ms)
    lasted = np.array([4, 6, 2, 2]) / 14  # the last one as long as the one before
    truth = sum(share * picture for share, picture in zip(lasted, pictures, strict=True))
    np.testing.assert_allclose(held.values, truth, rtol=1e-6)


def test_frames_may_be_stores(tmp_path):
    frames = [wave_at(0.0), wave_at(4 * ms)]
    stored = [vcc.store.save_store(frame, tmp_path / f"{n}.zarr") for n, frame in enumerate(frames)]
    found = MovingCamera(PINHOLE).capture(LightFieldVideo(stored, [0, 4 * ms]), 4 * ms)
    in_memory = MovingCamera(PINHOLE).capture(LightFieldVideo(frames, [0, 4 * ms]), 4 * ms)
    np.testing.assert_allclose(found.values, in_memory.values, rtol=1e-6)


@COARSE
def test_errors_of_rays_even_out_over_moments(field):
    """Each picture takes rays of its own: the error of the mean of two is that of both, over the root of two."""
    codes = [mura(5), 1 - mura(5)]
    moving = MovingCamera(CAMERA, {"code.pattern": Steps([0, 1 * ms], codes)})
    found = moving.capture(field, 2 * ms, method="rays", samples=8)
    alone = [moving.at(t).capture(field, method="rays", samples=8, seed=n) for n, t in enumerate([0, 1.5 * ms])]
    mean = (alone[0].values.astype(np.float64) + alone[1].values) / 2
    np.testing.assert_allclose(found.values, mean, rtol=1e-6)
    assert found.sampling_error == pytest.approx(
        math.hypot(*(each.sampling_error for each in alone)) / 2, rel=1e-6
    )


# --- a sweep through focus ---


@pytest.mark.filterwarnings("ignore:.*outside the views")
def test_a_point_is_spread_as_the_closed_form_of_a_focal_sweep_says():
    """Squares of the width b = a·|v − p|/v, integrated over the sensor's places p (Kuthirummal et al. 2011).

    They integrate discs; squares are what a grid of views before an open lens gives. At constant speed each side
    of focus gives ∫ dp/b² = v/a·∫ db/b² over the b between 2·max(|x|, |y|) and that at the end.
    """
    a, pitch, distance, fine = 8 * mm, 20e-6, 1.0, 9
    v = 1 / (1 / (50 * mm) - 1 / distance)
    views = np.zeros((41, 41, 37, 37), np.float32)
    views[:, :, 18, 18] = 1  # a square as large as a pixel of the sensor
    point = vcc.LightField.from_views(views, a / 41, pitch / v, distance, (0.0, 0.0))
    camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(v, (25, 25), pitch))
    low, high = v - 2 * mm, v + 2.6 * mm
    sweep = MovingCamera(camera, {"sensor.z": Lines([0, 0.1], [low, high])})
    crude = vcc.How(interpolation="nearest", between_views="none")
    found = sweep.capture(point, 0.1, crude, time_tolerance=0.3).values.astype(np.float64)
    places = (np.arange(25 * fine) - 12 * fine - fine // 2) * pitch / fine
    far = np.maximum(np.abs(places[:, None]), np.abs(places[None, :]))
    ends = [a * abs(v - p) / v for p in (low, high)]
    sides = [np.where(2 * far < end, 1 / np.maximum(2 * far, pitch / fine) - 1 / end, 0) for end in ends]
    truth = uniform_filter(uniform_filter((sides[0] + sides[1]) * v / a / (high - low), fine), fine)
    truth = truth[fine // 2 :: fine, fine // 2 :: fine]
    share = found / found.sum() / pitch**2
    # 81 moments put the edges of squares 0.4 pixels apart, and views half a pixel: the light of single pixels is
    # off by some per cent of what a square has there; in the middle 1/b² is cut off by the finest cell.
    distances = np.maximum(*np.abs(np.mgrid[-12:13, -12:13]))
    for ring in range(2, 7):
        at = distances == ring
        assert share[at].mean() == pytest.approx(truth[at].mean(), rel=0.02)
        np.testing.assert_allclose(share[at], truth[at], rtol=0.06)
    assert share[distances > max(ends) / pitch / 2 + 2].max() == 0


# --- what is refused and said ---


@pytest.mark.parametrize(
    ("courses", "shutter", "words"),
    [
        ({"sensor.x": lambda t: t}, None, "no parameter 'sensor.x'"),
        ({"sensor.z": 0.05}, None, "not a float"),
        ([("sensor.z", 1)], None, "must be a mapping"),
        ({"sensor.z": lambda t: -1.0}, None, "at 0 s"),
        ({}, "1101", "not a str"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(courses, shutter, words):
    with pytest.raises(vcc.InputError, match=words):
        MovingCamera(CAMERA, courses, shutter)


@COARSE
@pytest.mark.parametrize(
    ("moving", "exposure", "words"),
    [
        (MovingCamera(CAMERA), -1 * ms, "exposure"),
        (MovingCamera(CAMERA, shutter=lambda t: 2.0), 1 * ms, "the shutter at"),
        (MovingCamera(CAMERA, {"sensor.shape": Steps([0, 1e-3], [(20, 24), (5, 5)])}), 2 * ms, "must not change"),
        (MovingCamera(CAMERA, {"main.focal_length": lambda t: 50 * mm if t < 1 * ms else 0}), 2 * ms, "at 0.0"),
    ],
)
def test_an_exposure_that_cannot_be_is_refused(field, moving, exposure, words):
    with pytest.raises(vcc.InputError, match=words):
        moving.capture(field, exposure)


def test_light_that_is_not_there_is_refused(field):
    video = LightFieldVideo([field, field], [0, 1 * ms])
    with pytest.raises(vcc.InputError, match=r"the video from 0 s to 0.001 s"):
        MovingCamera(CAMERA).capture(video, 2 * ms)
    with pytest.raises(vcc.InputError, match=r"invalid value at 0\.\d+ s"):
        MovingCamera(CAMERA).capture(lambda t: None, 2 * ms)
    with pytest.raises(vcc.InputError, match="ascend"):
        LightFieldVideo([field, field], [1 * ms, 0])
    with pytest.raises(vcc.InputError, match="a time for each"):
        LightFieldVideo([field, field], [1 * ms])
    with pytest.raises(vcc.InputError, match="0 and 1"):
        coded("12", 1 * ms)
    with pytest.raises(vcc.InputError, match="ascend"):
        Steps([1, 0], ["a", "b"])
    with pytest.raises(vcc.InputError, match="equally many"):
        Lines([0, 1], [1])


def test_a_jump_that_nobody_told_of_is_said_and_one_that_was_is_exact(field):
    def jumps(time):
        return 0.0 if time < 7.3 * ms else 1.0

    with pytest.warns(vcc.ResultWarning, match="estimated"):
        MovingCamera(PINHOLE, shutter=jumps).capture(wave_at(0), 10 * ms, time_tolerance=1e-5)
    told = MovingCamera(PINHOLE, shutter=Function(jumps, (7.3 * ms,))).capture(wave_at(0), 10 * ms)
    np.testing.assert_allclose(told.values, 0.27 * PINHOLE.capture(wave_at(0)).values, rtol=1e-6)


def test_planes_that_move_are_a_function_of_time():
    """As the docs have it: a scene is a function of seconds."""

    def scene(time):
        plane = TexturedPlane(vcc.sources.textures.Uniform(1.0), 1.0, width=0.1, middle=(time, 0.0))
        return PlanesScene([plane]).light_field((2, 2), (20, 40), spacing=1 * mm, slope_per_pixel=0.01)

    camera = vcc.Camera([vcc.Lens(50 * mm), vcc.Mask(Circle(2 * mm))], vcc.Sensor(50 * mm, (10, 40), 0.5 * mm))
    found = MovingCamera(camera).capture(scene, 0.1, start=-0.05).upright().values[5, :, 0]
    # A box of 0.1 m that goes 0.1 m is a triangle, 20 pixels wide; pixels are 1/10 of either.
    triangle = np.clip(1 - np.abs(np.arange(40) - 19.5) / 10, 0, None)
    np.testing.assert_allclose(found / found.max() * triangle.max(), triangle, atol=0.03)
