"""What is written to a store and read back is the same, a part is read without the rest, faults are named.

The oracle is the light field in memory; for how much is read, the bytes that Zarr's own store hands out.
"""

from __future__ import annotations

import asyncio
import json
import math
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import zarr

import vcc
from tests.lock_holder import LOCKS
from vcc.base.affine import Affine
from vcc.files import parts
from vcc.files.transfer import decode
from vcc.sources import CameraArray
from vcc.store import (
    Lossless,
    Lossy,
    convert,
    create_store,
    is_store,
    open_store,
    save_store,
)

SHAPE = (3, 4, 10, 12)
CAMERAS = CameraArray(views=SHAPE[:2], pixels=SHAPE[2:], spacing=2e-3, slope_per_pixel=1e-3, focus_distance=1.3)
GENERAL = Affine(CAMERAS.frame.matrix + np.pad(np.random.default_rng(5).random((4, 5)) * 1e-5, ((0, 1), (0, 0))))


def light_field(kind="float32", channels=(3,), seed=0, **more):
    values = np.random.default_rng(seed).random((*SHAPE, *channels))
    top = np.iinfo(kind).max if np.dtype(kind).kind == "u" else 7.3
    return vcc.LightField((values * top).astype(kind), GENERAL, **more)


@pytest.fixture
def stored(tmp_path):
    return save_store(light_field(), tmp_path / "a.zarr")


# --- what is written comes back ---


@pytest.mark.parametrize("channels", [(), (1,), (3,), (5,)])
@pytest.mark.parametrize("kind", ["uint8", "uint16", "float16", "float32"])
def test_samples_and_frame_come_back_bit_for_bit(tmp_path, kind, channels):
    given = light_field(kind, channels, disparity_range=(-0.25, 1 / 3))
    save_store(given, tmp_path / "Lichtfeld größer 1.zarr", chunks=4)
    stored = open_store(tmp_path / "Lichtfeld größer 1.zarr")
    read = stored.read()
    assert read.values.dtype == given.values.dtype
    np.testing.assert_array_equal(read.values, given.values)
    assert read.frame == given.frame == stored.frame
    assert (stored.shape, stored.dtype, stored.channels) == (given.shape, np.dtype(kind), given.channels)
    assert read.disparity_range == stored.disparity_range == (-0.25, 1 / 3)
    assert stored.complete
    assert stored.transfer == "linear"
    assert stored.sample == "mean"


@pytest.mark.parametrize("sample", ["mean", "point"])
def test_what_samples_are_comes_back(tmp_path, sample):
    stored = save_store(light_field(sample=sample), tmp_path / "a.zarr")
    parts = [stored, stored.grid, stored.read(), stored[1:, :2, 3:], stored.scaled(2), open_store(stored.path)]
    parts.append(convert(stored, tmp_path / "b.zarr", dtype="float16"))
    parts.append(convert(stored.read(), tmp_path / "c.zarr"))
    assert {part.sample for part in parts} == {sample}
    assert {"mean": "means over pixels", "point": "values at points"}[sample] in repr(stored)


def test_a_store_that_states_something_else_of_its_samples_is_refused(stored):
    group = zarr.open_group(stored.path, mode="r+")
    group.attrs["light_field"] = group.attrs["light_field"] | {"sample": "cell"}
    with pytest.raises(vcc.InputError, match="sample is 'mean' or 'point', not 'cell'"):
        open_store(stored.path)


@pytest.mark.parametrize(
    "index",
    [
        (slice(1, 3),),
        (slice(None), slice(2, 3), slice(3, 5)),
        (slice(None, None, -1), slice(None, None, 2), slice(8, 1, -3), slice(None, 1, -2)),
        (Ellipsis, slice(1, 2)),
    ],
)
def test_a_part_is_what_the_same_part_in_memory_is(stored, index):
    part, whole = stored[index], light_field()[index]
    np.testing.assert_array_equal(part.values, whole.values)
    assert part.frame == whole.frame
    assert part.grid.extent == whole.grid.extent


def test_a_view_is_what_it_is_in_memory(stored):
    one, other = stored.view(-1, 2), light_field().view(-1, 2)
    np.testing.assert_array_equal(one.values, other.values)
    assert one.frame == other.frame


def test_srgb_codes_are_kept_and_read_as_light(tmp_path):
    codes = light_field("uint8")
    stored = save_store(codes, tmp_path / "a.zarr", transfer="srgb")
    assert (stored.dtype, stored.transfer) == (np.uint8, "srgb")
    np.testing.assert_array_equal(stored.read().values, decode(codes.values))
    np.testing.assert_array_equal(stored[1:2, 1:2, 2:5].values, decode(codes.values[1:2, 1:2, 2:5]))


