"""The plenoptic camera of the gallery against closed forms of planes, fringes and plates."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.gallery import fringes
from vcc.gallery import plenoptic as gallery
from vcc.gallery.entry import bench_for, silent
from vcc.recover import without_aberration
from vcc.shapes.surfaces import Tilt, Zernike
from vcc.showcase.bench import Bench
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

FOCUS, DISTANCE = 1.2, 0.9
SLOPE, PIXELS = 0.001, 98
TO_SENSOR = 1 / (1 / (50 * mm) - 1 / FOCUS)


def bench_with(light_field: vcc.LightField) -> Bench:
    pitch = SLOPE * TO_SENSOR
    return Bench(light_field, None, DISTANCE, FOCUS, 2.0, 50 * mm, 18 * mm, (pitch, pitch))


@pytest.fixture(scope="module")
def bench() -> Bench:
    """One plane of waves, 8 lenslets long, before what is in focus."""
    wave = 8 * gallery.PITCH / TO_SENSOR * DISTANCE
    scene = PlanesScene([TexturedPlane(Waves(wave), DISTANCE)])
    return bench_with(
        scene.light_field(
            (9, 9), (PIXELS, PIXELS), spacing=2 * mm, slope_per_pixel=SLOPE, focus_distance=FOCUS, dtype="float32"
        )
    )


@pytest.fixture(scope="module")
def camera(bench) -> gallery.Plenoptic:
    return gallery.designed(bench)


@pytest.fixture(scope="module")
def decoded(bench, camera) -> vcc.LightField:
    return camera.decoded(camera.recorded(bench.light_field), camera.white())


def off(picture: np.ndarray, truth: np.ndarray) -> float:
    inner = np.s_[gallery.MARGIN : -gallery.MARGIN, gallery.MARGIN : -gallery.MARGIN]
    return float(np.sqrt(np.mean((picture[inner] - truth[inner]) ** 2)))


def test_the_camera_is_the_published_one(camera):
    """125 µm, f/4, 14 pixels of 9 µm, and micro-images that just touch."""
    assert camera.pitch == pytest.approx(125 * um)
    assert camera.gap == pytest.approx(500 * um)
    assert camera.camera.sensor.pitch == pytest.approx(9 * um, rel=0.01)
    micro_image = camera.diameter * camera.gap / TO_SENSOR
    assert micro_image == pytest.approx(14 * camera.camera.sensor.pitch)
    # 98 pixels of the light field are 40.9 lenslets; half a one is free at each border.
    assert camera.lenslets == (39, 39)


def test_a_plane_refocused_is_its_mean_over_lenslets(camera, decoded):
    image = camera.refocuser(decoded).at(DISTANCE)
    picture = image.to_numpy()
    wide = camera.pitch / TO_SENSOR * DISTANCE  # what a lenslet shows of the plane
    places = (np.arange(picture.shape[0]) - (picture.shape[0] - 1) / 2) * wide
    nodes, weights = np.polynomial.legendre.leggauss(4)
    fine = (places[:, None] + nodes * wide / 2).ravel()
    texture = Waves(8 * wide)(fine[None, :], fine[:, None]).reshape(len(places), 4, len(places), 4, 3)
    truth = np.einsum("arbsc,r,s->abc", texture, weights, weights) / 4
    # The light field is linear between its pixels of 0.42 lenslets, and the window of a pixel blurs by
    # D·d·|1/Z − 1/F|/14 = 0.1 lenslets: of waves of 8 lenslets each takes less than (π·0.42/8)²/3 = 0.9 % of
    # the amplitude of 0.1. Photons of 10 000 electrons in a pixel, and in one of white, are 1.4 % of noise, and
    # 150 pixels are averaged: 0.12 % of white; rays, 16 a pixel and evenly spread, add less.
    assert off(picture, truth) < 0.002
    assert off(picture, np.roll(truth, 1, axis=1)) > 0.02
    assert off(camera.refocuser(decoded).at(2.0).to_numpy(), truth) > 0.01
    # The ideal camera sees the same.
    assert off(camera.ideal(camera.bench.light_field, DISTANCE), truth) < 0.002


def test_fringes_lose_contrast_as_windows_and_discs_say(camera):
    sharpness = gallery.depth_of_field(camera, 4)
    # Brute force: the mean of a wave over points of a square and of a disc.
    x = (np.arange(400) + 0.5) / 400 - 0.5
    disc = np.hypot(x[:, None], x[None, :]) < 0.5
    for distance, refocused, plain in zip(
        sharpness.distances, sharpness.refocused, sharpness.conventional, strict=True
    ):
        waves = camera.diameter * TO_SENSOR * abs(1 / distance - 1 / FOCUS) / camera.pitch / fringes.PERIOD
        lenslet = np.cos(2 * np.pi * x / fringes.PERIOD).mean()
        square = np.cos(2 * np.pi * x * waves / gallery.EACH).mean()
        through_disc = np.broadcast_to(np.cos(2 * np.pi * x * waves), disc.shape)[disc].mean()
        # Fringes of 32 pixels, linear between them, lose (π/32)²/3 = 0.3 %; windows cut by the rim of the lens see
        # a part of their square. Noise: as above.
        assert refocused == pytest.approx(lenslet * square, abs=0.01)
        assert plain == pytest.approx(lenslet * through_disc, abs=0.01)
    # Half the contrast, a quarter from either end of what was measured: sin(x)/x = 1/2 at x = 1.8955.
    expected = 1.8955 / np.pi * gallery.EACH * fringes.PERIOD
    # A parabola through points 0.4 of that apart misses the curve by some percent.
    assert sharpness.reach == pytest.approx(expected, rel=0.02)


def test_aberrations_are_taken_out(bench, camera, decoded):
    """Through a tilted plate the picture is where it was; through coma it is as sharp as each window allows."""
    white = camera.white()
    plain = camera.refocuser(decoded).at(DISTANCE).to_numpy()
    step = camera.pitch / TO_SENSOR
    for surface, moved in (
        (Tilt((2.3 * step, -1.6 * step)), 0.03),
        (Zernike.from_terms({8: 3 * um}, camera.diameter), 0.01),
    ):
        spoilt = camera.decoded(camera.recorded(bench.light_field, surface), white)
        before, after = (
            camera.refocuser(each).at(DISTANCE).to_numpy()
            for each in (spoilt, without_aberration(spoilt, surface))
        )
        assert off(before, plain) > moved
        # Cubic splines follow waves of 8 samples to (2π/8)⁴/700 of them; noise of two recordings as above.
        assert off(after, plain) < 0.002


def test_few_pixels_are_refused():
    small = np.random.default_rng(0).random((5, 5, 40, 40), np.float32)
    with pytest.raises(vcc.InputError, match=r"40×40 pixels have detail for 15×15 lenslets.*80 pixels"):
        gallery.designed(bench_with(vcc.LightField.from_views(small, 4 * mm, SLOPE * 4.5, FOCUS)))


def test_runs_on_a_light_field_of_one_s_own():
    scene = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])
    field = scene.light_field((9, 9), (96, 96), spacing=20 * mm / 9, slope_per_pixel=0.004, focus_distance=1.2)
    result = gallery.Run(each=7, depths=4)(bench_for(field), silent)
    assert all(math.isfinite(number.value) for number in result.numbers)
    refocused = [number for number in result.numbers if number.what.startswith("refocused")]
    assert len(refocused) == 3
    assert all(number.reached for number in refocused)
    before, after = result.numbers[-2:]
    assert after.value > before.value
    assert [row[0].name for row in result.pictures] == [
        "raw",
        "views",
        "refocused",
        "depth-of-field",
        "aberration",
    ]
