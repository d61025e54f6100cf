"""If a camera needs rays that the light field does not have, the image is made and their share is reported.

Oracles: areas in closed form, and rays drawn here. The share is an estimate from 2^16 quasi-random rays. `EVEN`
is more than the error of such a set at a border: the border crosses some 4·2^12 of its boxes with sides of 2^-4,
each wrong by half a ray at random: 2^7/2^17; plus the error of the rays drawn here.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import vcc
from vcc.base.units import mm

FOCAL_LENGTH = 50 * mm
EVEN = 2e-3


def field(views: int = 10, pixels: int = 40) -> vcc.LightField:
    samples = np.full((views, views, pixels, pixels), 0.5, np.float32)
    return vcc.LightField.from_views(samples, 1 * mm, 2e-3, disparity_range=(0.0, 0.0))


def capture(lens: vcc.Lens, pixels: int = 10, pitch: float = 0.1 * mm, z: float = 50 * mm, **options):
    return vcc.Camera([lens], vcc.Sensor(z, (pixels, pixels), pitch)).capture(field(), **options)


def circle_in_square(diameter: float, side: float) -> float:
    """Area of a circle that lies inside a square around the same middle."""
    r, h = diameter / 2, side / 2
    if r <= h:
        return np.pi * r * r
    segment = r * r * np.arccos(h / r) - h * np.sqrt(r * r - h * h)
    return np.pi * r * r - 4 * segment


@pytest.mark.parametrize("diameter", [11 * mm, 12.5 * mm, 14 * mm])
def test_a_lens_wider_than_the_grid_of_views_misses_what_lies_outside(diameter):
    lens = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=diameter)
    expected = 1 - circle_in_square(diameter, 10 * mm) / (np.pi * diameter**2 / 4)
    with pytest.warns(
        vcc.ResultWarning, match=r"% of the rays .* lens at z = 0 mm lies outside the grid of views"
    ):
        image = capture(lens)
    print(f"missing {image.missing_rays:.4f}, closed form {expected:.4f}")
    assert image.missing_rays == pytest.approx(expected, abs=EVEN)
    # The picture is made of the rays that there are: the circle cut by the grid.
    light = 0.5 * circle_in_square(diameter, 10 * mm) / (50 * mm) ** 2
    np.testing.assert_allclose(image.values, light, rtol=1e-5)


def test_a_lens_as_wide_as_the_grid_misses_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        image = capture(vcc.Lens(focal_length=FOCAL_LENGTH, diameter=10 * mm))
    assert image.missing_rays == 0


@pytest.mark.parametrize("engine", ["numba", "reference", "array_api"])
def test_a_decentred_lens_misses_the_part_that_leaves_the_grid(engine):
    diameter, x = 8 * mm, 3 * mm
    lens = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=diameter, decentre=(x, 0.0))
    sensor = vcc.Sensor(50 * mm, (10, 10), 0.1 * mm, decentre=(x, 0.0))  # x·d/f: where it throws its picture
    # The right border cuts a segment off at 2 mm from the middle of a circle of radius 4 mm.
    segment = 16 * np.arccos(0.5) - 2 * np.sqrt(12)
    expected = segment / (16 * np.pi)
    with pytest.warns(vcc.ResultWarning, match="outside the grid of views"):
        image = vcc.Camera([lens], sensor).capture(field(), engine=engine)
    assert image.missing_rays == pytest.approx(expected, abs=EVEN)
    kept = (16 * np.pi - segment) * mm**2
    np.testing.assert_allclose(image.values, 0.5 * kept / (50 * mm) ** 2, rtol=1e-5)


@pytest.mark.parametrize("pixels", [45, 60, 80])
def test_a_sensor_wider_than_the_pictures_misses_what_lies_outside(pixels):
    # At d = f every view's picture lies in one place: 40 samples of 0.1 mm on a sensor of `pixels`.
    expected = 1 - (40 / pixels) ** 2
    with pytest.warns(vcc.ResultWarning, match="lies outside the views' pictures"):
        image = capture(vcc.Lens(focal_length=FOCAL_LENGTH, diameter=8 * mm), pixels=pixels)
    print(f"missing {image.missing_rays:.4f}, closed form {expected:.4f}")
    assert image.missing_rays == pytest.approx(expected, abs=EVEN)
    middle = slice(pixels // 2 - 15, pixels // 2 + 15)
    np.testing.assert_allclose(
        image.values[middle, middle], 0.5 * np.pi * (4 * mm) ** 2 / (50 * mm) ** 2, rtol=1e-5
    )
    # 2.5 pixels beyond the corner the filter of the picture, which reaches as far as 2, still meets the last tent.
    assert abs(image.values[0, 0]) <= (0 if pixels > 45 else 1e-4 * image.values[pixels // 2, pixels // 2])


@pytest.mark.parametrize("method", ["footprints", "rays"])
@pytest.mark.parametrize("z", [0.0, 0.01 * mm, 3 * mm])
def test_a_rim_anywhere_misses_what_lies_outside(z, method):
    """Views of 4.5 mm a side before a lens of 20 mm: the same share wherever the lens stands by a hair."""
    lf = vcc.LightField.from_views(np.ones((9, 9, 60, 60), np.float32), 0.5 * mm, 2e-3, disparity_range=(0.0, 0.0))
    camera = vcc.Camera(
        [vcc.Lens(FOCAL_LENGTH, diameter=20 * mm, z=z)], vcc.Sensor(50 * mm + z, (10, 10), 0.1 * mm)
    )
    with pytest.warns(vcc.ResultWarning, match="lies outside the grid of views"):
        image = camera.capture(lf, method=method)
    # At z = 3 mm rays of one direction, at most 0.01, shift by 30 µm of 4.5 mm: the area stays.
    assert image.missing_rays == pytest.approx(1 - 4.5**2 / (np.pi * 100), abs=EVEN)
    assert "missing" in str(camera.explain(lf, method=method))


def random_camera(seed: int) -> tuple[vcc.LightField, vcc.Camera]:
    """A lens with a rim, and often a round stop before or behind it; views and pictures often too small."""
    rng = np.random.default_rng(seed)

    def within(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    views, pixels = rng.integers(3, 10, 2), rng.integers(20, 60, 2)
    spacing, slope = within(0.5, 2) * mm, within(1, 3) * 1e-3
    lf = vcc.LightField.from_views(
        np.ones((*views, *pixels), np.float32),
        spacing,
        slope,
        within(0.5, 3) if rng.random() < 0.5 else np.inf,
        disparity_range=(0.0, 0.0),
    )
    z = within(0, 20) * mm
    off = (within(-1, 1) * mm, within(-1, 1) * mm)
    lens = vcc.Lens(within(40, 60) * mm, diameter=within(0.4, 1.6) * spacing * int(views.min()), z=z, decentre=off)
    elements: list[vcc.Element] = [lens]
    if rng.random() < 0.7:
        stop = vcc.patterns.Circle(within(0.4, 1.2) * lens.diameter)
        elements.append(vcc.Mask(stop, z=within(0, 30) * mm, decentre=(within(-1, 1) * mm, 0.0)))
    d = z + within(35, 60) * mm
    size = within(0.3, 1.2) * slope * 50 * mm * int(pixels.min())
    return lf, vcc.Camera(elements, vcc.Sensor(d, (12, 15), size / 15))


def missing_by_rays(lf: vcc.LightField, camera: vcc.Camera, number: int = 17) -> float:
    """The share of rays from the sensor through all stops that have no sample, traced one element at a time.

    2^17 rays meet borders in 4·2^12.75 boxes: they err by 2^6.4/2^17 = 6e-4, and with the plan's own 2^7/2^17 by
    1.2e-3 of all rays, within `EVEN`.
    """
    from scipy.stats import qmc

    sensor = camera.sensor
    lens = next(element for element in camera.elements if isinstance(element, vcc.Lens))
    points = qmc.Sobol(4, seed=7).random_base2(number) - 0.5
    place = points[:, :2] * np.array(sensor.size)[::-1]
    slope = (place - points[:, 2:] * lens.diameter - np.array(lens.decentre)) / (sensor.z - lens.z)
    at, passed = sensor.z, np.ones(len(points), bool)
    for element in sorted(camera.elements, key=lambda one: -one.z):
        place, at = place - (at - element.z) * slope, element.z
        from_middle = place - np.array(element.decentre)
        diameter = element.diameter if isinstance(element, vcc.Lens) else element.pattern.diameter
        passed &= np.hypot(*from_middle.T) <= diameter / 2
        if isinstance(element, vcc.Lens):
            slope = slope + from_middle / element.focal_length
    place = place - at * slope
    frame = lf.frame.matrix
    ray = np.column_stack([place, slope])[passed] - frame[:4, 4]
    index = ray @ np.linalg.inv(frame[:4, :4]).T
    count = np.array([lf.shape[1], lf.shape[0], lf.shape[3], lf.shape[2]])
    inside = ((index >= -0.5) & (index <= count - 0.5)).all(axis=1)
    return float(1 - inside.mean())


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
def test_random_cameras_miss_what_rays_miss():
    found = []
    for seed in range(20):
        lf, camera = random_camera(seed)
        plans = [camera.compile(lf, method=method).missing_rays for method in ("footprints", "rays")]
        found.append((*plans, missing_by_rays(lf, camera)))
    by_footprints, by_rays, truth = np.array(found).T
    assert 0.1 < (truth > 0.01).mean() < 0.95
    assert (truth == 0).any()
    np.testing.assert_array_equal(by_footprints, by_rays)
    np.testing.assert_allclose(by_footprints, truth, atol=EVEN)


def test_where_nothing_bounds_the_light_the_views_are_the_aperture():
    camera = vcc.Camera([vcc.Lens(FOCAL_LENGTH)], vcc.Sensor(50 * mm, (10, 10), 0.1 * mm))
    assert camera.compile(field()).missing_rays == 0
    assert "the grid of views is taken for the aperture" in " ".join(str(camera.explain(field())).split())


def test_a_picture_without_missing_rays_warns_of_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        image = capture(vcc.Lens(focal_length=FOCAL_LENGTH, diameter=8 * mm))
    assert image.missing_rays == 0


def test_a_sensor_where_views_fall_into_points_asks_for_no_particular_sample():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        image = capture(vcc.Lens(focal_length=FOCAL_LENGTH, diameter=8 * mm), z=0.0, pitch=1 * mm)
    assert image.missing_rays == 0