def test_what_is_stated_comes_back(tmp_path):
    made = {"renderer": {"name": "größer", "far": math.inf, "seeds": (1, 2)}, "who": np.float64(2.5)}
    names = ("red", "green", "blue")
    with create_store(
        tmp_path / "a.zarr", GENERAL, (*SHAPE, 3), "float16", provenance=made, channel_names=names,
        description={"scene": 1}, compression=Lossless("lz4", 1),
    ) as writer:  # fmt: skip
        for row, column in writer.missing():
            writer.write_view(row, column, np.ones((10, 12, 3), np.float32))
        stored = writer.finish()
    assert stored.provenance == {
        "renderer": {"name": "größer", "far": "Infinity", "seeds": [1, 2]},
        "who": 2.5,
    }
    assert stored.channel_names == names
    assert stored.description["maker"] == {"scene": 1}


def test_views_that_are_all_dark_are_stored_and_found(tmp_path):
    stored = save_store(vcc.LightField(np.zeros(SHAPE, np.float32), GENERAL), tmp_path / "a.zarr")
    assert stored.missing() == []
    assert not stored.read().values.any()


def test_a_store_is_plain_zarr(stored):
    """Others can read it: what zarr itself gives are the samples, and the frame is among the attributes."""
    group = zarr.open_group(stored.path, mode="r")
    np.testing.assert_array_equal(group["samples"][:], light_field().values)
    assert np.array_equal(group.attrs["light_field"]["frame"], GENERAL.matrix)
    assert group["samples"].metadata.dimension_names == ("v", "u", "t", "s", "channel")


def test_a_store_that_another_program_writes(tmp_path):
    """By docs/store.md alone: no shards, no compression, no optional attributes."""
    group = zarr.create_group(tmp_path / "a.zarr")
    stated = {"format_version": 1, "frame": GENERAL.matrix.tolist(), "transfer": "linear", "complete": True}
    group.attrs["light_field"] = stated
    values = light_field("uint16", ()).values
    group.create_array("samples", data=values, chunks=(1, 1, 10, 12))
    np.testing.assert_array_equal(open_store(tmp_path / "a.zarr").read().values, values)
    assert open_store(tmp_path / "a.zarr").sample == "mean"


def test_disparities_are_measured_as_in_memory(tmp_path):
    """From the middle views alone: the same ones that a light field in memory looks at."""
    texture = np.random.default_rng(2).random((60, 90))
    texture = np.kron(texture, np.ones((2, 2)))
    views = [[texture[10 + j : 90 + j, 20 + i : 140 + i] for i in range(9)] for j in range(5)]
    given = vcc.LightField.from_views(np.array(views, dtype=np.float32), 1e-3, 1e-3)
    stored = save_store(given, tmp_path / "a.zarr")
    assert stored.measured_disparity_range() == given.measured_disparity_range()
    assert stored[:2, :2].measured_disparity_range() == given.measured_disparity_range()


def test_a_larger_world_is_only_another_frame(stored):
    assert stored.scaled(3).read().frame == light_field().scaled(3).frame


# --- little is read ---


class Counting:
    """A stream that counts what is read of it."""

    def __init__(self, stream, add):
        self.stream, self.add = stream, add

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stream.close()

    def seek(self, place):
        return self.stream.seek(place)

    def read(self, *size):
        found = self.stream.read(*size)
        self.add(len(found))
        return found


def bytes_read(monkeypatch, store):
    """Bytes that are read of views from now on, by their files."""
    found: dict[str, int] = {}
    opened = Path.open

    def counted(self, *more, **named):
        stream = opened(self, *more, **named)
        if self.parent != store / "samples" or self.name == "zarr.json":
            return stream
        key = self.name
        return Counting(stream, lambda size: found.update({key: found.get(key, 0) + size}))

    monkeypatch.setattr(Path, "open", counted)
    return found


