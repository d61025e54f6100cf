"""A camera that asks for rays which the light field does not hold gets its picture, and is told the share.

Oracles: areas in closed form. The share is an estimate on a raster (128 points across the aperture, 24
across the sensor), so it is right to about one raster line of the border: 1/128 and 1/24 of it.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import vcc
from vcc.base.units import mm

FOCAL_LENGTH = 50 * mm


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
    with pytest.warns(vcc.ResultWarning, match=r"% of the rays .* aperture lies outside the grid of views"):
        image = capture(lens)
    print(f"missing {image.missing_rays:.4f}, closed form {expected:.4f}")
    # Four chords of the border, each right to half a raster step (diameter/128) over its length.
    chord = 2 * np.sqrt((diameter / 2) ** 2 - (5 * mm) ** 2)
    tolerance = 4 * chord * diameter / 128 / 2 / (np.pi * diameter**2 / 4)
    assert image.missing_rays == pytest.approx(expected, abs=tolerance)
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
    assert image.missing_rays == pytest.approx(expected, abs=2 * np.sqrt(12) / 128 / np.pi)
    kept = (16 * np.pi - segment) * mm**2
    np.testing.assert_allclose(image.values, 0.5 * kept / (50 * mm) ** 2, rtol=1e-5)


@pytest.mark.parametrize("pixels", [45, 60, 80])
def test_a_sensor_wider_than_the_pictures_misses_what_lies_outside(pixels):
    # At d = f every view's picture lies in one place: 40 samples of 0.1 mm on a sensor of `pixels`.
    expected = 1 - (40 / pixels) ** 2
    with pytest.warns(vcc.ResultWarning, match="of what the sensor sees lies outside the views' pictures"):
        image = capture(vcc.Lens(focal_length=FOCAL_LENGTH, diameter=8 * mm), pixels=pixels)
    print(f"missing {image.missing_rays:.4f}, closed form {expected:.4f}")
    # Each way the share is right to half of one of 24 raster steps at either border.
    assert image.missing_rays == pytest.approx(expected, abs=2 * (40 / pixels) / 24)
    middle = slice(pixels // 2 - 15, pixels // 2 + 15)
    np.testing.assert_allclose(
        image.values[middle, middle], 0.5 * np.pi * (4 * mm) ** 2 / (50 * mm) ** 2, rtol=1e-5
    )
    # 2.5 pixels beyond the corner the filter of the picture, which reaches as far as 2, still meets the last tent.
    assert abs(image.values[0, 0]) <= (0 if pixels > 45 else 1e-4 * image.values[pixels // 2, pixels // 2])


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
