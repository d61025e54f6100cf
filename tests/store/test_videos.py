"""A video on disk gives the pictures of the one in memory; each frame is there as a whole or not at all.

The oracle is the video in memory, and for writers that are killed the frames that they were to write.
"""

from __future__ import annotations

import json
import os
import pickle
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import zarr

import vcc
from tests.lock_holder import LOCKS
from tests.physics.random_cameras import drawn
from vcc.files.transfer import decode
from vcc.motion import LightFieldVideo, Lines, MovingCamera
from vcc.sources import CameraArray
from vcc.store import Lossless, Lossy, create_video, is_video, open_store, open_video, save_store
from vcc.store.video_layout import Place
from vcc.units import mm, ms

SHAPE = (2, 3, 8, 10)
CAMERAS = CameraArray(views=SHAPE[:2], pixels=SHAPE[2:], spacing=2e-3, slope_per_pixel=1e-3, focus_distance=1.3)
TIMES = (-0.1, 0.0, 1 / 3, 1e5)


def frame(seed, kind="float32", channels=(3,), **change):
    values = np.random.default_rng(seed).random((*SHAPE, *channels))
    top = np.iinfo(kind).max if np.dtype(kind).kind == "u" else 7.3
    how = {"spacing": 2e-3, "slope_per_pixel": 1e-3, "focus_distance": 1.3} | change
    return vcc.LightField.from_views((values * top).astype(kind), **how)


def made(path, count, **how):
    with create_video(path, **how) as video:
        for n in range(count):
            video.append(frame(n), n / 10)
    return open_video(path)


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    return made(tmp_path_factory.mktemp("three") / "a.zarr", 3).path


@pytest.fixture
def path(tmp_path, three):
    """Of a video of three frames, to do with as one likes."""
    return Path(shutil.copytree(three, tmp_path / "a.zarr"))


# --- the same pictures ---


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")  # of noise in few views
@pytest.mark.parametrize(
    ("kind", "transfer", "between"), [("float32", "linear", "linear"), ("uint8", "srgb", "held")]
)
def test_a_video_on_disk_gives_the_pictures_of_the_one_in_memory_bit_for_bit(tmp_path, kind, transfer, between):
    camera = vcc.Camera(
        [vcc.Lens(50 * mm, name="main"), vcc.Mask(vcc.patterns.mura(5), width=6 * mm)],
        vcc.Sensor(52 * mm, (9, 11), 0.1 * mm),
    )
    frames, times = [frame(n, kind) for n in range(4)], [0.0, 4 * ms, 10 * ms, 12 * ms]
    with create_video(tmp_path / "a.zarr", between=between, transfer=transfer) as video:
        for each, at in zip(frames, times, strict=True):
            video.append(each, at)
    light = [each.replaced(decode(each.values)) if transfer == "srgb" else each for each in frames]
    sweep = Lines([0, 9 * ms], [51 * mm, 53 * mm])
    for moving in (MovingCamera(camera), MovingCamera(camera, {"sensor.z": sweep})):
        found = moving.capture(open_video(tmp_path / "a.zarr"), 9 * ms, start=1 * ms, time_tolerance=0.02)
        truth = moving.capture(LightFieldVideo(light, times, between), 9 * ms, start=1 * ms, time_tolerance=0.02)
        np.testing.assert_array_equal(found.values, truth.values)
        assert found.sampling_error == truth.sampling_error


def test_a_random_camera_sees_the_same(tmp_path):
    case = drawn("two masks", 3, pixels=10, views=7)
    first = case.light_field
    second = first.replaced(first.values[::-1])
    with create_video(tmp_path / "a.zarr") as video:
        video.append(first, 0.0)
        video.append(second, 0.5)
    moving = MovingCamera(case.camera)
    found = moving.capture(open_video(tmp_path / "a.zarr"), 0.25)
    truth = moving.capture(LightFieldVideo([first, second], (0.0, 0.5)), 0.25)
    # As all stores do: some cameras' sums are taken in another order, in single precision.
    np.testing.assert_allclose(found.values, truth.values, rtol=0, atol=1e-6 * truth.values.max())


