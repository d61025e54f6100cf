"""What a pair is: recordings and ground truth on the same pixels, against closed forms and mirrored cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.dataset.recipe import Recipe
from vcc.dataset.recording_pairs import Opened, Recorder
from vcc.dataset.scenes import scenes_of
from vcc.sweeps.design import cameras_of
from vcc.units import mm, nm

pytestmark = pytest.mark.filterwarnings("ignore::vcc.ResultWarning")

FOCAL, FOCUS = 50 * mm, 0.8
RANDOM = np.random.default_rng(3)
CODE = RANDOM.integers(0, 2, (5, 7)).astype(float)
SETTINGS = {
    "count": 8,
    "truth": ("sharp",),
    "crop": (20, 24),
    "flips": False,
    "gain": None,
    "color_gain": None,
    "exposure": 0.01,
    "radiance": 1e-3,
    "psf_distances": (),
    "psf_size": 31,
    "seed": 0,
    "how": vcc.How(threads=1),
}


def field_of(values, **more):
    return vcc.LightField.from_views(values, 1 * mm, 0.002, FOCUS, (-0.5, 0.5), **more)


def camera_of(electronics=None, code=CODE, decentre=(0.0, 0.0)):
    elements = [vcc.Lens(FOCAL), vcc.Mask(code, width=7 * mm, height=5 * mm, name="code")]
    return vcc.Camera.focused(
        elements, vcc.Sensor(0, (40, 48), 0.1 * mm, decentre, electronics=electronics), FOCUS
    )


def recipe_of(camera, scene, **more):
    return Recipe(cameras_of(camera, None), scenes_of(scene), **{**SETTINGS, **more})


def pair_of(recipe, number=0):
    return Recorder(recipe).pair(number, Opened("scene", recipe.scenes[0].opened()))


def test_a_flip_is_the_mirrored_scene_through_the_mirrored_camera():
    scene = field_of(RANDOM.random((5, 7, 50, 60, 3), dtype=np.float32))
    recipe = recipe_of(camera_of(), scene, flips=True, truth=("sharp", "views", "psf"), psf_distances=(1.1,))
    seen = set()
    for number in range(recipe.count):
        drawn, pair = recipe.drawn(number), pair_of(recipe, number)
        seen.add((drawn.flip_y, drawn.flip_x))
        of_views, of_pixels, of_code, signs = [], [], [], [1, 1]
        for axis, flip in enumerate((drawn.flip_y, drawn.flip_x)):
            if flip:
                of_views += [axis, axis + 2]
                of_pixels.append(axis)
                of_code.append(axis)
                signs[1 - axis] = -1  # decentres are (x, y)
        mirrored = field_of(np.flip(scene.values, of_views).copy())
        window = recipe.window(drawn).sensor
        decentre = tuple(sign * each for sign, each in zip(signs, window.decentre, strict=True))
        camera = camera_of(code=np.flip(CODE, of_code).copy())
        camera = camera.replace(sensor=replace(window, decentre=decentre))
        taken = camera.capture(mirrored, threads=1).values
        assert np.abs(pair.arrays["recording"] - taken).max() < 1e-6 * taken.max()
        spread = vcc.analysis.psf(camera, 1.1, shape=(31, 31)).values
        assert np.abs(pair.arrays["psf"][0] - spread).max() < 1e-6 * spread.max()
        # each sample of the views is the mirrored scene's of the same ray
        frame = vcc.Affine(np.array(pair.numbers["views_frame"]))
        views = pair.arrays["views"]
        for j, i, l, k in ((0, 0, 0, 0), (4, 2, 7, 3)):
            index = mirrored.frame.inverse()(frame([i, j, k, l]))
            assert np.allclose(index, np.rint(index), atol=1e-9)
            i_, j_, k_, l_ = np.rint(index).astype(int)
            assert np.array_equal(views[j, i, l, k], mirrored.values[j_, i_, l_, k_])
    assert len(seen) > 2


def test_a_window_is_the_same_pixels_of_the_whole_sensor():
    scene = field_of(RANDOM.random((5, 7, 50, 60), dtype=np.float32))
    camera = camera_of()
    recipe = recipe_of(camera, scene)
    whole = camera.capture(scene).values
    for number in range(3):
        drawn = recipe.drawn(number)
        part = whole[drawn.row : drawn.row + 20, drawn.column : drawn.column + 24]
        # The small filter against loss of sharpness ends at the border of a window as at that of a sensor.
        inside = (slice(4, -4), slice(4, -4))
        assert np.abs(pair_of(recipe, number).arrays["recording"] - part)[inside].max() < 1e-5 * whole.max()


@pytest.mark.parametrize("views", [(5, 7), (4, 6)])
def test_sharp_image_and_depth_of_a_plane_are_those_of_a_pinhole(views):
    """A plane at Z with texture g(x, y) radiates g(u − Z·s, v − Z·t) into the ray (u, v, s, t); through a point u₀
    of the lens, the sensor at d sees the slope s = (x − u₀)/d + u₀/f."""
    period, distance = 30 * mm, 1.1

    def g(x, y):
        return 0.5 + 0.2 * np.cos(2 * np.pi * x / period) + 0.2 * np.sin(2 * np.pi * y / period)

    empty = field_of(np.zeros((*views, 60, 70), np.float32))
    nv, nu, nt, ns = empty.shape
    j, i, l, k = np.meshgrid(*map(np.arange, (nv, nu, nt, ns)), indexing="ij")
    u, v, s, t = np.moveaxis(empty.frame(np.stack([i, j, k, l], axis=-1)), -1, 0)
    disparity = np.full((*views, 60, 70), empty.disparity_of(distance), np.float32)
    scene = field_of(g(u - distance * s, v - distance * t).astype(np.float32), sample="point", disparity=disparity)
    camera = camera_of()
    recipe = recipe_of(camera, scene, truth=("sharp", "depth"))
    pair, sensor = pair_of(recipe), recipe.window(recipe.drawn(0)).sensor
    middle = [(views[1] - 1) // 2, (views[0] - 1) // 2]
    u0, v0 = scene.frame([*middle, 0, 0])[:2]
    d = sensor.z
    s = (sensor.column_places - u0) / d + u0 / FOCAL
    t = (sensor.row_places - v0) / d + v0 / FOCAL
    wanted = g(u0 - distance * s[None], v0 - distance * t[:, None])
    # A pixel of 0.1 mm is 2.1 mm of the plane, whose mean takes 1 − sinc(2.1/30) = 0.8 % of the modulation of 0.2;
    # the border's filter and interpolation between samples 2.2 mm apart as much again: 0.004 in all.
    assert np.abs(pair.arrays["sharp"] - wanted).max() < 0.004
    assert np.allclose(pair.arrays["depth"], distance, rtol=1e-5)


def test_diffraction_belongs_to_the_recording_and_not_to_its_truth():
    disparity = np.full((60, 70), 0.1, np.float32)
    scene = field_of(RANDOM.random((3, 3, 60, 70), np.float32), disparity=disparity).with_wavelengths((0.9e-6,))
    camera = camera_of().replace(sensor=vcc.Sensor(camera_of().sensor.z, (40, 48), 4e-6))
    by_rays, by_waves, by_depth = (
        pair_of(recipe_of(camera, scene, how=vcc.How(threads=1, diffraction=waves)))
        for waves in (False, True, "depth")
    )
    for other in (by_waves, by_depth):
        np.testing.assert_array_equal(other.arrays["sharp"], by_rays.arrays["sharp"])
        assert other.numbers["irradiance_of_white"] == by_waves.numbers["irradiance_of_white"]
    assert not np.allclose(by_waves.arrays["recording"], by_rays.arrays["recording"], rtol=1e-3)
    with pytest.raises(vcc.InputError, match="traced by rays"):
        recipe_of(camera, scene, truth=("psf",), psf_distances=(1.0,), how=vcc.How(diffraction=True))


def test_recordings_are_in_units_of_the_sharp_image_with_the_noise_of_their_photons():
    scene = field_of(np.full((5, 7, 50, 60, 3), 0.6, np.float32))
    electronics = vcc.Electronics(bit_depth=16, gain=1.0, full_well=60000.0, color_filter=None)
    recipe = recipe_of(
        camera_of(electronics), scene, gain=(0.5, 2.0), color_gain=(0.8, 1.25), radiance=2e-2, exposure=0.02
    )
    gains = []
    for number in range(4):
        pair = pair_of(recipe, number)
        gain = np.array(pair.numbers["gain"])
        gains.append(gain)
        assert np.allclose(pair.arrays["sharp"], 0.6 * gain, rtol=1e-5)  # of float32, on 4 sums
        scale = np.array(pair.numbers["dn_per_radiance"])
        light = (pair.arrays["recording"] - pair.numbers["dark_dn"]) / scale
        electrons = 0.6 * gain * scale / electronics.gain
        # mean and variance of n Poisson numbers with read noise, within 5 standard deviations; rounding adds 1/12
        n, variance = 20 * 24, electrons + electronics.read_noise**2 + electronics.dark_current * 0.02 + 1 / 12
        assert (electrons > 1000).all()
        assert pair.numbers["saturated"] == 0
        assert np.all(np.abs(light.mean((0, 1)) - 0.6 * gain) < 5 * np.sqrt(variance / n) / scale)
        assert np.all(np.abs(light.var((0, 1)) * scale**2 / variance - 1) < 5 * np.sqrt(2 / n))
    assert np.ptp(gains) > 0.1


@pytest.mark.parametrize(
    ("lens", "sensor"),
    [
        (vcc.Lens(FOCAL, diameter=9 * mm), {"response": "mono"}),
        (vcc.Lens(FOCAL, diameter=9 * mm, glass="N-BK7"), {"fill_factor": 0.5}),
        (vcc.load_lens("double-gauss-50mm", model="real"), {}),
    ],
    ids=["mono", "glass", "real lens"],
)
def test_a_uniform_scene_has_its_radiance_through_any_camera(lens, sensor):
    values = np.full((5, 5, 50, 60, 3), 0.6, np.float32)
    scene = field_of(values).with_wavelengths([610 * nm, 540 * nm, 465 * nm])
    camera = vcc.Camera.focused([lens], vcc.Sensor(0, (40, 48), 0.1 * mm, **sensor), FOCUS)
    pair = pair_of(recipe_of(camera, scene))
    white = np.array(pair.numbers["irradiance_of_white"])
    # rays of the real lens, 64 a pixel, differ by random numbers; the rest is float32
    assert np.allclose((pair.arrays["recording"] / white).mean((0, 1)), 0.6, rtol=2e-3)
    assert np.allclose(pair.arrays["sharp"], 0.6, rtol=1e-5)


def test_settings_change_only_what_they_are_about():
    scene = field_of(np.ones((3, 3, 50, 60, 3), np.float32))
    one = recipe_of(camera_of(), scene)
    other = replace(one, flips=True, gain=(0.5, 2), color_gain=(0.5, 2), exposure=(0.1, 1.0))
    for number in range(20):
        a, b = one.drawn(number), other.drawn(number)
        assert replace(b, flip_x=a.flip_x, flip_y=a.flip_y, gain=a.gain, exposure=a.exposure) == a
        assert 0.1 <= b.exposure <= 1
    assert len({one.drawn(number).noise_seed for number in range(20)}) == 20


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"count": 0}, "count is a whole number of pairs"),
        ({"truth": ("sharpness",)}, "truth is one of 'sharp', 'depth', 'views' or 'psf'"),
        ({"crop": (50, 50)}, r"crop is \(50, 50\), and the sensor has \(40, 48\) pixels"),
        ({"gain": (2, 1)}, r"gain is drawn from \(low, high\)"),
        ({"gain": (1, 2), "exposure": "auto"}, "gain has no effect with exposure"),
        ({"exposure": (0, 1)}, "exposure is drawn from"),
        ({"exposure": -1}, "exposure"),
        ({"truth": ("psf",)}, "psf_distances belong together"),
        ({"truth": ("psf",), "psf_distances": (1.0,), "psf_size": 30}, "psf_size is odd"),
        ({"seed": 1.5}, "seed is 1.5"),
    ],
)
def test_wrong_settings_name_the_way_out(wrong, said):
    scene = field_of(np.ones((3, 3, 50, 60, 3), np.float32))
    with pytest.raises(vcc.InputError, match=said):
        recipe_of(camera_of(), scene, **wrong)
