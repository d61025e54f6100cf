"""The filter that compensates for the blur of interpolating views, compared with sinc(f).

Oracles: NumPy's sinc, cosines and their means over pixels in closed form, a view that must be reproduced.
"""

from __future__ import annotations

from dataclasses import replace

import array_api_strict
import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.engines import engine
from vcc.plan.choice import compile_best
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.operators import SharpenViews
from vcc.plan.rays.compile import ByRays
from vcc.run.drive import drive
from vcc.store import save_store

FOCUS = 1.0
D = 1 / (1 / 50e-3 - 1 / FOCUS)
SLOPE = 2e-3
LENS = vcc.Lens(focal_length=50 * mm, diameter=6 * mm)
KINDS = ["uint8", "uint16", "float16", "float32", "float64"]


def field(values: np.ndarray, **options) -> vcc.LightField:
    defaults = {
        "spacing": 2 * mm,
        "slope_per_pixel": SLOPE,
        "focus_distance": FOCUS,
        "disparity_range": (-0.2, 0.4),
    }
    return vcc.LightField.from_views(values, **(defaults | options))


CAMERA = vcc.Camera([LENS], vcc.Sensor(D, (6, 7), D * SLOPE))


def plan_of(lf: vcc.LightField, **options) -> Plan:
    return ByRays(CAMERA, lf.grid, How(**options)).plan


def sharpened(plan: Plan, values: np.ndarray, name: str):
    """Samples as an engine's rays interpolate them."""
    return engine(name).prepared(plan.before, values, threads=2)


def random(shape: tuple[int, ...], kind: str) -> np.ndarray:
    values = np.random.default_rng(3).random(shape)
    return (values * np.iinfo(kind).max).astype(kind) if kind.startswith("u") else values.astype(kind)


@pytest.mark.parametrize(("sample", "power"), [("point", 2), ("mean", 3)])
def test_the_filter_is_one_over_a_power_of_sinc(sample, power):
    middle, near, far = np.array(SharpenViews.of(sample).weights) / 1024
    f = np.array([0.02, 0.05, 0.1, 0.15])
    factor = middle + 2 * near * np.cos(2 * np.pi * f) + 2 * far * np.cos(4 * np.pi * f)
    # With h = sin(πf), 1/sinc(f) = arcsin(h)/h = 1 + h²/6 + 3h⁴/40 + 15h⁶/336 + …: the coefficients of its
    # powers are positive and decrease. The remainder is at most the sixth-order term times 1/(1 − h²), plus the
    # rounding of weights to 2⁻¹¹.
    series = np.polynomial.Polynomial([1, 1 / 6, 3 / 40, 15 / 336]) ** power
    h = np.sin(np.pi * f)
    left = series.coef[3] * h**6 / (1 - h**2) + 2.0**-11 * (4 * h**2 + 4 * np.sin(2 * np.pi * f) ** 2)
    assert (np.abs(factor * np.sinc(f) ** power - 1) <= left).all()


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_even_stays_even_to_the_bit(kind):
    for shape in ((2, 2, 5, 6), (1, 1, 1, 1), (1, 2, 2, 3, 3)):
        even = np.full(shape, 200 if kind.startswith("u") else 0.75, dtype=kind)
        for name in ("numba", "reference"):
            plan = plan_of(field(even))
            values = sharpened(plan, even, name)
            assert (values * 1.0 == values.flat[0]).all()
            scale = plan.core.scale * plan.kept_as(even.dtype)[1] / field(even).full_scale
            assert values.flat[0] * scale == pytest.approx(even.flat[0] / field(even).full_scale, rel=1e-7)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", [(3, 2, 9, 11), (2, 2, 4, 3, 3), (1, 1, 1, 2), (1, 2, 6, 7, 4)])
def test_engines_make_the_same_samples(kind, shape):
    values = random(shape, kind)
    plan = plan_of(field(values))
    expected = sharpened(plan, values, "reference")
    compiled = sharpened(plan, values, "numba")
    assert compiled.dtype == plan.kept_as(values.dtype)[0]
    # Single precision rounds six sums of numbers up to 3.4 times the largest.
    tolerance = 0 if kind == "uint8" else 6 * 3.4 * np.finfo(np.float32).eps * float(values.max())
    assert np.abs(compiled - expected.astype(float)).max() <= tolerance
    if kind != "float16":
        library = sharpened(plan, array_api_strict.asarray(values), "array_api")
        assert np.abs(np.from_dlpack(library) - expected.astype(float)).max() <= tolerance


