"""``vcc spectrum`` draws, and refuses what it cannot."""

import imagecodecs
import numpy as np
import pytest

import vcc
from tests.command_line import run as run_command
from vcc.store import save_store


@pytest.fixture
def store(tmp_path):
    samples = np.random.default_rng(1).random((3, 3, 16, 20, 3)).astype(np.float32)
    save_store(vcc.LightField.from_views(samples, 1e-3, 2e-3), tmp_path / "scene.zarr")
    return tmp_path / "scene.zarr"


def run(*arguments):
    result = run_command("spectrum", *arguments)
    assert "Traceback" not in result.output
    return result


def test_a_store_is_drawn(store, tmp_path):
    drawings = [tmp_path / name for name in ("power.png", "section.png")]
    first = run(store, "-o", drawings[0])
    assert first.exit_code == 0, first.output
    assert "written" in first.output
    assert run(store, "-o", drawings[1], "--across", "vt", "--of", "section", "--window", "none").exit_code == 0
    one, other = (imagecodecs.imread(drawing) for drawing in drawings)
    assert one.shape == other.shape
    assert (one != other).any()


def test_what_is_refused(store, tmp_path):
    large = run(store, "-o", tmp_path / "a.png", "--memory-limit", "1 kB")
    assert large.exit_code == 2
    assert "memory" in large.output
    assert run(store, "-o", tmp_path / "a.jpg").exit_code == 2
    assert run(store, "-o", tmp_path / "a.png", "--across", "uu").exit_code == 2
    assert not list(tmp_path.glob("a.*"))
