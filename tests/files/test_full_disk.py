"""Whatever writes a file, a disk that is full is told in the disk's own words, once, and an older file stays.

A limit on the size of files stands for the disk, which refuses in the midst of a write.
"""

import io
import resource
import signal
from contextlib import contextmanager

import numpy as np
import pytest

import vcc
from vcc.files.npy import write_npy
from vcc.files.writer_lock import WriterLock
from vcc.formats import save_light_field
from vcc.formats.films import Film
from vcc.store import save_store
from vcc.sweeps.table import Table

NOISE = np.random.default_rng(0).random((3, 3, 60, 80, 3), np.float32)
VIEWS = vcc.LightField.from_views(NOISE, 1e-3, 1e-3)
PICTURE = vcc.Image(NOISE[0, 0], vcc.Affine.identity(2))


@contextmanager
def files_of(size: int):
    """No file may become larger, bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)


def camera(path):
    mask = vcc.Mask(np.random.default_rng(0).random((60, 60)), 5e-4, z=1e-3)
    vcc.Camera([mask], vcc.Sensor(z=0.05, shape=(4, 5), pitch=1e-5)).save(path)


WRITERS = {
    "a.npy": PICTURE.save,
    "a.exr": PICTURE.save,
    "a.png": PICTURE.save,
    "a.tif": PICTURE.save,
    "a.npz": lambda path: save_light_field(VIEWS, path),
    "a.mat": lambda path: save_light_field(VIEWS, path),
    "a.mp4": lambda path: save_light_field(VIEWS, path, exposure="auto"),
    "views": lambda path: save_light_field(VIEWS, path, kind="views", ending=".exr"),
    "a.zarr": lambda path: save_light_field(VIEWS, path),
    "a.parquet": Table({"a": NOISE.reshape(-1).astype(float)}, {}).save,
    "a.csv": Table({"a": NOISE.reshape(-1).astype(float)}, {}).save,
    "a.toml": camera,
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_is_told_in_its_own_words(tmp_path, name):
    with files_of(4096), pytest.raises(vcc.InputError) as told:
        WRITERS[name](tmp_path / name)
    assert "could not be written: File too large. Write to another disk, or allow larger files" in str(told.value)
    assert not list(tmp_path.iterdir())


def test_an_older_file_stays(tmp_path):
    for name in ("a.exr", "a.npy"):
        (tmp_path / name).write_bytes(b"older")
        with files_of(4096), pytest.raises(vcc.InputError, match="An older file of that name stays as it was"):
            PICTURE.save(tmp_path / name)
        assert (tmp_path / name).read_bytes() == b"older"


def test_a_film_of_another_kind_is_told_too(tmp_path):
    with files_of(4096), pytest.raises(OSError, match="too large"):
        Film(".mp4", 10.0).write([np.uint8(NOISE[0, 0] * 255)] * 20, tmp_path / "a.mp4", "a.mp4")


def test_the_lock_of_a_writer_needs_no_room(tmp_path):
    with files_of(0):
        lock = WriterLock(tmp_path / "a.zarr")
        lock.give_back()
        with pytest.raises(vcc.InputError, match=r"a\.zarr could not be written: File too large"):
            save_store(VIEWS, tmp_path / "a.zarr")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("values", [NOISE[0, 0], np.eye(3)[::2], np.array(b"words"), np.arange(6, dtype=">u2")])
def test_arrays_are_written_byte_for_byte_as_numpy_does(values):
    ours, numpys = io.BytesIO(), io.BytesIO()
    write_npy(values, ours)
    np.save(numpys, values.copy(order="C"))
    assert ours.getvalue() == numpys.getvalue()


# --- long names ---


@pytest.mark.parametrize("letter", ["a", "é"])
@pytest.mark.parametrize("name", WRITERS)
def test_a_name_of_the_greatest_length_can_be_written(tmp_path, name, letter):
    ending = name.partition(".")[2]
    path = tmp_path / f"{letter * ((254 - len(ending)) // len(letter.encode()))}{'.' if ending else ''}{ending}"
    WRITERS[name](path)
    assert path.exists()
    assert all(len(each.name) > 100 for each in tmp_path.iterdir())  # it, and what a camera file names
    longer = path.with_name(f"{letter * 60}{path.name}")
    with pytest.raises(vcc.InputError, match=r"the disk allows 255\. Choose a shorter name"):
        WRITERS[name](longer)
