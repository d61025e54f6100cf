"""Exposures: photons, electrons, numbers, colour filters, saturation, and what is refused.

Oracles: the constants of the SI and of EMVA 1288 worked out by hand, the moments of the Poisson and normal
distributions, positions of filters counted on paper.
"""

import dataclasses
import json
import sys
import warnings

import imagecodecs
import numpy as np
import pytest
import tifffile
from scipy.stats import norm

import vcc
from vcc.files.pictures import read_picture
from vcc.optics.electronics import Electronics
from vcc.run.demosaic import demosaic
from vcc.run.expose import Exposure, below_zero, fixed_pattern

QUIET = Electronics(read_noise=0, dark_current=0)
XTRANS = ("GBGGRG", "RGRBGB", "GBGGRG", "GRGGBG", "BGBRGR", "GRGGBG")


def sensor(electronics=QUIET, shape=(64, 96), pitch=5e-6, **options):
    return vcc.Sensor(z=0.05, shape=shape, pitch=pitch, electronics=electronics, **options)


def picture(value, on):
    """The same light on every pixel; one number, or one per channel."""
    values = np.broadcast_to(np.float32(value), (*on.shape, *np.shape(value)))
    return vcc.Image(values, on.frame)


def flat(electronics, charge, shape=(512, 512), exposure=1e-2, seed=0):
    """A recording whose pixels free so many photo-electrons on average."""
    on = sensor(electronics, shape)
    # E = charge·h·c / (η·λ·A·t), with h·c = 1.98644586e-25 J·m (CODATA)
    per_watt = electronics.quantum_efficiency * electronics.wavelength / 1.98644586e-25 * 25e-12 * exposure
    return vcc.expose_image(picture(charge / per_watt, on), on, exposure, seed=seed)


# --- photons and electrons ---


def test_photons_by_hand():
    """EMVA 1288 eq. 3: μ_p = 50.34 · A[µm²] · t[ms] · λ[µm] · E[µW/cm²], here 50.34 · 25 · 1 · 0.55 · 100 = 69218.

    1 W/m² is 100 µW/cm². The constant has four digits: 1e-4 of rounding.
    """
    wide = Electronics(1.0, full_well=1e6, gain=0.05, black_level=0, bit_depth=16, read_noise=0, dark_current=0)
    on = sensor(wide, (512, 512))
    mean = vcc.expose_image(picture(1.0, on), on, 1e-3).electrons().mean(dtype=np.float64)
    # Mean of 512² Poisson numbers of 69218: 3 standard errors are 3·√69218/512 = 1.5, 2.2e-5 of it.
    assert mean == pytest.approx(69218, rel=1.3e-4)
    # To all digits, from the SI: 1 W/m² · 25e-12 m² · 1e-3 s · 550e-9 m / (h·c) = 69219.1
    assert wide.electrons_per_joule() * 25e-15 == pytest.approx(69219.1, abs=0.1)


def test_half_of_everything_is_half_of_the_electrons():
    """Radiance, time, area, fill factor, wavelength and efficiency all enter once."""
    base = flat(QUIET, 4000).electrons().mean(dtype=np.float64)
    on = sensor(shape=(512, 512))
    light = picture(4000 / (QUIET.electrons_per_joule() * 25e-12 * 1e-2), on)

    def mean(on=on, exposure=1e-2, **options):
        return vcc.expose_image(light, on, exposure, **options).electrons().mean(dtype=np.float64)

    def on_with(**changes):
        return dataclasses.replace(on, electronics=dataclasses.replace(QUIET, **changes))

    halves = [
        mean(radiance=0.5),
        mean(exposure=5e-3),
        mean(dataclasses.replace(on, fill_factor=0.5)),
        mean(dataclasses.replace(on, pitch=(2.5e-6, 5e-6))),
        mean(on_with(quantum_efficiency=0.3)),
        mean(on_with(wavelength=275e-9)),
    ]
    # Standard errors √4000/512 = 0.12 and √2000/512 = 0.09 electrons; four of them
    assert base == pytest.approx(4000, abs=0.5)
    assert halves == pytest.approx([2000] * 6, abs=0.4)


@pytest.mark.parametrize("charge", [3, 400, 7000])
def test_shot_noise_is_poisson(charge):
    """Variance = mean, in electrons; the standard error of the variance is √(2/N + 1/(N·mean)) of it."""
    fine = dataclasses.replace(QUIET, gain=1.0, bit_depth=16, full_well=60_000)
    got = flat(fine, charge).electrons().astype(np.float64)
    n = got.size
    assert got.mean() == pytest.approx(charge, abs=4 * np.sqrt(charge / n))
    assert got.var() == pytest.approx(charge, rel=4 * np.sqrt(2 / n + 1 / (n * charge)))