@pytest.mark.parametrize("kind", ["uint8", "uint16", "float16", "float32"])
def test_frames_and_times_come_back_bit_for_bit(tmp_path, kind):
    with create_video(tmp_path / "a.zarr", channel_names=("r", "g", "b"), provenance={"scene": 7}) as video:
        for n, at in enumerate(TIMES):
            video.append(frame(n, kind, disparity_range=(-n, 1)), at)
    video = open_video(tmp_path / "a.zarr")
    assert video.times == TIMES
    assert (len(video), video.shape, video.between) == (4, (*SHAPE, 3), "linear")
    assert video.provenance == {"scene": 7}
    for n, each in enumerate(video):
        np.testing.assert_array_equal(each.read().values, frame(n, kind).values)
        assert each.read().values.dtype == np.dtype(kind)
        assert each.frame == frame(n).frame
        assert each.disparity_range == (-n, 1)
        assert each.channel_names == ("r", "g", "b")
    assert video[1:3].times == TIMES[1:3]
    assert video[1:3][-1].path == video[2].path
    assert "4 frames, -0.1 s to 100000 s, linear, of a Grid(2×3×8×10×3" in repr(video)
    with pytest.raises(IndexError):
        video[4]


def test_frames_from_stores_keep_their_codes_and_others_take_the_type_that_is_asked_for(tmp_path):
    stored = save_store(frame(0, "uint8"), tmp_path / "0.zarr", transfer="srgb")
    with create_video(tmp_path / "a.zarr") as video:
        video.append(stored, 0)
    kept = open_video(tmp_path / "a.zarr")[0]
    assert (kept.dtype, kept.transfer) == (np.uint8, "srgb")
    np.testing.assert_array_equal(kept.read().values, stored.read().values)
    with create_video(tmp_path / "b.zarr", dtype="float16", compression=Lossless("lz4"), chunks=2) as video:
        video.append(frame(0), 0)
    np.testing.assert_array_equal(
        open_video(tmp_path / "b.zarr")[0].read().values, frame(0).values.astype(np.float16)
    )
    with create_video(tmp_path / "c.zarr", compression=Lossy()) as video:
        video.append(frame(0, "uint8"), 0)
    assert open_video(tmp_path / "c.zarr")[0].lossy["codec"] == "jpegxl"


def test_a_video_is_plain_zarr(path):
    group = zarr.open_group(path, mode="r")
    np.testing.assert_array_equal(group["000001_0.1"]["samples"][:], frame(1).values)
    assert sorted(name for name, _ in group.members()) == ["000000_0.0", "000001_0.1", "000002_0.2"]


def test_a_video_goes_to_other_processes_as_its_address(path):
    video = open_video(path)
    video[1].read()
    found = pickle.loads(pickle.dumps(video))
    assert found.times == video.times
    np.testing.assert_array_equal(found[1].read().values, frame(1).values)


def test_opening_reads_no_frame(tmp_path, monkeypatch):
    made(tmp_path / "a.zarr", 1)
    for n in range(1, 2000):
        (tmp_path / "a.zarr" / Place.of(n, n / 24).name).mkdir()
    monkeypatch.setattr("vcc.store.video_reading.open_store", lambda path: pytest.fail("a frame was opened"))
    assert len(open_video(tmp_path / "a.zarr")) == 2000


# --- frame after frame ---


def test_a_video_goes_on_where_it_stopped_and_readers_see_more_when_they_look_again(tmp_path):
    path = tmp_path / "a.zarr"
    before = made(path, 2, between="held")
    with create_video(path) as video:
        assert (len(video), video.times) == (2, (0.0, 0.1))
        for n in range(len(video), 4):
            video.append(frame(n), n / 10)
            assert len(open_video(path)) == n + 1
    assert len(before) == 2
    assert (len(open_video(path)), open_video(path).between) == (4, "held")
    assert [file.name for file in tmp_path.iterdir()] == ["a.zarr"]
    with pytest.raises(vcc.InputError, match=r"this writer of .* has ended"):
        video.append(frame(4), 0.4)
    with pytest.raises(vcc.InputError, match='states that it is "held" between frames, not "linear"'):
        create_video(path, between="linear")


