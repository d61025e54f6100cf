"""What tasks of others may take and are sent: memory, samples, and what is done first and what is no longer done.

Oracles: bytes counted by hand; a pool of one thread that writes down what it is asked.
"""

from __future__ import annotations

import pickle
from concurrent.futures import CancelledError, Executor, Future
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.base.version import VERSION
from vcc.fields.grid import Block
from vcc.plan.how import How
from vcc.run import executors, serialization
from vcc.run.drive import Drive
from vcc.run.executors import Cluster, Pool, Tree, Work, memory_of_task, worker_pool
from vcc.run.serialization import PortableRun, PortableSamples, check_portable
from vcc.store import save_store

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (3, 4, 10, 12)
FOCUS = 1 / (1 / 50e-3 - 1)
CAMERA = vcc.Camera([vcc.Lens(50 * mm, 7 * mm)], vcc.Sensor(FOCUS, (8, 9), FOCUS * 3e-3))
QUARTER = vcc.base.memory.MEMORY_LIMIT // 4


def light_field(kind: str = "float32") -> vcc.LightField:
    values = np.random.default_rng(0).random(SHAPE) * (255 if kind == "uint8" else 1)
    return vcc.LightField.from_views(values.astype(kind), 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))


class AtOnce(Executor):
    """Does each task when it is asked to, and writes down what it does."""

    def __init__(self) -> None:
        self.done: list[object] = []

    def submit(self, function, /, *given, **named):
        future = Future()
        self.done.append(given[0])
        function, given, named = pickle.loads(pickle.dumps((function, given, named)))
        future.set_result(function(*given, **named))
        return future


# --- memory ---


@pytest.mark.parametrize(
    ("asked", "memory", "found"),
    [
        (None, None, QUARTER),
        (10**8, None, 10**8),
        (10**12, None, 10**12),
        (None, 10**9, min(10**9, QUARTER)),
        (None, 10**12, QUARTER),
        (None, 2**26, 2**26),  # the least that is worth beginning
        (10**8, 10**9, 10**8),
        (10**9, 10**9, 10**9),
        (1000, 2**26, 1000),
        (None, 2**26 - 1, "67 MB for each task, .* and 67 MB are required: give workers more memory, or fewer"),
        (1000, 2**26 - 1, "67 MB for each task"),
        (10**9 + 1, 10**9, "1000 MB for each task, .* and 1000 MB are required.*, or pass a smaller limit"),
        (None, -3e8, "has 0 MB for each task"),
    ],
)
def test_memory_of_a_task(asked, memory, found):
    """What is asked for, a quarter of all, or what the least of the workers has."""
    workers = None if asked is not None and memory is None and asked > 10**9 else SimpleNamespace(memory=memory)
    if isinstance(found, str):
        with pytest.raises(vcc.InputError, match=found):
            memory_of_task(asked, workers)
    else:
        assert memory_of_task(asked, workers) == found


def test_the_room_of_a_cluster_is_that_of_its_least_worker():
    """0.7 of its memory may be taken, of which 400 MB are Python's and libraries'; its threads share the rest."""

    def client(**workers):
        return SimpleNamespace(
            asynchronous=False, status="running", sync=lambda *_, **__: None, scheduler=SimpleNamespace(echo=None),
            scheduler_info=lambda: {"workers": workers}, submit=None, map=None,
            nthreads=lambda: {name: one["nthreads"] for name, one in workers.items()},
        )  # fmt: skip

    one, other = {"memory_limit": 2e9, "nthreads": 2}, {"memory_limit": 8e9, "nthreads": 4}
    workers = worker_pool(client(one=one, other=other))
    assert isinstance(workers, Cluster)
    assert workers.memory == pytest.approx(5e8)
    assert workers.places == 6
    assert worker_pool(client(other=other, unlimited={"memory_limit": 0, "nthreads": 1})).memory == pytest.approx(
        1.3e9
    )
    assert worker_pool(client()).memory is None
    made = client()
    made.asynchronous = True
    with pytest.raises(vcc.InputError, match="asynchronous=True"):
        worker_pool(made)
    del made.nthreads
    with pytest.raises(vcc.InputError, match=r"executor must be a concurrent\.futures\.Executor"):
        worker_pool(made)


