"""What an executor is expected to take, beside what all takes here."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import vcc
from vcc.advice import explain
from vcc.plan.how import How
from vcc.run.drive import Drive
from vcc.store import save_store
from vcc.units import mm

CAMERA = vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=9 * mm)], vcc.Sensor(52 * mm, (20, 30), 0.1 * mm))


@pytest.fixture
def stored(tmp_path):
    values = np.random.default_rng(0).random((4, 5, 20, 30)).astype("float32")
    given = vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0, disparity_range=(0.0, 0.0))
    return save_store(given, tmp_path / "a.zarr")


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")
def test_both_times_are_told_and_which_to_take(stored):
    with ThreadPoolExecutor(3) as pool:
        words = CAMERA.explain(stored, executor=pool)
        assert "Run by an executor\n  one block of 4×5 views, 3 at once, each by 1 thread and within" in words
        assert f"about {words.expected_seconds_by_executor:.2g} s expected" in words
        assert f"about {words.expected_seconds:.2g} s without it, by all cores of this machine: " in words
        assert all(len(line) <= 80 for line in words.splitlines())
        run = Drive(CAMERA.compile(stored), stored, How(), pool)
        for here, verdict in ((1e-9, "leave the executor out"), (1e9, "the executor is worth it")):
            said, seconds = explain.of_executor(run, here)
            assert said.endswith(verdict)
            assert 0 < seconds < 1e9
        rays = CAMERA.explain(stored, executor=pool, method="rays")
        assert rays.expected_seconds_by_executor is None
        assert "not estimated" in rays.splitlines()[-1]
    assert CAMERA.explain(stored).expected_seconds_by_executor is None


def test_time_is_that_of_as_many_rounds_as_there_are(stored, monkeypatch):
    """Counted by hand: 10 blocks of which 4 run at once take 3 rounds; a clock that ticks when it is looked at."""
    ticks = iter(range(100))
    monkeypatch.setattr(explain.time, "perf_counter", lambda: float(next(ticks)))
    monkeypatch.setattr(explain, "_ask", lambda run, blocks, first=False: [0.25])
    with ThreadPoolExecutor(4) as pool:
        run = Drive(CAMERA.compile(stored), stored, How(), pool)
        _, share = explain.some_views(run)
        found = explain.expected_seconds(run, 10, 4)
    assert found == pytest.approx(1 + 3 * (0.25 / share / 10 + 0.75))