def test_little_is_read(tmp_path, monkeypatch):
    values = np.random.default_rng(1).random((4, 5, 64, 40, 3)).astype(np.float32)
    given = vcc.LightField.from_views(values, 1e-3, 1e-3)
    stored, tiled = (save_store(given, tmp_path / f"{n}.zarr", chunks=n) for n in (8, (8, 10)))
    file = stored.view_file(2, 3).stat().st_size
    found = bytes_read(monkeypatch, stored.path)
    open_store(stored.path)
    assert not found
    stored.view(2, 3)
    assert found == {"c.2.3.0.0.0": file}
    found.clear()
    stored[1:2]
    assert set(found) == {f"c.1.{column}.0.0.0" for column in range(5)}
    found.clear()
    stored[1:2, :, 20:21]  # an epipolar slice: one of eight chunks of each view, and the index
    assert len(found) == 5
    index = 16 * 8 + 4
    assert all(size < file / 8 * 1.2 + index for size in found.values())
    monkeypatch.undo()
    found = bytes_read(monkeypatch, tiled.path)
    part = tiled[1:2, 1:2, 40:42, 12:18]  # within one of 8×4 chunks
    np.testing.assert_array_equal(part.values, values[1:2, 1:2, 40:42, 12:18])
    (size,) = found.values()
    assert size < file / 32 * 1.2 + 4 * index


@pytest.mark.parametrize(
    ("packing", "kind"),
    [
        ("ours", "uint8"),
        ("ours", "float16"),
        ("in tiles", "uint16"),
        ("in tiles that go beyond", "uint8"),
        ("in tiles that go beyond", "float32"),
        ("the other way round", "uint16"),
        ("the other way round", "float32"),
        ("else", "float16"),
    ],
)
def test_pixels_are_those_that_zarr_reads(tmp_path, kind, packing):
    """Any pixels of any view, by Zarr and by us; of chunks packed otherwise, too."""
    random = np.random.default_rng(5)
    values = (random.random((2, 3, 21, 17, 3)) * 250).astype(kind)
    given = vcc.LightField.from_views(values, 1e-3, 1e-3)
    stored = save_store(
        given, tmp_path / "a.zarr", chunks={"in tiles": (7, 17), "ours": None}.get(packing, (4, 5))
    )
    if packing in ("the other way round", "else"):
        group = zarr.open_group(stored.path, mode="r+")
        packed = [zarr.codecs.BloscCodec(), zarr.codecs.Crc32cCodec()] if packing != "else" else "auto"
        array = group.create_array(
            "samples", shape=values.shape, chunks=(1, 1, 4, 5, 3), shards=(1, 1, 24, 20, 3), dtype=kind,
            serializer=zarr.codecs.BytesCodec(endian="big"), compressors=packed, overwrite=True,
            config={"write_empty_chunks": True},
        )  # fmt: skip
        array[:] = values
        stored = open_store(stored.path)
    assert (stored._chunked.kind is None) == (packing == "else")
    for _ in range(10):
        j, i = random.integers(2), random.integers(3)
        (a, b), (c, d) = (np.sort(random.choice(size + 1, 2, replace=False)) for size in (21, 17))
        found = stored.stored_view(j, i, a, b, (c, d))
        assert found.dtype == kind
        np.testing.assert_array_equal(found, stored.array[j, i, a:b, c:d])
        np.testing.assert_array_equal(found, values[j, i, a:b, c:d])


def test_bytes_that_rot_are_found_out(tmp_path):
    """Those of chunks that are not needed are not looked at."""
    values = np.random.default_rng(6).random((1, 1, 6, 8)).astype(np.float32)
    stored = save_store(vcc.LightField.from_views(values, 1e-3, 1e-3), tmp_path / "a.zarr", chunks=(3, 4))
    file = stored.view_file(0, 0)
    whole = file.read_bytes()
    refused = 0
    for place in range(0, len(whole), 3):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << place % 8
        file.write_bytes(damaged)
        with pytest.raises(vcc.InputError, match="is damaged or cut off"):
            stored.read()
        try:
            np.testing.assert_array_equal(stored[:, :, :2, :2].values, values[:, :, :2, :2])
        except vcc.InputError:
            refused += 1
    # One chunk of four, and the index, which stands for all.
    assert refused == pytest.approx((len(whole) / 4 + 3 / 4 * (4 * 16 + 4)) / 3, abs=2)
    for size in range(0, len(whole), 7):
        file.write_bytes(whole[:size])
        with pytest.raises(vcc.InputError, match="is damaged or cut off"):
            stored.read()


def test_opening_is_quick(stored):
    open_store(stored.path)
    start = time.process_time()
    open_store(stored.path)
    assert time.process_time() - start < 0.1  # measured: 2 ms


# --- written view by view ---


