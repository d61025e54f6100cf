"""Affine maps of rays and of sample indices, as users import them: the whole of linear optics, and every frame."""

from vcc.base.affine import (
    Affine,
)

__all__ = [
    "Affine",
]
