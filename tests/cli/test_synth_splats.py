"""Light fields from Gaussian splats, on the command line."""

import json

import imagecodecs
import numpy as np
import pytest

from tests.command_line import refused, run
from tests.sources.splat_clouds import spheres
from vcc.sources.splats import write_ply
from vcc.store import open_store

BALLS = [((-0.3, 0.0, 2.0), 0.4), ((0.5, 0.2, 4.0), 0.7)]
SMALL = ("--views", 3, 3, "--pixels", 30, 40)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_ply(spheres(BALLS, 1500), tmp_path / "balls.ply")
    # a camera at the origin that looks along +z, as cameras.json of 3D Gaussian splatting has it
    pose = {"img_name": "front", "width": 40, "height": 30, "fx": 40.0, "fy": 40.0, "position": [0, 0, 0]}
    (tmp_path / "cameras.json").write_text(json.dumps([pose | {"rotation": np.eye(3).tolist()}]))
    return tmp_path


def test_views_have_the_parallax_that_was_asked_for(folder):
    result = run("synth", "splats", "balls.ply", "-o", "balls.zarr", *SMALL, "--camera-from", "cameras.json",
                 "--parallax", 0.7, "--unit", "10 cm")  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "camera 0 (front)" in result.output
    stored = open_store("balls.zarr")
    disparity = stored.disparity.maps().values[0]
    solid = disparity > disparity.min() + 1e-6  # but for the background
    # The nearest and farthest 2 % of the pixels do not count, and the ends are measured at a low resolution.
    assert np.percentile(disparity[solid], 99) == pytest.approx(0.7, abs=0.05)
    assert np.percentile(disparity[solid], 1) == pytest.approx(-0.7, abs=0.05)
    # the nearest point of the first ball is 1.6 units of 10 cm away
    assert stored.distance_of(float(np.percentile(disparity[solid], 99))) == pytest.approx(0.16, abs=0.003)
    assert stored.read().values[1, 1, 14, 14].argmax() == 0  # the red ball, a bit to the left


@pytest.mark.parametrize("poses", [(), ("--camera-from", "cameras.json")])
def test_look_lists_cameras_and_draws_them(folder, poses):
    result = run("synth", "splats", "balls.ply", "--look", "-o", "sheet.png", "--pixels", 30, 40, *poses)
    assert result.exit_code == 0, result.output
    count = 1 if poses else 12
    assert f"3000 splats, harmonics of degree 0, srgb; {count} cameras:" in result.stdout
    lines = result.stdout.splitlines()
    assert len(lines) == 2 + count + 1
    assert lines[2].split()[-1] == ("front" if poses else "0°")
    if poses:  # 2 − 0.4 m
        assert lines[2].split()[2:4] == ["1.6", "m"]
    sheet = imagecodecs.png_decode((folder / "sheet.png").read_bytes())[..., :3].astype(int)
    for colour in range(2):  # both balls are drawn
        others = np.delete(sheet, colour, axis=-1).max(axis=-1)
        assert ((sheet[..., colour] > 150) & (others < 100)).sum() > 100


def test_views_from_a_file_by_an_executor_have_the_same_bytes(folder):
    (folder / "there").mkdir()
    (folder / "cameras.json").rename(folder / "there/cameras.json")
    (folder / "there/views.toml").write_text(
        'views = [3, 3]\npixels = [30, 40]\ncamera_from = "cameras.json"\nfocus_distance = "2.5 m"\n'
        'unit = "1 m"\naperture = ["30 mm", "60 mm"]\n'
    )
    result = run("synth", "splats", "balls.ply", "there/views.toml", "-o", "a.zarr", "--focus-distance", "3 m")
    assert result.exit_code == 0, result.output
    assert "converge at 3 m, 20 mm apart" in result.output
    options = ("--camera-from", "there/cameras.json", "--focus-distance", "3 m", "--aperture", "30 mm, 60 mm")
    result = run("synth", "splats", "balls.ply", "-o", "b.zarr", *SMALL, *options, "--executor", "threads")
    assert result.exit_code == 0, result.output
    a, b = (open_store(name) for name in ("a.zarr", "b.zarr"))
    assert a.grid.frame == b.grid.frame
    assert a.read().values.tobytes() == b.read().values.tobytes()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("views = [3", "views.toml is not TOML"),
        ("views = " + "[" * 9999, "views.toml is not TOML"),
        ('colour = "red"', "colour does not describe views"),
        ("views = {}", "views is {}: write two whole numbers"),
        ("views = [3, 3]\naperture = 20", "aperture"),
        ('direction = "0, 0, 1"', "--direction"),
        ("views = [3, 2.5]", "views is [3, 2.5]: write two whole numbers"),
        ('camera_from = ["a.json", "b.json"]', "write the name of a file"),
        ('aperture = "--help"', '--aperture is "--help"'),
    ],
)
def test_files_of_views_that_are_none(folder, text, message):
    (folder / "views.toml").write_text(text)
    assert message in refused("synth", "splats", "balls.ply", "views.toml", "-o", "a.zarr")
    assert not (folder / "a.zarr").exists()


def test_eye_and_target(folder):
    result = run("synth", "splats", "balls.ply", "-o", "a.zarr", *SMALL, "--eye", "0, 0, 8", "--target", "0, 0, 0",
                 "--aperture", "20 mm", "--focus-distance", "4 m", "--field-of-view", "40 deg")  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "converge at 4 m, 6.67 mm apart" in result.output
    # seen from behind: the blue-green ball is now the nearer one, on the left
    assert open_store("a.zarr").read().values[1, 1, 15, 8].argmax() == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "give --output STORE.zarr"),
        (("-o", "a.npz"), ".zarr"),
        (("-o", "a.zarr", "--camera", 12), "--camera is 12, and there are the cameras 0 to 11"),
        (("-o", "a.zarr", "--eye", "0, 0, 1"), "give both"),
        (("-o", "a.zarr", "--aperture", "1 mm", "--parallax", 1), "give one of them"),
        (("-o", "a.zarr", "--camera-from", "poses.npy"), "transforms.json"),
        (("-o", "a.zarr", "--eye", "0, 0, 9", "--target", "0, 0, 99"), "are behind the array"),
        (("-o", "a.zarr", "--degree", 3), "degree of the harmonics"),
        (("--look", "--degree", 3), "degree of the harmonics"),
        (("--look", "-o", "a.zarr"), ".png"),
        (("-o", "a.zarr", "--executor", "cluster"), "--executor is processes"),
        (("-o", "a.zarr", "a.toml", "b.toml"), "one file of views"),
        (("-o", "a.zarr", "a.toml"), "a.toml"),
    ],
)
def test_bad_input(folder, options, message):
    assert message in refused("synth", "splats", "balls.ply", *options)
    assert sorted(path.name for path in folder.iterdir()) == ["balls.ply", "cameras.json"]
