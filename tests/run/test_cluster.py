"""Blocks run by a Dask cluster: the same bytes, a worker that is killed loses nothing, what is lost is told.

One cluster of two processes for all of them.
"""

from __future__ import annotations

import asyncio
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import distributed
import numpy as np
import pytest

import vcc
from tests.run.test_executors import CAMERAS, FOCUS, in_blocks, light_field, stored  # noqa: F401  # fixtures
from tests.run.unread import Unread
from vcc.run import executors
from vcc.run.executors import Tree, Work, worker_pool
from vcc.units import mm

pytestmark = [
    pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore:Port .* is already in use"),
]


@pytest.fixture(scope="module")
def client():
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, memory_limit="2GB", dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


@dataclass(frozen=True)
class Deadly(Unread):
    """Samples whose reader is killed, once for each of some rows of views.

    Args:
        samples: that are read else.
        rows: of views.
        folder: of marks: who was killed before is spared.
    """

    rows: tuple[int, ...]
    folder: Path

    def read(self, block):
        mark = self.folder / str(block.rows[0])
        if block.rows[0] in self.rows and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return self.samples.read(block)


def test_what_workers_lack_is_told(client, stored, monkeypatch):  # noqa: F811
    assert worker_pool(client).places == 2
    assert worker_pool(client).memory == pytest.approx(0.7 * 2e9 - 4e8, rel=1e-3)
    with pytest.raises(
        vcc.InputError, match=r"has 1000 MB for each task, .* and 1500 MB are required: give workers"
    ):
        CAMERAS["fine mask"][0].capture(stored, executor=client, memory_limit=1_500_000_000)
    for version, words in (("0.0.1", "version 0.0.1 of the package"), (None, "no version of the package")):
        monkeypatch.setattr(executors.pydoc, "locate", lambda _, found=version: found)  # sent as it is
        with pytest.raises(vcc.InputError, match=f"the worker tcp://.* has {words}, and the sender has"):
            CAMERAS["fine mask"][0].capture(stored, executor=client)


def test_a_cluster_makes_the_same_picture_though_a_worker_is_killed(client, stored, in_blocks, tmp_path):  # noqa: F811
    camera, _ = CAMERAS["fine mask"]
    calls: list[tuple[int, int]] = []
    here = camera.capture(stored)
    found = camera.capture(stored, executor=client, progress=lambda *call: calls.append(call))
    assert found.values.tobytes() == here.values.tobytes()
    assert calls[-1] == (16, 16)
    operator = camera.operator(stored)
    assert operator.T(here.values, executor=client).tobytes() == operator.T(here.values).tobytes()
    before = set(client.nthreads())
    deadly = Deadly(stored, (3,), tmp_path)
    assert camera.capture(deadly, executor=client).values.tobytes() == here.values.tobytes()
    assert (tmp_path / "3").exists()
    assert set(client.nthreads()) != before


PARAMETERS = {"sensor.z": [0.98 * FOCUS, FOCUS, 1.02 * FOCUS], "lens.diameter": [5 * mm, 7 * mm]}


@dataclass(frozen=True)
class OnceDeadly:
    """A metric that kills who computes it, the first time.

    Args:
        mark: a file that says that it did.
    """

    mark: Path

    def __call__(self, image):
        if not self.mark.exists():
            self.mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return image.values.max()


def test_a_sweep_loses_nothing_though_a_worker_is_killed(client, tmp_path):
    camera, field = CAMERAS["fine mask"][0], light_field()
    deadly = OnceDeadly(tmp_path / "mark")
    found = vcc.sweep(camera, field, PARAMETERS, metrics={"brightest": deadly}, executor=client)
    assert deadly.mark.exists()
    alone = vcc.sweep(camera, field, PARAMETERS)
    np.testing.assert_allclose(found.pictures, alone.pictures, rtol=0, atol=1e-6 * alone.pictures.max())
    assert found.table["brightest"].tolist() == found.pictures.max(axis=(2, 3, 4)).ravel().tolist()


