"""Detection of nearly black views, such as the corners of a plenoptic camera's grid, outside its pupil."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.words import first_few
from vcc.files import transfer as curves

Place = tuple[int, int]

_NEARLY_BLACK = 0.02
"""Fraction of the brightest view's light: 5.6 stops, which leave about a dozen of 255 sRGB codes for mid-grey.
Neither vignetting nor lamp flicker causes such a difference between views of one light field."""
_PIXELS = 64  # sampled along a side: mean light to a few per cent


def mean_light(view: NDArray[Any], transfer: str) -> float:
    """The mean light of a view, from a sample of its pixels.

    Args:
        view: shape (t, s[, channel]).
        transfer: "srgb" or "linear": transfer function of integers.
    """
    some = view[:: max(1, view.shape[0] // _PIXELS), :: max(1, view.shape[1] // _PIXELS)]
    if transfer == "srgb" and some.dtype in (np.uint8, np.uint16):
        some = curves.decode(np.ascontiguousarray(some))
    return float(some.mean(dtype=np.float64))


def dark_places(light: Mapping[Place, float]) -> list[Place]:
    """(row, column) of the views with less than 2 % of the brightest view's light; none if all are black.

    Args:
        light: mean light of each view.
    """
    brightest = max(light.values(), default=0.0)
    return [place for place, mean in light.items() if mean < _NEARLY_BLACK * brightest]


def dark_words(light: Mapping[Place, float]) -> str:
    """Text on the number and places of dark views; empty if there are none."""
    dark = dark_places(light)
    if not dark:
        return ""
    return (
        f"{len(dark)} of the {len(light)} views are black or nearly so (less than {_NEARLY_BLACK:.0%} of the "
        f"brightest one's light), by (row, column): {first_few(dark, len(dark))}"
    )


def dark_notice(views: Mapping[Place, NDArray[Any]]) -> str:
    """Notice on dark views and what to do with them; empty if there are none.

    Args:
        views: linear views by (row, column).
    """
    words = dark_words({place: mean_light(view, "linear") for place, view in views.items()})
    if not words:
        return ""
    return f"{words}. A camera treats them as missing light: crop them, as in light_field[1:-1, 1:-1]"
