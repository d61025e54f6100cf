"""The report of the demo: time of each step, PSNR of the check, files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

PAPER_SECONDS = 8 * 60.0
"""Time of one image through a mask in the paper (section 4.3): 500×500×20×20, Matlab, a 3 GHz PC of 2009."""


@dataclass(frozen=True)
class Timing:
    """The time of a step.

    Args:
        step: its name.
        first: seconds of the first run.
        again: seconds of a second, identical run; None without one.
        note: a remark.
        compared: whether this is the work that took 8 minutes in the paper: one image from the full light
            field.
    """

    step: str
    first: float
    again: float | None = None
    note: str = ""
    compared: bool = False

    @property
    def times_the_paper(self) -> float | None:
        """Speed-up over the paper's 8 minutes; None for other work."""
        return PAPER_SECONDS / self.first if self.compared else None

    @property
    def speed_up(self) -> str:
        """The same as text; empty for other work."""
        times = self.times_the_paper
        return "" if times is None else f"{float(f'{times:.2g}'):,.0f} ×"


@dataclass(frozen=True)
class DemoReport:
    """The demo's result.

    Args:
        folder: of all files.
        files: all written files, the page and the contact sheet first.
        timings: of the steps, in order.
        psnr: decibels of the simulated pinhole image against ``truth``, by interpolation.
        truth: description of the reference of the pinhole image.
        light_field: description of the light field.
    """

    folder: Path
    files: tuple[Path, ...]
    timings: tuple[Timing, ...]
    psnr: dict[str, float]
    truth: str
    light_field: str

    @property
    def page(self) -> Path:
        """The page to open in a browser."""
        return self.folder / "index.html"

    @property
    def sheet(self) -> Path:
        """The contact sheet, one picture of all pictures."""
        return self.folder / "contact-sheet.png"
