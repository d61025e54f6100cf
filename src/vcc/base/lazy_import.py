"""Modules loaded by name when they are first needed: what is compiled takes a second to load."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def module(name: str) -> Any:
    """A module of ours by its full name; the names stand in strings, where the tests of imports find them."""
    return import_module(name)
