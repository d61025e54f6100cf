"""Data sets on disk: the same bytes however they are made, what other programs read, and what is refused."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import signal
import subprocess
import sys
import tarfile
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from io import BytesIO

import numpy as np
import pytest
import torch
import webdataset
import xarray
import zarr
from webdataset.tariterators import group_by_keys, tar_file_expander

import vcc
from tests.command_line import refused, run
from vcc.dataset import make_dataset, open_dataset
from vcc.sources import CameraArray, PlanesScene, TexturedPlane
from vcc.sources.synthesis import synthesize
from vcc.sources.textures import Waves
from vcc.store import create_video, save_store
from vcc.units import mm

pytestmark = pytest.mark.filterwarnings("ignore::vcc.ResultWarning")

RANDOM = np.random.default_rng(5)
CAMERA = vcc.Camera(
    [vcc.Lens(50 * mm, name="main"), vcc.Mask(np.ones((5, 5)), width=5 * mm, name="code")],
    vcc.Sensor(52 * mm, (24, 30), 0.2 * mm, electronics=vcc.Electronics(color_filter="RGGB", prnu=0.01)),
)
CODES = [RANDOM.integers(0, 2, (5, 5)).astype(float) for _ in range(3)]


def scene(seed):
    values = np.random.default_rng(seed).random((3, 3, 30, 36, 3), dtype=np.float32)
    return vcc.LightField.from_views(values, 2 * mm, 0.005, 1.0, (-0.2, 0.2), disparity=np.zeros((30, 36)))


SCENES = [scene(1), scene(2)]
SETTINGS = {
    "count": 10,
    "per_shard": 3,
    "crop": (12, 16),
    "flips": True,
    "truth": ("sharp", "depth", "views", "psf"),
    "psf_distances": (0.8, 2.0),
    "psf_size": 9,
    "exposure": (1e-3, 4e-3),
    "gain": (0.5, 2),
    "radiance": 1e-2,
}


def made(path, **more):
    return make_dataset(path, CAMERA, SCENES, {"code.pattern": CODES}, **{**SETTINGS, **more})


def contents(path):
    return {str(each.relative_to(path)): each.read_bytes() for each in sorted(path.rglob("*")) if each.is_file()}


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    return made(tmp_path_factory.mktemp("sets") / "pairs", licence="CC0")


@pytest.fixture(scope="module")
def zarr_pairs(tmp_path_factory):
    return made(tmp_path_factory.mktemp("sets") / "zarr", licence="CC0", kind="zarr")


@pytest.fixture(params=["pairs", "zarr_pairs"])
def either(request):
    return request.getfixturevalue(request.param)


THIRD = {"webdataset": "pairs-000002.tar", "zarr": "pairs.zarr/pair/c/2"}
LEFT = {
    "webdataset": ".pairs-000002.0badcafe-1-00000000.part.tar",
    "zarr": "pairs.zarr/pair/c/2.0badcafe.partial",
}


def test_threads_and_a_resumed_run_write_the_same_bytes(either, tmp_path):
    pairs, kind = either, either.disk.kind
    with ThreadPoolExecutor(3) as executor:
        made(tmp_path / "threads", executor=executor, licence="CC0", kind=kind)
    assert contents(tmp_path / "threads") == contents(pairs.path)
    done = []
    (tmp_path / "threads" / THIRD[kind]).unlink()
    (tmp_path / "threads" / LEFT[kind]).write_bytes(b"left by a killed writer")
    with pytest.raises(vcc.InputError, match="unfinished: 1 of 4 shards are missing"):
        open_dataset(tmp_path / "threads")
    made(tmp_path / "threads", licence="CC0", kind=kind, progress=lambda n, total: done.append((n, total)))
    assert done[0] == (7, 10)
    assert done[-1] == (10, 10)
    resumed = contents(tmp_path / "threads")
    assert {name: resumed[name] for name in contents(pairs.path)} == contents(pairs.path)


def test_a_zarr_group_has_the_pairs_of_the_shards_and_the_card(pairs, zarr_pairs):
    for one, other in zip(pairs, zarr_pairs, strict=True):
        assert one.keys() == other.keys()
        assert one["numbers"] == other["numbers"]
        for name in one.keys() - {"numbers"}:
            assert one[name].dtype == other[name].dtype
            assert np.array_equal(one[name], other[name], equal_nan=True)
    group = zarr.open_group(zarr_pairs.path / "pairs.zarr", mode="r")
    assert group.attrs["dataset"] == pairs.card == zarr_pairs.card
    assert group["views"].chunks == (1, *group["views"].shape[1:])
    assert group["exposure_seconds"][:].tolist() == [each["numbers"]["exposure_seconds"] for each in pairs]
    with xarray.open_zarr(zarr_pairs.path / "pairs.zarr", consolidated=False) as opened:
        assert opened["depth"].dims == ("pair", "y", "x")
        assert opened["depth"].attrs["units"] == "m"
        assert opened["recording"].dtype == np.uint16


CAMERA_FILE = """
[[elements]]
kind = "lens"
z = "0 mm"
focal_length = "50 mm"
[[elements]]
kind = "mask"
name = "code"
z = "0 mm"
pattern = { name = "mura", prime = 5 }
width = "5 mm"
[sensor]
z = "52 mm"
shape = [48, 60]
pitch = "0.1 mm"
[sensor.electronics]
read_noise = 2.0
"""


KILLED = """
import time
from vcc.cli import main
from vcc.dataset import making
write = making.Shard.write
making.Shard.write = lambda self, shard, *told: (time.sleep(600 if shard > 8 else 0), write(self, shard, *told))
if __name__ == "__main__":
    main()
