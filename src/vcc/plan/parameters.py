"""The parameters of a plan, by name: the variables of derivatives, which change while a camera learns.

A plan consists of choices (which core, how many taps, which footprint) and parameters (places, steps, weights,
textures). The parameters of a value are all its floating-point leaves, named by their path: of a core
``"masks[0].texture"``, of operators ``"[1].kernel"``; an affine map is its matrix, a tuple of numbers one array.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine

Array = NDArray[np.float64]
Thing = TypeVar("Thing")


def parameters(thing: Any) -> dict[str, Array]:
    """All floating-point leaves of a dataclass, tuple, array or number, by name, as float64.

    Args:
        thing: a core, an operator, or a tuple of them; dataclasses and tuples are traversed, integers, texts and
            other values that are not floating-point are skipped, and so are fields whose metadata call them
            ``constant``. Arrays in double precision are not copied.
    """
    return dict(_leaves(thing, ""))


def with_parameters(thing: Thing, changed: Mapping[str, Any]) -> Thing:
    """Return a copy with the given parameters changed.

    Args:
        thing: as for `parameters`.
        changed: by the names that `parameters` returns; each of the parameter's shape. Arrays keep their type.
    """
    made, unknown = _changed(thing, "", dict(changed))
    if unknown:
        raise KeyError(f"no numbers are named {', '.join(unknown)}")
    return made  # type: ignore[no-any-return]


def _parts(thing: Any) -> Iterator[tuple[str, Any]]:
    """The fields of a dataclass or the items of a tuple, with the suffix that each adds to the name."""
    if isinstance(thing, tuple):
        yield from ((f"[{n}]", part) for n, part in enumerate(thing))
    elif dataclasses.is_dataclass(thing) and not isinstance(thing, type):
        changing = (field for field in dataclasses.fields(thing) if not field.metadata.get("constant"))
        yield from ((f".{field.name}", getattr(thing, field.name)) for field in changing)


def _leaf(thing: Any) -> Array | None:
    """A leaf as an array of numbers; None if the value is not a leaf."""
    if isinstance(thing, Affine):
        return thing.matrix
    if isinstance(thing, np.ndarray):
        return thing.astype(np.float64, copy=False) if thing.dtype.kind == "f" else None
    pair = isinstance(thing, tuple) and thing and all(isinstance(part, float) for part in thing)
    return np.array(thing, dtype=np.float64) if pair or isinstance(thing, float) else None


def _leaves(thing: Any, name: str) -> Iterator[tuple[str, Array]]:
    leaf = _leaf(thing)
    if leaf is not None:
        yield name.lstrip("."), leaf
        return
    for more, part in _parts(thing):
        yield from _leaves(part, name + more)


def _changed(thing: Any, name: str, changed: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """The value with the named parameters changed, and the changes whose names were not found in it."""
    if _leaf(thing) is not None:
        own = name.lstrip(".")
        if own not in changed:
            return thing, changed
        return _like(thing, changed[own]), {other: value for other, value in changed.items() if other != own}
    parts = {}
    for more, part in _parts(thing):
        made, changed = _changed(part, name + more, changed)
        if made is not part:
            parts[more] = made
    if not parts:
        return thing, changed
    if isinstance(thing, tuple):
        return tuple(parts.get(f"[{n}]", part) for n, part in enumerate(thing)), changed
    return dataclasses.replace(thing, **{more[1:]: made for more, made in parts.items()}), changed


def _like(thing: Any, value: Any) -> Any:
    """Numbers converted to the kind of a leaf."""
    if isinstance(thing, Affine):
        return Affine(np.asarray(value, dtype=np.float64))
    if isinstance(thing, np.ndarray):
        return np.asarray(value, dtype=thing.dtype).reshape(thing.shape)
    if isinstance(thing, tuple):
        return tuple(float(part) for part in np.reshape(value, -1))
    return float(value)
