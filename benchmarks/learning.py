"""Steps of learning beside the picture itself, and beside gradients through arrays of PyTorch, in the same run.

    pip install ".[torch]"
    python benchmarks/learning.py                      # some minutes; prints Markdown
    python benchmarks/learning.py --case module        # only the cases whose names begin so
    python benchmarks/learning.py --case arrays --before folder   # beside the package in another folder, too

The paper's light field (20×20 views of 500×500 pixels, RGB) through a mask of 1000×1000 cells; a smaller one
beside gradients of PyTorch's own. All steps of a case take turns; see ``benchmarks/backwards.py``. ``--before``
names a checkout of an earlier version, whose array engine is then timed in a process of its own between the turns.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numba
import numpy as np
import torch
from backwards import SHAPE, THREADS, Case, Step, light_field, timed

import vcc
from vcc.engines import numba_cpu
from vcc.engines.footprints_of_many import rasters
from vcc.torch import CameraModule, sigmoid_mask
from vcc.units import mm

MASKS = 16


def camera(cells: int = 1000) -> vcc.Camera:
    """A lens, and a mask in mid-path whose cells are grey: what learning begins with."""
    grey = np.random.default_rng(1).uniform(0.3, 0.7, (cells, cells))
    sensor = vcc.Sensor(z=52 * mm, shape=(500, 500), pitch=24 * mm / 500 * 0.93)
    mask = vcc.Mask(grey, width=30 * mm, z=40 * mm, name="code")
    return vcc.Camera([vcc.Lens(50 * mm, name="main"), mask], sensor)


def one_step(model: CameraModule, optimiser: torch.optim.Optimizer) -> Step:
    """A step of learning: picture, gradient, and the optimiser's."""
    wanted = torch.rand((500, 500, 3), generator=torch.Generator().manual_seed(2))

    def step() -> None:
        optimiser.zero_grad()
        ((model() - wanted) ** 2).mean().backward()
        optimiser.step()

    return step


def moved(model: CameraModule, name: str) -> Step:
    """A picture at another value of a parameter each time, as while it learns."""
    kept = dict(model.named_parameters())[name]

    def step() -> None:
        with torch.no_grad():
            kept.add_(1e-6)
            model()

    return step


def module(kind: str) -> Case:
    """What a module costs beside `capture`, plan and all."""
    field = light_field(kind)
    model = CameraModule(camera(), field, learn=["sensor.z"], threads=THREADS)
    return Case(
        f"module, {kind}, a mask in mid-path",
        {
            "capture": lambda: camera().capture(field, threads=THREADS),
            "model() at another sensor.z each time": moved(model, "sensor.z"),
        },
        "capture",
    )


def steps(kind: str) -> Case:
    """Whole steps of learning beside `capture`."""
    field = light_field(kind)

    def learned(*names: str, **constraints: Callable[[torch.Tensor], torch.Tensor]) -> Step:
        limits = {name.replace("_", "."): limit for name, limit in constraints.items()}
        model = CameraModule(camera(), field, learn=names, constraints=limits, threads=THREADS)
        return one_step(model, torch.optim.Adam(model.parameters(), lr=1e-3))

    return Case(
        f"steps of learning, {kind}, a mask in mid-path",
        {
            "capture": lambda: camera().capture(field, threads=THREADS),
            "a step: 1000×1000 cells": learned("code.pattern", code_pattern=sigmoid_mask),
            "a step: main.focal_length": learned("main.focal_length"),
            "a step: focal length and all places": learned(
                "main.focal_length", "main.decentre", "code.z", "code.decentre", "sensor.z", "sensor.decentre"
            ),
        },
        "capture",
    )


