"""Rays through arrays, masks and diffusers, beside SciPy doing the lookups alone; everything in the same run.

    pip install .
    python benchmarks/rays.py          # about two minutes; prints Markdown
    python benchmarks/rays.py --quick  # without the large plenoptic camera

The light field has 20×20 views of 500×500 pixels, RGB, 8 bits: 300 MB. Times are medians; compare ratios, not
seconds, between machines.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np
from scipy.ndimage import map_coordinates

import vcc
from vcc import kernels, patterns
from vcc.plan.rays.model import Rays
from vcc.run.drive import drive
from vcc.units import mm, um

LENS = vcc.Lens(focal_length=50 * mm, diameter=20 * mm)
ARRAY_Z, PITCH = 52 * mm, 125 * um
F_NUMBER_MATCHED = PITCH * ARRAY_Z / (20 * mm)  # focal length of the lenslets, nearly
LENSLETS = vcc.LensArray(pitch=PITCH, focal_length=F_NUMBER_MATCHED, z=ARRAY_Z)
MASK = vcc.Mask(patterns.CosineSum(period=1.5 * mm), width=60 * mm, z=40 * mm)


def light_field(width: float = 24 * mm) -> vcc.LightField:
    """Random bytes, as what a sample holds does not change the time; for a picture so wide behind the lens."""
    values = np.random.default_rng(0).integers(0, 256, (20, 20, 500, 500, 3), dtype=np.uint8)
    return vcc.LightField.from_views(values, 1 * mm, width / ARRAY_Z / 500, 1.3, disparity_range=(-0.5, 0.5))


def behind_lenslets(lenslets: int) -> vcc.Sensor:
    """14×14 pixels behind each lenslet, at its focal length."""
    return vcc.Sensor(ARRAY_Z + F_NUMBER_MATCHED, (lenslets * 14, lenslets * 14), PITCH / 14)


def cameras() -> dict[str, vcc.Camera]:
    """The cases, by name."""
    sensor = vcc.Sensor(ARRAY_Z, (500, 500), 48 * um)
    return {
        "lens, lenslet array, mask; 75×75 lenslets": vcc.Camera([LENS, MASK, LENSLETS], behind_lenslets(75)),
        "lens, lenslet array; 75×75 lenslets": vcc.Camera([LENS, LENSLETS], behind_lenslets(75)),
        "lens, diffuser, mask; 500×500 pixels": vcc.Camera(
            [LENS, vcc.Diffuser(kernels.Gaussian(0.005), z=20 * mm), MASK], sensor
        ),
        "lens, cubic phase plate; 500×500 pixels": vcc.Camera(
            [LENS, vcc.PhasePlate(vcc.surfaces.Cubic(5.0), diameter=20 * mm)], sensor
        ),
        "lens alone, by rays; 500×500 pixels": vcc.Camera([LENS], sensor),
    }


def seconds(step: Callable[[], object], runs: int) -> float:
    """The median time of a step after one run that is not counted."""
    step()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        step()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def lookups_in_scipy(field: vcc.LightField, plan: Rays, threads: int, runs: int) -> float:
    """Seconds a ray of SciPy's linear 4-D lookups in three channels, places given; with so many threads."""
    columns = plan.raster_shape[1]
    rows = np.arange(100, 120)  # some rows of pixels, as rays meet them
    pixel = (rows[:, None] * columns + np.arange(columns)).reshape(-1)
    pieces = []
    for some in np.array_split(pixel, 40):
        index, share = plan.looked_up(some, plan.block(some))
        pieces.append(index[share > 0])
    index = np.concatenate(pieces)[:1_000_000]
    place = np.ascontiguousarray(index[:, [1, 0, 3, 2]].T)
    parts = np.array_split(place, threads, axis=1)
    channels = [np.ascontiguousarray(field.values[..., c]) for c in range(3)]
    pool = ThreadPoolExecutor(threads)

    def look_up() -> None:
        for channel in channels:
            list(pool.map(lambda p, c=channel: map_coordinates(c, p, np.float32, order=1), parts))  # type: ignore[misc]

    return seconds(look_up, runs) / len(index)


