"""Rewrite rules for diffusers: when scattering is a blur of the picture, or of each view.

Rule 1, blur of the picture. A uniform diffuser changes a ray's slope by δ with density D(δ), wherever the ray
meets it. If all optics behind it are affine, the ray lands B·δ further, for every ray alike, with B the place
on the sensor from slope at the diffuser. So the picture is convolved with D, stretched by B. Preconditions: the
kernel is uniform; behind the diffuser's plane nothing bends rays other than affinely, nothing absorbs (a rim or
a mask there would be met in another place by the scattered ray), and whatever else scatters is uniform too.
What stands in the diffuser's own plane acts by position, which scattering leaves alone, and may absorb.

Rule 2, blur of the views. If all optics before a uniform diffuser are affine and each view meets it in one
place, then scattering exchanges light between the pixels of one view only: each view's picture is convolved
with D. Preconditions: the kernel is uniform; up to the diffuser's plane nothing bends rays other than affinely,
and what absorbs there tells views apart only.

Where neither holds, rays are traced.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.optics.train import Stage, Train
from vcc.plan.decisions import ANEW, Decisions, plan_again
from vcc.plan.sharpening import along_axis, weights_beside
from vcc.shapes.kernel_weights import axes_of
from vcc.shapes.kernels import Kernel
from vcc.shapes.sheets import clear_over

Array = NDArray[np.float64]

ROOM = 1.25
"""By how much a kernel may grow within decisions that are kept."""


@dataclass(frozen=True, eq=False, repr=False)
class Blurs(Brief):
    """What the diffusers of a camera come to.

    Args:
        picture: kernel in pixels that the picture is convolved with, odd rows × odd columns of sum 1, or None.
        views: kernel in samples that each view is convolved with, likewise, or None.
        notes: which rule was applied to what, in words.
    """

    picture: Array | None
    views: Array | None
    notes: tuple[str, ...] = ()


def diffusers_as_blurs(train: Train, grid: Grid, sharp: bool = True, decisions: Decisions = ANEW) -> Blurs | str:
    """The blurs by which the rules replace all diffusers of a camera, or why they do not.

    Args:
        train: with diffusers or without.
        grid: that it looks at.
        sharp: whether the tent by which a kernel is shared out on its lattice is given back.
        decisions: by which kernels have their sizes.
    """
    picture: Array | None = None
    views: Array | None = None
    notes: list[str] = []
    for n, stage in enumerate(train.stages):
        if stage.faces.spread is None:
            continue
        label = stage.element.label
        if not stage.faces.spread.uniform:
            return f"{label} scatters by a kernel that varies over its surface"
        kernel = stage.faces.spread.kernels[0]
        obstacle = behind(train, n, grid)
        its = decisions.of(f"diffuser {len(notes) + 1}")
        try:
            if obstacle is None:
                picture = _convolved(picture, _on_lattice(kernel, _pixels_from_slopes(train, n), sharp, its))
                notes.append(
                    f"blur of the picture: {label}, since all behind it is affine and nothing there absorbs"
                )
            elif meets_views_in_points(train, grid, n):
                views = _convolved(views, _on_lattice(kernel, _samples_from_slopes(train, grid, n), sharp, its))
                notes.append(f"blur of each view: {label}, since each view meets it in one place")
            else:
                return f"{label} scatters, and {obstacle} behind it"
        except InputError:
            if decisions.lasting:
                raise
            return f"{label} scatters further than a blur can reach"
    return Blurs(picture, views, tuple(notes))


def behind(train: Train, n: int, grid: Grid) -> str | None:
    """What forbids rule 1 for the diffuser that is stage n, in words; None if nothing does.

    A stop or a mask that lets all light of the light field pass, scattered as far as it may be, forbids nothing.
    """
    same_plane = True
    for stage in train.stages[n + 1 :]:
        same_plane = same_plane and np.array_equal(stage.approach.matrix, np.eye(5))
        label = stage.element.label
        if same_plane and stage.faces.bending is None:
            continue
        if stage.faces.bending is not None:
            return f"{label} bends rays by a function of position that is not affine"
        if stage.faces.pattern is not None and not _passes_all(train, stage, grid):
            return f"{label} absorbs"
        if stage.faces.spread is not None and not stage.faces.spread.uniform:
            return f"{label} scatters by a kernel that varies over its surface"
    return None


def _passes_all(train: Train, stage: Stage, grid: Grid) -> bool:
    """Whether a stage behind affine optics and uniform diffusers absorbs none of the light field's rays."""
    assert stage.faces.pattern is not None
    nv, nu, nt, ns = grid.shape[:4]
    middle = (np.array([nu, nv, ns, nt]) - 1) / 2
    half = middle + np.array([1.0, 1.0, 2.0, 2.0])  # places between views and footprints reach beyond the samples
    slack = np.zeros(4)
    for met in train.stages[: train.stages.index(stage)]:
        if met.faces.bending is not None:
            return False
        if met.faces.spread is not None:
            onward = stage.arriving @ met.leaving.inverse()
            slack = slack + np.abs(onward.linear) @ np.array([0.0, 0.0, *met.faces.spread.reach])
    arriving = stage.arriving @ grid.frame
    centre = arriving(middle[None])[0][:2] - stage.element.decentre
    reach = np.abs(arriving.linear[:2]) @ half + slack[:2]
    return bool(clear_over(stage.faces.pattern, centre - reach, centre + reach))


