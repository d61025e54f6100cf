"""Plot sampling advice: disparity and blur over distance, and bars of all lengths."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.advice.words import SamplingLimits, distance_in_words
from vcc.base.units import short, um
from vcc.plot import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

LEAST_SHOWN = 0.05
"""Lower end of the logarithmic axis of gaps, near focus, pixels."""
FREE = "#CFE9DE"
"""A pale `style.GREEN`: the range of distances without ghosts."""
BEYOND = 3.0
"""Factor by which the drawn distances extend beyond the scene, on both sides."""


def plot_sampling(advice: SamplingLimits) -> Figure:
    """Draw disparity and blur over distance, the range free of ghosts shaded, and bars of lengths.

    Bars within their limits are blue, others orange; each limit is a line across its bar. If disparity is not
    available (for example behind a lens array), only the bars are drawn.

    Args:
        advice: for a camera and a light field, as from `vcc.analysis.sampling_advice`.

    Returns:
        The figure; ``.savefig(path)`` writes it to a file.
    """
    lengths = [item for item in advice.items.values() if item.unit == "m"]
    height = max(4.2, 1.9 + 0.62 * len(lengths))
    if advice.gaps is None or max(advice.gaps.views) < 2:
        axes = style.new_axes(7.0, height)
        _draw_lengths(axes, advice)
    else:
        left, axes = style.new_axes(12.5, height, 1, 2, width_ratios=(1.25, 1.0))
        _draw_gaps(left, advice)
        _draw_lengths(axes, advice)
    figure: Figure = axes.figure
    return figure


def _draw_gaps(axes: Axes, advice: SamplingLimits) -> None:
    assert advice.gaps is not None
    low, high = _shown(advice)
    distances = np.geomspace(low, high, 1200)
    gaps = advice.gaps.along_axes(1 / distances)
    limit = advice.gaps.limit
    counts = np.array(advice.gaps.views[::-1])
    largest, blur = gaps.max(axis=1), (gaps * counts).max(axis=1)
    top = 2.5 * max(float(blur.max()), limit)
    if advice.free_of_ghosts is not None:
        near, far = advice.free_of_ghosts
        axes.axvspan(max(near, low), min(far, high), color=FREE, lw=0, label="free of ghosts")
    axes.plot(distances, blur, color=style.QUIET, ls="--", lw=1.5, label="blur: all views together")
    axes.plot(distances, largest, color=style.BLUE, lw=2.2, label="from one view to the next")
    axes.axhline(limit, color=style.ORANGE, lw=1.3)
    words = "one pixel" if limit == 1 else f"a sample: {limit:.2g} pixels"
    axes.text(low * 1.03, limit * 1.1, words, ha="left", va="bottom", fontsize=style.SMALL, color=style.ORANGE)
    if advice.depths is not None:
        for name, depth in zip(("nearest", "farthest"), advice.depths, strict=True):
            if not low <= depth <= high:
                continue
            axes.axvline(depth, color=style.INK, lw=0.9, ls=":")
            axes.text(
                depth, LEAST_SHOWN * 1.12, f" {name}\n {distance_in_words(depth)}", ha="left", va="bottom",
                fontsize=style.SMALL, color=style.INK,
            )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(low, high)
    axes.set_ylim(LEAST_SHOWN, top)
    _plain_ticks(axes.xaxis)
    _plain_ticks(axes.yaxis)
    style.tidy(axes, "distance of a point before the camera [m]", "on the sensor [pixels]")
    axes.set_title("A point's picture: from view to view, and whole", fontsize=style.TITLE, color=style.INK)
    _legend_below(axes)


def _shown(advice: SamplingLimits) -> tuple[float, float]:
    """The range of drawn distances, metres."""
    known = [*(advice.depths or ()), *(advice.free_of_ghosts or ())]
    known += [] if advice.focus_distance is None else [advice.focus_distance]
    finite = [distance for distance in known if math.isfinite(distance) and distance > 0] or [1.0]
    low, high = min(finite), max(finite)
    # Distant or infinite points have about the disparity of ten times the farthest finite distance.
    return low / BEYOND, high * (10.0 if any(distance > high for distance in known) else BEYOND)


def _draw_lengths(axes: Axes, advice: SamplingLimits) -> None:
    """Bars of lengths on a logarithmic axis, the sensor's pixel first; each limit a line."""
    items = [item for item in advice.items.values() if item.unit == "m" and item.value > 0]
    pixel = f"pixel of the sensor: {short(advice.pixel, digits=3)}"
    names = [name.replace(" um", " µm") for name in (pixel, *(item.finding for item in items))]
    values = np.array([advice.pixel, *(item.value for item in items)]) / um
    limits = [math.nan, *(item.limit / um for item in items)]
    colours = [style.QUIET, *(style.BLUE if item.fine else style.ORANGE for item in items)]
    finite = np.array([*values, *(limit for limit in limits if math.isfinite(limit) and limit > 0)])
    low, high = finite.min() / 3, finite.max() * 3
    places = np.arange(len(names))
    axes.barh(places, values - low, left=low, height=0.42, color=colours)
    for place, name, limit in zip(places, names, limits, strict=True):
        axes.text(low * 1.04, place - 0.27, name, ha="left", va="bottom", fontsize=style.SMALL, color=style.INK)
        if math.isfinite(limit) and limit > 0:
            axes.plot([limit, limit], [place - 0.24, place + 0.24], color=style.INK, lw=2.2, zorder=3)
    axes.plot([], [], color=style.INK, lw=2.2, label="limit")
    axes.barh([0], [0], color=style.BLUE, label="fine")
    if any(not item.fine for item in items):
        axes.barh([0], [0], color=style.ORANGE, label="watch out")
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.set_ylim(len(names) - 0.4, -0.75)
    axes.set_yticks([])
    _plain_ticks(axes.xaxis)
    style.tidy(axes, "length [µm]", "")
    axes.spines["left"].set_visible(False)
    axes.set_title("Lengths, and what they may be", fontsize=style.TITLE, color=style.INK)
    _legend_below(axes)


def _legend_below(axes: Axes) -> None:
    """A legend below the axes, where it covers nothing."""
    axes.legend(fontsize=style.SMALL, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, frameon=False)


def _plain_ticks(axis: Any) -> None:
    """Ticks as plain numbers, not as powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    steps = (1.0, 2.0, 5.0) if high / low < 1000 else (1.0,)
    axis.set_major_locator(LogLocator(subs=steps, numticks=20))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
