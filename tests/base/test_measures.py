"""The peak signal-to-noise ratio against its definition in round numbers."""

from __future__ import annotations

import numpy as np
import pytest

from vcc.base.measures import psnr


def test_a_tenth_of_the_peak_is_20_decibels():
    truth = np.linspace(0, 2, 50)
    assert psnr(truth + 0.2, truth) == pytest.approx(20)
    assert psnr(truth + 0.2, truth, 1.0) == pytest.approx(20 - 20 * np.log10(2))
    assert psnr(truth, truth, 1.0) == 200
