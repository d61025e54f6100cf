"""How far pictures are from the true ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vcc.base.measures import decibels, psnr


def test_a_tenth_of_the_peak_is_20_decibels():
    truth = np.array([[1.0, 4.0], [2.0, 3.0]])
    assert psnr(truth + 0.4, truth) == pytest.approx(20)  # the peak is the truth's brightest
    assert psnr(truth - 0.1, truth, peak=1.0) == pytest.approx(20)
    assert decibels(0.01**2 * 7**2, 7.0) == pytest.approx(40)


def test_what_is_alike_to_rounding_has_200_decibels():
    truth = np.linspace(0, 1, 9)
    assert psnr(truth, truth) == pytest.approx(200)
    assert math.isnan(decibels(math.nan))  # of nothing
