"""Compiled modules by name. Numba takes a moment to import: that is done when a picture first needs it."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Literal


def compiled(name: Literal["rays_compiled", "sharpening_kernels", "depth_kernels"]) -> Any:
    """A module of this folder that needs Numba."""
    return import_module(f"{__package__}.{name}")