def test_read_noise_and_dark_current_add_their_variances():
    noisy = dataclasses.replace(QUIET, gain=4.0, bit_depth=16, black_level=500, read_noise=6.0, dark_current=2000)
    n = 512 * 512
    for exposure in (5e-3, 10e-3, 20e-3):  # the mean is linear in time
        dark = flat(noisy, 0, exposure=exposure).electrons().astype(np.float64)
        charge = 2000 * exposure
        variance = charge + 36 + 1 / 12 / 16  # Poisson, Gaussian, rounding
        assert dark.mean() == pytest.approx(charge, abs=4 * np.sqrt(variance / n))
        # nearly Gaussian: excess kurtosis of the Poisson part at most 1/10, so √(2.1/N) of it
        assert dark.var() == pytest.approx(variance, rel=4 * np.sqrt(2.1 / n))


def test_black_level_is_where_no_electrons_are():
    got = flat(dataclasses.replace(QUIET, black_level=100), 0)
    assert (got.values == 100).all()
    assert (got.electrons() == 0).all()
    assert got.saturated == 0


@pytest.mark.parametrize(("bits", "kind"), [(1, np.uint8), (8, np.uint8), (10, np.uint16), (16, np.uint16)])
def test_bit_depth_bounds_the_numbers(bits, kind):
    got = flat(dataclasses.replace(QUIET, bit_depth=bits, black_level=0, gain=2.0**bits), 5000, (8, 8))
    assert got.values.dtype == kind
    assert (got.values == 2**bits - 1).all()
    assert got.saturated == 1


def test_numbers_are_rounded_not_cut():
    got = flat(dataclasses.replace(QUIET, black_level=0.5, gain=0.4), 5000)
    assert got.values.dtype == np.uint16
    # 0.5 + 0.4 · 5000; cutting instead of rounding would lose half a number, 1.25 electrons
    assert got.electrons().mean(dtype=np.float64) == pytest.approx(5000, abs=4 * np.sqrt(5001) / 512)


def test_saturation_at_the_full_well_comes_before_read_noise():
    """Charge is cut, then read: above the full well there is noise still, and the mean is the full well's."""
    well = dataclasses.replace(QUIET, full_well=2000, read_noise=5.0)
    got = flat(well, 50_000)
    charge = got.electrons().astype(np.float64)
    assert got.saturated == 1
    assert charge.mean() == pytest.approx(2000, abs=4 * np.sqrt(25.6) / 512)
    assert charge.var() == pytest.approx(25 + 1 / 12 / 0.16, rel=4 * np.sqrt(2) / 512)
    assert got.values.max() < 4095


def test_digital_saturation():
    """Gain 1: 4095 − 64 = 4031 electrons fill the range, long before the full well."""
    got = flat(dataclasses.replace(QUIET, gain=1.0), 6000)
    assert (got.values == 4095).all()
    assert got.saturated == 1
    assert got.electronics.saturation == 4031
    assert flat(dataclasses.replace(QUIET, gain=1.0), 2000).saturated == 0


def test_half_of_the_pixels_saturate_where_the_mean_is_the_full_well():
    got = flat(dataclasses.replace(QUIET, full_well=2000, gain=1.0), 2000)
    # The median of Poisson(2000) is 2000, P(at least that) = 0.503; 512² pixels tell it to ±0.004 (4 σ)
    assert got.saturated == pytest.approx(0.503, abs=0.004)


def test_absurd_overexposure_saturates():
    assert flat(QUIET, 1e25, (8, 8)).saturated == 1


# --- non-uniformity ---


def test_patterns_belong_to_the_sensor_and_noise_to_the_recording():
    uneven = Electronics(prnu=0.02, dsnu=20.0, gain=1.0, bit_depth=16, full_well=50_000)
    frames = np.array([flat(uneven, 10_000, (256, 256), seed=seed).electrons() for seed in range(8)], np.float64)
    # Spatial variance of the pixel means, less the share of the temporal variance 10000 + 6 that 8 frames leave:
    # (2 % of 10000)² + 20². Standard error of such a variance: √(2/65536) = 0.55 % of it; four of them.
    spatial = frames.mean(0).var() - 10_016 / 8
    assert spatial == pytest.approx(200**2 + 20**2, rel=4 * 0.0055)
    dark = np.array([flat(uneven, 0, (256, 256), seed=seed).electrons() for seed in range(8)], np.float64)
    assert dark.mean(0).std() == pytest.approx(20.0, rel=0.02)  # 4 standard errors 1.1 %, black level clips none
    # The temporal noise knows nothing of it.
    assert (frames[0] - frames[1]).var() / 2 == pytest.approx(10_006, rel=4 * 0.0055)


def test_another_sensor_has_another_pattern():
    uneven = Electronics(dsnu=50.0, read_noise=0, dark_current=0, black_level=1000)
    one, same, other = (
        flat(dataclasses.replace(uneven, pattern_seed=pattern), 0, (64, 64), seed=seed).electrons()
        for pattern, seed in ((0, 0), (0, 9), (1, 0))
    )
    assert np.array_equal(one, same)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 4 / 64


# --- seeds ---


def test_seeds_reproduce_and_differ():
    one, same, other = (flat(Electronics(), 3000, seed=seed) for seed in (1, np.int64(1), 2))
    assert np.array_equal(one.values, same.values)
    noise, others = (each.electrons().ravel() - 3000 for each in (one, other))
    assert abs(np.corrcoef(noise, others)[0, 1]) < 4 / 512


