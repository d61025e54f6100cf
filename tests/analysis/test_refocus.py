"""Refocusing by slices of the spectrum against the integral over views of a scene known everywhere."""

import re

import numpy as np
import pytest

import vcc
from vcc.analysis import Refocuser
from vcc.base.measures import psnr
from vcc.base.units import mm

DV, DU, PT, PS = 2 * mm, 2.5 * mm, 2.4e-3, 2e-3
PIXELS = (58, 65)
"""Rows and columns of a view."""
NEAR, FAR, FOCUS = 0.7, 2.2, 1.2
"""Metres: a sheet that is half clear, one behind it, and where the views converge."""


def radiance(u, v, s, t):
    """Two sheets of a few cosines, the nearer one seen through: no finer than 1/5 cycle a pixel of a view."""
    found = 0.5
    for distance, waves in ((NEAR, ((55, 20, 0.1), (-30, 70, 2.0))), (FAR, ((25, 12, 0.7), (-8, 21, 1.3)))):
        x, y = u - distance * s, v - distance * t
        for fx, fy, phase in waves:
            found = found + 0.1 * np.cos(2 * np.pi * (fx * x + fy * y) + phase)
    return found


def rays(views, row, column, at=None):
    """(u, v, s, t) of a view's pixels (fractional views too), `at` pixels (l, k) or at its own."""
    l, k = np.meshgrid(np.arange(PIXELS[0]), np.arange(PIXELS[1]), indexing="ij") if at is None else at
    u, v = (column - (views[1] - 1) / 2) * DU, (row - (views[0] - 1) / 2) * DV
    return u, v, u / FOCUS - (k - (PIXELS[1] - 1) / 2) * PS, v / FOCUS - (l - (PIXELS[0] - 1) / 2) * PT


def light_field(views):
    samples = np.array([[radiance(*rays(views, j, i)) for i in range(views[1])] for j in range(views[0])])
    return vcc.LightField.from_views(samples, (DV, DU), (PT, PS), FOCUS, sample="point")


def integral(views, distance, weights=None):
    """The mean over views of the rays that meet at each place of the plane in focus: no sample is interpolated."""
    weights = np.ones(views) if weights is None else weights
    u0, v0, s0, t0 = rays(views, (views[0] - 1) / 2, (views[1] - 1) / 2)
    total = 0.0
    for j, i in np.ndindex(*views):
        u, v, _, _ = rays(views, j, i)
        total = total + weights[j, i] * radiance(u, v, s0 + (u - u0) / distance, t0 + (v - v0) / distance)
    return total / weights.sum()


def inner_psnr(found, truth, border):
    rows, columns = border
    inside = np.s_[rows : found.shape[0] - rows, columns : found.shape[1] - columns]
    return psnr(found[inside], truth[inside], truth.max())


BESIDE = 6
"""Pixels beyond `margin` left out at the borders: there the transform rings where it does not know the scene."""


@pytest.mark.parametrize("views", [(7, 9), (8, 6), (2, 3), (1, 5)])
@pytest.mark.parametrize("distance", [NEAR, 1.0, FOCUS, FAR, np.inf])
def test_slices_agree_with_the_integral_over_views(views, distance):
    refocuser = Refocuser(light_field(views))
    image = refocuser.at(distance)
    reached = inner_psnr(image.values, integral(views, distance), np.add(refocuser.margin(distance), BESIDE))
    print(f"{views} views, {distance} m: {reached:.1f} dB")
    assert image.values.dtype == np.float32
    assert reached >= 45  # what the method was asked for


def test_gridding_is_as_good_as_its_kernel():
    """A scene that repeats with the picture has no borders: left is the kernel's error, 5e-6, and float32's."""
    views, waves = (9, 8), ((5, 3), (-7, 9))
    l, k = np.meshgrid(np.arange(60), np.arange(64), indexing="ij")
    shift = 0.37  # pixels per view: of a point at 1/Z = 0.37·PS/DU

    def picture(j, i):
        x, y = (k + shift * (i - 3.5)) / 64, (l + shift * (j - 4)) / 60
        return 0.5 + 0.1 * sum(np.cos(2 * np.pi * (a * x + b * y)) for a, b in waves)

    samples = np.array([[picture(j, i) for i in range(views[1])] for j in range(views[0])])
    refocuser = Refocuser(vcc.LightField.from_views(samples, DU, PS, sample="point"), border=0)
    sharp = refocuser.at(DU / (shift * PS))
    assert np.abs(sharp.values - picture(4, 3.5)).max() < 1e-5
    # At another distance every wave is dimmed by the Dirichlet kernel of the views.
    other = shift - 0.21

    def dirichlet(count, x):
        return np.sin(np.pi * count * x) / (count * np.sin(np.pi * x))

    blurred = 0.5 + 0.1 * sum(
        dirichlet(8, 0.21 * a / 64) * dirichlet(9, 0.21 * b / 60) * np.cos(2 * np.pi * (a * k / 64 + b * l / 60))
        for a, b in waves
    )
    found = refocuser.at(DU / (other * PS))
    assert np.abs(found.values - blurred).max() < 1e-5


