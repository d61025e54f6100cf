"""What may be learned of a camera before a light field, and how true its derivatives are."""

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
"""How names of parameters begin that pictures do not depend on, but what is recorded of them."""


STEP = 1e-4
"""Of a change of 1 (`vcc.learn.scales`): far enough for all that follows to be seen."""


@dataclass(frozen=True)
class Verdict:
    """Whether a parameter may be learned.

    Args:
        kind: ``"exact"``: the derivative is that of the picture; ``"smoothed"``: it is that of a picture, or of a
            recording, from which jumps are taken; ``"refused"``: there is none.
        why: it is not exact, in words.
    """

    kind: Kind
    why: str = ""


def verdict(train: Train, grid: Grid, name: str, how: How | None = None) -> Verdict:
    """Whether a parameter of a camera may be learned before a light field.

    Args:
        train: the camera.
        grid: of the light field.
        name: of the parameter.
        how: what was chosen of the computation; None takes the defaults.

    Raises:
        InputError: there is no such parameter.
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
    """The numbers of the plan (`vcc.plan.model.Plan.parameters`) that change where a parameter does.

    Args:
        chain: from parameters to plans, as learning begins.
        name: of the parameter.

    Raises:
        InputError: they do not follow it.
    """
    here = read(chain.train, name)
    # Each of its numbers by another amount, so that no changes make up for one another.
    some = STEP * scale(chain.train, name) * np.random.default_rng(0).uniform(0.5, 1.0, here.shape)
    start = chain.plan().parameters()
    for moved in (here + some, here - some):
        try:
            numbers = chain.plan({name: moved}).parameters()
        except InputError:  # at an end of what its element takes, or of what was decided
            continue
        return [number for number, value in numbers.items() if not np.array_equal(value, start[number])]
    return chain.followed()[name]
