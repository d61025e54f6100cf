"""Refocusing by slices of the 4-D spectrum against the sum over views, as views and pixels grow.

    python benchmarks/refocusing.py        # a minute; prints Markdown

The peers make the same picture from the views each time: `vcc.recover.refocused`, which is a camera's capture, and
views shifted by `scipy.ndimage.shift` (linear) and added. All take turns, and the fastest of each counts: other
programs on the machine only ever add.
"""

from __future__ import annotations

import argparse
import platform
import sys
import time
import warnings
from collections.abc import Callable

import numpy as np
from scipy import ndimage

import vcc
import vcc.errors
from vcc.analysis import Refocuser
from vcc.recover import refocused

SPACING, SLOPE, CONVERGENCE, FOCUS = 1e-3, 1e-3, 1.2, 0.9


def light_field(views: int, pixels: int) -> vcc.LightField:
    """Noise: what is in the views does not count."""
    values = np.random.default_rng(0).random((views, views, pixels, pixels), np.float32)
    return vcc.LightField.from_views(values, SPACING, SLOPE, CONVERGENCE, disparity_range=(-0.5, 0.5))


def shift_and_add(field: vcc.LightField) -> np.ndarray:
    """The textbook's way, one view after the other."""
    values = np.asarray(field.values)
    nv, nu = values.shape[:2]
    step = SPACING * (1 / FOCUS - 1 / CONVERGENCE) / SLOPE
    total = np.zeros(values.shape[2:], np.float32)
    for row in range(nv):
        for column in range(nu):
            away = step * (row - (nv - 1) / 2), step * (column - (nu - 1) / 2)
            total += ndimage.shift(values[row, column], away, order=1, mode="nearest")
    return total / (nv * nu)


def fastest(steps: dict[str, Callable[[], object]], runs: int) -> dict[str, float]:
    """Seconds of each step: the fastest of several turns, after one that does not count."""
    times: dict[str, list[float]] = {name: [] for name in steps}
    for _ in range(runs + 1):
        for name, step in steps.items():
            start = time.perf_counter()
            step()
            times[name].append(time.perf_counter() - start)
    return {name: min(found[1:]) for name, found in times.items()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    given = parser.parse_args()
    warnings.simplefilter("ignore", vcc.errors.ResultWarning)
    print(f"Python {platform.python_version()}, {platform.machine()}, one channel, fastest of {given.runs}\n")
    print("| views | pixels | transform, once | a focus by slice | `refocused` | shift and add (SciPy) |")
    print("|---|---|---|---|---|---|")
    for views, pixels in ((5, 256), (9, 256), (17, 256), (9, 128), (9, 512)):
        field = light_field(views, pixels)
        start = time.perf_counter()
        slices = Refocuser(field)
        once = time.perf_counter() - start
        found = fastest(
            {
                "slice": lambda slices=slices: slices.at(FOCUS),
                "capture": lambda field=field: refocused(field, FOCUS),
                "shift": lambda field=field: shift_and_add(field),
            },
            given.runs,
        )
        print(
            f"| {views}×{views} | {pixels}×{pixels} | {once:.2f} s | {1e3 * found['slice']:.1f} ms "
            f"| {1e3 * found['capture']:.1f} ms | {1e3 * found['shift']:.1f} ms |"
        )
        sys.stdout.flush()


if __name__ == "__main__":
    main()
