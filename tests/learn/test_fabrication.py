"""Codes that can be made: their constraints, counted and opened by SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy import ndimage

import vcc
from vcc.learn.fabrication import Fabrication
from vcc.torch import binary, fabricable

KINDS = [
    (14, 0.25, 2, "both", 48),  # of 196 cells 49, in groups of 4
    (14, 0.2, 3, "both", 40),  # 39.2
    (14, 0.7, 2, "left-right", 138),  # 137.2, in pairs
    (13, 0.4, 2, "none", 68),  # 67.6
    (11, 0.5, 3, "left-right", 60),  # 60.5; the middle column is single
    (9, 0.3, 1, "both", 24),  # 24.3
]


@pytest.mark.parametrize(("cells", "share", "feature", "symmetry", "opened"), KINDS)
def test_codes_of_random_scores_keep_all_constraints(cells, share, feature, symmetry, opened):
    random, kept = np.random.default_rng(0), Fabrication(cells, share, feature, symmetry)
    square = np.ones((feature, feature), bool)
    seen = set()
    for _ in range(25):
        holes = kept.nearest(random.standard_normal((cells, cells)))
        assert holes.sum() == kept.opened == opened
        for axis in {"none": (), "left-right": (1,), "both": (0, 1)}[symmetry]:
            assert np.array_equal(holes, np.flip(holes, axis))
        bars = np.pad(~holes, feature, constant_values=True)  # what surrounds the code is closed
        for cells_of in (holes, bars):
            # SciPy takes cells beyond the array as empty: an opening loses nothing at borders that are closed.
            assert np.array_equal(ndimage.binary_opening(cells_of, square), cells_of)
        if feature > 1:  # holes that touch at a corner would be one hole with eight neighbours, and two with four
            assert ndimage.label(holes)[1] == ndimage.label(holes, np.ones((3, 3)))[1]
        seen.add(holes.tobytes())
    assert len(seen) > 5


def test_without_features_and_symmetry_the_highest_scores_are_open():
    scores = torch.randn(7, 7, generator=torch.Generator().manual_seed(0))
    assert torch.equal(fabricable(scores, 0.4), binary(scores, 0.4))


def test_large_features_of_high_scores_are_found():
    """A wide bright square in the middle is the code that fits it."""
    scores = -np.ones((14, 14))
    scores[4:10, 4:10] = 1  # 36 cells
    assert np.array_equal(Fabrication(14, 36 / 196, 3, "both").nearest(scores), scores > 0)


def test_values_are_exactly_binary_and_gradients_pass_straight_through():
    scores = torch.randn(
        14, 14, dtype=torch.float64, generator=torch.Generator().manual_seed(0), requires_grad=True
    )
    code = fabricable(scores, 0.25, 2, "both")
    assert set(code.detach().unique().tolist()) == {0.0, 1.0}
    weights = torch.randn(14, 14, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    (gradient,) = torch.autograd.grad((weights * code).sum(), scores)
    torch.testing.assert_close(gradient, weights)


def test_what_cannot_be_made_is_refused():
    for arguments, message in (
        ((14, 0.25, 8, "both"), "feature"),
        ((14, 0.25, 2, "round"), "symmetry"),
        ((14, 1.2, 2, "both"), "share"),
        ((14, 0.01, 2, "both"), "opens 0 of 14×14"),
        ((14, 0.999, 1, "none"), "not all"),
    ):
        with pytest.raises(vcc.InputError, match=message):
            Fabrication(*arguments)
    kept = Fabrication(14, 0.25, 2, "both")
    for scores in (np.full((14, 14), np.nan), np.zeros((13, 13))):
        with pytest.raises(vcc.InputError, match="14×14 finite"):
            kept.nearest(scores)
    with pytest.raises(vcc.InputError, match="as many rows as columns"):
        fabricable(torch.zeros(3, 4), 0.5)
    with pytest.raises(vcc.InputError, match="no code of 5×5 cells with 24 open ones"):
        Fabrication(5, 0.96, 2, "both").nearest(np.zeros((5, 5)))  # the middle is a bar of one cell
