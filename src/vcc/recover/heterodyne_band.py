"""Band-limited scenes for simulated heterodyne recordings, and the true views to compare with.

On the sensor, a tile contains detail up to half of the carrier; across the aperture, the first harmonics of one
period (see `vcc.recover.heterodyne`). A real camera needs a scene that is no finer; this module makes such scenes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.fields.grid import skew
from vcc.light_field import LightField
from vcc.recover.heterodyne import HeterodyneGeometry

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

MARGIN = 2
"""By how many pixels of a decoded view a band-limited light field is larger than the sensor, on each side."""


def band_limited(
    light_field: LightField, camera: Camera, *, fineness: float = 1.0, samples: int = 5, parts: int = 4
) -> Iterator[LightField]:
    """A light field without the detail on the sensor that exceeds the tiles of a heterodyne camera.

    Each view is convolved, as projected on the sensor, with sinc²: the transfer function falls linearly to 0
    at half the carrier, the end of a tile, and light stays positive. All views are sampled at the same
    positions of the sensor. Nothing is filtered across the aperture. Beyond the border of a view its edge is
    repeated.

    Args:
        light_field: with views in rows along the axes, at the entrance plane.
        camera: see `HeterodyneGeometry.of`.
        fineness: of the remaining detail, relative to the capacity of the tiles: 2 passes frequencies twice
            as high, which alias.
        samples: per pixel of a decoded view. Sampling makes copies of the scene's spectrum at multiples of the
            carrier times ``samples``, and the mask shifts them by up to ``harmonics`` carriers: with more samples
            than harmonics, no copy overlaps the central tile.
        parts: into which the rows of samples are divided, one in memory at a time; the light field is their sum.

    Yields:
        ``parts`` light fields of float32 radiance, (v, u, rows of samples, columns of samples[, channels]), whose
        recordings add up to that of the whole. Samples are values at points of the filtered scene.

    Raises:
        InputError: views that are not along the axes, samples or parts below 1, a fineness that is not
            positive, or an error of `HeterodyneGeometry.of`.
    """
    if samples < 1 or parts < 1 or not fineness > 0:
        raise InputError(
            f"band_limited takes 1 sample or more, 1 part or more and a fineness above 0, not {samples}, {parts} "
            f"and {fineness}"
        )
    geometry = HeterodyneGeometry.of(camera)
    ends = _ends(geometry, fineness)
    places: list[NDArray[Any]] = []
    step: list[float] = []
    for axis in (0, 1):
        step.append(1 / geometry.carrier[axis] / samples)
        count = (geometry.shape[1 - axis] + 2 * MARGIN) * samples
        places.append(camera.sensor.decentre[axis] + (np.arange(count) - (count - 1) / 2) * step[axis])
    frame = light_field.frame
    for y in np.array_split(places[1], parts):
        values = _low_passed(light_field, camera, (places[0], y), ends)
        grid = Affine.from_parts(
            np.diag([frame.linear[0, 0], frame.linear[1, 1], *step]), [*frame.offset[:2], places[0][0], y[0]]
        )
        yield LightField(values, _landing(camera).inverse() @ grid, disparity_range=(0.0, 0.0), sample="point")


def true_views(light_field: LightField, camera: Camera, decoded: LightField) -> LightField:
    """The ideal result of decoding: views in the frame of the decoded ones, limited to what fits the tiles.

    On the sensor they are low-pass filtered as in `band_limited`. Across the aperture, views in a row are
    samples of a periodic function; the harmonics that have carriers in the mask are summed at the positions
    of the decoded views. A light field with the same number of views at the same positions is not changed by
    this.

    Args:
        light_field: with views in rows along the axes, which fill the period across the aperture evenly.
        camera: see `HeterodyneGeometry.of`.
        decoded: the result of `vcc.recover.decode_heterodyne`; only its frame and shape are used.

    Returns:
        float32 radiance; negative values from ringing of the sum of harmonics are set to 0.

    Raises:
        InputError: views that are not along the axes or do not fill the period, fewer views than decoded, or an
            error of `HeterodyneGeometry.of`.
    """
    geometry = HeterodyneGeometry.of(camera)
    frame, landing = light_field.frame, _landing(camera) @ decoded.frame
    weights, places = [], []
    n = np.arange(-geometry.harmonics, geometry.harmonics + 1)
    for axis, period in enumerate(geometry.aperture_period):
        count, wanted = light_field.shape[1 - axis], decoded.shape[1 - axis]
        spacing = abs(float(frame.linear[axis, axis]))
        if count < geometry.views or abs(count * spacing / period - 1) > 1e-6:
            raise InputError(
                f"true views need {geometry.views} views or more that fill the period across the aperture, "
                f"{period:.6g} m, evenly; the light field has {count}, {spacing:.6g} m apart"
            )
        there = frame.linear[axis, axis] * np.arange(count) + frame.offset[axis]
        here = decoded.frame.linear[axis, axis] * np.arange(wanted) + decoded.frame.offset[axis]
        turns = np.exp(2j * np.pi * n * (here[:, None, None] - there[:, None]) / period)
        weights.append((turns.sum(axis=-1).real / count).astype(np.float32))
        pixels = np.arange(decoded.shape[3 - axis])
        places.append(landing.linear[axis + 2, axis + 2] * pixels + landing.offset[axis + 2])
    seen = _low_passed(light_field, camera, (places[0], places[1]), _ends(geometry))
    values = np.tensordot(weights[0], seen, axes=(1, 1))  # (u', v, t, s[, channels])
    values = np.tensordot(weights[1], values, axes=(1, 1))  # (v', u', t, s[, channels])
    return decoded.replaced(np.maximum(values, 0))


def places_on_sensor(light_field: LightField, camera: Camera, axis: int) -> Array:
    """Positions on the sensor of the pixels of views, along an axis (0: x, 1: y): (views, pixels), metres.

    Raises:
        InputError: views that are not along the axes.
    """
    if not np.allclose(skew(light_field.frame), 0):
        raise InputError("views must stand in rows along the axes, and so must their pixels")
    views, pixels = light_field.shape[1 - axis], light_field.shape[3 - axis]
    index = np.zeros((views, pixels, 4))
    index[..., axis], index[..., axis + 2] = np.arange(views)[:, None], np.arange(pixels)
    return np.asarray((_landing(camera) @ light_field.frame)(index)[..., axis + 2])


def _landing(camera: Camera) -> Affine:
    """From rays (u, v, s, t) at the entrance plane to (u, v, x, y), x and y on the sensor."""
    rays = camera.rays_at(camera.sensor.z)
    return Affine.from_parts(np.vstack([np.eye(4)[:2], rays.linear[:2]]), [0.0, 0.0, *rays.offset[:2]])


def _ends(geometry: HeterodyneGeometry, fineness: float = 1.0) -> tuple[float, float]:
    """Highest remaining frequencies (x, y), cycles/metre."""
    return fineness * geometry.carrier[0] / 2, fineness * geometry.carrier[1] / 2


def _low_passed(
    light_field: LightField, camera: Camera, places: tuple[NDArray[Any], NDArray[Any]], ends: tuple[float, float]
) -> Floats:
    """Views at positions (x, y) of the sensor, low-pass filtered: (v, u, len(y), len(x)[, channels])."""
    right, down = (
        _kernel(places_on_sensor(light_field, camera, axis), places[axis], ends[axis]) for axis in (0, 1)
    )
    across = np.ascontiguousarray(right.swapaxes(1, 2))[:, None]  # layout for fast matrix products
    views = light_field.shape[:2]
    values = np.empty((*views, len(places[1]), len(places[0]), *light_field.shape[4:]), np.float32)
    for row in range(views[0]):
        given = np.asarray(light_field.values[row], dtype=np.float32) / np.float32(light_field.full_scale)
        planes = np.moveaxis(given.reshape(*given.shape[:3], -1), -1, 1)
        # The axis that shrinks goes first: fewer operations.
        filtered = np.moveaxis((down[row] @ np.ascontiguousarray(planes)) @ across, 1, -1)
        values[row] = filtered.reshape(values.shape[1:])
    return values


def _kernel(landed: Array, places: NDArray[Any], end: float) -> Floats:
    """Weights of views' pixels at positions: (views, places, pixels); their spectrum ends at ``end``, 1/m."""
    weights = np.sinc((places[None, :, None] - landed[:, None, :]) * end) ** 2
    return np.asarray(weights / weights.sum(axis=2, keepdims=True), dtype=np.float32)
