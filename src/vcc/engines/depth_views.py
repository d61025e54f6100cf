"""Views between views, rendered on demand from the disparity maps of neighbouring views.

An image in between is rendered from the view nearest to it. A ray marches through that view's disparity map
until it meets a surface (`vcc.engines.depth_kernels`), and takes the colour of the view there, by cubic
interpolation. Places that a near object hides from this view are taken from the other views around that show
them, weighted by their distance in views. Places that no view shows continue the border of the far side. So
occlusion follows the maps, and for given maps each image is linear in the samples.

(Marching through height fields: Policarpo, Oliveira and Comba 2005. Warped neighbouring views with gaps filled
from others: Chen and Williams 1993.)
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.workers import Workers
from vcc.engines import depth_kernels as kernels
from vcc.fields.grid import Block, Grid
from vcc.fields.samples import Samples
from vcc.plan.depth_rule import Parallax, ViewsBetween

Array = NDArray[np.float32]

BAND = 64
"""Rows of an image that a thread computes at a time."""
TEAR = 0.25
"""Disparity step between neighbouring pixels, in pixels per view, above which a map has a border, not a slope."""


class _Held:
    """A cache of the views used last, with a memory limit."""

    def __init__(self, make: Callable[[int, int], View], limit: float) -> None:
        self._make, self._limit = make, limit
        self._there: OrderedDict[tuple[int, int], View] = OrderedDict()
        self._bytes = 0

    def __call__(self, row: int, column: int) -> View:
        key = (row, column)
        if key in self._there:
            self._there.move_to_end(key)
            return self._there[key]
        made = self._make(row, column)
        self._bytes += sum(part.nbytes for part in made)
        self._there[key] = made
        while self._bytes > self._limit and len(self._there) > 1:
            _, oldest = self._there.popitem(last=False)
            self._bytes -= sum(part.nbytes for part in oldest)
        return made


class DenserViews:
    """A light field with views in between, read like a stored one.

    Args:
        source: the given light field, in memory or on disk.
        between: how views in between are computed.
        threads: number of threads that compute a view.
        held: memory limit in bytes for cached views and maps.
    """

    def __init__(self, source: Samples, between: ViewsBetween, threads: int, held: float) -> None:
        self._source, self._given, self._between = source, source.grid.shape, between
        self._threads = threads
        self.unseen = 0
        """Number of samples made so far that no view shows."""
        self.made = 0
        """Number of samples made so far, without channels."""
        self._views = _Held(self._read, held)
        self._own = {view: number for number, view in enumerate(between.maps.views)}

    @property
    def grid(self) -> Grid:
        """Shape and type of the denser light field, without its frame, which is part of the plan."""
        return Grid(self._between.shape(self._given), Affine.identity(), np.dtype(np.float32))

    def whole(self) -> None:
        """Do nothing: views are made when they are read."""

    @property
    def stored_bytes(self) -> int:
        """Bytes on disk of the given light field."""
        return self._source.stored_bytes

    def check_complete(self) -> None:
        """Raise an error if views of the given light field are missing."""
        self._source.check_complete()

    def read(self, block: Block) -> Array:
        """The samples of a block of the denser grid, radiance."""
        (a, b), (c, d), rows, columns = block.ranges
        views = [[self._view(j, i, *rows)[:, slice(*columns)] for i in range(c, d)] for j in range(a, b)]
        return np.stack([np.stack(row) for row in views]) if block.shape[:2] != (1, 1) else views[0][0][None, None]

    def _view(self, row: int, column: int, first: int, stop: int) -> Array:
        """Rows of pixels of one view of the denser grid."""
        down, across = self._between.times
        j, i = row // down, column // across
        y, x = (row % down + 0.5) / down - 0.5, (column % across + 0.5) / across - 0.5
        channels = self._given[4:]
        scale = np.float32(1 / self._source.grid.full_scale)
        view = self._views(j, i)
        if x == 0 and y == 0:
            return np.asarray(view.samples[first:stop].reshape(stop - first, -1, *channels) * scale, np.float32)
        others = [
            (j + b, i + a, (1 - abs(y - b)) * (1 - abs(x - a)))
            for b in {0, int(np.sign(y))}
            for a in {0, int(np.sign(x))}
            if (a or b) and 0 <= j + b < self._given[0] and 0 <= i + a < self._given[1]
        ]
        picture, unseen = self._looked_from(
            view,
            (y, x),
            (
                (self._views(row, column), (y - (row - j), x - (column - i)), weight)
                for row, column, weight in others
            ),
            first,
            stop,
        )
        self.unseen += unseen
        self.made += (stop - first) * picture.shape[1]
        picture *= scale
        return picture.reshape(stop - first, -1, *channels)

    def _read(self, row: int, column: int) -> View:
        whole = Block.all_of(self._given)
        view = self._source.read(replace(whole, rows=(row, row + 1), columns=(column, column + 1)))[0, 0]
        view = np.ascontiguousarray(view, dtype=np.float32 if view.dtype == np.float16 else view.dtype)
        nearness = self._nearness(row, column)
        return seen_as(view.reshape(*view.shape[:2], -1), nearness)

    def _nearness(self, row: int, column: int) -> Array:
        """sign · disparity of a view: from its own map, or rendered from the nearest map."""
        sign, maps = np.float32(self._between.parallax.sign), self._between.maps
        if (row, column) in self._own:
            return np.ascontiguousarray(sign * maps.values[self._own[row, column]])
        places = np.array(maps.views)
        nearest = int(np.argmin(np.abs(places - (row, column)).sum(axis=1)))
        known = np.ascontiguousarray(sign * maps.values[nearest])
        away = (row - places[nearest, 0], column - places[nearest, 1])
        return seen_from(self._between.parallax, known, away, self._threads)

    def _looked_from(
        self, view: View, away: tuple[float, float], others: Any, first: int, stop: int
    ) -> tuple[Array, int]:
        found = Looking(self._between.parallax, self._threads, view, away, first, stop)
        found.complete(others)
        return found.found.out, found.unseen()


def seen_from(parallax: Parallax, nearness: Array, away: tuple[float, float], threads: int) -> Array:
    """A map of nearness, sign · disparity, as seen from a place (down, across) views away."""
    looking = Looking(parallax, threads, seen_as(nearness[..., None], nearness), away, 0, len(nearness))
    looking.unseen()
    return np.ascontiguousarray(looking.found.out[..., 0])


class Looking:
    """Rows of the image from a place between views.

    Args:
        parallax: of the light field.
        threads: number of threads.
        view: the view nearest to the place.
        away: (down, across), views from there to the place.
        first: first row of the image.
        stop: the row after the last.
    """

    def __init__(
        self, parallax: Parallax, threads: int, view: View, away: tuple[float, float], first: int, stop: int
    ) -> None:
        self._parallax, self._threads = parallax, threads
        out = np.zeros((stop - first, *view.samples.shape[1:]), dtype=np.float32)
        self.found = Found(first, out, *np.empty((3, *out.shape[:2]), dtype=np.float32))
        with Workers(threads) as pool:
            self._look(pool, view, away, 1.0, False)

    def complete(self, others: Any) -> None:
        """Add what the first view does not show from others, an iterable of (view, away, weight)."""
        if (self.found.seen < 0).any():
            with Workers(self._threads) as pool:
                for other, distance, weight in others:
                    self._look(pool, other, distance, weight, True)

    def unseen(self) -> int:
        """Number of pixels that no view shows; called once, at the end."""
        return int(kernels.share_out(self.found.out, self.found.seen))

    def _look(self, pool: Workers, view: View, away: tuple[float, float], weight: float, torn_only: bool) -> None:
        parallax, nearness, found = self._parallax, view.nearness, self.found
        down, across = away
        way = Way(float(across), float(down), parallax.sign, parallax.along_v)
        bounds = kernels.march_bounds(view.ranges, way)
        ends = np.linspace(parallax.sign * float(nearness.min()), parallax.sign * float(nearness.max()), 17)
        steps = np.abs(np.diff(parallax.down(ends))).max() / max(np.abs(np.diff(ends)).max(), 1e-30)
        reach = float(max(abs(across), abs(down) * float(steps)))  # a float: kernels are compiled per type
        march = March(way, reach, TEAR)

        def band(start: int) -> None:
            rows = (part[start : start + BAND] for part in found[1:])
            kernels.look_from_between(view, bounds, march, weight, torn_only, Found(found.first + start, *rows))

        list(pool.map(band, range(0, len(found.out), BAND)))


def seen_as(samples: NDArray[Any], nearness: Array) -> View:
    """A `View` from samples (t, s, channels) and nearness (t, s)."""
    return View(samples, nearness, kernels.tile_ranges(nearness))


# --- arguments of the compiled march through disparity maps, for `depth_kernels` ---


class View(NamedTuple):
    """A view and its depth.

    Args:
        samples: (t, s, channels).
        nearness: (t, s), sign · disparity: larger is nearer.
        ranges: (tiles, tiles, 2), the lowest and highest nearness around each tile, see
            `vcc.engines.depth_kernels.tile_ranges`.
    """

    samples: NDArray[Any]
    nearness: Array
    ranges: Array


class Way(NamedTuple):
    """How points move on a view's pixels, seen from a place between views, by their disparities.

    Args:
        columns: columns of views from the view to the place.
        rows: rows of views, likewise.
        sign: of disparities: sign · disparity is nearness.
        along_v: four numbers that convert disparities along u to those along v, see
            `vcc.plan.depth_rule.Parallax`.
    """

    columns: float
    rows: float
    sign: float
    along_v: tuple[float, float, float, float]


class March(NamedTuple):
    """Parameters of a march through a view.

    Args:
        way: see `Way`.
        reach: largest length of a march, in pixels of the view for each pixel per view of disparity.
        tear: step of nearness between neighbouring pixels above which there is a border.
    """

    way: Way
    reach: float
    tear: float


class Found(NamedTuple):
    """Rows of an image between views, and their state.

    Args:
        first: row of the image that is the first one here.
        out: (rows, s, channels), added to.
        seen: (rows, s), 1 if the nearest view shows the place; else −1, minus the weights of other views that
            show it.
        far: (rows, s), nearness of the surface; at tears that of the far side.
        near: (rows, s), likewise of the near side.
    """

    first: int
    out: Array
    seen: Array
    far: Array
    near: Array
