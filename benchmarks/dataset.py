"""Processor time of a pair of a data set, and what it is spent on.

    pip install .
    python benchmarks/dataset.py                    # about a minute; prints Markdown
    python benchmarks/dataset.py --executor processes --count 1000    # wall time on all cores

Pairs of 256×256 pixels, RGB, from the desk of the docs (9×9 views of 320×480 pixels) through 64 coded apertures
of 13×13 cells, with windows, flips and noise. Wanted: 10,000 pairs in ten minutes on two cores, which is 120 ms
of processor time for each.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import shutil
import tempfile
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import vcc
from vcc.camera import Camera
from vcc.dataset import make_dataset, open_dataset, recording_pairs, shards
from vcc.dataset.zarr_group import ZarrGroup
from vcc.store import open_store
from vcc.units import mm, ms

DESK = Path(__file__).parents[1] / "docs" / "data" / "desk.zarr"
WANTED = 120.0
"""Milliseconds of processor time for a pair: ten minutes on two cores for 10,000."""
STEPS = (
    ("light on the sensor", Camera, "capture"),
    ("of it, plans", Camera, "compile"),
    ("of it, the sharp image", recording_pairs.Recorder, "_sharp"),
    ("of it, a uniform scene, once for each camera", recording_pairs.Recorder, "_white"),
    ("noise", recording_pairs, "expose_image"),
    ("depth", recording_pairs.Recorder, "_depth"),
    ("writing", shards, "_add"),
    ("writing", ZarrGroup, "_put"),
)


def camera_of(field: vcc.store.StoredLightField) -> tuple[vcc.Camera, list[np.ndarray]]:
    random = np.random.default_rng(0)
    codes = [random.integers(0, 2, (13, 13)).astype(float) for _ in range(64)]
    rows, columns = field.shape[2:4]
    pitch = abs(field.frame.linear[2, 2]) * 50 * mm
    elements = [vcc.Lens(50 * mm, name="main"), vcc.Mask(codes[0], width=18 * mm, name="code")]
    sensor = vcc.Sensor(0, (rows, columns), pitch, electronics=vcc.Electronics())
    return vcc.Camera.focused(elements, sensor, 1.0), codes


def processor() -> float:
    """Seconds of this process and of the workers that have ended."""
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in spent)


def timed(owner: object, name: str, spent: dict[str, float], words: str) -> None:
    function = getattr(owner, name)

    def measured(*arguments: object, **options: object) -> object:
        began = time.process_time()
        try:
            return function(*arguments, **options)
        finally:
            spent[words] = spent.get(words, 0.0) + time.process_time() - began

    setattr(owner, name, measured)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--executor", choices=("none", "processes"), default="none")
    parser.add_argument("--kind", choices=("webdataset", "zarr"), default="webdataset")
    asked = parser.parse_args()
    warnings.simplefilter("ignore", vcc.ResultWarning)
    field = open_store(DESK)
    camera, codes = camera_of(field)
    settings = {
        "crop": (256, 256),
        "flips": True,
        "exposure": 10 * ms,
        "radiance": 0.01,
        "truth": ("sharp", "depth"),
        "kind": asked.kind,
    }
    folder = Path(tempfile.mkdtemp())
    spent: dict[str, float] = {}

    def make(name: str, count: int, **more: object) -> tuple[float, float]:
        wall, used = time.perf_counter(), processor()
        make_dataset(folder / name, camera, field, {"code.pattern": codes}, count=count, **settings, **more)
        return (time.perf_counter() - wall) / count * 1e3, (processor() - used) / count * 1e3

    try:
        make("warm", 10, threads=1)
        if asked.executor == "none":
            for words, owner, name in STEPS:
                timed(owner, name, spent, words)
            wall, used = make("pairs", asked.count, threads=1)
        else:
            with ProcessPoolExecutor(None, get_context("spawn")) as executor:
                before = processor()
                wall, _ = make("pairs", asked.count, executor=executor)
            used = (processor() - before) / asked.count * 1e3  # of workers that have ended
        size = sum(each.stat().st_size for each in (folder / "pairs").rglob("*") if each.is_file()) / asked.count
        pairs, began = open_dataset(folder / "pairs"), time.process_time()
        for pair in pairs:
            pair["recording"]
        spent["reading it again"] = time.process_time() - began
    finally:
        shutil.rmtree(folder)
    print(
        f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {asked.count} pairs\n"
    )
    print("| of a pair | processor [ms] |\n|---|---|")
    for words, seconds in spent.items():
        print(f"| {words} | {seconds / asked.count * 1e3:.1f} |")
    print(f"| all | {used:.1f} (wanted: {WANTED:.0f}) |\n")
    print(f"Wall time {wall:.1f} ms, {size / 1e6:.2f} MB for a pair.")


if __name__ == "__main__":
    main()
