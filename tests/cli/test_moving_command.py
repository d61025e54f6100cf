"""Commands given the camera file of a camera that changes over time. The oracle is the library."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from tests.command_line import CAMERA, refused, run
from vcc.motion import LightFieldVideo, Lines, MovingCamera, coded, load_moving_camera
from vcc.store import create_video, save_store
from vcc.units import mm, ms

pytestmark = pytest.mark.filterwarnings("ignore::vcc.ResultWarning")  # of noise in few views

MOVING = """
[moving]
sensor.z = { name = "lines", times = ["0 ms", "20 ms"], values = ["51 mm", "53 mm"] }
shutter = { name = "coded", code = "1101", exposure = "20 ms" }
"""


@pytest.fixture
def frames(tmp_path, monkeypatch):
    """Two light fields, the first in a store of its own, both in a video; this is the folder to work in."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "camera.toml").write_text(CAMERA + MOVING)
    (tmp_path / "still.toml").write_text(CAMERA)
    values = np.random.default_rng(1).random((2, 3, 4, 20, 24), dtype=np.float32)
    made = [vcc.LightField.from_views(each, 1e-3, 0.02, 1.3) for each in values]
    save_store(made[0], "s.zarr")
    with create_video("v.zarr") as video:
        for n, frame in enumerate(made):
            video.append(frame, n / 50)
    return made


def captured(*given):
    result = run("capture", "camera.toml", *given, "-o", "picture.npy", "--time-tolerance", "0.05")
    assert result.exit_code == 0, result.output
    return np.load("picture.npy")


def test_capture_takes_a_moving_camera_before_light_that_stays_and_before_a_video(frames):
    still = vcc.load_camera("still.toml")
    moving = MovingCamera(still, {"sensor.z": Lines([0, 20 * ms], [51 * mm, 53 * mm])}, coded("1101", 20 * ms))
    truth = moving.capture(frames[0], 20 * ms, time_tolerance=0.05).upright().values
    for options in ([], ["--executor", "threads"]):
        found = captured("s.zarr", "--exposure-time", "20 ms", *options)
        np.testing.assert_allclose(found, truth, rtol=0, atol=1e-6 * truth.max())
    video = LightFieldVideo(frames, [0, 20 * ms])
    truth = moving.capture(video, 10 * ms, start=5 * ms, time_tolerance=0.05).upright().values
    found = captured("v.zarr", "--start", "5 ms", "--exposure-time", "10 ms")
    np.testing.assert_allclose(found, truth, rtol=0, atol=1e-6 * truth.max())


def test_explain_says_what_changes(frames):
    said = run("explain", "camera.toml", "s.zarr").stdout
    assert said.startswith("What changes over time\n  sensor.z changes linearly, 51 mm at 0 s, 53 mm at 20 ms\n")
    assert "shutter opens and shuts by the code 1101 in 20 ms" in said
    assert str(load_moving_camera("camera.toml").explain(frames[0])).split("Sampling")[0] in said
    assert "What changes" not in run("explain", "still.toml", "s.zarr").stdout


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("capture camera.toml s.zarr -o p.npy", "how long its shutter is open, --exposure-time"),
        ("capture camera.toml v.zarr -o p.npy --start 1ms", "how long its shutter is open, --exposure-time"),
        ("capture camera.toml s.zarr -o p.npy --start 1ms --exposure-time 1ms", "is no video"),
        ("capture still.toml s.zarr -o p.npy --exposure-time 1ms", "still.toml has no table [moving]"),
        ("capture still.toml s.zarr -o p.npy --time-tolerance 0.1", "leave out --time-tolerance"),
        ("capture camera.toml s.zarr -o p.npy --exposure-time 9", "needs a unit"),
        ("expose camera.toml s.zarr -o p.npy", "run vcc capture with --exposure-time"),
        ("plot camera.toml -o p.png", "run vcc capture with --exposure-time"),
        ("sweep camera.toml s.zarr --set main.z=1mm -o t.csv", "run vcc capture with --exposure-time"),
        ("bench camera.toml s.zarr", "run vcc capture with --exposure-time"),
        ("decode raw.tif --camera camera.toml -o f.zarr", "run vcc capture with --exposure-time"),
    ],
)
def test_what_cannot_be_is_refused_with_the_way_out(frames, command, words):
    assert words in refused(*command.split())
