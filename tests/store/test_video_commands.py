"""Commands given a video. The oracle is the library, and for moments between frames the mean of their pictures."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import imagecodecs
import numpy as np
import pytest

import vcc
from tests.command_line import CAMERA, KNOWN, refused, run, write_views
from vcc.store import create_video, open_video

pytestmark = pytest.mark.filterwarnings("ignore::vcc.ResultWarning")  # of noise in few views


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A folder with a camera, a video of three frames, and one of none."""
    folder = tmp_path_factory.mktemp("kept")
    (folder / "camera.toml").write_text(CAMERA)
    with create_video(folder / "v.zarr", provenance={"scene": "noise"}) as frames:
        for n in range(3):
            views = np.random.default_rng(n).random((3, 4, 20, 24, 3), dtype=np.float32)
            frames.append(vcc.LightField.from_views(views, 1e-3, 0.02, 1.3), n / 50)
    create_video(folder / "empty.zarr").__exit__(None, None, None)
    return folder


@pytest.fixture
def video(tmp_path, monkeypatch, kept):
    """Three frames; this is the folder to work in."""
    shutil.copytree(kept, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return open_video("v.zarr")


def captured(*options):
    result = run("capture", "camera.toml", "v.zarr", "-o", "picture.npy", *options)
    assert result.exit_code == 0, result.output
    return np.load("picture.npy")


def test_info_says_what_a_video_is(video):
    result = run("info", "v.zarr")
    assert result.exit_code == 0, result.output
    lines = dict(re.split(r"  +", line, maxsplit=1) for line in result.stdout.splitlines())
    assert lines["format"] == "Zarr store of vcc, a video"
    assert lines["frames"] == "3, 0 s to 40 ms, every 20 ms"
    assert lines["between frames"] == "light of both, mixed by time (linear)"
    assert lines["views"] == "3 × 4 (rows × columns)"
    assert lines["pictures"] == "24 × 20 pixels, 3 channels, float32 linear"
    packed = sum(frame.stored_bytes for frame in video)
    assert (
        lines["size"] == f"{packed / 1e6:,.1f} MB on disk, {3 * 12 * 20 * 24 * 12 / 1e6:,.1f} MB in memory, linear"
    )
    assert lines["scene"] == "noise"
    darkest, brightest = np.quantile([frame.read().values for frame in video], [0.001, 0.999])
    found = re.match(r"(\S+) to (\S+) in linear light", lines["brightness"])
    np.testing.assert_allclose([float(each) for each in found.groups()], [darkest, brightest], rtol=0.1)
    assert run(*lines["one frame"].split()[1:]).exit_code == 0
    assert "on disk" not in run("info", "v.zarr", "--quick").stdout
    with create_video("v.zarr") as frames:
        frames.append(video[0], 0.1)
    assert "4, 0 s to 100 ms, 20 ms to 60 ms apart" in run("info", "v.zarr", "--quick").stdout
    said = run("info", "v.zarr").stdout
    assert "size            about " in said
    assert "stops; of frames 0, 2, 3" in said
    assert "none yet" in run("info", "empty.zarr").stdout


def test_capture_takes_a_moment_or_an_exposure(video):
    camera = vcc.load_camera("camera.toml")
    pictures = [camera.capture(frame).upright().values.astype(np.float64) for frame in video]
    np.testing.assert_array_equal(captured("--start", "20 ms"), pictures[1].astype(np.float32))
    between = captured("--start", "5 ms")
    np.testing.assert_allclose(between, 0.75 * pictures[0] + 0.25 * pictures[1], rtol=1e-6)
    mean = captured("--exposure-time", "40 ms")
    np.testing.assert_allclose(mean, (pictures[0] + 2 * pictures[1] + pictures[2]) / 4, rtol=1e-6)
    np.testing.assert_array_equal(captured("--start", "0 s", "--exposure-time", "40 ms"), mean)
    part = captured("--start", "20 ms", "--exposure-time", "10 ms", "--executor", "threads")
    np.testing.assert_allclose(part, 0.75 * pictures[1] + 0.25 * pictures[2], rtol=1e-6)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("capture camera.toml v.zarr -o p.npy", "is a video from 0 s to 0.04 s: say when, --start"),
        ("capture camera.toml v.zarr -o p.npy --start 1s", "1 s is not within the video, from 0 s to 0.04 s"),
        ("capture camera.toml v.zarr -o p.npy --exposure-time 1s", "the exposure goes from 0 s to 1 s, and"),
        ("capture camera.toml v.zarr -o p.npy --start 0s --spacing 1mm", "leave out --spacing"),
        ("capture camera.toml v.zarr/000000_0.0 -o p.npy --start 0s", "does not change over time: leave"),
        ("capture camera.toml none.zarr -o p.npy --start 0s", "there is no"),
        ("capture camera.toml empty.zarr -o p.npy --start 0s", "has no frame yet"),
        ("explain camera.toml v.zarr", "take one of its frames, v.zarr/000000_0.0"),
        ("refocus v.zarr --distance 1m -o p.png", "take one of its frames"),
        ("convert v.zarr w.zarr", "take one of its frames"),
        ("info v.zarr --picture p.png", "draw the views of one frame, v.zarr/000000_0.0"),
    ],
)  # fmt: skip
def test_what_a_video_is_not_taken_for_is_said(video, command, words):
    assert words in refused(*command.split())


