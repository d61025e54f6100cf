"""``vcc refocus --memory-limit``: stores are read in pieces, stacks that would not fit are refused."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from tests.command_line import refused, run
from vcc.store import save_store


@pytest.fixture
def store(tmp_path, monkeypatch):
    """A store of 5×5 views of 64×80 pixels, 2.6 MB."""
    monkeypatch.chdir(tmp_path)
    values = np.random.default_rng(0).random((5, 5, 64, 80), np.float32)
    save_store(vcc.LightField.from_views(values, 1e-3, 1e-3, 1.0), "field.zarr")
    return "field.zarr"


def test_a_store_in_pieces_gives_the_same_picture(store):
    for name, more in (("whole", []), ("pieces", ["--memory-limit", "1 MB"])):
        result = run("refocus", store, "--distance", "0.7 m", "-o", f"{name}.npy", *more)
        assert result.exit_code == 0, result.output
    # Sums of float32 in another order.
    np.testing.assert_allclose(np.load("pieces.npy"), np.load("whole.npy"), atol=1e-5)


def test_too_large_a_stack_is_refused(store):
    stack = "refocus", store, "--stack", "0.5 m", "2 m", 8, "--all-in-focus", "-o", "sharp.npy"
    assert "focal stack" in refused(*stack, "--memory-limit", "10 kB")
    assert "--memory-limit" in refused(*stack, "--memory-limit", "much")
    assert run(*stack, "--memory-limit", "10 MB").exit_code == 0
