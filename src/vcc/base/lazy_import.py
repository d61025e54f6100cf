"""Modules imported by name on first use: compiled ones take a second to load."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def module(name: str) -> Any:
    """Import a module of this package by its full name; names are literal strings, which the import tests find."""
    return import_module(name)