def test_the_ideal_camera_focused_there_records_the_same():
    """A lens that the views fill, a sensor where it images the distance, pixels that see a view's pixels."""
    views, f = (9, 9), 50 * mm
    field = light_field(views)
    refocuser = Refocuser(field)
    for distance in (NEAR, 1.0, FAR):
        d = 1 / (1 / f - 1 / distance)
        # Sharper than a view's pixels is not asked for: what the sensor's see is small, as that of a point.
        # It is smaller than the pictures by 10 pixels on each side, which hold all that it asks for.
        inside = (PIXELS[0] - 20, PIXELS[1] - 20)
        sensor = vcc.Sensor(z=d, shape=inside, pitch=(PT * d, PS * d), fill_factor=1e-4)
        camera = vcc.Camera([vcc.Lens(focal_length=f)], sensor)
        image = camera.capture(field, interpolation="cubic", between_views="none").upright()
        mean = image.values / (views[0] * DV * views[1] * DU / d**2)
        reached = inner_psnr(refocuser.at(distance).values[10:-10, 10:-10], mean, (0, 0))
        print(f"camera focused at {distance} m: {reached:.1f} dB")
        assert reached >= 45


def test_weights_channels_and_integers():
    views = (5, 6)
    field = light_field(views)
    weights = np.random.default_rng(1).random(views)
    refocuser = Refocuser(field, weights)
    truth = integral(views, 1.0, weights)
    assert inner_psnr(refocuser.at(1.0).values, truth, np.add(refocuser.margin(1.0), BESIDE)) >= 45
    coloured = (field.values[..., None] * np.array([1.0, 0.5, 0.25]) * 255).round().astype(np.uint8)
    image = Refocuser(field.replaced(coloured), weights).at(1.0)
    assert image.shape == (*PIXELS, 3)
    # Rounding to 8 bits: 1/255/√12 in each view, less in their mean.
    np.testing.assert_allclose(image.values[..., 0], 2 * image.values[..., 1], atol=6 / 255)
    np.testing.assert_allclose(image.values[10:-10, 10:-10, 0], truth[10:-10, 10:-10], atol=2 / 255)


def test_a_general_frame_is_refocused_too():
    """Views on a turned grid: the shift from view to view is a matrix."""
    angle = 0.4
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    matrix = np.zeros((5, 5))
    matrix[:2, :2], matrix[2:4, :2], matrix[2:4, 2:4] = turn * DU, turn * DU / FOCUS, -np.eye(2) * PS
    matrix[4, 4] = 1
    frame = vcc.Affine(matrix) @ vcc.Affine.translation(-3.0, -3.0, -30.0, -28.0)
    index = np.stack(np.meshgrid(*map(np.arange, (7, 7, 57, 61)), indexing="ij"), axis=-1)[..., [1, 0, 3, 2]]
    field = vcc.LightField(radiance(*np.moveaxis(frame(index), -1, 0)), frame, sample="point")
    _, _, s0, t0 = np.moveaxis(frame(index[3, 3]), -1, 0)
    for distance in (NEAR, FAR):
        places = frame(index[:, :, 0, 0])[..., :2].reshape(-1, 2)
        truth = np.mean([radiance(u, v, s0 + u / distance, t0 + v / distance) for u, v in places], axis=0)
        refocuser = Refocuser(field)
        assert inner_psnr(refocuser.at(distance).values, truth, np.add(refocuser.margin(distance), BESIDE)) >= 45
        assert abs(refocuser.shift(distance)[0, 1]) > 0.1


def test_pictures_lie_where_views_look():
    field = light_field((3, 5))
    assert Refocuser(field).at(1.0).frame.isclose(field.view(1, 2).frame)
    assert not Refocuser(field).at(1.0).inverted


def test_the_work_of_a_focus_does_not_grow_with_the_views():
    """What is read of the transform: 6×6 values a frequency, however many views there are."""
    from vcc.analysis.refocus import TAPS, _ViewAxis

    for views in (2, 9, 50):
        assert len(_ViewAxis(views).taps(np.zeros((3, 3)))) == TAPS


def test_what_is_refused():
    field = light_field((2, 2))

    def refused(words):
        return pytest.raises(vcc.InputError, match=re.escape(words))

    with refused("the transform for refocusing of shape 1×90×49×6×6 needs 1.211 MiB"):
        Refocuser(field, memory_limit=1000)
    with refused("weights of views have the shape"):
        Refocuser(field, np.ones(3))
    with refused("not all 0"):
        Refocuser(field, np.zeros((2, 2)))
    with refused("border is"):
        Refocuser(field, border=-1)
    with refused("pass stored.read()"):
        Refocuser("views")
    refocuser = Refocuser(field)
    for distance in (0, -1.0, np.nan):
        with refused("greater than 0 m"):
            refocuser.at(distance)
    # Behind a lens that images the pixels of each view onto one place at 40 mm before it: all see the same there.
    behind = field.transformed(vcc.Affine.propagation(40 * mm))
    with refused("see one place"):
        Refocuser(behind).at(40 * mm)