def test_sums_are_those_of_the_tree_and_results_come_with_their_numbers(client):
    tree = Tree(70, joined)
    for number in range(70):
        tree.put(number, f"{number}!")
    told: list[int] = []
    assert worker_pool(client).summed(Work(marked, "!"), range(70), joined, told.append) == tree.total
    assert sorted(told) == list(range(70))
    assert sorted(worker_pool(client).each(Work(marked, "?"), "abc")) == [(0, "a?"), (1, "b?"), (2, "c?")]


def marked(mark, item):
    return f"{item}{mark}"


def joined(one, other):
    return f"({one}+{other})"


def test_a_view_that_is_missing_is_named(client, tmp_path, monkeypatch):
    given = vcc.store.save_store(light_field(), tmp_path / "a.zarr")
    given.view_file(2, 3).unlink()
    monkeypatch.setattr(type(given), "check_complete", lambda _: None)
    with pytest.raises(vcc.InputError, match=r"view \(2, 3\) is missing"):
        CAMERAS["fine mask"][0].capture(given, executor=client)


def test_a_task_that_kills_all_workers_is_told(client):
    client.cluster.scheduler.allowed_failures = 0
    with pytest.raises(vcc.InputError, match=r"killed each worker that ran it.* Pass memory_limit="):
        list(worker_pool(client).each(Work(kill, None), [0]))


def kill(*_):
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize("ends", ["scheduler", "interrupt"])
def test_work_whose_scheduler_is_lost_ends_with_an_error_and_ctrl_c_cancels(ends, monkeypatch):
    """Threads instead of processes, as nothing is computed."""
    monkeypatch.setattr(executors, "LOOK", 0.05)
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster.scheduler_address, set_as_default=False) as client,
    ):
        client._timeout = 0.1  # once connected: how long it looks for a scheduler that is lost

        def told(number):
            if ends == "interrupt":
                raise KeyboardInterrupt
            cluster.close()

        async def never(data):
            await asyncio.sleep(3600)

        workers = worker_pool(client)
        with monkeypatch.context() as frozen:
            frozen.setattr(executors, "SILENT", 0.2)  # here alone: a busy machine may answer later
            frozen.setitem(cluster.scheduler.handlers, "echo", never)
            with pytest.raises(vcc.InputError, match=r"has not answered for 0\.2 s: it is stopped"):
                workers.summed(Work(pause, 0.5), [0], joined, told)
        expected, words = {
            "interrupt": (KeyboardInterrupt, None),
            "scheduler": (vcc.InputError, "connection to the Dask scheduler inproc.* was lost"),
        }[ends]
        with pytest.raises(expected, match=words):
            worker_pool(client).summed(Work(sleep, None), range(100), joined, told)
    with pytest.raises(vcc.InputError, match="reconnect with"):
        worker_pool(client)


def test_a_sweep_whose_scheduler_is_lost_says_what_is_kept_and_goes_on(stored, tmp_path, monkeypatch):  # noqa: F811
    monkeypatch.setattr(executors, "LOOK", 0.05)
    given = CAMERAS["fine mask"][0], stored, PARAMETERS
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster.scheduler_address, set_as_default=False) as client,
    ):
        client._timeout = 0.1  # once connected: how long it looks for a scheduler that is lost

        def progress(done, total):
            if done == 2:
                cluster.close()

        said = r"connection to the Dask .* was lost.*\. 2 of 6 pictures are kept in .*a.zarr: run the same sweep"
        with pytest.raises(vcc.InputError, match=said):
            vcc.sweep(*given, output=tmp_path / "a.zarr", executor=client, progress=progress)
    assert vcc.sweeps.open_sweep(tmp_path / "a.zarr").done.sum() == 2
    whole, alone = vcc.sweep(*given, output=tmp_path / "a.zarr"), vcc.sweep(*given)
    np.testing.assert_allclose(whole.pictures, alone.pictures, rtol=0, atol=1e-6 * alone.pictures.max())


def pause(seconds, item):
    time.sleep(seconds)


def sleep(_, item):
    time.sleep(0.02)
    return str(item)
