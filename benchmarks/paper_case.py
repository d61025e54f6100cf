"""The paper's case in one table: 500×500 pixels, 20×20 views, RGB, 8 bits, everything in the same run.

    pip install ".[benchmark]"        # OpenCV, the peer; PyTorch is compared too where it is installed
    python benchmarks/paper_case.py   # about two minutes; prints Markdown

Times are medians of several runs in one process; compare ratios, not seconds, between machines. Ours runs by its
default options, plan, sharpening and all; the peers take views bilinearly, one after the other.
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

import vcc
from vcc.units import mm, um

THREADS = 2
OTHER_SIZE = 0.93
"""Pixels of another size than samples: neither lies on the other's lattice."""
Step = Callable[[], object]


def light_field(views: int, pixels: int) -> vcc.LightField:
    """Random bytes in the demo's geometry: what a sample holds does not change the time."""
    values = np.random.default_rng(0).integers(0, 256, (views, views, pixels, pixels, 3), dtype=np.uint8)
    slope = 24 * mm / 52 / mm / pixels
    return vcc.LightField.from_views(values, 20 * mm / views, slope, 1.3, disparity_range=(-0.5, 0.5))


def cameras(pixels: int, size: float = 1.0) -> tuple[vcc.Camera, vcc.Camera]:
    """A conventional camera, and the same with a 1000×1000 mask in mid-path; pixels of so many samples' size."""
    sensor = vcc.Sensor(z=52 * mm, shape=(pixels, pixels), pitch=24 * mm / pixels * size)
    cells = np.random.default_rng(1).random((1000, 1000)).round()
    lens, mask = vcc.Lens(50 * mm), vcc.Mask(cells, width=30 * mm, z=40 * mm)
    return vcc.Camera([lens], sensor), vcc.Camera([lens, mask], sensor)


def seconds(step: Step, runs: int) -> float:
    """The median time of a step after one run that is not counted."""
    step()
    return statistics.median(once(step) for _ in range(runs))


def once(step: Step) -> float:
    """The time of a step, seconds."""
    start = time.perf_counter()
    step()
    return time.perf_counter() - start


@numba.njit(nogil=True)
def _summed(values):  # type: ignore[no-untyped-def]
    total = np.uint64(0)
    for n in range(values.size):
        total += values[n]
    return total


def reading(values: np.ndarray, kind: type = np.uint64) -> Step:
    """Every byte once, in as many threads: the limit, where words of eight bytes are added; bytes take longer."""
    parts = np.array_split(values.reshape(-1).view(kind), THREADS)
    pool = ThreadPoolExecutor(THREADS)
    return lambda: list(pool.map(_summed, parts))


def places(field: vcc.LightField, camera: vcc.Camera) -> tuple[np.ndarray, np.ndarray, float]:
    """Where sample (0, 0) of each view falls on the sensor, and the step: what the peers need to know."""
    plan = camera.compile(field, between_views="none", refine=1, interpolation="linear").core
    return plan.x, plan.y, plan.row_step


def with_opencv(field: vcc.LightField, camera: vcc.Camera, masked: bool) -> Step:
    """OpenCV, view by view: warpAffine and accumulate, the mask warped to each view's picture."""
    import cv2

    cv2.setNumThreads(THREADS)
    values = field.values
    plan = camera.compile(field, between_views="none", refine=1, interpolation="linear").core
    size = camera.sensor.shape[::-1]

    def run() -> np.ndarray:
        total = np.zeros((*camera.sensor.shape, 3), np.float32)
        for j, i in np.ndindex(*field.shape[:2]):
            place = np.array([[plan.column_step, 0, plan.x[j, i]], [0, plan.row_step, plan.y[j, i]]])
            warped = cv2.warpAffine(values[j, i], place, size, flags=cv2.INTER_LINEAR)
            if masked:
                lookup = plan.masks[0]
                scale = lookup.step[0, 0] / plan.column_step
                shift_x = lookup.column[j, i] - scale * plan.x[j, i]
                shift_y = lookup.row[j, i] - scale * plan.y[j, i]
                to_texture = np.array([[scale, 0, shift_x], [0, scale, shift_y]])
                flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
                weight = cv2.warpAffine(lookup.texture, to_texture, size, flags=flags)
                total += warped * weight[..., None]
            else:
                cv2.accumulate(warped, total)
        return total

    return run