def test_each_task_has_one_thread_and_keeps_the_sums_of_others(tmp_path):
    stored = save_store(light_field(), tmp_path / "a.zarr")
    plan = CAMERA.compile(stored)
    here = Drive(plan, stored, How(threads=1))
    elsewhere = Drive(plan, stored, How(memory_limit=10**9), AtOnce())
    assert elsewhere.portable.how.threads == 1
    assert elsewhere.portable.how.memory_limit == 10**9
    assert elsewhere.need.fixed == here.need.fixed + 8 * here.need.raster
    assert Drive(plan, stored, How(threads=3), AtOnce()).portable.how.threads == 3
    assert elsewhere.portable.plan == replace(plan, made_for=None, notes=(), cautions=())
    assert elsewhere.portable.plan.made_for is None
    assert elsewhere.portable.plan.notes == elsewhere.portable.plan.cautions == ()


# --- samples ---


def test_as_many_samples_are_sent_as_may_be(monkeypatch, tmp_path):
    given = light_field("uint8")
    size = 3 * 4 * 10 * 12
    for limit, refused in ((size, False), (size - 1, True)):
        monkeypatch.setattr(serialization, "SENT", limit)
        if refused:
            with pytest.raises(vcc.InputError, match="this light field takes 0 MB of memory"):
                check_portable(given)
        else:
            check_portable(given)
            with pytest.raises(vcc.InputError, match="at most 0 MB"):
                check_portable(light_field())  # four times as large
    check_portable(save_store(light_field(), tmp_path / "a.zarr"))
    monkeypatch.undo()
    assert serialization.SENT == 64 * 1024**2


def test_samples_that_are_sent_are_those_that_were_given(tmp_path):
    given = light_field()
    stored = save_store(given, tmp_path / "a.zarr")
    block = Block((1, 3), (0, 2), (4, 9), (3, 12))
    for samples, kept in ((given, 0), (stored, stored.stored_bytes)):
        there = pickle.loads(pickle.dumps(PortableSamples.of(samples)))
        assert (there.stored_bytes, there.whole(), there.check_complete()) == (kept, None, None)
        np.testing.assert_array_equal(there.read(block), given.values[1:3, 0:2, 4:9, 3:12])
        assert there.grid.frame == given.frame
        assert there.grid.shape == SHAPE
    made = PortableRun.of(CAMERA.compile(given), PortableSamples.of(given), How())
    assert made.samples.source is given.values


# --- work ---


def test_work_begins_here_and_is_asked_for_once_each():
    pool = AtOnce()
    STARTED.clear()
    found = list(Pool(pool).each(Work(times, 3.0, first=begin), [5, 4, 9]))
    assert found == [(0, 15.0), (1, 12.0), (2, 27.0)]
    assert pool.done == [5, 4, 9]
    assert STARTED == [(3.0, None)]
    told: list[int] = []
    assert Pool(pool).summed(Work(times, 2.0), range(20), added, told.append) == 2 * 190
    assert told == list(range(20))
    assert STARTED == [(3.0, None)]  # nothing is done first where nothing is asked
    assert Pool(pool).places == 1


STARTED: list[tuple[float, object]] = []


def begin(shared, item):
    STARTED.append((shared, item))


def times(shared, item):
    return shared * item


def added(one, other):
    return one + other


class Cancelling(AtOnce):
    """Cancels what it is given; its futures are never done otherwise."""

    def submit(self, function, /, *given, **named):
        future = Future()
        future.cancel()
        future.set_running_or_notify_cancel()
        return future


def test_work_that_is_cancelled_is_told():
    with pytest.raises(vcc.InputError, match="executor cancelled unfinished tasks") as error:
        list(Pool(Cancelling()).each(Work(times, 1.0), [1, 2]))
    assert isinstance(error.value.__cause__, CancelledError)


