"""The demo's contact sheet: its pictures on one sheet, from top to bottom."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vcc.demo.report import Timing
from vcc.showcase.bench import Bench
from vcc.showcase.figures import SheetRow, contact_sheet
from vcc.showcase.words import away, duration, length

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MASK_TITLES = {"cosine": "cosine mask near the sensor", "coded": "coded mask half-way"}


def truth_in_words(bench: Bench) -> str:
    """A description of the reference of the pinhole image."""
    if bench.scene is not None:
        return "the scene’s closed form, traced through the pinhole at 4×4 points a pixel"
    return "a cubic spline through the view at the pinhole (no truth is known between its samples)"


def drawn_sheet(folder: Path, bench: Bench, psnr: dict[str, float], timings: Sequence[Timing]) -> Figure:
    """The sheet of the pictures in the folder."""
    nv, nu, nt, ns = bench.light_field.shape[:4]
    whose = "a built-in scene" if bench.scene is not None else "your light field"
    decibels = ", ".join(f"{name} {value:.1f} dB" for name, value in psnr.items())
    rows = [
        (
            f"The light field: {whose}, {nv}×{nu} views of {nt}×{ns} pixels",
            "Three views of a row, and the slice through all views along the dashed line: slope shows distance.",
            {"light-field-views": ""},
        ),
        (
            "Example 1: a conventional camera; only the sensor moves",
            f"f = {length(bench.focal_length)}, lens {length(bench.diameter)} wide; one exposure.",
            {
                "example-1-focused-near": f"focused near, {away(bench.near)}",
                "example-1-focused-middle": f"focused in the middle, {away(bench.middle)}",
                "example-1-focused-far": f"focused far, {away(bench.far)}",
            },
        ),
        (
            "The conventional camera in phase space (position u across, slope s up)",
            "A point is a line, sheared by lens and flight; sharp where it stands upright. Left: parallel light "
            "(blue) and a near point (orange), the paper’s Figure 4(c). Right: a row of pixels.",
            {"example-1-phase-space-points": "", "example-1-phase-space-scene": ""},
        ),
        (
            f"Example 2: a mask between lens and sensor{_compared(timings)}",
            "Cosine: the picture carries directions as a modulation. Coded: what is out of focus shows the mask. "
            "Exposed twice as long as Example 1.",
            {f"example-2-{name}": title for name, title in MASK_TITLES.items()}
            | {"example-2-close-ups": "close-ups"},
        ),
        (
            "The cameras from the side",
            "Without a mask, and with the coded mask half-way; rays end where a mask stops them.",
            {"example-1-camera": "", "example-2-coded-camera": ""},
        ),
        (
            "The paper’s own check: a simulated pinhole picture against the truth",
            f"Truth: {truth_in_words(bench)}. {decibels}",
            {"check-sharp": "simulated pinhole picture, sharp", "check-close-ups": "close-ups"},
        ),
    ]
    return contact_sheet(
        "Virtual Computational Camera",
        [
            SheetRow(title, text, [(words, folder / f"{file}.png") for file, words in pictures.items()])
            for title, text, pictures in rows
        ],
    )


def _compared(timings: Sequence[Timing]) -> str:
    """The time of the first image comparable to the paper's 8 minutes, as text; empty without one."""
    for timing in timings:
        if timing.compared:
            return f"; {duration(timing.first)} ({timing.speed_up} faster than the paper’s 8 min)"
    return ""