@pytest.mark.parametrize(
    ("given", "at", "words"),
    [
        (frame(3)[:1], 0.3, r"frame 3, 0\.3 s, has another grid .*: shape 1×3×8×10×3 instead of 2×3×8×10×3"),
        (frame(3, channels=()), 0.3, "shape 2×3×8×10 instead of 2×3×8×10×3"),
        (frame(3, "uint8"), 0.3, "type uint8 instead of float32"),
        (frame(3, spacing=3e-3), 0.3, "spacing 3 mm, .* instead of spacing 2 mm"),
        (frame(3, focus_distance=1.2), 0.3, r"converging at 1\.2 m instead of .* at 1\.3 m"),
        (frame(3, slope_per_pixel=1.0000001e-3), 0.3, r"a frame that differs by up to .*e-10"),
        (frame(3, sample="point"), 0.3, "sample point instead of mean"),
        (frame(3), 0.2, r"times of frames ascend, and frame 2 of .* is at 0\.2 s: 0\.2 s is not after it"),
        (frame(3), np.nan, "the time of a frame"),
        (frame(3, "float64"), 0.3, "not float64"),
        (frame(3).values, 0.3, "light_field is a vcc.LightField, not a ndarray"),
    ],
)  # fmt: skip
def test_frames_that_do_not_fit_are_refused_by_what_differs(path, given, at, words):
    with create_video(path) as video, pytest.raises(vcc.InputError, match=words):
        video.append(given, at)
    assert len(open_video(path)) == 3
    assert not list(path.glob(".*"))


def test_a_frame_is_written_view_by_view(tmp_path):
    views = frame(0).values
    shape = (*SHAPE, 3)
    with create_video(tmp_path / "a.zarr") as video:
        with video.frame(0.5, CAMERAS, shape, "float32", disparity_range=(0, 1), provenance={"pass": 1}) as one:
            for row, column in one.missing():
                one.write_view(row, column, views[row, column])
                assert len(open_video(tmp_path / "a.zarr")) == 0
            with (
                pytest.raises(vcc.InputError, match=r"a frame of .* is being written"),
                video.frame(1.5, CAMERAS, shape, "float32"),
            ):
                pass
        assert len(open_video(tmp_path / "a.zarr")) == 1
        with (
            pytest.raises(vcc.InputError, match=r"000001_0\.75 cannot be finished: 6 of 6 views are missing"),
            video.frame(0.75, CAMERAS, shape, "float32"),
        ):
            pass
        with pytest.raises(ZeroDivisionError), video.frame(0.75, CAMERAS, shape, "float32"):
            raise ZeroDivisionError
        video.append(vcc.LightField(views, CAMERAS.frame), 0.75)
    found = open_video(tmp_path / "a.zarr")
    assert found.times == (0.5, 0.75)
    np.testing.assert_array_equal(found[0].read().values, views)
    assert (found[0].disparity_range, found[0].provenance) == ((0, 1), {"pass": 1})
    assert not list((tmp_path / "a.zarr").glob(".*"))


def test_a_video_without_frames_takes_any_and_is_one_to_speak_of(tmp_path):
    path = tmp_path / "a.zarr"
    create_video(path).__exit__(None, None, None)
    assert is_video(path)
    assert (len(open_video(path)), open_video(path).times) == (0, ())
    with pytest.raises(vcc.InputError, match="has no frame yet"):
        _ = open_video(path).shape
    with pytest.raises(vcc.InputError, match="is a video of light fields: it has no frame yet"):
        open_store(path)
    with create_video(path) as video:
        video.append(frame(0, "uint8", ()), 3)
    assert open_video(path).shape == SHAPE
    # What it states of frames is left, as by a kill before the first one has its name.
    shutil.rmtree(path / "000000_3.0")
    assert len(open_video(path)) == 0
    with create_video(path) as video:
        video.append(frame(0), 3)
    assert open_video(path).shape == (*SHAPE, 3)


# --- killed, full, two at once ---

