"""Zernike surfaces on large grids: few places fix the polynomials; those evaluated one by one are the oracle."""

import numpy as np
import pytest

from vcc.shapes.zernike import ROUNDING, Zernike, noll


@pytest.mark.parametrize("terms", [20, 200])
def test_a_large_grid_is_found_from_as_few_places_as_fix_its_polynomials(terms, monkeypatch):
    plate = Zernike(tuple(np.random.default_rng(terms).normal(size=terms) * 1e-8), 8e-3)
    x, y = np.linspace(-4e-3, 3.2e-3, 300)[None, :], np.linspace(-3.6e-3, 4e-3, 200)[:, None]
    looked_at = []
    within_disc = Zernike._within_disc

    def counted(self, across, down):
        looked_at.append(across.size)
        return within_disc(self, across, down)

    monkeypatch.setattr(Zernike, "_within_disc", counted)
    found = plate.slopes(x, y)
    assert sum(looked_at) <= noll(terms)[0] ** 2
    each = np.broadcast_arrays(x, y)
    inside = np.hypot(*each) < 4e-3
    for one, other in zip(found, plate.slopes(*map(np.array, each)), strict=True):
        assert np.abs(one - other)[inside].max() < ROUNDING * np.abs(other)[inside].max()