def meets_views_in_points(train: Train, grid: Grid, n: int) -> bool:
    """Whether each view meets stage n, and all that absorbs before it, in one place (rule 2)."""
    size = np.array([grid.shape[3], grid.shape[2]])
    for m, stage in enumerate(train.stages[: n + 1]):
        if stage.faces.bending is not None:
            return False
        if m == n or stage.faces.pattern is not None:
            place = (stage.arriving @ grid.frame).linear[:2]
            travel = np.abs(place[:, 2:]) @ size
            if (travel > 1e-6 * np.abs(place[:, :2]).sum(axis=1)).any():
                return False
    return True


def _pixels_from_slopes(train: Train, n: int) -> Array:
    """2×2: pixels on the sensor by which a ray moves for a change of slope at stage n."""
    onward = train.arriving_at_sensor @ train.stages[n].leaving.inverse()
    return np.asarray(train.sensor.frame.inverse().linear @ onward.linear[:2, 2:])


def _samples_from_slopes(train: Train, grid: Grid, n: int) -> Array:
    """2×2: samples of a view by which a ray moves for a change of slope at stage n."""
    return np.asarray((train.stages[n].arriving @ grid.frame).inverse().linear[2:, 2:])


def _on_lattice(kernel: Kernel, steps_from_slopes: Array, sharp: bool, decisions: Decisions) -> Array:
    """A kernel's weights; ``sharp``, without what they spread by sharing out what falls between lattice points.

    Along an axis that adds E|δ| − E δ² steps² to the variance of a kernel narrower than a step, and 1/6 to that of
    a wide one, as much as sinc² takes.
    """
    weights = kernel.weights(steps_from_slopes, _beside(kernel, steps_from_slopes, decisions))
    if not sharp:
        return weights
    slopes, shares = kernel.quadrature()
    places = slopes @ steps_from_slopes.T
    wanted = shares @ places**2 - (shares @ places) ** 2
    made = weights
    for axis in (0, 1):
        along = weights.sum(axis=axis)
        step = np.arange(len(along)) - len(along) // 2
        added = along @ step**2 - (along @ step) ** 2 - wanted[axis]
        losses = min(max(12 * added, 0.0), 3.0)
        beside = decisions.keep(f"filter along axis {axis}", partial(weights_beside, losses, 1.0))
        made = _filtered(made, along_axis(losses, 1.0, beside=beside), 1 - axis)
    return made


def _filtered(weights: Array, along: Array, axis: int) -> Array:
    """Weights convolved along one axis with an odd number of weights, and as many but one more of them there.

    One axis after the other: a wide kernel has millions of weights.
    """
    from scipy.ndimage import convolve1d

    room = [(0, 0), (0, 0)]
    room[axis] = (len(along) // 2, len(along) // 2)
    return np.asarray(convolve1d(np.pad(weights, room), along, axis=axis, mode="constant"))


def _beside(kernel: Kernel, steps_from_slopes: Array, decisions: Decisions) -> tuple[int, int] | None:
    """Room for a kernel that may grow; None where nothing has to follow it."""
    if not decisions.lasting:
        return None
    decisions.hold("axes that the kernel lies along", axes_of(steps_from_slopes, kernel.reach))
    needed = kernel.steps_beside(steps_from_slopes)
    rows, columns = decisions.keep(
        "reach of the kernel", lambda: kernel.steps_beside(ROOM * steps_from_slopes), _within_room
    )
    if needed[0] > rows or needed[1] > columns:
        raise plan_again(f"reach of a kernel, {max(needed)} steps where there is room for {max(rows, columns)}")
    return rows, columns


def _within_room(one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether two sizes differ by less than the room that kernels have."""
    return all(b <= ROOM * a + 1 and a <= ROOM * b + 1 for a, b in zip(one, other, strict=True))


def _convolved(one: Array | None, other: Array) -> Array:
    if one is None:
        return other
    from scipy.signal import convolve

    return np.asarray(convolve(one, other))
