"""Affine maps of rays and of sample indices, for users: linear optics, and frames."""

from vcc.base.affine import (
    Affine,
)

__all__ = [
    "Affine",
]
