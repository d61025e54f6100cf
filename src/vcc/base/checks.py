"""Refusals that many places share: each names the thing, its value and the way out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from vcc.base.errors import InputError


def whole_number(value: object) -> int | None:
    """A whole number as an int; None for anything else, truth values and 2.0 included."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer):
        return None
    return int(value)


def one_of(name: str, value: object, choices: Iterable[str]) -> str:
    """A word out of some, as it is.

    Args:
        name: what to call it in an error.
        value: the word.
        choices: those that there are.

    Raises:
        InputError: another word.
    """
    words = list(choices)
    if value not in words:
        listed = ", ".join(map(repr, words[:-1])) + f" or {words[-1]!r}"
        raise InputError(
            f"{name} is one of {listed}, not {value!r}" if len(words) > 3 else f"{name} is {listed}, not {value!r}"
        )
    return str(value)


def seed(value: object, name: str = "seed") -> int:
    """A seed of random numbers as an int.

    Args:
        value: a whole number, 0 or more; truth values and floating-point numbers are none.
        name: what to call it in an error.

    Raises:
        InputError: anything else.
    """
    number = whole_number(value)
    if number is None or number < 0:
        raise InputError(f"{name} is {value!r}: it is a whole number, 0 or more, such as 1")
    return number


def above_zero(name: str, value: Any, what: str = "") -> float:
    """A number greater than 0, as a float.

    Args:
        name: what to call it in an error.
        value: the number.
        what: it is, for the error, such as "a share of the picture's mean".

    Raises:
        InputError: anything else, NaN included.
    """
    try:
        fine = bool(value > 0)
    except TypeError:
        fine = False
    if not fine:
        raise InputError(f"{name} {f'is {what}, ' if what else 'must be '}greater than 0, not {value!r}")
    return float(value)
