"""``--executor``: the picture is the same, and what cannot be is refused before anything is read."""

import multiprocessing
import time

import numpy as np
import pytest

import vcc
from tests.command_line import CAMERA, run
from vcc.cli import executing
from vcc.cli.executing import opened
from vcc.store import save_store
from vcc.units import mm


@pytest.fixture
def files(tmp_path):
    """(camera, store)"""
    (tmp_path / "camera.toml").write_text(CAMERA)
    values = np.random.default_rng(0).random((3, 4, 12, 16)).astype("float32")
    given = vcc.LightField.from_views(values, 1 * mm, 0.02, 1.3, disparity_range=(0.0, 0.0))
    save_store(given, tmp_path / "a.zarr")
    return str(tmp_path / "camera.toml"), str(tmp_path / "a.zarr")


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")
def test_threads_make_the_same_picture(files, tmp_path):
    pictures = []
    for name, options in (("here.npy", []), ("there.npy", ["--executor", "threads"])):
        done = run("capture", *files, "-o", str(tmp_path / name), *options)
        assert done.exit_code == 0, done.stderr
        pictures.append(np.load(tmp_path / name))
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=0, atol=1e-6 * pictures[0].max())


@pytest.mark.parametrize(
    ("executor", "words"),
    [
        ("cluster", "--executor is processes, threads or \"dask://host:8786\", not 'cluster'"),
        ("dask://127.0.0.1:1", "no Dask scheduler answers at 127.0.0.1:1"),
        ("dask://127.0.0.1:x", "no Dask scheduler answers at 127.0.0.1:x"),
    ],
)
@pytest.mark.parametrize("command", ["capture", "expose"])
def test_what_is_no_executor_is_refused(files, tmp_path, monkeypatch, command, executor, words):
    monkeypatch.setattr(executing, "CONNECTING", 0.1)
    (tmp_path / "camera.toml").write_text(CAMERA + "[sensor.electronics]\n")
    output = tmp_path / "picture.tif"
    done = run(command, *files, "-o", str(output), "--executor", executor)
    assert (done.exit_code, output.exists()) == (2, False)
    assert words in " ".join(done.stderr.split())


def test_what_is_no_store_is_refused(files, tmp_path):
    done = run("capture", files[0], str(tmp_path), "-o", str(tmp_path / "p.npy"), "--executor", "threads")
    assert done.exit_code == 2
    assert "--executor requires a light field in a store" in done.stderr
    assert "vcc convert" in done.stderr


def test_what_ends_the_command_ends_its_processes():
    processes = []

    def interrupted():
        with opened("processes") as pool:
            pool.submit(int).result()
            pool.submit(time.sleep, 600)
            processes.extend(multiprocessing.active_children())
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert processes
    for process in processes:
        process.join(60)
        assert not process.is_alive()
