"""Units as plain factors to SI, so that code reads ``Lens(focal_length=50 * mm)``: what users import.

Everything inside this library is in metres, radians and seconds; slopes are dimensionless. ``parse`` reads a
quantity with its unit, as camera files and the command line carry it.
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