def test_work_goes_on_in_a_store_from_before_samples_were_told_apart(tmp_path):
    made = {"provenance": {}, "description": {"scene": 1}}
    first = create_store(tmp_path / "a.zarr", CAMERAS, SHAPE, "float32", **made)
    group = zarr.open_group(first.path, mode="r+")
    stated = group.attrs["light_field"]
    del stated["sample"], stated["description"]["settings"]["sample"]
    group.attrs["light_field"] = stated
    assert len(create_store(tmp_path / "a.zarr", CAMERAS, SHAPE, "float32", **made).missing()) == 12
    with pytest.raises(vcc.InputError, match="sample is 'mean' there and 'point' now"):
        create_store(tmp_path / "a.zarr", CAMERAS, SHAPE, "float32", sample="point", **made)


def test_work_goes_on_where_it_stopped(tmp_path):
    def writer(scene=1, dtype="float32", **more):
        return create_store(
            tmp_path / "a.zarr", CAMERAS, SHAPE, dtype, provenance={}, description={"scene": scene}, **more
        )

    views = light_field(channels=()).values
    first = writer()
    first.write_view(2, 3, views[2, 3])
    (tmp_path / "a.zarr/samples/c.2.3.0.123abc.partial").write_bytes(b"killed here")
    again = writer()
    assert (2, 3) not in again.missing()
    assert len(again.missing()) == 11
    assert not list((tmp_path / "a.zarr").rglob("*.partial"))
    with pytest.raises(vcc.InputError, match=r"11 of 12 views are missing.*\(0, 0\)"):
        again.finish()
    with pytest.raises(vcc.InputError, match="not complete: 11 of its 12 views are missing"):
        open_store(tmp_path / "a.zarr").check_complete()
    assert not open_store(tmp_path / "a.zarr").complete
    np.testing.assert_array_equal(open_store(tmp_path / "a.zarr")[2:, 3:].values[0, 0], views[2, 3])
    for other, words in (
        ({"scene": 2}, r"another description.*scene is 1 there and 2 now"),
        ({"dtype": "float16"}, "dtype is 'float32' there and 'float16' now"),
        ({"compression": Lossless("lz4")}, "compression is"),
        ({"sample": "point"}, "sample is 'mean' there and 'point' now"),
    ):
        with pytest.raises(vcc.InputError, match=words):
            writer(**other)
    for row, column in again.missing():
        again.write_view(row, column, views[row, column])
    np.testing.assert_array_equal(again.finish().read().values, views)
    done = writer()
    assert done.missing() == []
    assert done.finish().complete
    with pytest.raises(vcc.InputError, match="is finished"):
        done.write_view(0, 0, views[0, 0])


KILLED = """
import sys
import time
import numpy as np
from vcc.base.affine import Affine
from vcc.store import create_store
writer = create_store(sys.argv[1], Affine.identity(), (20, 20, 300, 300), "float32", provenance={}, description={})
noise = np.random.default_rng(0).random((300, 300)).astype(np.float32)
for row, column in writer.missing():
    time.sleep(600 if row == 19 else 0)  # who kills it is in time
    writer.write_view(row, column, noise)
"""


def test_a_kill_leaves_whole_views_and_nothing_else(tmp_path):
    """Killed in the midst of writing: each view that counts as done is whole, the others are missing."""
    child = subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path / "a.zarr")])
    there = tmp_path / "a.zarr/samples/c.0.3.0.0"
    while not there.exists() and child.poll() is None:
        time.sleep(0.001)
    child.kill()
    assert child.wait() == -signal.SIGKILL
    frame = Affine.identity()
    writer = create_store(tmp_path / "a.zarr", frame, (20, 20, 300, 300), "float32", provenance={}, description={})
    noise = np.random.default_rng(0).random((300, 300)).astype(np.float32)
    stored, missing = open_store(tmp_path / "a.zarr"), writer.missing()
    assert 0 < len(missing) < 400
    for row, column in np.ndindex(20, 20):
        if (row, column) not in missing:
            np.testing.assert_array_equal(stored.stored_view(row, column, 0, 300), noise)


def test_a_store_without_a_description_is_not_gone_on_with(tmp_path):
    create_store(tmp_path / "a.zarr", CAMERAS, SHAPE, "uint8", provenance={})
    with pytest.raises(vcc.InputError, match="without a description"):
        create_store(tmp_path / "a.zarr", CAMERAS, SHAPE, "uint8", provenance={})


