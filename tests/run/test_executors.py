"""Blocks run by others: the picture is the one made here, the same bytes from run to run, and what dies is told.

Oracle: the picture that the serial driver makes of the same samples, in memory. Single precision sums of a picture
in another order differ by about 1e-7 of its brightest pixel; 1e-6 is asked for.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import pickle
import random
import threading
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from functools import reduce

import array_api_strict
import numpy as np
import pytest
import zarr

import vcc
from tests.physics.random_cameras import drawn
from vcc.base.units import mm
from vcc.plan.how import How
from vcc.run import backwards, drive, serialization
from vcc.run.backwards import AHEAD
from vcc.run.blocks import Blocks
from vcc.run.executors import TOGETHER, Parcel, Pool, Tree, Work
from vcc.run.operator import Operator
from vcc.shapes.patterns import CosineSum
from vcc.store import save_store

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (5, 6, 14, 16)
FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=7 * mm)
SENSOR = vcc.Sensor(FOCUS, (12, 14), FOCUS * 3e-3)
MASK = vcc.Mask(pattern=CosineSum((0.5 * mm, 0.6 * mm), 1, 0.3), z=0.96 * FOCUS)
CAMERAS = {
    "fine mask": (vcc.Camera([LENS, MASK], SENSOR), {}),
    "views blurred": (
        vcc.Camera([LENS, vcc.Diffuser(kernel=vcc.kernels.Gaussian(0.004))], SENSOR),
        {"method": "footprints"},
    ),
    "rays": (
        vcc.Camera([LENS, vcc.LensArray(focal_length=2 * mm, pitch=1 * mm, z=FOCUS - 3 * mm)], SENSOR),
        {"samples": 8},
    ),
}


class Hostile(Executor):
    """Does its work in an order of its own, in another thread; what it is given it packs and unpacks.

    Args:
        seed: of the order.
        dies_after: so many tasks, as the pools of Python do; None never.
        pause: seconds after each task.
    """

    def __init__(self, seed: int, dies_after: int | None = None, pause: float = 0.0) -> None:
        self.random, self.dies_after, self.pause = random.Random(seed), dies_after, pause
        self.waiting: list[tuple[Future, bytes]] = []
        self.cancelled = self.done = 0
        self.there, self.closed = threading.Condition(), False
        self.thread = threading.Thread(target=self.work)
        self.thread.start()

    def submit(self, function, /, *given, **named):
        future, packed = Future(), pickle.dumps((function, given, named))
        with self.there:
            self.waiting.append((future, packed))
            self.there.notify()
        return future

    def shutdown(self, wait=True, *, cancel_futures=False):
        with self.there:
            self.closed = True
            self.there.notify()
        self.thread.join()

    def work(self):
        while True:
            with self.there:
                self.there.wait_for(lambda: self.waiting or self.closed)
                if not self.waiting:
                    return
                future, packed = self.waiting.pop(self.random.randrange(len(self.waiting)))
            if not future.set_running_or_notify_cancel():
                self.cancelled += 1
            elif self.done == self.dies_after:
                future.set_exception(BrokenExecutor("one died"))
            else:
                self.done += 1
                function, given, named = pickle.loads(packed)
                try:
                    future.set_result(function(*given, **named))
                except Exception as error:
                    future.set_exception(error)
                time.sleep(self.pause)


def light_field(shape=(*SHAPE, 3)):
    samples = np.random.default_rng(0).random(shape).astype(np.float32)
    return vcc.LightField.from_views(samples, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    return save_store(light_field(), tmp_path_factory.mktemp("executors") / "a.zarr", chunks=4)


@pytest.fixture
def in_blocks(monkeypatch):
    """Here and elsewhere blocks of a fifth of the rows and a third of the columns of views: two levels of sums."""

    def cut(used, grid, need, limit):
        looked_at = (np.flatnonzero(used.any(axis=axis)) for axis in (1, 0))
        spans = [(int(places[0]), int(places[-1]) + 1) for places in looked_at]
        return Blocks(*spans, *grid.shape[2:4], -(-grid.shape[0] // 5), -(-grid.shape[1] // 3), grid.shape[2])

    monkeypatch.setattr(drive, "cut_evenly", cut)
    monkeypatch.setattr(backwards, "cut_evenly", cut)


# --- the picture ---


@pytest.mark.parametrize("name", list(CAMERAS))
def test_the_picture_is_that_of_one_after_the_other(stored, in_blocks, name):
    camera, options = CAMERAS[name]
    plan = camera.compile(stored, **options)
    how = How(tolerance=0.4 if plan.by_rays else None)
    whole, here = (camera.capture(each, how, plan=plan) for each in (stored.read(), stored))
    assert len(list(drive.Drive(plan, stored, how).blocks)) > TOGETHER
    for executor in (ThreadPoolExecutor(2), Hostile(1), Hostile(2)):
        with executor:
            found = camera.capture(stored, how, plan=plan, executor=executor)
        np.testing.assert_allclose(found.values, whole.values, rtol=0, atol=1e-6 * whole.values.max())
        assert found.values.tobytes() == here.values.tobytes()
        assert (found.missing_rays, found.sampling_error) == (here.missing_rays, here.sampling_error)


def test_processes_make_the_same_picture_and_one_that_dies_is_told(stored, in_blocks):
    """Processes that share nothing: of a stored light field they get the address, of a small one the samples."""
    camera, _ = CAMERAS["fine mask"]
    here, operator = camera.capture(stored), camera.operator(stored)
    samples = np.random.default_rng(1).normal(size=stored.shape)
    calls: list[tuple[int, int]] = []
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        found = camera.capture(stored, executor=pool, progress=lambda *call: calls.append(call))
        assert found.values.tobytes() == here.values.tobytes()
        assert calls[-1] == (16, 16)  # those of the 30 views that the lens lets through
        assert sorted(calls) == calls
        picture = operator(samples, executor=pool)
        np.testing.assert_allclose(picture, operator(samples), rtol=0, atol=1e-6 * np.abs(picture).max())
        np.testing.assert_array_equal(operator.T(picture, executor=pool), operator.T(picture))
        with pytest.raises(vcc.InputError, match=r"a process of the executor, ProcessPoolExecutor, ended before"):
            list(Pool(pool).each(Work(end_process, None), [0, 1]))
        with pytest.raises(vcc.InputError, match="ended before its work was done"):
            camera.capture(stored, executor=pool)


def end_process(_: None, item: int) -> None:
    os._exit(3)


def test_views_in_between_are_made_elsewhere_and_what_no_view_shows_is_told(in_blocks):
    """Two planes: of what lies between views along their border, some is hidden from all views around."""
    step = np.where(np.arange(16) < 8, 2.0, -2.0) * np.ones((14, 1))
    given = vcc.LightField.from_views(light_field().values[:3, :3], 2 * mm, 2e-3, 1.0, disparity=step)
    camera = vcc.Camera([LENS], vcc.Sensor(40 * mm, (40, 40), 40 * mm * 2e-3))
    plan = camera.compile(given, between_views="depth")
    pictures, told = [], []
    with ThreadPoolExecutor(2) as pool:
        for executor in (None, pool):
            with pytest.warns(vcc.ResultWarning) as found:
                pictures.append(camera.capture(given, plan=plan, executor=executor).values.tobytes())
            told.append([str(each.message) for each in found])
    assert pictures[0] == pictures[1]
    assert told[0] == told[1]
    assert any("of the samples between views are visible in none" in words for words in told[0])


# --- back ---


@pytest.mark.parametrize("name", list(CAMERAS))
def test_what_a_picture_says_of_samples_is_that_of_one_after_the_other(stored, in_blocks, tmp_path, name):
    """Into memory, and into a Zarr array whose chunks are none of the blocks."""
    camera, options = CAMERAS[name]
    in_memory = stored.read()
    plan = camera.compile(in_memory, **options)
    given, elsewhere = (Operator(plan, each, How()) for each in (in_memory, stored))
    picture = np.random.default_rng(3).standard_normal(given.picture_shape).astype(np.float32)
    whole, here = given.T(picture), elsewhere.T(picture)
    np.testing.assert_allclose(here, whole, rtol=0, atol=1e-6 * np.abs(whole).max())
    calls = []
    out = zarr.create_array(
        tmp_path / "back.zarr", shape=given.samples_shape, chunks=(2, 3, 5, 7, 3), dtype="f4", fill_value=9
    )
    with Hostile(1) as executor:
        np.testing.assert_array_equal(elsewhere.T(picture, executor=executor), here)
        elsewhere.T(picture, out=out, executor=executor, progress=lambda *call: calls.append(call))
        np.testing.assert_array_equal(given.T(picture[None], executor=executor)[0], here)
    np.testing.assert_array_equal(out[:], here)
    used = int(plan.core.used_views(SHAPE).sum())
    assert sorted(calls) == calls
    assert calls[-1] == (used, used)


@pytest.mark.parametrize("kind", ["prisms", "three masks", "turned mask", "blur", "lenslets", "coded diffuser"])
def test_dot_products_of_random_cameras_by_an_executor(kind, in_blocks):
    case = drawn(kind, 17, 10, 4)
    operator = case.camera.operator(case.light_field)
    random = np.random.default_rng(4)
    samples = random.standard_normal(operator.samples_shape).astype(operator.dtype)
    with ThreadPoolExecutor(2) as pool:
        ahead = operator(samples)
        picture = ahead + random.standard_normal(ahead.shape).astype(ahead.dtype) * np.abs(ahead).mean()
        back = operator.T(picture, executor=pool)
    product = float((ahead.astype(np.float64) * picture).sum())
    assert abs(float((samples * back.astype(np.float64)).sum()) - product) <= 1e-6 * abs(product), case.described()


def test_not_all_that_others_find_waits_here(stored, in_blocks):
    """Samples may be more than memory: no more are made than are soon taken."""
    operator = CAMERAS["fine mask"][0].operator(stored)
    with Hostile(2) as executor:
        pieces = operator.T.pieces(np.ones(operator.picture_shape, np.float32), executor=executor)
        next(pieces)
        time.sleep(0.05)
        assert executor.done <= AHEAD < len(list(pieces))
    with (
        Hostile(3, dies_after=2) as executor,
        pytest.raises(vcc.InputError, match="ended before its work was done"),
    ):
        operator.T(np.ones(operator.picture_shape, np.float32), executor=executor)


# --- sums ---


@pytest.mark.parametrize("count", [1, 2, 8, 9, 64, 65, 200])
def test_a_tree_adds_in_one_order_whoever_comes_first(count):
    """Text shows what was added to what."""

    def add(one, other):
        return f"({one}+{other})"

    def expected(things):
        groups = [things[n : n + TOGETHER] for n in range(0, len(things), TOGETHER)]
        return things[0] if len(things) == 1 else expected([reduce(add, group) for group in groups])

    for seed in range(4):
        tree = Tree(count, add)
        for number in random.Random(seed).sample(range(count), count) if seed else range(count):
            assert tree.total is None
            tree.put(number, str(number))
            assert seed or len(tree._open) <= max(math.ceil(math.log(count, TOGETHER)), 1)
        assert tree.total == expected([str(n) for n in range(count)])


# --- what goes wrong ---


def test_the_first_that_fails_ends_the_work():
    executor = Hostile(3, pause=0.01)
    with pytest.raises(ZeroDivisionError):
        list(Pool(executor).each(Work(inverse, 1.0), [5, 4, 0, *range(1, 40)]))
    executor.shutdown()
    assert executor.done < 42
    assert executor.done + executor.cancelled == 42


def inverse(numerator, item):
    return numerator / item


def test_an_executor_that_dies_is_told(stored, in_blocks):
    executor = Hostile(4, dies_after=3)
    with pytest.raises(vcc.InputError, match="a process of the executor, Hostile, ended before its work was done"):
        CAMERAS["fine mask"][0].capture(stored, executor=executor)
    executor.shutdown()
    assert executor.done == 3


def test_an_executor_that_is_shut_down_is_told(stored):
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    with pytest.raises(vcc.InputError, match=r"executor accepts no tasks .*: pass one that is not shut down"):
        CAMERAS["fine mask"][0].capture(stored, executor=pool)


@pytest.mark.parametrize("ends", [KeyboardInterrupt, RuntimeError])
def test_what_progress_raises_ends_the_work(stored, in_blocks, ends):
    executor = Hostile(5, pause=0.01)

    def progress(done, total):
        raise ends

    with pytest.raises(ends):
        CAMERAS["fine mask"][0].capture(stored, executor=executor, progress=progress)
    executor.shutdown()
    assert executor.cancelled > 0


def test_no_executor(stored):
    with pytest.raises(
        vcc.InputError, match=r"executor must be a concurrent.futures.Executor or a dask.* not 'processes'"
    ):
        CAMERAS["fine mask"][0].capture(stored, executor="processes")


def test_much_in_memory_is_not_sent(monkeypatch):
    monkeypatch.setattr(serialization, "SENT", 1000)
    with Hostile(6) as executor, pytest.raises(vcc.InputError, match=r"takes 0 MB of memory.*save_store\("):
        CAMERAS["fine mask"][0].capture(light_field(), executor=executor)


def test_arrays_of_other_libraries_are_not_sent():
    given = light_field().replaced(array_api_strict.ones(SHAPE))
    with Hostile(6) as executor, pytest.raises(vcc.InputError, match="stores, not in arrays of array_api_strict"):
        CAMERAS["fine mask"][0].capture(given, executor=executor)


def test_another_version_is_told():
    parcel = replace(Parcel.of("anything"), version="0.0.1", packed=b"what this version cannot read")
    with pytest.raises(vcc.InputError, match=r"and the sender runs 0\.0\.1: install the same version on both"):
        parcel.opened()


def test_what_cannot_be_packed_is_told():
    with pytest.raises(vcc.InputError, match="this cannot be sent to other processes"):
        list(Pool(ThreadPoolExecutor(1)).each(Work(inverse, lambda: None), [1]))


def test_a_view_that_is_missing_or_damaged_is_named(tmp_path, monkeypatch):
    given = save_store(light_field(), tmp_path / "a.zarr")
    camera = CAMERAS["fine mask"][0]
    file = given.view_file(2, 3)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    with Hostile(8) as executor, pytest.raises(vcc.InputError, match=r"view \(2, 3\) .* is damaged or cut off"):
        camera.capture(given, executor=executor)
    file.unlink()
    with Hostile(8) as executor:
        with pytest.raises(vcc.InputError, match=r"is not complete: 1 of its 30 views are missing"):
            camera.capture(given, executor=executor)
        assert not executor.done
        monkeypatch.setattr(type(given), "check_complete", lambda _: None)  # gone while others work
        with pytest.raises(vcc.InputError, match=r"view \(2, 3\) is missing"):
            camera.capture(given, executor=executor)


# --- stores elsewhere ---


def test_a_store_is_sent_as_its_address(stored, tmp_path, monkeypatch):
    packed = pickle.dumps(stored.scaled(2.0))
    assert len(packed) < 4000
    monkeypatch.chdir(tmp_path)
    again = pickle.loads(packed)
    assert again.frame.isclose(stored.scaled(2.0).frame)
    np.testing.assert_array_equal(again.read().values, stored.read().values)


def test_a_store_that_is_not_there_or_another_is_told(tmp_path):
    given = save_store(light_field(), tmp_path / "a.zarr")
    packed = pickle.dumps(given)
    save_store(light_field((2, 2, 4, 4)), tmp_path / "a.zarr", overwrite=True)
    with pytest.raises(vcc.InputError, match=r"holds another light field than the one that was opened"):
        pickle.loads(packed)
    (tmp_path / "a.zarr").rename(tmp_path / "b.zarr")
    with pytest.raises(vcc.InputError, match=r"the store is not found on .* All processes must use the same path"):
        pickle.loads(packed)
