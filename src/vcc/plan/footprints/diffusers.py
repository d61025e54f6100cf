"""Rewrite rules for diffusers: conditions under which scattering is a blur of the image, or of each view.

Rule 1, blur of the image. A uniform diffuser changes a ray's slope by δ with density D(δ), wherever the ray
meets it. If all optics behind it are affine, every ray lands B·δ further, with B the derivative of the place
on the sensor to the slope at the diffuser. So the image is convolved with D, stretched by B. Preconditions: the
kernel is uniform; behind the diffuser's plane nothing bends rays other than affinely, nothing absorbs (the
scattered ray would meet a rim or a mask there in another place), and all other diffusers are uniform too.
Elements in the diffuser's own plane act by position, which scattering does not change, and may absorb.

Rule 2, blur of the views. If all optics before a uniform diffuser are affine and each view meets it in one
place, scattering exchanges light only between the pixels of one view: each view's image is convolved
with D. Preconditions: the kernel is uniform; up to the diffuser's plane nothing bends rays other than affinely,
and each view meets all that absorbs there in one place.

If neither rule holds, rays are traced.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.optics.train import Stage, Train
from vcc.plan.following import check_unchanged, choice, plan_again
from vcc.plan.sharpening import along_axis, filter_half_width
from vcc.shapes.kernel_weights import axes_of
from vcc.shapes.kernels import Kernel
from vcc.shapes.stacked_patterns import clear_over

Array = NDArray[np.float64]

ROOM = 1.25
"""Factor by which a kernel may grow if it follows a camera."""


@dataclass(frozen=True, eq=False, repr=False)
class Blurs(Brief):
    """The blurs that replace the diffusers of a camera.

    Args:
        picture: kernel in pixels that the image is convolved with, odd rows × odd columns of sum 1, or None.
        views: kernel in samples that each view is convolved with, likewise, or None.
        notes: the rule applied to each diffuser, as text.
    """

    picture: Array | None
    views: Array | None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class KernelChoices:
    """Choices for a kernel on a lattice so that it follows a camera.

    Args:
        axes: that the kernel lies along (`vcc.shapes.kernel_weights.axes_of`).
        steps_beside: (rows, columns) of steps on each side of its middle, with room to grow.
        filters: weights on each side of the middle of filters that compensate the distribution, (down, across).
    """

    axes: Hashable = choice("axes that the kernel lies along")
    steps_beside: tuple[int, int] = choice("reach of the kernel", lambda one, other: _within_room(one, other))
    filters: tuple[int, ...] = choice("filters along the axes")


@dataclass(frozen=True, eq=False)
class _Scattered:
    """A diffuser as a blur: its kernel, steps from slopes (2×2), whether it blurs views, and a note as text."""

    label: str
    kernel: Kernel
    steps_from_slopes: Array
    of_views: bool
    words: str


def diffusers_as_blurs(
    train: Train, grid: Grid, sharp: bool = True, choices: tuple[KernelChoices, ...] | None = None
) -> Blurs | str:
    """The blurs by which the rules replace all diffusers of a camera, or the reason why they cannot.

    Args:
        train: with diffusers or without.
        grid: of the light field.
        sharp: whether to compensate for the tent that distributes a kernel over its lattice.
        choices: for each kernel, if parameters follow a camera.

    Raises:
        InputError: kernels for which the choices no longer hold.
    """
    found = _scattered(train, grid)
    if isinstance(found, str):
        return found
    if choices is not None and len(choices) != len(found):
        raise plan_again("which diffusers are blurs")
    total: dict[bool, Array | None] = {False: None, True: None}
    for each, own in zip(found, choices or (None,) * len(found), strict=True):
        try:
            weights = _on_lattice(each.kernel, each.steps_from_slopes, sharp, own)
        except InputError:
            if own is not None:
                raise
            return f"{each.label} scatters further than a blur can reach"
        total[each.of_views] = _convolved(total[each.of_views], weights)
    return Blurs(total[False], total[True], tuple(each.words for each in found))


def choose_kernels(train: Train, grid: Grid, sharp: bool) -> tuple[KernelChoices, ...]:
    """Choose the lattices of diffusers that are blurs, so that their kernels follow a camera."""
    found = _scattered(train, grid)
    assert not isinstance(found, str)
    return tuple(_choose_kernel(each.kernel, each.steps_from_slopes, sharp) for each in found)


def _scattered(train: Train, grid: Grid) -> list[_Scattered] | str:
    """The diffusers of a camera as blurs, or the reason why one of them is not a blur."""
    found: list[_Scattered] = []
    for n, stage in enumerate(train.stages):
        if stage.faces.spread is None:
            continue
        label = stage.element.label
        if not stage.faces.spread.uniform:
            return f"{label} scatters by a kernel that varies over its surface"
        kernel = stage.faces.spread.kernels[0]
        obstacle = behind(train, n, grid)
        if obstacle is None:
            words = f"blur of the picture: {label}, since all behind it is affine and nothing there absorbs"
            found.append(_Scattered(label, kernel, _pixels_from_slopes(train, n), False, words))
        elif meets_views_in_points(train, grid, n):
            words = f"blur of each view: {label}, since each view meets it in one place"
            found.append(_Scattered(label, kernel, _samples_from_slopes(train, grid, n), True, words))
        else:
            return f"{label} scatters, and {obstacle} behind it"
    return found


def behind(train: Train, n: int, grid: Grid) -> str | None:
    """The obstacle to rule 1 for the diffuser that is stage n, as text; None if there is none.

    A stop or a mask is no obstacle if all light of the light field passes it even after the widest scattering.
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
    deflection_bounds = np.zeros(4)
    for met in train.stages[: train.stages.index(stage)]:
        if met.faces.bending is not None:
            return False
        if met.faces.spread is not None:
            onward = stage.arriving @ met.leaving.inverse()
            deflection_bounds = deflection_bounds + np.abs(onward.linear) @ np.array(
                [0.0, 0.0, *met.faces.spread.reach]
            )
    arriving = stage.arriving @ grid.frame
    centre = arriving(middle[None])[0][:2] - stage.element.decentre
    reach = np.abs(arriving.linear[:2]) @ half + deflection_bounds[:2]
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