@pytest.mark.parametrize("threads", [1, 2, 7])
def test_numbers_are_the_same_on_any_number_of_threads(threads):
    on = sensor(shape=(1100, 512))  # three blocks of rows
    light = picture(1, on)
    recorded = vcc.expose_image(light, on, 1e-3, seed=1, threads=threads)
    assert np.array_equal(recorded.values, vcc.expose_image(light, on, 1e-3, seed=1).values)


def test_blocks_of_rows_have_noise_of_their_own():
    """512² pixels are one block; 1024 × 512 two, which must not repeat each other."""
    got = flat(Electronics(), 3000, (1024, 512)).electrons() - 3000
    assert abs(np.corrcoef(got[:512].ravel(), got[512:].ravel())[0, 1]) < 4 / 512


@pytest.mark.parametrize("seed", [1.0, True, np.True_, "1", None, -1, np.float32(2)])
def test_seeds_are_whole_numbers(seed):
    on = sensor()
    with pytest.raises(vcc.InputError, match="whole number"):
        vcc.expose_image(picture(1, on), on, 1e-3, seed=seed)
    with pytest.raises(vcc.InputError, match="pattern_seed"):
        Electronics(pattern_seed=seed)


# --- exposure ---


def test_auto_exposure_brings_the_brightest_to_ninety_percent():
    """0 … 1 evenly over 64 × 96 pixels: the brightest 0.1 %, six or seven of them, begin at 0.999."""
    dark = 2e7  # electrons a second, a quarter of the light's
    on = sensor(dataclasses.replace(QUIET, dark_current=dark))
    ramp = np.linspace(0, 1, 64 * 96, dtype=np.float32).reshape(64, 96)
    got = vcc.expose_image(vcc.Image(ramp, on.frame), on, "auto", radiance=2.0)
    rate = 2.0 * 0.999 * 25e-12 * 0.6 * 550e-9 / 1.98644586e-25
    assert got.exposure == pytest.approx(9000 / (rate + dark), rel=2e-4)  # the ramp's step is 1.6e-4
    small = dataclasses.replace(on, electronics=dataclasses.replace(QUIET, gain=1.0))
    assert vcc.expose_image(vcc.Image(ramp, on.frame), small, "auto").exposure == pytest.approx(
        2 * 0.9 * 4031 / rate, rel=2e-4
    )


def test_auto_exposure_of_colours_goes_by_the_pixels_brightest_channel():
    """3 of 1000 pixels are 4 times as blue: 0.1 % of all numbers are, but 0.3 % of the pixels, which saturated."""
    on = sensor(shape=(20, 50))
    values = np.full((20, 50, 3), 0.25, np.float32)
    values[:3, 0, 2] = 1.0
    got = vcc.expose_image(vcc.Image(values, on.frame), on, "auto")
    assert got.saturated == 0
    assert got.electrons().max() == pytest.approx(9000, rel=0.05)  # 5 standard deviations of Poisson(9000)


def test_auto_exposure_of_stars_goes_by_the_brightest():
    on = sensor()
    stars = np.zeros(on.shape, np.float32)
    stars[3, 4] = 1.0
    got = vcc.expose_image(vcc.Image(stars, on.frame), on, "auto")
    assert got.electrons().max() == pytest.approx(9000, rel=0.05)  # 5 standard deviations of Poisson(9000)


@pytest.mark.parametrize("exposure", [0, -1e-3, np.nan, np.inf, "10 ms", None, True, [1e-3]])
def test_exposures_that_are_none(exposure):
    on = sensor()
    with pytest.raises(vcc.InputError, match="exposure must be greater than 0 s"):
        vcc.expose_image(picture(1, on), on, exposure)


@pytest.mark.parametrize("radiance", [0, -1.0, np.nan, "1", False])
def test_radiances_that_are_none(radiance):
    on = sensor()
    with pytest.raises(vcc.InputError, match="radiance is what a sample value of 1 stands for, greater than 0"):
        vcc.expose_image(picture(1, on), on, 1e-3, radiance=radiance)


@pytest.mark.parametrize(
    ("light", "on", "exposure", "words"),
    [
        (picture(0, sensor()), sensor(), "auto", "picture is black"),
        (picture(np.nan, sensor()), sensor(), 1e-3, "not finite"),
        (picture(1, sensor()).upright(), sensor(), 1e-3, "image is upright"),
        (picture(1, sensor(shape=(3, 4))), sensor(), 1e-3, "64, 96"),
        (picture(1, sensor()), sensor(None), 1e-3, r"electronics=vcc\.Electronics"),
    ],
)
def test_pictures_that_cannot_be_exposed(light, on, exposure, words):
    with pytest.raises(vcc.InputError, match=words):
        vcc.expose_image(light, on, exposure)


