"""The backward pass of steps of rays and aims: transposes against difference quotients of the forward pass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vcc.base.affine import Affine
from vcc.optics.deflections import CellDeflection
from vcc.optics.visible_pupil import VisiblePupil
from vcc.plan.parameters import parameters, with_parameters
from vcc.plan.rays import steps
from vcc.plan.rays.aim_backwards import aim_back
from vcc.plan.rays.backwards import back
from vcc.plan.rays.bounds.windows import CellOpening, CellWindows, Sight, Stop, Window
from vcc.plan.rays.steps import Bundle, Texture
from vcc.shapes.lattice import Lattice

RANDOM = np.random.default_rng(11)
RAYS = ("x", "y", "s", "t", "share", "points")
STEP = 1e-7
"""For numbers of about 1: rounding gives some 1e-8 of a difference quotient, and curvature as much, except for
rays at the rim of a disc, which give 1e-5 of the whole sum. None of some hundred rays meets a kink within the
step."""
TOLERANCE = {"rel": 3e-5, "abs": 1e-6}


def random(*shape: int) -> np.ndarray:
    return RANDOM.uniform(-1, 1, shape)


def bundle(shape=(6, 9), columns=8) -> Bundle:
    share = RANDOM.uniform(0.5, 1.5, shape)
    points = np.concatenate([random(*shape, columns - 1), RANDOM.random((*shape, 1))], axis=-1)
    return Bundle(2 * random(*shape), 2 * random(*shape), random(*shape), random(*shape), share, points)


def weights_like(rays: Bundle) -> Bundle:
    return Bundle(*(random(*np.shape(getattr(rays, name))) for name in RAYS))


def told(weights: Bundle, rays: Bundle) -> float:
    return float(sum(np.sum(getattr(weights, name) * getattr(rays, name)) for name in RAYS))


def slope(function: Callable[[Any], float], at: np.ndarray, along: np.ndarray) -> float:
    """The derivative of a function of an array along a direction."""
    return (function(at + STEP * along) - function(at - STEP * along)) / (2 * STEP)


LATTICES = Lattice("hexagonal", 0.7, 0.2, (0.1, -0.3)), Lattice("square", 0.9, -0.4, (-0.2, 0.15))
MATRIX = np.eye(5) + 0.3 * RANDOM.uniform(-1, 1, (5, 5))
MATRIX[4] = [0, 0, 0, 0, 1]
CUMULATIVE = np.cumsum(RANDOM.dirichlet([1, 1, 1], (4, 5)), axis=-1)
CASES = {
    "move": steps.Move(Affine(MATRIX)),
    "cells": steps.CellsUnbend(LATTICES[0], (0.2, 0.4), random(2, 3), random(2, 3, 2), "cells"),
    "square cells": steps.CellsUnbend(LATTICES[1], (0.2, 0.4), random(1, 2), random(1, 2, 2), "cells"),
    "gaps": steps.CellGaps(LATTICES[0], (0.2, 0.4), 0.3, True, "gaps"),
    "block": steps.BlockOfCells(LATTICES[1], (0.2, 0.4), 2, 2, "block"),
    "facets": steps.FacetsUnbend(random(3, 2), random(3, 2), (0.1, 0.2), "facets"),
    "plate": steps.TextureUnbend(Texture(random(4, 6, 2), (-1.3, -1.6), (0.5, 0.9)), "plate"),
    "plate of one row": steps.TextureUnbend(Texture(random(1, 6, 2), (-1.3, -1.6), (0.5, 0.9)), "plate"),
    "plate of one column": steps.TextureUnbend(Texture(random(5, 1, 2), (-1.3, -1.6), (0.5, 0.9)), "plate"),
    "disc": steps.Disc((0.3, -0.2), 1.2, "disc"),
    "rectangle": steps.Rectangle((0.3, -0.2), (1.2, 0.8), "rectangle"),
    "mask of cells": steps.CellShares(RANDOM.random((4, 5)), (-1.5, -1.2), (0.6, 0.7), "mask"),
    "cosines": steps.Cosines((0.1, -0.3), (1.7, 2.3), 0.4, 3, "cosines"),
    "cosines along y": steps.Cosines((0.1, -0.3), (0.0, 2.3), 0.4, 2, "cosines"),
    "mask": steps.TextureShares(Texture(RANDOM.random((5, 4, 1)), (-1.2, -1.4), (0.8, 0.6)), "mask"),
    "diffuser": steps.Unscatter(2, 1, -1, None, None, "diffuser"),
    "diffuser of widths": steps.Unscatter(
        1, 1, -1, None, Texture(RANDOM.random((4, 3, 1)), (-1.2, -1.4), (0.8, 0.6)), "diffuser"
    ),
    "mixed diffuser": steps.Unscatter(
        1, 3, 7, Texture(CUMULATIVE, (-1.2, -1.4), (0.6, 0.9)),
        Texture(RANDOM.random((4, 3, 1)), (-1.2, -1.4), (0.8, 0.6)), "diffuser",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_each_step_backwards_is_the_transpose_of_its_derivative(name):
    """For all that rays are and for all numbers of a step; those that it does not name change nothing."""
    step, before = CASES[name], bundle()
    behind = weights_like(before)

    def made(step: steps.Step, rays: Bundle) -> float:
        rays = replace(rays)
        step(rays)
        return told(behind, rays)

    found, own = back(step, before, replace(behind))
    for part in RAYS:
        along = random(*getattr(before, part).shape)
        wanted = slope(lambda at, p=part: made(step, replace(before, **{p: at})), getattr(before, part), along)
        assert np.sum(getattr(found, part) * along) == pytest.approx(wanted, **TOLERANCE), part
    known = parameters(step)
    assert set(own) <= set(known)
    for number, value in known.items():
        along = random(*value.shape)
        if number == "before_from_behind":
            along[4] = 0
        if number == "frequency":  # 0 stands for no cosines along an axis, and stays
            assert not own[number][value == 0].any()
            along *= value != 0
        wanted = slope(lambda at, n=number: made(with_parameters(step, {n: at}), before), value, along)
        got = np.sum(own.get(number, 0.0) * along)
        assert got == pytest.approx(wanted, **TOLERANCE), number


def sees(disc: bool, radius: float, borders: int) -> CellWindows:
    """An array whose cells' openings and images of the stop cut one another at all sides."""
    return CellWindows(
        CellDeflection(LATTICES[0], random(2, 3), 0.1 * random(2, 3, 2)),
        CellOpening(np.array([0.3, 0.35]), np.array([[0.0, 0.33], [0.6, 0.4], [-0.6, 0.4]])[:borders], radius),
        Sight(
            np.array([0.9, 1.1]), np.array([-2.1, 1.8]), np.array([0.05, -0.1]), np.array([-2.2, -2.6]),
            np.array([0.8, 0.7]), np.array([0.4, 0.5]), np.array([0.02, 0.07]),
        ),
        Stop(np.array([0.1, 0.2]), np.array([0.8, 0.6]), disc),
        (1, 1),
        "cells",
    )  # fmt: skip


