"""Products with banded matrices equal those with dense matrices, for arrays of every library."""

from __future__ import annotations

import array_api_strict
import jax.numpy as jnp
import numpy as np
import pytest
import torch

from vcc.engines.bands import Bands
from vcc.plan.footprints.shares import Division, taps

LIBRARIES = {
    "numpy": np.asarray,
    "strict": array_api_strict.asarray,
    "torch": torch.asarray,
    "jax": jnp.asarray,
}


def bands_and_matrix():
    index = np.random.default_rng(0).integers(0, 9, (6, 4))
    weights = np.random.default_rng(1).standard_normal((6, 4))
    matrix = np.zeros((6, 9))
    for row, (places, shares) in enumerate(zip(index, weights, strict=True)):
        for place, share in zip(places, shares, strict=True):
            matrix[row, place] += share
    return Bands(index, weights), matrix


@pytest.mark.parametrize("library", LIBRARIES)
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_they_are_a_matrix(library, kind):
    bands, matrix = bands_and_matrix()
    rows = np.random.default_rng(2).standard_normal((9, 5)).astype(kind)
    found = bands.of(LIBRARIES[library](rows))
    assert type(found) is type(LIBRARIES[library](rows))
    if library != "jax":  # no double precision by default
        assert np.asarray(found).dtype == kind
    exact = np.asarray(found).dtype == np.float64
    # Nine products of numbers up to 3 in single precision: 9 · 9 · 6e-8.
    np.testing.assert_allclose(np.asarray(found), matrix @ rows, rtol=0, atol=1e-13 if exact else 5e-6)


def test_tensors_carry_gradients_through_them():
    bands, matrix = bands_and_matrix()
    rng = np.random.default_rng(3)
    rows = torch.tensor(rng.random((9, 5)), requires_grad=True)
    weights = torch.tensor(rng.random((6, 5)))
    (found,) = torch.autograd.grad((bands.of(rows) * weights).sum(), rows)
    np.testing.assert_allclose(found.numpy(), matrix.T @ weights.numpy(), rtol=0, atol=1e-14)


def test_taps_and_divisions_are_bands():
    shares = taps("linear", np.array([0.3, -1.2]), 0.9, 8, 7, kind=np.float64)
    rows = np.random.default_rng(2).standard_normal((20, 3))
    found = Bands.of_taps(shares, 8, np.array([2.0, -1.0]), np.array([11, 1])).of(rows)
    wanted = np.zeros((7, 3))
    for tap, (weight, begin) in enumerate(((2.0, 11), (-1.0, 1))):
        for pixel in range(7):
            for n, share in enumerate(shares.weights[tap, pixel]):
                if share:
                    wanted[pixel] += weight * share * rows[begin + shares.first[tap, pixel] + n]
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
    division = Division.of("linear", 8, 3)
    np.testing.assert_allclose(
        Bands.of_division(division, 8).of(rows[:8]), division.matrix(8) @ rows[:8], atol=1e-13
    )
