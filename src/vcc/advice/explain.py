"""A plan in words: what was folded, what was pulled to the sensor, which sampling was chosen, what it costs."""

from __future__ import annotations

import re
import textwrap
from typing import Any

from vcc.advice import explain_footprints, explain_rays, explain_runs
from vcc.advice.limits import sampling_limits
from vcc.advice.words import in_words
from vcc.base.showing import Shown
from vcc.fields.grid import SAMPLES_IN_WORDS, Grid
from vcc.fields.samples import Samples
from vcc.optics.train import Train
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.parallax_rule import vergences
from vcc.run.drive import Drive
from vcc.run.needed import needed

COLUMNS = 80
"""Into which an explanation's lines fit, but for words that are longer."""
PLACES_END = 20
"""The column at which an element's words begin, behind its place on the axis."""


class Explanation(Shown, str):
    """Text that shows itself plainly in a notebook or at the prompt."""

    __slots__ = ("expected_seconds", "expected_seconds_by_executor", "plan")
    plan: Plan
    expected_seconds: float | None
    expected_seconds_by_executor: float | None

    def __repr__(self) -> str:
        return str(self)


def explained(train: Train, samples: Samples, plan: Plan, how: How, executor: Any = None) -> Explanation:
    """A plan for a light field in words; see `vcc.Camera.explain`.

    The time is foretold by running a part of the plan on the light field and scaling it up.

    Args:
        train: that the plan was made of.
        samples: that it was made for.
        plan: what is explained.
        how: what was chosen.
        executor: that may run the blocks, or None.
    """
    run = Drive(plan, samples, how)
    room = explain_rays if plan.by_rays else explain_footprints
    parts, seconds = room.sections(run)
    made = "How the picture is made\n" + "\n".join(f"  {note}" for note in plan.notes)
    limits = _limits(train, samples.grid, how.scene_distance)
    text = wrapped("\n\n".join([_what(train, samples.grid), made, limits, *parts]))
    if samples.whole() is None:
        more, seconds = explain_runs.of_store(Drive(*needed(plan, samples), how))
        text = f"{text}\n\n{more}"
    by_executor = None
    if executor is not None:
        more, by_executor = explain_runs.of_executor(Drive(*needed(plan, samples), how, executor), seconds)
        text = f"{text}\n\n{wrapped(more)}"
    result = Explanation(text)
    result.plan, result.expected_seconds, result.expected_seconds_by_executor = plan, seconds, by_executor
    return result


def wrapped(text: str) -> str:
    """Text whose lines fit a terminal: what is longer goes on in the next line, further to the right."""
    lines = []
    for line in text.split("\n"):
        indent = len(line) - len(line.lstrip())
        # A quantity stays in one piece.
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
        f"{grid.kind} {SAMPLES_IN_WORDS[grid.sample]}; {grid.geometry}"
    ]
    return "\n".join([*lines, *train.listed()])


def _limits(train: Train, grid: Grid, scene_distance: float | None) -> str:
    shown = vergences(grid, scene_distance)
    scene = None if shown is None else (float(shown.min()), float(shown.max()))
    return "What the samples can carry\n" + in_words(sampling_limits(train, grid, scene))
