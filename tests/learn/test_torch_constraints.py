"""Constraints as ordinary functions: what they give, and the gradients that they let through."""

from __future__ import annotations

import pytest
import torch

import vcc
from vcc.learn.torch_constraints import binary, levels, raw_of, sigmoid_mask, total_light

torch.manual_seed(0)
MASK = torch.rand(2, 5, 7, dtype=torch.float64)


def test_a_sigmoid_mask_and_its_raw_numbers_are_each_others_inverse():
    torch.testing.assert_close(sigmoid_mask(raw_of(MASK)), MASK, rtol=0, atol=1e-15)
    ends = torch.tensor([0.0, 1.0], dtype=torch.float64)
    torch.testing.assert_close(sigmoid_mask(raw_of(ends)), ends, rtol=0, atol=1.001e-6)  # cut off there


def test_straight_through_rounds_and_lets_the_gradient_through():
    weights = torch.randn_like(MASK)
    for function, values in ((binary, [0.0, 1.0]), (levels(2), [0.0, 1.0]), (levels(4), [0.0, 1 / 3, 2 / 3, 1.0])):
        given = MASK.clone().requires_grad_()
        found = function(given)
        torch.testing.assert_close(found.detach().unique(), torch.tensor(values, dtype=torch.float64))
        assert (found - given).abs().max() <= (values[1] - values[0]) / 2 + 1e-12
        (gradient,) = torch.autograd.grad((weights * found).sum(), given)
        torch.testing.assert_close(gradient, weights)
    assert torch.equal(binary(torch.tensor([0.49, 0.5])), torch.tensor([0.0, 1.0]))


def test_levels_are_two_or_more():
    with pytest.raises(vcc.InputError, match="number of levels is a whole number, 2 or more, not 1"):
        levels(1)


@pytest.mark.parametrize("share", [0.01, 0.5, 0.93])
def test_the_total_light_is_what_was_asked_for_and_no_cell_leaves_its_range(share):
    found = total_light(MASK, share)
    torch.testing.assert_close(found.mean(dim=(1, 2)), torch.full((2,), share, dtype=torch.float64))
    assert found.min() > 0
    assert found.max() < 1
    # Of one factor for all odds, the order of the cells stays.
    assert torch.equal(found.flatten(1).argsort(), MASK.flatten(1).argsort())
    torch.testing.assert_close(total_light(found, share), found)


def test_the_derivative_of_the_total_light_is_that_of_the_factor_too():
    cells = (0.1 + 0.8 * MASK[0, :2, :3]).requires_grad_()
    assert torch.autograd.gradcheck(lambda mask: total_light(mask, 0.4), (cells,))
    # The sum is kept: what all cells add to it is nothing.
    (gradient,) = torch.autograd.grad(total_light(cells, 0.4).sum(), cells)
    assert gradient.abs().max() < 1e-12


@pytest.mark.parametrize("share", [0.1, 0.2, 0.3, 0.4, 0.8])
@pytest.mark.parametrize("mask", [torch.rand(3, 20, 25, dtype=torch.float64), torch.full((3, 20, 25), 0.3)])
def test_what_is_binary_keeps_the_total_light(share, mask):
    """The brightest cells are open, as many as the share asks for: none that is closed is brighter."""
    given = mask.clone().requires_grad_()
    found = binary(total_light(given, share))
    assert found.detach().unique().tolist() == [0.0, 1.0]
    assert found.sum(dim=(1, 2)).tolist() == [500 * share] * 3
    for cells, opened in zip(mask, found.detach(), strict=True):
        assert cells[opened == 1].min() >= cells[opened == 0].max()
    weights = torch.randn_like(mask)
    (gradient,) = torch.autograd.grad((weights * found).sum(), given)
    (grey,) = torch.autograd.grad((weights * total_light(given, share)).sum(), given)
    torch.testing.assert_close(gradient, grey)
    assert torch.equal(binary(mask, share), found.detach())


def test_an_even_mask_opens_cells_that_are_spread_evenly():
    opened = binary(total_light(torch.full((32, 32), 0.5), 0.25))
    parts = opened.reshape(4, 8, 4, 8).mean(dim=(1, 3))
    # 16 of 64 cells in each part; the whole first quarter open would be 64 in four of them.
    assert (parts - 0.25).abs().max() <= 3 / 64
    assert binary(total_light(torch.rand(3, 4), 0.01)).sum() == 1  # one at least


@pytest.mark.parametrize("share", [0.0, 1.0, 1.5])
@pytest.mark.parametrize("function", [total_light, binary])
def test_a_share_lies_between_none_and_all(share, function):
    with pytest.raises(vcc.InputError, match="share of the light"):
        function(MASK, share)
