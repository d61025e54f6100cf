"""Which views of a light field were recorded, and how good those are that were not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.values import Value
from vcc.base.words import first_few
from vcc.fields.sampled import as_slice

Missing = Literal["refuse", "fill", "dark"]
"""Views missing in a grid: raise an error, render them from the others, or leave them dark."""


@dataclass(frozen=True, eq=False, repr=False)
class Filling(Value, Brief):
    """Recorded and filled views of a grid, each array of shape (rows, columns) of views.

    Args:
        given: whether each view was recorded.
        error: estimated root mean square error of each view, in radiance (1 is full scale for integers): 0 for
            recorded views; NaN where there is no estimate, and for dark views.
        unseen: share of each view's pixels that no recorded view shows; 1 for dark views.

    Raises:
        InputError: arrays of different shapes, or values out of range.
    """

    given: NDArray[np.bool_]
    error: NDArray[np.float64]
    unseen: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.given.ndim != 2 or not self.given.shape == self.error.shape == self.unseen.shape:
            raise InputError(
                "a filling has one entry for each view, (rows, columns), in given, error and unseen, not "
                f"{self.given.shape}, {self.error.shape} and {self.unseen.shape}"
            )
        if (
            self.given.dtype != np.bool_
            or (self.error < 0).any()
            or not ((self.unseen >= 0) & (self.unseen <= 1)).all()
        ):
            raise InputError("of a filling, given is true or false, error is 0 or more and unseen from 0 to 1")

    @classmethod
    def of_lists(cls, stated: Any, where: str) -> Filling:
        """From lists as `lists` returns them, read from a file.

        Raises:
            InputError: other data; the message starts with ``where``.
        """
        try:
            given, unseen = (np.array(stated[name]) for name in ("given", "unseen"))
            error = np.array([[math.nan if one is None else one for one in row] for row in stated["error"]], float)
            return cls(given, error, unseen.astype(np.float64))
        except (InputError, TypeError, ValueError, KeyError, IndexError) as error:
            raise InputError(f"{where}: its filled views cannot be used: {error}") from None

    def lists(self) -> dict[str, Any]:
        """As JSON data; None for unknown errors."""
        error = [[None if math.isnan(one) else one for one in row] for row in self.error.tolist()]
        return {"given": self.given.tolist(), "error": error, "unseen": self.unseen.tolist()}

    def piece(self, ranges: Sequence[range]) -> Filling:
        """The filling of a piece of the light field.

        Args:
            ranges: the indices that the piece takes along (v, u, …).
        """
        part = as_slice(ranges[0]), as_slice(ranges[1])
        return Filling(self.given[part], self.error[part], self.unseen[part])

    def moved(self, steps: Sequence[str]) -> Filling:
        """After views were rearranged by "flip-rows", "flip-columns" and "transpose"."""
        parts: list[NDArray[Any]] = [self.given, self.error, self.unseen]
        for step in steps:
            parts = [part.T if step == "transpose" else np.flip(part, int(step != "flip-rows")) for part in parts]
        return Filling(*parts)

    @property
    def words(self) -> str:
        """Which views were filled, and how well, as a sentence; empty if all were recorded."""
        made = ~self.given
        if not made.any():
            return ""
        places = [(int(row), int(column)) for row, column in np.argwhere(made)]
        named = f"{len(places)} of the {made.size} views, by (row, column): {first_few(places, len(places))}"
        if (self.unseen[made] == 1).all():
            return f"not recorded, and dark, are {named}"
        said = f"not recorded, but rendered from the others by depth, are {named}"
        known = self.error[made][np.isfinite(self.error[made])]
        rms = math.sqrt(float(np.mean(known**2))) if known.size else math.nan
        error = f"{rms:.2g} in radiance" if known.size else "unknown: too few views to test"
        worst = f", at most {known.max():.2g}" if known.size else ""
        share = f"{self.unseen[made].mean():.2%} of their pixels no view shows"
        return f"{said}. Estimated error (root mean square): {error}{worst}; {share}"


def filling_of(given: ArrayLike, error: ArrayLike, unseen: ArrayLike) -> Filling:
    """A `Filling` from values for the views that are not given, in their order row by row."""
    there = np.asarray(given, np.bool_)
    errors, shares = np.zeros(there.shape), np.zeros(there.shape)
    errors[~there], shares[~there] = error, unseen
    return Filling(there, errors, shares)
