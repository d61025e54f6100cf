"""From weights of a picture back to what it was made of, beside the picture itself; everything in the same run.

    pip install .
    python benchmarks/backwards.py                   # some minutes; prints Markdown
    python benchmarks/backwards.py --case samples    # only the cases whose names begin so

The light field has 20×20 views of 500×500 pixels, RGB. All steps of a case take turns; ratios are medians over the
rounds, of the shortest times of all rounds, and of the shortest times of the processor in the program itself:
without what the system takes to give it new memory, which on a shared machine is most of it. Compare ratios, not
seconds, between machines.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numba
import numpy as np
import rays

import vcc
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.run.backwards import back
from vcc.run.drive import drive
from vcc.units import mm

THREADS = 2
HOW = How(threads=THREADS)
SHAPE = (20, 20, 500, 500, 3)
Step = Callable[[], object]


@dataclass(frozen=True)
class Case:
    """Steps that take turns.

    Args:
        name: what is compared.
        steps: by name.
        under: the step whose time the others are divided by.
    """

    name: str
    steps: dict[str, Step]
    under: str


# --- what is pictured ---


@cache
def light_field(kind: str) -> vcc.LightField:
    """Random samples of a type: what one holds does not change the time."""
    values = np.random.default_rng(0).integers(0, 256, SHAPE, dtype=np.uint8)
    held = values if kind == "uint8" else values.astype(np.float32) / np.float32(255)
    return vcc.LightField.from_views(held, 1 * mm, 24 * mm / (52 * mm) / 500, 1.3, disparity_range=(-0.5, 0.5))


def camera(masked: bool) -> vcc.Camera:
    """A lens, and a mask of 1000×1000 cells in mid-path."""
    sensor = vcc.Sensor(z=52 * mm, shape=(500, 500), pitch=24 * mm / 500 * 0.93)
    cells = np.random.default_rng(1).random((1000, 1000)).round()
    return vcc.Camera([vcc.Lens(50 * mm), *[vcc.Mask(cells, width=30 * mm, z=40 * mm)] * masked], sensor)


def weights(plan: Plan) -> np.ndarray:
    """Of a picture."""
    return np.random.default_rng(2).standard_normal((*plan.sensor_shape, 3))


def writing() -> None:
    """As much memory as a gradient to the samples takes, new and written once."""
    fresh = np.zeros(SHAPE, np.float32).reshape(SHAPE[0], -1)
    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(lambda some: some.fill(1.0), fresh))


# --- the cases ---


def samples_by_footprints(masked: bool) -> Case:
    """The derivative to all samples, by footprints."""
    field, eight = light_field("float32"), light_field("uint8")
    plan, plan_of_eight = (camera(masked).compile(each) for each in (field, eight))
    given = weights(plan)
    return Case(
        f"samples by footprints{', a mask in mid-path' if masked else ''}",
        {
            "picture, float32": lambda: drive(plan, field, HOW),
            "picture, 8 bits": lambda: drive(plan_of_eight, eight, HOW),
            "back to all samples": lambda: back(plan, field, given, HOW),
            "merely writing 1.2 GB": writing,
        },
        "picture, float32",
    )


def samples_by_rays(name: str) -> Case:
    """The derivative to all samples, by rays through one of the cameras of ``benchmarks/rays.py``."""
    field = rays.light_field()
    plan = rays.cameras()[name].compile(field, method="rays")
    given = weights(plan)
    return Case(
        f"samples by rays, 8 bits: {name}",
        {
            "picture": lambda: drive(plan, field, HOW),
            "back to all samples": lambda: back(plan, field, given, HOW),
        },
        "picture",
    )


def numbers_by_footprints(kind: str) -> Case:
    """The derivatives to a mask's texture, and to all that says where samples fall and meet the mask."""
    field = light_field(kind)
    plan = camera(masked=True).compile(field)
    given = weights(plan)
    texture = "core.masks[0].texture"
    geometry = ["core.scale", "core.weights", "core.x", "core.y", "core.step"]
    geometry += [f"core.masks[0].{name}" for name in ("column", "row", "step")]

    def to(*wanted: str) -> Step:
        return lambda: back(plan, field, given, HOW, samples_wanted=False, wanted=wanted)

    return Case(
        f"numbers by footprints, a mask in mid-path, {kind}",
        {
            "picture": lambda: drive(plan, field, HOW),
            "to the mask's texture": to(texture),
            "to the weights": to("core.weights"),
            "to all geometry": to(*geometry),
            "to all of these": to(*geometry, texture),
        },
        "picture",
    )


