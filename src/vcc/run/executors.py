"""Run tasks on an executor: threads, processes, clusters.

A task is a function of this package, the data that all tasks share (packed once) and one item. `worker_pool`
accepts any `concurrent.futures.Executor` or a Dask client and returns a pool with two methods: `WorkerPool.each`
yields results as they arrive, `WorkerPool.summed` returns their sum. The order of additions is one fixed tree
(`Tree`), whichever task finishes first: sums have the same bytes in each run, on one machine or many.
"""

from __future__ import annotations

import pickle
import platform
import pydoc
import warnings
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor
from contextlib import closing
from dataclasses import dataclass
from functools import partial, reduce
from queue import Empty, SimpleQueue
from typing import Any

from vcc.base.errors import InputError, warn_of_result
from vcc.base.memory import MEMORY_LIMIT
from vcc.base.version import VERSION

Function = Callable[[Any, Any], Any]
"""A module-level function of the shared data and an item; other processes find it by name."""
Add = Callable[[Any, Any], Any]
"""A module-level function that adds two results."""

TOGETHER = 8
"""How many parts each sum of a `Tree` adds."""
RETRIES = 3
"""How often a cluster repeats a task that failed."""
LOOK = 1.0
"""Seconds without results after which a pool is checked."""
LEAST_ROOM = 2**26
"""The smallest memory in bytes with which a task can run."""
SILENT = 60.0
"""Seconds within which a scheduler must answer; a frozen one never does."""
TAKEN, LIBRARIES = 0.7, 4e8
"""The share of a Dask worker's memory that can be used before the worker spills to disk; and the bytes of it that
Python, its libraries and compiled code use."""


@dataclass(frozen=True, eq=False, repr=False)
class Work:
    """The work that is done for each item.

    Args:
        function: module-level; called with ``shared`` and an item.
        shared: picklable; sent once to each process of a cluster, or with each task to a pool.
        first: module-level; called with ``shared`` and None before all else, once on each machine of a cluster,
            or in this process for a pool, so that code is compiled only once. None for nothing.
    """

    function: Function
    shared: Any
    first: Function | None = None


def worker_pool(executor: Any) -> WorkerPool:
    """The worker pool of a user's executor.

    Args:
        executor: a `concurrent.futures.Executor`, or a ``dask.distributed.Client``.

    Raises:
        InputError: another type, or a client that is closed or asynchronous.
    """
    if isinstance(executor, Executor):
        return Pool(executor)
    if all(hasattr(executor, name) for name in ("submit", "map", "scheduler_info", "nthreads")):
        return Cluster(executor)
    raise InputError(
        f"executor must be a concurrent.futures.Executor or a dask.distributed.Client, not {executor!r}: on one "
        "machine concurrent.futures.ProcessPoolExecutor(), for a cluster distributed.Client('tcp://host:8786')"
    )


