"""From a camera and a light field to a plan: linear optics folded, masks pulled to the samples.

This is the paper's strategy (section 4.2) taken further: with every linear element folded into one matrix,
the place of a sample on the sensor and on each mask is an affine function of its index, and the transform,
the masks and the projection become one sum.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.affine import Affine
from vcc.errors import InputError
from vcc.light_field import LightField
from vcc.plan.diffuser_rules import diffusers_as_blurs
from vcc.plan.footprint import REACH, SMALLEST_STEP
from vcc.plan.model import MaskLookup, Plan
from vcc.plan.parallax_rule import BetweenViews, choose_between_views
from vcc.plan.planes import Plane, depends_on_view_only, detail_lost, mask_lookup, tap_origin, texture_error
from vcc.sampled import to_dtype

if TYPE_CHECKING:
    from vcc.camera import Camera
    from vcc.sensor import Sensor

Array = NDArray[np.float64]

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
    interpolation: str = "linear",
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
    blurs = diffusers_as_blurs(camera, light_field)
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

    divide = _divide_views(planes, between, refine)
    fine = _divide_samples(path_planes, between, light_field.whole_views, refine)
    rows, row_shift, row_share = _tap_places(light_field.shape[0], divide)
    columns, column_shift, column_share = _tap_places(light_field.shape[1], divide)
    index = np.stack(np.broadcast_arrays(columns[None, :], rows[:, None]), axis=-1).astype(np.float64)
    shift = np.stack(np.broadcast_arrays(column_shift[None, :], row_shift[:, None]), axis=-1)

    weights = row_share[:, None] * column_share[None, :]
    for plane in view_planes:
        weights = weights * plane.view_weights(index, shift, between.motion, samples, divide)
    used_rows, used_columns = _used(weights)
    keep = np.ix_(used_rows, used_columns)
    index, shift, weights = index[keep], shift[keep], weights[keep]

    tap = tap_origin(on_sensor, origin, index, shift, between.motion)
    guard, smear = _smear(between, divide)
    _check_raster(sensor.shape, guard)
    if blurs.picture is not None:
        guard += max(blurs.picture.shape) // 2
    lookups = tuple(
        mask_lookup(plane, index, shift, between.motion, samples, divide, fine) for plane in path_planes
    )
    missing, reason = _missing_rays(view_planes, light_field.shape, samples, weights, tap, step, sensor.shape)
    volume = light_field.sample_volume / light_field.full_scale
    return Plan(
        sensor_shape=sensor.shape,
        guard=guard,
        interpolation=interpolation,
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
        notes=_notes(camera, view_planes, path_planes, against_sensor, between, divide, fine, swapped)
        + _coarse_textures(lookups)
        + blurs.notes,
        expected_ghosting=between.gap_left,
        opening=math.sqrt(sensor.fill_factor),
        blur=blurs.picture,
        view_blur=blurs.views,
    )


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
    if interpolation not in REACH:
        raise InputError(f"interpolation is one of {', '.join(map(repr, REACH))}, not {interpolation!r}")
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
    in_path: list[Plane] = []
    against_sensor: list[Plane] = []
    rays = Affine.identity()
    for stage in camera.stages:
        rays = stage.approach @ rays
        arriving = rays
        if stage.centred is not None:
            rays = stage.centred @ rays
        pattern, element = stage.faces.pattern, stage.element
        if pattern is None:
            continue
        plane = Plane.met_by(frame, arriving, pattern, element.decentre, element.label)
        place = (arriving @ frame).matrix[:2]
        same = np.allclose(place, sensor_place, rtol=1e-9, atol=1e-9 * np.abs(sensor_place).max())
        (against_sensor if same else in_path).append(plane)
    return in_path, against_sensor


def _tap_places(views: int, divide: int) -> tuple[NDArray[np.int64], Array, Array]:
    """Views read, shifts from them in views, and shares, of the taps along one axis.

    Undivided, each view is one tap. Divided, a view's light is spread over a tent that reaches its
    neighbours, in steps of 1/divide: a place between views is interpolated linearly from both.
    """
    if divide == 1:
        return np.arange(views), np.zeros(views), np.ones(views)
    shift = (np.arange(-divide, divide) + 0.5) / divide
    share = (1 - np.abs(shift)) / divide
    return np.repeat(np.arange(views), 2 * divide), np.tile(shift, views), np.tile(share, views)


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


def _divide_views(planes: list[Plane], between: BetweenViews, refine: int | str) -> int:
    """Into how many parts a view's cell is divided each way, so that fine masks keep their detail.

    Needed only where a cell's picture is spread over more than a pixel: else what a mask does inside the
    cell adds up in one place, and the mean over the cell says it all.
    """
    if refine != "auto":
        return 1
    divide = 1
    for plane in planes:
        cell = np.abs(plane.view_step(between.motion)).sum(axis=1)
        while divide < min(LARGEST_REFINEMENT, max(between.gap_filled)):
            if detail_lost(plane, np.zeros(2), cell / divide) < FINE_DETAIL_IN_VIEW:
                break
            divide *= 2
    return divide


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
    divide: int,
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
    if divide > 1:
        notes.append(f"cells of views divided {divide}×{divide}: a mask is finer than a view's cell")
    if fine > 1:
        further = (
            f"; finer ones, up to refine={LARGEST_REFINEMENT}, are made when asked for"
            if fine == LARGEST_CHOSEN_REFINEMENT
            else ""
        )
        notes.append(f"samples divided {fine}×{fine}: a mask near the sensor is finer than a sample{further}")
    return tuple(notes)
