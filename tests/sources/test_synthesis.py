"""Views asked for in turn: kept as they are done, gone on with after failures and kills, never mixed."""

import math
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import vcc
from tests.command_line import run as run_command
from vcc import InputError
from vcc.base.units import mm
from vcc.sources import CameraArray
from vcc.sources.synthesis import synthesize

CAMERAS = CameraArray((2, 3), (4, 5), 2 * mm, 0.01, 1.3)


class Numbers:
    """Each view is a picture of its own number; stops at one of them if told to."""

    def __init__(self, stops_at=None, brightness=1.0, killed=False):
        self.stops_at, self.brightness, self.killed = stops_at, brightness, killed
        self.asked = []

    def description(self):
        return {"name": "numbers", "brightness": self.brightness}

    def render(self, camera):
        self.asked.append((camera.row, camera.column))
        if (camera.row, camera.column) == self.stops_at:
            if self.killed:
                os.kill(os.getpid(), signal.SIGKILL)
            raise RuntimeError("the lamp has burnt out")
        rows, columns = camera.pixels
        picture = np.full((rows, columns, 3), (10 * camera.row + camera.column) / 32, np.float32)
        picture[0, 0] = camera.x + 0.5, camera.left + 0.5, self.brightness  # what the camera is
        return picture


def whole():
    """The light field of `Numbers`, view by view."""
    values = np.empty((2, 3, 4, 5, 3), np.float32)
    for row, column in np.ndindex(2, 3):
        values[row, column] = Numbers().render(CAMERAS.camera(row, column))
    return values


def test_in_memory():
    steps = []
    made = synthesize(
        Numbers(), CAMERAS, dtype="float32", progress=lambda done, total: steps.append((done, total))
    )
    assert isinstance(made, vcc.LightField)
    assert np.array_equal(made.values, whole())
    assert made.frame == CAMERAS.frame
    assert steps == [(n, 6) for n in range(7)]


@pytest.mark.parametrize("dtype", ["float16", "uint8", "uint16"])
def test_precision_of_what_is_kept(dtype):
    values = synthesize(Numbers(), CAMERAS, dtype=dtype)[..., 1:, 1:, :].values
    scale = 1 if dtype == "float16" else np.iinfo(dtype).max
    # n/32 is exact in float16; integers are rounded to the nearest.
    expected = whole()[..., 1:, 1:, :].astype(np.float64)
    assert values.dtype == dtype
    assert np.abs(values.astype(np.float64) / scale - expected).max() <= (0 if scale == 1 else 0.5 / scale)


def test_what_integers_cannot_hold_is_cut_off_and_said():
    # One sample in 60 is 3.
    with pytest.warns(vcc.ResultWarning, match="^1.7 % of the samples were brighter"):
        made = synthesize(Numbers(brightness=3.0), CAMERAS, dtype="uint8")
    assert (made.values[:, :, 0, 0, 2] == 255).all()


def test_a_store_is_what_memory_is(tmp_path):
    made = synthesize(Numbers(), CAMERAS, tmp_path / "numbers.zarr", dtype="float32")
    assert np.array_equal(made.read().values, whole())
    assert made.frame == CAMERAS.frame
    assert made.complete
    assert made.provenance["renderer"] == Numbers().description()
    again = Numbers()
    assert np.array_equal(
        synthesize(again, CAMERAS, tmp_path / "numbers.zarr", dtype="float32").read().values, whole()
    )
    assert again.asked == []  # all there already


@pytest.mark.parametrize("focus", [1.3, math.inf])
def test_a_failure_keeps_what_is_done_and_the_same_call_goes_on(tmp_path, focus):
    cameras = CameraArray((2, 3), (4, 5), 2 * mm, 0.01, focus)
    path = tmp_path / "half done.zarr"
    with pytest.raises(InputError) as failure:
        synthesize(Numbers(stops_at=(1, 1)), cameras, path, dtype="float32")
    for words in (
        "view (1, 1) could not be rendered",
        "RuntimeError: the lamp has burnt out",
        "4 of 6 views are kept in",
        "half done.zarr",
    ):
        assert words in str(failure.value)
    steps, second = [], Numbers()
    made = synthesize(second, cameras, path, dtype="float32", progress=lambda *step: steps.append(step))
    assert second.asked == [(1, 1), (1, 2)]
    assert steps == [(4, 6), (5, 6), (6, 6)]
    assert made.complete
    assert np.array_equal(made.read().values[1:, 2], Numbers().render(cameras.camera(1, 2))[None])


@pytest.mark.parametrize("store", [None, "threads.zarr"])
def test_an_executor_renders_the_same_views(tmp_path, store):
    path, steps = store and tmp_path / store, []
    if path is not None:  # goes on where one process has stopped
        with pytest.raises(InputError, match="4 of 6 views are kept"):
            synthesize(Numbers(stops_at=(1, 1)), CAMERAS, path, dtype="uint8")
    with ThreadPoolExecutor(2) as pool:
        made = synthesize(
            Numbers(), CAMERAS, path, dtype="uint8", executor=pool, progress=lambda *step: steps.append(step)
        )
        again = made if path is None else made.read()
        assert again.values.tobytes() == synthesize(Numbers(), CAMERAS, dtype="uint8").values.tobytes()
        assert steps == [(n, 6) for n in range(0 if path is None else 4, 7)]
        with pytest.raises(InputError, match=r"view \(1, 1\) could not be rendered[^$]*Give store="):
            synthesize(Numbers(stops_at=(1, 1)), CAMERAS, executor=pool)
        cannot = Numbers()
        cannot.lamp = lambda: None
        with pytest.raises(InputError, match="cannot be sent to other processes"):
            synthesize(cannot, CAMERAS, executor=pool)


