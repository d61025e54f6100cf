"""A light field larger than memory: 6 GB in a store, captured by a process that may not have more than 1.5 GB.

    python benchmarks/store.py [--folder /somewhere/with/room] [--gigabytes 6] [--limit-gigabytes 1.5] [--keep]

The store is made view by view from one picture that moves with the view, in a process of its own. Then one process
for each camera, its address space limited (RLIMIT_AS), opens it and takes the picture: by footprints (a lens, a
mask in mid-path) and by rays (a lens and an array of lenses). Said are its time and its largest resident size
(VmHWM).
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import vcc
from vcc.patterns import CosineSum
from vcc.units import mm

PIXELS = (1000, 1000)
ALONE = 0.5e9
"""Bytes that a capture is allowed. Address space is more than memory: libraries, compiled code, stacks of threads
and what the allocator keeps in reserve take some 0.8 GB of it before anything is read. (The children keep two
reserves, not one of 64 MB for each thread: that is address space and no memory.)"""
FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=9 * mm)
CAMERAS = {
    "lens": vcc.Camera([LENS], vcc.Sensor(FOCUS, PIXELS, FOCUS * 1e-3)),
    "mask in mid-path": vcc.Camera(
        [LENS, vcc.Mask(pattern=CosineSum((3 * mm, 3 * mm), 1, 0.3), z=FOCUS / 2)],
        vcc.Sensor(FOCUS, PIXELS, FOCUS * 1e-3),
    ),
    "array of lenses, by rays": vcc.Camera(
        [LENS, vcc.LensArray(focal_length=1 * mm, pitch=0.2 * mm, z=FOCUS - 1 * mm)],
        vcc.Sensor(FOCUS, (400, 400), FOCUS * 2.5e-3),
    ),
}


def make(path: Path, gigabytes: float) -> None:
    """Views of a flat scene, 12 MB each."""
    from vcc.sources import CameraArray
    from vcc.store import Lossless, create_store

    side = max(math.ceil((gigabytes * 1e9 / (PIXELS[0] * PIXELS[1] * 3 * 4)) ** 0.5), 2)
    cameras = CameraArray(
        views=(side, side), pixels=PIXELS, spacing=10 * mm / side, slope_per_pixel=1e-3, focus_distance=1.0
    )
    coarse = np.random.default_rng(0).random((130, 130, 3)).astype(np.float32)
    scene = np.kron(coarse, np.ones((10, 10, 1), dtype=np.float32))
    start = time.perf_counter()
    with create_store(
        path, cameras, (*cameras.shape, 3), "float32", provenance={"made_by": "benchmarks/store.py"},
        description={"scene": "flat"}, disparity_range=(-1.0, -1.0), compression=Lossless("lz4", 1),
    ) as writer:  # fmt: skip
        for row, column in writer.missing():
            writer.write_view(row, column, scene[row : row + PIXELS[0], column : column + PIXELS[1]])
        stored = writer.finish()
    seconds, memory = time.perf_counter() - start, np.prod(stored.shape) * 4 / 1e9
    print(
        f"made: {side}×{side} views of {PIXELS[0]}×{PIXELS[1]}×3 float32, {memory:.2f} GB in memory, "
        f"{stored.stored_bytes / 1e9:.2f} GB on disk, in {seconds:.0f} s ({memory / seconds * 1e3:.0f} MB/s)"
    )


def capture(path: Path, name: str, limit: float) -> None:
    """Take one picture in a process whose address space is limited."""
    import warnings

    import zarr  # noqa: F401  # opening is timed without importing

    from vcc.store import open_store

    warnings.simplefilter("ignore", vcc.ResultWarning)
    CAMERAS[name].capture(_tiny(), samples=4 if "rays" in name else None)  # compiles, or loads what was compiled
    before = _status("VmHWM")
    resource.setrlimit(resource.RLIMIT_AS, (int(limit), int(limit)))
    start = time.perf_counter()
    stored = open_store(path)
    opened = time.perf_counter() - start
    if name == "lens":
        try:
            stored.read()
        except vcc.InputError as error:
            print(f"  .read() in this process: {str(error)[:110]}…")
        else:
            print("  .read() in this process: went through (there is no limit to show)")
    start = time.perf_counter()
    samples = 16 if "rays" in name else None
    image = CAMERAS[name].capture(stored, memory_limit=int(ALONE), samples=samples)
    seconds = time.perf_counter() - start
    print(
        f"  {name}: opened in {opened * 1e3:.0f} ms; {seconds:.0f} s; resident at most "
        f"{_status('VmHWM') / 1e9:.2f} GB ({before / 1e9:.2f} GB before), address space at most "
        f"{_status('VmPeak') / 1e9:.2f} GB; mean {float(image.values.mean()):.4g}"
    )


def _tiny() -> vcc.LightField:
    values = np.full((3, 3, 16, 16, 3), 0.5, dtype=np.float32)
    return vcc.LightField.from_views(values, 3 * mm, 60e-3, 1.0, disparity_range=(-1.0, -1.0))


def _status(name: str) -> float:
    """Bytes that the system states of this process."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith(name))


def main() -> None:
    """Make the store, then a child for each camera."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()))
    options.add_argument("--gigabytes", type=float, default=6.0)
    options.add_argument("--limit-gigabytes", type=float, default=1.5)
    options.add_argument("--keep", action="store_true")
    options.add_argument("--capture", choices=list(CAMERAS), help=argparse.SUPPRESS)
    options.add_argument("--make", action="store_true", help=argparse.SUPPRESS)
    given = options.parse_args()
    path = given.folder / "vcc-benchmark.zarr"
    if given.make:
        return make(path, given.gigabytes)
    if given.capture:
        return capture(path, given.capture, given.limit_gigabytes * 1e9)
    again = [sys.executable, __file__, *sys.argv[1:]]
    try:
        subprocess.run([*again, "--make"], check=True)
        print(f"captured by processes of at most {given.limit_gigabytes:g} GB of address space:", flush=True)
        for name in CAMERAS:
            subprocess.run([*again, "--capture", name], check=True, env=os.environ | {"MALLOC_ARENA_MAX": "2"})
    finally:
        if not given.keep:
            shutil.rmtree(path, ignore_errors=True)
    return None


if __name__ == "__main__":
    main()
