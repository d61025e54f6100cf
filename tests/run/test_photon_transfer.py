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
