"""The photon transfer curve of simulated flat fields gives back the gain and the read noise that were put in.

The oracle is the method of EMVA 1288, done here with plain NumPy on recorded numbers: of two flats at each
level, half the variance of their difference is the temporal variance σ_y²; its slope against the mean is the gain
K; and the dark pair's variance, less 1/12 DN² of rounding, is (K·σ_d)².
"""

import dataclasses

import numpy as np
import pytest

import vcc
from vcc.optics.electronics import Electronics
from vcc.run.photon_transfer import PhotonTransfer

LEVELS = np.arange(1, 13) / 12
"""Twelve flats up to 70 % of saturation, where EMVA 1288 fits."""
PIXELS = (512, 512)
EXPOSURE = 1e-3

SENSORS = {
    "default": Electronics(),
    "low noise, 16 bits": Electronics(gain=2.0, bit_depth=16, full_well=30_000, read_noise=1.2, black_level=200),
    "8 bits": Electronics(gain=0.24, bit_depth=8, full_well=1000, read_noise=6.0, black_level=12),
    "uneven": Electronics(prnu=0.01, dsnu=3.0),
}


def flats(electronics, light):
    """Two recordings of the same even light, W/m², as floating-point numbers."""
    on = vcc.Sensor(z=0.05, shape=PIXELS, pitch=3.45e-6, electronics=electronics)
    image = vcc.Image(np.full(PIXELS, light, np.float32), on.frame)
    seeds = int(1e6 * light), int(1e6 * light) + 1_000_000_000
    return [vcc.expose_image(image, on, EXPOSURE, seed=seed).values.astype(np.float64) for seed in seeds]


def curve(electronics):
    """(mean, temporal variance) of a dark pair and of pairs up to 70 % of saturation."""
    # Irradiance that fills a pixel to 70 %: E = 0.7·sat·h·c / (η·λ·A·t)
    full = 0.7 * electronics.saturation * 1.98644586e-25 / (0.6 * 550e-9 * 3.45e-6**2 * EXPOSURE)
    pairs = [flats(electronics, light) for light in (0.0, *(full * LEVELS))]
    means = np.array([(one.mean() + two.mean()) / 2 for one, two in pairs])
    variances = np.array([(one - two).var() / 2 for one, two in pairs])
    return means, variances


@pytest.mark.parametrize("name", SENSORS)
def test_gain_and_read_noise_come_back(name):
    """Within 1 %, of which the estimators themselves take about half, at three standard errors.

    N = 512² pixels give a temporal variance to √(2/N) = 0.28 % (1 σ; Gaussian noise). The slope through the
    origin, K = Σ x·v / Σ x², of levels x = 1 … 12 with variances v ∝ x has σ_K/K = √(2/N) · √Σx⁴ / Σx²
    = 0.28 % · 0.38 = 0.105 %; 3 σ: 0.31 %.
    The dark variance V = (K·σ_d)² + 1/12 is known to 0.28 %, hence σ_d to half of that times V / (V − 1/12),
    and to what K is known to: √(0.14² · 1.09² + 0.105²) % = 0.19 % for the default (V = 1.08); 3 σ: 0.56 %.
    1/12 itself is off by about exp(−2π²·V), nothing at V > 1. The dark current of 1 e/s adds 1e-3 to 6.25 e².
    """
    electronics = SENSORS[name]
    means, variances = curve(electronics)
    x, v = means[1:] - means[0], variances[1:] - variances[0]
    gain = float(x @ v / (x @ x))
    read_noise = np.sqrt(variances[0] - 1 / 12) / gain
    off = gain / electronics.gain - 1, read_noise / electronics.read_noise - 1
    print(f"{name}: gain {off[0]:+.3%}, read noise {off[1]:+.3%}")
    assert gain == pytest.approx(electronics.gain, rel=0.01)
    assert read_noise == pytest.approx(electronics.read_noise, rel=0.01)
    # and the means are in line with the light: shares of 70 % of saturation, to 4 standard errors, PRNU included
    charge = x / electronics.gain
    expected = 0.7 * electronics.saturation * LEVELS
    error = 4 * np.sqrt(expected + 2 * electronics.read_noise**2 + (electronics.prnu * expected) ** 2) / 512
    assert np.all(np.abs(charge - expected) < error)


