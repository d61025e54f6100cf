"""Affine maps of rays and indices: the public face of `vcc.base.affine`."""

from vcc.base.affine import (
    Affine,
)

__all__ = [
    "Affine",
]
