"""Blocks run by a cluster: two processes against one, workers that are killed, 100 GB of which little is needed.

    python benchmarks/cluster.py [--only PART] [--folder /somewhere/with/room] [--gigabytes 20] [--keep]

The parts, one after the other unless one is named:

lens, mask: a store of noise that hardly packs, made view by view, is captured through a lens, and with a mask in
mid-path, by Dask clusters on this machine of one worker and of two. Before each run the system is asked to forget
what it has read of the store. Said are times, each worker's largest resident size against its limit, and whether
all pictures are the same bytes; and, beside them, one process without Dask, by one thread and by all.
killed: the lens by two workers of which 10 % of the blocks kill the one that first takes them, and by none killed.

These three need the extra ``cluster``, and as many bytes free as the store has; of fewer they make a smaller one,
and say so. The store is deleted at the end, after an error and Ctrl-C, too; with --keep it stays, and a part that
is run on its own uses what an earlier one left: run the last one without --keep. ``make`` only makes it.

sparse: a store of 100 GB, whose view files are all the same one (hard links): the time to open it, and how much of
it cameras read whose stop lets 5 % of it through, or whose sensor sees 5 % of each view, by several chunks.

scheduler: how many tasks Dask's scheduler, here, hands out and sums in a second.

simulated: a petabyte on 1000 workers, event by event, with the delays and bandwidths of `Machines`;
docs/cluster.md has the arithmetic. What a thread runs and how many tasks the scheduler hands out are measured
first, and printed; --running and --tasks put in what an earlier run printed.
"""

from __future__ import annotations

import argparse
import heapq
import os
import random
import shutil
import signal
import tempfile
import time
import warnings
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import vcc
from vcc.patterns import CosineSum
from vcc.run.executors import TOGETHER, Work, worker_pool
from vcc.store import Lossless, create_store, open_store
from vcc.units import mm

PIXELS = (1000, 1000)
WORKER_MEMORY = 2e9
"""Bytes that a worker may have; Dask ends one that takes more."""
KILLED = 0.1
FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=9 * mm)
CAMERAS = {
    "lens": vcc.Camera([LENS], vcc.Sensor(FOCUS, PIXELS, FOCUS * 1e-3)),
    "mask in mid-path": vcc.Camera(
        [LENS, vcc.Mask(pattern=CosineSum((3 * mm, 3 * mm), 1, 0.3), z=FOCUS / 2)],
        vcc.Sensor(FOCUS, PIXELS, FOCUS * 1e-3),
    ),
}


def views_of(side: int, diameter: float = 10 * mm) -> Any:
    """Cameras whose views fill an aperture."""
    from vcc.sources import CameraArray

    return CameraArray(
        views=(side, side), pixels=PIXELS, spacing=diameter / side, slope_per_pixel=1e-3, focus_distance=1.0
    )


# --- two processes against one ---


def make(path: Path, gigabytes: float) -> vcc.store.StoredLightField:
    """Views of noise, 12 MB each: nothing of it packs."""
    side = max(int(np.ceil((gigabytes * 1e9 / (PIXELS[0] * PIXELS[1] * 3 * 4)) ** 0.5)), 2)
    noise = np.random.default_rng(0).random((PIXELS[0] + side, PIXELS[1] + side, 3)).astype(np.float32)
    start = time.perf_counter()
    with create_store(
        path, views_of(side), (side, side, *PIXELS, 3), "float32", provenance={"made_by": "benchmarks/cluster.py"},
        description={"scene": "noise"}, disparity_range=(-1.0, -1.0), compression=Lossless("lz4", 1),
    ) as writer:  # fmt: skip
        for row, column in writer.missing():
            writer.write_view(row, column, noise[row : row + PIXELS[0], column : column + PIXELS[1]])
        stored = writer.finish()
    print(
        f"store: {side}×{side} views of {PIXELS[0]}×{PIXELS[1]}×3 float32, {stored.stored_bytes / 1e9:.1f} GB on "
        f"disk, in {time.perf_counter() - start:.0f} s",
        flush=True,
    )
    return stored


