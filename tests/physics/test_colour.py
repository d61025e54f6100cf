"""Colour: dispersing lenses, prisms and plates, masks by channel, diffractive orders, responses.

Oracles: closed forms, the brute-force tracer with indices written here, and cameras whose numbers are set by hand.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

import vcc
from tests.physics.brute_force import Layer, Scene, ThinLensCamera, cosines, psnr, round_stop, views
from vcc.base.units import mm, nm, um

F, D, C = 486.1327 * nm, 587.5618 * nm, 656.2725 * nm
BANDS = (450 * nm, 520 * nm, 610 * nm, 680 * nm)
CROWN = vcc.glasses.Cauchy(1.5046, 0.0042 * um**2)


def crown(wavelength: float) -> float:
    """The index, written again."""
    return 1.5046 + 0.0042 / (wavelength / um) ** 2


def noise(channels: int | None = 4, views_of: int = 7) -> vcc.LightField:
    """A light field for equalities that hold for any light."""
    shape = (views_of, views_of, 24, 28) if channels is None else (views_of, views_of, 24, 28, channels)
    samples = np.random.default_rng(0).random(shape, np.float32)
    found = vcc.LightField.from_views(samples, 1 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.3))
    return found.with_wavelengths(BANDS[:channels]) if channels is not None else found


SENSOR = vcc.Sensor(z=52.6 * mm, shape=(18, 20), pitch=0.1 * mm)


def same(one, other, tolerance=1e-6):
    one, other = np.asarray(one), np.asarray(other)
    np.testing.assert_allclose(one, other, rtol=0, atol=tolerance * np.abs(other).max())


# --- closed forms ---


def test_focal_shift_of_a_thin_lens_between_f_and_c_is_f_over_v():
    """Δf = f_C − f_F, and 1/f ∝ n − 1: (1/f_F − 1/f_C)·f_d = (n_F − n_C)/(n_d − 1) = 1/V exactly."""
    camera = vcc.Camera([vcc.Lens(50 * mm, glass=vcc.glasses.Abbe(1.5168, 64.17))], SENSOR)
    blue, red = (camera.at_wavelength(line).elements[0].focal_length for line in (F, C))
    assert (1 / blue - 1 / red) * 50 * mm == pytest.approx(1 / 64.17, rel=1e-6)
    assert camera.at_wavelength(D).elements[0].focal_length == pytest.approx(50 * mm, rel=1e-12)


def test_a_prism_disperses_by_its_apex_angle_times_the_change_of_the_index():
    """δ = (n − 1)·α. A point far away lands at −d·δ: fitted in the picture of each band."""
    apex = 0.2
    flint = vcc.glasses.Cauchy(1.62, 0.013 * um**2)
    prism = vcc.Prism((apex * (flint.index(D) - 1), 0.0), glass=flint)
    for band in BANDS:
        expected = apex * (0.62 + 0.013 / (band / um) ** 2)
        (found,) = vcc.Camera([prism], SENSOR).at_wavelength(band).elements
        assert found.deflection == pytest.approx((expected, 0.0), rel=1e-6)


def test_two_cemented_thin_lenses_that_meet_the_condition_of_achromats_have_one_focus_at_f_and_c():
    """f₁V₁ + f₂V₂ = 0 (Born and Wolf, section 4.7.3)."""
    crown, flint = vcc.glasses.Abbe(1.5168, 64.17), vcc.glasses.Abbe(1.62, 36.37)
    one, other = (f * (64.17 - 36.37) / v * 50 * mm for f, v in ((1, 64.17), (-1, 36.37)))
    camera = vcc.Camera([vcc.Lens(one, glass=crown), vcc.Lens(other, glass=flint)], SENSOR)
    powers = [sum(1 / lens.focal_length for lens in camera.at_wavelength(line).elements) for line in (F, D, C)]
    assert powers[0] == pytest.approx(powers[2], rel=1e-6)
    assert 1 / powers[1] == pytest.approx(50 * mm, rel=1e-9)


# --- brute force ---


@pytest.mark.parametrize("seed", range(4))
def test_random_cameras_with_bands_match_brute_force(seed):
    """A lens and a prism of glass, a stop, and a smooth mask for each band, on a plane out of focus.

    Each band shows another texture. Default options; 50 dB, as sharp footprints reach 60 or more on such textures
    (test_masks) and the stop's edge, known by the open share of each view's cell, costs some.
    """
    rng = np.random.default_rng(seed)
    spacing, slope, focus, diameter = 1 * mm, 1e-3, 1.0, 14 * mm
    f, distance = 50 * mm, 1 / (1 / (50 * mm) - 1 / 1.0)
    apex = rng.uniform(-4e-3, 4e-3)
    disparity = rng.uniform(-0.5, 0.5)
    away = 1 / (disparity * slope / spacing + 1 / focus)
    mask_z, phases = rng.uniform(0.3, 0.9) * distance, rng.uniform(0, 6, len(BANDS))
    period = rng.uniform(4, 7) * mm
    glass = vcc.glasses.Cauchy(1.5046, 0.0042 * um**2)

    def shade(phase):
        return lambda x, y: 0.5 + 0.4 * np.cos(2 * np.pi * x / period + phase) + 0 * y

    masks = vcc.patterns.ByChannel(tuple(vcc.patterns.as_pattern(shade(phase)) for phase in phases))
    camera = vcc.Camera(
        [
            vcc.Lens(f, diameter, glass=glass, design_wavelength=D),
            vcc.Prism((apex * (crown(D) - 1), 0.0), glass=glass, design_wavelength=D),
            vcc.Mask(masks, z=mask_z),
        ],
        vcc.Sensor(z=distance, shape=(40, 40), pitch=distance * slope),
    )
    samples, expected = [], []
    for number, band in enumerate(BANDS):
        periods = np.array([26.0, 34.0, 47.0, 70.0]) * slope * away
        scene = Scene([Layer(away, cosines(10 * seed + number, periods))])
        samples.append(views(scene, (18, 18, 84, 84), spacing, slope, focus))
        bent = apex * (crown(band) - 1)
        strength = (crown(band) - 1) / (crown(D) - 1)

        def moved(x, y, bent=bent, scene=scene):
            return scene.layers[0].texture(x + away * bent, y)

        tracer = ThinLensCamera(
            f / strength,
            round_stop(diameter, 8, 24),
            distance,
            (40, 40),
            distance * slope,
            [(mask_z, shade(phases[number]))],
        )
        expected.append(tracer.picture(Scene([Layer(away, moved)])))
    light_field = vcc.LightField.from_views(
        np.stack(samples, axis=-1).astype(np.float32), spacing, slope, focus, (disparity, disparity), "point"
    ).with_wavelengths(BANDS)
    with warnings.catch_warnings():
        warnings.simplefilter("error", vcc.ResultWarning)
        image = camera.capture(light_field).values
    reached = [psnr(image[..., n], expected[n]) for n in range(len(BANDS))]
    print(seed, np.round(reached, 1))
    assert min(reached) >= 50


# --- band by band: numbers set by hand ---


def scaled(band: float) -> float:
    return (crown(band) - 1) / (crown(D) - 1)


PATHS = np.random.default_rng(3).random((6, 6)) * 2 * um
SLOPES = np.random.default_rng(4).normal(size=(3, 3, 2)) * 0.01
CASES = {
    "lens": (lambda how: vcc.Lens(50 * mm, 6 * mm, **how), lambda k: vcc.Lens(50 * mm / k, 6 * mm)),
    "prism": (lambda how: vcc.Prism((0.01, 0.02), **how), lambda k: vcc.Prism((0.01 * k, 0.02 * k))),
    "biprism": (lambda how: vcc.Biprism(0.01, 0.3, 6 * mm, **how), lambda k: vcc.Biprism(0.01 * k, 0.3, 6 * mm)),
    "lens array": (
        lambda how: vcc.LensArray(1 * mm, (50 * mm, 60 * mm), width=6 * mm, **how),
        lambda k: vcc.LensArray(1 * mm, (50 * mm / k, 60 * mm / k), width=6 * mm),
    ),
    "prism array": (
        lambda how: vcc.PrismArray(SLOPES, 2 * mm, focal_length=60 * mm, **how),
        lambda k: vcc.PrismArray(SLOPES * k, 2 * mm, focal_length=60 * mm / k),
    ),
    "quadratic plate": (
        lambda how: vcc.PhasePlate(vcc.surfaces.Quadratic(50 * mm), diameter=6 * mm, **how),
        lambda k: vcc.PhasePlate(vcc.surfaces.Quadratic(50 * mm / k), diameter=6 * mm),
    ),
    "path map": (
        lambda how: vcc.PhasePlate(vcc.surfaces.PathMap(PATHS, 6 * mm), **how),
        lambda k: vcc.PhasePlate(vcc.surfaces.PathMap(PATHS * k, 6 * mm)),
    ),
    "height map": (
        lambda how: vcc.PhasePlate(vcc.surfaces.HeightMap(PATHS, 6 * mm, refractive_index=crown(D)), **how),
        lambda k: vcc.PhasePlate(vcc.surfaces.PathMap(PATHS * (crown(D) - 1) * k, 6 * mm)),
    ),
    "slopes by a function": (
        lambda how: vcc.PhasePlate(lambda x, y: (-x / 0.05, 2 * x), diameter=6 * mm, **how),
        lambda k: vcc.PhasePlate(lambda x, y: (-x * k / 0.05, 2 * x * k), diameter=6 * mm),
    ),
}


@pytest.mark.filterwarnings("ignore:.* of the rays:vcc.ResultWarning")
@pytest.mark.parametrize("name", CASES)
def test_bands_are_images_of_elements_with_their_numbers_set_by_hand(name):
    made, by_hand = CASES[name]
    light_field = noise()
    glass = {"glass": CROWN, "design_wavelength": D}
    options = {"samples": 64} if name not in ("lens", "prism", "quadratic plate") else {}
    image = vcc.Camera([vcc.Lens(80 * mm, 6 * mm), made(glass)], SENSOR).capture(light_field, **options)
    assert image.shape == (18, 20, 4)
    for n, band in enumerate(BANDS):
        camera = vcc.Camera([vcc.Lens(80 * mm, 6 * mm), by_hand(scaled(band))], SENSOR)
        same(image.values[..., n], camera.capture(light_field[..., n : n + 1], **options).values[..., 0], 2e-6)


def test_a_mask_of_channels_is_a_mask_for_each():
    light_field = noise()
    cells = np.random.default_rng(1).random((5, 6, 4))
    cells[..., 2] = 0  # nothing passes: a dark channel
    lens = vcc.Lens(50 * mm, 6 * mm)
    image = vcc.Camera([lens, vcc.Mask(cells, 5 * mm, z=20 * mm)], SENSOR).capture(light_field).values
    for n in (0, 1, 3):
        mask = vcc.Mask(cells[..., n], 5 * mm, z=20 * mm)
        same(image[..., n], vcc.Camera([lens, mask], SENSOR).capture(light_field[..., n : n + 1]).values[..., 0])
    assert not image[..., 2].any()


def test_filters_side_by_side_let_pass_the_sum_of_pattern_times_spectrum():
    """A colour filter array before the sensor; some cells of round filters, which no array holds, likewise."""
    light_field = noise()
    filters = [vcc.Spectrum((400 * nm, 700 * nm), (0.9, 0.1)), lambda wavelength: wavelength / um - 0.3]
    shares = np.array([[0.9 - 0.8 * (band / nm - 400) / 300, band / um - 0.3] for band in BANDS])
    lens = vcc.Lens(50 * mm, 6 * mm)
    tiles = np.stack([np.indices((6, 6)).sum(axis=0) % 2, 1 - np.indices((6, 6)).sum(axis=0) % 2], axis=-1)
    image = vcc.Camera([lens, vcc.Mask(tiles, 2 * mm, spectrum=filters, z=50 * mm)], SENSOR).capture(light_field)
    for n in range(4):
        mask = vcc.Mask(tiles @ shares[n], 2 * mm, z=50 * mm)
        same(
            image.values[..., n],
            vcc.Camera([lens, mask], SENSOR).capture(light_field[..., n : n + 1]).values[..., 0],
        )
    rounds = (vcc.patterns.Circle(2 * mm), vcc.patterns.Polygon(3, 4 * mm))
    mask = vcc.Mask(vcc.patterns.ByChannel(rounds), spectrum=filters, z=20 * mm)
    image = vcc.Camera([lens, mask], SENSOR).capture(light_field)
    alone = [vcc.Camera([lens, vcc.Mask(each, z=20 * mm)], SENSOR).capture(light_field).values for each in rounds]
    same(image.values, np.einsum("frcb,bf->rcb", alone, shares))


def test_a_filter_shares_the_plan_of_all_bands():
    light_field = noise()
    gray = vcc.Mask(vcc.patterns.Open(), spectrum=vcc.Spectrum((400 * nm, 700 * nm), (0.0, 1.0)), z=10 * mm)
    camera = vcc.Camera([vcc.Lens(50 * mm, 6 * mm), gray], SENSOR)
    assert "1 plan, 4 channel images" in camera.explain(light_field)
    plain = vcc.Camera([vcc.Lens(50 * mm, 6 * mm)], SENSOR).capture(light_field).values
    same(camera.capture(light_field).values, plain * [(band / nm - 400) / 300 for band in BANDS])


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
def test_a_diffractive_lens_is_the_sum_of_its_orders():
    light_field = noise()
    lens = vcc.DiffractiveLens(50 * mm, 6 * mm, 532 * nm, (1, 0, -1, 2))
    image = vcc.Camera([lens], SENSOR).capture(light_field, method="footprints").values
    for n, band in enumerate(BANDS):
        total = 0.0
        for order in (1, 0, -1, 2):
            x = math.pi * (532 * nm / band - order)
            share = (math.sin(x) / x) ** 2
            at_order = vcc.Mask(vcc.patterns.Circle(6 * mm))
            if order:
                at_order = vcc.Lens(50 * mm * 532 * nm / (order * band), 6 * mm)
            one = vcc.Camera([at_order], SENSOR).capture(light_field[..., n : n + 1], method="footprints")
            total = total + share * one.values[..., 0]
        same(image[..., n], total, 3e-4)  # the orders of less than 1e-4 are left out


def test_all_orders_of_a_blazed_profile_have_all_light():
    """Σ sinc²(a − m) = 1 over all whole m, and the tail beyond |m| = 50 has 2/(π²·50)·sin²(πa) at most."""
    lens = vcc.DiffractiveLens(50 * mm, orders=tuple(range(-50, 51)))
    for band in BANDS:
        total = sum(lens.efficiency(order, band) for order in lens.orders)
        assert 1 - 2 / (math.pi**2 * 49) < total < 1
    assert lens.efficiency(1, D) == pytest.approx(1)


# --- the sensor's response ---


def test_a_response_matrix_mixes_the_images_of_bands():
    light_field = noise()
    lens = vcc.Lens(50 * mm, 6 * mm, glass=CROWN)
    matrix = np.random.default_rng(2).random((3, 4))
    bands = vcc.Camera([lens], SENSOR).capture(light_field).values
    mixed = vcc.Camera([lens], vcc.Sensor(SENSOR.z, SENSOR.shape, SENSOR.pitch, response=matrix))
    same(mixed.capture(light_field).values, np.einsum("rcb,kb->rck", bands, matrix))


def test_curves_are_integrals_over_the_bands_and_mono_is_an_even_one():
    """Bands at 450, 520, 610 and 680 nm are 70, 80, 80 and 70 nm wide, of 300."""
    light_field = noise()
    widths = np.array([70, 80, 80, 70]) / 300
    bands = vcc.Camera([vcc.Lens(50 * mm, 6 * mm)], SENSOR).capture(light_field).values
    red = vcc.Spectrum((400 * nm, 700 * nm), (0.0, 1.0))
    rows = {
        "mono": np.ones((1, 4)),
        (red, lambda wavelength: 0.5): [(np.array(BANDS) / nm - 400) / 300, [0.5] * 4],
    }
    for response, curves in rows.items():
        sensor = vcc.Sensor(SENSOR.z, SENSOR.shape, SENSOR.pitch, response=response)
        image = vcc.Camera([vcc.Lens(50 * mm, 6 * mm)], sensor).capture(light_field).values
        expected = np.einsum("rcb,kb->rck", bands, curves * widths)
        same(image if response != "mono" else image[..., None], expected)


def test_a_colour_filter_behind_a_response():
    light_field = noise()
    matrix = np.random.default_rng(2).random((3, 4))
    electronics = vcc.Electronics(color_filter="RGGB", read_noise=0, prnu=0)
    sensor = vcc.Sensor(SENSOR.z, SENSOR.shape, SENSOR.pitch, electronics=electronics, response=matrix)
    camera = vcc.Camera([vcc.Lens(50 * mm, 6 * mm, glass=CROWN)], sensor)
    light = camera.capture(light_field).values
    recording = camera.expose(light_field, "auto", seed=1)
    assert recording.values.shape == SENSOR.shape
    # Shot noise of thousands of electrons: a per cent or two a pixel, and less in the mean over a ninth of them.
    assert recording.irradiance()[::2, ::2].mean() == pytest.approx(light[::2, ::2, 0].mean(), rel=0.02)
    two = vcc.Sensor(SENSOR.z, SENSOR.shape, SENSOR.pitch, electronics=electronics, response=matrix[:2])
    with pytest.raises(vcc.InputError, match="wants light of 3 channels"):
        vcc.Camera(camera.elements, two).expose(light_field)
