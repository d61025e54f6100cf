"""Where rays meet: focus, thin-lens equation, size of the blur, prism. The oracles are closed forms.

A ray that leaves a point at distance Z in front of the lens meets the plane d behind it at
x = u·(1 − d/f) + d·s, with s = u/Z + const: x = u·(1 − d/d') + const, 1/d' = 1/f − 1/Z.
"""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.base.units import m, mm, mrad

FOCAL_LENGTH = 50 * mm

# The sensors here are wider than the views' pictures, so as to catch everything, and the camera says so.
pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")


def parallel_light(views: int = 9, pixels: int = 15) -> vcc.LightField:
    """Light of one slope only: the same pixel is lit in every view, a little off the middle."""
    samples = np.zeros((views, views, pixels, pixels))
    samples[:, :, pixels // 2 + 2, pixels // 2 - 3] = 1.0
    return vcc.LightField.from_views(samples, 1 * mm, 2e-3, disparity_range=(0.0, 0.0))


def blob(distance: float, views: int, spacing: float, slope: float, pixels: int, sigma: float):
    """A Gaussian spot at a distance, ``sigma`` samples wide in each view: a point that samples can carry."""
    place = (np.arange(views) - (views - 1) / 2) * spacing
    angle = -(np.arange(pixels) - (pixels - 1) / 2) * slope
    # A point on the axis is seen by a view at u along the slope u/Z.
    profile = np.exp(-((angle - place[:, None] / distance) ** 2) / (2 * (sigma * slope) ** 2))
    samples = profile[:, None, :, None] * profile[None, :, None, :]
    return vcc.LightField.from_views(samples, spacing, slope, sample="point")


def moments(image: np.ndarray, pitch: float) -> tuple[float, float]:
    """Mean and variance of x over a picture, metres and m²."""
    x = (np.arange(image.shape[1]) - (image.shape[1] - 1) / 2) * pitch
    share = image.sum(axis=0, dtype=np.float64) / image.sum(dtype=np.float64)
    mean = (share * x).sum()
    return mean, (share * (x - mean) ** 2).sum()


@pytest.mark.parametrize("engine", ["numba", "reference", "array_api"])
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_parallel_light_meets_in_one_pixel_at_the_focal_length(engine, interpolation):
    lf = parallel_light()
    step = FOCAL_LENGTH * 2e-3
    # The lit pixel, 3 left of the middle and 2 below it, stands for the slopes (3, −2)·ps, hence meets the
    # sensor at (3, −2) steps: the middle of the sensor, whose pixels of 4 steps hold a tent of ±1.
    sensor = vcc.Sensor(z=FOCAL_LENGTH, shape=(11, 11), pitch=4 * step, decentre=(3 * step, -2 * step))
    image = vcc.Camera([vcc.Lens(focal_length=FOCAL_LENGTH)], sensor).capture(
        lf, engine=engine, interpolation=interpolation
    )
    assert np.count_nonzero(image.values) == 1
    assert image.values[5, 5] > 0
    assert image.values.sum() * image.pixel_area == pytest.approx(lf.flux, rel=1e-6)


@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic"])
def test_nothing_is_singular_at_the_focal_length(interpolation):
    rng = np.random.default_rng(1)
    lf = vcc.LightField.from_views(rng.random((5, 5, 12, 12)), 1 * mm, 2e-3, disparity_range=(0.0, 0.5))

    def capture(z: float) -> np.ndarray:
        # An even number of pixels of 0.93 steps: no pixel's middle lies half-way between two samples,
        # where nearest may fall to either side.
        sensor = vcc.Sensor(z=z, shape=(30, 30), pitch=0.93 * FOCAL_LENGTH * 2e-3)
        camera = vcc.Camera([vcc.Lens(focal_length=FOCAL_LENGTH)], sensor)
        return camera.capture(lf, interpolation=interpolation, between_views="none").values

    at_focus = capture(FOCAL_LENGTH)
    assert np.isfinite(at_focus).all()
    assert at_focus.max() > 0
    # One part in 1e9 moves the outermost samples by 1e-8 of a pixel: only float32 rounding is left.
    for nearby in (1 - 1e-9, 1 + 1e-9):
        np.testing.assert_allclose(capture(FOCAL_LENGTH * nearby), at_focus, rtol=0, atol=1e-6 * at_focus.max())


@pytest.mark.parametrize("engine", ["numba", "reference", "array_api"])
@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic"])
def test_nothing_is_singular_where_the_sensor_is_conjugate_to_the_view_plane(engine, interpolation):
    rng = np.random.default_rng(2)
    samples = rng.random((5, 7, 9, 11))
    spacing = 1 * mm
    lf = vcc.LightField.from_views(samples, spacing, 2e-3, disparity_range=(0.1, 0.2))
    # A lens 2f behind the views images them at 2f behind itself, upside down and as large: each view's
    # light falls into one point, x = −u.
    lens = vcc.Lens(focal_length=FOCAL_LENGTH, z=2 * FOCAL_LENGTH)
    sensor = vcc.Sensor(z=4 * FOCAL_LENGTH, shape=(5, 7), pitch=spacing)
    image = vcc.Camera([lens], sensor).capture(
        lf, engine=engine, interpolation=interpolation, between_views="none"
    )
    expected = samples.sum(axis=(2, 3))[::-1, ::-1] * lf.sample_volume / spacing**2
    np.testing.assert_allclose(image.values, expected, rtol=2e-6)  # float32 sums of 99 samples


@pytest.mark.parametrize(("interpolation", "footprint"), [("sharp", 0), ("linear", 1 / 6)])
@pytest.mark.parametrize("distance", [0.3 * m, 0.7 * m, 2 * m, 20 * m])
def test_sharpness_peaks_where_the_thin_lens_equation_says(distance, interpolation, footprint):
    slope, spacing = 1e-3, 0.5 * mm
    lf = blob(distance, 15, spacing, slope, 61, sigma=2.5)
    power = 1 / FOCAL_LENGTH - 1 / distance
    swept = power + np.linspace(-0.6, 0.6, 7) + 0.05  # 1/d, dioptres; the peak is none of them
    widths = []
    for inverse in swept:
        d = 1 / inverse
        # Pixels that see the same slope at every d, so that footprint and pixel add the same constant.
        sensor = vcc.Sensor(z=d, shape=(81, 81), pitch=d * slope)
        camera = vcc.Camera([vcc.Lens(focal_length=FOCAL_LENGTH)], sensor)
        image = camera.capture(lf, between_views="none", interpolation=interpolation).values
        widths.append(moments(image, d * slope)[1] / d**2)
    # variance/d² = Var(u)·(1/d − 1/d')² + constant: a parabola in 1/d, exactly. What disturbs it: the
    # aliasing of a Gaussian of 2.5 samples, exp(−2π²·2.5²) = 1e-54; its tails, cut at 6σ or more; float32.
    curvature, linear, constant = np.polyfit(swept, widths, 2)
    print(f"1/d' = {-linear / 2 / curvature:.6f}, 1/f − 1/Z = {power:.6f} dioptres")
    assert -linear / 2 / curvature == pytest.approx(power, abs=1e-4)
    place = (np.arange(15) - 7) * spacing
    assert curvature == pytest.approx(np.mean(place**2), rel=1e-3)
    # At the peak: the spot, 2.5² samples², the pixel, 1/12, and the tent of linear footprints, 1/6, which the
    # filter of sharp ones gives back whole: it is right to sixth order, a variance is of second. The rest is
    # float32, 1e-6 of variances of 8.5 samples² at most.
    sharpest = (constant - linear**2 / 4 / curvature) / slope**2
    assert sharpest == pytest.approx(2.5**2 + 1 / 12 + footprint, abs=1e-5)


@pytest.mark.parametrize("distance", [0.4 * m, 1 * m, 5 * m])
@pytest.mark.parametrize("offset", [-1.5, 1.5, 2.0])
def test_blur_has_the_diameter_of_the_aperture_times_the_defocus(distance, offset):
    views, spacing, slope = 41, 0.5 * mm, 1e-3
    diameter = 0.87 * views * spacing
    inverse = 1 / FOCAL_LENGTH - 1 / distance
    d = 1 / (inverse + offset)  # defocused by `offset` dioptres
    pitch = d * slope
    shift = np.abs(views * spacing / distance / slope)
    lf = blob(distance, views, spacing, slope, 2 * int(shift / 2) + 25, sigma=1.2)
    sensor = vcc.Sensor(z=d, shape=(81, 81), pitch=pitch)
    lens = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=diameter)
    image = vcc.Camera([lens], sensor).capture(lf, between_views="none").values.astype(np.float64)
    expected = diameter * abs(d * inverse - 1)  # A·|d/d' − 1|
    # Neighbouring views' spots lie at most 1 pixel apart: a smooth plateau. Its width at half height is
    # the disc's, less σ²/R for its curved rim: σ² = 1.2² + 1/6 + 1/12 (spot, tent, pixel) and a disc of
    # 26.7 pixels or more make that 0.5 % at worst.
    line = image[40]
    plateau = image[36:45, 36:45].mean()
    above = np.flatnonzero(line > plateau / 2)
    left, right = above[0], above[-1]
    start = left - (line[left] - plateau / 2) / (line[left] - line[left - 1])
    stop = right + (line[right] - plateau / 2) / (line[right] - line[right + 1])
    print(f"blur {(stop - start):.3f} pixels, A·|d/d' − 1| = {expected / pitch:.3f} pixels")
    assert (stop - start) * pitch == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("z", [0.0, 20 * mm])