def table(field: vcc.LightField, runs: int) -> None:
    """Time and rays a second of each case, and the peer's."""
    print("| 64 rays a pixel | rays | time | million rays a second | foretold |")
    print("|---|---|---|---|---|")
    ours = None
    for name, camera in cameras().items():
        plan = camera.compile(field, method="rays")
        foretold = camera.explain(field, method="rays").expected_seconds or float("nan")
        rays = drive(plan, field).rays
        taken = seconds(lambda p=plan: drive(p, field), runs)  # type: ignore[misc]
        ours = ours or (taken / rays, plan.core)
        print(
            f"| {name} | {rays / 1e6:.1f} million | {taken:.2f} s | {rays / taken / 1e6:.1f} | {foretold:.2f} s |",
            flush=True,
        )
    assert ours is not None
    per_ray, plan = ours
    print(
        "\n| the lookups alone, places given, `scipy.ndimage.map_coordinates(order=1)` | million rays a second |"
    )
    print("|---|---|")
    for words, threads in (("as it is: one thread", 1), ("split by hand over two threads", 2)):
        theirs = lookups_in_scipy(field, plan, threads, 3)
        print(f"| {words} | {1e-6 / theirs:.2f}; ours is {theirs / per_ray:.1f} times as fast |")
    print()


_CHILD = """
import sys, time
sys.path.insert(0, sys.argv[1])
import rays as bench
def peak():
    with open("/proc/self/status") as status:  # Linux; counts from the start of this very process
        return next(int(line.split()[1]) / 1024 for line in status if line.startswith("VmHWM"))
field = bench.light_field(38e-3)
small = bench.vcc.Camera([bench.LENS, bench.LENSLETS], bench.behind_lenslets(2))
start = time.perf_counter()
small.capture(field)
first = time.perf_counter() - start
before = peak()
camera = bench.vcc.Camera([bench.LENS, bench.LENSLETS], bench.behind_lenslets(int(sys.argv[2])))
start = time.perf_counter()
picture = camera.capture(field)
taken = time.perf_counter() - start
plan = camera.compile(field)
print(first, taken, peak() - before, picture.values.nbytes / 2**20, picture.sampling_error / picture.values.mean())
"""


def child(lenslets: int, cache: str | None = None) -> list[float]:
    """A plenoptic camera in a process of its own: first call, time, memory, size of the picture, error."""
    folder = os.path.dirname(os.path.abspath(__file__))  # noqa: PTH100, PTH120 - a string for the command line
    environment = {**os.environ, **({} if cache is None else {"NUMBA_CACHE_DIR": cache})}
    out = subprocess.run(
        [sys.executable, "-c", _CHILD, folder, str(lenslets)],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [float(number) for number in out.stdout.split()]


def large() -> None:
    """The plenoptic camera of 300×300 lenslets with 14×14 pixels each."""
    _, taken, memory, picture, error = child(300)
    rays = (300 * 14) ** 2 * 64
    print(
        f"Plenoptic camera, 300×300 lenslets of 14×14 pixels (17.6 Mpixel), 64 rays a pixel: {taken:.1f} s "
        f"for {rays / 1e9:.2f} billion rays ({rays / taken / 1e6:.1f} million a second), sampling error "
        f"{error:.1%} of the mean. Peak memory: {memory:.0f} MB more than before, of which the picture is "
        f"{picture:.0f} MB.\n"
    )


def first_calls() -> None:
    """First call in a new process, with and without a compiled cache."""
    with tempfile.TemporaryDirectory() as cache:
        times = [child(2, cache)[0] for _ in range(2)]
    print(
        f"First `capture` by rays in a new process: {times[0]:.1f} s with nothing compiled, "
        f"{times[1]:.2f} s cached."
    )


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5, help="runs of each step (default 5)")
    parser.add_argument("--quick", action="store_true", help="leave out the large plenoptic camera")
    given = parser.parse_args()
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, ")
    print(f"NumPy {np.__version__}, Numba {numba.__version__}\n")
    table(light_field(), given.runs)
    first_calls()
    if not given.quick:
        large()


if __name__ == "__main__":
    main()
