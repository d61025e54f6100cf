"""`run_demo`: from a light field to a folder of pictures that explain the paper."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vcc.base.errors import InputError, without_result_warnings
from vcc.base.progress import Progress
from vcc.camera import Camera
from vcc.demo.report import DemoReport, Timing
from vcc.demo.sheet import MASK_TITLES, drawn_sheet, truth_in_words
from vcc.image import Image
from vcc.light_field import LightField
from vcc.plan.how import Interpolation
from vcc.plot import plot_phase_space_stages
from vcc.showcase import figures
from vcc.showcase.bench import Bench, built_in, from_someone
from vcc.showcase.figures import Crop, Shown
from vcc.showcase.scene import CHECK_PLACES, PLACES
from vcc.showcase.truth import psnr, true_picture
from vcc.showcase.words import away, duration, length, write_page
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Uniform

if TYPE_CHECKING:
    from rich.console import Console

INTERPOLATIONS: tuple[Interpolation, ...] = ("nearest", "linear", "cubic", "sharp")
PAPER_SHAPE = (20, 20, 500, 500)
BEHIND_MASKS = 2.0
"""Relative exposure behind masks: one mask is half open, and crests behind the other do not clip."""
OTHER_PLACES = "sharp when focused near", "sharp at middle distance", "sharp when focused far"
"""Labels of close-ups for a light field of the user."""


def run_demo(
    output: Path,
    light_field: Path | LightField | None = None,
    small: bool = False,
    console: Console | None = None,
) -> DemoReport:
    """Run the paper's two examples and its own check, and write pictures and a page that explain them.

    Args:
        output: the folder for pictures, ``index.html`` and ``contact-sheet.png``; created if missing.
        light_field: a light field, a store of one, or a path that `vcc.open_light_field` reads, instead of
            the built-in scene.
        small: a smaller light field (8×8 views of 160×160 pixels; of the user's, every second view and
            pixel), for a quick look.
        console: for progress and results; None prints to the standard output.

    Returns:
        The files, the time of each step in seconds, and the check's PSNR in decibels.

    Raises:
        InputError: the folder cannot be created or written to, or the light field cannot be used.
    """
    if console is None:
        from rich.console import Console

        console = Console()
    work = _Work(_made(Path(output)), console)
    with work.timed("everything, drawings and files included"):
        bench = _light_field(work, light_field, small)
        _show_light_field(work, bench)
        conventional = _example_one(work, bench)
        _example_two(work, bench, conventional)
        _check(work, bench, conventional)
    return _finish(work, bench, conventional["near"].exposure)


@dataclass(frozen=True)
class _Taken:
    """An image, its display version, and the times of two captures, seconds."""

    image: Image
    exposure: float
    shown: Shown
    seconds: tuple[float, float]


@dataclass
class _Work:
    """The state of a run of the demo."""

    folder: Path
    console: Console
    timings: list[Timing] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    psnr: dict[str, float] = field(default_factory=dict)
    gaps: dict[str, float] = field(default_factory=dict)

    def path(self, name: str) -> Path:
        """The path of a file, which is added to the list of files."""
        path = self.folder / name
        self.files.append(path)
        return path

    def draw(self, name: str, figure: Any) -> None:
        """Write a figure, or the figure of axes."""
        figures.write_figure(getattr(figure, "figure", figure), self.path(name))

    @contextmanager
    def timed(self, step: str, note: str = "") -> Iterator[None]:
        """Context that records its duration as a step."""
        begun = time.perf_counter()
        yield
        self.timings.append(Timing(step, time.perf_counter() - begun, note=note))

    @contextmanager
    def bar(self, words: str) -> Iterator[Progress]:
        """A progress bar; yields a callback for (done, total)."""
        from rich.progress import Progress

        with Progress(console=self.console, transient=True) as progress:
            task = progress.add_task(words, total=None)
            yield lambda done, total: progress.update(task, completed=done, total=total)

    def take(
        self, bench: Bench, camera: Camera, name: str, exposure: float, interpolation: Interpolation = "sharp"
    ) -> _Taken:
        """Capture twice, timed, and write the image."""
        seconds = []
        with without_result_warnings(), self.console.status(name):  # the page reports the share of missing rays
            for _ in range(2):
                begun = time.perf_counter()
                image = camera.capture(bench.light_field, interpolation=interpolation)
                seconds.append(time.perf_counter() - begun)
        if image.missing_rays > 0.01:
            self.gaps[name] = image.missing_rays
        image.save(self.path(f"{name}.png"), exposure=exposure)
        return _Taken(image, exposure, figures.shown(image, exposure), (seconds[0], seconds[1]))


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".vcc-demo"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(
            f"the demo cannot write to the folder {folder}: {error.strerror or error}. Choose another"
        ) from error
    return folder


# --- the light field ---


def _light_field(work: _Work, given: Path | LightField | None, small: bool) -> Bench:
    begun = time.perf_counter()
    if given is None:  # a tiny plane, so that the next time does not include compiling
        with work.console.status("compiling"):
            tiny = PlanesScene([TexturedPlane(Uniform(), 1.0)])
            tiny.light_field((1, 1), (2, 2), spacing=1e-3, slope_per_pixel=1e-3)
    compiled = time.perf_counter()
    with work.bar("light field") as progress:
        bench = built_in(small, progress) if given is None else from_someone(given, small, progress)
    made = time.perf_counter()
    with work.console.status("compiling"):
        _warm_up(bench)
    compiling = compiled - begun + time.perf_counter() - made
    values = bench.light_field.values
    sizes = f"{'×'.join(map(str, values.shape))}, {values.nbytes / 1e6:.0f} MB"
    work.timings.append(
        Timing("compiling the loops", compiling, note="once on a machine where it can be kept on disk")
    )
    verb = "synthesizing" if given is None else "reading"
    work.timings.append(Timing(f"{verb} the light field", made - compiled, note=sizes))
    work.console.print(f"{bench.light_field!r}")
    if bench.assumed:
        work.console.print(bench.assumed)
    return bench


def _warm_up(bench: Bench) -> None:
    """Run each kind of plan once on a few views, so that later times do not include compiling."""
    few = few_views(bench)
    with without_result_warnings():  # most of the sensor stays dark
        for camera in kinds_of_camera(bench):
            for interpolation in INTERPOLATIONS:
                camera.capture(few, interpolation=interpolation)


def kinds_of_camera(bench: Bench) -> tuple[Camera, ...]:
    """One camera for each kind of plan that the demo runs."""
    return bench.conventional(bench.near), bench.cosine(), bench.coded()


def few_views(bench: Bench) -> LightField:
    """A corner of the pixels of four middle views.

    Corner views lie outside the round lens, and a plan skips them.
    """
    row, column = (n // 2 for n in bench.light_field.shape[:2])
    middle = bench.light_field[row - 1 : row + 1, column - 1 : column + 1, :8, :8]
    return middle.replaced(np.ascontiguousarray(middle.values))


def _show_light_field(work: _Work, bench: Bench) -> None:
    light_field = bench.light_field
    rows, columns = light_field.shape[:2]
    light_field.view(rows // 2, columns // 2).save(work.path("light-field-middle-view.png"), exposure=1.0)
    work.draw("light-field-views.png", figures.views_figure(light_field))


# --- pictures ---


def _example_one(work: _Work, bench: Bench) -> dict[str, _Taken]:
    exposure = bench.exposure(bench.conventional(bench.middle), bench.diameter)
    taken = {}
    for name, distance in bench.distances.items():
        camera = bench.conventional(distance)
        taken[name] = work.take(bench, camera, f"example-1-focused-{name}", exposure)
        note = f"one lens, sensor at {length(camera.sensor.z)}"
        work.timings.append(Timing(f"Example 1: focused {name}, {away(distance)}", *taken[name].seconds, note))
    with work.timed("Example 1: camera and phase space drawn"):
        _draw_example_one(work, bench, taken)
    return taken


def _draw_example_one(work: _Work, bench: Bench, taken: dict[str, _Taken]) -> None:
    far = bench.conventional(bench.far)
    work.draw("example-1-camera.png", far.plot(light_field=bench.light_field))
    points = figures.points_figure(bench.conventional(math.inf), bench.diameter)
    work.draw("example-1-phase-space-points.png", points)
    row = round(0.46 * bench.light_field.shape[2])
    stages = plot_phase_space_stages(far, bench.light_field, pixel_row=row)
    work.draw("example-1-phase-space-scene.png", stages)
    columns = [(f"focused {name}", picture.shown) for name, picture in taken.items()]
    crops, places = _close_ups(bench, taken)
    work.draw("example-1-close-ups.png", figures.close_ups(columns, crops, places))


def _close_ups(bench: Bench, taken: dict[str, _Taken]) -> tuple[list[Crop], Sequence[str]]:
    """The squares for close-ups and their labels: known places, or those sharp in one image only."""
    size = max(min(bench.light_field.shape[2:4]) * 13 // 100, 8)
    if bench.scene is None:
        return figures.detailed_crops([picture.shown for picture in taken.values()], size), OTHER_PLACES
    sensor = bench.sensor(bench.near)
    return [figures.crop_around(sensor, place, size) for place in PLACES.values()], list(PLACES)


def _example_two(work: _Work, bench: Bench, conventional: dict[str, _Taken]) -> None:
    cameras = {"cosine": bench.cosine(), "coded": bench.coded()}
    unmasked = conventional["near" if bench.masked_focus == bench.near else "middle"]
    full = bench.light_field.shape[:4] == PAPER_SHAPE
    note = "one mask in mid-path" + (", three channels for the paper’s one" if full else "")
    columns = [("no mask", unmasked.shown)]
    for name, camera in cameras.items():
        taken = work.take(bench, camera, f"example-2-{name}", BEHIND_MASKS * unmasked.exposure)
        work.timings.append(Timing(f"Example 2: {MASK_TITLES[name]}", *taken.seconds, note, full))
        columns.append((MASK_TITLES[name], taken.shown))
        work.draw(f"example-2-{name}-camera.png", camera.plot(light_field=bench.light_field))
    masks = [(MASK_TITLES[name], camera.elements[-1]) for name, camera in cameras.items()]
    width = max(cameras["cosine"].sensor.size) * 0.9
    work.draw("example-2-masks.png", figures.mask_figure(masks, width))
    work.draw("example-2-close-ups.png", figures.close_ups(columns, *_close_ups(bench, conventional)))


def _check(work: _Work, bench: Bench, conventional: dict[str, _Taken]) -> None:
    camera = bench.pinhole()
    exposure = bench.exposure(camera, bench.pinhole_diameter)
    words = truth_in_words(bench)
    with work.console.status("the true picture"), work.timed("check: the true picture", note=words):
        truth = true_picture(bench)
    truth.save(work.path("check-truth.png"), exposure=exposure)
    columns, errors = [("truth", figures.shown(truth, exposure))], []
    for interpolation in INTERPOLATIONS:
        taken = work.take(bench, camera, f"check-{interpolation}", exposure, interpolation)
        reached = work.psnr[interpolation] = psnr(taken.image, truth, 1 / exposure)
        note = f"PSNR {reached:.1f} dB against the truth"
        work.timings.append(Timing(f"check: pinhole picture, {interpolation}", *taken.seconds, note))
        columns.append((f"{interpolation}, {reached:.1f} dB", taken.shown))
        errors.append((f"{interpolation}: error × 3", figures.error_shown(taken.image, truth, exposure)))
    crops, places = _check_places(bench, conventional)
    work.draw("check-close-ups.png", figures.close_ups(columns, crops, places))
    work.draw("check-errors.png", figures.close_ups(errors, crops[:1], places[:1]))


def _check_places(bench: Bench, conventional: dict[str, _Taken]) -> tuple[list[Crop], list[str]]:
    size = max(min(bench.light_field.shape[2:4]) * 12 // 100, 8)
    if bench.scene is None:
        pictures = [picture.shown for picture in conventional.values()]
        return figures.detailed_crops(pictures, size), list(conventional)
    sensor = bench.sensor(bench.near)
    return [figures.crop_around(sensor, place, size) for place in CHECK_PLACES.values()], list(CHECK_PLACES)


# --- the end ---


def _finish(work: _Work, bench: Bench, exposure: float) -> DemoReport:
    work.draw("contact-sheet.png", drawn_sheet(work.folder, bench, work.psnr, work.timings))
    write_page(
        work.path("index.html"),
        "demo/page.html",
        title="A virtual computational camera at work",
        bench=bench,
        disparities=bench.light_field.measured_disparity_range() or (0.0, 0.0),
        exposure=exposure,
        psnr=work.psnr,
        timings=work.timings,
        compared=[timing for timing in work.timings if timing.compared],
        gaps=work.gaps,
    )
    files = (*work.files[:-3:-1], *work.files[:-2])
    report = DemoReport(
        work.folder, files, tuple(work.timings), work.psnr, truth_in_words(bench), repr(bench.light_field)
    )
    _print(work.console, report)
    return report


def _print(console: Console, report: DemoReport) -> None:
    from rich.table import Table

    table = Table(title="What each step took")
    table.add_column("step")
    for name in ("first", "again", "faster than the paper’s 8 min"):
        table.add_column(name, justify="right")
    table.add_column("", style="dim")
    for timing in report.timings:
        table.add_row(timing.step, duration(timing.first), duration(timing.again), timing.speed_up, timing.note)
    console.print(table)
    best = max(report.psnr, key=lambda name: report.psnr[name] if math.isfinite(report.psnr[name]) else -1.0)
    console.print(
        f"Simulated pinhole picture against {report.truth}: "
        + ", ".join(f"{name} {value:.1f} dB" for name, value in report.psnr.items())
        + f" (best: {best})"
    )
    console.print(f"Look at [bold]{report.page}[/bold] or [bold]{report.sheet}[/bold]", soft_wrap=True)
    console.print(f"{len(report.files)} files in {report.folder}", soft_wrap=True)