@pytest.mark.parametrize("deflection", [(3 * mrad, 0.0), (-1.7 * mrad, 2.9 * mrad)])
def test_prism_shifts_every_ray_by_its_deflection_times_the_distance(z, deflection):
    d = 52 * mm
    lens = vcc.Lens(focal_length=FOCAL_LENGTH)
    sensor = vcc.Sensor(z=d, shape=(10, 10), pitch=50e-6)
    without = vcc.Camera([lens], sensor).rays_at(d)
    # Behind the lens' plane, so that no lens follows the prism.
    prism = vcc.Prism(deflection=deflection, z=z)
    moved = vcc.Camera([lens, prism], sensor).rays_at(d)
    rays = np.random.default_rng(0).normal(size=(20, 4)) * [5 * mm, 5 * mm, 0.1, 0.1]
    shift = np.array([*np.multiply(deflection, d - z), *deflection])
    np.testing.assert_allclose(moved(rays) - without(rays), np.tile(shift, (20, 1)), atol=1e-9 * 50e-6)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("inverse", [18.0, 20.0, 21.5])
def test_prism_shifts_the_picture_by_its_deflection_times_the_distance(inverse, interpolation):
    d = 1 / inverse
    slope = 1e-3
    # Pixels of 1.5 samples: the spot's replicas, which the tent leaves, lie 1/3 of a cycle a sample from
    # the pixels' frequency, where a spot of 2.5 samples holds exp(−2π²(2.5/3)²) = 1e-6.
    pitch = 1.5 * d * slope
    lf = blob(1 * m, 9, 0.5 * mm, slope, 41, sigma=2.5)
    sensor = vcc.Sensor(z=d, shape=(91, 91), pitch=pitch)
    lens = vcc.Lens(focal_length=FOCAL_LENGTH)
    deflection = (3.37 * 1.5 * slope, -5.61 * 1.5 * slope)
    centroids = []
    for elements in ([lens], [lens, vcc.Prism(deflection=deflection)]):
        image = vcc.Camera(elements, sensor).capture(lf, interpolation=interpolation).values
        centroids.append((moments(image, pitch)[0], moments(image.T, pitch)[0]))
    shift = np.subtract(centroids[1], centroids[0]) / pitch
    print(f"shift {shift} pixels")
    np.testing.assert_allclose(shift, [3.37, -5.61], atol=1e-4)  # deflection · d / pitch
