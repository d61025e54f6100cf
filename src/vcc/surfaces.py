"""What plates add to the optical path: the public face of `vcc.shapes.surfaces`."""

from vcc.shapes.surfaces import (
    Axicon,
    Cubic,
    HeightMap,
    PathMap,
    Quadratic,
    Rough,
    Sheet,
    Surface,
    Tilt,
    Zernike,
    noll,
)

__all__ = [
    "Axicon",
    "Cubic",
    "HeightMap",
    "PathMap",
    "Quadratic",
    "Rough",
    "Sheet",
    "Surface",
    "Tilt",
    "Zernike",
    "noll",
]
