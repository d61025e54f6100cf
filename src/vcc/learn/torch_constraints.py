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

_SHARE = "vcc_share_of_light"
"""The attribute in which tensors of `total_light` hold the share that they were asked for."""
_GOLDEN = 0.6180339887498949
"""Fraction of the golden ratio: multiples of it are spread evenly from 0 to 1."""
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


def binary(mask: torch.Tensor, share: float | None = None) -> torch.Tensor:
    """Transmissions as 0 or 1; gradients go straight through (Bengio et al. 2013).

    Args:
        mask: transmissions, 0 to 1, of any shape, as `sigmoid_mask` gives them; with a share (..., rows, columns).
        share: of the light: the brightest cells of each mask are open, as many as come nearest to the share, and
            one at least; of equally bright ones some that are spread evenly. None takes the share of `total_light`
            where ``mask`` is what that returned; else each cell is open at ½ and above.

    Raises:
        InputError: no such share.
    """
    if share is None:
        share = getattr(mask, _SHARE, None)
    if share is None:
        return _straight_through(mask, (mask >= 0.5).to(mask.dtype))
    return _straight_through(mask, _brightest(mask.detach(), _checked_share(share)))


def _brightest(mask: torch.Tensor, share: float) -> torch.Tensor:
    """1 for the brightest cells of each mask, as many as make a share of them, and 0 for the others."""
    cells = mask.shape[-2] * mask.shape[-1]
    opened = min(max(round(share * cells), 1), cells)
    evenly = torch.argsort(torch.arange(cells, dtype=torch.float64) * _GOLDEN % 1)
    ranked = torch.argsort(mask.flatten(-2)[..., evenly], dim=-1, descending=True, stable=True)
    found = torch.zeros_like(mask).flatten(-2)
    return found.scatter(-1, evenly[ranked[..., :opened]], 1.0).reshape(mask.shape)


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
    """Transmissions of which a given share passes in the mean, all between 0 and 1; `binary` of them keeps it.

    The odds T/(1 − T) of all cells are multiplied by one factor, which is found so that the mean is right: none
    leaves 0 to 1, and 0 and 1 stay (nearly) what they are. The derivative is that of the factor, too.

    Args:
        mask: transmissions, 0 to 1, (..., rows, columns): of each mask for itself.
        share: of the light, the mean of the transmissions, above 0 and below 1.

    Raises:
        InputError: no such share.
    """
    share = _checked_share(share)
    odds = torch.logit(mask, eps=NEAR)
    shift = _shift(odds.detach(), share)
    light = torch.sigmoid(odds + shift)
    # One step of Newton's: no change in value, and the derivative of the implicit function.
    slope = (light * (1 - light)).mean(dim=(-2, -1), keepdim=True).detach()
    shift = shift - (light.mean(dim=(-2, -1), keepdim=True) - share) / slope
    found = torch.sigmoid(odds + shift)
    setattr(found, _SHARE, share)
    return found


def _checked_share(share: float) -> float:
    share = checks.above_zero("share of the light", share, most=1)
    if share == 1:
        raise InputError("share of the light is 1: that is a mask without cells, all open")
    return share


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