@contextmanager
def made(folder: Path, gigabytes: float, keep: bool) -> Any:
    """A store, made or there, and its path; deleted afterwards unless it is to be kept."""
    path = folder / "vcc-cluster.zarr"
    folder.mkdir(parents=True, exist_ok=True)
    free = shutil.disk_usage(folder).free / 1e9 - 2
    if not path.exists() and free < gigabytes * 1.02:
        print(f"{free:.0f} GB are free beside 2 to spare: the store is made as large as that, not {gigabytes:g}")
        gigabytes = free / 1.02
    try:
        yield make(path, gigabytes), path
    finally:
        if not keep:
            shutil.rmtree(path, ignore_errors=True)


def forget(path: Path) -> None:
    """Ask the system to forget what it has read of a store."""
    os.sync()
    for file in path.rglob("*"):
        if file.is_file():
            stream = os.open(file, os.O_RDONLY)
            os.posix_fadvise(stream, 0, 0, os.POSIX_FADV_DONTNEED)
            os.close(stream)


@dataclass(frozen=True)
class Deadly:
    """A stored light field whose reader is killed, once for each of some views.

    Args:
        stored: that is read else.
        views: (row, column) of those.
        folder: of marks: who was killed before is spared.
    """

    stored: Any
    views: frozenset[tuple[int, int]]
    folder: Path

    grid = property(lambda self: self.stored.grid)
    stored_bytes = property(lambda self: self.stored.stored_bytes)

    def whole(self) -> None:
        """It is on disk."""

    def check_complete(self) -> None:
        """It is."""

    def read(self, block: Any) -> Any:
        """The samples of a block, or death."""
        at = block.rows[0], block.columns[0]
        mark = self.folder / f"{at[0]}-{at[1]}"
        if at in self.views and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return self.stored.read(block)


@contextmanager
def cluster(workers: int) -> Any:
    """A client of a cluster of so many processes of one thread each."""
    import dask
    import distributed

    dask.config.set({"distributed.scheduler.allowed-failures": 10})  # who is killed often is not to blame here
    with (
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, memory_limit=int(WORKER_MEMORY), dashboard_address=None,
            silence_logs=50,
        ) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):  # fmt: skip
        yield client


