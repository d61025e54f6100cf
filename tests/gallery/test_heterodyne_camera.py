"""The heterodyne camera of the gallery, on a small scene of two depths that is known in closed form.

Its filter and its true views are tested in tests/recover/test_heterodyne_band.py, its decoder, the cost of detail
that does not fit and the noise in tests/recover/test_heterodyne.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.gallery import heterodyne
from vcc.gallery.entry import bench_for, silent
from vcc.recover.heterodyne import HeterodyneGeometry
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

NEAR, FAR, CONVERGENCE = 0.8, 2.0, 1.2
VIEWS, PIXELS, SLOPE = 10, 96, 0.4 / 96
TILE = 24
"""Pixels of a view: as few as the camera takes."""
SCENE = PlanesScene([TexturedPlane(Waves(0.05), NEAR, width=0.16), TexturedPlane(Waves(0.15, seed=1), FAR)])


def seen_by_views(count: int = VIEWS, pixels: int = PIXELS) -> vcc.LightField:
    return SCENE.light_field(
        (count, count),
        (pixels, pixels),
        spacing=20 * mm / count,
        slope_per_pixel=SLOPE * PIXELS / pixels,
        focus_distance=CONVERGENCE,
        dtype="float32",
    )


@pytest.fixture(scope="module")
def bench():
    return replace(bench_for(seen_by_views()), scene=SCENE)


@pytest.fixture(scope="module")
def result():
    """Of someone's own light field: the scene is not known."""
    return heterodyne.Run(tile=TILE, calibration_rays=16)(bench_for(seen_by_views(9)), silent)


def finding(result, begins: str):
    (found,) = [number for number in result.numbers if number.what.startswith(begins)]
    print(found.what, found.measured)
    return found


def test_tiles_fill_the_spectrum_and_one_period_the_stop(bench):
    camera = heterodyne.designed(bench, bench.light_field)
    geometry = HeterodyneGeometry.of(camera)
    assert geometry.views == 9
    assert geometry.carrier[0] * 9 * camera.sensor.pitches[1] == pytest.approx(1, rel=1e-9)
    assert geometry.aperture_period == pytest.approx((20 * mm, 20 * mm), rel=1e-9)
    mask = camera.elements[-1]
    # Similar triangles: one period of the mask, from a point on the sensor, covers the stop.
    gap = camera.sensor.z - mask.z
    assert mask.pattern.periods[0] * camera.sensor.z / gap == pytest.approx(20 * mm, rel=1e-9)


def test_a_scene_that_fits_is_decoded_to_the_views_that_it_came_from(result):
    assert result.reached
    fitting = finding(result, "scene that fits the tiles").value
    assert fitting > 30
    assert finding(result, "scene that fits, with photon noise").value < fitting
    assert finding(result, "light that").value == pytest.approx(0.25, rel=0.01)
    assert sum("refocused" in number.what for number in result.numbers) == 3
    assert "own views" in result.text


def test_views_are_what_pinholes_at_their_own_places_see(bench):
    """And not at the opposite ones: by the triangle inequality they are nearer to views less than half as far."""
    camera = heterodyne.designed(bench, bench.light_field, 36)
    calibration = vcc.recover.heterodyne_calibration(camera, samples=16)
    image = heterodyne.recorded(camera, vcc.recover.band_limited(bench.light_field, camera))
    decoded = vcc.recover.decode_heterodyne(image, camera, calibration=calibration, border=heterodyne.BORDER)
    truth = vcc.recover.true_views(heterodyne.equally_sampled(bench, bench.light_field, camera), camera, decoded)
    assert heterodyne.view_decibels(decoded, truth, float(truth.values.max()))[1:-1, 1:-1].mean() > 30
    for axis, end in enumerate(((1, 4), (4, 1))):
        opposite = np.flip(truth.values, axis)[end]
        error = np.linalg.norm(decoded.values[end] - truth.values[end])
        apart = np.linalg.norm(opposite - truth.values[end])
        print(f"off by {error / apart:.2f} of how far opposite views are apart")
        assert error < apart / 2


def test_fewer_views_than_the_camera_tells_apart_are_refused():
    with pytest.raises(vcc.InputError, match="9×9 views or more"):
        heterodyne.ENTRY.run(seen_by_views(8))


def test_views_of_few_pixels_are_refused():
    with pytest.raises(vcc.InputError, match="too small"):
        heterodyne.ENTRY.run(seen_by_views(9, 40))
