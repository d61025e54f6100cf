"""The built-in scene and its bench: the true picture against the light field's, and light fields of one's own."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.showcase import figures
from vcc.showcase.bench import Bench, built_in, from_someone
from vcc.showcase.scene import demo_scene
from vcc.showcase.truth import psnr, true_picture
from vcc.showcase.words import away, duration, filled, length
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves
from vcc.store import save_store


@pytest.fixture(scope="module")
def bench() -> Bench:
    return built_in(small=True)


@pytest.fixture(scope="module")
def truth(bench: Bench) -> vcc.Image:
    return true_picture(bench)


def someones_own(convergence: float = math.inf) -> vcc.LightField:
    """A gantry half a metre wide, in grey; with and without knowing where its views converge."""
    planes = [TexturedPlane(Waves(0.4 * z, seed=n), z, width=0.5 * z) for n, z in enumerate((12.0, 25.0))]
    field = PlanesScene([*planes, TexturedPlane(Waves(8.0), 50.0)]).light_field(
        (5, 5), (48, 64), spacing=0.1, slope_per_pixel=0.5 / 64, focus_distance=20.0, dtype="float32"
    )
    return vcc.LightField.from_views(
        field.values[..., 1], 0.1, 0.5 / 64, convergence, disparity_range=field.disparity_range
    )


def reached(bench: Bench, truth: vcc.Image) -> dict[str, float]:
    """Decibels of the pinhole picture by interpolation."""
    camera = bench.pinhole()
    white = 1 / bench.exposure(camera, bench.pinhole_diameter)
    return {
        way: psnr(camera.capture(bench.light_field, interpolation=way), truth, white)
        for way in ("nearest", "linear", "cubic", "sharp")
    }


def seen_through_the_pinhole(bench: Bench, right: float, down: float) -> np.ndarray:
    """What the pinhole sees if all its rays are a little off: slopes, by the scene's closed form."""
    sensor, (u, v) = bench.pinhole().sensor, bench.pinhole_place
    inside = (np.arange(4) + 0.5) / 4 - 0.5
    x = (sensor.column_places[:, None] + sensor.pitches[1] * inside).ravel()
    y = (sensor.row_places[:, None] + sensor.pitches[0] * inside).ravel()
    # Through the middle of the lens rays go straight on; the lens bends those at u by −u/f.
    s, t = ((place - at) / sensor.z + at / bench.focal_length for place, at in ((x, u), (y, v)))
    assert bench.scene is not None
    radiance = bench.scene.radiance_along(u, v, s[None, :] + right, t[:, None] + down)
    return radiance.reshape(len(x) // 4, 4, len(y) // 4, 4, -1).mean(axis=(1, 3))


def test_each_better_interpolation_comes_closer_to_the_truth(bench, truth):
    found = reached(bench, truth)
    assert found["sharp"] > found["cubic"] > found["linear"] > found["nearest"]
    # The nearest sample lies at most half a view's pixel off, each way: closer than if every pixel were.
    half = abs(float(bench.light_field.frame.linear[2, 2])) / 2
    inner = np.s_[5:-5, 5:-5]
    displaced = seen_through_the_pinhole(bench, half, half) - seen_through_the_pinhole(bench, 0, 0)
    assert found["nearest"] > -10 * math.log10(np.mean(displaced[inner] ** 2))


def test_the_true_picture_is_as_bright_as_the_light_field_s(bench, truth):
    """Its geometry is independent: the scene's closed form, without the light field."""
    image = bench.pinhole().capture(bench.light_field, interpolation="cubic")
    # Weights of samples sum to 1. What is left is light that interpolation exchanges over the border: of half a
    # pixel at each of four sides, as much as neighbouring pixels differ.
    values = truth.to_numpy().astype(float)
    differ = np.abs(np.diff(values, axis=1)).mean() / values.mean()
    assert image.values.sum() == pytest.approx(values.sum(), rel=4 * 0.5 / values.shape[0] * differ)
    assert image.missing_rays == 0


def test_pictures_are_upright(bench, truth):
    """As the sensor moves, pictures grow a little and blur; each is nearer to the truth as it is than turned."""
    inner = np.s_[20:-20, 20:-20]
    upright = truth.upright().to_numpy()[inner]
    images = [bench.conventional(distance).capture(bench.light_field) for distance in (bench.near, bench.far)]
    images += [bench.pinhole().capture(bench.light_field), bench.light_field.view(4, 4)]
    for image in images:
        picture = image.upright().to_numpy()[inner]
        as_is, turned = np.corrcoef([upright.ravel(), picture.ravel(), picture[::-1, ::-1].ravel()])[0, 1:]
        assert as_is > turned


def test_no_picture_of_the_built_in_scene_lacks_rays(bench):
    """Views are wider than the sensor in angle: 25 mm at 52 mm, against 24 mm at 51 mm or more."""
    for distance in bench.distances.values():
        assert bench.conventional(distance).compile(bench.light_field).missing_rays == 0


def test_the_scene_is_radiance_between_0_and_1():
    s = np.linspace(-0.25, 0.25, 200)
    radiance = demo_scene().radiance_along(0, 0, s[None, :], s[:, None])
    assert radiance.min() >= 0
    assert radiance.max() <= 1 + 1e-6  # rounding of the colours' mixture
    assert radiance.std() > 0.1  # it shows something: dusk, leaves and a chart of black on white


@pytest.mark.parametrize("convergence", [20.0, math.inf])
def test_someones_own_light_field_is_scaled_to_a_lens(convergence):
    bench = from_someone(someones_own(convergence), small=False)
    assert ("were taken to converge" in bench.assumed) == math.isinf(convergence)
    assert 5 * abs(bench.light_field.frame.linear[0, 0]) == pytest.approx(20 * mm)
    assert 0 < bench.near < bench.middle < bench.far
    found = reached(bench, true_picture(bench))
    assert found["cubic"] > found["linear"] > found["nearest"]
    # Waves of 0.4 Z are 51 pixels long, of an amplitude of ½ at most: half a pixel off and less, evenly, each way,
    # is an rms error of ½/√2·(2π/51)·√(2/12) = 0.018, 35 dB. Four edges of two planes, half of the picture wide,
    # cost a strip of half a pixel of 64 where radiances differ by ½ at most: 4·½/64·¼ = 0.008, 21 dB.
    assert found["nearest"] > 20.8


@pytest.mark.parametrize("brightness", [0.002, 30.0])
def test_radiance_that_nobody_exposed_is_brought_to_white(brightness):
    own = someones_own(20.0)
    as_it_is = from_someone(own, small=False)
    assert "multiplied" not in as_it_is.assumed
    lit = from_someone(own.replaced(own.values * np.float32(brightness)), small=False)
    assert "multiplied" in lit.assumed
    # "auto" of Image.save: the 99.5th percentile of what a person sees is white.
    assert np.percentile(lit.light_field.view(2, 2).to_numpy(), 99.5, method="higher") == pytest.approx(
        1, rel=1e-5
    )
    gain = lit.light_field.values.max() / as_it_is.light_field.values.max()
    np.testing.assert_allclose(lit.light_field.values, as_it_is.light_field.values * gain, rtol=1e-5, atol=1e-7)


def test_a_store_can_be_put_on_the_bench(tmp_path):
    own = someones_own(20.0)
    save_store(own, tmp_path / "own.zarr")
    bench = from_someone(tmp_path / "own.zarr", small=True)
    np.testing.assert_array_equal(bench.light_field.values, from_someone(own, small=True).light_field.values)


def test_what_no_bench_can_use_is_refused(tmp_path: Path):
    row = vcc.LightField.from_views(np.ones((1, 4, 8, 8), np.float32), 1 * mm, 1e-3)
    flat = vcc.LightField.from_views(np.ones((4, 4, 32, 32), np.float32), 1 * mm, 1e-3)
    five = vcc.LightField.from_views(np.ones((4, 4, 8, 8, 5), np.float32), 1 * mm, 1e-3)
    for given, words in (
        (row, "two rows"),
        (flat, "no parallax"),
        (five, "1 or 3 channels"),
        (tmp_path / "nowhere", "nowhere"),
    ):
        with pytest.raises(vcc.InputError, match=words):
            from_someone(given, small=False)


def test_a_crop_lies_where_rays_through_the_lens_s_middle_land(bench):
    x, y, distance = 0.1, -0.05, 1.3
    sensor = bench.sensor(distance)
    crop = figures.crop_around(sensor, (x, y, distance), 10)
    # Upright, the picture of (X, Y) lies at +d·(X, Y)/Z from the middle.
    middle = crop.row + 5 - (sensor.shape[0] - 1) / 2, crop.column + 5 - (sensor.shape[1] - 1) / 2
    expected = y / distance * sensor.z / sensor.pitches[0], x / distance * sensor.z / sensor.pitches[1]
    assert middle == pytest.approx(expected, abs=0.5)  # whole pixels


def test_numbers_read_well():
    assert [duration(t) for t in (0.0042, 0.0353, 0.156, 1.84, None)] == [
        "4.2 ms",
        "35 ms",
        "156 ms",
        "1.8 s",
        "–",
    ]
    assert [length(x) for x in (9e-6, 0.0225, 1.3)] == ["9 µm", "22.5 mm", "1.3 m"]
    assert [away(z) for z in (1.3, 0.05, math.inf)] == ["1.3 m away", "50 mm away", "at infinity"]


def test_a_template_that_asks_for_what_is_not_given_is_an_error():
    with pytest.raises(Exception, match="'bench' is undefined"):
        filled("gallery/prose/conventional.txt")


def test_close_ups_are_of_what_is_sharp_in_one_picture_only():
    """Of black beside noise from bright to faint, running sums leave some −1e-20, whose root is no number."""
    random = np.random.default_rng(0)
    noise = random.random((20, 16, 1)) * 10 ** -random.uniform(0, 8, (20, 16, 1))
    pictures = [np.zeros((64, 64, 3), np.float32) for _ in range(2)]
    for picture, left in zip(pictures, (8, 40), strict=True):
        picture[20:40, left : left + 16] = noise
    for crop, left in zip(figures.detailed_crops(pictures, 12), (8, 40), strict=True):
        assert 20 - 6 <= crop.row <= 40 - 6
        assert left - 6 <= crop.column <= left + 16 - 6
