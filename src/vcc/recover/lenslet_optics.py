"""What a camera with lenslets before its sensor makes of the middle of its entrance plane: a micro-image each.

And its aberrations, taken out of a light field afterwards.
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
        rays_at_array: from rays at the entrance plane to rays that arrive at the lenslets.
        sensor_from_array: from the place of a lenslet to that where it images the middle of the entrance plane,
            metres.
    """

    array: LensArray
    gap: float
    rays_at_array: Affine
    sensor_from_array: Affine

    @classmethod
    def of(cls, camera: Train) -> LensletOptics:
        """Those of a camera.

        Raises:
            InputError: no lens array as its last element, one on the sensor, or one at an image of the entrance
                plane.
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
        # A ray from (0, 0) at slope σ arrives at B·σ + o with slope D·σ + q: its slope follows from its place.
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
        """From steps along the lattice of lenslets to the centres of micro-images on the sensor, metres."""
        array = self.array
        return self.sensor_from_array @ Affine.translation(*array.decentre) @ array.lattice.place_from_steps


# --- aberrations taken out of a light field after it was recorded (Ng and Hanrahan 2006) ---


_TURNED = 1e-9
"""Share of a pixel's step in slope by which it may leave its axis: rounding."""


def without_aberration(light_field: LightField, surface: Surface) -> LightField:
    """Each view moved back by the slopes that a known plate at the views' plane has added to its rays.

    A ray that came at the slope s to the place u of the plate is recorded at s + Δs(u) by a camera that takes
    its lens for perfect. A light field tells the places apart, and each view can be put right by itself (R. Ng and
    P. Hanrahan, *Digital correction of lens aberrations in light field photography*, 2006). Views are read by
    cubic splines between pixels, go on beyond their borders as they end there, and stay 0 or more.

    Args:
        light_field: in memory, at the plane of the plate, its pixels along s and t. A view is taken as one place:
            its middle.
        surface: of the plate, a `vcc.surfaces.Surface`, whose gradient is Δs.

    Returns:
        Float32 samples in the same frame.

    Raises:
        InputError: a light field on disk or with turned pixels, or a plate that moves a view by more than its
            width.
    """
    from scipy.ndimage import shift

    if not isinstance(light_field, LightField):
        raise InputError("an aberration is taken out of samples in memory: pass stored.read(), or a part of it")
    linear = light_field.frame.linear
    steps = np.array([linear[3, 3], linear[2, 2]])  # of a row and of a column
    if not steps.all() or max(abs(linear[2, 3]), abs(linear[3, 2])) > _TURNED * np.abs(steps).min():
        raise InputError(
            "the pixels of this light field do not lie along the slopes s and t: take the aberration out where it "
            "was decoded, before other optics"
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
