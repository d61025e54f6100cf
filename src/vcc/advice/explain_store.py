"""What a light field on disk adds to an explanation: its blocks, and how long reading them takes."""

from __future__ import annotations

from vcc.advice.explain_footprints import seconds_from_store
from vcc.run.drive import Drive


def traced_for(run: Drive) -> str:
    """For which blocks rays are traced, as text."""
    if run.need.bands > 1 and run.blocks.pixel_rows_each < run.blocks.pixel_rows:
        return "rays are traced for the blocks that they look at"
    return "all rays are traced once for each block"


def section(run: Drive) -> tuple[str, float | None]:
    """The section of `vcc.Camera.explain`, and the seconds expected.

    Args:
        run: of which a few views are read, to foretell the time.
    """
    lines = [f"  read in {run.blocks.words}", f"  {run.given.stored_bytes / 1e6:.0f} MB on disk, as packed"]
    if run.plan.by_rays:
        lines.append(f"  {traced_for(run)}; the time is not foretold")
        return "Light field on disk\n" + "\n".join(lines), None
    seconds = seconds_from_store(run)
    lines.append(f"  about {seconds:.2g} s expected (some views were read and timed on this machine)")
    return "Light field on disk\n" + "\n".join(lines), seconds
