"""Views that are black or nearly so, as in the corners of a plenoptic camera's grid, beside its round pupil."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.words import first_few
from vcc.files import transfer as curves

Place = tuple[int, int]

_NEARLY_BLACK = 0.02
"""Of the light of the brightest view: 5.6 stops, which leave a dozen of 255 sRGB codes to what was mid-grey. No
vignetting and no flicker of a lamp takes that much from one view of a light field and not from another."""
_PIXELS = 64  # along a side, that are looked at: mean light to some per cent


def mean_light(view: NDArray[Any], transfer: str) -> float:
    """The mean light of some of the pixels of a view.

    Args:
        view: shape (t, s[, channel]).
        transfer: "srgb" or "linear": how integers stand for light.
    """
    some = view[:: max(1, view.shape[0] // _PIXELS), :: max(1, view.shape[1] // _PIXELS)]
    if transfer == "srgb" and some.dtype in (np.uint8, np.uint16):
        some = curves.decode(np.ascontiguousarray(some))
    return float(some.mean(dtype=np.float64))


def dark_places(light: Mapping[Place, float]) -> list[Place]:
    """(row, column) of the views with less than 2 % of the brightest one's light; none where all are black.

    Args:
        light: mean light of each view.
    """
    brightest = max(light.values(), default=0.0)
    return [place for place, mean in light.items() if mean < _NEARLY_BLACK * brightest]


def dark_words(light: Mapping[Place, float]) -> str:
    """How many views are dark, and which; empty for none."""
    dark = dark_places(light)
    if not dark:
        return ""
    return (
        f"{len(dark)} of the {len(light)} views are black or nearly so (less than {_NEARLY_BLACK:.0%} of the "
        f"brightest one's light), by (row, column): {first_few(dark, len(dark))}"
    )


def dark_notice(views: Mapping[Place, NDArray[Any]]) -> str:
    """A word on views that are dark, and what to do with them; empty for none.

    Args:
        views: linear, by (row, column).
    """
    words = dark_words({place: mean_light(view, "linear") for place, view in views.items()})
    if not words:
        return ""
    return f"{words}. A camera takes them for light that does not come: cut them off, like light_field[1:-1, 1:-1]"