# --- the picture ---


@pytest.mark.parametrize("kind", ["float32", "uint8"])
def test_blocks_in_memory_and_in_stores_make_the_picture_elsewhere(tmp_path, kind):
    """Of views that are sent, and of views that are read: the same bytes; progress counts to the last view."""
    given, calls = light_field(kind), []
    whole = CAMERA.capture(given).values
    stored = save_store(given, tmp_path / "a.zarr")
    for samples in (given, stored):
        found = CAMERA.capture(samples, executor=AtOnce(), progress=lambda *call: calls.append(call)).values
        np.testing.assert_allclose(found, whole, rtol=0, atol=1e-6 * whole.max())
    views = int(CAMERA.compile(given).used_views(SHAPE).sum())
    assert calls == [(views, views)] * 2


# --- a cluster, whose client is made up: what it is asked ---


class Done:
    """A task's result, there at once; of a cancelled one there is none, of one that failed what it raised."""

    def __init__(self, make, status: str = "finished") -> None:
        self.status, self._made = status, None
        if status == "finished":
            try:
                self._made = make()
            except Exception as error:
                self.status, self._made = "error", error
        self.waiting = False

    def result(self):
        if self.status == "cancelled":
            raise CancelledError
        if self.status == "error":
            raise self._made
        return self._made

    def done(self) -> bool:
        return not self.waiting

    def add_done_callback(self, told) -> None:
        if not self.waiting:
            told(self)


class Client:
    """Speaks like a client of Dask; does each task at once, and writes down what it is asked."""

    asynchronous, status = False, "running"

    def __init__(self, hosts=("one", "one", "other"), version=VERSION) -> None:
        self.scheduler = SimpleNamespace(echo=None, address="tcp://made.up:1")
        self.workers = {
            f"tcp://{n}": {"host": host, "nthreads": 2, "memory_limit": 0} for n, host in enumerate(hosts)
        }
        self.asked: list[tuple[str, object, dict]] = []
        self.version, self.cancelled, self.states, self.looks = version, [], {}, 0

    def nthreads(self):
        return {address: worker["nthreads"] for address, worker in self.workers.items()}

    def scheduler_info(self):
        return {"workers": self.workers}

    def run(self, function, *given, on_error):
        return dict.fromkeys(self.workers, self.version)

    def sync(self, function, **named):
        self.looks += 1

    def submit(self, function, *given, pure, parcel=None, **named):
        assert not pure
        self.asked.append((function.__name__, given, named))

        def there(thing):
            if isinstance(thing, list):
                return [there(each) for each in thing]
            return thing.result() if isinstance(thing, Done) else thing

        named = {} if parcel is None else {"parcel": there(parcel)}
        return Done(lambda: function(*map(there, given), **named))

    def map(self, function, items, *, parcel, pure, **named):
        assert not pure
        self.asked.append(("map", list(items), named))
        made = [
            Done(partial(function, item, parcel.result()), self.states.get(item, "finished")) for item in items
        ]
        for one in made:
            one.waiting = one.status == "pending"
        return made

    def cancel(self, futures):
        self.cancelled += futures


def brackets(one, other):
    return f"({one}+{other})"


def marked(mark, item):
    return f"{item}{mark}"


def test_a_cluster_is_asked_for_each_item_once_and_for_sums_before_others():
    """Something is begun once on each machine; of 70 items 9 + 2 + 1 sums are asked, the later the more urgent."""
    client = Client()
    told: list[int] = []
    STARTED.clear()
    found = worker_pool(client).summed(Work(marked, "!", first=begin), range(70), brackets, told.append)
    tree = Tree(70, brackets)
    for number in range(70):
        tree.put(number, f"{number}!")
    assert found == tree.total
    assert sorted(told) == list(range(70))
    assert STARTED == [("!", None)] * 2
    began = [named for name, _, named in client.asked if name == "perform"]
    assert [(each["workers"], each["allow_other_workers"]) for each in began] == [
        ("tcp://1", True),
        ("tcp://2", True),
    ]
    assert all(each["retries"] == 3 for each in began)
    assert [(items, named) for name, items, named in client.asked if name == "map"] == [
        (list(range(70)), {"retries": 3})
    ]
    sums = [(len(given[1]), named) for name, given, named in client.asked if name == "_added"]
    assert [number for number, _ in sums] == [8] * 8 + [6] + [8, 1] + [2]
    assert [named["priority"] for _, named in sums] == [1] * 9 + [2] * 2 + [3]
    assert all(named["retries"] == 3 for _, named in sums)
    assert not client.cancelled
    client.asked.clear()
    assert worker_pool(client).summed(Work(marked, "?"), ["a"], brackets, told.append) == "a?"
    assert [name for name, _, _ in client.asked] == ["_kept", "map"]


