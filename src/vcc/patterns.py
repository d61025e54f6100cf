"""Transmission patterns, for users: the transmission of a mask as a function of position.

A pattern is called with positions (x, y) in metres relative to its centre (x right, y down) and returns the
transmitted share, 0 to 1. Light fields are sampled in cells, so a camera needs a pattern's *mean* over a
rectangle, not its value at a point: patterns with a closed form compute it exactly, others with a fine
raster. Any function of (x, y) becomes a pattern with `as_pattern`.
"""

from typing import Any

from vcc.base.hints import no_such_name
from vcc.shapes.by_channel import ByChannel
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
    "ByChannel",
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
