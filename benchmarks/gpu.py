"""What engine "cuda" takes on a GPU, beside one read of the samples from its memory and beside PyTorch there.

    pip install ".[gpu]" torch        # a build of PyTorch for CUDA, for the peer; left out where there is none
    python benchmarks/gpu.py          # about two minutes on an H100; prints Markdown

Kernels are timed by the GPU's own clock around several runs that are all asked for beforehand, with samples and
tables there: what is printed is what the GPU works, and below it what a whole ``capture`` takes of a wall clock.
Each figure is the median over rounds in which all steps take turns. ``--tiny`` runs all of it at a few samples, on
numba-cuda's simulator too (``NUMBA_ENABLE_CUDASIM=1 NUMBA_DISABLE_JIT=1``), where times mean nothing: a check of
this program, not of the GPU.
"""

from __future__ import annotations

import argparse
import platform
import statistics
import subprocess
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numba import cuda

import vcc
from vcc.engines import cuda as engine
from vcc.engines import cuda_back, cuda_footprints
from vcc.engines.cuda_arrays import SIMULATED, launch, to_device, zeros
from vcc.plan.how import How
from vcc.run.drive import Drive
from vcc.units import mm

Step = Callable[[], object]
WAITED = 400_000
"""Rounds of waiting for each run that is asked for: a millisecond or so."""


@dataclass(frozen=True)
class Sizes:
    """How large the light field and the work are.

    Args:
        views: a side.
        pixels: of a view, a side.
        cells: of the mask, a side.
        samples: rays a pixel.
        runs: of a step before the clock is read.
        rounds: in which all steps take turns.
        refine: as `vcc.How` has it.
    """

    views: int = 20
    pixels: int = 500
    cells: int = 1000
    samples: int = 64
    runs: int = 10
    rounds: int = 7
    refine: Any = "auto"


TINY = Sizes(views=2, pixels=4, cells=2, samples=2, runs=1, rounds=1, refine=1)


@dataclass(frozen=True)
class Case:
    """A camera before samples on the GPU: what one run of its core does there."""

    camera: vcc.Camera
    plan: Any
    there: vcc.LightField
    core: Any

    @classmethod
    def of(cls, camera: vcc.Camera, lf: vcc.LightField, there: vcc.LightField, **options: Any) -> Case:
        plan = camera.compile(lf, **options)
        return cls(camera, plan, there, Drive(plan, there, How(engine="cuda")).core)

    def values(self) -> Any:
        return engine.prepared(self.plan.before, self.there.values, 1)

    def ahead(self) -> Step:
        values = self.values()
        return lambda: cuda_footprints.raster_on_gpu(self.core, values)

    def back(self) -> Step:
        weights = to_device(np.random.default_rng(3).random((*self.core.raster_shape, 3), np.float32))
        return lambda: cuda_back.samples_back_on_gpu(self.core, self.there.shape, weights)

    def numbers(self) -> Step:
        weights = to_device(np.random.default_rng(3).random((*self.core.raster_shape, 3), np.float32))
        wanted = ["weights", *(f"masks[{n}].texture" for n in range(len(self.core.masks)))]
        values = self.values()
        return lambda: cuda_back.footprint_gradients(self.core, values, weights, wanted)

    def rays(self) -> Step:
        values = self.values()
        return lambda: engine.traced_on_gpu(self.core, values, 0)


def light_field(sizes: Sizes) -> vcc.LightField:
    """Random bytes in the demo's geometry, as in paper_case.py."""
    views, pixels = sizes.views, sizes.pixels
    values = np.random.default_rng(0).integers(0, 256, (views, views, pixels, pixels, 3), dtype=np.uint8)
    slope = 24 * mm / 52 / mm / pixels
    return vcc.LightField.from_views(values, 20 * mm / views, slope, 1.3, disparity_range=(-0.5, 0.5))