"""
"""Processes that stop after shard 8, so that who kills them is in time."""


@pytest.mark.parametrize(
    ("kind", "first"), [("webdataset", "pairs-000000.tar"), ("zarr", "pairs.zarr/recording/c/2/0/0/0")]
)
def test_a_killed_command_resumes_and_processes_write_the_same_bytes(tmp_path, kind, first):
    count = 12
    (tmp_path / "killed.py").write_text(KILLED)
    (tmp_path / "camera.toml").write_text(CAMERA_FILE)
    save_store(SCENES[0], tmp_path / "scene.zarr")
    command = ["dataset", tmp_path / "camera.toml", tmp_path / "scene.zarr", "--set", "code.pattern=mura,circle"]
    command += ["--count", count, "--per-shard", 1, "--crop", 24, 32, "--flips", "--sharp", "--depth"]
    command += ["--psf", "1 m", "--kind", kind]
    killed = subprocess.Popen(
        [sys.executable, str(tmp_path / "killed.py"), *map(str, command), "-o", str(tmp_path / "killed")],
        start_new_session=True,
    )
    while not (tmp_path / "killed" / first).exists() and killed.poll() is None:
        time.sleep(0.01)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.wait()
    with pytest.raises(vcc.InputError, match="unfinished"):
        open_dataset(tmp_path / "killed")
    resumed = run(*command, "-o", tmp_path / "killed", "--executor", "threads")
    assert resumed.exit_code == 0, resumed.output
    assert f"{count} pairs, {count} shards" in resumed.stdout
    run(*command, "-o", tmp_path / "whole", "--executor", "none")
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")
    assert open_dataset(tmp_path / "whole")[0]["sharp"].shape == (24, 32, 3)


def test_webdataset_reads_the_shards(pairs):
    with ExitStack() as files:  # webdataset.WebDataset(urls).decode() is these steps, and leaves its files open
        opened = [(file.name, files.enter_context(file.open("rb"))) for file in sorted(pairs.path.glob("*.tar"))]
        streams = [{"url": name, "stream": stream} for name, stream in opened]
        found = list(webdataset.decode()(group_by_keys(tar_file_expander(streams))))
    assert [each["__key__"] for each in found] == [f"{n:08d}" for n in range(10)]
    stored = open_dataset(pairs.path, numbers="digital")
    for number, each in enumerate(found):
        for name in ("recording", "sharp", "depth", "views", "psf"):
            assert np.array_equal(each[f"{name}.npy"], stored[number][name], equal_nan=True)
        assert each["json"] == stored[number]["numbers"]


def test_a_loader_of_pytorch_reads_it_in_a_worker(either):
    pairs = either
    # Spawned: JAX, if another test has loaded it, must not be forked. One kind is enough: both are pickled below.
    worker = {"num_workers": 1, "multiprocessing_context": "spawn"} if pairs.disk.kind == "zarr" else {}
    loader = torch.utils.data.DataLoader(pairs, batch_size=4, shuffle=True, **worker)
    sent, seen = pickle.loads(pickle.dumps(pairs)), []
    assert np.array_equal(sent[7]["recording"], pairs[7]["recording"])
    for batch in loader:
        assert batch["recording"].dtype == torch.float32
        assert batch["views"].shape[1:] == (3, 3, *pairs[0]["views"].shape[2:])
        for n, number in enumerate(batch["numbers"]["pair"].tolist()):
            assert np.array_equal(batch["recording"][n].numpy(), pairs[number]["recording"])
            seen.append(number)
    assert sorted(seen) == list(range(10))


def test_the_card_says_how_it_was_made(pairs):
    card = json.loads((pairs.path / "dataset.json").read_text())
    text = (pairs.path / "README.md").read_text()
    assert card["arrays"]["depth"]["unit"] == "m"
    assert card["cameras"] == [f"code.pattern {n}" for n in range(3)]
    assert card["arrays"].keys() == pairs[0].keys() - {"numbers"}
    assert card["numbers"].keys() == pairs[0]["numbers"].keys()
    for said in ("Licence: CC0", "seed: 0", "linear in light", "inverted", "RGGB"):
        assert said in text
    first = vcc.load_camera(pairs.path / "camera.toml")
    assert np.array_equal(first.elements[1].pattern.values, CODES[0])
    assert "10 pairs of recording 12×16, sharp 12×16×3" in repr(pairs)


def test_renderers_videos_and_stores_give_the_pairs_of_their_light_fields(tmp_path):
    plane, cameras = (
        PlanesScene([TexturedPlane(Waves(20 * mm), 1.0)]),
        CameraArray((3, 3), (30, 36), 2 * mm, 5e-3, 1.0),
    )
    drawn = synthesize(plane, cameras, dtype="float32")
    save_store(drawn, tmp_path / "scene.zarr")
    with create_video(tmp_path / "video.zarr") as video:
        video.append(SCENES[0], 0.0)
        video.append(drawn, 0.1)
    few = {"count": 2, "per_shard": 2, "truth": ("sharp", "views"), "crop": (12, 16)}
    sources = [[drawn], (plane, cameras), str(tmp_path / "scene.zarr")]
    shards = [
        make_dataset(tmp_path / f"set{n}", CAMERA, each, **few).path / "pairs-000000.tar"
        for n, each in enumerate(sources)
    ]
    assert len({each.read_bytes() for each in shards}) == 1
    frames = make_dataset(tmp_path / "frames", CAMERA, tmp_path / "video.zarr", **few)
    assert frames.card["scenes"] == ["video.zarr, frame 0", "video.zarr, frame 1"]
    both = make_dataset(tmp_path / "both", CAMERA, [SCENES[0], drawn], **few)
    assert [each["numbers"]["scene"] for each in frames] == [0, 1]
    for one, other in zip(frames, both, strict=True):
        assert np.array_equal(one["recording"], other["recording"])


def test_what_is_there_is_not_mixed_or_overwritten(pairs, tmp_path):
    with pytest.raises(vcc.InputError, match=r"is another data set.*seed is 0 there and 1 now"):
        made(pairs.path, seed=1, licence="CC0")
    with pytest.raises(vcc.InputError, match=r"of kind 'webdataset', not 'zarr'"):
        made(pairs.path, licence="CC0", kind="zarr")
    with pytest.raises(vcc.InputError, match=r"is another data set"):
        make_dataset(pairs.path, CAMERA, SCENES[::-1], {"code.pattern": CODES}, **SETTINGS, licence="CC0")
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "diary.txt").write_text("mine")
    with pytest.raises(vcc.InputError, match=r"is no data set of vcc"):
        made(tmp_path / "notes")
    assert [each.name for each in (tmp_path / "notes").iterdir()] == ["diary.txt"]


def test_what_cannot_be_made_leaves_nothing(tmp_path):
    (tmp_path / "plain").mkdir()
    corner = np.zeros((5, 5))
    corner[0, 0] = 1
    dark = CAMERA.replace(code=vcc.Mask(corner, z=51.5 * mm, width=6 * mm))
    colourless = vcc.LightField.from_views(np.ones((3, 3, 8, 8), np.float32), 1 * mm, 0.01)
    out = tmp_path / "out"
    for said, make in (
        ("pair 0, scene 0, camera 0: .*leave this camera out", lambda: make_dataset(out, dark, SCENES)),
        ("equally many channels", lambda: make_dataset(out, CAMERA, [SCENES[0], colourless])),
        ("is no store.*vcc convert", lambda: make_dataset(out, CAMERA, tmp_path / "plain")),
        ("there is no scene", lambda: make_dataset(out, CAMERA, [tmp_path / "absent.zarr"])),
        ("scene 0 is a int", lambda: make_dataset(out, CAMERA, 3)),
        ("at least one scene", lambda: make_dataset(out, CAMERA, [])),
        ("there is no folder", lambda: make_dataset(tmp_path / "no" / "out", CAMERA, SCENES)),
        ("crop is", lambda: make_dataset(out, CAMERA, SCENES, crop=64)),
        ("truth is a list", lambda: make_dataset(out, CAMERA, SCENES, truth=None)),
        ("executor must be", lambda: make_dataset(out, CAMERA, SCENES, executor="processes")),
        ("per_shard", lambda: make_dataset(out, CAMERA, SCENES, per_shard=0)),
        ("kind is .webdataset. or", lambda: make_dataset(out, CAMERA, SCENES, kind="tar")),
        ("no parameter|has no", lambda: make_dataset(out, CAMERA, SCENES, {"cod.pattern": CODES})),
    ):
        with pytest.raises(vcc.InputError, match=said):
            make()
    assert {each.name for each in tmp_path.iterdir()} == {"plain"}


def damaged(path, name, change):
    (path / name).write_bytes(change((path / name).read_bytes()))


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("pairs-000000.tar", lambda data: data[:2000], "pairs-000000.tar"),
        ("pairs-000000.tar", lambda data: b"", "pairs-000000.tar"),
        ("pairs-000000.tar", lambda data: data.replace(b"NUMPY", b"NUMPX"), "pairs-000000.tar"),
        ("pairs-000000.tar", lambda data: data.replace(b"'<u2'", b"'|O8'"), "pairs-000000.tar"),
        ("pairs-000000.tar", lambda data: data.replace(b"(12, 16)", b"(99, 99)"), "pairs-000000.tar"),
        ("pairs-000000.tar", lambda data: data.replace(b'"pair"', b'"p\xff\x00r"'), "pairs-000000.tar"),
        ("dataset.json", lambda data: data[:300], "dataset.json"),
        ("dataset.json", lambda data: b"[]", "dataset.json"),
        ("dataset.json", lambda data: data.replace(b'"shards": 4', b'"shards": 99'), "do not fit together"),
        ("dataset.json", lambda data: data.replace(b'"format_version": 1', b'"format_version": 7'), "newer vcc"),
    ],
)
def test_damaged_files_are_named(pairs, tmp_path, name, change, said):
    copy = tmp_path / "copy"
    copy.mkdir()
    for each in pairs.path.iterdir():
        (copy / each.name).write_bytes(each.read_bytes())
    damaged(copy, name, change)
    with pytest.raises(vcc.InputError, match=said):
        open_dataset(copy)[0]


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("sharp/c/0/0/0/0", lambda data: data[:-9], "sharp/c/0/0/0/0 is damaged"),
        ("sharp/c/0/0/0/0", lambda data: bytes([data[0] ^ 1]) + data[1:], "sharp/c/0/0/0/0 cannot be read"),
        ("gain/c/0/0", lambda data: data + b" ", "gain/c/0/0 is damaged"),
        ("sharp/c/0/0/0/0", None, "there is no chunk of pairs .*sharp/c/0/0/0/0"),
        ("gain/zarr.json", None, "there is no array of pairs .*gain"),
        ("sharp/zarr.json", lambda data: data.replace(b"crc32c", b"gzip"), "sharp/zarr.json"),
        ("sharp/zarr.json", lambda data: data.replace(b'"/"', b'"/../"'), "sharp/zarr.json"),
        ("sharp/zarr.json", lambda data: data.replace(b'"float32"', b'"float64"'), "data_type is float64"),
        ("gain/zarr.json", lambda data: data.replace(b'"float64"', b'"string"'), "gain/zarr.json"),
        ("gain/zarr.json", lambda data: b"[" * 10**5, "gain/zarr.json"),
    ],
)
def test_damaged_arrays_are_named(zarr_pairs, tmp_path, name, change, said):
    copy = tmp_path / "copy"
    shutil.copytree(zarr_pairs.path, copy)
    if change is None:
        (copy / "pairs.zarr" / name).unlink()
    else:
        damaged(copy / "pairs.zarr", name, change)
    with pytest.raises(vcc.InputError, match=said):
        open_dataset(copy)[0]


def test_headers_of_tar_files_have_no_time_or_owner(pairs):
    with tarfile.open(fileobj=BytesIO((pairs.path / "pairs-000000.tar").read_bytes())) as tar:
        assert {(each.mtime, each.uid, each.gid, each.uname) for each in tar} == {(0, 0, 0, "")}


def test_the_command_refuses_what_it_cannot_use(tmp_path):
    (tmp_path / "camera.toml").write_text(CAMERA_FILE)
    out = ("-o", tmp_path / "pairs")
    assert "give at least one scene" in refused("dataset", tmp_path / "camera.toml", *out)
    scene_ = tmp_path / "scene.zarr"
    save_store(SCENES[0], scene_)
    command = ("dataset", tmp_path / "camera.toml", scene_, *out)
    assert "two with a colon" in refused(*command, "--exposure", "1ms:2ms:3ms")
    assert "more than once" in refused(*command, "--set", "sensor.z=1m", "--set", "sensor.z=2m")
    assert "--executor is" in refused(*command, "--executor", "ducks")
    assert not (tmp_path / "pairs").exists()
