"""The paper's operators on a light field: they return light fields instead of images.

𝕋 (`LightField.transformed`) is exact and lazy. The other operators compute new samples: `resampled` changes the
grid, `masked` is the dot product (·), `scattered` the convolution (⊗), `projected` the sensor (S). A camera's
image needs none of them. They process 4-D data, so the size is computed first, and a size above the memory
limit raises an error.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.memory import check_samples
from vcc.fields.disparity import Disparities
from vcc.fields.grid import ALL
from vcc.fields.sampled import LIGHT_FIELD_AXES, to_numpy
from vcc.fields.samples import InMemory, maps_of
from vcc.optics.bands import refuse
from vcc.optics.faces import Element
from vcc.optics.mask import Mask
from vcc.optics.scatter import Scatter
from vcc.optics.terms import RayTransmission
from vcc.optics.train import Stage, Train
from vcc.plan.footprints.aperture import Aperture
from vcc.plan.footprints.mask_textures import MaskMet
from vcc.plan.footprints.planes import Plane, depends_on_view_only
from vcc.plan.footprints.taps import CellDivision, Taps
from vcc.shapes.patterns import Pattern

Field = TypeVar("Field", bound=InMemory)
"""A light field in memory; results have the same type."""

SPLINE_ORDER = {"nearest": 0, "linear": 1, "cubic": 3}


def masked_at(
    light_field: Field,
    planes: list[tuple[Pattern | RayTransmission, tuple[float, float], Affine]],
    memory_limit: int | None = None,
) -> Field:
    """The light field times the transmission of patterns at several planes; its plane and frame stay the same.

    Args:
        light_field: at some plane.
        planes: for each pattern: the pattern, the position (x, y) of its centre in metres, and the map of rays
            from the light field's plane to the pattern's. A function of rays is evaluated in the middle of each
            sample.
        memory_limit: bytes; None takes `vcc.base.memory.MEMORY_LIMIT`.

    Raises:
        InputError: more memory needed than allowed.
    """
    if not planes:
        return light_field
    check_samples(light_field.shape, memory_limit, "the masked light field")
    values = to_numpy(light_field.values)
    result = np.empty(values.shape, dtype=np.float32)
    weights = [_weights(light_field, *plane) for plane in planes]
    for j, i in np.ndindex(values.shape[:2]):
        weight: Any = 1.0 / light_field.grid.full_scale
        for of_view in weights:
            weight = weight * of_view(j, i)
        if values.ndim == 5 and np.ndim(weight):
            weight = weight[..., None]
        result[j, i] = values[j, i] * weight
    return light_field.replaced(result)


def carried_to(
    train: Train, light_field: Field, z: float, before: bool = False, memory_limit: int | None = None
) -> Field:
    """The light field at a plane inside a camera; see `vcc.Camera.light_field_at`.

    Raises:
        InputError: z behind the sensor, or an element before z that is not affine, unlike a lens or a prism.
    """
    if any(element.depends_on_band for element in train.elements):
        refuse(train, "one light field of all channels inside the camera")
    if z > train.sensor.z:
        raise InputError(f"z = {z * 1e3:g} mm lies behind the sensor at {train.sensor.z * 1e3:g} mm")
    passed = list(itertools.takewhile(lambda stage: _passed(stage, z, before), train.stages))
    for stage in passed:
        if stage.faces.bending is not None:
            raise InputError(
                f"{stage.element.label} is not affine: behind it the light field has no frame. Choose a z "
                "before it, or compute the image (camera.capture)"
            )
    planes: list[tuple[Pattern | RayTransmission, tuple[float, float], Affine]] = []
    for stage in passed:
        planes += [
            (each, stage.element.decentre, stage.arriving)
            for each in (stage.faces.pattern, stage.faces.by_ray)
            if each is not None
        ]
        if stage.faces.spread is not None:
            # To the diffuser, and back to the plane to which the maps of the next masks refer.
            arriving = transformed(masked_at(light_field, planes, memory_limit), stage.arriving)
            planes = []
            light_field = transformed(scattered_by(arriving, stage, memory_limit), stage.arriving.inverse())
    behind = masked_at(light_field, planes, memory_limit)
    return transformed(behind, train.rays_at(z, before=before))


def _passed(stage: Stage, z: float, before: bool) -> bool:
    """Whether light has passed a stage at z; a stage exactly at z counts unless ``before``."""
    return stage.element.z < z or (stage.element.z == z and not before)


def transformed(light_field: Field, rays: Affine) -> Field:
    """The light field after a map of rays: 𝕋 of the paper (section 3.2.1); the samples are not modified."""
    return light_field.of(light_field.values, light_field.grid.moved(rays))


def _weights(
    light_field: Field, pattern: Pattern | RayTransmission, decentre: tuple[float, float], rays: Affine
) -> Callable[[int, int], Any]:
    """Transmission of a pattern for view (j, i): a number if it depends on the view only, else (rows, columns)."""
    nv, nu, nt, ns = light_field.shape[:4]
    if isinstance(pattern, RayTransmission):
        arriving = Affine.translation(-decentre[0], -decentre[1], 0, 0) @ rays @ light_field.frame
        column, row = np.meshgrid(np.arange(float(ns)), np.arange(float(nt)))

        def of_view(j: int, i: int) -> NDArray[np.float64]:
            index = np.stack([np.full_like(row, i), np.full_like(row, j), column, row], axis=-1)
            return pattern.share(arriving(index))

        return of_view
    plane = Plane.met_by(light_field.frame, rays, pattern, decentre, "pattern")
    views, still = Taps.of((nv, nu), CellDivision(1, False)), np.zeros((2, 2))
    if depends_on_view_only(plane, (nt, ns), still):
        shares = Aperture([plane], views, still, (nt, ns)).open_shares()
        return lambda j, i: shares[j, i]
    met = MaskMet.of(plane, views, np.zeros_like(views.index), still, (nt, ns), fine=1)
    lookup, _ = met.look_up(met.choices())
    k, l = np.arange(ns, dtype=float), np.arange(nt, dtype=float)
    # A texture that is prefiltered for splines may undershoot 0 beside an edge; transmission does not.
    return lambda j, i: np.maximum(lookup.weights(j, i, k, l), 0.0)


def masked(light_field: Field, mask: Mask, memory_limit: int | None = None) -> Field:
    """The paper's dot product L · K; see `vcc.LightField.masked`."""
    if mask.depends_on_band:
        raise InputError(
            f"{mask.label} has a pattern or a transmission for each channel, and light_field.masked weights all "
            "channels alike: mask channel by channel, light_field[..., n : n + 1], or put it in a vcc.Camera"
        )
    pattern = mask.faces().pattern
    assert pattern is not None
    return masked_at(light_field, [(pattern, mask.decentre, Affine.identity())], memory_limit)