KILLED = """
import os
import sys
import time
import numpy as np
import zarr
import vcc
from vcc.store import create_video
writers = []
for path in sys.argv[1:]:
    writers.append(os.fork())
    if writers[-1] == 0:
        with create_video(path) as video:
            for n in range(200):
                time.sleep(600 if n > 150 else 0)  # who kills it is in time
                views = np.random.default_rng(n).random((3, 3, 40, 50), dtype=np.float32)
                video.append(vcc.LightField.from_views(views, 1e-3, 1e-3), n / 7)
        os._exit(0)
print(*writers, flush=True)
print(*(os.waitstatus_to_exitcode(os.waitpid(writer, 0)[1]) for writer in writers))
"""


def test_a_kill_leaves_whole_frames_and_nothing_else_while_readers_look_on(tmp_path):
    """Killed at random moments: what is there is whole, for readers meanwhile and after, and work goes on."""
    rng = np.random.default_rng()
    paths = [tmp_path / f"{n}.zarr" for n in range(3)]
    command = [sys.executable, "-c", KILLED, *map(str, paths)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writers:
        for path, writer in zip(paths, map(int, writers.stdout.readline().split()), strict=True):
            most = 0
            while most < 3:
                video = open_video(path) if is_video(path) else []
                assert len(video) >= most
                most = len(video)
                if most:
                    np.testing.assert_array_equal(video[-1].read().values, views(most - 1))
            time.sleep(rng.uniform(0, 0.03))  # in any part of a frame
            os.kill(writer, signal.SIGKILL)
        assert writers.communicate()[0].split() == [str(-signal.SIGKILL)] * 3
    for path in paths:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", ".*a writer was stopped in a frame", vcc.ResultWarning)
            video = create_video(path)
        assert not list(path.glob(".*"))
        video.append(vcc.LightField.from_views(views(len(video)), 1e-3, 1e-3), len(video) / 7)
        found = open_video(path)
        assert len(found) > 3
        assert found.times == tuple(n / 7 for n in range(len(found)))
        for n, each in enumerate(found):
            np.testing.assert_array_equal(each.read().values, views(n))
        assert sorted(each.name for each in path.iterdir()) == [
            *(place.name for place in found.places),
            "zarr.json",
        ]


def views(n):
    return np.random.default_rng(n).random((3, 3, 40, 50), dtype=np.float32)


def test_what_a_killed_writer_left_of_a_frame_is_said(tmp_path):
    path = tmp_path / "a.zarr"
    made(path, 2)
    dead = subprocess.run(["sh", "-c", "echo $$"], capture_output=True, text=True, check=True).stdout.strip()
    with create_video(path) as video, video.frame(0.3, CAMERAS, (*SHAPE, 3), "float32") as one:
        left = one.path.with_name(re.sub(rf"-{os.getpid()}-", f"-{dead}-", one.path.name))
        shutil.copytree(one.path, left)
        for row, column in one.missing():
            one.write_view(row, column, frame(2).values[row, column])
    assert left.is_dir()
    with pytest.warns(
        vcc.ResultWarning, match=r"stopped in a frame, of which nothing is kept: it goes on after frame 2"
    ):
        create_video(path).__exit__(None, None, None)
    assert not left.exists()
    assert len(open_video(path)) == 3


@pytest.mark.parametrize("when", ["a view", "settling"])
def test_a_full_disk_keeps_the_frames_that_are_there(tmp_path, monkeypatch, when):
    def full(*given):
        raise OSError(28, "No space left on device")

    path = tmp_path / "a.zarr"
    made(path, 2)
    with create_video(path) as video:
        with monkeypatch.context() as patched:
            patched.setattr(*((zarr.Array, "__setitem__") if when == "a view" else (os, "fsync")), full)
            words = (
                r"000002_0\.2 could not be written: No space left.* MB are free there: make room.*nothing of it is"
            )
            with pytest.raises(vcc.InputError, match=words):
                video.append(frame(2), 0.2)
        assert sorted(each.name for each in path.iterdir()) == ["000000_0.0", "000001_0.1", "zarr.json"]
        video.append(frame(2), 0.2)
    np.testing.assert_array_equal(open_video(path)[2].read().values, frame(2).values)


def test_a_disk_that_ends_within_a_view_keeps_the_frames_that_are_there(tmp_path):
    """A limit on the size of files stands for the disk: writing fails half-way, as there."""
    path = tmp_path / "a.zarr"
    large = vcc.LightField.from_views(np.random.default_rng(0).random((1, 2, 60, 60)), 1e-3, 1e-3)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with create_video(path, dtype="float32") as video:
        video.append(large, 0)
        before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
        try:
            with pytest.raises(vcc.InputError, match=r"000001_1\.0 could not be written: File too large"):
                video.append(large, 1)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
            signal.signal(signal.SIGXFSZ, before)
        video.append(large, 1)
    assert open_video(path)[1].complete


def test_a_video_has_one_writer_and_the_others_are_told(tmp_path):
    path = tmp_path / "a.zarr"
    made(path, 1)
    first = create_video(path)
    half = first.frame(0.5, CAMERAS, (*SHAPE, 3), "float32")
    writer = half.__enter__()
    second = create_video(path)
    second.append(frame(1), 0.1)
    for row, column in writer.missing():  # what the earlier one was at is let be, and ends with it
        writer.write_view(row, column, frame(2).values[row, column])
    with pytest.raises(vcc.InputError, match=r"this writer of .* has ended"):
        half.__exit__(None, None, None)
    with pytest.raises(vcc.InputError, match=r"this writer of .* has ended"):
        first.append(frame(2), 0.2)
    second.append(frame(2), 0.2)
    second.__exit__(None, None, None)
    assert open_video(path).times == (0.0, 0.1, 0.2)
    command = [sys.executable, "-c", LOCKS, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(vcc.InputError, match=f"is being written by process {other.pid}"):
            create_video(path)
        assert len(open_video(path)) == 3  # readers are not hindered
        other.kill()
    with create_video(path) as again:  # a lock ends with its process
        again.append(frame(3), 0.3)
    assert [file.name for file in tmp_path.iterdir()] == ["a.zarr"]


# --- what is damaged, or something else ---


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (
            lambda path: shutil.rmtree(path / "000001_0.1"),
            r"frame 1 is missing, between 000000_0\.0 and 000002_0\.2",
        ),
        (lambda path: shutil.rmtree(path / "000000_0.0"), r"frame 0 is missing, before 000001_0\.1"),
        (lambda path: (path / "000001_0.05").mkdir(), r"000001_0\.\d+ and 000001_0\.\d+ are both frame 1"),
        (
            lambda path: (path / "000003_0.2").mkdir(),
            r"times of frames ascend, and 000003_0\.2 comes after 000002",
        ),
        (lambda path: (path / "000003_1e999").mkdir(), r"times of frames ascend, and 000003_1e999 comes"),
    ],
)
def test_a_video_whose_frames_do_not_follow_one_another_is_refused(path, harm, words):
    harm(path)
    for look in (open_video, create_video):
        with pytest.raises(vcc.InputError, match=rf"a\.zarr is damaged: {words}"):
            look(path)


