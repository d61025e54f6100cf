"""An element of your own: a spiral phase plate with an absorbing disc in its middle and an absorbing rim.

python examples/own_element.py [PICTURE.png]

The camera takes points of light through the plate: each becomes a ring. docs/elements/own-element.md explains.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import vcc
from vcc.sources import PlanesScene, TexturedPlane
from vcc.units import mm, nm, um

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SpiralPlate(vcc.Element):
    """Glass that grows by ``charge`` wavelengths of path in a turn, clear between two diameters."""

    charge: int
    wavelength: float = field(metadata={"unit": "length"})
    inner_diameter: float = field(metadata={"unit": "length"})
    outer_diameter: float = field(metadata={"unit": "length"})

    def faces(self) -> vcc.Faces:
        """OPL = a·θ with a = charge · wavelength/2π, so that slopes run around the axis: a/r."""
        a = self.charge * self.wavelength / (2 * np.pi)

        def slopes(x: Array, y: Array) -> tuple[Array, Array]:
            r2 = np.maximum(x**2 + y**2, (self.inner_diameter / 2) ** 2)  # finite on the axis too
            return -a * y / r2, a * x / r2

        def clear(x: Array, y: Array) -> Array:
            r = np.hypot(x, y)
            return np.where((r >= self.inner_diameter / 2) & (r <= self.outer_diameter / 2), 1.0, 0.0)

        return vcc.Faces(deflection=slopes, transmission=clear)


SLOPE_PER_PIXEL = 20e-6


def camera_with(*elements: vcc.Element) -> vcc.Camera:
    """A telescope of 100 mm focused on 10 m, with elements at its lens; a pixel is 20 µrad."""
    z = 1 / (1 / (100 * mm) - 1 / 10)
    sensor = vcc.Sensor(z=z, shape=(240, 360), pitch=SLOPE_PER_PIXEL * z)
    return vcc.Camera([vcc.Lens(focal_length=100 * mm, diameter=12 * mm), *elements], sensor)


def points_of_light(x: Array, y: Array) -> Array:
    """Seven points in three colours on black, 10 m away; (..., 3)."""
    picture = np.zeros((*np.broadcast_shapes(x.shape, y.shape), 3))
    colours = ((1.0, 0.85, 0.6), (0.55, 0.75, 1.0), (1.0, 0.5, 0.35))
    places = ((0, 0), (-20, -11), (-13, 14), (19, -13), (10, 16), (-28, 6), (27, 7))
    for n, (column, row) in enumerate(places):
        r2 = (x - column * mm) ** 2 + (y - row * mm) ** 2
        picture += np.exp(-r2 / (2 * (0.25 * mm) ** 2))[..., None] * colours[n % 3]
    return np.minimum(picture, 1.0)


def scene() -> vcc.LightField:
    """The light field of the points of light, 13×13 views over 13 mm."""
    planes = PlanesScene([TexturedPlane(points_of_light, 10.0)])
    return planes.light_field(
        (13, 13), (350, 470), spacing=1 * mm, slope_per_pixel=SLOPE_PER_PIXEL, focus_distance=10.0
    )


def main() -> None:
    """Take the picture, say how it is made, and write it."""
    plate = SpiralPlate(
        charge=20, wavelength=550 * nm, inner_diameter=4 * mm, outer_diameter=10 * mm, name="spiral"
    )
    camera, light_field = camera_with(plate), scene()
    print(camera.explain(light_field))
    radii = [plate.charge * plate.wavelength / (np.pi * d) * camera.sensor.z / um for d in (10 * mm, 4 * mm)]
    print(f"rings of {radii[0]:.0f} to {radii[1]:.0f} um radius")
    picture = camera.capture(light_field, samples=1024)  # points are small: few of 64 rays would meet one
    print(picture.save(sys.argv[1] if len(sys.argv) > 1 else "rings.png").description)


if __name__ == "__main__":
    main()