def test_a_full_disk_keeps_the_views_that_are_done(tmp_path):
    """A limit on the size of files stands for the disk: writing fails half-way, as there."""
    cameras = CameraArray(views=(1, 2), pixels=(128, 128), spacing=1e-3, slope_per_pixel=1e-3)
    noise = np.random.default_rng(0).random((128, 128)).astype(np.float32)
    writer = create_store(tmp_path / "a.zarr", cameras, cameras.shape, "float32", provenance={}, description={})
    writer.write_view(0, 0, noise)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(vcc.InputError, match=r"view \(0, 1\) could not be written.*1 of 2 views are kept"):
            writer.write_view(0, 1, noise)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert writer.missing() == [(0, 1)]
    assert len(list((tmp_path / "a.zarr/samples").glob("c.*"))) == 1
    writer.write_view(0, 1, noise)
    assert writer.finish().complete


@pytest.mark.parametrize(
    ("view", "words"),
    [
        (np.ones((10, 11), np.float32), "has the shape"),
        (np.ones((10, 12), np.uint8), "is uint8, and the store keeps float16"),
        (np.full((10, 12), np.nan, np.float32), "NaN, infinite or negative"),
        (np.full((10, 12), -1, np.float32), "NaN, infinite or negative"),
        (np.full((10, 12), 1e6, np.float32), "radiance of 1e\\+06, and float16 ends at 65504"),
    ],
)
def test_views_that_do_not_fit_are_refused(tmp_path, view, words):
    writer = create_store(tmp_path / "a.zarr", CAMERAS, SHAPE, "float16", provenance={})
    with pytest.raises(vcc.InputError, match=words):
        writer.write_view(0, 0, view)
    assert (0, 0) in writer.missing()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"dtype": "float64"}, "not float64"),
        ({"dtype": "float32", "transfer": "srgb"}, "integer codes"),
        ({"shape": (3, 4, 10)}, "has the shape"),
        ({"channel_names": ("red",)}, "1 channel_names for 3 channels"),
        ({"disparity_range": (2, 1)}, "disparity_range is"),
        ({"provenance": {"what": object()}}, "provenance.what of a store is kept as JSON"),
        ({"chunks": 0}, "chunks is"),
        ({"compression": Lossy("avif"), "dtype": "uint16"}, "AVIF holds 8 bits"),
        ({"compression": Lossy(), "dtype": "float32"}, "not float32"),
        ({"compression": Lossy(), "shape": (*SHAPE, 5)}, "not 5"),
    ],
)
def test_impossible_stores_are_refused(tmp_path, change, words):
    options = {"shape": (*SHAPE, 3), "dtype": "uint8", "provenance": {}} | change
    with pytest.raises(vcc.InputError, match=words):
        create_store(tmp_path / "a.zarr", CAMERAS, options.pop("shape"), options.pop("dtype"), **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("packing", "options", "words"),
    [
        (Lossless, {"codec": "gzip"}, "the codec of lossless compression is 'zstd' or 'lz4', not 'gzip'"),
        (Lossless, {"level": 12}, "a whole number from 0 to 9, not 12"),
        (Lossy, {"codec": "jpeg"}, "the codec of lossy compression is 'jpegxl' or 'avif', not 'jpeg'"),
        (Lossy, {"quality": 0}, "a whole number from 1 to 99, not 0"),
    ],
)
def test_settings_of_compression_are_checked(packing, options, words):
    with pytest.raises(vcc.InputError, match=words):
        packing(**options)


def test_a_store_is_replaced_only_when_asked_and_only_by_a_whole_one(tmp_path, stored):
    with pytest.raises(vcc.InputError, match="exists already"):
        save_store(light_field(seed=1), stored.path)
    bad = light_field().values.astype(np.float64)  # refused as it is written
    with pytest.raises(vcc.InputError):
        save_store(vcc.LightField(bad, GENERAL), stored.path, overwrite=True)
    np.testing.assert_array_equal(open_store(stored.path).read().values, light_field().values)
    new = save_store(light_field(seed=1), stored.path, overwrite=True)
    np.testing.assert_array_equal(new.read().values, light_field(seed=1).values)
    (tmp_path / "notes").mkdir()
    with pytest.raises(vcc.InputError, match="is not a store"):
        save_store(light_field(), tmp_path / "notes", overwrite=True)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.zarr", "notes"]


# --- with loss ---