def status(name: str) -> float:
    """Bytes that the system states of this process."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith(name))


def captured(camera: vcc.Camera, light_field: Any, path: Path, **options: Any) -> tuple[float, np.ndarray]:
    """Seconds, and the picture."""
    forget(path)
    start = time.perf_counter()
    image = camera.capture(light_field, **options)
    return time.perf_counter() - start, image.values


def compared(name: str, stored: Any, path: Path) -> None:
    """One camera by one process, and by clusters of one worker and of two."""
    camera = CAMERAS[name]
    print(f"{name}:", flush=True)
    seconds: dict[int, float] = {}
    pictures = []
    for threads in (1, None):
        took, here = captured(camera, stored, path, threads=threads)
        words = "one thread" if threads else f"{os.cpu_count()} threads"
        print(f"  without an executor, {words}: {took:.1f} s", flush=True)
        pictures.append(here)
    for workers in (1, 2):
        with cluster(workers) as client:
            foretold = camera.explain(stored, executor=client)  # workers load what they need for it
            seconds[workers], picture = captured(camera, stored, path, executor=client)
            sizes = client.run(status, "VmHWM").values()
        pictures.append(picture)
        print(
            f"  Dask, {workers} of one thread: {seconds[workers]:.1f} s "
            f"({foretold.expected_seconds_by_executor:.1f} s foretold, "
            f"and {foretold.expected_seconds:.1f} s without); "
            f"resident at most {max(sizes) / 1e9:.2f} GB of {WORKER_MEMORY / 1e9:.0f} GB",
            flush=True,
        )
    print(f"  two against one: {seconds[1] / seconds[2]:.2f} times as fast (1.7 asked for)")
    print(f"  {told_alike(pictures)}", flush=True)


def told_alike(pictures: list[np.ndarray]) -> str:
    """Whether pictures are the same bytes, in words."""
    same = len({picture.tobytes() for picture in pictures}) == 1
    error = max(float(np.abs(picture - pictures[0]).max()) for picture in pictures) / pictures[0].max()
    return f"the {len(pictures)} pictures are {'the same bytes' if same else f'NOT the same, by {error:.1e}'}"


def killed(stored: Any, path: Path) -> None:
    """Two workers, none of which is killed, and two that are."""
    from vcc.run.drive import Drive

    camera = CAMERAS["lens"]
    with cluster(2) as client, tempfile.TemporaryDirectory() as marks:
        run = Drive(camera.compile(stored), stored, vcc.How(), client)
        blocks = [block for block in run.blocks if run.used_in(block)]
        some = random.Random(0).sample(blocks, max(round(KILLED * len(blocks)), 1))
        deadly = Deadly(stored, frozenset(first_used(run.used, block) for block in some), Path(marks))
        took, whole = captured(camera, stored, path, executor=client)
        print(f"none of {len(blocks)} blocks kills its worker: {took:.1f} s", flush=True)
        took, picture = captured(camera, deadly, path, executor=client)
        died = len(list(Path(marks).iterdir()))
    print(f"{died} of {len(blocks)} blocks killed their worker: {took:.1f} s; {told_alike([whole, picture])}")


def first_used(used: np.ndarray, block: Any) -> tuple[int, int]:
    """(row, column) of the first view of a block that is read."""
    rows, columns = np.nonzero(used[slice(*block.rows), slice(*block.columns)])
    return block.rows[0] + int(rows[0]), block.columns[0] + int(columns[0])


# --- 100 GB of which little is needed ---


def sparse(folder: Path) -> None:
    """Open 100 GB, and capture what needs a twentieth of it."""
    # A round stop in the middle of the aperture, of a twentieth of its area.
    stop = (4 / np.pi * 0.05) ** 0.5 * 10 * mm
    pitch = FOCUS * 1e-3
    through_stop = vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=stop)], vcc.Sensor(FOCUS, PIXELS, pitch))
    few = round(0.05**0.5 * PIXELS[0])
    wide = vcc.Lens(focal_length=50 * mm, diameter=15 * mm)  # through which all views send light
    of_pixels = vcc.Camera([wide], vcc.Sensor(FOCUS, (few, few), pitch))
    of_rows = vcc.Camera([wide], vcc.Sensor(FOCUS, (PIXELS[0] // 20, PIXELS[1]), pitch))
    for chunks in (None, (104, 104), (50, 50), (25, 25)):
        path = folder / "vcc-sparse.zarr"
        try:
            stored = linked(path, chunks)
            print(f"chunks of {'×'.join(map(str, stored.array.chunks[2:4]))} pixels:", flush=True)
            cameras = {f"a sensor of {few}×{few} pixels, 5 % of each view": of_pixels}
            if chunks is None:
                cameras |= {"a stop of 5 % of the aperture": through_stop, "a sensor of 5 % of the rows": of_rows}
            for name, camera in cameras.items():
                size, before, start = stored.stored_bytes, read_bytes(), time.perf_counter()
                camera.capture(stored)
                took, read = time.perf_counter() - start, read_bytes() - before
                print(
                    f"  {name}: {read / size:.1%} of the bytes read (7 % asked for), in {took:.0f} s", flush=True
                )
            if chunks is None:
                continue
            with cluster(2) as client:
                before = sum(client.run(read_bytes).values())
                of_pixels.capture(stored, executor=client)
                read = sum(client.run(read_bytes).values()) - before
            print(f"  the same by two workers: {read / size:.1%}", flush=True)
        finally:
            shutil.rmtree(path, ignore_errors=True)


def linked(path: Path, chunks: tuple[int, int] | None) -> vcc.store.StoredLightField:
    """A store of 100 GB whose views are all one file."""
    side = 92
    with create_store(
        path, views_of(side), (side, side, *PIXELS, 3), "float32", description={"scene": "noise"},
        provenance={"made_by": "benchmarks/cluster.py"}, disparity_range=(0.0, 0.0),
        compression=Lossless("lz4", 0), chunks=chunks,
    ) as writer:  # fmt: skip
        writer.write_view(0, 0, np.random.default_rng(0).random((*PIXELS, 3)).astype(np.float32))
        for row, column in writer.missing():
            os.link(path / "samples/c.0.0.0.0.0", path / f"samples/c.{row}.{column}.0.0.0")
        writer.finish()
    start = time.perf_counter()
    stored = open_store(path)
    opened = time.perf_counter() - start
    size = stored.stored_bytes / 1e9
    print(f"{side}×{side} views, {size:.0f} GB on disk as it states: opened in {opened * 1e3:.0f} ms")
    return stored


def read_bytes() -> int:
    """Bytes that this process has read so far, by the system's account."""
    lines = Path("/proc/self/io").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("rchar"))


