"""What a light field on disk, and an executor, add to an explanation: blocks, time, and whether it is worth it."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

from vcc.advice.explain_footprints import seconds_from_store, some_views
from vcc.fields.grid import Block
from vcc.run.drive import Counted, Drive, begun
from vcc.run.executors import Work
from vcc.run.sent import Sent

WORTH_IT = 0.8
"""Of the time here, which an executor must take less than to be worth its trouble."""


def _traced_for(run: Drive) -> str:
    """For which blocks rays are traced, as text."""
    if run.need.bands > 1 and run.blocks.pixel_rows_each < run.blocks.pixel_rows:
        return "rays are traced for the blocks that they look at"
    return "all rays are traced once for each block"


def of_store(run: Drive) -> tuple[str, float | None]:
    """The section of `vcc.Camera.explain`, and the seconds expected.

    Args:
        run: of which a few views are read, to foretell the time.
    """
    lines = [f"  read in {run.blocks.words}", f"  {run.given.stored_bytes / 1e6:.0f} MB on disk, as packed"]
    if run.plan.by_rays:
        lines.append(f"  {_traced_for(run)}; the time is not foretold")
        return "Light field on disk\n" + "\n".join(lines), None
    seconds = seconds_from_store(run)
    lines.append(f"  about {seconds:.2g} s expected (some views were read and timed on this machine)")
    return "Light field on disk\n" + "\n".join(lines), seconds


def of_executor(run: Drive, here: float | None) -> tuple[str, float | None]:
    """The section of `vcc.Camera.explain`, and the seconds expected.

    Args:
        run: by an executor, which runs a few views to foretell the time.
        here: seconds that all takes without it; None where that is not foretold.
    """
    assert run.crew is not None
    blocks, places = len(list(run.blocks)), run.crew.places
    threads = run.sent.how.workers
    each = f"each by {threads} thread{'' if threads == 1 else 's'} and within {run.limit / 1e6:.0f} MB"
    lines = [f"  {run.blocks.words}, {places} at once, {each}"]
    seconds = None
    if run.plan.by_rays:
        lines.append(f"  {_traced_for(run)}; the time is not foretold")
    else:
        seconds = expected_seconds(run, blocks, max(places, 1))
        lines.append(f"  about {seconds:.2g} s expected (some views were run there and timed)")
        if here is not None:
            worth = "the executor is worth it" if seconds < WORTH_IT * here else "leave the executor out"
            lines.append(f"  about {here:.2g} s without it, by all cores of this machine: {worth}")
    return "Run by an executor\n" + "\n".join(lines), seconds


def expected_seconds(run: Drive, blocks: int, places: int) -> float:
    """How long an executor will take: it begins, runs some views and gives a raster back, and each is timed.

    Args:
        run: by the executor.
        blocks: how many there are.
        places: how many run at once.
    """
    block, share = some_views(run)
    began = time.perf_counter()
    _ask(run, [block], first=True)
    beginning = time.perf_counter() - began
    asked = time.perf_counter()
    (running,) = _ask(run, [block])
    asking = max(time.perf_counter() - asked - running, 0.0)
    rounds = math.ceil(blocks / places)
    return beginning + rounds * (running / share / blocks + asking)


def _ask(run: Drive, blocks: Sequence[Block], first: bool = False) -> list[float]:
    assert run.crew is not None
    work = Work(_seconds, run.sent, first=begun if first else None)
    return [result[0] for _, result in run.crew.each(work, blocks)]


def _seconds(sent: Sent, block: Block) -> tuple[float, Any]:
    """How long a block takes where this runs, and its raster, so that it is sent."""
    drive = Drive(sent.plan, sent.samples, sent.how)
    start = time.perf_counter()
    part = drive.part(block, 0, Counted(None, 0))
    return time.perf_counter() - start, part