# --- made of folders ---


def take(count, first=1):
    """Folders of views, one for each frame; returns what is in them."""
    for n in range(first, first + count):
        views = write_views(Path(f"take/frame_{n:02d}"))
        for file in Path(f"take/frame_{n:02d}").iterdir():
            file.write_bytes(imagecodecs.png_encode(imagecodecs.png_decode(file.read_bytes()) // n))
    return views


def converted(*options):
    result = run("convert", "take", "take.zarr", "--frame-rate", 25, *options)
    assert result.exit_code == 0, result.output
    return result


@pytest.fixture
def frames(tmp_path, monkeypatch):
    """Folders of two frames; this is the folder to work in. Returns the views of the first."""
    monkeypatch.chdir(tmp_path)
    Path("take").mkdir()
    Path("take/notes.txt").write_text("scene 7")
    return take(2)


def test_folders_become_the_frames_of_a_video(frames):
    said = converted(*KNOWN).stdout
    assert said == "take.zarr: 2 frames, 0 s to 0.04 s, each 3×3 views of 24×20 pixels, uint8 srgb\n"
    video = open_video("take.zarr")
    assert video.times == (0.0, 1 / 25)
    for n, each in enumerate(video, start=1):
        codes = [[each.stored_view(j, i, 0, 20) for i in range(3)] for j in range(3)]
        np.testing.assert_array_equal(codes, frames // n)
    take(1, first=3)
    assert converted(*KNOWN).stdout.startswith("take.zarr: 3 frames, 1 of them new, 0 s to 0.08 s")
    assert converted(*KNOWN).stdout.startswith("take.zarr: 3 frames, none of them new")
    assert "frame rate" in run("info", "take.zarr", "--quick").stdout


def test_what_is_assumed_of_all_frames_is_said_once(frames):
    assert converted("--dtype", "float16").stderr.count("do not state") == 1
    assert open_video("take.zarr")[1].dtype == np.float16
    assert "assumed         spacing, slope_per_pixel, focus_distance" in run("info", "take.zarr", "--quick").stdout


@pytest.mark.parametrize(
    ("harm", "options", "words"),
    [
        (lambda: Path("take/frame_04").mkdir(), "", "frame 3 is missing between frame_02 and frame_04"),
        (lambda: Path("take/frame_002").mkdir(), "", "frame_002 and frame_02 are both frame 2"),
        (lambda: Path("take/other_1").mkdir(), "", "several kinds of numbered names, frame_01, other_1"),
        (lambda: Path("take/frame_03").mkdir(), "", "no light field was found in take/frame_03"),
        (lambda: None, "--overwrite", "leave out --kind and --overwrite"),
        (lambda: run("convert", "take", "take.zarr", "--frame-rate", 30, *KNOWN), "", "frame_rate is 30.0 there"),
        (lambda: create_video("take.zarr"), "", "a video of other frames: converted_from is None there"),
        (lambda: Path("take.zarr").mkdir() or Path("take.zarr/x").write_text(""), "", "is not a video"),
        (lambda: [shutil.rmtree(each) for each in Path("take").glob("f*")], "", "take holds nothing numbered"),
    ],
)  # fmt: skip
def test_folders_that_make_no_video_are_refused(frames, harm, options, words):
    harm()
    assert words in refused("convert", "take", "take.zarr", "--frame-rate", 25, *KNOWN, *options.split())
