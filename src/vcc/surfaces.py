"""Surfaces of plates, for users: the added optical path as a function of position.

A thin plate of height h(x, y) and refractive index n adds the path OPL = (n − 1)·h and deflects rays by its
gradient, (Δs, Δt) = (∂OPL/∂x, ∂OPL/∂y). Positions (x, y) are in metres relative to the surface's centre, x
right and y down.
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