def geometry_by_rays(name: str) -> Case:
    """The derivative to where rays are aimed and to all optics between what they meet, by rays, 8 bits."""
    field = rays.light_field()
    plan = rays.cameras()[name].compile(field, method="rays")
    given = weights(plan)
    shape = ("core.first_pixel", "core.pitch", "core.index_from_ray", "core.aim.")
    wanted = [each for each in plan.parameters() if each.startswith(shape) or each.endswith("before_from_behind")]
    return Case(
        f"geometry by rays, 8 bits: {name}",
        {
            "picture": lambda: drive(plan, field, HOW),
            "back to all geometry": lambda: back(plan, field, given, HOW, samples_wanted=False, wanted=wanted),
        },
        "picture",
    )


CASES: dict[str, Callable[[], Case]] = {
    "samples": lambda: samples_by_footprints(masked=False),
    "samples, mask": lambda: samples_by_footprints(masked=True),
    "numbers, float32": lambda: numbers_by_footprints("float32"),
    "numbers, 8 bits": lambda: numbers_by_footprints("uint8"),
    **{f"rays: {name}": partial(samples_by_rays, name) for name in rays.cameras()},
    **{f"geometry by rays: {name}": partial(geometry_by_rays, name) for name in rays.cameras()},
}
"""By name, in the order in which they are timed."""


# --- time and memory ---


def processor() -> float:
    """Seconds that all threads of the program have worked, without what the system did for them."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def timed(case: Case, rounds: int) -> None:
    """A table of a case: the median time of each step, and by how much it is longer than another."""
    times: dict[str, list[float]] = {name: [] for name in case.steps}
    own: dict[str, list[float]] = {name: [] for name in case.steps}
    for turn in range(rounds + 1):  # compiled, loaded and warm before anything counts
        for name, step in case.steps.items():
            start, used = time.perf_counter(), processor()
            step()
            if turn:
                times[name].append(time.perf_counter() - start)
                own[name].append(processor() - used)
    under, own_under = times[case.under], own[case.under]
    print(f"| {case.name} | time | × {case.under} | of the shortest | of the processor's |")
    print("|---|---|---|---|---|")
    for name, taken in times.items():
        ratio = statistics.median(a / b for a, b in zip(taken, under, strict=True))
        shortest, ours = min(taken) / min(under), min(own[name]) / min(own_under)
        print(
            f"| {name} | {statistics.median(taken):.3f} s | {ratio:.2f} | {shortest:.2f} | {ours:.2f} |",
            flush=True,
        )
    print()


_CHILD = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from backwards import HOW, back, camera, light_field, weights
def held(what):
    with open("/proc/self/status") as status:  # Linux
        return next(int(line.split()[1]) / 1024 for line in status if line.startswith(what))
field = light_field("uint8")
plan = camera(sys.argv[2] == "mask").compile(field)
given = weights(plan)
part = field[:1, :1, :8, :8]
back(camera(sys.argv[2] == "mask").compile(part), part, given, HOW)  # loads the libraries
with open("/proc/self/clear_refs", "w") as counter:
    counter.write("5")  # the peak counts from here
before = held("VmRSS")
found = back(plan, field, given, HOW).samples
print(held("VmHWM") - before - found.nbytes / 2**20)
"""


def memory() -> None:
    """Memory beside samples and gradient, of the derivative to all samples by footprints."""
    here = str(Path(__file__).resolve().parent)
    for kind, words in (("plain", "conventional"), ("mask", "mask in mid-path")):
        out = subprocess.run(
            [sys.executable, "-c", _CHILD, here, kind], capture_output=True, text=True, check=True
        )
        print(f"Peak memory beside samples and their gradient, {words}: {float(out.stdout):.0f} MB.")


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=9, help="rounds of all steps (default 9)")
    parser.add_argument("--case", default="", help="only cases whose names begin so")
    given = parser.parse_args()
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, ")
    print(f"NumPy {np.__version__}, Numba {numba.__version__}\n")
    for name, case in CASES.items():
        if name.startswith(given.case):
            timed(case(), given.rounds)
    memory()


if __name__ == "__main__":
    main()