def masks(place: str) -> Case:
    """Pictures of several masks on one light field, and a step of learning them all."""
    field = light_field("float32")
    cells, z = (1000, 40 * mm) if place == "in mid-path" else (20, 0.0)
    elements = [vcc.Lens(50 * mm), vcc.Mask(np.full((cells, cells), 0.5), width=30 * mm, z=z, name="code")]
    one = vcc.Camera(elements, camera().sensor)
    model = CameraModule(one, field, learn=["code.pattern"], threads=THREADS)
    several = torch.rand((MASKS, cells, cells), dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    with_gradient = several.clone().requires_grad_()

    def ahead() -> None:
        with torch.no_grad():
            model(values={"code.pattern": several})

    return Case(
        f"{MASKS} masks {place}, float32",
        {
            "capture of one": lambda: one.capture(field, threads=THREADS),
            f"{MASKS} masks": ahead,
            f"{MASKS} masks and back": lambda: model(values={"code.pattern": with_gradient}).sum().backward(),
        },
        "capture of one",
    )


def at_once(kind: str, shape: tuple[int, ...], place: str) -> Case:
    """Rasters of several masks in one pass over the samples, without plans and what is done to pictures."""
    values = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
    values = values if kind == "uint8" else values.astype(np.float32) / np.float32(255)
    size = shape[2]
    field = vcc.LightField.from_views(values, 1 * mm, 24 * mm / (52 * mm) / size, 1.3, disparity_range=(-0.5, 0.5))
    sensor = vcc.Sensor(z=52 * mm, shape=(size, size), pitch=24 * mm / size * 0.93)
    mask = [vcc.Mask(np.full((1000, 1000), 0.5), width=30 * mm, z=40 * mm)] if place == "in mid-path" else []
    core = vcc.Camera([vcc.Lens(50 * mm), *mask], sensor).compile(field).core
    draw = np.random.default_rng(3)
    if mask:
        textures = [draw.random(core.masks[0].texture.shape) for _ in range(MASKS)]
        cores = [replace(core, masks=(replace(core.masks[0], texture=texture),)) for texture in textures]
    else:
        cores = [replace(core, weights=draw.random(core.weights.shape)) for _ in range(MASKS)]
    times = max(1, 2**28 // values.size)  # long enough for the processor's time to be told

    def several(step: Step) -> Step:
        return lambda: [step() for _ in range(times)]

    return Case(
        f"{times} times rasters of {MASKS} masks {place}, {kind}, {'×'.join(map(str, shape))}",
        {
            "one": several(lambda: numba_cpu.run(cores[0], values, threads=THREADS)),
            f"{MASKS} in one pass": several(lambda: rasters(cores, values, THREADS)),
        },
        "one",
    )


# --- beside arrays of PyTorch ---

_ARRAYS = """
import sys, time, warnings
warnings.simplefilter("ignore")
import numpy as np, torch
import vcc
from vcc.units import mm
torch.set_num_threads({threads})
field = vcc.LightField.from_views(torch.rand({shape}), 1 * mm, 24 * mm / (52 * mm) / 200, 1.3,
                                  disparity_range=(-0.5, 0.5))
elements = [vcc.Lens(50 * mm)]
if sys.argv[1] == "mask":
    elements.append(vcc.Mask(np.random.default_rng(1).random((1000, 1000)).round(), width=30 * mm, z=40 * mm))
camera = vcc.Camera(elements, vcc.Sensor(z=52 * mm, shape=(200, 200), pitch=24 * mm / 200 * 0.93))
plan = camera.compile(field)
def step():
    samples = field.values.detach().requires_grad_()
    picture = camera.capture(field.replaced(samples), plan=plan, engine="array_api").values
    torch.autograd.grad(picture.sum(), samples)
step()
print("ready", flush=True)
for _ in sys.stdin:
    start = time.perf_counter()
    step()
    print(time.perf_counter() - start, flush=True)
"""
SMALL = (8, 8, 200, 200, 3)


class Elsewhere:
    """The array engine of the package in a folder, in a process of its own, a step at a time.

    Args:
        folder: a checkout.
        kind: "mask" or "plain".
    """

    def __init__(self, folder: str, kind: str) -> None:
        code = _ARRAYS.format(threads=THREADS, shape=SMALL)
        environment = {**os.environ, "PYTHONPATH": str(Path(folder) / "src")}
        self._process = subprocess.Popen(
            [sys.executable, "-c", code, kind],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        self._answer()

    def _answer(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline()

    def __call__(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        self._answer()


def arrays(kind: str, before: str | None) -> Case:
    """Pictures and gradients to all samples beside those of PyTorch through the array engine."""
    samples = np.random.default_rng(0).random(SMALL, dtype=np.float32)
    field = vcc.LightField.from_views(samples, 1 * mm, 24 * mm / (52 * mm) / 200, 1.3, disparity_range=(-0.5, 0.5))
    cells = np.random.default_rng(1).random((1000, 1000)).round()
    elements = [vcc.Lens(50 * mm), *[vcc.Mask(cells, width=30 * mm, z=40 * mm)] * (kind == "mask")]
    one = vcc.Camera(elements, vcc.Sensor(z=52 * mm, shape=(200, 200), pitch=24 * mm / 200 * 0.93))
    model = CameraModule(one, field, threads=THREADS)
    given = torch.from_numpy(samples).requires_grad_()
    here = str(Path(__file__).resolve().parents[1])
    found: dict[str, Step] = {
        "model(samples), forward and backward": lambda: torch.autograd.grad(model(given).sum(), given),
        "PyTorch through array_api": Elsewhere(here, kind),
    }
    if before is not None:
        found["PyTorch through array_api, before"] = Elsewhere(before, kind)
    return Case(f"arrays, 8×8×200×200×3, {kind}", found, "model(samples), forward and backward")


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7, help="rounds of all steps (default 7)")
    parser.add_argument("--case", default="", help="only cases whose names begin so")
    parser.add_argument("--before", help="a checkout of an earlier version")
    given = parser.parse_args()
    torch.set_num_threads(THREADS)
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, ")
    print(f"NumPy {np.__version__}, Numba {numba.__version__}, PyTorch {torch.__version__}\n")
    cases: dict[str, Callable[[], Case]] = {
        "arrays": lambda: arrays("plain", given.before),
        "arrays, mask": lambda: arrays("mask", given.before),
        "module, float32": lambda: module("float32"),
        "module, 8 bits": lambda: module("uint8"),
        "steps, float32": lambda: steps("float32"),
        "steps, 8 bits": lambda: steps("uint8"),
        "masks, views": lambda: masks("at the views"),
        "masks, mid-path": lambda: masks("in mid-path"),
    }
    for size, shape in (("large", SHAPE), ("small", (9, 9, 200, 200, 3))):
        for kind in ("float32", "uint8"):
            for place in ("at the views", "in mid-path"):
                cases[f"at once, {size}, {kind}, {place}"] = partial(at_once, kind, shape, place)
    for name, case in cases.items():
        if name.startswith(given.case):
            timed(case(), given.rounds)


if __name__ == "__main__":
    main()