# --- a petabyte on 1000 workers ---


def scheduler() -> None:
    """Tasks that Dask's scheduler on this machine hands out and sums in a second."""
    with cluster(2) as client:
        print(f"tasks without content, two workers: {tasks_each_second(client, 4096):.0f} in a second", flush=True)


def tasks_each_second(client: Any, count: int) -> float:
    """How many tasks are done in a second that do nothing, sums counted."""
    worker_pool(client).summed(Work(pause, 0.0), range(TOGETHER), longer, lambda _: None)
    start = time.perf_counter()
    worker_pool(client).summed(Work(pause, 0.0), range(count), longer, lambda _: None)
    return count * TOGETHER / (TOGETHER - 1) / (time.perf_counter() - start)


def pause(seconds: float, _: int) -> float:
    """A task."""
    time.sleep(seconds)
    return seconds


def longer(one: float, other: float) -> float:
    """A sum."""
    return max(one, other)


@dataclass(frozen=True)
class Machines:
    """A cluster and its work.

    Args:
        light_field: bytes of samples that are read.
        block: bytes of samples in a block.
        raster: bytes of a raster, in double precision.
        workers: of one thread each.
        storage: bytes in a second that the storage gives to all together.
        network: bytes in a second to and from each worker.
        latency: seconds from the scheduler's word to the beginning of a task.
        running: bytes of samples that a thread unpacks and runs in a second.
        adding: bytes of rasters that it adds in a second.
        tasks: that the scheduler hands out in a second.
    """

    light_field: float = 1e15
    block: float = 1e9
    raster: float = 24e6
    workers: int = 1000
    storage: float = 500e9
    network: float = 1.25e9
    latency: float = 2e-3
    running: float = 0.79e9
    adding: float = 1e9
    tasks: float = 552.0

    @property
    def blocks(self) -> int:
        """How many there are."""
        return int(np.ceil(self.light_field / self.block))

    @property
    def bounds(self) -> dict[str, float]:
        """Seconds that each thing takes if nothing else took any."""
        sums = self.blocks / (TOGETHER - 1)
        each = (TOGETHER - 1) * self.raster / self.network + TOGETHER * self.raster / self.adding
        return {
            "reading": self.light_field / min(self.storage, self.workers * self.network),
            "running": self.light_field / (self.workers * self.running),
            "summing": sums * each / self.workers,
            "scheduling": (self.blocks + sums) / self.tasks,
        }

    def simulated(self) -> float:
        """Seconds until the picture is there, event by event.

        The scheduler and the storage serve one after the other, in the order of asking. A worker reads, runs, and
        takes the sum of which it made the last part before it asks for the next block.
        """
        left, size = [], self.blocks
        while size > 1:
            groups = -(-size // TOGETHER)
            left.append([min(TOGETHER, size - TOGETHER * n) for n in range(groups)])
            size = groups
        events = [(0.0, worker, -1, 0) for worker in range(self.workers)]  # time, worker, what it has done, level
        begun, scheduler, storage, now = 0, 0.0, 0.0, 0.0
        adding = (TOGETHER - 1) * self.raster / self.network + TOGETHER * self.raster / self.adding
        while events:
            now, worker, place, level = heapq.heappop(events)
            if place >= 0 and level < len(left):
                group = place // TOGETHER
                left[level][group] -= 1
                if not left[level][group]:  # the sum is taken where its last part was made
                    scheduler = max(scheduler, now) + 1 / self.tasks
                    heapq.heappush(events, (scheduler + self.latency + adding, worker, group, level + 1))
                    continue
            if begun < self.blocks:
                scheduler = max(scheduler, now) + 1 / self.tasks
                start = scheduler + self.latency
                storage = max(storage, start) + self.block / self.storage
                read = max(storage, start + self.block / self.network)
                heapq.heappush(events, (read + self.block / self.running, worker, begun, 0))
                begun += 1
        return now + self.raster / self.network


VARIANTS = {
    "as stated": Machines(),
    "blocks of 0.25 GB": Machines(block=0.25e9),
    "blocks of 4 GB": Machines(block=4e9),
    "storage of 100 GB/s": Machines(storage=100e9),
    "storage of 2 TB/s": Machines(storage=2e12),
    "a picture of 20000×20000×3": Machines(raster=9.6e9),
    "10000 workers, storage of 5 TB/s": Machines(workers=10000, storage=5e12),
}


def run_by_a_thread(folder: Path) -> float:
    """Bytes of samples in a second of a processor, of the slower of the cameras, with the store in memory."""
    found = []
    with made(folder, 0.5, keep=False) as (stored, _):
        samples = np.prod(stored.shape) * stored.read_dtype.itemsize
        for name, camera in CAMERAS.items():
            seconds = []
            for _ in range(3):
                start = time.process_time()
                camera.capture(stored, threads=1)
                seconds.append(time.process_time() - start)
            found.append(samples / min(seconds))
            print(f"{name}: {found[-1] / 1e9:.2f} GB of samples in a second of the processor", flush=True)
    return min(found)


def simulated(folder: Path, running: float | None, tasks: float | None) -> None:
    """Each variant's bounds, and what comes of them together; and a small one beside Dask itself."""
    running = run_by_a_thread(folder) if running is None else running
    if tasks is None:
        with cluster(2) as client:
            tasks = tasks_each_second(client, 4096)
    print(f"put in: --running {running:.3g} --tasks {tasks:.0f}; all else as Machines states it")
    beside_dask()
    print("seconds" + " " * 29 + "".join(f"{name:>12}" for name in (*VARIANTS["as stated"].bounds, "together")))
    for name, variant in VARIANTS.items():
        machines = replace(variant, running=running, tasks=tasks)
        numbers = (*machines.bounds.values(), machines.simulated())
        print(f"  {name:34}" + "".join(f"{number:12.0f}" for number in numbers), flush=True)


def beside_dask() -> None:
    """The simulation of few tasks, and Dask itself."""
    import distributed

    with (
        distributed.LocalCluster(
            n_workers=8, threads_per_worker=1, processes=False, dashboard_address=None, silence_logs=50
        ) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):
        rate = tasks_each_second(client, 2048)
        for seconds in (0.02, 0.1):
            small = Machines(
                512.0, 1.0, 0.0, 8, storage=np.inf, network=np.inf, latency=0.0, running=1 / seconds, tasks=rate
            )
            start = time.perf_counter()
            worker_pool(client).summed(Work(pause, seconds), range(512), longer, lambda _: None)
            took = time.perf_counter() - start
            print(f"512 tasks that sleep {seconds:g} s, 8 workers, {rate:.0f} tasks a second: ", end="")
            print(f"simulated {small.simulated():.2f} s, by Dask {took:.2f} s", flush=True)


def main() -> None:
    """What is asked for."""
    of_store = {
        "make": lambda stored, path: None,
        "lens": partial(compared, "lens"),
        "mask": partial(compared, "mask in mid-path"),
        "killed": killed,
    }
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--only", choices=[*of_store, "sparse", "scheduler", "simulated"])
    options.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()))
    options.add_argument("--gigabytes", type=float, default=20.0)
    options.add_argument("--keep", action="store_true")
    options.add_argument("--running", type=float)
    options.add_argument("--tasks", type=float)
    given = options.parse_args()
    warnings.simplefilter("ignore", vcc.ResultWarning)
    some = [name for name in of_store if given.only in (None, name)]
    if some:
        with made(given.folder, given.gigabytes, given.keep) as (stored, path):
            for name in some:
                print(f"--- {name} ---", flush=True)
                of_store[name](stored, path)
    parts = {
        "sparse": lambda: sparse(given.folder),
        "scheduler": scheduler,
        "simulated": lambda: simulated(given.folder, given.running, given.tasks),
    }
    for name, part in parts.items():
        if given.only in (None, name):
            print(f"--- {name} ---", flush=True)
            part()


if __name__ == "__main__":
    main()
