"""Constraints on learned parameters, as functions of tensors: they keep a camera physically valid.

Each function maps free numbers to numbers that an element accepts. Functions can be composed:
``binary(sigmoid_mask(raw))``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.learn.fabrication import Fabrication

_SHARE = "vcc_share_of_light"
"""The attribute in which tensors of `total_light` store their share."""
_GOLDEN = 0.6180339887498949
"""Fractional part of the golden ratio: its multiples modulo 1 are evenly spread."""
NEAR = 1e-6
"""Transmissions are clipped to this distance from 0 and 1 before the logarithm."""
ENOUGH = 60
"""Bisection steps for the shift of `total_light`: to the last digit of double precision."""
FURTHEST = 40.0
"""The largest shift of `total_light`, in log-odds: 1 in 10¹⁷."""


def sigmoid_mask(raw: torch.Tensor) -> torch.Tensor:
    """Map any numbers to transmissions, 0 to 1: 1/(1 + exp(−raw)), of any shape.

    Start from `raw_of` of the initial transmissions.
    """
    return torch.sigmoid(raw)


def raw_of(mask: torch.Tensor) -> torch.Tensor:
    """The inverse of `sigmoid_mask`: log(T/(1 − T)), of any shape.

    Args:
        mask: transmissions, 0 to 1; values closer than 1e-6 to 0 or 1 are clipped.
    """
    return torch.logit(mask, eps=NEAR)


INVERSES = {sigmoid_mask: raw_of}
"""Constraints with an inverse, which gives the initial free numbers."""


def binary(mask: torch.Tensor, share: float | None = None) -> torch.Tensor:
    """Round transmissions to 0 or 1; straight-through gradients (Bengio et al. 2013).

    Args:
        mask: transmissions, 0 to 1, of any shape, as `sigmoid_mask` returns; with a share (..., rows, columns).
        share: of the light: the brightest cells of each mask are open, as many as come nearest to the share, at
            least one; among equally bright cells, an evenly spread selection. None uses the share of `total_light`
            if ``mask`` is its result; otherwise each cell is open from ½ on.

    Raises:
        InputError: an invalid share.
    """
    if share is None:
        share = getattr(mask, _SHARE, None)
    if share is None:
        return _straight_through(mask, (mask >= 0.5).to(mask.dtype))
    return _straight_through(mask, _brightest(mask.detach(), _checked_share(share)))


def _brightest(mask: torch.Tensor, share: float) -> torch.Tensor:
    """1 for the brightest cells of each mask, in number a share of all cells; 0 for the others."""
    cells = mask.shape[-2] * mask.shape[-1]
    opened = min(max(round(share * cells), 1), cells)
    evenly = torch.argsort(torch.arange(cells, dtype=torch.float64) * _GOLDEN % 1)
    ranked = torch.argsort(mask.flatten(-2)[..., evenly], dim=-1, descending=True, stable=True)
    found = torch.zeros_like(mask).flatten(-2)
    return found.scatter(-1, evenly[ranked[..., :opened]], 1.0).reshape(mask.shape)


def fabricable(mask: torch.Tensor, share: float, feature: int = 1, symmetry: str = "none") -> torch.Tensor:
    """A binary code that can be made, of high values; straight-through gradients.

    See `vcc.learn.fabrication.Fabrication`: the number of open cells is exact, no hole and no bar is smaller than
    ``feature`` × ``feature`` cells, and the code is symmetric. The gradient is that of `binary`.

    Args:
        mask: any numbers, (rows, columns), both equal: transmissions, or free numbers without another constraint.
        share: of the light; at most half a group of mirrored cells (0.5, 1 or 2 cells) is rounded.
        feature: side of the smallest hole and bar, cells.
        symmetry: "none", "left-right", or "both": left-right and up-down.

    Returns:
        Zeros and ones, in the mask's type and shape.

    Raises:
        InputError: an invalid share, feature, symmetry or shape, or no such code was found.
    """
    if mask.ndim != 2 or mask.shape[0] != mask.shape[1]:
        raise InputError(f"a code to be made has as many rows as columns, and the mask has {tuple(mask.shape)}")
    kept = Fabrication(mask.shape[0], share, feature, symmetry)
    found = torch.from_numpy(kept.nearest(mask.detach().to(torch.float64).numpy()))
    return _straight_through(mask, found.to(mask.dtype))


def levels(number: int) -> Callable[[torch.Tensor], torch.Tensor]:
    """A function that rounds transmissions to evenly spaced levels; straight-through gradients.

    Args:
        number: levels from 0 to 1, both included; 2 or more.

    Raises:
        InputError: an invalid number.
    """
    steps = checks.whole_number_between("number of levels", number, 2) - 1

    def rounded(mask: torch.Tensor) -> torch.Tensor:
        """Round transmissions, 0 to 1, of any shape, to the nearest level."""
        return _straight_through(mask, torch.round(mask * steps) / steps)

    return rounded


def total_light(mask: torch.Tensor, share: float) -> torch.Tensor:
    """Transmissions between 0 and 1 with a given mean; `binary` preserves the share.

    The odds T/(1 − T) of all cells are multiplied by the one factor that gives this mean: all values stay
    between 0 and 1, and 0 and 1 stay (nearly) the same. The gradient includes the derivative of the factor.

    Args:
        mask: transmissions, 0 to 1, (..., rows, columns); each mask has its own factor.
        share: of the light: the mean of the transmissions, above 0 and below 1.

    Raises:
        InputError: an invalid share.
    """
    share = _checked_share(share)
    odds = torch.logit(mask, eps=NEAR)
    shift = _shift(odds.detach(), share)
    light = torch.sigmoid(odds + shift)
    # One Newton step: it does not change the value, but has the derivative of the implicit function.
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
    """The shift of log-odds that makes the mean transmission equal to a share, by bisection."""
    low = torch.full_like(odds[..., :1, :1], -FURTHEST)
    high = -low
    for _ in range(ENOUGH):
        middle = (low + high) / 2
        dark = torch.sigmoid(odds + middle).mean(dim=(-2, -1), keepdim=True) < share
        low, high = torch.where(dark, middle, low), torch.where(dark, high, middle)
    return (low + high) / 2


def _straight_through(mask: torch.Tensor, rounded: torch.Tensor) -> Any:
    return rounded.detach() + (mask - mask.detach())  # exactly the rounded values
