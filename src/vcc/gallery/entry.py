"""What every camera of the gallery has: a citation, a claim, and a run that measures it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from vcc.base import showing
from vcc.base.describe import Brief
from vcc.base.progress import Progress as Progress
from vcc.light_field import LightField
from vcc.showcase.bench import Bench, built_in, from_someone
from vcc.showcase.figures import Shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass
class Steps:
    """Counts steps and tells how far the work is: called after each.

    Args:
        progress: whom to tell.
        total: how many steps there are.
        done: how many are done.
    """

    progress: Progress
    total: int
    done: int = 0

    def __call__(self) -> None:
        """One more is done."""
        self.done += 1
        self.progress(self.done, self.total)


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture on an entry's page.

    Args:
        name: of the file, without its ending.
        title: a few words.
        caption: HTML.
        content: what is drawn: (rows, columns, 3) as screens want it, 0 to 1, or a figure of matplotlib.
    """

    name: str
    title: str
    caption: str
    content: Shown | Figure


@dataclass(frozen=True)
class Finding:
    """One number that a run measured, beside what was claimed.

    Args:
        what: was measured, in words.
        claim: what is published or follows from it in closed form, in words; empty where nothing is claimed.
        value: what this run measured.
        unit: of the value, e.g. ``"dB"``; empty for a plain number.
        reached: whether the claim was reached; None where nothing is claimed.
        why: what explains the number, above all where the claim was not reached.
    """

    what: str
    claim: str
    value: float
    unit: str = ""
    reached: bool | None = None
    why: str = ""

    @property
    def verdict(self) -> str:
        """Whether the claim was reached, in words; a dash where nothing is claimed."""
        return {True: "reached", False: "not reached", None: "–"}[self.reached]

    @property
    def measured(self) -> str:
        """The value with its unit, as people read it."""
        return f"{self.value:.3g} {self.unit}".strip()


@dataclass(frozen=True, eq=False, repr=False)
class Result(showing.Shown, Brief):
    """What came of a run.

    Args:
        text: HTML paragraphs: the optics with the parameters used, and how the recording was decoded.
        pictures: rows of pictures.
        numbers: what was measured.
        assumed: what had to be assumed about the light field, a sentence; empty if nothing.
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
        name: by which it is asked for.
        title: in words.
        citation: who published it, and where.
        claim: what they say it does, in a sentence.
        runner: takes a bench through the camera, see `run`; where that is much work, a dataclass whose fields say
            how much.
    """

    name: str
    title: str
    citation: str = field(repr=False)
    claim: str = field(repr=False)
    runner: Callable[[Bench, Progress], Result] = field(repr=False)

    def run(self, light_field: Path | LightField | None = None, progress: Progress | None = None) -> Result:
        """Take a light field through the camera and its decoder, and measure.

        Args:
            light_field: a light field, or a folder, file or store that holds one; its world is scaled so that its
                grid of views is 20 mm wide (`vcc.showcase.bench.from_someone`). None takes the built-in scene:
                leaves at 0.8 m, a chart at 1.3 m and a town at 3 m, 20×20 views of 500×500 pixels.
            progress: called with (done, total) as the work advances.

        Raises:
            InputError: a light field that cannot be read or used.
        """
        return self.runner(bench_for(light_field), progress or silent)


def bench_for(light_field: Path | LightField | None) -> Bench:
    """The light field before a lens, and the distances to focus on; the built-in scene if None is given."""
    return _scene() if light_field is None else from_someone(light_field, small=False)


@lru_cache(maxsize=1)
def _scene() -> Bench:
    return built_in(small=False)


def silent(done: int, total: int) -> None:
    """Progress that nobody is told of."""