@pytest.mark.parametrize(
    ("packing", "kind", "channels"),
    [
        (Lossy(), "uint8", (3,)),
        (Lossy(quality=80), "uint16", ()),
        (Lossy(), "uint8", (1,)),
        (Lossy("avif"), "uint8", (3,)),
    ],
)
def test_loss_is_measured_and_stated(tmp_path, packing, kind, channels):
    row, column = np.mgrid[:40, :48] / 48
    smooth = np.stack([row, column, row * column][: (channels or (1,))[0]], axis=-1).reshape(40, 48, *channels)
    codes = (np.tile(smooth, (2, 2, *[1] * smooth.ndim)) * np.iinfo(kind).max).astype(kind)
    codes[0, 1] = codes[0, 1, ::-1]
    stored = save_store(vcc.LightField.from_views(codes, 1e-3, 1e-3), tmp_path / "a.zarr", compression=packing)
    error = open_store(stored.path).read().values.astype(float) - codes
    psnr = 10 * math.log10(np.iinfo(kind).max ** 2 / np.mean(error**2))
    assert stored.lossy["psnr"] == pytest.approx(psnr)
    assert stored.lossy["worst_psnr"] <= psnr + 1e-9
    assert psnr > 30
    assert (stored.lossy["codec"], stored.lossy["quality"]) == (packing.codec, packing.quality)


# --- from one type to another ---


def test_types_are_converted_as_light(tmp_path):
    codes = light_field("uint8")
    kept = convert(codes, tmp_path / "8.zarr", transfer="srgb")
    wide = convert(kept, tmp_path / "16.zarr", dtype="uint16")
    np.testing.assert_array_equal(wide.read().values, decode(wide.read().values))
    np.testing.assert_allclose(wide.read().values, decode(codes.values), atol=1e-6)
    back = convert(wide, tmp_path / "8 again.zarr", dtype="uint8")
    light = convert(kept, tmp_path / "light.zarr", dtype="float32", compression=Lossless("lz4"))
    coded = convert(light, tmp_path / "coded.zarr", dtype="uint8")
    np.testing.assert_array_equal(light.read().values, decode(codes.values))
    for same in (kept, back, coded):
        np.testing.assert_array_equal(zarr.open_group(same.path, mode="r")["samples"][:], codes.values)
        assert same.transfer == "srgb"
    assert wide.provenance == kept.provenance
    with pytest.raises(vcc.InputError, match=r"view \(0, 0\) has radiance up to"):
        convert(light_field(), tmp_path / "bright.zarr", dtype="uint16")
    linear = convert(light_field("uint16"), tmp_path / "linear.zarr", dtype="float32")
    np.testing.assert_allclose(linear.read().values, light_field("uint16").values / 65535, rtol=1e-6)


# --- faults ---


def test_a_missing_view_is_named(stored):
    file = stored.view_file(1, 2)
    file.unlink()
    with pytest.raises(vcc.InputError, match=rf"view \(1, 2\) is missing .*{file}"):
        stored.read()
    with pytest.raises(vcc.InputError, match=r"is not complete: 1 of its 12 views are missing.*\(1, 2\)\. Copy"):
        vcc.Camera([], vcc.Sensor(0.0, (4, 4), 1e-3)).capture(stored)


@pytest.mark.parametrize("left", [0, 10, 300, -1])
def test_a_view_that_is_cut_off_is_named(stored, left):
    file = stored.view_file(0, 1)
    file.write_bytes(file.read_bytes()[:left])
    with pytest.raises(vcc.InputError, match=rf"view \(0, 1\) .* cannot be read: {file} is damaged or cut off"):
        stored.view(0, 1)
    stored.view(0, 0)


def test_a_view_that_rotted_is_named(stored):
    file = stored.view_file(0, 1)
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    with pytest.raises(vcc.InputError, match=r"view \(0, 1\).*damaged"):
        stored.view(0, 1)


def test_a_chunk_within_a_view_that_was_never_written_is_named(tmp_path):
    """Zarr reads zeros there and says nothing."""
    stored = save_store(light_field(), tmp_path / "a.zarr", chunks=2)
    array = zarr.open_group(stored.path, mode="r+")["samples"]
    array[0, 1, 4:6] = 0  # dark, so that zarr drops it
    assert not array[0, 1, 4:6].any()
    with pytest.raises(vcc.InputError, match=r"view \(0, 1\).*1 of its 5 chunks were never written"):
        stored.view(0, 1)


def test_samples_that_are_no_light_are_named(stored):
    zarr.open_group(stored.path, mode="r+")["samples"][2, 2, 3, 3] = np.nan
    with pytest.raises(vcc.InputError, match=r"view \(2, 2\).*NaN"):
        stored.read()


