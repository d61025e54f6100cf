"""The micro-images of the centre of the entrance plane, for a camera with lenslets.

Also: correction of lens aberrations in a light field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.fields.sampled import to_numpy
from vcc.light_field import LightField
from vcc.optics import LensArray
from vcc.optics.train import Train
from vcc.shapes.surfaces import Surface


@dataclass(frozen=True, eq=False)
class LensletOptics:
    """Affine optics, then a sheet of lenslets, then the sensor.

    Args:
        array: the lenslets.
        gap: from them to the sensor, metres.
        rays_at_array: map from rays at the entrance plane to rays that arrive at the lenslets.
        sensor_from_array: map from a lenslet's position to its image of the centre of the entrance plane, metres.
    """

    array: LensArray
    gap: float
    rays_at_array: Affine
    sensor_from_array: Affine

    @classmethod
    def of(cls, camera: Train) -> LensletOptics:
        """The lenslet optics of a camera.

        Raises:
            InputError: no lens array as the last element, a lens array on the sensor, or one at an image of the
                entrance plane.
        """
        array = camera.elements[-1] if camera.elements else None
        if not isinstance(array, LensArray):
            found = ", ".join(element.label for element in camera.elements) or "none"
            raise InputError(
                f"plenoptic decoding needs a camera whose last element is a vcc.LensArray; its elements: {found}"
            )
        gap = camera.sensor.z - array.z
        if not gap > 0:
            raise InputError(f"{array.label} lies on the sensor: micro-images need a distance between them")
        rays = camera.rays_at(array.z, before=True)
        # A ray from (0, 0) with slope σ arrives at B·σ + o with slope D·σ + q: its position determines its slope.
        position, slope = rays.linear[:2, 2:], rays.linear[2:, 2:]
        if abs(np.linalg.det(position)) < 1e-12:
            raise InputError(
                f"{array.label} stands where the optics image the entrance plane: all light from the middle of "
                "that plane meets there, and no lenslet sees views. Move the array or the entrance plane"
            )
        slope_from_place = slope @ np.linalg.inv(position)
        offset = rays.offset[2:] - slope_from_place @ rays.offset[:2]
        return cls(array, gap, rays, Affine.from_parts(np.eye(2) + gap * slope_from_place, gap * offset))

    @property
    def micro_image_from_steps(self) -> Affine:
        """Map from steps along the lattice of lenslets to the centres of micro-images on the sensor, metres."""
        array = self.array
        return self.sensor_from_array @ Affine.translation(*array.decentre) @ array.lattice.place_from_steps


# --- correction of aberrations in a recorded light field (Ng and Hanrahan 2006) ---


_TURNED = 1e-9
"""Largest component of a pixel's slope step along the other axis, relative: rounding."""


def without_aberration(light_field: LightField, surface: Surface) -> LightField:
    """Correct a light field for a known aberration: shift each view by the slopes that a plate added to its rays.

    A ray that arrives with slope s at position u of the plate is recorded at s + Δs(u) by a camera that assumes a
    perfect lens. A light field separates these positions, so each view can be corrected on its own (R. Ng and
    P. Hanrahan, *Digital correction of lens aberrations in light field photography*, 2006). Views are
    interpolated by cubic splines, repeated beyond their borders, and clipped at 0.

    Args:
        light_field: in memory, at the plane of the plate, its pixels along s and t. The centre of each view counts
            as its position.
        surface: of the plate, a `vcc.surfaces.Surface`; its gradient is Δs.

    Returns:
        Float32 samples in the same frame.

    Raises:
        InputError: a light field on disk or with rotated pixels, or a plate that shifts a view by more than its
            width.
    """
    from scipy.ndimage import shift

    if not isinstance(light_field, LightField):
        raise InputError("an aberration is corrected for samples in memory: pass stored.read(), or a part of it")
    linear = light_field.frame.linear
    steps = np.array([linear[3, 3], linear[2, 2]])  # of a row and of a column
    if not steps.all() or max(abs(linear[2, 3]), abs(linear[3, 2])) > _TURNED * np.abs(steps).min():
        raise InputError(
            "the pixels of this light field do not lie along the slopes s and t: correct the aberration "
            "right after decoding, before other optics"
        )
    values = np.array(to_numpy(light_field.values), dtype=np.float32)
    nv, nu, nt, ns = values.shape[:4]
    for row, column in np.ndindex(nv, nu):
        u, v = light_field.frame([column, row, (ns - 1) / 2, (nt - 1) / 2])[:2]
        across, down = surface.slopes(u, v)
        moved = -np.array([float(down), float(across)]) / steps
        if not (np.abs(moved) < (nt, ns)).all():
            raise InputError(
                f"at u = {u:.4g} m, v = {v:.4g} m this plate moves the view by {np.abs(moved).max():.4g} pixels, "
                "more than its width: is it the plate of this camera, in metres?"
            )
        away = (*moved, 0.0)[: values.ndim - 2]
        values[row, column] = shift(values[row, column], away, order=3, mode="nearest")
    return light_field.replaced(np.maximum(values, 0))
