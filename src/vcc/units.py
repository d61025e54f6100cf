"""Units as factors to SI, for users: ``Lens(focal_length=50 * mm)``.

All values in this library are in metres, radians and seconds; slopes are dimensionless. ``parse`` reads a quantity
with its unit, as in camera files and on the command line.
"""

from vcc.base.units import (
    cm,
    deg,
    m,
    mm,
    mrad,
    ms,
    nm,
    parse,
    rad,
    s,
    short,
    text,
    um,
    us,
)

__all__ = [
    "cm",
    "deg",
    "m",
    "mm",
    "mrad",
    "ms",
    "nm",
    "parse",
    "rad",
    "s",
    "short",
    "text",
    "um",
    "us",
]
