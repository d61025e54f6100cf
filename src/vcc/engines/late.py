"""Modules that need Numba, which takes a moment to import: that is done when a picture first needs one."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def compiled(module: str) -> Any:
    """A module of compiled loops, by its full name."""
    return import_module(module)
