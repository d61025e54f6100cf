"""Constraints on what is learned, as ordinary functions of tensors: what a camera can be made of.

Each takes numbers that are free, or nearly so, and gives numbers that an element takes; they can be put one around
the other: ``binary(sigmoid_mask(raw))``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch

from vcc.base import checks
from vcc.base.errors import InputError

NEAR = 1e-6
"""How near to 0 and 1 a transmission may come before its logarithm is taken."""
ENOUGH = 60
"""Halvings of the interval in which the shift of `total_light` lies: to the last digit of double precision."""
FURTHEST = 40.0
"""The largest shift of `total_light`, in logarithms of odds: 1 in 10¹⁷."""


def sigmoid_mask(raw: torch.Tensor) -> torch.Tensor:
    """Any numbers as transmissions, 0 to 1: 1/(1 + exp(−raw)), of any shape.

    Begin with `raw_of` of the transmissions that are to be there first.
    """
    return torch.sigmoid(raw)


def raw_of(mask: torch.Tensor) -> torch.Tensor:
    """The numbers of which `sigmoid_mask` makes these transmissions: log(T/(1 − T)), of any shape.

    Args:
        mask: transmissions, 0 to 1; those nearer than 1e-6 to an end are taken to lie there.
    """
    return torch.logit(mask, eps=NEAR)


INVERSES = {sigmoid_mask: raw_of}
"""Constraints that can be undone: where free numbers begin."""


def binary(mask: torch.Tensor) -> torch.Tensor:
    """Transmissions as 0 or 1, whichever is nearer; gradients go straight through (Bengio et al. 2013).

    Args:
        mask: transmissions, 0 to 1, of any shape, as `sigmoid_mask` gives them. At ½ it is open.
    """
    return _straight_through(mask, (mask >= 0.5).to(mask.dtype))


def levels(number: int) -> Callable[[torch.Tensor], torch.Tensor]:
    """A function that rounds transmissions to so many even levels; gradients go straight through.

    Args:
        number: of levels from 0 to 1, both included, 2 or more.

    Raises:
        InputError: another number.
    """
    steps = checks.whole_number_between("number of levels", number, 2) - 1

    def rounded(mask: torch.Tensor) -> torch.Tensor:
        """Transmissions, 0 to 1, of any shape, at the nearest level."""
        return _straight_through(mask, torch.round(mask * steps) / steps)

    return rounded


def total_light(mask: torch.Tensor, share: float) -> torch.Tensor:
    """Transmissions of which a given share passes in the mean, all between 0 and 1.

    The odds T/(1 − T) of all cells are multiplied by one factor, which is found so that the mean is right: none
    leaves 0 to 1, and 0 and 1 stay (nearly) what they are. The derivative is that of the factor, too.

    Args:
        mask: transmissions, 0 to 1, (..., rows, columns): of each mask for itself.
        share: of the light, the mean of the transmissions, above 0 and below 1.

    Raises:
        InputError: no such share.
    """
    share = checks.above_zero("share of the light", share, most=1)
    if share == 1:
        raise InputError("share of the light is 1: that is a mask without cells, all open")
    odds = torch.logit(mask, eps=NEAR)
    shift = _shift(odds.detach(), share)
    light = torch.sigmoid(odds + shift)
    # One step of Newton's: no change in value, and the derivative of the implicit function.
    slope = (light * (1 - light)).mean(dim=(-2, -1), keepdim=True).detach()
    shift = shift - (light.mean(dim=(-2, -1), keepdim=True) - share) / slope
    return torch.sigmoid(odds + shift)


def _shift(odds: torch.Tensor, share: float) -> torch.Tensor:
    """What is added to logarithms of odds so that the mean transmission is a share, by halving."""
    low = torch.full_like(odds[..., :1, :1], -FURTHEST)
    high = -low
    for _ in range(ENOUGH):
        middle = (low + high) / 2
        dark = torch.sigmoid(odds + middle).mean(dim=(-2, -1), keepdim=True) < share
        low, high = torch.where(dark, middle, low), torch.where(dark, high, middle)
    return (low + high) / 2


def _straight_through(mask: torch.Tensor, rounded: torch.Tensor) -> Any:
    return mask + (rounded - mask).detach()