def scattered(light_field: Field, diffuser: Element, memory_limit: int | None = None) -> Field:
    """The paper's convolution L ⊗ D; see `vcc.LightField.scattered`."""
    if diffuser.depends_on_band:
        raise InputError(
            f"{diffuser.label} scatters each wavelength otherwise, and light_field.scattered treats all channels "
            "alike: scatter channel by channel with diffusers without a glass, or put it in a vcc.Camera"
        )
    faces = diffuser.faces()
    if faces.spread is None:
        raise InputError(f"{diffuser.label} does not scatter light: its faces have no kernel")
    if faces.deflection is not None:
        raise InputError(
            f"{diffuser.label} also bends rays: scatter with an element that only scatters, and use "
            "lf.transformed() for the bending, or put it in a vcc.Camera"
        )
    if faces.pattern is not None:  # positions stay: the order does not matter
        plane = (faces.pattern, diffuser.decentre, Affine.identity())
        light_field = masked_at(light_field, [plane], memory_limit)
    return scattered_by(light_field, Stage(diffuser, 0.0, Affine.identity(), faces), memory_limit)


def scattered_by(light_field: Field, stage: Stage, memory_limit: int | None = None) -> Field:
    """The light field just behind a scattering stage in its plane; other effects of the stage are ignored.

    Args:
        light_field: at the stage's plane.
        stage: with a scatter face.
        memory_limit: bytes; None takes `vcc.base.memory.MEMORY_LIMIT`.

    Raises:
        InputError: ray positions that depend on the pixel, not on the view alone; a kernel over too many samples;
            more memory needed than allowed.
    """
    from scipy.signal import oaconvolve

    scatter, label = stage.faces.spread, stage.element.label
    assert scatter is not None
    nv, nu, nt, ns = light_field.shape[:4]
    _check_places_of_views(light_field, label)
    with stage.named():
        weights = _view_weights(scatter, light_field, stage.element.decentre)
    high, wide = (max(one.shape[axis] // 2 for row in weights for one in row) for axis in (0, 1))
    shape = (nv, nu, nt + 2 * high, ns + 2 * wide, *light_field.shape[4:])
    check_samples(shape, memory_limit, f"the light field behind {label}")
    values = to_numpy(light_field.values)
    result = np.zeros(shape, dtype=np.float32)
    for j, i in np.ndindex(nv, nu):
        rows, columns = (size // 2 for size in weights[j][i].shape)
        inside = result[j, i, high - rows : high + nt + rows, wide - columns : wide + ns + columns]
        kernel = weights[j][i] if values.ndim == 4 else weights[j][i][:, :, None]
        # In double precision: rounding errors of Fourier transforms in dark regions would add up over a view.
        view = values[j, i].astype(np.float64) / light_field.grid.full_scale
        np.maximum(oaconvolve(view, kernel, axes=(0, 1)), 0.0, out=inside, casting="same_kind")
    # Scattering does not move points: the disparity range stays, and maps are computed on demand.
    disparities = Disparities(
        find=lambda progress: maps_of(made, progress), measure=light_field.grid.disparities.range
    )
    grid = replace(light_field.grid.grown(high, wide), kind=result.dtype, disparities=disparities)
    made = light_field.of(result, grid)
    return made


def _check_places_of_views(light_field: InMemory, label: str) -> None:
    """Check that all rays of a view have the same position.

    Raises:
        InputError: see `scattered_by`.
    """
    rows, columns = light_field.shape[2:4]
    linear = light_field.frame.linear
    travel = np.abs(linear[:2, 2:]) @ np.array([columns, rows])
    if (travel > 1e-6 * np.abs(linear[:2, :2]).sum(axis=1)).any():
        raise InputError(
            f"{label} cannot scatter this light field within its views: the positions of its rays depend on the "
            "pixel, not on the view alone, so that a change of slope moves rays to other views. Resample it "
            "first, to a frame whose positions depend on (i, j) only: lf.resampled(frame, shape)"
        )


def _view_weights(
    scatter: Scatter, light_field: Field, decentre: tuple[float, float]
) -> list[list[NDArray[np.float64]]]:
    """The kernel at the centre of each view's cell, as weights on the lattice of a view's samples."""
    nv, nu = light_field.shape[:2]
    steps_from_slopes = light_field.frame.inverse().linear[2:, 2:]
    if scatter.uniform:
        return [[scatter.kernels[0].weights(steps_from_slopes)] * nu] * nv
    index = np.zeros((nv, nu, 4))
    index[..., 0], index[..., 1] = np.meshgrid(np.arange(nu), np.arange(nv))
    place = light_field.frame(index)[..., :2] - decentre
    shares, widths = scatter.at(place[..., 0], place[..., 1])

    @cache  # many views have the same width
    def kernel(n: int, width: float) -> NDArray[np.float64]:
        return scatter.kernels[n].weights(width * steps_from_slopes)

    def mixed(share: NDArray[np.float64], width: float) -> NDArray[np.float64]:
        return _about_one_middle([share[n] * kernel(n, width) for n in np.flatnonzero(share).tolist()])

    return [[mixed(shares[j, i], float(widths[j, i])) for i in range(nu)] for j in range(nv)]


def _about_one_middle(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """The sum of arrays of odd sizes, aligned at their centres."""
    rows, columns = (max(part.shape[axis] for part in parts) for axis in (0, 1))
    total = np.zeros((rows, columns))
    for part in parts:
        top, left = (rows - part.shape[0]) // 2, (columns - part.shape[1]) // 2
        total[top : top + part.shape[0], left : left + part.shape[1]] += part
    return total


def resampled(
    light_field: Field,
    frame: Affine,
    shape: tuple[int, int, int, int],
    interpolation: str = "linear",
    memory_limit: int | None = None,
) -> Field:
    """The light field on another grid; see `vcc.LightField.resampled`."""
    from scipy.ndimage import affine_transform

    checks.one_of("interpolation", interpolation, SPLINE_ORDER)
    checks.counts("the shape of a grid", shape, "v", "u", "t", "s")
    check_samples((*shape, light_field.grid.channels or 1), memory_limit, "the resampled light field")
    old_from_new = light_field.frame.inverse() @ frame
    axes = list(np.argsort(LIGHT_FIELD_AXES))
    matrix, offset = old_from_new.linear[np.ix_(axes, axes)], old_from_new.offset[axes]
    values = to_numpy(light_field.values)
    values = values.reshape(*values.shape[:4], -1)
    result = np.empty((*shape, values.shape[4]), dtype=np.float32)
    for channel in range(values.shape[4]):
        samples = values[..., channel].astype(np.float32) / np.float32(light_field.grid.full_scale)
        result[..., channel] = affine_transform(
            samples,
            matrix,
            offset,
            output_shape=shape,
            order=SPLINE_ORDER[interpolation],
            mode="grid-constant",  # zero outside, and interpolated towards the border
            output=np.float32,
        )
    np.maximum(result, 0, out=result)  # splines may undershoot; radiance is not negative
    final: NDArray[np.float32] = result if light_field.grid.channels is not None else result[..., 0]
    alone: dict[str, Any] = {"disparity_range": None, "disparity": None, "extent": None, "beyond": ALL}
    return replace(light_field, values=final, frame=frame, **alone)
