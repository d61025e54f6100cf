"""The disparities of a light field's middle view by a plane sweep.

Disparities are tested one after the other, and each pixel gets the one at which the views of the middle row and
column agree best with the middle view. A point that a nearer object hides from views on one side is visible from
the other, so only the better half of the views to the left and right, and of the views above and below, counts
(Kang, Szeliski and Chai 2001). Costs are aggregated over a small window that follows the edges in the middle view,
a guided filter (Hosni et al. 2013), and then along paths on which a jump of disparity costs more than a constant
one: semi-global matching (Hirschmüller 2008). A parabola through the lowest cost and its neighbours gives the
disparity between steps, and averaging over the same surface smooths it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import lazy_import
from vcc.base.affine import Affine
from vcc.base.checks import above_zero
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.memory import check_memory
from vcc.base.progress import Progress
from vcc.base.version import VERSION
from vcc.fields.cross import (
    LARGEST_RANGE,
    MARGIN,
    Arm,
    Array,
    Views,
    arms,
    check_axes,
    cubic_weights,
    range_to_search,
)
from vcc.fields.disparity import DisparityMaps
from vcc.fields.grid import Block, Grid
from vcc.fields.sampled import to_numpy

NOISE = 0.006
"""Share of full scale, on the square-root scale: remaining noise of 8 bits and JPEG."""
FINEST_STEP = 0.06
"""Step of a sweep, pixels per view."""
MOST_STEPS = 240
"""Steps of a sweep for views in between."""
WINDOW = 3
"""Pixels a side, over which costs are aggregated."""
SURROUNDINGS = 9
"""Pixels a side, over which the agreement of views is averaged."""
UNMATCHED = 0.8
"""Disagreement above which views show different objects: unrelated textures reach 0.9, edges at their true
disparity 0.7."""
MANY_UNMATCHED = 0.02
"""Share of pixels without agreement at any disparity above which a wider range is searched, with a warning."""
_FEWER = 0.75  # a wider range is used if at most this share of the lost pixels remains
_COARSE_SIDE, _COARSEST = 48, 4
"""Smallest side in pixels of the coarse views for the first sweep over a wide range, and largest reduction."""
_UNSURE = 0.2
"""Confidence up to which the first sweep does not affect the range: dark walls have 0.1 anywhere."""
_OUTERMOST = 0.005
"""Share of the confidence that is left out at either end of the range found by the first sweep."""
_SOFTNESSES = 9  # fractions of a pixel in sixteenths, up to a half


@dataclass(frozen=True, eq=False, repr=False)
class Swept(Brief):
    """Result of a sweep.

    Args:
        disparity: pixels per view along u, of the middle view, shape (t, s).
        confidence: 0 to 1, likewise: how much better this disparity is than any that is not its neighbour.
        disagreement: 0 to 1, likewise: difference of the views from the middle one; 1 means unrelated.
    """

    disparity: Array
    confidence: Array
    disagreement: Array


def plane_sweep(
    light_field: Views,
    disparity_range: tuple[float, float] | None = None,
    *,
    step: float = FINEST_STEP,
    window: int = WINDOW,
    memory_limit: int | None = None,
    progress: Progress | None = None,
) -> Swept:
    """The disparity at which the views agree best with the middle one, for each pixel.

    Args:
        light_field: at least two views, with view axes parallel to the pixel axes.
        disparity_range: (lowest, highest) disparity along u to be tested, pixels per view; see `range_to_search`.
        step: between the disparities tested, pixels per view.
        window: side of the window, pixels, an odd number.
        memory_limit: bytes for costs and temporary arrays; None uses `vcc.base.memory.MEMORY_LIMIT`.
        progress: called with (done, total) as the sweep advances.

    Raises:
        InputError: see `vcc.recover.depth_by_plane_sweep`.
    """
    step = above_zero("step", step)
    if not (window >= 1 and window % 2 == 1):
        raise InputError(f"window is an odd number of pixels, 1 or more, not {window}")
    grid = light_field.grid
    check_axes(grid, fewest=2)
    low, high = range_to_search(grid, disparity_range)
    # At least three steps: a parabola needs neighbours.
    tried = np.linspace(low, high, max(3, math.ceil((high - low) / step) + 1))
    cross = arms(light_field)
    return sweep_of(cross, cross[0].views[cross[0].middle], grid, tried, window, memory_limit, progress)


def sweep_of(
    cross: Sequence[Arm],
    compared: Array,
    grid: Grid,
    tried: NDArray[np.float64],
    window: int = WINDOW,
    memory_limit: int | None = None,
    progress: Progress | None = None,
) -> Swept:
    """The disparity at which the views of one or more arms agree best with one view, for each pixel.

    Args:
        cross: views on both sides of the compared one.
        compared: this view, (channels, t, s), on the scale of the arms.
        grid: of the views, which converts disparities along u to those along v.
        tried: disparities along u, at least three, evenly spaced.
        window: see `plane_sweep`.
        memory_limit: see `plane_sweep`.
        progress: see `plane_sweep`.

    Raises:
        InputError: more memory needed than allowed.
    """
    rows, columns = compared.shape[1:]
    needed = 4 * (rows * columns * (2 * len(tried) + 24) + 3 * sum(arm.views.size for arm in cross))
    what = f"a sweep of {len(tried)} disparities over {rows}×{columns} pixels"
    check_memory(needed, memory_limit, what, "give a part of the light field")
    softened = [(arm, _as_if_moved(compared, arm.axis)) for arm in cross]
    by_axis = {axis: np.asarray(grid.disparities_along(axis, tried), float) for axis in ("u", "v")}
    along = [np.stack([by_axis[arm.along], by_axis["v" if arm.along == "u" else "u"]], axis=1) for arm in cross]
    guide = compared.mean(axis=0)
    kernels = lazy_import.module("vcc.engines.sweep_kernels")
    costs = kernels.costs(softened, along, guide, window, progress)
    step = float(tried[1] - tried[0])
    best = kernels.smoothest(costs, guide, step, len(cross))
    offset, bend, lowest = _parabola(costs, best)
    found = kernels.means_of_surfaces((tried[best] + step * offset).astype(np.float32), bend)
    lowest = np.maximum(lowest, 0)  # a guided filter can be negative
    clarity = _clarity(costs, best, lowest, step)
    most = np.float32(kernels.TRUNCATION * len(cross))
    return Swept(found, clarity, np.clip(around(lowest) / most, 0, 1))


def range_of_sweep(
    light_field: Views, given: tuple[float, float] | None, memory_limit: int | None = None
) -> tuple[float, float]:
    """(lowest, highest) disparity along u to be tested: as passed, as stored in the grid, or estimated.

    Sweeps of coarser views search beyond the measured range, which misses small objects and large steps. The
    range is doubled while many pixels agree at no disparity, or best at an end; a wider range is used if it has
    fewer of them.

    Args:
        light_field: as for `plane_sweep`.
        given: by a user, used without a check against the views.
        memory_limit: see `plane_sweep`.

    Raises:
        InputError: see `range_to_search`.
    """
    grid = light_field.grid
    low, high = range_to_search(grid, given)
    if given is not None:
        return low, high
    # Not beyond infinity, unless a tenth of the measured range lies on either side of it.
    infinity, length = grid.disparity_of(math.inf), high - low
    before, behind = high - infinity, infinity - low
    ends_there = math.isfinite(infinity) and min(before, behind) < 0.1 * length + MARGIN
    farthest = min(LARGEST_RANGE, max(grid.shape[2:4]) / 4)
    lowest = infinity if ends_there and before >= behind else min(low, -farthest)
    highest = infinity if ends_there and before < behind else max(high, farthest)

    def within(least: float, most: float) -> tuple[float, float]:
        return max(least, lowest), min(most, highest)

    if grid.disparity_range is not None:
        return within(low - MARGIN, high + MARGIN)
    reach = (lowest if lowest == infinity else low - length, highest if highest == infinity else high + length)
    tried = within(min(reach[0], low), max(reach[1], high))
    seen, lost = _first_look(light_field, tried, memory_limit)
    ends = tried
    while lost > MANY_UNMATCHED and ends != (lowest, highest):
        length = ends[1] - ends[0]
        ends = within(ends[0] - length / 2, ends[1] + length / 2)
        wider, left = _first_look(light_field, ends, memory_limit)
        if left < _FEWER * lost:
            seen, lost = wider, left
    return within(min(low, seen[0] - MARGIN), max(high, seen[1] + MARGIN))


def _first_look(
    light_field: Views, ends: tuple[float, float], memory_limit: int | None
) -> tuple[tuple[float, float], float]:
    """(lowest, highest) of a sweep of coarser views, weighted by confidence, without outliers; and the share lost.

    Lost are pixels at which views agree nowhere, or best at an end of the sweep.
    """
    factor = min(max(min(light_field.grid.shape[2:4]) // _COARSE_SIDE, 1), _COARSEST)
    coarse = (ends[0] / factor, ends[1] / factor)
    step = max(FINEST_STEP, (coarse[1] - coarse[0]) / MOST_STEPS)
    found = plane_sweep(_Coarser(light_field, factor), coarse, step=step, memory_limit=memory_limit)
    at_an_end = ((found.disparity <= coarse[0]) | (found.disparity >= coarse[1])) & (found.confidence > 0)
    lost = float(((found.disagreement > UNMATCHED) | at_an_end).mean())
    low, high = ends_of(found)
    return (factor * low, factor * high), lost


def ends_of(found: Swept) -> tuple[float, float]:
    """(lowest, highest) disparity of a sweep, weighted by confidence, without outliers; (inf, −inf) if unknown."""
    order = np.argsort(found.disparity, axis=None)
    sure = np.maximum(found.confidence - _UNSURE, 0)
    share = np.cumsum((sure if sure.any() else found.confidence).ravel()[order], dtype=np.float64)
    if share[-1] == 0:
        return math.inf, -math.inf
    places = np.searchsorted(share, share[-1] * np.array([_OUTERMOST, 1 - _OUTERMOST]))
    low, high = found.disparity.ravel()[order[places]].astype(np.float64)
    return float(low), float(high)


@dataclass(frozen=True, eq=False)
class _Coarser:
    """A light field with ``factor`` × ``factor`` pixels averaged into one; reads whole views."""

    whole: Views
    factor: int

    @property
    def grid(self) -> Grid:
        """The grid of the coarser pixels."""
        fine, n = self.whole.grid, self.factor
        shape = (*fine.shape[:2], fine.shape[2] // n, fine.shape[3] // n, *fine.shape[4:])
        middle = (n - 1) / 2
        frame = fine.frame @ Affine.translation(0, 0, middle, middle) @ Affine.scaling(1, 1, n, n)
        return replace(fine, shape=shape, frame=frame)

    def read(self, block: Block) -> Array:
        """The samples of whole views."""
        n, (rows, columns) = self.factor, self.grid.shape[2:4]
        views = to_numpy(self.whole.read(replace(block, pixel_rows=(0, rows * n), pixel_columns=(0, columns * n))))
        parts = views.reshape(*views.shape[:2], rows, n, columns, n, *views.shape[4:])
        return np.asarray(parts.mean(axis=(3, 5), dtype=np.float32))


def disparity_maps(light_field: Views, *, progress: Progress | None = None) -> DisparityMaps:
    """The disparities for views in between: from a plane sweep, of the middle view.

    A light field calls this when ``between_views="depth"`` first needs its disparities, and caches the result.

    Args:
        light_field: in memory, or stored: then its middle row and column of views are read.
        progress: see `vcc.recover.depth_by_plane_sweep`.

    Raises:
        InputError: as there; the message suggests passing the disparities with the light field.
    """
    try:
        low, high = ends = range_of_sweep(light_field, None)
        # Neighbouring views are half a view from the views in between: a parabola through steps of this
        # size estimates disparities to a hundredth or two of a pixel, which is half of that on the sensor.
        step = max(FINEST_STEP, (high - low) / MOST_STEPS)
        found = plane_sweep(light_field, ends, step=step, progress=progress)
    except InputError as error:
        raise InputError(
            f"disparities between views cannot be found: {error}. Or give them: vcc.LightField(…, disparity=maps)"
        ) from error
    source = f"found for the middle view by vcc.recover.depth_by_plane_sweep, steps of {step:.2g}, vcc {VERSION}"
    unmatched = float((found.disagreement > UNMATCHED).mean())
    return DisparityMaps(found.disparity[None], (light_field.grid.middle_view,), source, unmatched=unmatched)


def _as_if_moved(view: Array, axis: int) -> Array:
    """A view, not moved, but blurred as by interpolation at fractions 0, 1/16 … 1/2 of a pixel."""
    from scipy.ndimage import correlate1d

    frequencies = 2 * np.pi * np.fft.rfftfreq(64)
    softened = []
    for level in range(_SOFTNESSES):
        weights = cubic_weights(level / 16)
        passes = np.abs(sum(weight * np.exp(1j * n * frequencies) for n, weight in enumerate(weights)))
        kernel = np.fft.fftshift(np.fft.irfft(passes))[32 - 6 : 32 + 7]
        softened.append(correlate1d(view, kernel / kernel.sum(), axis=axis, mode="nearest"))
    return np.array(softened, np.float32)


def _parabola(costs: Array, best: NDArray[np.int32]) -> tuple[Array, Array, Array]:
    """The minimum of a parabola through ``best`` and its neighbours, in steps from it; its bend; the best cost.

    At the ends of the range there is only one neighbour: the offset and the bend are 0.
    """
    inner = np.clip(best, 1, len(costs) - 2)
    before, here, after = (np.take_along_axis(costs, (inner + n)[None], axis=0)[0] for n in (-1, 0, 1))
    bend = np.where(inner == best, np.maximum(before - 2 * here + after, 0), 0).astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.where(bend > 0, np.clip((before - after) / (2 * bend), -0.5, 0.5), 0).astype(np.float32)
    return offset, bend, np.take_along_axis(costs, best[None], axis=0)[0]


def _clarity(costs: Array, best: NDArray[np.int32], lowest: Array, step: float) -> Array:
    """How much better the best disparity is than any that is not its neighbour, 0 to 1."""
    apart = max(2, math.ceil(0.3 / step)) if step > 0 else 2
    rival = np.full(lowest.shape, np.inf, np.float32)
    for n, cost in enumerate(costs):
        np.minimum(rival, np.maximum(cost, 0), out=rival, where=np.abs(best - n) >= apart)
    # If no other disparity was tested, the confidence is unknown.
    rival, noise = np.where(np.isfinite(rival), rival, lowest), np.float32(NOISE)
    return np.asarray(np.clip(1 - (around(lowest) + noise) / (around(rival) + noise), 0, 1), np.float32)


def around(values: NDArray[Any]) -> NDArray[Any]:
    """The mean over a pixel's surroundings."""
    from scipy.ndimage import uniform_filter

    return np.asarray(uniform_filter(values, SURROUNDINGS, mode="nearest"))
