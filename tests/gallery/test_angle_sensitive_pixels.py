"""Angle-sensitive pixels of the gallery against closed forms of a white scene, of planes and of the formula."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.gallery import angle_sensitive_camera as gallery
from vcc.gallery import angle_sensitive_pixels as entry
from vcc.gallery.entry import bench_for, silent
from vcc.showcase.bench import Bench
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

FOCUS, DISTANCE, VIEWS, PIXELS, SLOPE = 1.2, 0.8, 12, 72, 0.005
TO_SENSOR = 1 / (1 / (50 * mm) - 1 / FOCUS)
STOP = 20 * mm * 3 / 4
"""Nine of the views across: three for each decoded one."""


def seen_by_views(scene: PlanesScene) -> vcc.LightField:
    return scene.light_field(
        (VIEWS, VIEWS),
        (PIXELS, PIXELS),
        spacing=20 * mm / VIEWS,
        slope_per_pixel=SLOPE,
        focus_distance=FOCUS,
        dtype="float32",
    )


def camera_for(light_field: vcc.LightField) -> gallery.AngleSensitive:
    pitch = 0.9 * SLOPE * TO_SENSOR
    return gallery.designed(Bench(light_field, None, DISTANCE, FOCUS, 2.0, 50 * mm, STOP, (pitch, pitch)), 200)


@pytest.fixture(scope="module")
def camera() -> gallery.AngleSensitive:
    """A plane before what is in focus, of waves that are long for tiles."""
    return camera_for(seen_by_views(PlanesScene([TexturedPlane(Waves(0.09), DISTANCE)])))


@pytest.fixture(scope="module")
def decoded(camera) -> vcc.LightField:
    return camera.decoded(gallery.captured(camera.camera, camera.bench.light_field))


def off(views, truth) -> float:
    inner = np.s_[:, :, 4:-4, 4:-4]
    return float(np.sqrt(np.mean((np.asarray(views)[inner] - np.asarray(truth)[inner]) ** 2)))


def test_pixels_respond_as_the_formula_by_hand(camera):
    angles, measured, _ = gallery.measured_responses(camera)
    for phase, places, values in zip((0, math.pi, math.pi / 2, 3 * math.pi / 2), angles, measured, strict=True):
        expected = (1 + 0.8 * np.cos(camera.frequency * places + phase)) / 2
        # A pinhole and a pixel, 0.004 and 0.006 of slope, take less than (β·0.004)²/24 + (β·0.006)²/24 = 0.1 % off
        # the fringes of β = 22, and a sample of the white scene less.
        np.testing.assert_allclose(values, expected, atol=0.002)


def test_the_lowest_frequency_has_one_period_over_the_aperture(camera):
    edge = math.atan(STOP / 2 / TO_SENSOR)
    assert camera.frequency * 2 * edge == pytest.approx(2 * math.pi)
    # Harmonics (0, 1), (1, 0) and (1, ±1) are as many numbers as views: least squares have one solution.
    a = camera.responses(0)[0]
    assert a.shape == (16, 9)
    assert np.linalg.cond(a) < 15


def test_a_white_scene_is_decoded_to_white_views(camera):
    white = seen_by_views(PlanesScene([TexturedPlane(Waves(0.09), DISTANCE)]))
    white = white.replaced(np.ones(white.shape, np.float32))
    image = gallery.captured(camera.camera, white)
    # All phases of a grating sum to two pixels that pass all light.
    tiles = camera.radiance(image)[16:-16, 16:-16].reshape(-1, 4, camera.tiles[1] - 8, 4, 3)
    np.testing.assert_allclose(tiles.mean(axis=(1, 3)), 0.5, atol=0.002)
    # The light field's cells are a ninth of the aperture wide: their means of the fringes are those of rays to a
    # sample's middle within (2π/9)²/24 = 2 %, of which the decoder amplifies what is no common factor.
    views = camera.decoded(image)
    error = off(views.values, np.ones(views.shape))
    print(f"off by {error:.4f}")
    assert error < 0.02


def test_views_are_those_of_the_lens_stopped_down(camera, decoded):
    truth = camera.true_views(camera.bench.light_field, 3)
    assert decoded.shape == (3, 3, *camera.tiles, 3)
    error = off(decoded.values, truth)
    apart = off(np.broadcast_to(truth.mean(axis=(0, 1)), truth.shape), truth)
    print(f"off by {error:.4f}; without an angular response {apart:.4f}")
    # Without an angular response all views are the mean; views mirrored at the lens are twice as far away.
    assert error < apart / 3
    assert off(np.asarray(decoded.values)[:, ::-1], truth) > apart
    assert off(np.asarray(decoded.values)[::-1], truth) > apart


def test_true_views_are_the_plane_s_closed_form(camera, decoded):
    """The mean of rays through each ninth of the aperture, from the middle of a pixel, by hand."""
    truth = camera.true_views(camera.bench.light_field, 3)
    inside = (np.arange(8) + 0.5) / 8 - 0.5
    rows, columns = camera.tiles
    for row, column in ((0, 2), (1, 1), (2, 0)):
        u, v = ((n - 1 + inside) * STOP / 3 for n in (column, row))
        # A ray from u that lands at x met the plane in focus at −x·F/d, and DISTANCE at the place between.
        x, y = (-(np.arange(n) - (n - 1) / 2) * camera.pitch for n in (columns, rows))
        share = DISTANCE / FOCUS
        places_x = u * (1 - share) - x[:, None] * FOCUS / TO_SENSOR * share
        places_y = v * (1 - share) - y[:, None] * FOCUS / TO_SENSOR * share
        seen = Waves(0.09)(places_x[None, :, None, :], places_y[:, None, :, None]).mean(axis=(2, 3))
        # Upright as here, x to the left; pixels and samples blur by 1 % of the waves' amplitude of 0.1.
        assert off(truth[row, column][None, None], seen[None, None]) < 0.005
        assert off(np.asarray(decoded.values)[row, column][None, None], seen[None, None]) < 0.02


def test_without_an_angular_response_views_are_equal(camera):
    even = replace(camera, modulation=0.0)
    plain = gallery.captured(vcc.Camera(camera.elements(camera.stop), camera.sensor(4)), camera.bench.light_field)
    views = np.asarray(even.decoded(plain * 0.5).values)
    np.testing.assert_allclose(views, np.broadcast_to(views[:1, :1], views.shape), atol=1e-5)


def test_lenslets_show_views_of_the_same_radiance(camera):
    image = gallery.captured(camera.plenoptic, camera.bench.light_field, 64)
    views = gallery.through_lenslets(camera, image)
    truth = camera.true_views(camera.bench.light_field, 4)
    error, mirrored = off(views.values, truth), off(np.asarray(views.values)[:, ::-1], truth)
    print(f"off by {error:.4f}; mirrored at the lens {mirrored:.4f}")
    assert error < mirrored / 3


def test_few_pixels_are_refused():
    field = seen_by_views(PlanesScene([TexturedPlane(Waves(0.09), DISTANCE)]))
    with pytest.raises(vcc.InputError, match=r"30×30 tiles.*give views of 68 pixels or more"):
        camera_for(field[:, :, :60, :60])


def test_runs_on_a_light_field_of_one_s_own():
    scene = PlanesScene([TexturedPlane(Waves(0.06), 0.8, width=0.16), TexturedPlane(Waves(0.15, seed=1), 2.0)])
    result = entry.Run(most=36, rays=16)(bench_for(seen_by_views(scene)), silent)
    assert all(math.isfinite(number.value) for number in result.numbers)
    by_name = {number.what: number for number in result.numbers}
    assert by_name["light that the pixels record of what ordinary pixels would"].reached
    assert next(number for what, number in by_name.items() if "decoded views" in what).reached
    assert not any("disparity" in what for what in by_name)  # the distances of such a scene are not known
    assert len(result.pictures) == 4
