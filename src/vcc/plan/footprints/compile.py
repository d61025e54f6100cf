"""From a camera and a light field to a plan: linear optics folded, masks pulled to the samples.

This is the paper's strategy (section 4.2) taken further: with every linear element folded into one matrix,
the place of a sample on the sensor and on each mask is an affine function of its index, and the transform,
the masks and the projection become one sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.fields.sampled import to_dtype
from vcc.light_field import LightField
from vcc.plan.footprints.diffusers import diffusers_as_blurs
from vcc.plan.footprints.model import MaskLookup, Plan
from vcc.plan.footprints.planes import (
    Plane,
    depends_on_view_only,
    detail_lost,
    mask_lookup,
    open_parts,
    tap_origin,
    texture_error,
)
from vcc.plan.footprints.shares import SMALLEST_STEP
from vcc.plan.parallax_rule import BetweenViews, choose_between_views
from vcc.plan.sharpening import MEAN, TENT, across_plane, along_axis
from vcc.shapes.patterns import Open

if TYPE_CHECKING:
    from vcc.camera import Camera
    from vcc.optics.sensor import Sensor
    from vcc.optics.train import Stage

Array = NDArray[np.float64]

INTERPOLATIONS = ("sharp", "nearest", "linear", "cubic")
"""Ways to interpolate within a view; ``"sharp"`` is linear with what that costs given back."""
PARTS_OF_A_PIXEL = 4
"""Parts each way by which a mask against the sensor is looked at within pixels."""
FINER_PIXELS = 1.25
"""Pixels from sample to sample from which on they see how samples are interpolated between."""
LARGEST_SHEARED_FILTER = 6
"""Weights on each side of the middle of a filter for a sheared pixel grid."""
CORRELATED = 0.02
"""Share of two masks' variances that may vanish together inside the cell of a view before cells are divided."""
FINE_DETAIL_IN_VIEW = 0.15
"""Share of a mask's variance that may vanish inside the cell of a view before cells are divided."""
FINE_DETAIL_IN_SAMPLE = 0.01
"""Share of a mask's variance that may vanish inside a sample before samples are divided."""
LARGEST_REFINEMENT = 8
LARGEST_RASTER = 2**28
"""Pixels of the sensor and its margin: 1 GiB for each colour channel."""
COARSE_TEXTURE = 5e-3
"""Error of a mask's texture between its points, as a share of its largest value, from which on a plan says it."""
LARGEST_CHOSEN_REFINEMENT = 4
"""Beyond this a plan divides samples only when told to: the cost grows with the square."""


