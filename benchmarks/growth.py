"""How costs grow with sizes in ordinary use: exponents of the cost against the work it should be proportional to.

    pip install .
    python benchmarks/growth.py            # some three minutes; prints Markdown

Each row makes one thing larger, all else as in the case of the other benchmarks: 9×9 views of 200×200 pixels, a
lens, a sensor of 200×200 pixels. Work is what the cost should be proportional to, such as the number of cells of a
mask. The exponent is that of cost ~ workᵉ, fitted to the sizes that take more than 5 ms: below, fixed costs are
most of it. Costs are the smallest of some runs, planning included.
"""

from __future__ import annotations

import argparse
import math
import os
import platform
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import vcc
from vcc.store import open_store, save_store
from vcc.units import mm

FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(50 * mm, diameter=8 * mm)
TOO_SHORT = 5e-3
"""Seconds below which fixed costs are most of a run."""
WANTED = 1.2


@dataclass(frozen=True)
class Row:
    """What grows.

    Args:
        name: of it.
        sizes: rising.
        work: what the cost of a size should be proportional to.
        made: what is timed, of a size.
    """

    name: str
    sizes: tuple[int, ...]
    work: Callable[[int], float]
    made: Callable[[int], Callable[[], Any]]


def field(views: int = 9, pixels: int = 200, channels: int = 1) -> vcc.LightField:
    """Noise over a width of 9 mm that sees as much whatever the number of pixels."""
    values = np.random.default_rng(0).random((views, views, pixels, pixels, channels), dtype=np.float32)
    return vcc.LightField.from_views(values, 9 * mm / views, 0.2 / pixels, 1.0, disparity_range=(-0.5, 0.5))


def camera(*elements: Any, sensor: int = 200, z: float = FOCUS) -> vcc.Camera:
    """A lens, other elements, and a sensor that sees as much whatever the number of its pixels."""
    return vcc.Camera([LENS, *elements], vcc.Sensor(z, (sensor, sensor), z * 0.2 / sensor))


def cells(number: int, z: float) -> vcc.Mask:
    values = (np.random.default_rng(1).random((number, number)) < 0.5).astype(np.float32)
    return vcc.Mask(values, width=8 * mm, z=z)


def masks(number: int) -> list[vcc.Mask]:
    """Smooth ones in mid-path."""
    return [
        vcc.Mask(vcc.patterns.CosineSum((3 * mm, 4 * mm), 1, n), z=FOCUS * (n + 1) / (number + 1))
        for n in range(number)
    ]


def rays(samples: int, sensor: int = 200) -> Callable[[], Any]:
    views = field()
    return lambda: camera(sensor=sensor).capture(views, method="rays", samples=samples)


def zernike(terms: int) -> Callable[[], Any]:
    # The same detail whatever their number: coefficients fall as those of a random surface do
    amplitudes = np.random.default_rng(2).normal(size=terms) * 2e-7 / (1 + np.arange(terms)) ** 1.5
    plate, views = vcc.PhasePlate(vcc.surfaces.Zernike(tuple(amplitudes), 8 * mm)), field()
    return lambda: camera(plate).compile(views, samples=16)


def transpose(pixels: int) -> Callable[[], Any]:
    operator = camera(sensor=pixels).operator(field(pixels=pixels))
    picture = np.ones((pixels, pixels, 1), dtype=np.float32)
    return lambda: operator.T(picture)


def sweep(number: int) -> Callable[[], Any]:
    views, one = field(5, 40), camera(vcc.Mask(np.eye(3), 8 * mm, name="code"), sensor=40)
    values = [np.random.default_rng(n).random((3, 3)) for n in range(number)]
    return lambda: len(vcc.sweep(one, views, {"code.pattern": values}))