def memory_of_task(asked: int | None, workers: WorkerPool | None) -> float:
    """Memory in bytes for one task, or for work in this process.

    Args:
        asked: by the user; None is a quarter of `vcc.base.memory.MEMORY_LIMIT`, or what the workers have.
        workers: the pool; None for this process.

    Raises:
        InputError: more than the workers have, or workers with too little memory.
    """
    memory = None if workers is None else workers.memory
    if memory is None:
        return MEMORY_LIMIT // 4 if asked is None else asked
    if memory < LEAST_ROOM or (asked is not None and asked > memory):
        needed = LEAST_ROOM if asked is None else asked
        raise InputError(
            f"the least of the executor's workers has {max(memory, 0) / 1e6:.0f} MB for each task, without "
            f"Python and its libraries, and {needed / 1e6:.0f} MB are required: give workers more memory, or "
            "fewer threads each" + ("" if asked is None else ", or pass a smaller limit")
        )
    return min(MEMORY_LIMIT // 4, memory) if asked is None else asked


# --- tasks ---


@dataclass(frozen=True, repr=False)
class Parcel:
    """The data that all tasks share, packed once.

    Args:
        version: of the package that packed it.
        packed: by `pickle`.
    """

    version: str
    packed: bytes

    @classmethod
    def of(cls, shared: Any) -> Parcel:
        """Pack an object.

        Raises:
            InputError: it cannot be pickled.
        """
        try:
            return cls(VERSION, pickle.dumps(shared, protocol=5))
        except (pickle.PicklingError, TypeError, AttributeError) as error:
            raise InputError(f"this cannot be sent to other processes: {error}") from error

    def opened(self) -> Any:
        """The unpacked object, a new one each time: threads never share it.

        Raises:
            InputError: it was packed by another version of the package.
        """
        if self.version != VERSION:
            raise InputError(
                f"{platform.node()} runs version {VERSION} of the package, and the sender runs "
                f"{self.version}: install the same version on both"
            )
        return pickle.loads(self.packed)


def perform(item: Any, parcel: Parcel) -> Any:
    """Run one task; the parcel contains the function and the shared data."""
    function, shared = parcel.opened()
    return function(shared, item)


def _kept(parcel: Parcel) -> Parcel:
    """Return a parcel as a task's result, so that a cluster recomputes it if a worker is lost."""
    return parcel


def _added(parcel: Parcel, parts: Sequence[Any]) -> Any:
    """A sum of a `Tree`; the parcel contains the function that adds two."""
    return reduce(parcel.opened(), parts)


class Tree:
    """A sum of parts that arrive in any order, with a fixed order of additions: eight neighbours, eight such
    sums, …

    Each sum adds from the left as far as its parts have arrived. If parts arrive in order, one partial sum is kept
    per level, ⌈log₈ n⌉ in all.

    Args:
        leaves: the number of parts.
        add: adds two parts.
    """

    def __init__(self, leaves: int, add: Add) -> None:
        self._add, self._counts = add, [leaves]
        while self._counts[-1] > 1:
            self._counts.append(-(-self._counts[-1] // TOGETHER))
        self._open: dict[tuple[int, int], _Sum] = {}
        self.total: Any = None
        """The sum, once all parts have arrived."""

    def put(self, number: int, thing: Any, level: int = 0) -> None:
        """Add one part.

        Args:
            number: its index, from 0.
            thing: the part, as `add` accepts it.
            level: 0 for parts; n for sums at level n of the tree.
        """
        if self._counts[level] == 1:
            self.total = thing
            return
        group, place = divmod(number, TOGETHER)
        count = min(TOGETHER, self._counts[level] - group * TOGETHER)
        made = self._open.setdefault((level, group), _Sum({}))
        made.there[place] = thing
        while made.next in made.there:
            following = made.there.pop(made.next)
            made.value = following if made.next == 0 else self._add(made.value, following)
            made.next += 1
        if made.next == count:
            del self._open[level, group]
            self.put(group, made.value, level + 1)


@dataclass
class _Sum:
    """A partial sum of the parts before ``next``; later parts wait in ``there``."""

    there: dict[int, Any]
    next: int = 0
    value: Any = None


def _finished(futures: Sequence[Any], alive: Callable[[], None]) -> Generator[int, None, None]:
    """Yield the indices of futures as they finish; call ``alive`` every `LOOK` seconds without a result."""
    done: SimpleQueue[int] = SimpleQueue()
    for number, future in enumerate(futures):
        future.add_done_callback(partial(_noted, done, number))
    for _ in range(len(futures)):
        while True:
            try:
                yield done.get(timeout=LOOK)
                break
            except Empty:
                alive()


def _noted(done: SimpleQueue[int], number: int, _: Any) -> None:
    done.put(number)


# --- an executor of Python ---


class Pool:
    """Any `concurrent.futures.Executor`: threads, processes, and compatible classes.

    Args:
        executor: its ``submit`` is called.
    """

    memory = None

    def __init__(self, executor: Executor) -> None:
        self._executor = executor

    @property
    def places(self) -> int:
        """The number of workers of Python's own pools; 1 for other executors."""
        return int(getattr(self._executor, "_max_workers", 1))

    def each(self, work: Work, items: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        """The function's result for each item.

        Args:
            work: the work.
            items: picklable.

        Yields:
            (index of the item, result), as they arrive. Closing the generator early, by an error or Ctrl-C,
            cancels the tasks that have not started.

        Raises:
            InputError: the executor is shut down, or fails before the work is done. Errors of tasks are
                raised again.
        """
        parcel, futures = Parcel.of((work.function, work.shared)), []
        if work.first is not None:
            perform(None, Parcel.of((work.first, work.shared)))
        try:
            futures += [self._submit(parcel, item) for item in items]
            for number in _finished(futures, lambda: None):
                result = self._result(futures[number])
                futures[number] = None  # frees the result
                yield number, result
        finally:
            for future in futures:
                if future is not None:
                    future.cancel()

    def summed(self, work: Work, items: Sequence[Any], add: Add, told: Callable[[int], None]) -> Any:
        """The sum of the function's results for all items, in the order of `Tree`.

        Args:
            work: the work.
            items: picklable; at least one.
            add: module-level; adds two results.
            told: called with the index of each item that is done.

        Raises:
            InputError: as in `each`.
        """
        tree = Tree(len(items), add)
        with closing(self.each(work, items)) as results:
            for number, result in results:
                tree.put(number, result)
                told(number)
        return tree.total

    def _submit(self, parcel: Parcel, item: Any) -> Any:
        try:
            return self._executor.submit(perform, item, parcel)
        except BrokenExecutor as error:
            raise self._broken() from error
        except RuntimeError as error:
            raise InputError(f"executor accepts no tasks ({error}): pass one that is not shut down") from error

    def _result(self, future: Any) -> Any:
        try:
            return future.result()
        except BrokenExecutor as error:
            raise self._broken() from error
        except CancelledError as error:
            raise InputError("executor cancelled unfinished tasks: was it shut down?") from error

    def _broken(self) -> InputError:
        return InputError(
            f"a process of the executor, {type(self._executor).__name__}, ended before its work was done: killed, "
            "or out of memory (memory_limit= is the limit per task). Python's pools do not recover: pass a "
            "new one, or a Dask client, which repeats lost tasks"
        )


# --- Dask ---


class Cluster:
    """A Dask client.

    The shared data is the result of a task, so that each worker fetches it once and no task depends on the worker
    that had it first. Sums are tasks with priority over new items. Dask repeats the tasks of a lost worker on
    another one.

    Args:
        client: a ``dask.distributed.Client``.

    Raises:
        InputError: a client that is closed or asynchronous.
    """

    def __init__(self, client: Any) -> None:
        self._client, self._silent = client, False
        if client.asynchronous:
            raise InputError(
                "executor is a Dask client made with asynchronous=True: pass distributed.Client(address)"
            )
        self._look()

    @property
    def places(self) -> int:
        """The threads of all current workers."""
        return sum(self._client.nthreads().values())

    @property
    def memory(self) -> float | None:
        """The smallest memory per thread among the workers, without spilling to disk; None if unlimited."""
        workers = self._client.scheduler_info()["workers"].values()
        rooms = [
            (TAKEN * worker["memory_limit"] - LIBRARIES) / worker["nthreads"]
            for worker in workers
            if worker["memory_limit"]
        ]
        return min(rooms, default=None)

    def each(self, work: Work, items: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        """See `Pool.each`."""
        futures = self._mapped(work, items)
        try:
            for number in _finished(futures, self._look):
                result = self._result(futures[number])
                futures[number] = None  # lets the cluster free the result
                yield number, result
        finally:
            self._cancel(futures)

    def summed(self, work: Work, items: Sequence[Any], add: Add, told: Callable[[int], None]) -> Any:
        """See `Pool.summed`; the workers add the results, and only the sum is transferred."""
        futures = self._mapped(work, items)
        total = self._tree(futures, add)
        try:
            for number in _finished(futures, self._look):
                self._check(futures[number])
                futures[number] = None
                told(number)
            for _ in _finished([total], self._look):
                pass
            return self._result(total)
        finally:
            self._cancel([*futures, total])

    def _mapped(self, work: Work, items: Sequence[Any]) -> list[Any]:
        self._check_versions()
        if work.first is not None:
            self._begin(self._to_workers(work.first, work.shared))
        parcel = self._to_workers(work.function, work.shared)
        return list(self._client.map(perform, items, parcel=parcel, pure=False, retries=RETRIES))

    def _to_workers(self, function: Function, shared: Any) -> Any:
        """The function and the shared data of tasks, as the result of a task."""
        with warnings.catch_warnings():  # about large parcels, sent only once
            warnings.filterwarnings("ignore", "Sending large graph")
            return self._client.submit(_kept, Parcel.of((function, shared)), pure=False)

    def _check_versions(self) -> None:
        """Check the package version of all workers: a worker without a function would fail for good.

        Raises:
            InputError: a worker has another version of the package, or none.
        """
        # Calls a function of the standard library, which all workers have.
        found = self._client.run(pydoc.locate, "vcc.base.version.VERSION", on_error="return")
        for address, version in found.items():
            if version is None or (isinstance(version, str) and version != VERSION):
                has = f"version {version} of the package" if version else "no version of the package"
                raise InputError(
                    f"the worker {address} has {has}, and the sender has "
                    f"{VERSION}: install the same version on all"
                )

    def _begin(self, parcel: Any) -> None:
        """Run the first task once on each machine, or when the first worker arrives."""
        if not self.places:
            warn_of_result(f"the Dask scheduler {self._address} has no workers yet: work begins when one comes")
        workers = self._client.scheduler_info()["workers"]
        machines = {worker["host"]: address for address, worker in workers.items()}
        places = [{"workers": address, "allow_other_workers": True} for address in machines.values()]
        futures = [
            self._client.submit(perform, None, parcel=parcel, pure=False, retries=RETRIES, **place)
            for place in places or [{}]
        ]
        try:
            for number in _finished(futures, self._look):
                self._result(futures[number])
        finally:
            self._cancel(futures)

    def _tree(self, futures: Sequence[Any], add: Add) -> Any:
        level, parcel = 0, Parcel.of(add)
        while len(futures) > 1:
            level += 1
            futures = [
                self._client.submit(
                    _added, parcel, list(futures[n : n + TOGETHER]), pure=False, retries=RETRIES, priority=level
                )
                for n in range(0, len(futures), TOGETHER)
            ]
        return futures[0]

    def _check(self, future: Any) -> None:
        """Raise the error of a task that failed or was cancelled."""
        if future.status == "error":
            self._result(future)
        if future.status == "cancelled":
            raise self._lost()

    def _result(self, future: Any) -> Any:
        try:
            return future.result()
        except InputError:
            raise
        except CancelledError as error:
            raise self._lost() from error
        except Exception as error:
            if type(error).__name__ == "KilledWorker":
                raise InputError(
                    "a task killed each worker that ran it: most likely it needs "
                    "more memory than they have. Pass memory_limit=, the bytes per task"
                ) from error
            raise

    def _look(self) -> None:
        """Check that the scheduler still answers.

        Raises:
            InputError: the connection is lost, or the scheduler does not answer.
        """
        if self._client.status != "running":
            raise self._lost()
        try:
            self._client.sync(self._client.scheduler.echo, data=None, callback_timeout=SILENT)
        except TimeoutError as error:
            self._silent = True
            raise InputError(
                f"the Dask scheduler {self._address} has not answered for {SILENT:g} s: it is stopped or "
                "overloaded. Check it, or start another; then run again"
            ) from error
        except OSError as error:
            raise self._lost() from error

    def _lost(self) -> InputError:
        return InputError(
            f"the connection to the Dask scheduler {self._address} was lost, or the tasks were cancelled, before "
            "they finished: reconnect with distributed.Client(address), and run again"
        )

    @property
    def _address(self) -> str:
        scheduler = getattr(self._client, "scheduler", None)
        return str(getattr(scheduler, "address", "")) or "that was given"

    def _cancel(self, futures: Sequence[Any]) -> None:
        """Cancel unfinished futures if the scheduler still answers."""
        waiting = [future for future in futures if future is not None and not future.done()]
        if waiting and self._client.status == "running" and not self._silent:
            self._client.cancel(waiting)


WorkerPool = Pool | Cluster
"""What runs the work. The caller keeps its executor: it is never shut down here."""