def test_light_below_zero_is_dark_and_said_to_be():
    on = sensor()
    values = np.ones(on.shape, np.float32)
    values[0, 0] = -0.3
    with pytest.warns(vcc.ResultWarning, match="cannot be negative"):
        got = vcc.expose_image(vcc.Image(values, on.frame), on, 1e-2)
    assert got.values[0, 0] == 64
    # What sharp interpolation undershoots beside a hard edge is not worth a word (warnings are errors here): a
    # step of 1 filtered by [0.019, −0.202, 1.366, −0.202, 0.019], after the tent and the mean that it undoes, goes
    # down to −0.09 at most, one in the light field's own border to −0.13.
    values[0, 0] = -0.13
    assert vcc.expose_image(vcc.Image(values, on.frame), on, 1e-2).values[0, 0] == 64


# --- back to light ---


def test_image_gives_back_what_was_captured():
    """Of a billion electrons, shot noise leaves 3.2e-5, and 16 bits 1.5e-5 of full scale."""
    vast = Electronics(0.5, full_well=2e9, gain=5e-5, bit_depth=16, read_noise=0, dark_current=1e8, black_level=9)
    on = sensor(vast, fill_factor=0.4)
    values = np.random.default_rng(3).uniform(0.2, 1, (*on.shape, 3)).astype(np.float32)
    image = vcc.Image(values, on.frame, missing_rays=0.25)
    recorded = vcc.expose_image(image, on, "auto", radiance=7.0)
    got = recorded.image()
    assert np.abs(got.values - values).max() < 6 * (3.2e-5 + 1.5e-5)  # of 18432 draws, none beyond 6 σ
    assert got.values.dtype == np.float32
    assert got.missing_rays == 0.25
    assert np.array_equal(got.frame.matrix, image.frame.matrix)


def test_each_channel_has_its_own_efficiency_and_wavelength():
    eta, wavelength = (0.3, 0.6, 0.5), (600e-9, 540e-9, 460e-9)
    three = dataclasses.replace(QUIET, quantum_efficiency=eta, wavelength=wavelength)
    on = sensor(three, (256, 256))
    got = vcc.expose_image(picture((0.05, 0.05, 0.05), on), on, 1e-3)
    want = [0.05 * 25e-15 * e * w / 1.98644586e-25 for e, w in zip(eta, wavelength, strict=True)]
    standard = np.sqrt(np.array(want) + 0.6) / 256
    assert np.all(np.abs(got.electrons().mean((0, 1), dtype=np.float64) - want) < 4 * standard)
    assert got.image().values.mean((0, 1)) == pytest.approx(0.05, rel=4 * np.max(standard / want))


# --- colour filters ---


@pytest.mark.parametrize(
    ("tile", "red", "blue"),
    [
        ("RGGB", (0, 0), (1, 1)),
        ("GRBG", (0, 1), (1, 0)),
        ("GBRG", (1, 0), (0, 1)),
        ("bggr", (1, 1), (0, 0)),
        (("RG", "GB"), (0, 0), (1, 1)),
        ("0112", (0, 0), (1, 1)),
    ],
)
def test_each_pixel_records_its_filter(tile, red, blue):
    on = sensor(dataclasses.replace(QUIET, color_filter=tile), (6, 8))
    want = np.full((6, 8), 2.0)
    want[red[0] :: 2, red[1] :: 2] = 1.0
    want[blue[0] :: 2, blue[1] :: 2] = 3.0
    got = vcc.expose_image(picture((1.0, 2.0, 3.0), on), on, "auto")
    assert got.values.shape == (6, 8)
    assert np.abs(got.image().values - want).max() < 0.3  # 3 ± 0.032 (σ of 9000 electrons) and so on


def test_a_tile_of_six_by_six():
    on = sensor(dataclasses.replace(QUIET, color_filter=XTRANS), (13, 14))
    got = np.rint(vcc.expose_image(picture((1.0, 2.0, 3.0), on), on, "auto").image().values)
    letters = np.array([[" RGB"[int(value)] for value in row] for row in got])
    assert ["".join(row) for row in letters[:6, :6]] == list(XTRANS)
    assert np.array_equal(letters[6:12, 6:12], letters[:6, :6])
    assert np.array_equal(letters[12, :6], letters[0, :6])


