"""The common parts of gallery entries: a citation, a claim, and a run that measures it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vcc.base import showing
from vcc.base.describe import Brief
from vcc.base.progress import Progress as Progress
from vcc.light_field import LightField
from vcc.showcase.bench import Bench, built_in, from_someone
from vcc.showcase.figures import Shown
from vcc.showcase.words import paragraphs

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass
class Steps:
    """Counts steps and reports progress: called after each step.

    Args:
        progress: receives the counts.
        total: number of steps.
        done: number of completed steps.
    """

    progress: Progress
    total: int
    done: int = 0

    def __call__(self) -> None:
        """Count one more step."""
        self.done += 1
        self.progress(self.done, self.total)


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture on an entry's page.

    Args:
        name: of the file, without its ending.
        title: a few words.
        caption: HTML.
        content: (rows, columns, 3) for display, 0 to 1, or a Matplotlib figure.
    """

    name: str
    title: str
    caption: str
    content: Shown | Figure


def below(*pictures: Picture) -> tuple[tuple[Picture, ...], ...]:
    """Pictures one below the other: each is a row of a `Result`."""
    return tuple((picture,) for picture in pictures)


@dataclass(frozen=True)
class Finding:
    """One measured number, with the claim about it.

    Args:
        what: name of the measurement.
        claim: the published value or a closed-form result, as text; empty without a claim.
        value: the measured value.
        unit: of the value, e.g. ``"dB"``; empty for a plain number.
        reached: whether the claim was reached; None without a claim.
        why: an explanation, especially if the claim was not reached.
    """

    what: str
    claim: str
    value: float
    unit: str = ""
    reached: bool | None = None
    why: str = ""

    @classmethod
    def gain(cls, what: str, ours: float, theirs: float, least: float, why: str = "", claim: str = "") -> Finding:
        """The claim that one result is better than another by some decibels, or just better for 0.

        Args:
            what: name of the measurement.
            ours: decibels of the one.
            theirs: decibels of the other.
            least: decibels to gain.
            why: an explanation.
            claim: words of the claim before the number.
        """
        least_words = f"{least:g} dB or more" if least else "better"
        return cls(
            what,
            f"{claim}: {least_words}" if claim else least_words,
            ours - theirs,
            "dB",
            ours - theirs >= least,
            f"{ours:.1f} dB against {theirs:.1f} dB" + (f": {why}" if why else ""),
        )

    @property
    def verdict(self) -> str:
        """Whether the claim was reached, as text; a dash without a claim."""
        return {True: "reached", False: "not reached", None: "–"}[self.reached]

    @property
    def measured(self) -> str:
        """The value with its unit, as readable text."""
        return f"{self.value:.3g} {self.unit}".strip()


@dataclass(frozen=True, eq=False, repr=False)
class Result(showing.Shown, Brief):
    """The result of a run.

    Args:
        text: HTML paragraphs: the optics with the parameters used, and how the recording was decoded.
        pictures: rows of pictures.
        numbers: the measurements.
        assumed: a sentence on the assumptions about the light field; empty if there are none.
    """

    text: str
    pictures: tuple[tuple[Picture, ...], ...]
    numbers: tuple[Finding, ...]
    assumed: str = ""

    @property
    def reached(self) -> bool:
        """Whether every claim was reached."""
        return all(number.reached is not False for number in self.numbers)


@dataclass(frozen=True)
class Entry:
    """A published camera.

    Args:
        name: identifier.
        title: as text.
        citation: authors and publication.
        claim: of the authors, in a sentence.
        runner: runs the camera on a bench, see `run`; if that is much work, a dataclass whose fields set the
            sizes.
    """

    name: str
    title: str
    citation: str = field(repr=False)
    claim: str = field(repr=False)
    runner: Callable[[Bench, Progress], Result] = field(repr=False)

    def run(self, light_field: Path | LightField | None = None, progress: Progress | None = None) -> Result:
        """Record a light field with the camera, decode it, and measure.

        Args:
            light_field: a light field, or a folder, file or store that contains one; its lengths are scaled
                so that its grid of views is 20 mm wide (`vcc.showcase.bench.from_someone`). None uses the
                built-in scene: leaves at 0.8 m, a chart at 1.3 m and a town at 3 m, 20×20 views of 500×500
                pixels.
            progress: called with (done, total) as the work advances.

        Raises:
            InputError: a light field that cannot be read or used.
        """
        return self.runner(bench_for(light_field), progress or silent)


def bench_for(light_field: Path | LightField | None) -> Bench:
    """The light field before a lens, and the distances to focus on; the built-in scene for None."""
    return _scene() if light_field is None else from_someone(light_field, small=False)


@lru_cache(maxsize=1)
def _scene() -> Bench:
    return built_in(small=False)


def prose(module: str, **values: Any) -> str:
    """The paragraphs ``gallery/prose/NAME.txt`` of an entry, as HTML.

    Args:
        module: name of the entry's module, ``__name__``; the template has all of its constants.
        values: further values for the template.
    """
    constants = {name: value for name, value in vars(sys.modules[module]).items() if name.isupper()}
    name = module.rpartition(".")[2].replace("_", "-")
    return paragraphs(f"gallery/prose/{name}.txt", **constants, **values)


def silent(done: int, total: int) -> None:
    """A progress callback that does nothing."""
