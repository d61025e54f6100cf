"""The common data structure: values on a regular grid plus an affine frame from index to physical coordinates.

A light field, an image and a mask texture are all of this kind, so slicing one means slicing its values
and composing its frame with a translation: a piece of a light field is a light field, in its place.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from types import EllipsisType
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError

Index = slice | EllipsisType

LIGHT_FIELD_AXES = (1, 0, 3, 2)
"""The value axis of each frame index (i, j, k, l): values are stored (v, u, t, s)."""
IMAGE_AXES = (1, 0)
"""The value axis of each frame index (column, row): values are stored rows before columns."""


def indices(
    shape: tuple[int, ...], frame: Affine, index: Index | tuple[Index, ...], axes: tuple[int, ...], what: str
) -> tuple[Affine, tuple[range, ...]]:
    """The frame of a piece of values on a grid, and the indices that it takes along each axis.

    Args:
        shape: of the values, whose first axes are the sampled ones.
        frame: maps indices of the values to physical coordinates.
        index: slices, one for each leading axis of the values; an ellipsis stands for whole axes.
        axes: the value axis of each frame index.
        what: name of the object in an error.

    Raises:
        InputError: an integer or array index (which would remove an axis), too many slices, or an empty result.
    """
    parts: list[Any] = list(index) if isinstance(index, tuple) else [index]
    ellipses = [place for place, part in enumerate(parts) if part is Ellipsis]
    if len(ellipses) > 1:
        raise InputError(f"{what} takes at most one ellipsis as an index")
    for place in ellipses:
        parts[place : place + 1] = [slice(None)] * (len(shape) - len(parts) + 1)
    if len(parts) > len(shape):
        raise InputError(f"{what} has {len(shape)} axes, and {len(parts)} slices were given")
    for part in parts:
        if not isinstance(part, slice):
            raise InputError(
                f"{what} keeps all of its axes and is indexed by slices, not by {part!r}: "
                f"write {part!r}:{part + 1}"
                if isinstance(part, int)
                else f"{what} is indexed by slices, not by {part!r}"
            )
    parts += [slice(None)] * (len(shape) - len(parts))
    ranges = tuple(range(*part.indices(size)) for part, size in zip(parts, shape, strict=True))
    for axis, chosen in enumerate(ranges):
        if len(chosen) == 0:
            raise InputError(f"slice {parts[axis]} of axis {axis} of {what} (size {shape[axis]}) is empty")
    starts = [ranges[axis].start for axis in axes]
    steps = [ranges[axis].step for axis in axes]
    return frame @ Affine.translation(*starts) @ Affine.scaling(*steps), ranges


def taken(values: Any, ranges: Sequence[range]) -> Any:
    """The values at these indices along each axis: a view, not a copy."""
    return values[tuple(as_slice(part) for part in ranges)]


def as_slice(part: range) -> slice:
    """The slice that takes a range of indices from an axis that begins at 0."""
    return slice(part.start, None if part.stop < 0 else part.stop, part.step)


def to_numpy(values: Any) -> np.ndarray[Any, Any]:
    """``values`` of any array library as a NumPy array in main memory (without gradients)."""
    if isinstance(values, np.ndarray):
        return values
    if hasattr(values, "detach"):
        values = values.detach().cpu()
    try:
        return np.asarray(values)
    except (TypeError, ValueError, RuntimeError):
        return np.from_dlpack(values)


def as_array(values: Any, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
    """Values for ``__array__``: the result of ``numpy.asarray`` for an object with these values.

    Args:
        values: an array of any library.
        dtype: None for their own.
        copy: None copies if needed, False never, True always.

    Raises:
        ValueError: a copy is needed but not allowed, as in NumPy.
    """
    if copy is not False or isinstance(values, np.ndarray):
        return np.array(to_numpy(values), dtype=dtype, copy=copy)
    try:
        shared = np.from_dlpack(values.detach() if hasattr(values, "detach") else values)
    except (AttributeError, BufferError, RuntimeError, TypeError) as error:  # each library raises another type
        raise ValueError(f"numbers of {type(values).__module__} cannot be had without a copy: {error}") from error
    return np.array(shared, dtype=dtype, copy=False)


def library_of(values: Any) -> str:
    """The name of the package of an array, or of an object that computes with it: "numpy", "torch", …"""
    return type(values).__module__.split(".")[0]


def has_values(values: Any) -> bool:
    """Whether an array has readable values: under a tracer it has only a shape and a type.

    Detects JAX's tracers (``jit``, ``grad``, ``vmap``), and PyTorch's fake and meta tensors and its transforms.
    """
    kind = type(values)
    if isinstance(values, np.ndarray):
        return True
    if kind.__module__.startswith("jax"):
        jax = sys.modules["jax"]
        return not isinstance(values, jax.core.Tracer)
    if hasattr(values, "detach"):
        torch = sys.modules["torch"]
        wrapped = torch._C._functorch.is_functorch_wrapped_tensor(values)
        return not (wrapped or values.device.type == "meta" or kind.__name__ == "FakeTensor")
    return True


def to_dtype(values: Any) -> np.dtype[Any]:
    """The NumPy dtype that corresponds to the type of an array of any library."""
    name = str(values.dtype).rsplit(".", 1)[-1]
    try:
        return np.dtype(name)
    except TypeError:
        raise InputError(f"samples of type {values.dtype} are not supported: use float32 or uint8") from None
