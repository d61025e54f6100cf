"""The one data idea: values on a regular grid plus an affine frame from index to physical coordinates.

A light field, an image and a mask texture are all of this kind, so slicing one is slicing its values
and composing its frame with a translation: a piece of a light field is a light field, in its place.
"""

from __future__ import annotations

from types import EllipsisType
from typing import Any

import numpy as np

from vcc.base.affine import Affine
from vcc.base.errors import InputError

Index = slice | EllipsisType

LIGHT_FIELD_AXES = (1, 0, 3, 2)
"""The value axis of each frame index (i, j, k, l): values are stored (v, u, t, s)."""
IMAGE_AXES = (1, 0)
"""The value axis of each frame index (column, row): values are stored rows before columns."""


def sliced(
    values: Any, frame: Affine, index: Index | tuple[Index, ...], axes: tuple[int, ...], what: str
) -> tuple[Any, Affine, list[range]]:
    """A piece of ``values``, its frame, and the indices taken along each axis of ``values``.

    Args:
        values: an array whose first axes are the sampled ones.
        frame: maps indices of ``values`` to physical coordinates.
        index: slices, one for each leading axis of ``values``; an ellipsis stands for whole axes.
        axes: which value axis each frame index belongs to.
        what: how to name the thing in an error.

    Raises:
        InputError: an integer or array index (it would lose an axis), too many slices, or nothing left.
    """
    parts: list[Any] = list(index) if isinstance(index, tuple) else [index]
    ellipses = [place for place, part in enumerate(parts) if part is Ellipsis]
    if len(ellipses) > 1:
        raise InputError(f"{what} takes at most one ellipsis as an index")
    for place in ellipses:
        parts[place : place + 1] = [slice(None)] * (values.ndim - len(parts) + 1)
    if len(parts) > values.ndim:
        raise InputError(f"{what} has {values.ndim} axes, and {len(parts)} slices were given")
    for part in parts:
        if not isinstance(part, slice):
            raise InputError(
                f"{what} keeps all of its axes and is indexed by slices, not by {part!r}: "
                f"write {part!r}:{part + 1}"
                if isinstance(part, int)
                else f"{what} is indexed by slices, not by {part!r}"
            )
    parts += [slice(None)] * (values.ndim - len(parts))
    ranges = [range(*part.indices(size)) for part, size in zip(parts, values.shape, strict=True)]
    for axis, chosen in enumerate(ranges):
        if len(chosen) == 0:
            raise InputError(f"slice {parts[axis]} of axis {axis} of {what} (size {values.shape[axis]}) is empty")
    starts = [ranges[axis].start for axis in axes]
    steps = [ranges[axis].step for axis in axes]
    piece = values[tuple(parts)]
    moved = frame @ Affine.translation(*starts) @ Affine.scaling(*steps)
    return piece, moved, ranges


def to_numpy(values: Any) -> np.ndarray[Any, Any]:
    """``values`` of any array library as a NumPy array in main memory (gradients are left behind)."""
    if isinstance(values, np.ndarray):
        return values
    if hasattr(values, "detach"):
        values = values.detach().cpu()
    try:
        return np.asarray(values)
    except (TypeError, ValueError, RuntimeError):
        return np.from_dlpack(values)


def known(values: Any) -> np.ndarray[Any, Any] | None:
    """`to_numpy`, or None for an array under a tracer, which has a shape and a type but no values yet.

    Under a tracer, libraries refuse to give numbers, each with an error of its own.
    """
    try:
        return to_numpy(values)
    except Exception:
        return None


def to_dtype(values: Any) -> np.dtype[Any]:
    """The NumPy dtype that corresponds to that of an array of any library."""
    name = str(values.dtype).rsplit(".", 1)[-1]
    try:
        return np.dtype(name)
    except TypeError:
        raise InputError(f"samples of type {values.dtype} are not supported: use float32 or uint8") from None
