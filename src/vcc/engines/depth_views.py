"""Views between views, made when they are asked for: each looks at the scene through the maps of its neighbours.

A picture in between is made of the view nearest to it: a ray marches through that view's map of disparities until
it meets a surface (`vcc.engines.depth_kernels`), and takes the colour that the view shows there, by cubic
interpolation. What a near thing hides from that view is taken from the other views around, as far as they show it,
by their nearness in views; what none of them shows goes on as the far side's border. Occlusion is thus that of the
maps, and for given maps each picture is linear in the samples.

(Marching through height fields: Policarpo, Oliveira and Comba 2005. Views as warped neighbours with what they lack
filled from others: Chen and Williams 1993.)
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError, ResultWarning
from vcc.engines.depth_tables import Found, March, View, Way
from vcc.engines.late import compiled
from vcc.light_field import LightField
from vcc.plan.depth_rule import ViewsBetween
from vcc.plan.how import cores

if TYPE_CHECKING:
    from vcc.engines import EngineName, Progress
    from vcc.plan.footprints.model import Plan
    from vcc.run.pieces import Unread

Array = NDArray[np.float32]

BAND = 64
"""Rows of a picture that a thread makes at once."""
TEAR = 0.25
"""Pixels per view of disparity from pixel to pixel from which on a map shows a border, not a slanted surface."""
IN_MEMORY = 2**28
"""Bytes of denser views that are there at a time, of a light field in memory."""
HELD = 0.25
"""Share of the memory that views and maps, kept to be used again, may take."""
MUCH_UNSEEN = 0.01
"""Share of the samples between views that no view shows, from which on a warning says it."""


class InMemory:
    """Samples in memory, given view by view.

    Args:
        values: (v, u, t, s[, channels]).
    """

    stored_bytes = 0

    def __init__(self, values: NDArray[Any]) -> None:
        self.values = values

    @property
    def outline(self) -> LightField:
        """Their shape and type; where they lie, plans know."""
        return LightField(self.values, Affine.identity(), _checked=True)

    def check_complete(self) -> None:
        """All views are there."""

    def linear_view(self, row: int, column: int, first: int, stop: int) -> NDArray[Any]:
        """Rows of pixels of one view."""
        return self.values[row, column, first:stop]


class _Held:
    """The last few of what takes time to make, within some bytes."""

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
    """A light field with views in between, read like one on disk.

    Args:
        source: the light field that there is: samples in memory, or a light field on disk.
        between: how views in between are made.
        memory_limit: bytes; a share of it is for views and maps kept to be used again.
        threads: how many work at once; None takes `vcc.plan.how.cores`. The views are the same.
    """

    def __init__(
        self,
        source: Unread,
        between: ViewsBetween,
        memory_limit: float = IN_MEMORY,
        threads: int | None = None,
    ) -> None:
        self._source, self._given, self._between = source, source.outline.shape, between
        self._threads = threads
        self.unseen = 0
        """Samples made so far that no view shows."""
        self.made = 0
        """Samples made so far, channels not counted."""
        self._views = _Held(self._read, HELD * memory_limit)
        self._own = {view: number for number, view in enumerate(between.maps.views)}

    @property
    def outline(self) -> LightField:
        """The shape and type of the denser light field; where it lies, plans know."""
        shape = self._between.shape(self._given)
        return LightField(np.broadcast_to(np.float32(0), shape), Affine.identity())

    @property
    def stored_bytes(self) -> int:
        """Bytes on disk of the light field that there is."""
        return self._source.stored_bytes

    def check_complete(self) -> None:
        """Refuse a light field of which views are missing."""
        self._source.check_complete()

    def linear_view(self, row: int, column: int, first: int, stop: int) -> Array:
        """Rows of pixels of one view of the denser grid, radiance; see `vcc.run.pieces.Unread`."""
        down, across = self._between.times
        j, i = row // down, column // across
        y, x = (row % down + 0.5) / down - 0.5, (column % across + 0.5) / across - 0.5
        channels = self._given[4:]
        scale = np.float32(1 / self._between.full_scale)
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
        view = self._source.linear_view(row, column, 0, self._given[2])
        view = np.ascontiguousarray(view, dtype=np.float32 if view.dtype == np.float16 else view.dtype)
        nearness = self._nearness(row, column)
        return _seen_as(view.reshape(*view.shape[:2], -1), nearness)

    def _nearness(self, row: int, column: int) -> Array:
        """sign · disparity of a view: its own map's, or what the nearest map shows from there."""
        sign, maps = np.float32(self._between.parallax.sign), self._between.maps
        if (row, column) in self._own:
            return np.ascontiguousarray(sign * maps.values[self._own[row, column]])
        places = np.array(maps.views)
        nearest = int(np.argmin(np.abs(places - (row, column)).sum(axis=1)))
        known = np.ascontiguousarray(sign * maps.values[nearest])
        away = (row - places[nearest, 0], column - places[nearest, 1])
        shown, _ = self._looked_from(_seen_as(known[..., None], known), away, (), 0, len(known))
        return shown[..., 0]

    def _looked_from(
        self, view: View, away: tuple[float, float], others: Any, first: int, stop: int
    ) -> tuple[Array, int]:
        """The picture (rows, s, channels) from a place (down, across) views away, and how many pixels are unseen.

        ``others``: more views, as far away as they are, and weights, for what the first one does not show.
        """
        out = np.zeros((stop - first, *view.samples.shape[1:]), dtype=np.float32)
        found = Found(first, out, *np.empty((3, *out.shape[:2]), dtype=np.float32))
        with ThreadPoolExecutor(self._threads or cores()) as pool:
            self._look(pool, view, away, 1.0, False, found)
            if (found.seen < 0).any():
                for other, distance, weight in others:
                    self._look(pool, other, distance, weight, True, found)
        return out, int(compiled("vcc.engines.depth_kernels").share_out(out, found.seen))

    def _look(
        self,
        pool: ThreadPoolExecutor,
        view: View,
        away: tuple[float, float],
        weight: float,
        torn_only: bool,
        found: Found,
    ) -> None:
        kernels, parallax, nearness = compiled("vcc.engines.depth_kernels"), self._between.parallax, view.nearness
        down, across = away
        way = Way(float(across), float(down), parallax.sign, parallax.along_v)
        bounds = kernels.march_bounds(view.ranges, way)
        ends = np.linspace(parallax.sign * float(nearness.min()), parallax.sign * float(nearness.max()), 17)
        steps = np.abs(np.diff(parallax.down(ends))).max() / max(np.abs(np.diff(ends)).max(), 1e-30)
        march = March(way, max(abs(across), abs(down) * float(steps)), TEAR)

        def band(start: int) -> None:
            rows = (part[start : start + BAND] for part in found[1:])
            kernels.look_from_between(view, bounds, march, weight, torn_only, Found(found.first + start, *rows))

        list(pool.map(band, range(0, len(found.out), BAND)))