def test_a_wrong_gain_or_noise_would_be_seen():
    """The test above tells a deviation of 2 %: the same numbers, judged against other parameters."""
    means, variances = curve(Electronics(gain=0.408, read_noise=2.55))
    x, v = means[1:] - means[0], variances[1:] - variances[0]
    gain = float(x @ v / (x @ x))
    assert gain != pytest.approx(0.4, rel=0.01)
    assert np.sqrt(variances[0] - 1 / 12) / gain != pytest.approx(2.5, rel=0.01)


def test_the_library_s_own_curve_finds_the_same():
    for electronics in (SENSORS["default"], SENSORS["uneven"]):
        got = vcc.photon_transfer(electronics, seed=1)
        assert got.gain == pytest.approx(electronics.gain, rel=0.01)
        assert got.read_noise == pytest.approx(electronics.read_noise, rel=0.01)
        # It ends beyond saturation, where noise is cut off, and fits below 70 % of it.
        assert got.mean[-1] == pytest.approx(64 + 0.4 * 10_000, rel=2e-3)
        assert got.variance[-1] < 0.1 * got.variance.max()
        # Levels are even, up to 1.1 of the full well of 10 000.
        unsaturated = got.mean - 64 < 0.4 * 9_000
        steps = 0.4 * 11_000 / len(got.mean) * np.arange(1, len(got.mean) + 1)
        np.testing.assert_allclose((got.mean - got.dark_mean)[unsaturated], steps[unsaturated], rtol=5e-3)
        assert got.mean[got.fitted].max() <= 64 + 0.7 * 4000 + 1
        assert 9 <= got.fitted.sum() < len(got.mean)


@pytest.mark.parametrize(
    ("electronics", "options", "message"),
    [
        (Electronics(black_level=1), {}, "raise it"),
        (Electronics(), {"levels": 3}, "levels is a whole number, 4 or more, not 3"),
        (Electronics(), {"shape": (1, 1)}, "two pixels"),
        (Electronics(), {"exposure": 0}, "exposure"),
    ],
)
def test_curves_that_cannot_be_measured(electronics, options, message):
    with pytest.raises(vcc.InputError, match=message):
        vcc.photon_transfer(electronics, **options)


def test_read_noise_below_the_rounding_is_not_told():
    coarse = vcc.photon_transfer(dataclasses.replace(SENSORS["default"], gain=0.05), shape=(64, 64))
    assert coarse.gain == pytest.approx(0.05, rel=0.1)
    with pytest.raises(vcc.InputError, match="rounding"):
        _ = coarse.read_noise


def test_what_is_read_from_a_curve_by_hand():
    """Signals 1 … 10 over a dark level of 100: those up to 7 count. A least-squares slope through 0."""
    signal = np.arange(1.0, 11)
    variance = 0.5 * signal + np.array([0.1, -0.2, 0.3, 0.0, -0.1, 0.2, -0.3, 9, 9, 9])
    curve = PhotonTransfer(100 + signal, 2.0 + variance, 100.0, 2.0)
    assert curve.fitted.tolist() == [True] * 7 + [False] * 3
    slope = np.linalg.lstsq(signal[:7, None], variance[:7], rcond=None)[0][0]
    assert curve.gain == pytest.approx(slope, rel=1e-12)
    assert curve.read_noise == pytest.approx(np.sqrt(2.0 - 1 / 12) / slope, rel=1e-12)
    # EMVA 1288 takes a dark variance of 0.24 DN² as the least that rounding leaves to be told.
    at_least = dataclasses.replace(curve, dark_variance=0.24, variance=0.24 + variance)
    assert at_least.read_noise == pytest.approx(np.sqrt(0.24 - 1 / 12) / slope, rel=1e-12)
    with pytest.raises(vcc.InputError, match=r"dark noise is 0\.239 DN²"):
        _ = dataclasses.replace(curve, dark_variance=0.239).read_noise


