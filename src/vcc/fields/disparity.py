"""The disparities of a light field: displacement of the object at each pixel of a view to the next view.

They belong to the grid of samples, not to its frame: flight, lenses and prisms do not change them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.fields.sampled import as_slice

OUTERMOST = 0.5
"""Per cent of a map's pixels at either end of its disparities that their range excludes, as outliers."""


@dataclass(frozen=True, eq=False, repr=False)
class DisparityMaps(Brief):
    """Maps of the disparities of some views of a light field.

    Args:
        values: pixels per view along u, shape (maps, t, s): a point at column k of view i is at column k − d of
            the next one to the right.
        views: (row, column) of the view of each map; for a piece of a light field these may be views
            outside it, or between its own.
        source: where the maps come from, as text.
        whole_extent: (lowest, highest) that a piece inherits from the whole; None computes it from the values.
        unmatched: the share of pixels at which views differ at the disparity that was found; 0 for given maps.

    Raises:
        InputError: other shapes, or values that are not finite.
    """

    values: NDArray[np.float32]
    views: tuple[tuple[float, float], ...]
    source: str
    whole_extent: tuple[float, float] | None = None
    unmatched: float = 0.0

    def __post_init__(self) -> None:
        if self.values.ndim != 3 or 0 in self.values.shape or len(self.views) != len(self.values):
            raise InputError(
                f"maps of disparities have the shape (maps, t, s) and a view each, not {self.values.shape} and "
                f"{len(self.views)} views"
            )
        if not np.isfinite(self.values).all():
            raise InputError("disparities are finite numbers of pixels per view: fill what is not known first")

    @classmethod
    def given(cls, maps: ArrayLike, shape: Sequence[int]) -> DisparityMaps:
        """From maps that a user passes with a light field.

        Args:
            maps: pixels per view along u, (v, u, t, s) of all views, or (t, s) of the middle one, which is
                ((rows − 1) // 2, (columns − 1) // 2).
            shape: of the light field's samples.

        Raises:
            InputError: another shape, or values that are not finite.
        """
        values = np.asarray(maps, dtype=np.float32)
        rows, columns = shape[:2]
        if values.shape == tuple(shape[2:4]):
            return cls(values[None], (((rows - 1) // 2, (columns - 1) // 2),), "given for the middle view")
        if values.shape == tuple(shape[:4]):
            views = tuple((float(j), float(i)) for j, i in np.ndindex(rows, columns))
            return cls(values.reshape(-1, *shape[2:4]), views, "given for each view")
        raise InputError(
            f"disparity has the shape {values.shape}: it is (v, u, t, s) = {tuple(shape[:4])}, or (t, s) = "
            f"{tuple(shape[2:4])} of the middle view"
        )

    @property
    @cached
    def extent(self) -> tuple[float, float]:
        """(lowest, highest) disparity, pixels per view along u, without the outermost half per cent of each map.

        A piece has the extent of the whole, so that all pieces are treated alike.
        """
        if self.whole_extent is not None:
            return self.whole_extent
        ends = np.percentile(self.values, (OUTERMOST, 100 - OUTERMOST), axis=(1, 2))
        return float(ends[0].min()), float(ends[1].max())

    def piece(self, ranges: Sequence[range]) -> DisparityMaps:
        """The maps of a piece of the light field.

        Args:
            ranges: the indices that the piece takes along (v, u, t, s).
        """
        v, u, t, s = ranges[:4]
        factor = u.step / s.step
        values = self.values[:, as_slice(t), as_slice(s)] * np.float32(factor)
        views = tuple(((row - v.start) / v.step, (column - u.start) / u.step) for row, column in self.views)
        low, high = sorted(end * factor for end in self.extent)
        return DisparityMaps(values, views, self.source, (low, high), self.unmatched)


class Disparities:
    """Depth information of a light field: the range and the maps of disparities, each computed on first use.

    Shared by a light field and all pieces of it, so that each piece is treated like the whole.

    Args:
        known: the maps, if given.
        find: computes them, called with a progress callback or None; without it there are no maps.
        measure: measures (lowest, highest) in pixels per view along u, or None if the views show no
            parallax; without it there is no range.
        whole: the disparities of the light field of which this is a piece, if it is one.
    """

    def __init__(
        self,
        known: DisparityMaps | None = None,
        find: Callable[[Progress | None], DisparityMaps] | None = None,
        measure: Callable[[], tuple[float, float] | None] | None = None,
        whole: Disparities | None = None,
    ) -> None:
        self._maps, self._find, self._whole = known, find, whole
        self._measure = measure
        self._range: tuple[float, float] | None = None
        self._measured = False

    def completed(
        self,
        find: Callable[[Progress | None], DisparityMaps],
        measure: Callable[[], tuple[float, float] | None],
    ) -> Disparities:
        """The same, with functions to find and to measure if they are missing."""
        if (self._find or self._maps) and (self._measure or self._whole):
            return self
        return Disparities(self._maps, self._find or find, self._measure or measure, self._whole)

    def __repr__(self) -> str:
        if self._maps is not None:
            return f"Disparities({self._maps!r})"
        state = "known with the whole" if self.known else "not looked for yet"
        return f"Disparities({state}: .range() and .maps() tell)"

    def __reduce__(self) -> tuple[Any, ...]:
        """The known maps, and the range; other processes compute missing maps from their samples."""
        return _with_default, (self.maps() if self.known else None, self.range())

    @property
    def known(self) -> bool:
        """Whether the maps are available without further work."""
        return self._maps is not None or (self._whole is not None and self._whole.known)

    def range(self) -> tuple[float, float] | None:
        """(lowest, highest) in pixels per view along u, measured on first use; None if there is none."""
        if not self._measured and self._measure is not None:
            self._range, self._measured = self._measure(), True
        return self._range

    def maps(self, progress: Progress | None = None) -> DisparityMaps:
        """The maps, computed on first use.

        Args:
            progress: called with (done, total) while they are computed.

        Raises:
            InputError: as `vcc.recover.depth.disparity_maps`, or a light field without samples.
        """
        if self._maps is None:
            if self._find is None:
                raise InputError("there are no samples to find disparities in: give the light field itself")
            self._maps = self._find(progress)
        return self._maps

    def piece(self, ranges: Sequence[Any]) -> Disparities:
        """The disparities of a piece of the light field, computed from the whole; see `DisparityMaps.piece`."""
        factor = ranges[1].step / ranges[3].step

        def measured() -> tuple[float, float] | None:
            whole = self.range()
            return None if whole is None else scaled(whole, factor)

        return Disparities(find=lambda progress: self.maps(progress).piece(ranges), measure=measured, whole=self)


def _with_default(maps: DisparityMaps | None, ends: tuple[float, float] | None) -> Disparities:
    return Disparities(maps, measure=partial(_same, ends))


def _same(ends: tuple[float, float] | None) -> tuple[float, float] | None:
    return ends


def scaled(ends: tuple[float, float], factor: float) -> tuple[float, float]:
    """Both ends of a range times a factor, the lower one first."""
    low, high = sorted((ends[0] * factor, ends[1] * factor))
    return low, high
