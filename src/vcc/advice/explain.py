"""A plan as text: how it folds the optics, what it moves to the sensor, the chosen sampling, and the cost.

For a light field on disk and an executor, with additional sections.
"""

from __future__ import annotations

import math
import re
import textwrap
import time
from collections.abc import Sequence
from typing import Any

from vcc.advice import explain_footprints, explain_rays
from vcc.advice.explain_footprints import seconds_from_store, some_views
from vcc.advice.limits import sampling_limits
from vcc.advice.waves import wave_section, wavelength_of
from vcc.advice.words import in_words
from vcc.base.showing import Shown
from vcc.fields.grid import SAMPLES_IN_WORDS, Block, Grid
from vcc.fields.samples import Samples
from vcc.optics.train import Train
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.parallax_rule import vergences
from vcc.run.drive import Counted, Drive, warmed_up
from vcc.run.executors import Work
from vcc.run.required_samples import required_samples
from vcc.run.serialization import PortableRun

COLUMNS = 80
"""Largest width of a line, except for longer words."""
PLACES_END = 20
"""The column at which an element's description begins, after its position on the axis."""


class Explanation(Shown, str):
    """Text whose `repr` is the text itself, in a notebook or on the command line."""

    __slots__ = ("expected_seconds", "expected_seconds_by_executor", "plan")
    plan: Plan
    expected_seconds: float | None
    expected_seconds_by_executor: float | None

    def __repr__(self) -> str:
        return str(self)

    def with_section(self, section: str) -> Explanation:
        """The same with lines below; the plan and the times stay those of what is explained above."""
        longer = Explanation(f"{self}\n\n{wrapped(section)}")
        for name in self.__slots__:
            setattr(longer, name, getattr(self, name))
        return longer


def explained(train: Train, samples: Samples, plan: Plan, how: How, executor: Any = None) -> Explanation:
    """A plan for a light field as text; see `vcc.Camera.explain`.

    The time is estimated by running a part of the plan on the light field and scaling it up.

    Args:
        train: of the plan.
        samples: of the plan.
        plan: to explain.
        how: the settings.
        executor: may run the blocks, or None.
    """
    run = Drive(plan, samples, how)
    room = explain_rays if plan.by_rays else explain_footprints
    parts, seconds = room.sections(run)
    made = "How the picture is made\n" + "\n".join(f"  {note}" for note in (*plan.notes, *_by_direction(train)))
    shown = vergences(samples.grid, how.scene_distance)
    scene = None if shown is None else (float(shown.min()), float(shown.max()))
    limits = _limits(train, samples.grid, scene)
    waves = wave_section(train, samples.grid, scene)
    text = wrapped("\n\n".join([_what(train, samples.grid), made, limits, waves, *parts]))
    if samples.whole() is None:
        more, seconds = of_store(Drive(*required_samples(plan, samples), how))
        text = f"{text}\n\n{more}"
    by_executor = None
    if executor is not None:
        more, by_executor = of_executor(Drive(*required_samples(plan, samples), how, executor), seconds)
        text = f"{text}\n\n{wrapped(more)}"
    result = Explanation(text)
    result.plan, result.expected_seconds, result.expected_seconds_by_executor = plan, seconds, by_executor
    return result


def wrapped(text: str) -> str:
    """Text wrapped to the width of a terminal, with further indentation of continued lines."""
    lines = []
    for line in text.split("\n"):
        indent = len(line) - len(line.lstrip())
        # Keep a number and its unit on one line.
        whole = re.sub(
            r"z = (?=[-\d])", "z\xa0=\xa0", re.sub(r"(?<=\d) (?=(?:[mun]?m|s|MB|pixels)\b)", "\xa0", line)
        )
        further = " " * (indent + (2 if "z =" not in line[:6] else PLACES_END - indent))
        pieces = textwrap.wrap(
            whole, COLUMNS, subsequent_indent=further, break_long_words=False, break_on_hyphens=False
        )
        lines += [piece.replace("\xa0", " ") for piece in pieces] or [""]
    return "\n".join(lines)


