"""Filters that restore sharpness: their gains against closed forms of the loss."""

from __future__ import annotations

import numpy as np
import pytest

from vcc.plan.sharpening import MEAN, TENT, across_plane, along_axis, gain

FREQUENCIES = np.linspace(0.0, 0.5, 51)
"""Cycles per pixel."""


def gain_of(weights: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    order = np.arange(len(weights)) - len(weights) // 2
    return np.asarray((weights * np.exp(-2j * np.pi * frequency[:, None] * order)).sum(axis=1))


@pytest.mark.parametrize("losses", [MEAN, TENT, TENT + MEAN])
def test_the_series_gives_back_powers_of_sinc_to_fourth_order(losses):
    # With x² = s + s²/3 + 8s³/45 + 4s⁴/35 + …, log(x/sin x) = s/6 + 11s²/180 + 191s³/5670 + …, all terms positive:
    # the first that is left out is (n³/1296 + 11n²/1080 + 191n/5670)·s³, and the rest grows it by less than 3s.
    s = (np.sin(np.pi * FREQUENCIES) ** 2)[5:]
    left = (np.sinc(FREQUENCIES) ** -losses - gain(losses, FREQUENCIES))[5:]
    third = (losses**3 / 1296 + 11 * losses**2 / 1080 + 191 * losses / 5670) * s**3
    small = s < 0.2
    assert (left > third).all()
    assert (left < third * (1 + 3 * s))[small].all()


@pytest.mark.parametrize("losses", [TENT, TENT + MEAN])
@pytest.mark.parametrize("step", [1.0, 0.7, -0.4, 0.1])
def test_five_weights_for_samples_up_to_a_pixel(losses, step):
    weights = along_axis(losses, step)
    assert len(weights) == 5
    assert weights.sum() == pytest.approx(1, abs=1e-15)
    np.testing.assert_array_equal(weights, weights[::-1])
    low = FREQUENCIES[FREQUENCIES <= 0.1]
    # Of sixth order in x = π·frequency, of steps of one pixel: (0.314)⁶ = 1e-3 at 0.1, times what is below 1/2.
    np.testing.assert_allclose(gain_of(weights, low), np.sinc(step * low) ** -losses, atol=5e-4)


@pytest.mark.parametrize("step", [1.1, 1.7, 2.0, 3.3])
def test_larger_samples_are_filtered_at_their_own_distance(step):
    weights = along_axis(TENT, step)
    assert weights.sum() == pytest.approx(1, abs=1e-12)
    inside = FREQUENCIES[FREQUENCIES < 0.4]
    np.testing.assert_allclose(gain_of(weights, inside), gain(TENT, step * inside), atol=0.02)


@pytest.mark.parametrize("step", [1.3, 2.0, 4.0])
def test_splines_interpolate(step):
    """Samples seen through a cubic B-spline are [1, 4, 1]/6 of themselves, which the filter undoes.

    Its inverse falls by 0.268 a sample; cut after two and a half of them, 0.268^2.5 · 2 = 7 % are left at worst.
    """
    weights = along_axis(TENT, step, spline=True)
    inside = FREQUENCIES[FREQUENCIES < 0.4]
    seen = (4 + 2 * np.cos(2 * np.pi * step * inside)) / 6
    np.testing.assert_allclose(gain_of(weights, inside) * seen, 1, atol=0.075)
    low = step * inside < 0.2  # cycles a sample, where pictures have most of what they hold
    np.testing.assert_allclose((gain_of(weights, inside) * seen)[low], 1, atol=0.05)


def test_nothing_lost_is_nothing_done():
    assert along_axis(0.0, 1.0).tolist() == [1.0]
    assert along_axis(TENT, 1e-7).tolist() == [1.0]  # a view that falls into a point


def test_losses_along_rows_and_columns_part():
    kernel = across_plane([(float(TENT), np.array([0.8, 0.0])), (float(TENT), np.array([0.0, 0.9]))], 3)
    assert kernel.sum() == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(kernel, kernel[::-1, ::-1], atol=1e-15)
    order = np.arange(7) - 3
    low = np.linspace(0, 0.2, 9)
    waves = np.exp(-2j * np.pi * low[:, None] * order)
    found = waves @ kernel @ waves.T  # [frequency down, frequency across]
    np.testing.assert_allclose(found, np.outer(gain(TENT, 0.9 * low), gain(TENT, 0.8 * low)), atol=5e-3)
