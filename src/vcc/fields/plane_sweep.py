"""The disparities of a light field's middle view by a sweep of planes.

Disparities are tried one after the other, and each pixel takes the one at which the views of the middle row and
column agree best with the middle one. What a nearer thing hides from views on one side is seen from the other, so
that of the views to the left and to the right, and of those above and below, the half that agrees better counts
(Kang, Szeliski and Chai 2001). Costs are gathered over a window that follows the borders in the middle view, a
guided filter (Hosni et al. 2013), and a parabola through the lowest one and its neighbours gives the disparity
between steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.checks import above_zero
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.memory import check_memory
from vcc.base.progress import Progress, tell
from vcc.base.version import VERSION
from vcc.fields.cross import Arm, Array, Views, arms, check_axes, cubic_weights, moved, range_to_search
from vcc.fields.disparity import DisparityMaps

NOISE = 0.006
"""Of full scale, on the square-root scale: what 8 bits and JPEG leave."""
FINEST_STEP = 0.06
"""Of a sweep, pixels per view."""
MOST_STEPS = 160
"""Of a sweep for what lies between views."""
WINDOW = 11
"""Pixels a side, over which costs are gathered."""
_TRUNCATION = 0.02  # of full scale, likewise: a difference that is no match, whatever its size
_SOFTNESSES = 9  # fractions of a pixel in sixteenths, up to a half


@dataclass(frozen=True, eq=False, repr=False)
class Swept(Brief):
    """What a sweep finds.

    Args:
        disparity: pixels per view along u, of the middle view, shape (t, s).
        confidence: 0 to 1, likewise: how much better that disparity is than any that is not its neighbour.
    """

    disparity: Array
    confidence: Array


def plane_sweep(
    light_field: Views,
    disparity_range: tuple[float, float] | None = None,
    *,
    step: float = FINEST_STEP,
    window: int = WINDOW,
    memory_limit: int | None = None,
    progress: Progress | None = None,
) -> Swept:
    """The disparity at which the views agree best with the middle one, pixel by pixel.

    Args:
        light_field: two views at least, its views' axes along those of its pixels.
        disparity_range: (lowest, highest) disparity along u to be tried, pixels per view; see `range_to_search`.
        step: between the disparities tried, pixels per view.
        window: side of the window, pixels, an odd number.
        memory_limit: bytes that the costs and the work may take; None takes `vcc.base.memory.MEMORY_LIMIT`.
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
    # Three steps at the least: a parabola needs neighbours.
    tried = np.linspace(low, high, max(3, math.ceil((high - low) / step) + 1))
    cross = arms(light_field)
    rows, columns = grid.shape[2:4]
    needed = 4 * (rows * columns * (len(tried) + 24) + 3 * sum(arm.views.size for arm in cross))
    what = f"a sweep of {len(tried)} disparities over {rows}×{columns} pixels"
    check_memory(needed, memory_limit, what, "give a part of the light field")
    rows_of_views = [_RowOfViews(arm) for arm in cross]
    gather = _GuidedFilter(cross[0].views[cross[0].middle].mean(axis=0), window)
    costs = np.empty((len(tried), rows, columns), np.float32)
    for n, disparity in enumerate(tried):
        disagreement = [
            row.disagreement(grid.disparities_along(row.arm.along, disparity)) for row in rows_of_views
        ]
        costs[n] = gather(np.sum(disagreement, axis=0))
        tell(progress, n + 1, len(tried))
    best = costs.argmin(axis=0)
    offset, lowest = _parabola(costs, best)
    found = tried[best] + offset * (tried[1] - tried[0])
    return Swept(found.astype(np.float32), _clarity(costs, best, lowest, float(tried[1] - tried[0])))


def disparity_maps(
    light_field: Views, *, memory_limit: int | None = None, progress: Progress | None = None
) -> DisparityMaps:
    """The disparities by which cameras look between views: a plane sweep's, of the middle view.

    A light field calls this when ``between_views="depth"`` first asks for its disparities, and keeps the result.

    Args:
        light_field: in memory, or on disk: then its middle row and column of views are read.
        memory_limit: see `vcc.recover.depth_by_plane_sweep`.
        progress: see there.

    Raises:
        InputError: as there; the way out is to give the disparities with the light field.
    """
    try:
        low, high = range_to_search(light_field.grid, None)
        # Neighbouring views are half a view from what is looked at in between: a parabola through steps of this
        # size finds disparities to a hundredth or two of a pixel, which is half of that on the sensor.
        step = max(FINEST_STEP, (high - low) / MOST_STEPS)
        found = plane_sweep(light_field, step=step, memory_limit=memory_limit, progress=progress)
    except InputError as error:
        raise InputError(
            f"disparities between views cannot be found: {error}. Or give them: vcc.LightField(…, disparity=maps)"
        ) from error
    source = f"found for the middle view by vcc.recover.depth_by_plane_sweep, steps of {step:.2g}, vcc {VERSION}"
    return DisparityMaps(found.disparity[None], (light_field.grid.middle_view,), source)