def with_numpy(field: vcc.LightField, camera: vcc.Camera) -> Step:
    """NumPy, view by view: bilinear by slices, for this case's step of one pixel a sample."""
    x, y, step = places(field, camera)
    assert abs(abs(step) - 1) < 1e-9
    rows, columns = camera.sensor.shape

    def run() -> np.ndarray:
        total = np.zeros((rows + 80, columns + 80, 3), np.float32)
        for j, i in np.ndindex(*field.shape[:2]):
            view = field.values[j, i, ::-1, ::-1].astype(np.float32)  # the step is −1: a real image
            left, top = x[j, i] - (columns - 1) + 40, y[j, i] - (rows - 1) + 40
            c, r = int(np.floor(left)), int(np.floor(top))
            fc, fr = np.float32(left - c), np.float32(top - r)
            across = np.zeros((rows, columns + 1, 3), np.float32)
            across[:, :-1] = (1 - fc) * view
            across[:, 1:] += fc * view
            total[r : r + rows, c : c + columns + 1] += (1 - fr) * across
            total[r + 1 : r + rows + 1, c : c + columns + 1] += fr * across
        return total

    return run


def with_torch(field: vcc.LightField, camera: vcc.Camera) -> Step | None:
    """PyTorch's grid_sample, view by view."""
    try:
        import torch
    except ImportError:
        return None
    torch.set_num_threads(THREADS)
    x, y, step = places(field, camera)
    rows, columns = camera.sensor.shape
    row, column = torch.arange(rows), torch.arange(columns)
    values = torch.from_numpy(field.values)

    def run() -> torch.Tensor:
        total = torch.zeros(1, 3, rows, columns)
        for j, i in np.ndindex(*field.shape[:2]):
            k = (column - x[j, i]) / step * 2 / (columns - 1) - 1
            l = (row - y[j, i]) / step * 2 / (rows - 1) - 1
            grid = torch.stack(torch.meshgrid(l, k, indexing="ij")[::-1], -1)[None].float()
            view = values[j, i].permute(2, 0, 1)[None].float()
            total += torch.nn.functional.grid_sample(view, grid, align_corners=True)
        return total

    return run


def main_table(rounds: int) -> None:
    """The table of the paper's case: all steps in turn, round by round, and medians of each round's ratios."""
    field = light_field(20, 500)
    conventional, masked = cameras(500)
    other, other_masked = cameras(500, OTHER_SIZE)
    torch_step = with_torch(field, conventional)
    steps: dict[str, Step] = {
        "reading": reading(field.values),
        "bytes": reading(field.values, np.uint8),
        "ours": lambda: conventional.capture(field),
        "ours, mask": lambda: masked.capture(field),
        "ours, other size": lambda: other.capture(field),
        "ours, other size, mask": lambda: other_masked.capture(field),
        "OpenCV": with_opencv(field, conventional, False),
        "OpenCV, mask": with_opencv(field, masked, True),
        "NumPy": with_numpy(field, conventional),
        **({"PyTorch": torch_step} if torch_step else {}),
    }
    times: dict[str, list[float]] = {name: [] for name in steps}
    for step in steps.values():
        step()  # compiled, loaded and warm before anything counts
    for turn in range(rounds):
        for name, step in steps.items():
            if name in ("NumPy", "PyTorch") and turn >= 3:
                continue
            # Quick steps are repeated, so that each round compares like with like on a noisy machine.
            again = 5 if name in ("reading", "bytes") else 3 if name.startswith("ours") else 1
            times[name].append(statistics.median(once(step) for _ in range(again)))

    def ratio(over: str, under: str) -> str:
        return f"{statistics.median(a / b for a, b in zip(times[over], times[under], strict=False)):.1f}"

    rows = [
        (f"reading the 300 MB once, {THREADS} threads", "reading", None),
        ("the same byte by byte", "bytes", None),
        ("ours: `capture`, plan and all", "ours", "ours, mask"),
        (f"ours, pixels {OTHER_SIZE} times the size of samples", "ours, other size", "ours, other size, mask"),
        ("OpenCV warpAffine + accumulate, view by view", "OpenCV", "OpenCV, mask"),
        ("NumPy, view by view", "NumPy", None),
        ("PyTorch grid_sample, view by view", "PyTorch", None),
    ]
    print("| 500×500×20×20 RGB, 8 bits | conventional | × reading | mask in mid-path | × reading |")
    print("|---|---|---|---|---|")
    for title, plain, through_mask in rows:
        cells = []
        for name in (plain, through_mask):
            known = name is not None and name in times
            cells += [f"{statistics.median(times[name]):.4f} s", ratio(name, "reading")] if known else ["—", "—"]
        print(f"| {title} | {' | '.join(cells)} |")
    print(f"\nOpenCV over ours: {ratio('OpenCV', 'ours')} conventional, ", end="")
    print(f"{ratio('OpenCV, mask', 'ours, mask')} with the mask (medians of {rounds} rounds).\n")


