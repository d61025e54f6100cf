"""Sweeps beside loops of captures, in turns in the same run.

    pip install .
    python benchmarks/sweep.py            # about a minute; prints Markdown
    python benchmarks/sweep.py --quick    # fewer cameras

The light field has 9×9 views of 200×200 pixels, RGB, float32. 1000 masks of 31×31 cells, at the views or in
mid-path, and 100 places of the sensor go through `vcc.sweep`, and every tenth of them through a loop of
`Camera.capture`. Wall time, and time of the processor in this program (on a machine that others use, too, it says
more); medians of the turns.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import vcc
from vcc.units import mm

RANDOM = np.random.default_rng(0)
VIEWS = RANDOM.random((9, 9, 200, 200, 3), dtype=np.float32)
FIELD = vcc.LightField.from_views(VIEWS, spacing=1 * mm, slope_per_pixel=0.002, disparity_range=(-0.5, 0.5))
SENSOR = vcc.Sensor(z=52 * mm, shape=(200, 200), pitch=0.1 * mm)
EVERY = 10
"""Of the cameras, those that the loop goes through."""


@dataclass(frozen=True)
class Case:
    """A sweep, and the factor by which it is to be faster."""

    name: str
    camera: vcc.Camera
    parameter: str
    values: list
    wanted: float

    def sweep(self) -> int:
        return len(vcc.sweep(self.camera, FIELD, {self.parameter: self.values}))

    def loop(self) -> int:
        some = self.values[::EVERY]
        for value in some:
            self.made(value).capture(FIELD)
        return len(some)

    def made(self, value: object) -> vcc.Camera:
        """As a user writes it in a loop."""
        if self.parameter == "sensor.z":
            return vcc.Camera(self.camera.elements, vcc.Sensor(z=value, shape=SENSOR.shape, pitch=SENSOR.pitch))
        mask = self.camera.elements[-1]
        return vcc.Camera([self.camera.elements[0], vcc.Mask(value, mask.width, z=mask.z, name="code")], SENSOR)


def cases(masks: int, places: int) -> list[Case]:
    lens, codes = vcc.Lens(50 * mm, name="main"), [RANDOM.random((31, 31)) for _ in range(masks)]
    at_views = vcc.Mask(codes[0], width=10 * mm, name="code")
    between = vcc.Mask(codes[0], width=16 * mm, z=40 * mm, name="code")
    z = list(np.linspace(50, 54, places) * mm)
    with_code, with_mask = vcc.Camera([lens, at_views], SENSOR), vcc.Camera([lens, between], SENSOR)
    return [
        Case(f"{masks} masks at the views", with_code, "code.pattern", codes, 5),
        Case(f"{masks} masks in mid-path", with_mask, "code.pattern", codes, 5),
        Case(f"{places} places of the sensor", vcc.Camera([lens], SENSOR), "sensor.z", z, 1.5),
        Case(f"{places} places of the sensor, a mask at the views", with_code, "sensor.z", z, 1.5),
        Case(f"{places} places of the sensor, a mask in mid-path", with_mask, "sensor.z", z, 1.5),
    ]


def each(step: Callable[[], int]) -> tuple[float, float]:
    """Milliseconds a camera: of the clock, of the processor."""
    wall, processor = time.perf_counter(), time.process_time()
    count = step()
    return (time.perf_counter() - wall) / count * 1e3, (time.process_time() - processor) / count * 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer cameras")
    parser.add_argument("--turns", type=int, default=3)
    asked = parser.parse_args()
    warnings.simplefilter("ignore", vcc.ResultWarning)
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}\n")
    print("| sweep | loop [ms] | sweep [ms] | times faster | by the processor's time | wanted |")
    print("|---|---|---|---|---|---|")
    for case in cases(200 if asked.quick else 1000, 40 if asked.quick else 100):
        case.sweep(), case.loop()
        turns = [(each(case.loop), each(case.sweep)) for _ in range(asked.turns)]
        loop, swept = (statistics.median(turn[n][0] for turn in turns) for n in (0, 1))
        ratios = [statistics.median(turn[0][n] / turn[1][n] for turn in turns) for n in (0, 1)]
        print(
            f"| {case.name} | {loop:.1f} | {swept:.1f} | {ratios[0]:.1f} | {ratios[1]:.1f} | {case.wanted} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
