"""Scattering by a thin element, by position: the paper's third category (section 3.2.2, eq. 6)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.lookup import bilinear
from vcc.base.values import Value
from vcc.shapes.kernels import SUM_TOLERANCE, Kernel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SheetMap(Value):
    """Numbers that vary over a sheet, given in cells side by side: bilinear between the cells' middles.

    Values are constant from the middles of the outermost cells outwards.

    Args:
        values: one number a cell, shape (rows, columns), or n maps over the same sheet, (n, rows, columns);
            row 0 at the top.
        width: of the sheet, metres.
        height: of the sheet, metres.

    Raises:
        InputError: another number of axes, no cells, numbers that are not finite, a size of zero or less.
    """

    values: Array
    width: float
    height: float

    def __post_init__(self) -> None:
        needed = "numbers (rows, columns) or (n, rows, columns)"
        maps = (None,) * (np.ndim(self.values) == 3)
        values = checks.array("a map over a sheet", self.values, needed, *maps, None, None)
        checks.sizes("a map over a sheet", width=self.width, height=self.height)
        object.__setattr__(self, "values", values)

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Values at places x, y in metres relative to the sheet's middle (arrays that broadcast to a shape S).

        Returns:
            Shape S for one map, (*S, n) for n maps.
        """
        rows, columns = self.values.shape[-2:]
        column = np.asarray(x, dtype=np.float64) * (columns / self.width) + (columns - 1) / 2
        row = np.asarray(y, dtype=np.float64) * (rows / self.height) + (rows - 1) / 2
        return bilinear(np.moveaxis(self.values, 0, -1) if self.values.ndim == 3 else self.values, row, column)

    def __repr__(self) -> str:
        cells = "×".join(map(str, self.values.shape))
        return f"SheetMap({cells}, width={self.width!r}, height={self.height!r})"


@dataclass(frozen=True)
class Scatter:
    """The scattering of an element by position: one kernel, or kernels mixed and stretched over the surface.

    D(δ | x, y) = Σₙ weightₙ(x, y) · Dₙ(δ / width(x, y)) / width(x, y)².

    Args:
        kernels: the kernels Dₙ.
        weights: the kernels' shares by position, with sum 1: a `SheetMap` of n maps, or a function of
            (x, y) in metres that returns shape (..., n); None for one kernel.
        width: the factor, 0 or more, by which the kernels are stretched, by position: a `SheetMap`, or a
            function of (x, y) in metres; None stretches nothing.
        largest_width: the largest value of ``width``.

    Raises:
        InputError: no kernels, objects of another type, several kernels without weights, a largest width that is
            negative or not finite.
    """

    kernels: tuple[Kernel, ...]
    weights: SheetMap | Callable[[Array, Array], Array] | None = None
    width: SheetMap | Callable[[Array, Array], Array] | None = None
    largest_width: float = 1.0

    def __post_init__(self) -> None:
        kernels = tuple(self.kernels)
        for kernel in kernels:
            if not isinstance(kernel, Kernel):
                raise InputError(f"a scatterer's kernels are vcc.kernels.Kernel, not {type(kernel).__name__}")
        if not kernels:
            raise InputError("a scatterer has one kernel or more, not none")
        if len(kernels) > 1 and self.weights is None:
            raise InputError(f"a scatterer of {len(kernels)} kernels needs weights: how they mix, by position")
        checks.zero_or_more("largest_width", self.largest_width)
        object.__setattr__(self, "kernels", kernels)

    @property
    def uniform(self) -> bool:
        """Whether the kernel is the same everywhere."""
        return self.weights is None and self.width is None

    @property
    def reach(self) -> tuple[float, float]:
        """Largest (|δs|, |δt|) of all kernels."""
        reaches = np.array([kernel.reach for kernel in self.kernels]) * self.largest_width
        s, t = reaches.max(axis=0)
        return float(s), float(t)

    def at(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Shares of the kernels and their stretch at places x, y in metres (arrays that broadcast to shape S).

        Returns:
            Shares, shape (*S, n), and widths, shape S.

        Raises:
            InputError: weights or widths of a wrong shape, not finite or negative, weights whose sum is not
                1, a width above ``largest_width``.
        """
        x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        shares, widths = np.ones((*x.shape, len(self.kernels))), np.ones(x.shape)
        if self.weights is not None:
            shares = _checked("weights", self.weights(x, y), shares.shape)
            if abs(shares.sum(axis=-1) - 1).max(initial=0.0) > SUM_TOLERANCE:
                raise InputError(f"weights of kernels sum to 1 at each place, not to {shares.sum(axis=-1)}")
        if self.width is not None:
            widths = _checked("width", self.width(x, y), widths.shape)
            if widths.max(initial=0.0) > self.largest_width * (1 + SUM_TOLERANCE):
                raise InputError(f"width reaches {widths.max():g}, above its largest_width {self.largest_width:g}")
        return shares, widths


def _checked(name: str, given: ArrayLike, shape: tuple[int, ...]) -> Array:
    values = np.asarray(given, dtype=np.float64)
    if values.shape != shape:
        raise InputError(f"{name} of a scatterer returned shape {values.shape} where {shape} was asked for")
    checks.all_finite(f"{name} of a scatterer", values)
    checks.none_negative(f"{name} of a scatterer", values)
    return values
