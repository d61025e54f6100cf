"""Shares of samples on pixels: they integrate the footprint, and sum to one along both axes."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from vcc.plan.footprints.shares import Division, cumulative, shares, taps, weight

STEPS = st.floats(0.05, 7.0).flatmap(lambda step: st.sampled_from([step, -step]))


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("a", [-2.3, -1.4, -0.6, 0.0, 0.3, 1.2, 1.9, 2.5])
def test_cumulative_is_the_integral_of_the_weight(interpolation, a):
    knots = [p for p in (-2.0, -1.0, 0.0, 1.0, 2.0) if p < a]
    truth = quad(lambda x: float(weight(interpolation, np.float64(x))), -3, a, points=knots or None)[0]
    assert float(cumulative(interpolation, np.float64(a))) == pytest.approx(truth, abs=1e-9)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@given(step=STEPS, origin=st.floats(-3, 3))
def test_no_light_is_lost_and_uniform_light_stays_uniform(interpolation, step, origin):
    pixel, index = np.arange(-60.0, 60.0), np.arange(-400.0, 400.0)
    near = np.abs(origin + step * index) < 40
    table = shares(interpolation, pixel[:, None], origin + step * index[near], step)
    assert np.allclose(table.sum(axis=0), 1, atol=1e-9)
    # Pixels that have samples on all sides, within the reach of a footprint.
    border = 2 * abs(step) + 1
    middle = (np.abs(pixel) < 40 - border) & (np.abs(pixel - origin) < abs(step) * 399 - border)
    assert np.allclose(table[middle].sum(axis=1), 1 / abs(step), atol=1e-9)


@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic"])
@given(step=STEPS, origin=st.floats(-5, 25))
def test_tables_hold_every_share(interpolation, step, origin):
    samples, pixels = 17, 23
    table = taps(interpolation, np.array([origin]), step, samples, pixels)
    pixel, index = np.arange(float(pixels)), np.arange(float(samples))
    truth = shares(interpolation, pixel[:, None], origin + step * index, step)
    dense = np.zeros((pixels, samples + table.weights.shape[2]))
    for m in range(pixels):
        for n in range(table.weights.shape[2]):
            dense[m, table.first[0, m] + n] = table.weights[0, m, n]
    assert np.allclose(dense[:, :samples], truth, atol=1e-6)
    assert not dense[:, samples:].any()


@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic"])
@given(step=STEPS, origins=st.lists(st.floats(-40, 60), min_size=1, max_size=3))
def test_tables_by_sample_hold_the_same_shares(interpolation, step, origins):
    samples, pixels = 17, 23
    table = taps(interpolation, np.array(origins), step, samples, pixels)
    turned = table.by_sample(samples)
    by_pixel = np.zeros((len(origins), pixels, samples + table.weights.shape[2]), np.float32)
    by_sample = np.zeros((len(origins), pixels + turned.weights.shape[2], samples), np.float32)
    for o in range(len(origins)):
        for m, n in np.ndindex(pixels, table.weights.shape[2]):
            by_pixel[o, m, table.first[o, m] + n] += table.weights[o, m, n]
        for k, n in np.ndindex(samples, turned.weights.shape[2]):
            by_sample[o, turned.first[o, k] + n, k] += turned.weights[o, k, n]
    assert (by_pixel[:, :, :samples] == by_sample[:, :pixels]).all()
    assert not by_sample[:, pixels:].any()


@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic"])
@pytest.mark.parametrize("refine", [2, 3, 8])
def test_dividing_samples_only_spreads_their_light(interpolation, refine):
    division = Division.of(interpolation, 9, refine)
    matrix = division.matrix(9)
    assert np.allclose(matrix.sum(axis=0), 1, atol=1e-12)
    place = division.start + np.arange(len(matrix)) / refine
    assert np.allclose(matrix.T @ place, np.arange(9), atol=1e-12)  # around where it was


def test_a_side_of_many_pixels_takes_little_more_than_its_table():
    pixels = 200_000
    tracemalloc.start()
    found = taps("spline", np.arange(5.0), 5.26, 64, pixels)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    kept = found.first.nbytes + found.weights.nbytes
    assert peak < 3 * kept  # the table, and two whole numbers a pixel; as one piece it took eight times the table
    some = slice(0, 2**14 + 7)
    few = taps("spline", np.arange(5.0), 5.26, 64, some.stop)
    np.testing.assert_array_equal(few.first, found.first[:, some])
    np.testing.assert_array_equal(few.weights, found.weights[:, some, : few.weights.shape[-1]])
