"""Reports of a run: a table with standard errors, a strip of pictures, quality over light, and their page."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.showcase import figures
from vcc.showcase.words import write_page
from vcc.sweeps.table import Table
from vcc.zoo.bench import LEVELS
from vcc.zoo.running import SHOWN_LEVEL, Scored, results
from vcc.zoo.task import Task
from vcc.zoo.tasks import task_named

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

STRIP = 8
"""Cameras in a strip of pictures."""
MARKERS = "DsP*X^"


@dataclass(frozen=True)
class Score:
    """A mean and its standard error.

    Args:
        mean: over scenes and seeds.
        error: the standard error over scenes, after seeds are averaged; NaN for one scene.
    """

    mean: float
    error: float

    @classmethod
    def of(cls, by_scene: Array) -> Score:
        """Of values of scenes."""
        count = len(by_scene)
        error = float(by_scene.std(ddof=1)) / math.sqrt(count) if count > 1 else math.nan
        return cls(float(by_scene.mean()), error)

    def text(self, digits: int, sign: str = "") -> str:
        """Such as "23.1 ± 0.4"."""
        mean = f"{self.mean:{sign}.{digits}f}"
        return mean if math.isnan(self.error) else f"{mean} ± {self.error:.{digits}f}"


@dataclass(frozen=True, eq=False, repr=False)
class Report(Brief):
    """The results of a task.

    Args:
        task: the task.
        found: its results.
    """

    task: Task
    found: Sequence[Scored]

    @classmethod
    def of(cls, path: str | PathLike[str], task: str) -> Report:
        """Of the latest run of a task.

        Raises:
            InputError: unknown task; see also `vcc.zoo.running.results`.
        """
        return cls(task_named(task), results(path, task))

    def names(self, what: str) -> list[str]:
        """All cameras, decoders or scenes, in order."""
        return list(dict.fromkeys(str(each.about[what]) for each in self.found))

    def first(self, camera: str) -> Scored:
        """A result of a camera, for what all of its results share."""
        return next(each for each in self.found if each.about["camera"] == camera)

    def light(self, camera: str) -> float:
        """The share of the light of the open square, exposure time included."""
        return float(self.first(camera).about["light"])

    def by_scene(self, camera: str, decoder: str, level: int, measure: int = 0) -> Array:
        """Values of all scenes, averaged over seeds."""
        return np.array(
            [
                each.scores[level, :, measure].mean()
                for each in self.found
                if (each.about["camera"], each.about["decoder"]) == (camera, decoder)
            ]
        )

    def decoders(self, camera: str) -> list[str]:
        """The decoders that were run for a camera, in order."""
        names = (str(each.about["decoder"]) for each in self.found if each.about["camera"] == camera)
        return list(dict.fromkeys(names))

    def best(self, camera: str, level: int) -> str:
        """The decoder with the best mean of the first measure."""
        sign = 1 if self.task.measures[0].larger else -1
        return max(self.decoders(camera), key=lambda name: sign * self.by_scene(camera, name, level).mean())

    def controls(self, camera: str) -> tuple[str, ...]:
        """The names of the controls of a camera; none for controls."""
        return tuple(self.first(camera).about["controls"])

    def gain(self, camera: str, other: str | None, level: int) -> Score | None:
        """By how much a camera beats another one, each by its best decoder: the mean of differences of scenes."""
        if not other or other not in self.names("camera"):
            return None
        sign = 1 if self.task.measures[0].larger else -1
        ours, theirs = (self.by_scene(name, self.best(name, level), level) for name in (camera, other))
        return Score.of(sign * (ours - theirs))

    def rows(self, level: int) -> list[list[str]]:
        """The table of a light level, its first row with headings."""
        measure, decoders = self.task.measures[0], self.names("decoder")
        against = self.task.against
        rows = [["camera", "light", *decoders, *(f"against {each}" for each in against)]]
        for camera in self.names("camera"):
            best = self.best(camera, level)
            cells = []
            for name in decoders:
                values = self.by_scene(camera, name, level)
                cell = Score.of(values).text(measure.digits) if len(values) else ""
                cells.append(f"**{cell}**" if name == best else cell)
            gains = [self.gain(camera, other, level) for other in self.controls(camera) or [""] * len(against)]
            told = ["" if gain is None else gain.text(measure.digits, "+") for gain in gains]
            rows.append([camera, f"{self.light(camera):.1%}", *cells, *told])
        return rows

    def markdown(self) -> str:
        """The tables of all light levels, and what they mean."""
        parts = [f"{self.task.title}. {self.summary}"]
        for level, (name, electrons) in enumerate(LEVELS.items()):
            rows = self.rows(level)
            lines = [rows[0], ["---"] * len(rows[0]), *rows[1:]]
            table = "\n".join(f"| {' | '.join(row)} |" for row in lines)
            parts.append(f"{name.capitalize()}: {electrons:g} electrons\n\n{table}")
        return "\n\n".join([*parts, *self.remarks])

    @property
    def summary(self) -> str:
        """One paragraph for the tables."""
        measure, scenes = self.task.measures[0], self.names("scene")
        seeds = self.found[0].scores.shape[1]
        return (
            f"{measure.heading}, {'more' if measure.larger else 'less'} is better: mean over "
            f"{len(scenes)} scenes ({', '.join(Path(name).name for name in scenes)}) and {seeds} recordings of "
            "each, ± the standard error over scenes. Light is relative to the open camera at the same exposure "
            "time. The last columns are differences, positive if the camera is better, of the best decoders "
            f"(bold): to {' and to '.join(self.task.against)}."
        )

    @property
    def remarks(self) -> list[str]:
        """What differs from the rules, and the warnings of captures, each with the number of results."""
        told: dict[str, int] = {}
        for each in self.found:
            scene = Path(str(each.about["scene"])).name
            for words in (each.about["note"], *each.about["warnings"]):
                if words:
                    told[f"{scene}: {words}"] = told.get(f"{scene}: {words}", 0) + 1
        return [f"{words} ({count} of {len(self.found)} results)" for words, count in told.items()]

    def table(self) -> Table:
        """One row for each camera, decoder, scene, light level and recording, with all measures."""
        rows = [
            (each, level, seed)
            for each in self.found
            for level in range(each.scores.shape[0])
            for seed in range(each.scores.shape[1])
        ]
        words = ("camera", "decoder", "scene")
        columns = {name: np.array([str(each.about[name]) for each, _, _ in rows]) for name in words}
        columns["control"] = np.array([(*each.about["controls"], "")[0] for each, _, _ in rows])
        columns["light"] = np.array([float(each.about["light"]) for each, _, _ in rows])
        columns["electrons"] = np.array([list(LEVELS.values())[level] for _, level, _ in rows])
        columns["seed"] = np.array([seed for _, _, seed in rows])
        for place, measure in enumerate(self.task.all_measures):
            columns[measure.name] = np.array([each.scores[level, seed, place] for each, level, seed in rows])
        columns["missing_rays"] = np.array([float(each.about["missing_rays"]) for each, _, _ in rows])
        columns["sampling_error"] = np.array([float(each.about["sampling_error"]) for each, _, _ in rows])
        return Table(columns, {measure.name: measure.unit for measure in self.task.all_measures if measure.unit})

    def pareto(self) -> Figure:
        """Quality over light, each camera by its best decoder: a panel for each light level."""
        from matplotlib.ticker import PercentFormatter

        measure, names = self.task.measures[0], self.names("camera")
        times = [each for each in names if each.endswith("% of the time")]
        stops = [each for each in names if re.fullmatch(r"open|round \S+ %", each)]
        groups = [("stops", stops, figures.QUIET, "o-"), ("shorter exposures", times, "#0072B2", "v")]
        cameras = [each for each in names if each not in {*stops, *times}]
        groups += [(each, [each], f"C{n % 10}", MARKERS[n % len(MARKERS)]) for n, each in enumerate(cameras)]
        figure = figures.new_figure(4.0 * len(LEVELS), 4.6)
        panels = figure.subplots(1, len(LEVELS))
        for level, (axes, (name, electrons)) in enumerate(zip(panels, LEVELS.items(), strict=True)):
            for label, group, colour, style in (each for each in groups if each[1]):
                by_light = sorted(group, key=self.light)
                scores = [Score.of(self.by_scene(each, self.best(each, level), level)) for each in by_light]
                axes.errorbar(
                    [self.light(each) for each in by_light],
                    [each.mean for each in scores],
                    np.nan_to_num([each.error for each in scores]),
                    fmt=style,
                    color=colour,
                    markersize=7,
                    linewidth=1,
                    elinewidth=0.6,
                    label=label,
                )
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter(PercentFormatter(1))
            axes.set_title(f"{name}: {electrons:g} electrons", fontsize=figures.LABEL)
            axes.set_xlabel("light, of the open camera", fontsize=figures.LABEL)
            axes.set_ylabel(measure.heading if level == 0 else "", fontsize=figures.LABEL)
            if not measure.larger:
                axes.invert_yaxis()
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=figures.LABEL, frameon=False)
        return figure

    def strip(self) -> Figure:
        """The first scene, as recorded and as decoded by the best decoder, for cameras and some controls."""
        shown = [name for name in self.names("camera") if self.controls(name)]
        shown = [*shown[: STRIP - 2], *[name for name in ("open", "round 4 %") if name in self.names("camera")]]
        scene = self.names("scene")[0]
        columns = []
        for camera in shown:
            decoder = self.best(camera, SHOWN_LEVEL)
            columns.append(
                next(
                    each
                    for each in self.found
                    if (each.about["camera"], each.about["decoder"], each.about["scene"])
                    == (camera, decoder, scene)
                )
            )
        measure, first = self.task.measures[0], columns[0]
        figure = figures.new_figure(2.2 * len(columns) + 2.2, 3.9)
        grid = figure.subplots(2, len(columns) + 1, squeeze=False)
        top = [(str(each.about["camera"]), each.recording) for each in columns]
        score = [each.scores[SHOWN_LEVEL, 0, 0] for each in columns]
        under = [
            (f"{each.about['decoder']}: {value:.{measure.digits}f} {measure.unit}", each.picture)
            for each, value in zip(columns, score, strict=True)
        ]
        figures.fill(
            grid, [[*top, ("truth", first.truth)], under], ["recorded", "decoded"], cmap="gray", vmin=0, vmax=255
        )
        return figure

    def write(self, folder: Path) -> Path:
        """Write the page index.html with its pictures and the table as CSV.

        Returns:
            The page.

        Raises:
            InputError: the folder or a file cannot be written.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder} cannot be made: {error.strerror}") from error
        figures.write_figure(self.pareto(), folder / "light.png")
        figures.write_figure(self.strip(), folder / "strip.png")
        self.table().save(folder / "scores.csv")
        levels = [
            (f"{name}: {electrons:g} electrons", self.rows(n))
            for n, (name, electrons) in enumerate(LEVELS.items())
        ]
        page = folder / "index.html"
        write_page(page, "zoo/page.html", title=f"The zoo: {self.task.title}", report=self, levels=levels)
        return page
