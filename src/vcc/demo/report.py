"""What the demo did: how long each step took, how close the check came, which files there are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

PAPER_SECONDS = 8 * 60.0
"""What one picture through a mask took the paper (section 4.3): 500×500×20×20, Matlab, a 3 GHz PC of 2009."""


@dataclass(frozen=True)
class Timing:
    """How long a step took.

    Args:
        step: in words.
        first: seconds of the first run.
        again: seconds of a second run of the same, where there was one.
        note: what else is to be said.
        compared: whether this is the work that took the paper 8 minutes: one picture from the full field.
    """

    step: str
    first: float
    again: float | None = None
    note: str = ""
    compared: bool = False

    @property
    def times_the_paper(self) -> float | None:
        """How many times faster than the paper's 8 minutes; None for other work."""
        return PAPER_SECONDS / self.first if self.compared else None

    @property
    def speed_up(self) -> str:
        """The same as text; nothing where there is nothing to compare."""
        times = self.times_the_paper
        return "" if times is None else f"{float(f'{times:.2g}'):,.0f} ×"


@dataclass(frozen=True)
class DemoReport:
    """The demo's result.

    Args:
        folder: where everything was written.
        files: all that was written, the page and the contact sheet first.
        timings: of the steps, in order.
        psnr: decibels of the simulated pinhole picture against ``truth``, by interpolation.
        truth: what the pinhole picture was compared with, in words.
        light_field: what was looked at, in words.
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
