"""Commands given a video. The oracle is the library, and for moments between frames the mean of their pictures."""

from __future__ import annotations

import re

import numpy as np
import pytest

import vcc
from tests.command_line import CAMERA, refused, run
from vcc.store import create_video, open_video

pytestmark = pytest.mark.filterwarnings("ignore::vcc.ResultWarning")  # of noise in few views


@pytest.fixture
def video(tmp_path, monkeypatch):
    """Three frames; this is the folder to work in."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "camera.toml").write_text(CAMERA)
    with create_video("v.zarr", provenance={"scene": "noise"}) as frames:
        for n in range(3):
            views = np.random.default_rng(n).random((3, 4, 20, 24, 3), dtype=np.float32)
            frames.append(vcc.LightField.from_views(views, 1e-3, 0.02, 1.3), n / 50)
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
    create_video("empty.zarr")
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
        ("capture camera.toml v.zarr/000000_0.0 -o p.npy --start 0s", "is no video, and stays as it is: leave"),
        ("capture camera.toml none.zarr -o p.npy --start 0s", "there is no"),
        ("capture camera.toml empty.zarr -o p.npy --start 0s", "has no frame yet"),
        ("explain camera.toml v.zarr", "take one of its frames, v.zarr/000000_0.0"),
        ("refocus v.zarr --distance 1m -o p.png", "take one of its frames"),
        ("convert v.zarr w.zarr", "take one of its frames"),
        ("info v.zarr --picture p.png", "draw the views of one frame, v.zarr/000000_0.0"),
    ],
)  # fmt: skip
def test_what_a_video_is_not_taken_for_is_said(video, command, words):
    create_video("empty.zarr").__exit__(None, None, None)
    assert words in refused(*command.split())