def test_a_frame_that_came_while_names_were_listed_and_was_passed_over_is_seen(path, monkeypatch):
    names, listed = os.listdir, []

    def passing(folder):
        listed.append(1)
        return [name for name in names(folder) if not (len(listed) == 1 and name.startswith("000001"))]

    monkeypatch.setattr(os, "listdir", passing)
    assert len(open_video(path)) == 3


def test_a_damaged_frame_is_named_and_the_others_are_read(path):
    video = open_video(path)
    (path / "000001_0.1/zarr.json").write_text("{")
    with pytest.raises(
        vcc.InputError, match=r"frame 1, 0\.1 s, of .*a\.zarr cannot be used: .*not JSON.* Copy the frame"
    ):
        video[1]
    shutil.rmtree(path / "000001_0.1")
    save_store(frame(1, focus_distance=2), path / "000001_0.1")
    with pytest.raises(vcc.InputError, match=r"frame 1, .*another grid .*converging at 2 m instead of .* 1\.3 m"):
        video[1]
    video[2].view_file(0, 1).unlink()
    with pytest.raises(
        vcc.InputError, match=r"000002_0\.2 is not complete: 1 of its 6 views are missing.*\(0, 1\)"
    ):
        PINHOLE.capture(video[2])
    shutil.rmtree(path / "000002_0.2")
    with pytest.raises(
        vcc.InputError, match=r"frame 2, 0\.2 s, of .* cannot be used: there is no store .*000002_0\.2"
    ):
        pickle.loads(pickle.dumps(video))[2]
    np.testing.assert_array_equal(video[0].read().values, frame(0).values)