def _on_lattice(
    kernel: Kernel, steps_from_slopes: Array, sharp: bool, choices: KernelChoices | None = None
) -> Array:
    """A kernel's weights on its lattice; ``sharp`` compensates for the blur of distributing it to lattice points.

    Raises:
        InputError: a kernel that reaches too far, or for which the choices no longer hold.
    """
    if choices is None:
        weights = kernel.weights(steps_from_slopes, None)
    else:
        check_unchanged("axes that the kernel lies along", choices.axes, axes_of(steps_from_slopes, kernel.reach))
        needed, room = kernel.half_width_in_steps(steps_from_slopes), choices.steps_beside
        if needed[0] > room[0] or needed[1] > room[1]:
            raise plan_again(f"reach of a kernel, {max(needed)} steps where there is room for {max(room)}")
        weights = kernel.weights(steps_from_slopes, room)
    if not sharp:
        return weights
    losses = _losses(kernel, steps_from_slopes, weights)
    beside = [filter_half_width(loss, 1.0) for loss in losses] if choices is None else choices.filters
    for axis, (loss, each) in enumerate(zip(losses, beside, strict=True)):
        weights = _filtered(weights, along_axis(loss, 1.0, beside=each), 1 - axis)
    return weights


def _choose_kernel(kernel: Kernel, steps_from_slopes: Array, sharp: bool) -> KernelChoices:
    room = kernel.half_width_in_steps(ROOM * steps_from_slopes)
    losses = _losses(kernel, steps_from_slopes, kernel.weights(steps_from_slopes, room)) if sharp else []
    filters = tuple(filter_half_width(loss, 1.0) for loss in losses)
    return KernelChoices(axes_of(steps_from_slopes, kernel.reach), room, filters)


def _losses(kernel: Kernel, steps_from_slopes: Array, weights: Array) -> list[float]:
    """The blur of distributing a kernel over its lattice, along x and y, as a power of sinc.

    Along an axis, the distribution adds E|δ| − E δ² steps² to the variance of a kernel narrower than a step, and
    1/6 to the variance of a wide one, as much as sinc² does.
    """
    slopes, shares = kernel.quadrature()
    places = slopes @ steps_from_slopes.T
    wanted = shares @ places**2 - (shares @ places) ** 2
    found = []
    for axis in (0, 1):
        along = weights.sum(axis=axis)
        step = np.arange(len(along)) - len(along) // 2
        added = along @ step**2 - (along @ step) ** 2 - wanted[axis]
        found.append(min(max(12 * added, 0.0), 3.0))
    return found


def _filtered(weights: Array, along: Array, axis: int) -> Array:
    """Weights convolved along one axis with an odd number n of weights, which adds n − 1 weights there.

    Each axis is filtered separately: a wide kernel has millions of weights.
    """
    from scipy.ndimage import convolve1d

    room = [(0, 0), (0, 0)]
    room[axis] = (len(along) // 2, len(along) // 2)
    return np.asarray(convolve1d(np.pad(weights, room), along, axis=axis, mode="constant"))


def _within_room(one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether two sizes differ by less than the room that kernels have."""
    return all(b <= ROOM * a + 1 and a <= ROOM * b + 1 for a, b in zip(one, other, strict=True))


def _convolved(one: Array | None, other: Array) -> Array:
    if one is None:
        return other
    from scipy.signal import convolve

    return np.asarray(convolve(one, other))