def compile_plan(
    camera: Camera,
    light_field: LightField,
    *,
    interpolation: str = "sharp",
    between_views: str = "auto",
    scene_distance: float | None = None,
    refine: int | str = "auto",
) -> Plan:
    """The plan by which an engine makes the picture that ``camera`` records of ``light_field``.

    Args: see `vcc.Camera.capture`.

    Raises:
        InputError: an option that does not exist, or a frame that the sensor cannot be reached by.
    """
    _check_options(interpolation, between_views, refine)
    sharp = interpolation == "sharp"
    blurs = diffusers_as_blurs(camera, light_field, sharp)
    if isinstance(blurs, str):
        raise InputError(f"this camera's picture cannot be made by footprints: {blurs}")
    if blurs.views is not None:
        light_field = _grown(light_field, blurs.views)
    sensor = camera.sensor
    at_sensor = camera.rays_at(sensor.z)
    frame, samples, swapped = _without_transposition(light_field, at_sensor)
    pixels_from_metres = sensor.frame.inverse()
    metres = (at_sensor @ frame).matrix[:2]
    on_sensor = pixels_from_metres.linear @ metres[:, :4]
    origin = pixels_from_metres(metres[:, 4])
    step = _cleaned(on_sensor[:, 2:], samples)

    between = choose_between_views(light_field, frame, on_sensor, between_views, scene_distance)
    planes, against_sensor = _absorbing_planes(camera, frame, metres)
    view_planes = [p for p in planes if depends_on_view_only(p, samples, between.motion)]
    path_planes = [p for p in planes if p not in view_planes]

    division = _divide_views(planes, path_planes, between, refine)
    divide = division.parts
    fine = _divide_samples(path_planes, between, light_field.whole_views, refine)
    rows, row_shift, row_share = _tap_places(light_field.shape[0], division)
    columns, column_shift, column_share = _tap_places(light_field.shape[1], division)
    index = np.stack(np.broadcast_arrays(columns[None, :], rows[:, None]), axis=-1).astype(np.float64)
    shift = np.stack(np.broadcast_arrays(column_shift[None, :], row_shift[:, None]), axis=-1)

    parts = open_parts(view_planes, index, shift, between.motion, samples, divide)
    weights = row_share[:, None] * column_share[None, :] * parts.weights
    used_rows, used_columns = _used(weights)
    keep = np.ix_(used_rows, used_columns)
    index, shift, weights, off_middle = index[keep], shift[keep], weights[keep], parts.middle[keep]

    tap = tap_origin(on_sensor, origin, index, shift, between.motion)
    guard, smear = _smear(between, divide)
    _check_raster(sensor.shape, guard)
    if blurs.picture is not None:
        guard += max(blurs.picture.shape) // 2
    points = light_field.sample == "point" and fine == 1
    lookups = tuple(
        mask_lookup(plane, index, shift + off_middle, between.motion, samples, divide, fine, not points)
        for plane in path_planes
    )
    missing, reason = _missing_rays(view_planes, light_field.shape, samples, weights, tap, step, sensor.shape)
    volume = light_field.sample_volume / light_field.full_scale
    plan = Plan(
        sensor_shape=sensor.shape,
        guard=guard,
        interpolation=_sharp_footprint(step, fine) if sharp else interpolation,
        scale=volume / (sensor.pitches[0] * sensor.pitches[1]),
        view_rows=rows[used_rows],
        view_columns=columns[used_columns],
        weights=weights,
        x=tap[..., 0] + guard,
        y=tap[..., 1] + guard,
        step=step,
        masks=lookups,
        sensor_transmission=_sensor_transmission(sensor, against_sensor),
        refine=fine,
        smear=smear,
        swap_pixel_axes=swapped,
        samples=samples,
        missing_rays=missing,
        missing_reason=reason,
        notes=_notes(camera, view_planes, path_planes, against_sensor, between, division, fine, swapped)
        + _coarse_textures(lookups)
        + blurs.notes,
        expected_ghosting=between.gap_left,
        opening=math.sqrt(sensor.fill_factor),
        blur=blurs.picture,
        view_blur=blurs.views,
    )
    if not sharp:
        return plan
    detail = _sensor_detail(sensor, against_sensor)
    plan = _sharpened(plan, light_field.sample)
    return plan if detail is None else _guarded(replace(plan, sensor_detail=detail), 1)


def _sharpened(plan: Plan, sample: str) -> Plan:
    """The plan with the filters that give back what linear interpolation takes (`vcc.plan.sharpening`).

    Where samples are divided because a mask is finer than they are, they are filtered as they are divided, before
    the mask; the picture then lacks only what its finer samples lost, each a mean over its own cell.
    """
    losses = TENT + (MEAN if sample == "mean" else 0)
    within = along_axis(losses, 1.0) if plan.refine > 1 else None
    if plan.refine > 1:
        losses = TENT + MEAN
    step = plan.step / plan.refine
    (xk, xl), (yk, yl) = step
    if not (xl or yk):
        spline = plan.interpolation == "spline"
        filters = along_axis(losses, yl, spline), along_axis(losses, xk, spline)
        reach = max(len(weights) for weights in filters) // 2
        return _guarded(replace(plan, sharpen=filters, sharpen_samples=within), reach)
    # Light is spread along the samples' columns on the sensor, and across at fixed rows of pixels; a pixel's mean
    # is taken along the columns, too.
    shear = xl / yl
    spread = [(float(TENT), np.array([xk - shear * yk, 0.0])), (float(TENT), np.array([xl, yl]))]
    spread += [(1.0, plan.opening * np.array([shear, 1.0])), (-1.0, plan.opening * np.array([0.0, 1.0]))]
    if losses > TENT:
        spread += [(float(MEAN), step[:, 0]), (float(MEAN), step[:, 1])]
    half = min(2 + math.ceil(2 * max(0.0, float(np.abs(step).max()) - 1)), LARGEST_SHEARED_FILTER)
    kernel = across_plane(spread, half)
    if plan.blur is not None:
        from scipy.signal import convolve

        kernel = np.asarray(convolve(plan.blur, kernel))
    return _guarded(replace(plan, blur=kernel, sharpen_samples=within), half)