def rows(folder: Path) -> Iterator[Row]:
    """All that grows."""

    def capture(camera_of: Callable[[int], vcc.Camera], field_of: Callable[[int], vcc.LightField]) -> Any:
        def made(size: int) -> Callable[[], Any]:
            views, seen_by = field_of(size), camera_of(size)
            return lambda: seen_by.capture(views)

        return made

    def always(_: int) -> vcc.LightField:
        return field()

    def saved(pixels: int) -> Callable[[], Any]:
        views = field(pixels=pixels)
        return lambda: save_store(views, folder / f"{pixels}.zarr", overwrite=True)

    def read(pixels: int) -> Callable[[], Any]:
        saved(pixels)()
        return lambda: open_store(folder / f"{pixels}.zarr")[:]

    def square(size: int) -> float:
        return size**2

    yield Row("views a side", (5, 9, 17, 33), square, capture(lambda _: camera(), field))
    yield Row(
        "pixels of a view, a side",
        (100, 200, 400, 800),
        square,
        capture(lambda _: camera(), lambda n: field(pixels=n)),
    )
    yield Row(
        "pixels of the sensor, a side", (400, 800, 1600, 3200), square, capture(lambda n: camera(sensor=n), always)
    )
    yield Row(
        "the same, out of focus",
        (400, 800, 1600, 3200),
        square,
        capture(lambda n: camera(sensor=n, z=50 * mm), always),
    )
    yield Row("channels", (1, 3, 12), float, capture(lambda _: camera(), lambda n: field(channels=n)))
    yield Row(
        "cells of a mask at the views, a side",
        (500, 2000, 8000),
        square,
        capture(lambda n: camera(cells(n, 0)), always),
    )
    yield Row(
        "cells of a mask in mid-path, a side",
        (500, 2000, 8000),
        square,
        capture(lambda n: camera(cells(n, 20 * mm)), always),
    )
    yield Row("masks in mid-path", (1, 2, 4, 8), float, capture(lambda n: camera(*masks(n)), always))
    yield Row("rays a pixel", (16, 64, 256), float, rays)
    yield Row("pixels of the sensor by rays, a side", (200, 400, 800), square, lambda n: rays(16, n))
    yield Row("terms of a Zernike plate (the plan)", (25, 50, 100, 200), float, zernike)
    yield Row("going back: pixels of a view and the sensor, a side", (200, 400, 800), square, transpose)
    yield Row("cameras of a sweep", (100, 400, 1600), float, sweep)
    yield Row("a store written: pixels of a view, a side", (100, 200, 400), square, saved)
    yield Row("a store read: pixels of a view, a side", (100, 200, 400), square, read)


def cost(run: Callable[[], Any], turns: int) -> float:
    """Seconds of the quickest run."""
    found = math.inf
    for _ in range(turns):
        start = time.perf_counter()
        run()
        found = min(found, time.perf_counter() - start)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--row", help="only rows in whose names this stands")
    given = parser.parse_args()
    warnings.simplefilter("ignore", vcc.ResultWarning)
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}\n")
    print(f"| what grows | costs | exponent, wanted at most {WANTED} |\n|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for row in rows(Path(folder)):
            if given.row and given.row not in row.name:
                continue
            row.made(row.sizes[0])()  # compiles, and imports
            costs = [cost(row.made(size), given.turns) for size in row.sizes]
            works = [row.work(size) for size in row.sizes]
            long = [
                (math.log(work), math.log(took))
                for work, took in zip(works, costs, strict=True)
                if took > TOO_SHORT
            ]
            exponent = float(np.polyfit(*np.transpose(long), 1)[0]) if len(long) > 1 else math.nan
            said = "fixed costs" if len(long) < 2 else f"{exponent:.2f}" + " **above**" * (exponent > WANTED)
            each = ", ".join(f"{size}: {1e3 * took:.3g} ms" for size, took in zip(row.sizes, costs, strict=True))
            print(f"| {row.name} | {each} | {said} |", flush=True)


if __name__ == "__main__":
    main()