PINHOLE = vcc.Camera(
    [vcc.Mask(vcc.patterns.Circle(3 * mm)), vcc.Lens(50 * mm)], vcc.Sensor(52 * mm, (4, 5), 0.1 * mm)
)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"format_version": 2}, "has format_version 2, and this vcc reads up to 1"),
        ({"format_version": "one"}, "format_version is a whole number, 1 or more, not 'one'"),
        ({"between": "mixed"}, "between is 'linear' or 'held', not 'mixed'"),
        ({"grid": 3}, "grid is an object or null, not int"),
        ({"grid": None}, r"states no grid, and holds a frame, 000000_0\.0"),
        ({"grid": {}}, "its grid does not state shape, dtype, frame, transfer"),
        ({"provenance": [1]}, "provenance is an object, not list"),
    ],
)
def test_wrong_attributes_are_named(path, keys, words):
    stated = json.loads((path / "zarr.json").read_text())
    stated["attributes"]["light_field_video"] |= keys
    (path / "zarr.json").write_text(json.dumps(stated))
    with pytest.raises(vcc.InputError, match=words) as caught:
        open_video(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"shape": [2, 3]}, "its grid cannot be used"),
        ({"shape": [2, 3, 8, 0]}, "a size of shape"),
        ({"shape": "x"}, "a size of shape"),
        ({"shape": 7}, "its grid cannot be used"),
        ({"dtype": "float64"}, "dtype is one of"),
        ({"frame": [[1]]}, "cannot be used: an affine map"),
        ({"frame": [[10**400] * 5] * 5}, "cannot be used: int too large"),
        ({"transfer": "log"}, "transfer is 'linear' or 'srgb'"),
        ({"channel_names": ["red"]}, "1 channel_names for 3 channels"),
        ({"channel_names": 5}, "cannot be used"),
    ],
)
def test_a_wrong_grid_is_named(path, keys, words):
    stated = json.loads((path / "zarr.json").read_text())
    stated["attributes"]["light_field_video"]["grid"] |= keys
    (path / "zarr.json").write_text(json.dumps(stated))
    with pytest.raises(vcc.InputError, match=words):
        open_video(path)


def test_what_is_no_video_and_a_video_for_one_light_field_are_told_apart(tmp_path, path):
    video = open_video(path)
    save_store(frame(0), tmp_path / "b.zarr")
    assert (is_video(video.path), is_video(tmp_path / "b.zarr"), is_video(tmp_path)) == (True, False, False)
    with pytest.raises(vcc.InputError, match=r"one of its frames, .*a\.zarr.000000_0\.0 \(0 s\) to 000002_0\.2 "):
        open_store(video.path)
    with pytest.raises(vcc.InputError, match=r"is not a video of light fields: vcc\.store\.open_store opens"):
        open_video(tmp_path / "b.zarr")
    with pytest.raises(vcc.InputError, match="exists already, and is not a video"):
        create_video(tmp_path / "b.zarr")
    with pytest.raises(vcc.InputError, match=r"holds no zarr\.json"):
        open_video(tmp_path)
    with pytest.raises(vcc.InputError, match="there is no video"):
        open_video(tmp_path / "c.zarr")
    with pytest.raises(vcc.InputError, match="there is no folder"):
        create_video(tmp_path / "none/c.zarr")
    for given in (video, LightFieldVideo(video, video.times)):
        with pytest.raises(vcc.InputError, match=r"take one of its frames, or vcc\.MovingCamera"):
            PINHOLE.capture(given)
    with pytest.raises(vcc.InputError, match="a video has two frames or more, and there are 1"):
        MovingCamera(PINHOLE).capture(video[:1], 0.1)
