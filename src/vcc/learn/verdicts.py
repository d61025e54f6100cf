"""Which parameters of a camera can be learned with a light field, and how exact their derivatives are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.learn.parameters import SENSOR, parameter
from vcc.learn.paths import Paths
from vcc.optics.train import Train
from vcc.plan.how import How
from vcc.shapes.patterns import Polygon

Kind = Literal["exact", "smoothed", "refused"]

ELECTRONICS = f"{SENSOR}.electronics."
"""Prefix of the parameters that affect recordings, but not images."""


@dataclass(frozen=True)
class Verdict:
    """Whether a parameter can be learned.

    Args:
        kind: ``"exact"``: the derivative of the image itself; ``"smoothed"``: the derivative of an image or a
            recording with jumps smoothed; ``"refused"``: no derivative.
        why: the reason why it is not exact, as text.
    """

    kind: Kind
    why: str = ""


def verdict(train: Train, grid: Grid, name: str, how: How | None = None) -> Verdict:
    """Whether a parameter of a camera can be learned with a light field.

    Args:
        train: the camera.
        grid: of the light field.
        name: of the parameter.
        how: the settings; None uses the defaults.

    Raises:
        InputError: an unknown parameter.
    """
    found = parameter(train, name)
    if name.startswith(ELECTRONICS):
        return Verdict("smoothed", "rounding to whole numbers lets the gradient straight through")
    try:
        paths = Paths.of(train, grid, how, [name])
    except InputError as error:
        return Verdict("refused", str(error))
    if isinstance(found.holder, Polygon) and any(path.chain.plan({}).by_rays for path in paths.each):
        return Verdict("smoothed", "by rays its edges are those of a texture")
    return Verdict("exact")