def _seen_as(samples: NDArray[Any], nearness: Array) -> View:
    """A view (t, s, channels) of which the nearness (t, s) is known."""
    return View(samples, nearness, compiled("vcc.engines.depth_kernels").tile_ranges(nearness))


def run(plan: Plan, values: Any, engine: EngineName, progress: Progress | None = None) -> Any:
    """The picture of samples (v, u, t, s[, channels]) by a plan with ``views_between``; see `run_plan`.

    Raises:
        InputError: samples that are no NumPy array.
    """
    from vcc.run.pieces import record_pieces

    if not isinstance(values, np.ndarray):
        raise InputError(
            f"between_views='depth' takes NumPy arrays, not {type(values).__module__}.{type(values).__name__}: "
            "pass light_field.replaced(numpy.asarray(values)), or between_views='auto', which carries gradients"
        )
    source = InMemory(values)
    return record_pieces(plan, source, engine=engine, memory_limit=_room(plan, source), progress=progress).values


def _room(plan: Plan, source: InMemory) -> int:
    """Bytes for blocks of denser views: as few as serve well, and as many as a block of one view takes."""
    from vcc.run.pieces import least_memory

    return max(IN_MEMORY, math.ceil(least_memory(plan, source.outline) / (1 - HELD)))


def warn_of_unseen(views: DenserViews, stacklevel: int) -> None:
    """Say it if much of what lies between views is seen by none."""
    import warnings

    if views.made and views.unseen > MUCH_UNSEEN * views.made:
        warnings.warn(
            f"{views.unseen / views.made:.1%} of the samples between views show what none of the views around "
            "them shows (it is hidden there, or outside their pictures): borders go on there",
            ResultWarning,
            stacklevel=stacklevel,
        )
