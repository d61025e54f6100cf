"""The demo runs, writes what it says, and its numbers are right."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import vcc
from vcc.base.units import mm
from vcc.demo import DemoReport, Timing, run_demo
from vcc.demo.report import duration, speed_up
from vcc.files.pictures import read_picture
from vcc.showcase.bench import built_in
from vcc.showcase.scene import demo_scene
from vcc.showcase.truth import true_picture
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[DemoReport, str]:
    said = io.StringIO()
    folder = tmp_path_factory.mktemp("demo") / "new" / "folder"
    report = run_demo(folder, small=True, console=Console(file=said, width=200))
    return report, said.getvalue()


def test_every_file_exists_and_shows_something(made: tuple[DemoReport, str]) -> None:
    report, _ = made
    assert {path.name for path in report.files} == {path.name for path in report.folder.iterdir()}
    for path in report.files:
        assert path.stat().st_size > 2000, path.name
        if path.suffix == ".png":
            assert read_picture(path)[0].std() > 10, path.name


def test_the_page_shows_every_picture_and_refers_to_nothing_else(made: tuple[DemoReport, str]) -> None:
    report, _ = made
    page = report.page.read_text(encoding="utf-8")
    for path in report.files:
        if path.suffix == ".png" and path.name not in ("contact-sheet.png", "light-field-middle-view.png"):
            assert f'src="{path.name}"' in page
    assert "http" not in page
    assert str(report.folder) not in page


def test_it_says_what_each_step_took_and_where_things_are(made: tuple[DemoReport, str]) -> None:
    report, said = made
    assert all(timing.first > 0 for timing in report.timings)
    for timing in report.timings:
        assert timing.step in said
    assert "8 min" in said
    assert report.page.name in said


def test_the_pinhole_picture_is_right(made: tuple[DemoReport, str]) -> None:
    psnr = made[0].psnr
    # The small field's pixels are coarse for the scene's edges; 25.8, 27.7 and 28.9 dB were measured.
    assert psnr["nearest"] > 25
    assert psnr["linear"] > psnr["nearest"] + 1
    assert psnr["cubic"] > psnr["linear"] + 0.5
    assert psnr["sharp"] > psnr["cubic"] + 1  # views are means over pixels: their own softness is given back, too


def test_pictures_of_one_scene_are_upright_and_focused_as_named(made: tuple[DemoReport, str]) -> None:
    report, _ = made

    def picture(name: str) -> np.ndarray:
        return read_picture(report.folder / f"{name}.png")[0].astype(float)

    truth = picture("check-truth")
    for name in ("example-1-focused-near", "example-1-focused-far", "check-linear", "light-field-middle-view"):
        small, turned = np.corrcoef(
            [
                truth[20:-20, 20:-20].ravel(),
                picture(name)[20:-20, 20:-20].ravel(),
                picture(name)[-20:20:-1, -20:20:-1].ravel(),
            ]
        )[0, 1:]
        assert small > turned + 0.3  # moving the sensor changes the picture's size a little


def test_the_middle_view_is_the_true_pinhole_picture() -> None:
    """The true picture agrees with the light field where both are smooth: its geometry is independent."""
    bench = built_in(small=True)
    image = bench.pinhole().capture(bench.light_field, interpolation="cubic")
    truth = true_picture(bench)
    assert image.values.sum() == pytest.approx(truth.values.sum(), rel=2e-3)
    assert image.missing_rays < 0.01


def test_no_picture_of_the_built_in_scene_lacks_rays() -> None:
    bench = built_in(small=True)
    for distance in (bench.near, bench.middle, bench.far):
        assert bench.conventional(distance).compile(bench.light_field).missing_rays < 0.002


def test_the_scene_is_radiance_between_0_and_1() -> None:
    s = np.linspace(-0.25, 0.25, 200)
    radiance = demo_scene().radiance_along(0, 0, s[None, :], s[:, None])
    assert radiance.min() >= 0
    assert radiance.max() <= 1 + 1e-6
    assert radiance.std() > 0.1


@pytest.mark.parametrize("convergence", [1.0, np.inf])
def test_someones_own_light_field(tmp_path: Path, convergence: float) -> None:
    """A gantry half a metre wide, in grey; with and without knowing where its views converge."""
    planes = [TexturedPlane(Waves(0.4 * z, seed=n), z, width=0.5 * z) for n, z in enumerate((12.0, 25.0))]
    field = PlanesScene([*planes, TexturedPlane(Waves(8.0), 50.0)]).light_field(
        (5, 5), (48, 64), spacing=0.1, slope_per_pixel=0.5 / 64, focus_distance=20.0, dtype="float32"
    )
    grey = vcc.LightField.from_views(
        field.values[..., 1], 0.1, 0.5 / 64, 20.0 * convergence, disparity_range=field.disparity_range
    )
    report = run_demo(tmp_path, light_field=grey, console=Console(file=io.StringIO()))
    assert all(path.stat().st_size > 300 for path in report.files)
    assert report.psnr["cubic"] > report.psnr["linear"] > report.psnr["nearest"] > 20
    assert "spline" in report.truth
    assert ("were taken to converge" in report.page.read_text(encoding="utf-8")) == np.isinf(convergence)


def test_what_the_demo_cannot_use_is_refused(tmp_path: Path) -> None:
    quiet = Console(file=io.StringIO())
    row = vcc.LightField.from_views(np.ones((1, 4, 8, 8), np.float32), 1 * mm, 1e-3)
    with pytest.raises(vcc.InputError, match="two rows"):
        run_demo(tmp_path, light_field=row, console=quiet)
    flat = vcc.LightField.from_views(np.ones((4, 4, 32, 32), np.float32), 1 * mm, 1e-3)
    with pytest.raises(vcc.InputError, match="no parallax"):
        run_demo(tmp_path, light_field=flat, console=quiet)
    with pytest.raises(vcc.InputError, match="nowhere"):
        run_demo(tmp_path, light_field=tmp_path / "nowhere", console=quiet)
    (tmp_path / "file").touch()
    with pytest.raises(vcc.InputError, match="cannot write to the folder"):
        run_demo(tmp_path / "file" / "folder", console=quiet)


def test_durations_read_well() -> None:
    assert [duration(t) for t in (0.0042, 0.0353, 0.156, 1.84, None)] == [
        "4.2 ms",
        "35 ms",
        "156 ms",
        "1.8 s",
        "–",
    ]
    assert speed_up(Timing("a", 0.156, compared=True)) == "3,100 ×"
    assert speed_up(Timing("a", 0.156)) == ""


def test_the_warm_up_runs_every_loop_that_is_timed_later(monkeypatch):
    """A plan that lets no view through runs nothing, and what is timed next would be compiling.

    With 20×20 views, as the full demo has, those of the corners lie outside the round lens.
    """
    from dataclasses import replace

    from vcc import engines
    from vcc.demo import run
    from vcc.showcase.bench import built_in

    small = built_in(small=True)
    assert small.scene is not None
    views = small.scene.light_field((20, 20), (16, 16), spacing=1e-3, slope_per_pixel=0.03, focus_distance=1.3)
    used = []
    monkeypatch.setattr(engines, "record", lambda plan, values: used.append((plan.taps_used, len(plan.masks))))
    run._warm_up(replace(small, light_field=views))
    assert all(taps > 0 for taps, _ in used)
    assert {masks for _, masks in used} == {0, 1}
