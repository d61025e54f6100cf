"""Views from places where there was no camera, from views at any places of one plane.

The disparities of a few views are found by plane sweeps against the views around them. A missing view is then
rendered as views in between are (`vcc.engines.depth_views`): from the nearest view, and from the next ones where a
near object hides the scene from it. The error is estimated by cross-validation: given views are rendered in the
same way from the others and compared with their samples.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from vcc.base import lazy_import
from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.memory import check_memory
from vcc.base.progress import Progress, tell
from vcc.fields.cross import LARGEST_RANGE, MARGIN, Arm
from vcc.fields.disparity import DisparityMaps
from vcc.fields.grid import Grid
from vcc.fields.plane_sweep import FINEST_STEP, MOST_STEPS, Swept, ends_of, sweep_of
from vcc.plan.depth_rule import Parallax
from vcc.plan.how import cores

Array = NDArray[np.float32]

SWEEPS = 3
"""Largest number of views whose disparities are found; the others are given those of the nearest one, moved."""
ON_A_SIDE = 4
"""Largest number of views on each side that a view is compared with."""
BESIDE = 4
"""Views after the nearest one that show what it does not."""
TESTED = 40
"""Largest number of given views that are rendered from the others to estimate the error."""
_COARSE_SIDE, _COARSEST = 128, 8  # pixels of the views of the first sweep, and their largest reduction
_WIDER = 0.2
"""Share by which the range of the first sweep is widened: it leaves out small objects."""


class ScatteredViews:
    """Views of one scene at known places of a plane, with the rays of one grid.

    Args:
        pictures: radiance, (n, t, s, channels), float32. Where ``covered``, the last channel is the share of each
            pixel that the view shows, and the others are multiplied by it.
        places: (row, column) of each view in the grid, (n, 2); fractions and places outside are allowed.
        grid: of the light field to be made; its view axes must be parallel to its pixel axes.
        covered: see ``pictures``.
        memory_limit: bytes; None uses `vcc.base.memory.MEMORY_LIMIT`.

    Raises:
        InputError: a single view, a frame whose axes are mixed, or more memory needed than allowed.
    """

    def __init__(
        self,
        pictures: Array,
        places: NDArray[np.float64],
        grid: Grid,
        *,
        covered: bool = False,
        memory_limit: int | None = None,
    ) -> None:
        if len(pictures) < 2:
            raise InputError(
                "one view has no parallax, so that no other can be made from it: vcc synth depth makes a "
                "light field "
                "of one picture and its depth map"
            )
        self._parallax = Parallax.of(grid.frame)
        # Beside the pictures: their maps, and an image in the making.
        check_memory(4 * pictures[..., 0].size, memory_limit, "disparities of the views", "use smaller pictures")
        self.pictures, self.places, self.grid = pictures, np.asarray(places, float), grid
        self._covered, self._memory_limit = covered, memory_limit
        self._nearness: dict[int, Array] = {}
        self.unmatched = 0.0

    # --- disparities ---

    @property
    @cached
    def swept(self) -> tuple[int, ...]:
        """Numbers of the views whose disparities are found: spread evenly, the most central one first."""
        middle = (self.places.min(axis=0) + self.places.max(axis=0)) / 2
        chosen = [int(np.argmin(np.linalg.norm(self.places - middle, axis=1)))]
        away = np.linalg.norm(self.places - self.places[chosen[0]], axis=1)
        while len(chosen) < min(SWEEPS, len(self.places)) and away.max() > 1:
            chosen.append(int(away.argmax()))
            away = np.minimum(away, np.linalg.norm(self.places - self.places[chosen[-1]], axis=1))
        return tuple(chosen)

    def find_disparities(self, progress: Progress | None = None) -> DisparityMaps:
        """The disparities of the views of `swept`, pixels per view of the grid along u.

        Args:
            progress: called with (done, total).

        Raises:
            InputError: more memory needed than allowed, or views without texture.
        """
        low, high = self.grid.disparity_range or self._first_look()
        step = max(FINEST_STEP, (high - low) / MOST_STEPS)
        tried = np.linspace(low, high, max(3, math.ceil((high - low) / step) + 1))
        found = []
        for done, number in enumerate(self.swept):
            found.append(self._sweep(number, tried, 1))
            tell(progress, done + 1, len(self.swept))
        unmatched = float(np.mean([(one.disagreement > 0.8).mean() for one in found]))
        views = tuple((float(row), float(column)) for row, column in self.places[list(self.swept)])
        source = f"found by plane sweeps of {len(views)} views, steps of {step:.2g}"
        maps = DisparityMaps(np.stack([one.disparity for one in found]), views, source, unmatched=unmatched)
        sign = np.float32(self._parallax.sign)
        self._nearness = {number: sign * one for number, one in zip(self.swept, maps.values, strict=True)}
        return maps

    def _first_look(self) -> tuple[float, float]:
        """The range of disparities, by a sweep of coarser views over all that are likely."""
        factor = min(max(min(self.pictures.shape[1:3]) // _COARSE_SIDE, 1), _COARSEST)
        nearest = min(np.partition(np.linalg.norm(self.places - self.places[n], axis=1), 1)[1] for n in self.swept)
        farthest = min(LARGEST_RANGE, max(self.pictures.shape[1:3]) / 4) / max(nearest, 1)
        reach = farthest / factor
        tried = np.linspace(-reach, reach, max(3, min(MOST_STEPS, math.ceil(2 * reach / FINEST_STEP))))
        low, high = ends_of(self._sweep(self.swept[0], tried, factor))
        if not low <= high:
            raise InputError(
                "the range of disparities cannot be measured (too little texture): give disparity_range=(low, "
                "high)"
            )
        margin = MARGIN + _WIDER * factor * (high - low)
        return factor * low - margin, factor * high + margin

    def _sweep(self, number: int, tried: NDArray[np.float64], factor: int) -> Swept:
        """Disparities of one view, in pixels that are ``factor`` times as wide."""
        compared = self._root(number, factor)
        bright = max(float(np.percentile(compared, 99)), 1e-12)
        steps, cross = self.places - self.places[number], []
        along_u = np.abs(steps[:, 1]) >= np.abs(steps[:, 0])
        for axis, own, mine in (("u", 1, along_u), ("v", 0, ~along_u)):
            chosen = [
                n
                for side in (steps[:, own] < 0, steps[:, own] > 0)
                for n in _spread(np.flatnonzero(side & mine), np.linalg.norm(steps, axis=1))
            ]
            if chosen:
                views = np.stack([self._root(n, factor) for n in chosen]) / np.float32(bright)
                cross.append(Arm(views, axis, steps[chosen][:, [own, 1 - own]]))  # type: ignore[arg-type]
        grid = self.grid
        return sweep_of(cross, compared / np.float32(bright), grid, tried, memory_limit=self._memory_limit)

    def _root(self, number: int, factor: int) -> Array:
        """(channels, t, s) of a view: square roots, see `vcc.fields.cross.Arm`."""
        view = self.pictures[number, ..., :-1] if self._covered else self.pictures[number]
        rows, columns = (n // factor for n in view.shape[:2])
        parts = view[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor, -1)
        return np.ascontiguousarray(np.moveaxis(np.sqrt(np.maximum(parts.mean(axis=(1, 3)), 0)), 2, 0))

    def _nearness_of(self, number: int) -> Array:
        """sign · disparity of a view: found, or that of the nearest one as seen from its place."""
        if number not in self._nearness:
            known = min(self.swept, key=lambda n: float(np.linalg.norm(self.places[n] - self.places[number])))
            down, across = self.places[number] - self.places[known]
            self._nearness[number] = lazy_import.module("vcc.engines.depth_views").seen_from(
                self._parallax, self._nearness[known], (down, across), cores()
            )
        return self._nearness[number]

    # --- views ---

    def view_at(self, place: tuple[float, float], without: int | None = None) -> tuple[Array, NDArray[np.bool_]]:
        """The view from a place, (t, s, channels), and the pixels that a view shows, (t, s).

        Pixels that none shows continue what is around them, or are 0 beyond the pictures' borders.

        Args:
            place: (row, column) in the grid.
            without: number of a view that is not used.
        """
        engine = lazy_import.module("vcc.engines.depth_views")
        away = np.array(place, float) - self.places
        distances = np.linalg.norm(away, axis=1)
        order = [int(n) for n in np.argsort(distances, kind="stable") if n != without][: 1 + BESIDE]
        first, *others = order
        rows = self.pictures.shape[1]

        def view(number: int) -> tuple[object, tuple[float, float]]:
            nearness = self._nearness_of(number)
            return engine.seen_as(self.pictures[number], nearness), (
                float(away[number, 0]),
                float(away[number, 1]),
            )

        looking = engine.Looking(self._parallax, cores(), *view(first), 0, rows)
        found = looking.found
        if self._covered:
            found.seen[(found.seen > 0) & (found.out[..., -1] < 0.99)] = -1
        looking.complete((*view(n), 1 / max(distances[n], 1e-3) ** 2) for n in others)
        shown = found.seen != -1
        looking.unseen()
        picture = found.out
        if self._covered:
            share = picture[..., -1:]
            shown &= share[..., 0] > 0.1
            picture = np.where(share > 0.01, picture[..., :-1] / np.maximum(share, 0.01), 0)
        return np.maximum(picture, 0), shown

    def errors(self, progress: Progress | None = None) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Numbers of tested views, and the root mean square error of each if rendered from the others.

        Args:
            progress: called with (done, total).
        """
        if len(self.pictures) < 3:
            return np.zeros(0, np.intp), np.zeros(0)
        tested = np.unique(np.linspace(0, len(self.pictures) - 1, min(len(self.pictures), TESTED)).astype(np.intp))
        errors = np.zeros(len(tested))
        for done, number in enumerate(tested):
            row, column = self.places[number]
            made, shown = self.view_at((float(row), float(column)), without=int(number))
            true = self.pictures[number]
            if self._covered:
                shown = shown & (true[..., -1] > 0.99)
                true = true[..., :-1]
            errors[done] = math.sqrt(float(np.mean((made - true)[shown] ** 2))) if shown.any() else math.inf
            tell(progress, done + 1, len(tested))
        return tested, errors

    def expected_error(
        self, places: Sequence[tuple[float, float]], tested: NDArray[np.intp], errors: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The root mean square error to expect of rendered views; NaN if no view was tested.

        That of the four nearest tested views, times how much farther away the nearest given view is.

        Args:
            places: (row, column) of the views.
            tested: see `errors`.
            errors: see `errors`.
        """
        if not len(tested):
            return np.full(len(places), np.nan)
        apart = np.linalg.norm(self.places[:, None] - self.places[None], axis=2)
        np.fill_diagonal(apart, np.inf)
        gaps = apart.min(axis=1)[tested]
        expected = []
        for place in places:
            distances = np.linalg.norm(self.places - place, axis=1)
            nearest = np.argsort(distances[tested], kind="stable")[:4]
            farther = np.maximum(distances.min() / gaps[nearest], 1)
            expected.append(math.sqrt(float(np.mean((errors[nearest] * farther) ** 2))))
        return np.array(expected)


def _spread(numbers: NDArray[np.intp], distances: NDArray[np.float64]) -> Iterator[int]:
    """At most `ON_A_SIDE` of some views, from the nearest to the farthest in even steps."""
    order = numbers[np.argsort(distances[numbers], kind="stable")]
    if len(order) > ON_A_SIDE:
        order = order[np.linspace(0, len(order) - 1, ON_A_SIDE).round().astype(int)]
    return iter(order.tolist())