def _what(train: Train, grid: Grid) -> str:
    nv, nu, nt, ns = grid.shape[:4]
    lines = [
        f"Light field: {nv}×{nu} views of {nt}×{ns} pixels, "
        f"{grid.channels or 1} channel{'s' if (grid.channels or 1) > 1 else ''}, "
        f"{grid.kind} {SAMPLES_IN_WORDS[grid.sample]}; {grid.geometry}{grid.bands}"
    ]
    if grid.filling is not None and grid.filling.words:
        lines.append(f"  {grid.filling.words}")
    return "\n".join([*lines, *train.listed()])


def _by_direction(train: Train) -> list[str]:
    """What depends on the direction of light, and how photodiodes share it."""
    notes = []
    stages = [each for each in train.stages if each.term is not None or each.faces.by_ray is not None]
    labels = dict.fromkeys(stage.element.label for stage in stages)
    if labels:
        notes.append(f"transmission that depends on direction: {', '.join(labels)}")
    rows, columns = train.sensor.photodiodes
    if rows * columns > 1:
        notes.append(
            f"this is the plan of whole pixels; a capture makes an image for each of their {rows}×{columns} "
            f"photodiodes, whose microlenses image {train.chief_rays().of} onto them"
        )
    return notes


def _limits(train: Train, grid: Grid, scene: tuple[float, float] | None) -> str:
    return "What the samples can carry\n" + in_words(sampling_limits(train, grid, scene, wavelength_of(grid)))


# --- sections for a light field on disk and for an executor: blocks, time, recommendation ---


WORTH_IT = 0.8
"""An executor is recommended if it takes less than this share of the local time."""


def _traced_for(run: Drive) -> str:
    """The blocks for which rays are traced, as text."""
    if run.need.bands > 1 and run.blocks.pixel_rows_each < run.blocks.pixel_rows:
        return "rays are traced for the blocks that they look at"
    return "all rays are traced once for each block"


def of_store(run: Drive) -> tuple[str, float | None]:
    """The section of `vcc.Camera.explain`, and the seconds expected.

    Args:
        run: reads a few views to estimate the time.
    """
    lines = [f"  read in {run.blocks.words}", f"  {run.given.stored_bytes / 1e6:.0f} MB on disk, as packed"]
    if run.plan.by_rays:
        lines.append(f"  {_traced_for(run)}; the time is not estimated")
        return "Light field on disk\n" + "\n".join(lines), None
    seconds = seconds_from_store(run)
    lines.append(f"  about {seconds:.2g} s expected (some views were read and timed on this machine)")
    return "Light field on disk\n" + "\n".join(lines), seconds


def of_executor(run: Drive, here: float | None) -> tuple[str, float | None]:
    """The section of `vcc.Camera.explain`, and the seconds expected.

    Args:
        run: with an executor, which runs a few views to estimate the time.
        here: seconds without the executor; None if not estimated.
    """
    assert run.worker_pool is not None
    blocks, places = len(list(run.blocks)), run.worker_pool.places
    threads = run.portable.how.workers
    each = f"each by {threads} thread{'' if threads == 1 else 's'} and within {run.limit / 1e6:.0f} MB"
    lines = [f"  {run.blocks.words}, {places} at once, {each}"]
    seconds = None
    if run.plan.by_rays:
        lines.append(f"  {_traced_for(run)}; the time is not estimated")
    else:
        seconds = expected_seconds(run, blocks, max(places, 1))
        lines.append(f"  about {seconds:.2g} s expected (some views were run there and timed)")
        if here is not None:
            worth = "the executor is worth it" if seconds < WORTH_IT * here else "leave the executor out"
            lines.append(f"  about {here:.2g} s without it, by all cores of this machine: {worth}")
    return "Run by an executor\n" + "\n".join(lines), seconds


def expected_seconds(run: Drive, blocks: int, places: int) -> float:
    """The estimated run time with an executor, from timings of its start, some views and a returned raster.

    Args:
        run: with the executor.
        blocks: number of blocks.
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
    assert run.worker_pool is not None
    work = Work(_seconds, run.portable, first=warmed_up if first else None)
    return [result[0] for _, result in run.worker_pool.each(work, blocks)]


def _seconds(sent: PortableRun, block: Block) -> tuple[float, Any]:
    """The run time of a block on this machine, and its raster, so that its transfer is included."""
    drive = Drive(sent.plan, sent.samples, sent.how)
    start = time.perf_counter()
    part = drive.part(block, 0, Counted(None, 0))
    return time.perf_counter() - start, part