def change(stored, file, **keys):
    path = stored.path / file
    stated = json.loads(path.read_text())
    at = stated["attributes"]["light_field"] if file == "zarr.json" and "zarr_format" not in keys else stated
    for key, value in keys.items():
        if value is None:
            del at[key]
        else:
            at[key] = value
    path.write_text(json.dumps(stated))


@pytest.mark.parametrize(
    ("file", "keys", "words"),
    [
        ("zarr.json", {"format_version": 2}, "has format_version 2, and this vcc reads up to 1"),
        ("zarr.json", {"format_version": "one"}, "format_version is a whole number, 1 or more, not 'one'"),
        ("zarr.json", {"zarr_format": 2}, "zarr_format 2"),
        ("zarr.json", {"frame": None}, "do not state frame"),
        ("zarr.json", {"frame": [[1, 2], [3, 4]]}, "cannot be used"),
        ("zarr.json", {"frame": np.zeros((5, 5)).tolist()}, "cannot be used"),
        ("zarr.json", {"transfer": "log"}, "transfer is 'linear' or 'srgb'"),
        ("zarr.json", {"transfer": "srgb"}, "only integers are sRGB codes"),
        ("zarr.json", {"units": {"u": "mm"}}, "units"),
        ("zarr.json", {"complete": "yes"}, "complete is true or false"),
        ("samples/zarr.json", {"data_type": "float64"}, "not float64"),
        ("samples/zarr.json", {"data_type": "nonsense"}, "cannot be used"),
        ("samples/zarr.json", {"codecs": [{"name": "nonsense"}]}, "cannot be used"),
        ("samples/zarr.json", {"shape": [0, 4, 10, 12, 3]}, "not the shape"),
    ],
)
def test_wrong_metadata_is_named(stored, file, keys, words):
    change(stored, file, **keys)
    with pytest.raises(vcc.InputError, match=words) as caught:
        open_store(stored.path)
    assert str(stored.path) in str(caught.value)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, "there is no store"),
        (lambda path: path.write_text(""), "it is a file"),
        (lambda path: path.mkdir(), r"holds no zarr\.json"),
        (zarr.create_group, "but not a light field"),
        (lambda path: zarr.create_group(path, zarr_format=2), "is Zarr version 2"),
    ],
)
def test_what_is_no_store_is_named(tmp_path, make, words):
    make(tmp_path / "a.zarr")
    with pytest.raises(vcc.InputError, match=words):
        open_store(tmp_path / "a.zarr")


def test_any_group_is_a_store_to_speak_of(tmp_path):
    zarr.create_group(tmp_path / "other.zarr")
    assert is_store(tmp_path / "other.zarr")


@pytest.mark.parametrize(
    ("place", "words"), [("file.zarr", "is not a store"), ("lost/a.zarr", "there is no folder")]
)
def test_stores_that_cannot_be_made_are_refused(tmp_path, place, words):
    (tmp_path / "file.zarr").write_text("")
    with pytest.raises(vcc.InputError, match=words):
        create_store(tmp_path / place, CAMERAS, SHAPE, "uint8", provenance={}, description={})
    assert not list(tmp_path.glob(".*"))


def test_views_in_shards_of_several_are_refused(tmp_path):
    group = zarr.create_group(tmp_path / "a.zarr")
    stated = {"format_version": 1, "frame": GENERAL.matrix.tolist(), "transfer": "linear", "complete": True}
    group.attrs["light_field"] = stated
    group.create_array("samples", shape=SHAPE, dtype="uint8", chunks=(1, 2, 10, 12))
    with pytest.raises(vcc.InputError, match="each view is a file of its own"):
        open_store(tmp_path / "a.zarr")


# --- replaced, and written by two ---


def test_a_store_whose_writer_died_between_two_renames_is_put_back_where_it_is_looked_for(tmp_path, monkeypatch):
    path = tmp_path / "a.zarr"
    lf = vcc.LightField.from_views(np.arange(48, dtype=np.uint8).reshape(2, 2, 3, 4), 1e-3, 1e-3, 1.0)
    dead = subprocess.run(["sh", "-c", "echo $$"], capture_output=True, check=True)
    monkeypatch.setattr(os, "getpid", lambda: int(dead.stdout))
    for look in (open_store, is_store, lambda path: save_store(lf, path, overwrite=True)):
        save_store(lf, path, overwrite=True)
        path.rename(parts.set_aside(path))
        with pytest.warns(vcc.ResultWarning, match="the old store was restored"):
            assert look(path)
        np.testing.assert_array_equal(open_store(path).read().values, lf.values)
        assert [file.name for file in tmp_path.iterdir()] == ["a.zarr"]


