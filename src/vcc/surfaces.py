"""Surfaces of plates, as users import them: the optical path that they add, as a function of position.

A thin plate of height h(x, y) and refractive index n adds the path OPL = (n − 1)·h and bends rays by its gradient,
(Δs, Δt) = (∂OPL/∂x, ∂OPL/∂y). Positions (x, y) are in metres from the surface's own middle, x right and y down.
"""

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