AIMS = {
    "window": Window(random(2, 2), random(2, 2), random(2), False, "window"),
    "disc behind diffusers": Window(
        np.array([[0.2, 1.1], [0.9, -0.3]]), random(2, 2), random(2), True, "disc",
        ((4, random(2, 2)), (6, random(2, 2))),
    ),
    "part of a disc": Window(
        random(2, 2), random(2, 2), random(2), True, "disc",
        visible=VisiblePupil(np.abs(random(5, 9)), (0.1, -0.2), 0.4),
    ),
    "cells": sees(False, np.inf, 3),
    "cells that look at a disc": sees(True, np.inf, 1),
    "round cells": sees(True, 0.34, 0),
}  # fmt: skip


@pytest.mark.parametrize("name", AIMS)
def test_aims_backwards_are_the_transposes_of_their_derivatives(name):
    aim = AIMS[name]
    x, y = 0.5 * random(2, 7, 1, 11)
    points, cells = random(7, 1, 11, 8), None
    if isinstance(aim, CellWindows):
        row, column = aim.around(x[:, 0, 0], y[:, 0, 0])
        cells = row[..., None], column[..., None]
        x, y, points = (np.repeat(each, row.shape[1], axis=1) for each in (x, y, points))

    def aimed(aim: Any, x: np.ndarray, y: np.ndarray, points: np.ndarray) -> Bundle:
        if isinstance(aim, CellWindows):
            assert cells is not None
            return Bundle(x, y, *aim.rays_through(x, y, *cells, points[..., 2:4]), points)
        return Bundle(x, y, *aim.slopes(x, y, points), points)

    rays = aimed(aim, x, y, points)
    if isinstance(aim, CellWindows):  # some of all kinds: cut by the image and by the opening, dark, lit
        assert 0.2 < (rays.share > 0).mean() < 0.95
    behind = weights_like(rays)
    # At the rim of a disc curvature has no bounds, and a root of what rounding leaves says nothing.
    rim = (rays.share < 0.2 * rays.share.max()) & (isinstance(aim, CellWindows) and aim.stop.disc)
    behind = Bundle(*(np.where(rim[..., None] if n == "points" else rim, 0.0, getattr(behind, n)) for n in RAYS))
    found, own = aim_back(aim, rays, cells, behind)
    if getattr(aim, "visible", None) is not None:  # constants: rays move in the pupil, and light does not change
        drawn: tuple[str, ...] = ("points",)
    else:
        drawn = ("x", "y") if isinstance(aim, CellWindows) else ("x", "y", "points")
    for part in drawn:
        given = {"x": x, "y": y, "points": points}
        along = random(*given[part].shape)
        if part == "points":
            along[..., :4] = 0  # where in the window a ray goes is no number that changes

        def changed(at: np.ndarray, part: str = part, given: dict[str, np.ndarray] = given) -> float:
            return told(behind, aimed(aim, **{**given, part: at}))

        wanted = slope(changed, given[part], along)
        assert np.sum(getattr(found, part) * along) == pytest.approx(wanted, **TOLERANCE), part
    for number, value in parameters(aim).items():
        if not np.isfinite(value).all():
            continue
        along = random(*value.shape)
        wanted = slope(
            lambda at, n=number: told(behind, aimed(with_parameters(aim, {n: at}), x, y, points)), value, along
        )
        assert np.sum(own[number] * along) == pytest.approx(wanted, **TOLERANCE), number