def cameras(sizes: Sizes) -> tuple[vcc.Camera, vcc.Camera, vcc.Camera]:
    """A conventional camera; the same with a mask in mid-path; and one with lenslets, for rays."""
    sensor = vcc.Sensor(z=52 * mm, shape=(sizes.pixels,) * 2, pitch=24 * mm / sizes.pixels)
    cells = np.random.default_rng(1).random((sizes.cells,) * 2).round()
    lens, mask = vcc.Lens(50 * mm), vcc.Mask(cells, width=30 * mm, z=40 * mm)
    lenslets = vcc.LensArray(pitch=24 * mm / 50, focal_length=2 * mm, z=50 * mm)
    stopped = vcc.Lens(50 * mm, diameter=16 * mm)
    return vcc.Camera([lens], sensor), vcc.Camera([lens, mask], sensor), vcc.Camera([stopped, lenslets], sensor)


# --- clocks ---


@cuda.jit
def _wait(rounds, sums):  # type: ignore[no-untyped-def]
    """Some time of the GPU: each round waits for the one before."""
    total = sums[0]
    for _ in range(rounds):
        total = total * np.float32(0.999) + np.float32(1)
    sums[0] = total


def on_the_gpu(step: Step, runs: int) -> float:
    """Seconds of one run by the GPU's clock, of several one after the other.

    The GPU is kept waiting until they are all asked for, so that it has no gaps between them, and no memory is
    given back in between, for which it would stop.
    """
    if SIMULATED:
        return on_the_wall(step)
    start, stop = cuda.event(), cuda.event()
    with cuda.defer_cleanup():
        launch(_wait, (1,), 0, WAITED * runs, zeros((1,)))
        start.record()
        for _ in range(runs):
            step()
        stop.record()
        stop.synchronize()
    return float(start.elapsed_time(stop)) / 1e3 / runs


def on_the_wall(step: Step) -> float:
    """Seconds until a step has come to its end."""
    start = time.perf_counter()
    step()
    cuda.synchronize()
    return time.perf_counter() - start


def medians(steps: dict[str, Step], clock: Callable[[Step], float], rounds: int) -> dict[str, float]:
    """The median time of each step, all in turn; the first round, in which code is compiled, does not count."""
    times: dict[str, list[float]] = {name: [] for name in steps}
    for turn in range(rounds + 1):
        for name, step in steps.items():
            taken = clock(step)
            if turn > 0:
                times[name].append(taken)
    return {name: statistics.median(taken) for name, taken in times.items()}


# --- peers ---


@cuda.jit
def _read(words, sums):  # type: ignore[no-untyped-def]
    """Every word once, in the order of memory; sums[thread] is kept, so that nothing is left out."""
    x, threads = cuda.grid(1), cuda.gridsize(1)
    one, two, three, four = np.uint64(0), np.uint64(0), np.uint64(0), np.uint64(0)
    for n in range(x, words.size - 3 * threads, 4 * threads):  # four words on their way at a time
        one += words[n]
        two += words[n + threads]
        three += words[n + 2 * threads]
        four += words[n + 3 * threads]
    sums[x % sums.size] = one + two + three + four


