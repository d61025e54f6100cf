"""What is said of a folder's cameras once is kept in it."""

import math
import warnings

import pytest

import vcc
from tests.command_line import run
from vcc.formats import keep_geometry

GIVEN = {"spacing": 2.5e-3, "slope_per_pixel": 1.7e-3, "focus_distance": 1.3}


def opened_in_silence(folder):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return vcc.open_light_field(folder)


@pytest.mark.parametrize(
    ("name", "given"),
    [
        pytest.param(lambda j, i: f"view_{j}_{i}.png", GIVEN, id="all said"),
        pytest.param(lambda j, i: f"view_{j}_{i}.png", {"spacing": (3e-3, 2e-3)}, id="rows further apart"),
        pytest.param(lambda j, i: f"view_{j}_{i}.png", {}, id="all assumed"),
        pytest.param(lambda j, i: f"out_{j:02d}_{i:02d}_{-2.0 * j:f}_{2.0 * i:f}.png", GIVEN, id="gantry"),
        pytest.param(lambda j, i: f"input_Cam{4 * j + i:03d}.png", GIVEN, id="hci"),
    ],
)
def test_opened_again_nothing_is_assumed_and_the_cameras_are_the_same(views, folder_of, name, given):
    if "input" in name(0, 0):  # without a camera file only a square grid is known
        views, name = views[:, :3], lambda j, i: f"input_Cam{3 * j + i:03d}.png"
    folder = folder_of(views, name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)
        before = vcc.open_light_field(folder, **given)
    kept = keep_geometry(folder, **given)
    assert kept == folder / "parameters.cfg"
    after = opened_in_silence(folder)
    assert after.shape == before.shape
    assert after.frame.isclose(before.frame)
    assert (after.values == before.values).all()
    assumed = [each for each in GIVEN if each not in given]
    assert ("# Assumed" in kept.read_text()) == bool(assumed)


def test_nothing_is_overwritten(views, folder_of):
    folder = folder_of(views, lambda j, i: f"view_{j}_{i}.png")
    file = keep_geometry(folder, **GIVEN)
    said = file.read_bytes()
    with pytest.raises(vcc.InputError, match=r"parameters\.cfg states the cameras already"):
        keep_geometry(folder, spacing=1.0)
    assert file.read_bytes() == said
    assert not list(folder.glob(".*"))


def test_what_has_no_place_or_no_need_is_refused(views, folder_of, tmp_path):
    stated = folder_of(views, lambda j, i: f"v_{j:02d}_{i:02d}_{2.0 * j:f}_{2.0 * i:f}_30_36.png")
    with pytest.raises(vcc.InputError, match="state all of its cameras, so there is nothing to keep"):
        keep_geometry(stated)
    vcc.formats.save_light_field(opened_in_silence(stated), tmp_path / "field.npz")
    with pytest.raises(vcc.InputError, match=r"field\.npz is a single file"):
        keep_geometry(tmp_path / "field.npz", **GIVEN)
    with pytest.raises(vcc.InputError, match="spacing"):
        keep_geometry(folder_of(views, lambda j, i: f"view_{j}_{i}.png", "other"), spacing=-1.0)
    assert not (tmp_path / "other" / "parameters.cfg").exists()


def test_what_is_said_goes_before_names(views, folder_of):
    folder = folder_of(views, lambda j, i: f"v_{j:02d}_{i:02d}_{2.0 * j:f}_{2.0 * i:f}_30_36.png")
    keep_geometry(folder, focus_distance=2.0)
    info = vcc.formats.read_geometry(folder)
    assert info.spacing == pytest.approx((2e-3, 2e-3))
    assert info.focus_distance == 2.0
    assert info.directions == (1, 1)  # of the names, which say how the views are ordered


def test_kept_from_the_command_line(views, folder_of):
    folder = folder_of(views, lambda j, i: f"view_{j}_{i}.png")
    first = run("info", folder)
    assert first.stdout.count("not stated: assumed") == 3
    assert "with --keep they are kept in the folder" in first.stdout
    assert "do not state" not in first.stderr  # the lines say it
    tried = run("info", folder, "--spacing", "2 mm", "--quick").stdout
    assert "2 mm\n" in tried
    assert not (folder / "parameters.cfg").exists()
    kept = run(
        "info", folder, "--keep", "--spacing", "2 mm", "--slope-per-pixel", "0.002", "--focus-distance", "inf"
    )
    assert kept.exit_code == 0, kept.output
    assert "kept             " + str(folder / "parameters.cfg") in kept.stdout
    assert "assumed" not in kept.stdout
    info = vcc.formats.read_geometry(folder)
    assert info.spacing == pytest.approx((2e-3, 2e-3))
    assert math.isinf(info.focus_distance)
    assert info.unknown == ()
    again = run("info", folder, "--keep")
    assert again.exit_code != 0
    assert "states the cameras already" in again.stderr


def test_what_is_kept_without_anybody_having_said_it_is_named(views, folder_of):
    kept = run(
        "info", folder_of(views, lambda j, i: f"view_{j}_{i}.png"), "--keep", "--spacing", "2 mm", "--quick"
    )
    assert "parameters.cfg; assumed, because not stated: slope per pixel, focus distance." in kept.stdout


def test_beside_a_camera_file_that_says_less(square_views, folder_of):
    """Cambridge's says where the cameras stand, and which way they are counted: that stays."""
    folder = folder_of(square_views[::-1, ::-1], lambda j, i: f"{j:02d}_{i:02d}.png")
    (folder / "param.txt").write_text("num_x: 3\nnum_y: 3\nbase_x: 0.002\nbase_y: 0.002\n")
    with pytest.warns(vcc.ResultWarning):
        before = vcc.open_light_field(folder, slope_per_pixel=1e-3)
    keep_geometry(folder, slope_per_pixel=1e-3)
    with pytest.warns(vcc.ResultWarning, match="order of the rows and columns"):
        after = vcc.open_light_field(folder)
    assert after.frame.isclose(before.frame)
    assert (after.values == before.values).all()