def test_a_store_has_one_writer_and_the_earlier_one_is_told(tmp_path):
    made = {"provenance": {}, "description": {}}
    first = create_store(tmp_path / "a.zarr", CAMERAS, SHAPE, "float32", **made)
    second = create_store(tmp_path / "a.zarr", CAMERAS, SHAPE, "float32", **made)
    with pytest.raises(vcc.InputError, match=r"this writer of .* has ended"):
        first.write_view(0, 0, np.ones(SHAPE[2:], np.float32))
    second.write_view(0, 0, np.ones(SHAPE[2:], np.float32))
    assert open_store(tmp_path / "a.zarr").view(0, 0).values.all()  # readers are not hindered
    second.__exit__(None, None, None)
    assert [file.name for file in tmp_path.iterdir()] == ["a.zarr"]


def test_another_process_is_told_who_writes_a_store(tmp_path):
    path = tmp_path / "a.zarr"
    made = {"provenance": {}, "description": {}}
    create_store(path, CAMERAS, SHAPE, "float32", **made).__exit__(None, None, None)
    command = [sys.executable, "-c", LOCKS, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(vcc.InputError, match=f"is being written by process {other.pid}"):
            create_store(path, CAMERAS, SHAPE, "float32", **made)
        with pytest.raises(vcc.InputError, match=f"is being written by process {other.pid}"):
            save_store(light_field(), path, overwrite=True)
        assert not open_store(path).complete  # readers are not hindered
        other.communicate("")
    save_store(light_field(), path, overwrite=True)
    assert [file.name for file in tmp_path.iterdir()] == ["a.zarr"]


def test_a_full_disk_under_a_store_written_as_a_whole_keeps_what_stood_there(tmp_path, monkeypatch):
    def full(self, key, value):
        raise OSError(28, "No space left on device")

    lf = vcc.LightField.from_views(np.zeros((2, 2, 4, 4), np.uint8), 1e-3, 1e-3, 1.0)
    words = r"a\.zarr could not be written: No space left.* MB are free there: make room.* as a whole: "
    monkeypatch.setattr(zarr.Array, "__setitem__", full)
    with pytest.raises(vcc.InputError, match=words + "nothing of it is kept"):
        save_store(lf, tmp_path / "a.zarr")
    monkeypatch.undo()
    save_store(lf, tmp_path / "a.zarr")
    monkeypatch.setattr(zarr.Array, "__setitem__", full)
    with pytest.raises(vcc.InputError, match=words + "the store that was there stays"):
        save_store(lf, tmp_path / "a.zarr", overwrite=True)
    assert [file.name for file in tmp_path.iterdir()] == ["a.zarr"]
    assert open_store(tmp_path / "a.zarr").complete


def test_what_interrupts_is_raised_once_nothing_writes_any_more(tmp_path, monkeypatch):
    """Zarr writes in threads of its own, which went on and made a folder anew that had been taken away."""
    real, written = zarr.storage.LocalStore.set, []

    async def interrupted(self, key, value):
        if key == "samples/c.0.1.0.0.0":
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
            await asyncio.sleep(0.3)
        await real(self, key, value)
        written.append(key)

    save_store(light_field(seed=1), tmp_path / "a.zarr")
    monkeypatch.setattr(zarr.storage.LocalStore, "set", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_store(light_field(), tmp_path / "a.zarr", overwrite=True)
    assert "samples/c.0.1.0.0.0" in written  # it was awaited
    assert [file.name for file in tmp_path.iterdir()] == ["a.zarr"]
    np.testing.assert_array_equal(open_store(tmp_path / "a.zarr").read().values, light_field(seed=1).values)


@pytest.mark.parametrize("overwrite", [True, False])
def test_threads_that_save_one_store_do_so_one_after_the_other(tmp_path, overwrite):
    together, told = threading.Barrier(4), []

    def save(seed):
        together.wait()
        try:
            stored = save_store(light_field(seed=seed), tmp_path / "a.zarr", overwrite=overwrite)
            told.append(stored.complete)
        except vcc.InputError as error:
            told.append(str(error))

    threads = [threading.Thread(target=save, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    there = f"{tmp_path / 'a.zarr'} exists already: choose another name, or pass overwrite=True"
    assert told == ([True] * 4 if overwrite else [True, there, there, there])
    found = open_store(tmp_path / "a.zarr").read().values
    assert any(np.array_equal(found, light_field(seed=seed).values) for seed in range(4))
    assert [file.name for file in tmp_path.iterdir()] == ["a.zarr"]