def test_a_kill_keeps_what_is_done(tmp_path):
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from tests.sources.test_synthesis import CAMERAS, Numbers\n"
        "from vcc.sources.synthesis import synthesize\n"
        "synthesize(Numbers(stops_at=(1, 0), killed=True), CAMERAS, sys.argv[2], dtype='float32')\n"
    )
    path = tmp_path / "killed.zarr"
    killed = subprocess.run([sys.executable, "-c", code, str(Path(__file__).parents[2]), str(path)])
    assert killed.returncode == -signal.SIGKILL
    second = Numbers()
    assert np.array_equal(synthesize(second, CAMERAS, path, dtype="float32").read().values, whole())
    assert second.asked == [(1, 0), (1, 1), (1, 2)]


@pytest.mark.parametrize(
    "change",
    [
        {"renderer": Numbers(brightness=0.5)},
        {"cameras": CameraArray((2, 3), (4, 5), 3 * mm, 0.01, 1.3)},
        {"dtype": "float16"},
    ],
    ids=["renderer", "cameras", "dtype"],
)
def test_a_changed_description_is_refused(tmp_path, change):
    with pytest.raises(InputError, match="burnt out"):
        synthesize(Numbers(stops_at=(1, 1)), CAMERAS, tmp_path / "a.zarr", dtype="float32")
    call = {"renderer": Numbers(), "cameras": CAMERAS, "dtype": "float32"} | change
    with pytest.raises(InputError, match=r"a\.zarr"):
        synthesize(call["renderer"], call["cameras"], tmp_path / "a.zarr", dtype=call["dtype"])
    assert np.array_equal(
        synthesize(Numbers(), CAMERAS, tmp_path / "a.zarr", dtype="float32").read().values, whole()
    )


class Wrong(Numbers):
    def __init__(self, picture):
        super().__init__()
        self.picture = picture

    def render(self, camera):
        return self.picture


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (np.zeros((5, 4, 3), np.float32), r"shape \(5, 4, 3\), and \(4, 5, 3\) was requested"),
        (np.zeros((4, 5, 3), np.uint8), "came as uint8"),
        (np.full((4, 5, 3), np.nan, np.float32), "60 values that are not valid radiance"),
        (np.full((4, 5, 3), -1e-3, np.float32), "60 values that are not valid radiance"),
        (np.full((4, 5, 3), 7e4, np.float32), 'float16 ends at 65504: take dtype="float32"'),
    ],
)
def test_pictures_that_are_none_are_refused(picture, message):
    with pytest.raises(InputError, match=message) as failure:
        synthesize(Wrong(picture), CAMERAS)
    assert str(failure.value).startswith("view (0, 0) ")
    assert "Give store=" in str(failure.value)


def test_another_dtype_is_refused():
    with pytest.raises(InputError, match="not int8"):
        synthesize(Numbers(), CAMERAS, dtype="int8")


def run(*arguments):
    return run_command("synth", *arguments)


def test_planes_on_the_command_line(tmp_path):
    from vcc.store import open_store

    path = tmp_path / "planes.zarr"
    done = run(
        *("planes", "-o", path, "--views", 2, 3, "--pixels", 12, 16, "--aperture", "10 mm, 30 mm"),
        *("--field-of-view", "20 deg", "--focus-distance", "inf"),
    )
    assert done.exit_code == 0, done.output
    assert "2×3 views of 12×16 pixels" in done.stdout
    made = open_store(path)
    assert made.shape == (2, 3, 12, 16, 3)
    cameras = CameraArray.over_aperture(
        (10 * mm, 30 * mm), math.radians(20), views=(2, 3), pixels=(12, 16), focus_distance=math.inf
    )
    assert np.allclose(made.frame.matrix, cameras.frame.matrix, rtol=1e-12, atol=1e-15)


def test_pictures_on_planes_on_the_command_line(tmp_path):
    import imagecodecs

    from vcc.store import open_store

    grey = np.full((8, 8, 3), 188, np.uint8)  # sRGB 188 is 0.5029 in light
    (tmp_path / "grey, flat.png").write_bytes(imagecodecs.png_encode(grey))
    path = tmp_path / "planes.zarr"
    done = run(
        *("planes", "-o", path, "--views", 1, 2, "--pixels", 4, 6, "--dtype", "float32"),
        *("--plane", f"{tmp_path}/grey, flat.png, 1 m, 5 m"),
    )
    assert done.exit_code == 0, done.output
    assert np.allclose(open_store(path).read().values, ((188 / 255 + 0.055) / 1.055) ** 2.4, atol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("planes", "-o", "out.png"), "end its name in .zarr"),
        (("planes", "-o", "nowhere/out.zarr"), "there is no folder nowhere"),
        (("planes", "-o", "out.zarr", "--aperture", "20"), "needs a unit"),
        (("planes", "-o", "out.zarr", "--aperture", "1 mm, 2 mm, 3 mm"), "one length, or two with a comma"),
        (("planes", "-o", "out.zarr", "--field-of-view", "200 deg"), "between 0 and π"),
        (("planes", "-o", "out.zarr", "--plane", "leaf.png, 1 m"), "FILE, DISTANCE, WIDTH"),
        (("mitsuba", "scene.xml", "-o", "out.zarr", "--set", "spp"), "NAME=VALUE"),
    ],
)
def test_bad_input_on_the_command_line(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    done = run(*arguments)
    assert done.exit_code == 2, done.output
    assert message in done.stderr
    assert not list(tmp_path.iterdir())
