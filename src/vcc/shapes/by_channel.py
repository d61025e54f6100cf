"""A pattern for each channel of light: colour filters side by side, apertures of several colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.shapes.patterns import Array, Cells, Pattern


@dataclass(frozen=True, repr=False)
class ByChannel(Brief, Pattern):
    """A pattern for each channel of a light field; of a `vcc.Mask` with several spectra, one for each of these.

    Called as a pattern, it is the mean of all of them: what drawings show.

    Args:
        patterns: one or more; ``Mask`` makes them of an array (rows, columns, channels).

    Raises:
        InputError: no pattern at all, or what is none.
    """

    patterns: tuple[Pattern, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "patterns", tuple(self.patterns))
        if not self.patterns or not all(isinstance(each, Pattern) for each in self.patterns):
            raise InputError("ByChannel has a pattern of vcc.patterns for each channel")

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) of the largest, metres."""
        width, height = zip(*(pattern.size for pattern in self.patterns), strict=True)
        return max(width), max(height)

    def described(self) -> str:
        """The number of patterns and the first of them as text."""
        return f"of {len(self.patterns)} channels, the first {self.patterns[0].described()}"

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """The mean of the channels' transmissions."""
        return np.asarray(sum(pattern(x, y) for pattern in self.patterns)) / len(self.patterns)

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """The mean of the channels' means."""
        means = (pattern.mean(x, y, width, height) for pattern in self.patterns)
        return np.asarray(sum(means)) / len(self.patterns)


def weighted(patterns: list[tuple[float, Pattern]]) -> list[tuple[float, Pattern]]:
    """A weighted sum of patterns, as few of them as can be: cells side by side on one sheet are added.

    Args:
        patterns: weights, and what they weight.

    Returns:
        As given; without those that pass nothing.
    """
    open_ones = [(weight, one) for weight, one in patterns if weight > 0 and not _opaque(one)]
    cells = [(weight, one) for weight, one in open_ones if isinstance(one, Cells)]
    if len(cells) < 2 or len(cells) < len(open_ones):
        return open_ones
    first = cells[0][1]
    sheets = {(one.values.shape, one.size, one.middle) for _, one in cells}
    total = np.sum([weight * one.values for weight, one in cells], axis=0)
    if len(sheets) > 1 or total.max() > 1 + 1e-9:
        return open_ones
    return [(1.0, Cells(np.minimum(total, 1), first.width, first.height, first.middle))]


def _opaque(pattern: Pattern) -> bool:
    return isinstance(pattern, Cells) and not pattern.values.any()
