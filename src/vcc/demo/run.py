"""`run_demo`: from a light field to a folder of pictures that explain the paper."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vcc.base.errors import InputError, ResultWarning
from vcc.camera import Camera
from vcc.demo import story
from vcc.demo.report import DemoReport, Timing, duration, speed_up
from vcc.image import Image
from vcc.light_field import LightField
from vcc.run.drive import drive
from vcc.showcase import figures
from vcc.showcase.bench import Bench, built_in, from_someone
from vcc.showcase.figures import Crop, SheetRow, Shown
from vcc.showcase.page import write_page
from vcc.showcase.truth import psnr, true_picture
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Uniform

if TYPE_CHECKING:
    from rich.console import Console

INTERPOLATIONS = ("nearest", "linear", "cubic", "sharp")
PAPER_SHAPE = (20, 20, 500, 500)


def run_demo(
    output: Path,
    light_field: Path | LightField | None = None,
    small: bool = False,
    console: Console | None = None,
) -> DemoReport:
    """Do the paper's two examples and its own check, and write pictures and a page that explain them.

    Args:
        output: the folder for pictures, ``index.html`` and ``contact-sheet.png``; made if missing.
        light_field: a light field, or a folder that `vcc.open_light_field` reads, instead of the built-in
            scene.
        small: a smaller light field (8×8 views of 160×160 pixels; of someone's own, every second view and
            pixel), for a quick look.
        console: where to print progress and results; None prints to the standard output.

    Returns:
        Where the files are, what each step took in seconds, and the check's PSNR in decibels.

    Raises:
        InputError: the folder cannot be made or written to, or the light field cannot be used.
    """
    if console is None:
        from rich.console import Console

        console = Console()
    work = _Work(_made(Path(output)), console)
    begun = time.perf_counter()
    bench = _light_field(work, light_field, small)
    _show_light_field(work, bench)
    conventional = _example_one(work, bench)
    _example_two(work, bench, conventional)
    truth_text = _check(work, bench, conventional)
    work.timings.append(Timing("everything, drawings and files included", time.perf_counter() - begun))
    return _finish(work, bench, truth_text)


@dataclass
class _Work:
    """What has been done so far."""

    folder: Path
    console: Console
    timings: list[Timing] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    psnr: dict[str, float] = field(default_factory=dict)
    crops: list[Crop] = field(default_factory=list)
    told: story.Told = field(default_factory=story.Told)

    def path(self, name: str) -> Path:
        """Where a file goes; it is remembered."""
        path = self.folder / name
        self.files.append(path)
        return path

    def draw(self, name: str, figure: Any) -> None:
        """Write a figure, or the figure of axes."""
        figures.write_figure(getattr(figure, "figure", figure), self.path(name))

    @contextmanager
    def status(self, words: str) -> Iterator[None]:
        """Say what is going on, while it is."""
        with self.console.status(words):
            yield

    @contextmanager
    def bar(self, words: str) -> Iterator[Callable[[int, int], None]]:
        """A progress bar; yields what to call with (done, total)."""
        from rich.progress import Progress

        with Progress(console=self.console, transient=True) as progress:
            task = progress.add_task(words, total=None)
            yield lambda done, total: progress.update(task, completed=done, total=total)


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
    with work.status("compiling"):
        begun = time.perf_counter()
        if given is None:
            _tiny().light_field((1, 1), (2, 2), spacing=1e-3, slope_per_pixel=1e-3)
        compiling = time.perf_counter() - begun
    with work.bar("light field") as progress:
        begun = time.perf_counter()
        bench = built_in(small, progress) if given is None else from_someone(given, small, progress)
        made = time.perf_counter() - begun
    with work.status("compiling"):
        begun = time.perf_counter()
        _warm_up(bench)
        compiling += time.perf_counter() - begun
    values = bench.light_field.values
    sizes = "×".join(map(str, values.shape))
    work.timings.append(
        Timing("compiling the loops", compiling, note="once on a machine: kept on disk for the next run")
    )
    verb = "synthesizing" if given is None else "reading"
    work.timings.append(Timing(f"{verb} the light field", made, note=f"{sizes}, {values.nbytes / 1e6:.0f} MB"))
    work.console.print(f"{bench.light_field!r}")
    if bench.assumed:
        work.console.print(bench.assumed)
    return bench


def _tiny() -> PlanesScene:
    return PlanesScene([TexturedPlane(Uniform(), 1.0)])


def _warm_up(bench: Bench) -> None:
    """Run each kind of plan once on a few views, so that what follows is not compiling.

    Views of the middle: those of the corners lie outside the round lens, and a plan passes them over.
    """
    row, column = (n // 2 for n in bench.light_field.shape[:2])
    middle = bench.light_field[row - 1 : row + 1, column - 1 : column + 1, :8, :8]
    middle = middle.replaced(np.ascontiguousarray(middle.values))
    for camera in (bench.conventional(bench.near), bench.cosine(), bench.coded()):
        for interpolation in INTERPOLATIONS:
            drive(camera.compile(middle, interpolation=interpolation), middle)


def _show_light_field(work: _Work, bench: Bench) -> None:
    light_field = bench.light_field
    rows, columns = light_field.shape[:2]
    light_field.view(rows // 2, columns // 2).save(work.path("light-field-middle-view.png"), exposure=1.0)
    work.draw("light-field-views.png", figures.views_figure(light_field))
    work.told.light_field(bench)


# --- pictures ---


@dataclass(frozen=True)
class _Taken:
    """A picture that a camera took, how it is shown, and how long it took."""

    image: Image
    exposure: float
    shown: Shown
    first: float
    again: float


def _take(
    work: _Work, bench: Bench, camera: Camera, name: str, exposure: float, interpolation: str = "sharp"
) -> _Taken:
    """Capture twice, timed, and write the picture."""
    seconds = []
    with warnings.catch_warnings(), work.status(name):
        warnings.simplefilter("ignore", ResultWarning)  # the page says what share of the rays is missing
        for _ in range(2):
            begun = time.perf_counter()
            image = camera.capture(bench.light_field, interpolation=interpolation)
            seconds.append(time.perf_counter() - begun)
    if image.missing_rays > 0.01:
        work.told.missing(name, image.missing_rays)
    image.save(work.path(f"{name}.png"), exposure=exposure)
    return _Taken(image, exposure, figures.shown(image, exposure), *seconds)


def _example_one(work: _Work, bench: Bench) -> dict[str, _Taken]:
    distances = {"near": bench.near, "middle": bench.middle, "far": bench.far}
    exposure = bench.exposure(bench.conventional(bench.middle), bench.diameter)
    taken = {}
    for name, distance in distances.items():
        camera = bench.conventional(distance)
        taken[name] = _take(work, bench, camera, f"example-1-focused-{name}", exposure)
        away = story.away(distance)
        note = f"one lens, sensor at {story.length(camera.sensor.z)}"
        work.timings.append(
            Timing(f"Example 1: focused {name}, {away}", taken[name].first, taken[name].again, note)
        )
    work.crops = _crops(bench, taken)
    begun = time.perf_counter()
    _draw_example_one(work, bench, taken)
    work.timings.append(Timing("Example 1: camera and phase space drawn", time.perf_counter() - begun))
    work.told.example_one(bench, exposure)
    return taken


def _draw_example_one(work: _Work, bench: Bench, taken: dict[str, _Taken]) -> None:
    from vcc.plot import plot_phase_space_stages

    far = bench.conventional(bench.far)
    work.draw("example-1-camera.png", far.plot(light_field=bench.light_field))
    points = figures.points_field(bench.focal_length, bench.diameter)
    focused_far_away = bench.conventional(math.inf)
    work.draw("example-1-phase-space-points.png", plot_phase_space_stages(focused_far_away, points))
    pixel_row = round(0.46 * bench.light_field.shape[2])
    work.draw(
        "example-1-phase-space-scene.png",
        plot_phase_space_stages(far, bench.light_field, pixel_row=pixel_row),
    )
    columns = [(f"focused {name}", picture.shown) for name, picture in taken.items()]
    work.draw("example-1-close-ups.png", figures.close_ups(columns, work.crops, story.places(bench)))


def _crops(bench: Bench, taken: dict[str, _Taken]) -> list[Crop]:
    """Where to look closely: known places of the built-in scene, else what is sharp in one picture only."""
    size = max(min(bench.light_field.shape[2:4]) * 13 // 100, 8)
    if bench.scene is None:
        return figures.detailed_crops([picture.shown for picture in taken.values()], size)
    return [_around(bench, place, size) for place in story.PLACES.values()]


def _around(bench: Bench, place: tuple[float, float, float], size: int) -> Crop:
    """The square around a point (X, Y) at a distance, as the camera focused near shows it."""
    x, y, distance = place
    sensor = bench.sensor(bench.near)
    # Through the middle of the lens; upright, the picture runs the way the scene does.
    column = (sensor.shape[1] - 1) / 2 + x / distance * sensor.z / sensor.pitches[1]
    row = (sensor.shape[0] - 1) / 2 + y / distance * sensor.z / sensor.pitches[0]
    return Crop(round(row) - size // 2, round(column) - size // 2, size)


def _example_two(work: _Work, bench: Bench, conventional: dict[str, _Taken]) -> None:
    full = bench.light_field.shape[:4] == PAPER_SHAPE
    taken = {}
    for name, camera, title, open_share in (
        ("cosine", bench.cosine(), "cosine mask near the sensor", 0.25),
        ("coded", bench.coded(), "coded mask half-way", 0.5),
    ):
        exposure = bench.exposure(bench.conventional(bench.middle), bench.diameter, open_share)
        taken[name] = _take(work, bench, camera, f"example-2-{name}", exposure)
        work.timings.append(
            Timing(
                f"Example 2: {title}",
                taken[name].first,
                taken[name].again,
                "one mask in mid-path" + (", three channels for the paper’s one" if full else ""),
                compared=full,
            )
        )
    unmasked = conventional["near" if bench.masked_focus == bench.near else "middle"]
    _draw_example_two(work, bench, {"no mask": unmasked, **taken})
    work.told.example_two(bench)


def _draw_example_two(work: _Work, bench: Bench, taken: dict[str, _Taken]) -> None:
    cameras = {"cosine": bench.cosine(), "coded": bench.coded()}
    for name, camera in cameras.items():
        work.draw(f"example-2-{name}-camera.png", camera.plot(light_field=bench.light_field))
    masks = [(story.MASK_TITLES[name], camera.elements[-1]) for name, camera in cameras.items()]
    width = max(cameras["cosine"].sensor.size) * 0.9
    work.draw("example-2-masks.png", figures.mask_figure(masks, width))
    titles = {"no mask": "no mask", **story.MASK_TITLES}
    columns = [(titles[name], picture.shown) for name, picture in taken.items()]
    work.draw("example-2-close-ups.png", figures.close_ups(columns, work.crops, story.places(bench)))


def _check(work: _Work, bench: Bench, conventional: dict[str, _Taken]) -> str:
    camera = bench.pinhole()
    exposure = bench.exposure(camera, bench.pinhole_diameter)
    with work.status("the true picture"):
        begun = time.perf_counter()
        truth = true_picture(bench)
        seconds = time.perf_counter() - begun
    truth.save(work.path("check-truth.png"), exposure=exposure)
    columns = [("truth", figures.shown(truth, exposure))]
    errors = []
    for interpolation in INTERPOLATIONS:
        taken = _take(work, bench, camera, f"check-{interpolation}", exposure, interpolation)
        work.psnr[interpolation] = psnr(taken.image, truth, 1 / exposure)
        work.timings.append(
            Timing(
                f"check: pinhole picture, {interpolation}",
                taken.first,
                taken.again,
                f"PSNR {work.psnr[interpolation]:.1f} dB against the truth",
            )
        )
        columns.append((f"{interpolation}, {work.psnr[interpolation]:.1f} dB", taken.shown))
        errors.append((f"{interpolation}: error × 3", figures.error_shown(taken.image, truth, exposure)))
    work.timings.append(Timing("check: the true picture", seconds, note=story.truth_in_words(bench)))
    crops = _check_crops(bench, conventional)
    work.draw("check-close-ups.png", figures.close_ups(columns, crops, story.check_places(bench)))
    work.draw("check-errors.png", figures.close_ups(errors, [crops[0]], [story.check_places(bench)[0]]))
    work.told.check(bench, work.psnr)
    return story.truth_in_words(bench)


def _check_crops(bench: Bench, conventional: dict[str, _Taken]) -> list[Crop]:
    size = max(min(bench.light_field.shape[2:4]) * 12 // 100, 8)
    if bench.scene is None:
        return figures.detailed_crops([picture.shown for picture in conventional.values()], size)
    return [_around(bench, place, size) for place in story.CHECK_PLACES.values()]


# --- the end ---


def _finish(work: _Work, bench: Bench, truth: str) -> DemoReport:
    folder = work.folder
    rows = [
        SheetRow(row.title, row.text, [(name, folder / file) for name, file in row.pictures])
        for row in story.sheet_rows(bench, work.psnr, work.timings)
    ]
    work.draw("contact-sheet.png", figures.contact_sheet("Virtual Computational Camera", rows))
    page = work.path("index.html")
    write_page(page, story.TITLE, story.introduction(bench, work.timings), work.told.sections(work.timings))
    first = [page, folder / "contact-sheet.png"]
    files = (*first, *(file for file in work.files if file not in first))
    report = DemoReport(folder, files, tuple(work.timings), dict(work.psnr), truth, repr(bench.light_field))
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
        table.add_row(timing.step, duration(timing.first), duration(timing.again), speed_up(timing), timing.note)
    console.print(table)
    best = max(report.psnr, key=lambda name: report.psnr[name] if math.isfinite(report.psnr[name]) else -1.0)
    console.print(
        f"Simulated pinhole picture against {report.truth}: "
        + ", ".join(f"{name} {value:.1f} dB" for name, value in report.psnr.items())
        + f" (best: {best})"
    )
    console.print(f"Look at [bold]{report.page}[/bold] or [bold]{report.sheet}[/bold]", soft_wrap=True)
    console.print(f"{len(report.files)} files in {report.folder}", soft_wrap=True)