def _sharp_footprint(step: Array, fine: int) -> str:
    """The footprint that is sharpened: a tent, which is quick; a spline where pixels would see a tent's bends."""
    parted = not (step[0, 1] or step[1, 0])
    return "spline" if fine == 1 and parted and max(abs(step[0, 0]), abs(step[1, 1])) > FINER_PIXELS else "linear"


def _guarded(plan: Plan, pixels: int) -> Plan:
    """The plan with so many more pixels around the picture, for filters that look beyond its border."""
    return replace(plan, guard=plan.guard + pixels, x=plan.x + pixels, y=plan.y + pixels)


def why_not_footprints(camera: Camera, light_field: LightField) -> str | None:
    """Why the picture cannot be made by footprints, in words that name the element; None where it can."""
    for stage in camera.stages:
        if stage.faces.bending is not None:
            return f"{stage.element.label} bends rays by a function of position that is not affine"
    blurs = diffusers_as_blurs(camera, light_field)
    if isinstance(blurs, str):
        return blurs
    if blurs.picture is not None:
        rows, columns = (n + m for n, m in zip(camera.sensor.shape, blurs.picture.shape, strict=True))
        if rows * columns > LARGEST_RASTER:
            return f"a diffuser scatters over {max(blurs.picture.shape)} pixels, more than a blur can hold"
    return None


