"""Transmission patterns, as users import them: what a mask lets through, as a function of position.

A pattern is called with positions (x, y) in metres from its own middle (x right, y down) and returns the
transmitted share, 0 to 1. Light fields are sampled in cells, so what a camera needs is a pattern's *mean* over
a rectangle, never its value at a point: patterns with a closed form give it exactly, the others through a fine
raster. Any function of (x, y) can be used as a pattern through `as_pattern`.
"""

from typing import Any

from vcc.base.hints import no_such_name
from vcc.shapes.directional import AngularFringes
from vcc.shapes.patterns import (
    Bounded,
    Cells,
    Circle,
    CosineSum,
    FunctionPattern,
    Open,
    Pattern,
    Polygon,
    as_pattern,
    mean_by_raster,
    mura,
    owned,
)

__all__ = [
    "AngularFringes",
    "Bounded",
    "Cells",
    "Circle",
    "CosineSum",
    "FunctionPattern",
    "Open",
    "Pattern",
    "Polygon",
    "as_pattern",
    "mean_by_raster",
    "mura",
    "owned",
]


_INSTEAD = {
    "ura": "mura",
    "pinhole": "Circle(diameter)",
    "disc": "Circle",
    "disk": "Circle",
    "cosine": "CosineSum",
    "sinusoid": "CosineSum",
    "random": "Cells(array)",
    "checkerboard": "Cells(array)",
}


def __getattr__(name: str) -> Any:
    raise no_such_name(__name__, name, __all__, _INSTEAD)
