"""Which parameters of a camera can be learned with a light field, and how exact their derivatives are."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.learn.chain import Chain
from vcc.learn.parameters import SENSOR, parameter, read
from vcc.learn.scales import scale
from vcc.optics.train import Train
from vcc.plan.how import How
from vcc.shapes.patterns import Polygon

Kind = Literal["exact", "smoothed", "refused"]

ELECTRONICS = f"{SENSOR}.electronics."
"""Prefix of the parameters that affect recordings, but not images."""


STEP = 1e-4
"""Step relative to a change of 1 (`vcc.learn.scales`): large enough to reveal all dependent numbers."""


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
        chain = Chain(train, grid, how, [name])
        following(chain, name)
    except InputError as error:
        return Verdict("refused", str(error))
    if isinstance(found.holder, Polygon) and chain.plan({}).by_rays:
        return Verdict("smoothed", "by rays its edges are those of a texture")
    return Verdict("exact")


def following(chain: Chain, name: str) -> Collection[str]:
    """The numbers of the plan (`vcc.plan.model.Plan.parameters`) that depend on a parameter.

    Args:
        chain: from parameters to plans, when learning begins.
        name: of the parameter.

    Raises:
        InputError: the numbers do not follow the parameter.
    """
    here = read(chain.train, name)
    # A different step for each number, so that changes do not cancel.
    some = STEP * scale(chain.train, name) * np.random.default_rng(0).uniform(0.5, 1.0, here.shape)
    start = chain.plan().parameters()
    for moved in (here + some, here - some):
        try:
            numbers = chain.plan({name: moved}).parameters()
        except InputError:  # at a limit of the element or of the choices
            continue
        return [number for number, value in numbers.items() if not np.array_equal(value, start[number])]
    return chain.followed()[name]