@pytest.mark.parametrize("tile", ["RGGB", "GRBG", "GBRG", "BGGR"])
@pytest.mark.parametrize("method", ["menon", "malvar", "bilinear"])
def test_demosaicing_a_constant_colour_gives_it_back(tile, method):
    """Without noise, up to float32 and rounding to numbers: DN are chosen, not drawn."""
    plain = dataclasses.replace(QUIET, color_filter=tile, black_level=0, gain=1.0)
    on = sensor(plain, (12, 17))
    numbers = {"R": 1000, "G": 2000, "B": 3000}
    values = np.empty(on.shape, np.uint16)
    for n, letter in enumerate(tile):
        values[n // 2 :: 2, n % 2 :: 2] = numbers[letter]
    got = vcc.Recording(values, on, 1e-3).demosaiced(method)
    want = np.array(list(numbers.values())) / (plain.electrons_per_joule() * 25e-15)
    assert got.shape == (12, 17, 3)
    assert np.allclose(got.values, want, rtol=1e-6)


def test_bilinear_is_the_library_s():
    """Away from the border, where the library mirrors and ours leaves out what is not there."""
    colour_demosaicing = pytest.importorskip("colour_demosaicing")
    on = sensor(Electronics(color_filter="GRBG"), (20, 31))
    values = np.random.default_rng(0).uniform(0, 1, (20, 31, 3)).astype(np.float32)
    got = vcc.expose_image(vcc.Image(values, on.frame), on, "auto")
    library = colour_demosaicing.demosaicing_CFA_Bayer_bilinear(got.image().values, "GRBG")
    assert np.allclose(got.demosaiced("bilinear").values[2:-2, 2:-2], library[2:-2, 2:-2], atol=1e-6)


@pytest.mark.parametrize("tile", [XTRANS, ("RGB",), ("0123", "3201"), ("R",)])
def test_any_tile_is_demosaiced(tile):
    on = sensor(dataclasses.replace(QUIET, color_filter=tile), (23, 19))
    colour = np.arange(1, on.electronics.channels + 1, dtype=np.float32)
    got = vcc.expose_image(picture(colour, on), on, "auto").demosaiced()
    # Averages are no noisier than single pixels: √(1/9000·channels) of the weakest, 6 of them
    assert np.abs(got.values / colour - 1).max() < 6 * np.sqrt(len(colour) / 9000)
    if tile != ("R",):
        with pytest.raises(vcc.InputError, match='method="bilinear"'):
            vcc.expose_image(picture(colour, on), on, "auto").demosaiced("menon")


def test_edge_following_demosaicing_beats_the_plain_one_on_edges():
    """Slanted grey edges, the reason for the default: what each method knows of edges orders their errors."""
    on = sensor(dataclasses.replace(QUIET, color_filter="RGGB"), (96, 96))
    row, column = np.mgrid[:96, :96]
    grey = 0.5 + 0.4 * np.clip(np.sin((row + 2.3 * column) / 4) * 3, -1, 1)
    values = np.repeat(grey[..., None], 3, axis=2).astype(np.float32)
    got = vcc.expose_image(vcc.Image(values, on.frame), on, "auto")
    error = {
        method: np.sqrt(np.mean((got.demosaiced(method).values - values)[4:-4, 4:-4] ** 2))
        for method in ("menon", "malvar", "bilinear")
    }
    assert got.demosaiced().values.tolist() == got.demosaiced("menon").values.tolist()
    assert error["menon"] < error["malvar"] < error["bilinear"]


def test_demosaicing_that_cannot_be(monkeypatch):
    on = sensor(dataclasses.replace(QUIET, color_filter="RGGB"), (8, 8))
    got = vcc.expose_image(picture((1, 1, 1), on), on, "auto")
    with pytest.raises(vcc.InputError, match="is 'menon', 'malvar' or 'bilinear', not 'vng'"):
        got.demosaiced("vng")
    grey = vcc.expose_image(picture(1, sensor()), sensor(), "auto")
    with pytest.raises(vcc.InputError, match=r"image\(\)"):
        grey.demosaiced()
    tiny = sensor(dataclasses.replace(QUIET, color_filter=XTRANS), (8, 5))
    with pytest.raises(vcc.InputError, match="smaller than a tile"):
        vcc.expose_image(picture((1, 1, 1), tiny), tiny, "auto").demosaiced()
    monkeypatch.setitem(sys.modules, "colour_demosaicing", None)
    with pytest.raises(vcc.InputError, match=r"virtual-computational-camera\[demosaic\]"):
        got.demosaiced()
    got.demosaiced("bilinear")


def test_demosaicing_leaves_the_process_as_it_was(monkeypatch):
    """The library changes how NumPy prints when it is imported; we do not."""
    for name in [name for name in sys.modules if name.split(".")[0] in ("colour", "colour_demosaicing")]:
        monkeypatch.delitem(sys.modules, name)
    before = np.get_printoptions()
    on = sensor(dataclasses.replace(QUIET, color_filter="RGGB"), (8, 8))
    vcc.expose_image(picture((1, 1, 1), on), on, "auto").demosaiced()
    assert "colour_demosaicing" in sys.modules
    assert np.get_printoptions() == before


@pytest.mark.parametrize(
    ("light", "electronics", "message"),
    [
        (1.0, {"color_filter": "RGGB"}, "light field is grey"),
        ((1.0, 1.0), {"color_filter": "RGGB"}, "has 2 channels"),
        ((1.0,) * 4, {"color_filter": "RGGB"}, "has 4 channels"),
        ((1.0,), {"color_filter": "RGGB"}, "has 1 channel\\b"),
        ((1.0, 1.0), {"quantum_efficiency": (0.5, 0.5, 0.5)}, "has 2 channels"),
        (1.0, {"wavelength": (6e-7, 5e-7)}, "light field is grey"),
    ],
)
def test_channels_that_do_not_fit(light, electronics, message):
    on = sensor(Electronics(**electronics))
    with pytest.raises(vcc.InputError, match=message):
        vcc.expose_image(picture(light, on), on, "auto")


# --- recordings ---


@pytest.mark.parametrize(
    ("values", "electronics", "words"),
    [
        (np.zeros((4, 6)), Electronics(), "uint8 or uint16"),
        (np.zeros((6, 4), np.uint16), Electronics(), r"\(4, 6\)"),
        (np.zeros((4, 6, 3), np.uint16), Electronics(color_filter="RGGB"), "one number"),
        (np.zeros((4, 6, 3), np.uint16), Electronics((0.5, 0.6)), "has 3 channels"),
    ],
)
def test_recordings_that_are_none(values, electronics, words):
    with pytest.raises(vcc.InputError, match=words):
        vcc.Recording(values, sensor(electronics, (4, 6)), 1e-3)


def test_repr_says_what_was_recorded_and_what_to_do_with_it():
    on = sensor(Electronics(color_filter="GBRG"))
    words = repr(vcc.expose_image(picture((1, 1, 1), on), on, 1e-2, seed=5))
    for part in (
        "64×96",
        "5 um",
        "GBRG",
        "10 ms",
        "100.00% of the pixels saturated",
        "seed 5",
        "4095",
        "demosaiced",
    ):
        assert part in words


@pytest.mark.parametrize("ending", [".tif", ".png", ".npy"])
@pytest.mark.parametrize("bits", [8, 12])
def test_raw_files_hold_the_numbers(tmp_path, ending, bits):
    on = sensor(Electronics(color_filter="RGGB", bit_depth=bits, gain=0.02))
    got = vcc.expose_image(picture((1.0, 0.5, 0.2), on), on, 1e-2)
    saved = got.save(tmp_path / f"raw{ending}")
    values, _ = read_picture(saved.path)
    assert values.dtype == got.values.dtype
    assert np.array_equal(values, got.values)
    assert f"{bits}-bit raw, RGGB" in saved.description
    assert "upside down" in saved.description


def test_raw_files_say_what_the_numbers_mean(tmp_path):
    on = sensor(Electronics(color_filter=XTRANS))
    got = vcc.expose_image(picture((1.0, 0.5, 0.2), on), on, 1e-2, seed=4)
    got.save(tmp_path / "raw.tif")
    with tifffile.TiffFile(tmp_path / "raw.tif") as file:
        said = json.loads(file.pages.first.description)
    assert (said["quantity"], said["transfer"]) == ("digital numbers", "linear")
    assert said["orientation"] == "as recorded"
    meaning = said["recording"]
    assert meaning["black_level_dn"] == 64
    assert meaning["exposure_seconds"] == 1e-2
    assert meaning["color_filter"] == list(XTRANS)
    assert meaning["seed"] == 4


def test_raw_files_of_several_channels(tmp_path):
    on = sensor()
    three = vcc.expose_image(picture((1.0, 0.5, 0.2), on), on, 1e-2)
    three.save(tmp_path / "three.png")
    assert np.array_equal(imagecodecs.png_decode((tmp_path / "three.png").read_bytes()), three.values)
    two = vcc.expose_image(picture((1.0, 0.5), on), on, 1e-2)
    with pytest.raises(vcc.InputError, match=r"use \.npy"):
        two.save(tmp_path / "two.tif")
    two.save(tmp_path / "two.npy")
    with pytest.raises(vcc.InputError, match=r"\.tif, \.tiff, \.png, \.npy"):
        two.save(tmp_path / "two.exr")


# --- the camera ---


def tiny():
    """A camera before a light field of 3 × 3 views, in focus."""
    texture = np.random.default_rng(1).uniform(0.2, 1, (24, 28, 3)).astype(np.float32)
    views = np.array([[texture[2 - j : 22 - j, 2 - i : 26 - i] for i in range(3)] for j in range(3)])
    light_field = vcc.LightField.from_views(views, spacing=1e-3, slope_per_pixel=0.02, focus_distance=1.3)
    lens = vcc.Lens(focal_length=0.05, diameter=0.004)
    return lens, light_field


def test_expose_is_capture_and_noise():
    lens, light_field = tiny()
    on = vcc.Sensor(z=0.052, shape=(12, 16), pitch=1e-3, electronics=Electronics(color_filter="RGGB"))
    camera = vcc.Camera([lens], on)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # a lens wider than the views
        image = camera.capture(light_field, interpolation="nearest")
        got = camera.expose(light_field, "auto", seed=3, radiance=0.1, interpolation="nearest")
    assert np.array_equal(got.values, vcc.expose_image(image, on, "auto", seed=3, radiance=0.1).values)
    assert got.missing_rays == image.missing_rays > 0
    recorded, captured = got.image().values[::2, ::2], image.values[::2, ::2, 0]
    lit = captured > 0.3 * captured.max()
    # 9000 electrons at the brightest: below 2 % noise at a third of it, 5 of them
    assert lit.sum() > 10
    assert np.abs(recorded / captured - 1)[lit].max() < 0.1
    assert got.demosaiced().shape == (12, 16, 3)


def test_expose_refuses_before_it_works(monkeypatch):
    lens, light_field = tiny()
    on = vcc.Sensor(z=0.052, shape=(12, 16), pitch=1e-3, electronics=Electronics(color_filter="RGGB"))
    monkeypatch.setattr(vcc.Camera, "capture", lambda *_, **__: pytest.fail("the work has begun"))
    camera = vcc.Camera([lens], on)
    for arguments, options in (((0,), {}), (("5",), {}), ((1e-3,), {"seed": 1.5}), ((1e-3,), {"radiance": -1})):
        with pytest.raises(vcc.InputError):
            camera.expose(light_field, *arguments, **options)
    with pytest.raises(vcc.InputError, match="no electronics"):
        vcc.Camera([lens], dataclasses.replace(on, electronics=None)).expose(light_field, 1e-3)
    grey = vcc.LightField(np.asarray(light_field.values)[..., 0], light_field.frame)
    with pytest.raises(vcc.InputError, match="light field is grey"):
        camera.expose(grey, 1e-3)


def test_a_sensor_of_one_tile_is_demosaiced():
    on = sensor(dataclasses.replace(QUIET, color_filter="RGGB"), shape=(2, 2))
    got = vcc.expose_image(picture((0.2, 0.6, 0.4), on), on, "auto").demosaiced("bilinear").values
    np.testing.assert_allclose(got / got[..., 1:2], np.broadcast_to([1 / 3, 1, 2 / 3], got.shape), rtol=0.1)


# --- what belongs to the sensor, number by number ---


@pytest.mark.parametrize("shape", [(600, 1000), (500, 400, 3)])
def test_the_fixed_pattern_is_what_recordings_hold(shape):
    """In the dark, without read noise, offsets are all that there is; in bright light sensitivities."""
    uneven = dataclasses.replace(QUIET, dsnu=40.0, black_level=500, gain=2.0, bit_depth=16, pattern_seed=7)
    on, dark = sensor(uneven, shape[:2]), np.zeros(shape, np.float32)
    sensitivity, offset = fixed_pattern(shape, uneven)
    assert sensitivity.shape == offset.shape == shape
    recorded = Exposure(on, 1e-3).recorded(dark).values
    np.testing.assert_array_equal(recorded, np.rint(500 + 2.0 * 40.0 * offset))
    bright = dataclasses.replace(QUIET, prnu=0.1, full_well=2e9, gain=2e-5, bit_depth=16, pattern_seed=7)
    light = np.full(shape, 4e8 / (bright.electrons_per_joule() * 25e-12 * 1e-3), np.float32)
    numbers = Exposure(sensor(bright, shape[:2]), 1e-3).recorded(light).values
    # Shot noise is 5e-5 of 4e8 electrons, 64 + 8000 DN: rounding is a half, and five of its deviations 2.
    np.testing.assert_allclose(numbers, 64 + 8000 * np.maximum(1 + 0.1 * sensitivity, 0), rtol=0, atol=3)


def test_noise_and_pattern_of_the_same_seed_have_nothing_in_common():
    both = dataclasses.replace(QUIET, prnu=0.1, read_noise=20.0, black_level=500, gain=2.0, bit_depth=16)
    noise = flat(both, 0, (256, 256), seed=0).electrons().ravel()
    for pattern in fixed_pattern((256, 256), both):
        assert abs(np.corrcoef(noise, pattern.ravel())[0, 1]) < 4 / 256


def test_a_pixel_saturates_where_any_of_its_channels_does():
    """Of 8 × 8 pixels 16 in the first channel, 16 in the third, 8 of them in both; dark ones do not."""
    on = sensor(dataclasses.replace(QUIET, full_well=3), (8, 8))
    light = np.zeros((8, 8, 3), np.float32)
    light[:4, :4, 0] = light[2:6, :4, 2] = 1e6
    got = Exposure(on, 1.0).recorded(light, missing_rays=0.25)
    assert got.saturated == 24 / 64
    assert (got.missing_rays, got.exposure, got.seed, got.radiance) == (0.25, 1.0, 0, 1.0)
    np.testing.assert_array_equal(got.values > 64, light > 0)
    # The largest number is saturated, the one before it is not: 4095 and 4094 of 12 bits.
    for black, share in ((4094.6, 1.0), (4094.4, 0.0)):
        on = sensor(dataclasses.replace(QUIET, black_level=black), (4, 4))
        assert Exposure(on, 1.0).recorded(np.zeros((4, 4), np.float32)).saturated == share


@pytest.mark.parametrize(
    ("low", "high", "said"), [(-0.149, 1.0, False), (-0.151, 1.0, True), (-0.29, 2.0, False), (0.0, 0.0, False),
                              (-1.0, -0.5, True), (-1e-6, 0.0, True), (0.5, 1.0, False)]
)  # fmt: skip
def test_below_zero_is_said_beyond_what_interpolation_undershoots(low, high, said):
    assert (below_zero(np.array([[low, high]], np.float32)) is not None) == said


@pytest.mark.parametrize("bad", [np.inf, -np.inf, np.nan])
def test_light_that_is_not_finite_is_refused(bad):
    light = np.ones((4, 4), np.float32)
    light[2, 1] = bad
    with pytest.raises(vcc.InputError, match="not finite"):
        Exposure(sensor(shape=(4, 4)), 1e-3).recorded(light)


@pytest.mark.parametrize("tile", ["RGGB", XTRANS, ("RGB",), ("0123", "3201"), ("01", "22", "00")])
def test_each_channel_is_filled_by_a_tent_that_reaches_all_pixels(tile):
    """The smallest that meets a sample of the channel from each pixel, written out; what is measured stays."""
    behind = Electronics(color_filter=tile)
    high, wide = len(behind.tile), len(behind.tile[0])
    shape = (2 * high + 1, 2 * wide + 2)
    mosaic = np.random.default_rng(1).random(shape).astype(np.float32)
    found = demosaic(mosaic, behind, "bilinear")
    assert found.shape == (*shape, behind.filter_channels)
    assert found.dtype == np.float32
    row, column = np.mgrid[: shape[0], : shape[1]]
    channel = np.array(behind.tile)[row % high, column % wide]
    for n in range(behind.filter_channels):
        here = channel == n
        for reach in range(7):
            away = [np.abs(one[:, :, None, None] - one) / (reach + 1) for one in (row, column)]
            weights = np.maximum(1 - away[0], 0) * np.maximum(1 - away[1], 0) * here
            total = weights.sum(axis=(2, 3))
            if (total > 1e-9).all():
                break
        expected = np.where(here, mosaic, (weights * mosaic).sum(axis=(2, 3)) / total)
        np.testing.assert_allclose(found[..., n], expected, rtol=0, atol=2e-6, err_msg=f"channel {n}")


def test_a_mosaic_that_just_holds_a_tile_is_filled_and_a_smaller_one_refused():
    for tile, (high, wide) in ((XTRANS, (6, 6)), (("01", "22", "00"), (3, 2)), ("RGGB", (2, 2))):
        behind = Electronics(color_filter=tile)
        assert demosaic(np.ones((high, wide), np.float32), behind, "bilinear").min() == pytest.approx(1)
        for shape in ((high - 1, wide), (high, wide - 1)):
            with pytest.raises(vcc.InputError, match=f"is smaller than a tile of .*{high}×{wide}"):
                demosaic(np.ones(shape, np.float32), behind, "bilinear")


def test_a_mosaic_goes_on_as_its_mirror_image():
    """The library's own, of the mosaic mirrored at the middle of its last pixels as a whole."""
    library = pytest.importorskip("colour_demosaicing")
    mosaic = np.random.default_rng(1).random((9, 12)).astype(np.float32)
    mirrored = np.block([[mosaic[:0:-1, :0:-1], mosaic[:0:-1], mosaic[:0:-1, -2::-1]],
                         [mosaic[:, :0:-1], mosaic, mosaic[:, -2::-1]],
                         [mosaic[-2::-1, :0:-1], mosaic[-2::-1], mosaic[-2::-1, -2::-1]]])  # fmt: skip
    expected = library.demosaicing_CFA_Bayer_Malvar2004(mirrored[:, 1:], "GRBG")[8:17, 10:22]
    found = demosaic(mosaic, Electronics(color_filter="GRBG"), "malvar")
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5)


