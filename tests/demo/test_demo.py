"""The demo runs, writes what it says, and says what it did. Its scene and bench are tested in tests/showcase."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imagecodecs import png_encode
from rich.console import Console

import vcc
from vcc.base.units import mm
from vcc.demo import DemoReport, Timing, run_demo
from vcc.demo.run import few_views, kinds_of_camera
from vcc.files.pictures import read_picture
from vcc.showcase import figures
from vcc.showcase.bench import built_in
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
    assert report.files[:2] == (report.page, report.sheet)
    for path in report.files:
        if path.suffix == ".png":
            assert read_picture(path)[0].std() > 10, path.name  # of 255: it is no even area


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
    page = report.page.read_text(encoding="utf-8")
    assert all(timing.first > 0 for timing in report.timings)
    for timing in report.timings:
        assert timing.step in said
        assert timing.step in page
    assert "8 min" in said
    assert report.page.name in said
    for name, value in report.psnr.items():
        assert f"{name} {value:.1f} dB" in said
        assert f"{name.capitalize()} {value:.1f} dB" in page


def test_someones_own_light_field(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In grey, without knowing where its views converge; figures are made but not drawn, as above they are."""
    grey_pixels = png_encode(np.full((8, 8, 3), 128, np.uint8))
    monkeypatch.setattr(figures, "write_figure", lambda figure, path: path.write_bytes(grey_pixels))
    scene = PlanesScene([TexturedPlane(Waves(0.5), 1.0, width=0.4), TexturedPlane(Waves(1.0), 2.0)])
    field = scene.light_field((4, 4), (32, 40), spacing=5 * mm, slope_per_pixel=0.02, focus_distance=1.5)
    grey = vcc.LightField.from_views(field.values[..., 1], 5 * mm, 0.02, disparity_range=field.disparity_range)
    report = run_demo(tmp_path, light_field=grey, console=Console(file=io.StringIO()))
    assert all(path.exists() for path in report.files)
    assert report.psnr["cubic"] > report.psnr["nearest"]
    assert "spline" in report.truth
    assert "were taken to converge" in report.page.read_text(encoding="utf-8")


def test_a_folder_that_cannot_be_written_to_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(vcc.InputError, match="cannot write to the folder"):
        run_demo(tmp_path / "file" / "folder", console=Console(file=io.StringIO()))


def test_speed_is_compared_where_the_work_is_the_same() -> None:
    assert Timing("a", 0.156, compared=True).speed_up == "3,100 ×"
    assert Timing("a", 0.156).speed_up == ""


def test_the_warm_up_runs_every_loop_that_is_timed_later() -> None:
    """A plan that lets no view through runs nothing, and what is timed next would be compiling.

    With 20×20 views, as the full demo has, those of the corners lie outside the round lens.
    """
    small = built_in(small=True)
    assert small.scene is not None
    views = small.scene.light_field((20, 20), (16, 16), spacing=1e-3, slope_per_pixel=0.03, focus_distance=1.3)
    bench = replace(small, light_field=views)
    plans = [camera.compile(few_views(bench)) for camera in kinds_of_camera(bench)]
    assert all(plan.core.taps_used > 0 for plan in plans)
    assert {len(plan.core.masks) for plan in plans} == {0, 1}
