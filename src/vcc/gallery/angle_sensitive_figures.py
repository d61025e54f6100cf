"""Figures of angle-sensitive pixels: responses, the recording, views and refocused images."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vcc.shapes.directional import AngularFringes
from vcc.showcase import figures

Array = NDArray[np.float64]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
NAMES = ("0", "π", "π/2", "3π/2")
PIECE = 12
"""Tiles across the enlarged piece of the recording."""


def response_figure(
    measured: tuple[Array, Array, Array], tile: Sequence[Sequence[AngularFringes]], aperture: float
) -> figures.Figure:
    """Responses against the angle, and those of all pixels of a tile over the aperture.

    Args:
        measured: angles in radians, responses, and those of the formula, (phases, places).
        tile: rows of columns.
        aperture: its width over its distance from the sensor.
    """
    angles, found, _ = measured
    figure = figures.new_figure(11.5, 4.6)
    parts = figure.add_gridspec(1, 2, width_ratios=(1.35, 1))
    left, right = (figure.add_subfigure(parts[0, n]) for n in (0, 1))
    axes = left.subplots()
    fine = np.linspace(angles.min(), angles.max(), 500)
    for each, name, colour, places, values in zip(tile[0], NAMES, COLOURS, angles, found, strict=True):
        axes.plot(np.degrees(fine), each(np.tan(fine), 0.0), color=colour, linewidth=1)
        axes.plot(np.degrees(places), values, "o", color=colour, markersize=3.5, label=f"α = {name}")
    figures.label(axes, "angle of incidence θ [degrees]", "share of the light that is recorded")
    axes.set_ylim(0, 1.18)
    axes.legend(ncols=len(NAMES), loc="upper center", frameon=False, fontsize=figures.LABEL)
    slopes = (np.arange(60) / 59 - 0.5) * aperture
    grid = right.subplots(len(tile), len(tile[0]))
    for r, row in enumerate(tile):
        for c, each in enumerate(row):
            figures.put(
                grid[r, c],
                each(slopes[None, :], slopes[:, None]).astype(np.float32),
                f"α = {NAMES[c]}" if r == 0 else "",
            )
        grid[r, 0].set_ylabel(
            f"{np.degrees(row[0].rotation):.0f}°, β = {row[0].frequency:.0f}", fontsize=figures.LABEL
        )
    return figure


def recording_figure(upright: Array, views: Array, tile: int) -> figures.Figure:
    """The recording, and the piece in which directions differ most.

    Args:
        upright: the recording, 1 for white.
        views: true views, (v, u, rows, columns, channels).
        tile: pixels across.
    """
    from scipy.ndimage import uniform_filter

    differ = uniform_filter(views.var(axis=(0, 1)).mean(axis=2), PIECE, mode="constant")
    half = PIECE // 2
    inside = differ[half:-half, half:-half]
    row, column = (int(n) for n in np.unravel_index(np.argmax(inside), inside.shape))
    piece = figures.Crop(row * tile, column * tile, PIECE * tile)
    shown = figures.values_shown(upright)
    title = f"whole: {shown.shape[0]}×{shown.shape[1]} pixels"
    return figures.enlarged(shown, piece, (title, f"the marked piece: {PIECE}×{PIECE} tiles"))


def views_figure(columns: dict[str, tuple[NDArray[np.floating], Array | None]], white: float) -> figures.Figure:
    """The views at the left and the right end of the middle row.

    Args:
        columns: titles, and for each views (v, u, rows, columns, channels) and their decibels, (v, u).
        white: radiance.
    """
    some = next(iter(columns.values()))[0]
    middle, count = some.shape[0] // 2, some.shape[1]
    rows = [
        [
            (
                title if decibels is None else f"{title}: {decibels[middle, number]:.1f} dB",
                figures.values_shown(views[middle, number], white),
            )
            for title, (views, decibels) in columns.items()
        ]
        for number in (0, count - 1)
    ]
    return table(rows, ("left view", "right view"))


def table(rows: Sequence[Sequence[tuple[str, figures.Shown]]], labels: Sequence[str]) -> figures.Figure:
    """Pictures in rows, each below its title."""
    height, width = rows[0][0][1].shape[:2]
    return figures.table((11.5, len(rows) * (11.2 / len(rows[0]) * height / width + 0.3)), rows, labels)