def test_levels_are_even_and_pairs_differ_by_noise_alone():
    """A pixel of 1e6 electrons at 1 DN each: means to 4 standard errors √(charge / 2N), variances as Poisson's."""
    exact = Electronics(full_well=1e6, gain=0.05, bit_depth=16, black_level=500, read_noise=100, dark_current=0)
    got = vcc.photon_transfer(exact, levels=5, shape=(64, 128), seed=3)
    charges = np.arange(1, 6) / 5 * 1.1e6
    noise = np.sqrt(charges + 100**2) / np.sqrt(2 * 64 * 128)
    assert got.mean.shape == got.variance.shape == (5,)
    assert np.all(np.abs((got.mean - 500) / 0.05 - charges)[:4] < 4 * noise[:4])
    assert got.mean[4] == pytest.approx(500 + 0.05 * 1e6, abs=1)
    expected = 0.05**2 * (charges + 100**2) + 1 / 12
    np.testing.assert_allclose(got.variance[:4], expected[:4], rtol=4 * np.sqrt(2 / (64 * 128)))
    assert got.dark_mean == pytest.approx(500, abs=4 * 5 / np.sqrt(2 * 64 * 128))
    assert got.dark_variance == pytest.approx(25 + 1 / 12, rel=4 * np.sqrt(2 / (64 * 128)))
    again = vcc.photon_transfer(exact, levels=5, shape=(64, 128), seed=3)
    other = vcc.photon_transfer(exact, levels=5, shape=(64, 128), seed=4)
    np.testing.assert_array_equal(got.mean, again.mean)
    assert (got.mean[:4] != other.mean[:4]).all()
    assert len(vcc.photon_transfer(exact, levels=4, shape=(8, 8)).mean) == 4
    assert len(vcc.photon_transfer(exact, shape=(1, 2)).mean) == 16  # two pixels are enough
    # By default 512² pixels, at which 0.5 % of a variance are 1.8 standard errors, and the seed 0.
    default = vcc.photon_transfer(exact, levels=4)
    assert default.mean.tolist() == vcc.photon_transfer(exact, levels=4, shape=(512, 512), seed=0).mean.tolist()


@pytest.mark.parametrize(
    ("noise", "exposure", "least"),
    [
        ({"read_noise": 3.0, "dsnu": 4.0, "dark_current": 0}, 1e-3, 20.0),  # √(9 + 16) = 5, four times
        ({"read_noise": 3.0, "dsnu": 0.0, "dark_current": 160}, 0.1, 4.0),  # 16 − 4 √(9 + 16)
        ({"read_noise": 2.0, "dsnu": 0.0, "dark_current": 0}, 1e-3, 8.0),
    ],
)
@pytest.mark.parametrize("gain", [1.0, 0.5])
def test_a_black_level_holds_four_standard_deviations_of_dark_noise(noise, exposure, least, gain):
    dark = Electronics(gain=gain, **noise)
    enough = dataclasses.replace(dark, black_level=gain * least)
    assert vcc.photon_transfer(enough, levels=4, shape=(8, 8), exposure=exposure).mean.shape == (4,)
    little = dataclasses.replace(dark, black_level=gain * least - 0.01)
    with pytest.raises(vcc.InputError, match="cuts off dark noise"):
        vcc.photon_transfer(little, levels=4, shape=(8, 8), exposure=exposure)


def test_dark_current_is_in_the_dark_recordings_and_not_in_the_signal():
    dark = Electronics(gain=1.0, bit_depth=16, full_well=20_000, dark_current=5e4, black_level=200)
    got = vcc.photon_transfer(dark, levels=4, shape=(128, 128), exposure=0.02)
    assert got.dark_mean == pytest.approx(200 + 1000, abs=4 * np.sqrt(1000 / 2 / 128**2))
    assert got.mean[0] - got.dark_mean == pytest.approx(5500, rel=1e-3)
    with_default = vcc.photon_transfer(dark, levels=4, shape=(128, 128))  # 1 ms
    assert with_default.dark_mean == pytest.approx(200 + 50, abs=0.3)


@pytest.mark.parametrize("shape", [(0, 5), (5, 0), (-2, -3), (4,), (2, 2, 2), (1, 1)])
def test_shapes_that_are_none(shape):
    with pytest.raises(vcc.InputError, match="at least two pixels"):
        vcc.photon_transfer(Electronics(), shape=shape)
