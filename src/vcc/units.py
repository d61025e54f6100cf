"""Units as plain factors, ``50 * mm``: the public face of `vcc.base.units`."""

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