def growth(runs: int) -> None:
    """Linear growth in views and in pixels."""
    print("| views a side | pixels a side | MB | conventional | ns a sample value | mask in mid-path | ns |")
    print("|---|---|---|---|---|---|---|")
    for views, pixels in ((5, 500), (10, 500), (20, 500), (20, 250), (20, 1000)):
        field = light_field(views, pixels)
        cells = []
        for camera in cameras(pixels):
            taken = seconds(lambda c=camera, f=field: c.capture(f), runs)  # type: ignore[misc]
            cells += [f"{taken:.4f} s", f"{taken / field.values.size * 1e9:.3f}"]
        print(
            f"| {views} | {pixels} | {field.values.nbytes / 1e6:.0f} | {' | '.join(cells)} |",
            flush=True,
        )
    print()


def refinement() -> None:
    """Cost where the plan refines, beside what `explain` foretells."""
    field = light_field(20, 500)
    rng = np.random.default_rng(2)
    coded = vcc.Mask(rng.random((11, 11)).round(), width=16 * mm)
    fine = vcc.Mask(rng.random((500, 500)).round(), width=26 * mm, z=51.5 * mm)
    lens = vcc.Lens(50 * mm, diameter=16 * mm)
    shape, pitch = (500, 500), 48 * um
    cases = [
        ("in focus", [lens], 52 * mm),
        ("strong defocus: gaps between views closed", [lens], 60 * mm),
        ("strong defocus, coded aperture: cells divided", [vcc.Lens(50 * mm), coded], 60 * mm),
        ("fine mask 0.5 mm before the sensor: samples divided", [lens, fine], 52 * mm),
    ]  # fmt: skip
    print("| case | view taps | samples divided | foretold | taken | taken / foretold |")
    print("|---|---|---|---|---|---|")
    for name, elements, z in cases:
        camera = vcc.Camera(elements, vcc.Sensor(z=z, shape=shape, pitch=pitch))
        explained = camera.explain(field)
        taken = seconds(lambda c=camera: c.capture(field), 1)  # type: ignore[misc]
        foretold = explained.expected_seconds or float("nan")
        plan = explained.plan.core
        print(
            f"| {name} | {plan.taps_used} | {plan.refine}×{plan.refine} | {foretold:.3f} s | {taken:.3f} s "
            f"| {taken / foretold:.2f} |",
            flush=True,
        )
    print()


_CHILD = """
import sys, time
import numpy as np
start = time.perf_counter()
import vcc
from vcc.units import mm, um
camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(z=52 * mm, shape=(500, 500), pitch=48 * um))
if sys.argv[1] == "mask":
    cells = np.random.default_rng(1).random((1000, 1000)).round()
    camera = vcc.Camera([*camera.elements, vcc.Mask(cells, width=30 * mm, z=40 * mm)], camera.sensor)
values = np.full((20, 20, 500, 500, 3), 7, dtype=np.uint8)
field = vcc.LightField.from_views(values, 1 * mm, 48 * um / (52 * mm), 1.3, disparity_range=(-0.5, 0.5))
if sys.argv[2] == "small":
    field = field[:1, :1, :8, :8]
def peak():
    with open("/proc/self/status") as status:  # Linux; counts from the start of this very process
        return next(int(line.split()[1]) / 1024 for line in status if line.startswith("VmHWM"))
if sys.argv[2] == "full":
    camera.capture(field[:1, :1, :8, :8], refine=1)  # loads the libraries
before = peak()
loaded = time.perf_counter()
camera.capture(field, refine=1)
first = time.perf_counter() - loaded
camera.capture(field, refine=1)
print(first, peak() - before)
"""


NAMES = {"plain": "conventional", "mask": "mask in mid-path"}


def first_calls() -> None:
    """First call in a new process, with and without a compiled cache, and memory beside the light field."""
    print("| first `capture` in a new process | nothing compiled | compiled code cached |")
    print("|---|---|---|")
    for kind in ("plain", "mask"):
        with tempfile.TemporaryDirectory() as cache:
            environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
            times = [
                float(
                    subprocess.run(
                        [sys.executable, "-c", _CHILD, kind, "small"],
                        env=environment, capture_output=True, text=True, check=True,
                    ).stdout.split()[0]
                )
                for _ in range(2)
            ]  # fmt: skip
        print(f"| {NAMES[kind]} | {times[0]:.2f} s | {times[1]:.2f} s |")
    print()
    for kind in ("plain", "mask"):
        out = subprocess.run(
            [sys.executable, "-c", _CHILD, kind, "full"], capture_output=True, text=True, check=True
        ).stdout.split()
        print(
            f"Peak memory while capturing, {NAMES[kind]}: "
            f"{float(out[1]):.0f} MB more than before (the 300 MB light field and all libraries were loaded)."
        )


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=9, help="rounds of all steps (default 9)")
    rounds = parser.parse_args().rounds
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, ")
    print(f"NumPy {np.__version__}, Numba {numba.__version__}\n")
    main_table(rounds)
    growth(max(rounds // 2, 3))
    refinement()
    first_calls()


if __name__ == "__main__":
    main()