def test_a_single_row_or_column_is_filtered_by_hand():
    row = np.zeros((1, 1, 1, 9), np.float32)
    row[..., 4] = 1.0
    plan = plan_of(field(row, sample="point"))
    values = sharpened(plan, row, "numba")
    middle, near, far = np.array(plan.before[0].weights) / 1024
    # The other axis is one sample long, so constant: its filter has no effect.
    np.testing.assert_allclose(values[0, 0, 0], [0, 0, far, near, middle, near, far, 0, 0], atol=1e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_transposed_or_mirrored_views_are_filtered_alike(kind):
    values = random((2, 2, 7, 9), kind)
    plan = plan_of(field(values))
    plain = sharpened(plan, values, "numba")
    for change in (lambda v: v.transpose(0, 1, 3, 2), lambda v: v[:, :, ::-1], lambda v: v[:, :, :, ::-1]):
        changed = sharpened(plan, change(values), "numba")
        np.testing.assert_allclose(changed, change(plain), rtol=0, atol=1e-5 * float(plain.max()))


@pytest.mark.parametrize("sample", ["point", "mean"])
def test_one_view_imaged_onto_pixels_of_its_own_size_gives_itself_back(sample):
    # Cosines of up to 0.12 cycles per sample along both axes. The image's pixels are means.
    k = np.arange(40.0)
    f, g = 0.12, 0.09

    def view(softened: int) -> np.ndarray:
        """With this number of means over the pixels."""
        across = np.sinc(f) ** softened * np.cos(2 * np.pi * f * k)
        down = np.sinc(g) ** softened * np.cos(2 * np.pi * g * k + 1)
        return 1 + 0.4 * down[:, None] * across[None, :]

    values = view(0 if sample == "point" else 1)[None, None].astype(np.float32)
    lf = field(values, spacing=7 * mm, sample=sample)
    camera = vcc.Camera([LENS], vcc.Sensor(D, (40, 40), D * SLOPE))
    picture = {
        way: record_upright(camera, lf, samples=256, interpolation=way)[4:-4, 4:-4] for way in ("sharp", "linear")
    }
    truth = view(1)[4:-4, 4:-4] * np.pi * (3 * mm) ** 2 / D**2
    reached = {
        way: -20 * np.log10(np.sqrt(np.mean((one - truth) ** 2)) / truth.max()) for way, one in picture.items()
    }
    print(sample, reached)
    # The filter's remainder at f, at most 1e-3, of cosines of 0.4/1.4 of the largest value: 65 dB.
    assert reached["sharp"] >= 60
    assert reached["linear"] < 42


def record_upright(camera: vcc.Camera, lf: vcc.LightField, **options) -> np.ndarray:
    # A lens rotates its image by 180°.
    return drive(ByRays(camera, lf.grid, How(**options)).plan, lf).values[::-1, ::-1].astype(float)


def test_a_picture_of_an_even_scene_keeps_its_light():
    lf = field(np.full((4, 4, 9, 9), 200, np.uint8))
    camera = vcc.Camera([LENS], vcc.Sensor(D, (4, 4), D * SLOPE))
    expected = 200 / 255 * np.pi * (3 * mm) ** 2 / D**2
    assert record_upright(camera, lf) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("kind", ["uint8", "float32"])
@pytest.mark.parametrize("channels", [(), (3,)])
def test_pictures_agree_between_engines_and_in_pieces(tmp_path, kind, channels):
    values = random((4, 5, 14, 16, *channels), kind)
    lf = field(values)
    array = vcc.LensArray(focal_length=2 * mm, pitch=1 * mm, z=D - 3 * mm)
    camera = vcc.Camera([LENS, array], vcc.Sensor(D, (12, 14), D * SLOPE))
    plan = ByRays(camera, lf.grid, How(samples=16)).plan
    whole = drive(plan, lf)
    other = drive(plan, lf, How(engine="reference")).values
    assert np.abs(whole.values - other).max() <= 1e-5 * other.max()  # docs/how-it-works: engines agree to 1e-5
    assert np.abs(drive(replace(plan, before=()), lf).values - other).max() > 1e-3 * other.max()
    stored = save_store(lf, tmp_path / "a.zarr", chunks=4)
    # Blocks of some rows of pixels: missing neighbours would be visible.
    for limit in (10**9, plan.core.points.nbytes * 3 + 140_000):
        picture = drive(plan, stored, How(memory_limit=limit))
        assert np.abs(picture.values - whole.values).max() <= 1e-5 * other.max()
        assert picture.sampling_error == pytest.approx(whole.sampling_error, rel=1e-3)


def test_memory_counts_the_filtered_samples():
    values = random((4, 4, 800, 800), "uint8")
    lf = field(values)

    def foretold(camera: vcc.Camera, **options) -> float:
        words = camera.explain(lf, method="rays", **options)
        return float(words.split(" MB of memory beside")[0].split()[-1])

    plate = vcc.PhasePlate(vcc.surfaces.Cubic(1.0), diameter=6 * mm)
    bent = vcc.Camera([LENS, plate], CAMERA.sensor)
    more = foretold(bent) - foretold(bent, interpolation="linear")
    assert more == pytest.approx(2 * values.size / 1e6, abs=1.0)  # 16 bits for 8; both rounded to a megabyte
    # A plain lens filters only the parts that its rays read, and makes no copy.
    assert foretold(CAMERA) - foretold(CAMERA, interpolation="linear") == pytest.approx(0, abs=1.0)


def test_other_interpolations_are_refused():
    lf = field(random((2, 2, 4, 4), "float32"))
    with pytest.raises(vcc.InputError, match="interpolation='cubic' is for pictures made by footprints"):
        compile_best(CAMERA, lf.grid, How(method="rays", interpolation="cubic"))


def test_samples_wider_than_any_picture_need_no_room_around_it():
    """A filter of the image would read 2·2·3000 pixels around 20; cubic interpolation reads unfiltered samples."""
    samples = np.arange(33) - 16
    line = 0.5 + 0.4 * np.cos(2 * np.pi * samples / 5.5)
    light_field = field(np.repeat(line[None, :], 33, axis=0)[None, None].astype(np.float32))
    sensor = vcc.Sensor(z=D, shape=(20, 20), pitch=SLOPE * D / 3000)
    camera = vcc.Camera([vcc.Lens(focal_length=50 * mm)], sensor)
    plan = camera.compile(light_field)
    assert plan.core.raster_shape == sensor.shape
    assert plan.core.interpolation == "cubic"
    # One view of 2×2 mm at distance D: radiance × steradian, without cos⁴; the sensor sees the cosine's maximum.
    radiance = camera.capture(light_field).to_numpy() / (2 * mm / D) ** 2
    np.testing.assert_allclose(radiance, 0.9, atol=1e-4)
