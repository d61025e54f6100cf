"""Disparity maps in a store, damaged: refused in words with their folder, and nothing large is read."""

import json
import os

import numpy as np
import pytest

import vcc
from vcc.fields.disparity import DisparityMaps
from vcc.store.disparity_maps import FOLDER, keep_maps, read_maps
from vcc.units import mm

SHAPE = (3, 3, 12, 16, 3)


@pytest.fixture
def store(tmp_path):
    values = np.random.default_rng(0).random(SHAPE, dtype=np.float32)
    path = tmp_path / "field.zarr"
    vcc.store.save_store(vcc.LightField.from_views(values, 1 * mm, 2e-3), path)
    keep_maps(path, DisparityMaps(np.ones((2, 12, 16), np.float32), ((1.0, 1.0), (0.0, 2.0)), "made up"))
    return path


def chunks(store):
    return [each for each in sorted((store / FOLDER).rglob("*")) if each.is_file() and each.name != "zarr.json"]


def to_a_large_file(store):
    large = store.parent / "large"
    with large.open("wb") as file:
        file.truncate(2**31)  # no blocks: it takes no room
    chunks(store)[0].unlink()
    chunk = store / FOLDER / "c" / "0" / "0" / "0"
    chunk.symlink_to(large)


def to_a_pipe(store):
    chunk = chunks(store)[0]
    chunk.unlink()
    os.mkfifo(chunk)


def of_another_shape(store):
    metadata = store / FOLDER / "zarr.json"
    told = json.loads(metadata.read_text())
    told["shape"] = [2, 2**20, 2**20]
    metadata.write_text(json.dumps(told))


def of_noise(store):
    for chunk in chunks(store):
        chunk.write_bytes(np.random.default_rng(1).bytes(300))


def cut_off(store):
    metadata = store / FOLDER / "zarr.json"
    metadata.write_text(metadata.read_text()[:40])


@pytest.mark.parametrize("damage", [to_a_large_file, to_a_pipe, of_another_shape, of_noise, cut_off])
def test_damaged_maps_are_refused_with_their_folder(store, damage):
    np.testing.assert_array_equal(read_maps(store, SHAPE).values, 1)
    damage(store)
    with pytest.raises(vcc.InputError, match=r"field\.zarr.disparity cannot be used: .*Delete this folder"):
        read_maps(store, SHAPE)