def test_what_is_not_said_of_a_recording():
    """It is one of radiance 1, seed 0, of which nothing is saturated or missing."""
    made = vcc.Recording(np.zeros((4, 6), np.uint16), sensor(shape=(4, 6)), 1e-3)
    assert (made.radiance, made.seed, made.saturated, made.missing_rays) == (1.0, 0, 0.0, 0.0)
    taken = Exposure(sensor(shape=(4, 6)), 1e-3).recorded(np.zeros((4, 6), np.float32))
    assert (taken.radiance, taken.seed, taken.saturated, taken.missing_rays) == (1.0, 0, 0.0, 0.0)
    for shape in ((4, 7), (5, 6), (6, 4)):
        with pytest.raises(vcc.InputError, match=r"the sensor has \(4, 6\) pixels"):
            Exposure(sensor(shape=(4, 6)), 1e-3).recorded(np.zeros(shape, np.float32))
        with pytest.raises(vcc.InputError, match=r"the sensor has \(4, 6\) pixels"):
            vcc.Recording(np.zeros(shape, np.uint16), sensor(shape=(4, 6)), 1e-3)
    with pytest.raises(vcc.InputError, match="the shape"):
        vcc.Recording(np.zeros((4, 6, 3, 1), np.uint16), sensor(shape=(4, 6)), 1e-3)


@pytest.mark.parametrize("level", [0.0, 10.0, 30.0, 41.0])
def test_noise_that_is_cut_off_at_0_is_reported_with_what_it_adds(level):
    """Of 512² dark pixels with noise of 10 numbers; scipy's normal distribution, integrated above 0."""
    low = dataclasses.replace(QUIET, black_level=level, gain=2.0, read_noise=5.0, dark_current=0.0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mean = flat(low, 0).electrons().mean(dtype=np.float64)
    added = norm(level, 10).expect(lambda x: x, lb=0) / 2 - level / 2
    assert mean == pytest.approx(added, abs=3 * 5 / 512)
    said = [str(each.message) for each in caught if "of the numbers are 0" in str(each.message)]
    assert len(said) == (level < 40)
    if said:
        assert f"is {added:.3g} electrons" in said[0]
        assert "Raise black_level to 40" in said[0]
