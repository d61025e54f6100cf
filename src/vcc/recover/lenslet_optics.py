"""What a camera with lenslets before its sensor makes of the middle of its entrance plane: a micro-image each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.optics import LensArray
from vcc.optics.train import Train


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
