"""The angular spectrum, which other tests and docs/waves.md use as an oracle, against closed forms."""

import numpy as np
import pytest
from scipy.special import fresnel

from tests.physics.wave_oracle import propagated
from vcc.units import mm, nm, um

GREEN = 550 * nm


@pytest.mark.parametrize("number", [0.5, 2.0, 10.0])
def test_a_slit_casts_fresnels_shadow(number):
    """I = ½·|F(a) + F(b)|², F = C + iS of (w/2 ± x)·√(2/(λd)); w²/(λd) is the Fresnel number."""
    width, points, across = 0.1 * mm, 200, 64
    distance, step = width**2 / (GREEN * number), width / points
    x = (np.arange(points * across) - points * across // 2 + 0.5) * step
    found = np.abs(propagated((np.abs(x) < width / 2).astype(float), step, GREEN, distance)) ** 2
    ends = [fresnel((width / 2 + sign * x) * np.sqrt(2 / (GREEN * distance))) for sign in (1, -1)]
    truth = sum(sum(each) ** 2 for each in zip(*ends, strict=True)) / 2
    seen = np.abs(x) < 2 * width
    # The band limit leaves out waves beyond the window's ±32 w: a share λd/(π²·32·w·w)·2 of the light at most.
    assert np.abs(found - truth)[seen].sum() / truth[seen].sum() < 0.01


def test_a_grating_is_sharp_again_at_the_talbot_distance():
    """Of 1 + m·cos: the first harmonic falls as cos(πλd/p²), sharp at 2p²/λ (Talbot 1836, Rayleigh 1881)."""
    period, points, contrast = 50 * um, 64, 0.1
    x = np.arange(points * 8) / points
    field = 1 + contrast * np.cos(2 * np.pi * x)
    talbot = 2 * period**2 / GREEN
    for share in (0.1, 0.25, 0.5, 0.8, 1.0):
        # Paraxial: the axial wavenumber differs from it by (λ/p)²/4 of its phase, 3·10⁻⁵ of 2π here.
        found = np.abs(propagated(field, period / points, GREEN, share * talbot)) ** 2
        harmonic = 2 * (found * np.exp(-2j * np.pi * x)).mean()
        expected = 2 * contrast * np.cos(2 * np.pi * share)
        assert harmonic == pytest.approx(expected, abs=2 * contrast * 1e-3)