def _grown(light_field: LightField, kernel: Array) -> LightField:
    """A light field of the size that blurring its views makes it, without samples."""
    high, wide = (n // 2 for n in kernel.shape)
    nv, nu, nt, ns = light_field.shape[:4]
    shape = (nv, nu, nt + 2 * high, ns + 2 * wide, *light_field.shape[4:])
    return replace(
        light_field,
        values=np.broadcast_to(np.zeros((), dtype=to_dtype(light_field.values)), shape),
        frame=light_field.frame @ Affine.translation(0, 0, -wide, -high),
    )


def _check_options(interpolation: str, between_views: str, refine: int | str) -> None:
    if interpolation not in INTERPOLATIONS:
        raise InputError(f"interpolation is one of {', '.join(map(repr, INTERPOLATIONS))}, not {interpolation!r}")
    if between_views not in ("auto", "none"):
        raise InputError(f"between_views is 'auto' or 'none', not {between_views!r}")
    if refine != "auto" and not (isinstance(refine, int) and 1 <= refine <= LARGEST_REFINEMENT):
        raise InputError(f"refine is 'auto' or a whole number from 1 to {LARGEST_REFINEMENT}, not {refine!r}")


def _without_transposition(light_field: LightField, at_sensor: Affine) -> tuple[Affine, tuple[int, int], bool]:
    """The frame with its pixel axes in the order in which rows of samples land on rows of the sensor."""
    frame, (nt, ns) = light_field.frame, light_field.shape[2:4]
    down = (at_sensor @ frame).linear[1]
    if abs(down[3]) >= abs(down[2]):
        return frame, (nt, ns), False
    exchange = Affine(np.eye(5)[[0, 1, 3, 2, 4]])
    return frame @ exchange, (ns, nt), True


def _cleaned(step: Array, samples: tuple[int, int]) -> Array:
    """Steps without cross terms that are rounding errors, and without zeros on the way to the pixels."""
    step = step.copy()
    for row, column in ((0, 1), (1, 0)):
        if abs(step[row, column]) * max(samples) < 1e-6:
            step[row, column] = 0.0
    for axis in (0, 1):
        if abs(step[axis, axis]) < SMALLEST_STEP:
            step[axis, axis] = np.copysign(SMALLEST_STEP, step[axis, axis])
    return step


def _absorbing_planes(camera: Camera, frame: Affine, sensor_place: Array) -> tuple[list[Plane], list[Plane]]:
    """What absorbs in mid-path, and what lies against the sensor (rewrite rule below).

    Rule: a mask whose every ray meets it where it meets the sensor multiplies the picture. Precondition:
    the place on the mask is the place on the sensor, shifted at most, for every sample.
    """
    groups: list[tuple[Array, list[Stage]]] = []
    rays = Affine.identity()
    for stage in camera.stages:
        rays = stage.approach @ rays
        place = (rays @ frame).matrix[:2]
        if stage.centred is not None:
            rays = stage.centred @ rays
        if stage.faces.pattern is None or isinstance(stage.faces.pattern, Open):
            continue
        if groups and _same_place(place, groups[-1][0]):
            groups[-1][1].append(stage)
        else:
            groups.append((place, [stage]))
    in_path: list[Plane] = []
    against_sensor: list[Plane] = []
    for place, stages in groups:
        # What stands in one plane is multiplied there, before anything is averaged.
        patterns = [(stage.faces.pattern, stage.element.decentre) for stage in stages]
        label = " and ".join(dict.fromkeys(stage.element.label for stage in stages))
        plane = Plane.at(place, [(pattern, middle) for pattern, middle in patterns if pattern is not None], label)
        (against_sensor if _same_place(place, sensor_place) else in_path).append(plane)
    return in_path, against_sensor


def _same_place(one: Array, other: Array) -> bool:
    return np.allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


@dataclass(frozen=True)
class _CellDivision:
    """How the cells of views are divided.

    Args:
        parts: of each, along each axis.
        spread: whether a view's light reaches its neighbours, as a tent, for a place between views is interpolated
            from both; else it stays in its own cell.
        left: the correlation that masks in different planes still have inside a part (see `CORRELATED`).
    """

    parts: int
    spread: bool
    left: float = 0.0


def _tap_places(views: int, division: _CellDivision) -> tuple[NDArray[np.int64], Array, Array]:
    """Views read, shifts from them in views, and shares, of the taps along one axis.

    Undivided, each view is one tap. Divided, it is one in each part of its cell; or its light is spread over a
    tent that reaches its neighbours, so that a place between views is interpolated linearly from both.
    """
    divide = division.parts
    if division.spread:
        shift = (np.arange(-divide, divide) + 0.5) / divide
        share = (1 - np.abs(shift)) / divide
    else:
        shift = (np.arange(divide) + 0.5) / divide - 0.5
        share = np.full(divide, 1 / divide)
    return np.repeat(np.arange(views), len(shift)), np.tile(shift, views), np.tile(share, views)


def _used(weights: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    rows, columns = np.flatnonzero(weights.any(axis=1)), np.flatnonzero(weights.any(axis=0))
    first = np.zeros(1, dtype=np.int64)
    return (rows if rows.size else first), (columns if columns.size else first)


def _smear(between: BetweenViews, divide: int) -> tuple[int, tuple[float, float]]:
    """The tent that fills gaps between taps' pictures, and the margin from which it brings in light."""
    vertical, horizontal = (gap / divide for gap in between.gap_filled)
    smear = (vertical if vertical > 1 else 0.0, horizontal if horizontal > 1 else 0.0)
    return (math.ceil(max(smear)) + 1 if any(smear) else 0), smear


def _check_raster(sensor_shape: tuple[int, int], guard: int) -> None:
    rows, columns = (n + 2 * guard for n in sensor_shape)
    if rows * columns > LARGEST_RASTER:
        raise InputError(
            f"neighbouring views' pictures lie {guard} pixels apart on the sensor: closing the gaps takes a "
            f"margin of as many pixels, {rows}×{columns} in all. Give the sensor larger pixels, move it closer "
            "to focus, or pass between_views='none'"
        )


def _divide_views(
    planes: list[Plane], path_planes: list[Plane], between: BetweenViews, refine: int | str
) -> _CellDivision:
    """How a view's cell is divided so that fine masks keep their detail.

    Where a cell's picture is spread over more than a pixel, what a mask does inside the cell must fall where it
    belongs. Elsewhere it adds up in one place, and the mean over the cell says it all for one mask; but the mean
    of two masks' product is not the product of their means where both are finer than the cell.
    """
    if refine != "auto":
        return _CellDivision(1, False)
    divide = 1
    for plane in planes:
        cell = np.abs(plane.view_step(between.motion)).sum(axis=1)
        while divide < min(LARGEST_REFINEMENT, max(between.gap_filled)):
            if detail_lost(plane, np.zeros(2), cell / divide) < FINE_DETAIL_IN_VIEW:
                break
            divide *= 2
    if divide > 1:
        return _CellDivision(divide, True)

    if len(path_planes) < 2:
        return _CellDivision(1, False)

    def correlated(parts: int) -> float:
        lost = sorted(
            detail_lost(plane, np.zeros(2), np.abs(plane.view_step(between.motion)).sum(axis=1) / parts)
            for plane in path_planes
        )
        return math.sqrt(lost[-1] * lost[-2])

    left = correlated(1)
    while left > CORRELATED and divide < LARGEST_CHOSEN_REFINEMENT:
        divide *= 2
        left = correlated(divide)
    return _CellDivision(divide, False, left)


def _divide_samples(
    planes: list[Plane], between: BetweenViews, views: tuple[float, float], refine: int | str
) -> int:
    """Into how many parts a sample is divided each way, so that a mask near the sensor stays sharp.

    A sample's light lands on the pixels as one footprint, mask and all: detail of the mask that the
    aperture's penumbra leaves and the footprint would blur needs finer samples.
    """
    if isinstance(refine, int):
        return refine
    fine = 1
    for plane in planes:
        penumbra = np.abs(plane.view_step(between.motion)) @ np.array([views[1], views[0]])
        sample = 2 * np.abs(plane.sample_step).sum(axis=1)
        while fine < LARGEST_CHOSEN_REFINEMENT:
            if detail_lost(plane, penumbra, sample / fine) < FINE_DETAIL_IN_SAMPLE:
                break
            fine *= 2
    return fine


def _sensor_transmission(sensor: Sensor, planes: list[Plane]) -> Array | None:
    """The mean transmission over each pixel of what lies against the sensor."""
    if not planes:
        return None
    vertical, horizontal = sensor.sensitive_pitches
    total = np.ones(sensor.shape)
    for plane in planes:
        x = sensor.column_places - plane.decentre[0]
        y = sensor.row_places - plane.decentre[1]
        total = total * plane.pattern.mean(x[None, :], y[:, None], horizontal, vertical)
    return total


def _sensor_detail(sensor: Sensor, planes: list[Plane]) -> Array | None:
    """What the variation of a mask against the sensor within pixels does; see `Plan.sensor_detail`.

    The mean of a product is not the product of the means. With the light in a pixel as its mean P, slope and
    curvature, told from its neighbours, and T̄, Tₓ, Tₓₓ, Tₓᵧ the mask's moments over the sensitive area of width a,
    in pixels, the mean of mask times light is

        T̄·P + Σₓ [Tₓ·(P₊ − P₋)/2 + (Tₓₓ/2 − T̄·a²/24)·(P₊ − 2P + P₋)] + Tₓᵧ·∂²P/∂x∂y.

    None where masks are even within pixels.
    """
    if not planes:
        return None
    opening, parts = math.sqrt(sensor.fill_factor), PARTS_OF_A_PIXEL
    place = ((np.arange(parts) + 0.5) / parts - 0.5) * opening
    vertical, horizontal = sensor.pitches
    rows, columns = sensor.shape
    x = (sensor.column_places[:, None] + place * horizontal).reshape(1, -1)
    y = (sensor.row_places[:, None] + place * vertical).reshape(-1, 1)
    means = np.ones((y.size, x.size))
    for plane in planes:
        part = opening * horizontal / parts, opening * vertical / parts
        means = means * plane.pattern.mean(x - plane.decentre[0], y - plane.decentre[1], *part)
    blocks = means.reshape(rows, parts, columns, parts) / parts**2

    def moment(power_y: Array, power_x: Array) -> Array:
        return np.asarray(np.einsum("rpcq,p,q->rc", blocks, power_y, power_x))

    one, square = np.ones(parts), place**2 + (opening / parts) ** 2 / 12
    mean = moment(one, one)
    slopes = moment(place, one), moment(one, place)
    curvatures = [moment(*powers) / 2 - mean * opening**2 / 24 for powers in ((square, one), (one, square))]
    twist = moment(place, place)
    detail = np.zeros((3, 3, rows, columns))
    for slope, curvature, before, after in (
        (slopes[0], curvatures[0], (0, 1), (2, 1)),
        (slopes[1], curvatures[1], (1, 0), (1, 2)),
    ):
        detail[before] += curvature - slope / 2
        detail[after] += curvature + slope / 2
        detail[1, 1] -= 2 * curvature
    detail[0, 0] += twist / 4
    detail[2, 2] += twist / 4
    detail[0, 2] -= twist / 4
    detail[2, 0] -= twist / 4
    return detail if np.abs(detail).max() > 1e-6 else None


def _missing_rays(
    view_planes: list[Plane],
    shape: tuple[int, ...],
    samples: tuple[int, int],
    weights: Array,
    tap: Array,
    step: Array,
    sensor_shape: tuple[int, int],
) -> tuple[float, str]:
    """The share of rays that the open aperture sends to the sensor and the light field does not hold."""
    outside_views = _aperture_outside_views(view_planes, shape)
    outside_pictures = _sensor_outside_views(samples, weights, tap, step, sensor_shape)
    missing = 1 - (1 - outside_views) * (1 - outside_pictures)
    reasons = []
    if outside_views > 1e-3:
        reasons.append(f"{outside_views:.1%} of the aperture lies outside the grid of views")
    if outside_pictures > 1e-3:
        reasons.append(f"{outside_pictures:.1%} of what the sensor sees lies outside the views' pictures")
    return (missing if missing > 1e-9 else 0.0), "; ".join(reasons)


def _aperture_outside_views(planes: list[Plane], shape: tuple[int, ...]) -> float:
    bounded = [plane for plane in planes if np.isfinite(plane.pattern.size).all()]
    if not bounded:
        return 0.0
    plane = min(bounded, key=lambda p: p.pattern.size[0] * p.pattern.size[1])
    points = (np.arange(128) + 0.5) / 128 - 0.5
    x, y = np.meshgrid(points * plane.pattern.size[0], points * plane.pattern.size[1])
    to_view = np.linalg.inv(plane.at_index[:, :2])
    samples = (shape[2], shape[3])
    view = (np.stack([x, y], axis=-1) - plane.middle_of_view(samples)) @ to_view.T
    open_here = np.ones_like(x)
    for other in planes:
        here = view @ other.at_index[:, :2].T + other.middle_of_view(samples)
        open_here = open_here * other.pattern(here[..., 0], here[..., 1])
    # Half a raster step of grace: an aperture as wide as the grid misses nothing.
    views = np.array([shape[1], shape[0]])
    inside = (np.abs(view - (views - 1) / 2) <= views / 2).all(axis=-1)
    total = open_here.sum()
    return float(1 - (open_here * inside).sum() / total) if total > 0 else 0.0


def _sensor_outside_views(
    samples: tuple[int, int], weights: Array, tap: Array, step: Array, sensor_shape: tuple[int, int]
) -> float:
    """The share of pixels and open views that meet outside the views' pictures, on a grid of sensor points."""
    total = weights.sum()
    if total <= 0:
        return 1.0
    if abs(np.linalg.det(step)) < 1e-9:
        return 0.0  # every view falls into a point: no pixel asks for a particular sample
    if not (step[0, 1] or step[1, 0] or np.ptp(tap[..., 0], axis=0).any() or np.ptp(tap[..., 1], axis=1).any()):
        across = _covered_share(tap[0, :, 0], step[0, 0], samples[1], sensor_shape[1])
        down = _covered_share(tap[:, 0, 1], step[1, 1], samples[0], sensor_shape[0])
        return float(1 - down @ weights @ across / total)
    rows = (np.arange(24) + 0.5) / 24 * sensor_shape[0] - 0.5
    columns = (np.arange(24) + 0.5) / 24 * sensor_shape[1] - 0.5
    points = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    used = weights > 0
    index = (points[None] - tap[used][:, None]) @ np.linalg.inv(step).T
    size = np.array([samples[1], samples[0]])
    inside = ((index >= -0.5) & (index <= size - 0.5)).all(axis=-1)
    return float(1 - (weights[used][:, None] * inside).sum() / (total * len(points)))


def _covered_share(first: Array, step: float, samples: int, pixels: int) -> Array:
    """The share of the sensor's extent that each view's picture covers, along one axis."""
    ends = np.stack([first - step / 2, first + step * (samples - 0.5)])
    low, high = ends.min(axis=0), ends.max(axis=0)
    covered = np.minimum(high, pixels - 0.5) - np.maximum(low, -0.5)
    return np.asarray(np.clip(covered, 0, None) / pixels)


def _coarse_textures(lookups: tuple[MaskLookup, ...]) -> tuple[str, ...]:
    found = [(lookup, texture_error(lookup.texture)) for lookup in lookups]
    return tuple(
        f"{lookup.label} is finer than its texture of {'×'.join(map(str, lookup.texture.shape))} points shows: "
        f"{error:.1%} root mean square of its largest value"
        for lookup, error in found
        if error > COARSE_TEXTURE
    )


def _notes(
    camera: Camera,
    view_planes: list[Plane],
    path_planes: list[Plane],
    against_sensor: list[Plane],
    between: BetweenViews,
    division: _CellDivision,
    fine: int,
    swapped: bool,
) -> tuple[str, ...]:
    linear = [
        element.label
        for element in camera.elements
        if any(isinstance(part, Affine) or part.affine is not None for part in element.parts())
    ]
    notes = [
        f"folded into one matrix: {', '.join(linear) or 'no linear element'}, and the flight to the sensor at "
        f"z = {camera.sensor.z * 1e3:g} mm"
    ]
    if view_planes:
        notes.append(
            f"one weight a view, the open share of its cell: {', '.join(plane.label for plane in view_planes)}"
        )
    if path_planes:
        notes.append(
            f"one weight a sample, its mean over the sample's footprint, pulled from mid-path: "
            f"{', '.join(plane.label for plane in path_planes)}"
        )
    if against_sensor:
        notes.append(f"multiplied into the picture: {', '.join(plane.label for plane in against_sensor)}")
    if swapped:
        notes.append("pixel rows and columns of the views change places: the frame turns them")
    notes.append(between.reason)
    parts = division.parts
    if parts > 1:
        finer = "a mask is" if division.spread else "several masks are"
        notes.append(f"cells of views divided {parts}×{parts}: {finer} finer than a view's cell")
    if division.left > CORRELATED:
        notes.append(
            f"masks in different planes still vary together inside these cells, by up to {division.left:.0%} of "
            "their contrast, and are taken as independent there: more views would tell them apart"
        )
    if fine > 1:
        further = (
            f"; finer ones, up to refine={LARGEST_REFINEMENT}, are made when asked for"
            if fine == LARGEST_CHOSEN_REFINEMENT
            else ""
        )
        notes.append(f"samples divided {fine}×{fine}: a mask near the sensor is finer than a sample{further}")
    return tuple(notes)
