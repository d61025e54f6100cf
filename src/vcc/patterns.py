"""What masks let through: the public face of `vcc.shapes.patterns`."""

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
