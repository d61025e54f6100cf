"""Exposures of moving cameras beside loops of captures of the same moments, in turns in the same run.

    pip install .
    python benchmarks/moving.py            # about a minute; prints Markdown
    python benchmarks/moving.py --quick    # a smaller light field

The light field has 9×9 views of 200×200 pixels, RGB, float32, in memory, and once in a store. Both make the same
pictures: the loop captures at the moments that `vcc.MovingCamera.capture` chose, and adds up. Wall time, and time
of the processor in this program (on a machine that others use, too, it says more); medians of the turns.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import vcc
from vcc.motion import Lines
from vcc.units import mm, ms

EXPOSURE = 90 * ms
RANDOM = np.random.default_rng(0)


@dataclass(frozen=True, eq=False, repr=False)
class Noted(vcc.MovingCamera):
    """A moving camera that notes at which times it was asked for."""

    times: list[float] = field(default_factory=list)

    def at(self, time: float) -> vcc.Camera:
        self.times.append(time)
        return super().at(time)


@dataclass(frozen=True)
class Case:
    """A camera that moves before a light field."""

    name: str
    moving: vcc.MovingCamera
    light_field: Any
    options: dict[str, Any] = field(default_factory=dict)

    def together(self) -> None:
        self.moving.capture(self.light_field, EXPOSURE, **self.options)

    def moments(self) -> list[vcc.Camera]:
        noted = Noted(self.moving.camera, self.moving.courses, self.moving.shutter)
        noted.times.clear()
        noted.capture(self.light_field, EXPOSURE, **self.options)
        return [self.moving.at(time) for time in noted.times if time > 0]  # at 0 s it is only looked at

    def loop(self, cameras: list[vcc.Camera]) -> None:
        options = {name: value for name, value in self.options.items() if name != "time_tolerance"}
        total: Any = 0.0
        for camera in cameras:
            total = total + camera.capture(self.light_field, **options).values.astype(np.float64)


def cases(side: int, folder: Path) -> list[Case]:
    views = RANDOM.random((9, 9, side, side, 3), dtype=np.float32)
    pixels = {"spacing": 1 * mm, "slope_per_pixel": 0.4 / side, "disparity_range": (-0.5, 0.5)}
    light_field = vcc.LightField.from_views(views, **pixels)
    stored = vcc.store.save_store(light_field, folder / "field.zarr")
    sensor = vcc.Sensor(z=52 * mm, shape=(side, side), pitch=20 * mm / side)
    lens = vcc.Lens(50 * mm, name="main")
    at_views = vcc.Mask(RANDOM.random((31, 31)), width=10 * mm, name="code")
    between = vcc.Mask(RANDOM.random((31, 31)), width=16 * mm, z=40 * mm, name="code")
    plain, coded, masked = (vcc.Camera([lens, *more], sensor) for more in ([], [at_views], [between]))
    sweep = {"sensor.z": Lines([0, EXPOSURE], [51 * mm, 53 * mm])}
    glide = {"code.decentre": lambda t: (2 * mm * (t / EXPOSURE - 0.5), 0.0)}
    rays = {"method": "rays", "samples": 8, "time_tolerance": 1.0}
    return [
        Case("a sensor that sweeps", vcc.MovingCamera(plain, sweep), light_field),
        Case("the same from a store", vcc.MovingCamera(plain, sweep), stored),
        Case("the same, a mask at the views", vcc.MovingCamera(coded, sweep), light_field),
        Case("the same, a mask in mid-path", vcc.MovingCamera(masked, sweep), light_field),
        Case("a mask at the views that glides", vcc.MovingCamera(coded, glide), light_field),
        Case("a mask in mid-path that glides", vcc.MovingCamera(masked, glide), light_field),
        Case("a sensor that sweeps, by rays", vcc.MovingCamera(plain, sweep), light_field, rays),
    ]


def each(step: Callable[[], None]) -> tuple[float, float]:
    """Milliseconds: of the clock, of the processor."""
    wall, processor = time.perf_counter(), time.process_time()
    step()
    return (time.perf_counter() - wall) * 1e3, (time.process_time() - processor) * 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a smaller light field")
    parser.add_argument("--turns", type=int, default=5)
    asked = parser.parse_args()
    warnings.simplefilter("ignore", vcc.ResultWarning)
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}\n")
    print("| what moves | moments | loop [ms] | exposure [ms] | times faster | by the processor's time |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for case in cases(100 if asked.quick else 200, Path(folder)):
            cameras = case.moments()
            loop = partial(case.loop, cameras)
            loop()
            turns = [(each(loop), each(case.together)) for _ in range(asked.turns)]
            alone, exposed = (statistics.median(turn[n][0] for turn in turns) for n in (0, 1))
            ratios = [statistics.median(turn[0][n] / turn[1][n] for turn in turns) for n in (0, 1)]
            figures = f"{alone:.0f} | {exposed:.0f} | {ratios[0]:.1f} | {ratios[1]:.1f}"
            print(f"| {case.name} | {len(cameras)} | {figures} |", flush=True)


if __name__ == "__main__":
    main()