def reading(values: Any) -> Step:
    """One read of all samples from the GPU's memory, by a kernel that only adds."""
    words = values.reshape(values.size).view(np.uint32)
    sums = zeros((2**18,))
    return lambda: launch(_read, (min(2**18, max(words.size // 4, 1)),), 0, words, sums)


def copying(values: Any) -> Step:
    """A copy of all samples within the GPU's memory: a read and a write."""
    other = cuda.device_array(values.shape, values.dtype)
    return lambda: other.copy_to_device(values)


def with_torch(lf: vcc.LightField, camera: vcc.Camera) -> tuple[Step, str] | None:
    """PyTorch's grid_sample on the same GPU, all views in batches of one row, samples there as it wants them."""
    try:
        import torch
    except ImportError:
        return None
    if not (torch.cuda.is_available() or SIMULATED):
        return None
    place = "cpu" if SIMULATED else "cuda"
    plan = camera.compile(lf, between_views="none", refine=1, interpolation="linear").core
    rows, columns = camera.sensor.shape
    # (views, channels, rows, columns), float32, as grid_sample takes them: converting them each time is left out.
    views = torch.from_numpy(lf.values).to(place).permute(0, 1, 4, 2, 3).float().contiguous()
    row, column = torch.arange(rows, device=place), torch.arange(columns, device=place)
    x, y = (torch.from_numpy(each).float().to(place) for each in (plan.x, plan.y))
    step = plan.row_step

    def run() -> Any:
        total = torch.zeros(3, rows, columns, device=place)
        for j in range(len(views)):
            k = (column[None] - x[j][:, None]) / step * 2 / (columns - 1) - 1
            l = (row[None] - y[j][:, None]) / step * 2 / (rows - 1) - 1
            grid = torch.stack([k[:, None].expand(-1, rows, -1), l[:, :, None].expand(-1, -1, columns)], -1)
            total += torch.nn.functional.grid_sample(views[j], grid, align_corners=True).sum(0)
        return total

    return run, f"PyTorch {torch.__version__}"


# --- what is printed ---


def name_of_gpu() -> str:
    if SIMULATED:
        return "numba-cuda's simulator"
    device = cuda.get_current_device()
    name = device.name.decode() if isinstance(device.name, bytes) else str(device.name)
    try:
        asked = ["nvidia-smi", "--query-gpu=driver_version", "--format=csv,noheader"]
        driver = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.split()[0]
    except (OSError, subprocess.CalledProcessError, IndexError):
        driver = "of unknown version"
    return f"{name}, driver {driver}"


def agreement(case: Case, lf: vcc.LightField, **options: Any) -> float:
    """How far a picture is from the reference's, of its brightest pixel, on views that it can do in time."""
    few = lf[::5, ::5] if lf.shape[0] > 5 else lf
    plan = case.camera.compile(few, **options)
    expected = case.camera.capture(few, plan=plan, engine="reference").values
    picture = case.camera.capture(few, plan=plan, engine="cuda").values
    return float(np.abs(picture - expected).max() / expected.max())


def line(what: str, seconds: float, found: str, target: str, met: bool) -> None:
    judged = "—" if SIMULATED else "yes" if met else "NO"
    print(f"| {what} | {seconds * 1e3:.3f} ms | {found} | {target} | {judged} |", flush=True)


def main() -> None:
    """Print all figures, each target beside what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tiny", action="store_true", help="a few samples: whether this program runs")
    sizes = TINY if parser.parse_args().tiny else Sizes()
    warnings.simplefilter("ignore", vcc.ResultWarning)
    lf = light_field(sizes)
    there, plain, masked, arrays = lf.on_gpu(), *cameras(sizes)
    conventional, through_mask = (Case.of(camera, lf, there, refine=sizes.refine) for camera in (plain, masked))
    rays, lenslets = (
        Case.of(camera, lf, there, method="rays", samples=sizes.samples) for camera in (masked, arrays)
    )
    peer = with_torch(lf, plain)
    steps: dict[str, Step] = {
        "reading": reading(there.values),
        "copying": copying(there.values),
        "ahead": conventional.ahead(),
        "mask": through_mask.ahead(),
        "back": conventional.back(),
        "mask back": through_mask.back(),
        "numbers": through_mask.numbers(),
        "rays": rays.rays(),
        "lenslets": lenslets.rays(),
        **({"torch": peer[0]} if peer else {}),
    }
    took = medians(steps, lambda step: on_the_gpu(step, sizes.runs), sizes.rounds)
    one = took["reading"]
    machine = f"{platform.machine()}, Python {platform.python_version()}, Numba {numba.__version__}"
    print(f"{name_of_gpu()}; {machine}\n")
    if SIMULATED:
        print("Times of a simulator say nothing of a GPU: this shows that the program runs.\n")
    megabytes = lf.values.nbytes / 1e6
    print(f"Samples: {'×'.join(map(str, lf.shape))}, 8 bits, {megabytes:.0f} MB, on the GPU. One read of them:")
    print(f"{one * 1e3:.3f} ms, {megabytes / 1e6 / one:.2f} TB/s; a copy {took['copying'] * 1e3:.3f} ms.\n")
    print("| kernels alone, by the GPU's clock | time | found | target | met |")
    print("|---|---|---|---|---|")
    for what, name, most in (("conventional", "ahead", 3), ("a mask in mid-path", "mask", 5)):
        line(what, took[name], f"{took[name] / one:.1f} reads", f"≤ {most}", took[name] <= most * one)
    for what, name, forward in (("back to samples", "back", "ahead"), ("the same, mask", "mask back", "mask")):
        ratio = took[name] / took[forward]
        line(what, took[name], f"{ratio:.1f} times forward", "≤ 3", ratio <= 3)
    ratio = took["numbers"] / took["mask"]
    line("back to mask and weights", took["numbers"], f"{ratio:.1f} times forward", "≤ 3", ratio <= 3)
    for what, name, case in (
        ("rays through a mask", "rays", rays),
        ("rays through lenslets", "lenslets", lenslets),
    ):
        traced = engine.traced(case.core, case.values(), 0).rays
        rate = traced / took[name] / 1e9
        line(what, took[name], f"{rate:.2f} G rays/s", "≥ 2", rate >= 2)
    if peer is None:
        print("| PyTorch grid_sample | — | not compared: no PyTorch with CUDA here | ≥ 5 | — |")
    else:
        ratio = took["torch"] / took["ahead"]
        line(f"{peer[1]}, grid_sample", took["torch"], f"{ratio:.1f} times ours", "≥ 5", ratio >= 5)
    captures(lf, there, conventional, through_mask, sizes)
    print("\n| agreement with `reference`, of the brightest pixel | found | target | met |")
    print("|---|---|---|---|")
    for what, case, options in (
        ("conventional", conventional, {"refine": sizes.refine}),
        ("a mask in mid-path", through_mask, {"refine": sizes.refine}),
        ("rays through a mask", rays, {"method": "rays", "samples": 2}),
    ):
        error = agreement(case, lf, **options)
        print(f"| {what} | {error:.1e} | ≤ 1e-5 | {'yes' if error <= 1e-5 else 'NO'} |", flush=True)


def captures(lf: vcc.LightField, there: vcc.LightField, plain: Case, masked: Case, sizes: Sizes) -> None:
    """Whole pictures by a wall clock, from samples here and there, with a plan made before and without."""
    given = {
        "samples there, plan given again": (there, True),
        "samples there": (there, False),
        "samples sent from main memory": (lf, False),
    }
    print("\n| a whole `capture`, by a wall clock | conventional | mask in mid-path |")
    print("|---|---|---|")
    steps: dict[str, Step] = {
        f"{name}, {number}": lambda field=field, case=case, kept=kept: case.camera.capture(  # type: ignore[misc]
            field, engine="cuda", **({"plan": case.plan} if kept else {"refine": sizes.refine})
        )
        for name, (field, kept) in given.items()
        for number, case in enumerate((plain, masked))
    }
    took = medians(steps, on_the_wall, sizes.rounds)
    for name in given:
        print(f"| {name} | {took[f'{name}, 0'] * 1e3:.2f} ms | {took[f'{name}, 1'] * 1e3:.2f} ms |", flush=True)
    processor = {
        f"{number}": lambda case=case: case.camera.capture(lf, plan=case.plan)  # type: ignore[misc]
        for number, case in enumerate((plain, masked))
    }
    if not SIMULATED:
        took = medians(processor, on_the_wall, sizes.rounds)
        print(f"| engine='numba' on this machine | {took['0'] * 1e3:.2f} ms | {took['1'] * 1e3:.2f} ms |")


if __name__ == "__main__":
    main()