class _RowOfViews:
    """A row or column of views, to be compared with its middle view."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self._softened = _as_if_moved(arm.views[arm.middle], arm.axis)

    def disagreement(self, disparity: NDArray[np.float64]) -> Array:
        """How much the better half of the views differs from the middle one at a disparity along them, (t, s)."""
        from scipy.ndimage import uniform_filter

        views, middle = self.arm.views, self.arm.middle
        halves: list[Array] = []
        for side in (range(middle), range(middle + 1, len(views))):
            if not side:
                continue
            total = np.zeros(views.shape[2:], np.float32)
            for n in side:
                shift = -float(disparity) * (n - middle)
                # Interpolation softens noise, most so between pixels: unless the middle view is as soft,
                # disparities that fall there seem to fit better.
                alike = self._softened[round(16 * abs(shift - round(shift)))]
                difference = np.abs(moved(views[n], shift, self.arm.axis) - alike)
                total += np.minimum(difference, _TRUNCATION).mean(axis=0)
            halves.append(uniform_filter(total / len(side), 3, mode="nearest"))
        return np.asarray(np.minimum.reduce(halves), np.float32)


def _as_if_moved(view: Array, axis: int) -> list[Array]:
    """A view where it is, but as soft as interpolation makes it by fractions 0, 1/16 … 1/2 of a pixel."""
    from scipy.ndimage import correlate1d

    frequencies = 2 * np.pi * np.fft.rfftfreq(64)
    softened = []
    for level in range(_SOFTNESSES):
        weights = cubic_weights(level / 16)
        passes = np.abs(sum(weight * np.exp(1j * n * frequencies) for n, weight in enumerate(weights)))
        kernel = np.fft.fftshift(np.fft.irfft(passes))[32 - 6 : 32 + 7]
        softened.append(correlate1d(view, kernel / kernel.sum(), axis=axis, mode="nearest"))
    return softened


class _GuidedFilter:
    """A mean over a window that does not reach over borders of a guide (He, Sun and Tang 2013)."""

    def __init__(self, guide: Array, window: int) -> None:
        self._guide, self._window = guide, window
        self._mean = self._box(guide)
        # Contrast of this variance, and more, counts as a border.
        self._variance = self._box(guide**2) - self._mean**2 + np.float32(0.02**2)

    def __call__(self, values: Array) -> Array:
        mean = self._box(values)
        a = (self._box(self._guide * values) - self._mean * mean) / self._variance
        b = mean - a * self._mean
        return self._box(a) * self._guide + self._box(b)

    def _box(self, values: Array) -> Array:
        from scipy.ndimage import uniform_filter

        return np.asarray(uniform_filter(values, self._window, mode="nearest"), np.float32)


def _parabola(costs: Array, best: NDArray[np.intp]) -> tuple[Array, Array]:
    """Where, in steps from ``best``, the parabola through it and its neighbours is lowest, and that cost."""
    inner = np.clip(best, 1, len(costs) - 2)
    before, here, after = (np.take_along_axis(costs, (inner + n)[None], axis=0)[0] for n in (-1, 0, 1))
    bend = before - 2 * here + after
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.where(bend > 0, (before - after) / (2 * bend), 0)
    # At the ends of the range there is one neighbour only: the disparity stays where it is.
    offset = np.where(inner == best, np.clip(offset, -0.5, 0.5), 0).astype(np.float32)
    return offset, np.take_along_axis(costs, best[None], axis=0)[0]


def _clarity(costs: Array, best: NDArray[np.intp], lowest: Array, step: float) -> Array:
    """How much better the best disparity is than any that is not its neighbour, 0 to 1."""
    apart = max(2, math.ceil(0.3 / step)) if step > 0 else 2
    rival = np.full(lowest.shape, np.inf, np.float32)
    for n, cost in enumerate(costs):
        np.minimum(rival, cost, out=rival, where=np.abs(best - n) >= apart)
    noise = np.float32(NOISE)
    clarity = 1 - (np.maximum(lowest, 0) + noise) / (np.maximum(rival, 0) + noise)
    # Nothing else was tried: nothing is known of how clear it is.
    return np.where(np.isfinite(rival), np.clip(clarity, 0, 1), 0).astype(np.float32)