def test_a_cluster_without_workers_is_waited_for_and_it_is_said():
    client = Client(hosts=())
    with pytest.warns(vcc.ResultWarning, match="tcp://made.up:1 has no workers yet"):
        found = dict(worker_pool(client).each(Work(marked, "!", first=begin), "ab"))
    assert found == {0: "a!", 1: "b!"}
    assert [named for name, _, named in client.asked if name == "perform"] == [{"retries": 3}]


def test_what_workers_have_is_asked_before_work():
    for version, words in (("0.1", "version 0.1 of the package"), (None, "no version of the package")):
        with pytest.raises(vcc.InputError, match=f"worker tcp://0 has {words}"):
            list(worker_pool(Client(version=version)).each(Work(marked, "!"), "ab"))
    # What a worker raises when it is asked is no version: it may be busy.
    assert dict(worker_pool(Client(version=OSError())).each(Work(marked, "!"), "a")) == {0: "a!"}


@pytest.mark.parametrize("verb", ["each", "summed"])
def test_what_is_not_done_is_cancelled_when_work_ends(verb):
    """Where a task was cancelled, failed or waits; not where the connection is gone and nobody hears it."""

    def ended(states, error, status="running"):
        client = Client()
        workers = worker_pool(client)
        client.states = states
        made = client.map

        def mapped(*given, **named):
            found = made(*given, **named)
            client.status = status
            return found

        client.map = mapped
        given = Work(divided, 1), [1, 0, 5, 7]
        with pytest.raises(error) as raised:
            _ = list(workers.each(*given)) if verb == "each" else workers.summed(*given, brackets, lambda _: None)
        return client, raised.value

    client, _ = ended({5: "pending", 7: "pending"}, ZeroDivisionError)
    assert [future.status for future in client.cancelled] == ["pending"] * 2
    client, error = ended({0: "cancelled", 5: "pending"}, vcc.InputError)
    assert "or the tasks were cancelled, before they finished" in str(error)
    assert [future.status for future in client.cancelled] == ["pending"]
    client, _ = ended({5: "pending", 7: "pending"}, ZeroDivisionError, "closed")
    assert client.cancelled == []


def divided(shared, item):
    return shared / item


@pytest.mark.parametrize(
    ("failure", "words"),
    [
        (OSError("gone"), "connection to the Dask scheduler tcp://made.up:1 was lost"),
        (TimeoutError(), "has not answered"),
    ],
)
def test_a_scheduler_that_does_not_answer_is_told_and_nobody_is_cancelled_there(monkeypatch, failure, words):
    monkeypatch.setattr(executors, "LOOK", 0.01)
    client = Client()
    workers = worker_pool(client)
    assert client.looks == 1  # it is asked when it is taken
    client.states = {"b": "pending"}

    def sync(*_, **named):
        assert named["callback_timeout"] == 60
        raise failure

    client.sync = sync
    with pytest.raises(vcc.InputError, match=words):
        list(workers.each(Work(marked, "!"), "ab"))
    assert len(client.cancelled) == (0 if isinstance(failure, TimeoutError) else 1)
    client.scheduler = None
    client.status = "closed"
    with pytest.raises(vcc.InputError, match="scheduler that was given was lost"):
        worker_pool(client)
