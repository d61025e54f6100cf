"""A light-field video on disk: how long it takes to open many frames, and what a frame costs beside its samples.

    python benchmarks/video_store.py [--folder /somewhere/with/room] [--frames 10000]

Frames of 9×9 views are saved as stores, and appended to a video, in turns; then a frame is copied, by links, until
there are many, and the video is opened.
"""

from __future__ import annotations

import argparse
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import vcc
from vcc.files.parts import settle
from vcc.store import create_video, open_video, save_store
from vcc.store.video_layout import Place

TURNS = 7


def main() -> None:
    """All of it, in a folder that is removed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=None)
    parser.add_argument("--frames", type=int, default=10_000)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=given.folder) as folder:
        for height, width in ((60, 80), (200, 300)):
            appended(Path(folder), height, width)
        opened(Path(folder), given.frames)


def appended(folder: Path, height: int, width: int) -> None:
    """Frames appended, and the same light fields saved, in turns."""
    values = np.random.default_rng(0).random((9, 9, height, width, 3), dtype=np.float32)
    light_field = vcc.LightField.from_views(values, 1e-3, 1e-3)
    found: dict[str, list[float]] = {"saved": [], "settled": [], "appended": []}
    with create_video(folder / f"{height}.zarr") as video:
        for turn in range(TURNS):
            path = folder / f"{turn}.zarr"
            found["saved"].append(seconds(lambda path=path: save_store(light_field, path)))
            found["settled"].append(seconds(lambda path=path: settle(path)))
            found["appended"].append(seconds(lambda turn=turn: video.append(light_field, turn)))
            shutil.rmtree(path)
    middles = ", ".join(f"{name} in {np.median(times) * 1e3:.0f} ms" for name, times in found.items())
    print(f"9×9 views of {height}×{width}×3 float32, {values.nbytes / 1e6:.0f} MB: {middles} (medians of {TURNS})")


def opened(folder: Path, frames: int) -> None:
    """A video of many frames, all of them links to one."""
    path = folder / "many.zarr"
    light_field = vcc.LightField.from_views(np.ones((3, 3, 20, 30), np.float32), 1e-3, 1e-3)
    with create_video(path) as video:
        video.append(light_field, 0)
    first = path / Place.of(0, 0.0).name
    for number in range(1, frames):
        shutil.copytree(first, path / Place.of(number, number / 24).name, copy_function=os.link)
    times = [seconds(lambda: open_video(path)) for _ in range(TURNS)]
    found = open_video(path)
    one = [seconds(lambda n=n: found[n]) for n in range(0, frames, max(frames // 50, 1))]
    print(
        f"{len(found)} frames open in {np.median(times) * 1e3:.0f} ms, each when its turn comes in "
        f"{np.median(one) * 1e3:.1f} ms"
    )


def seconds(work: Callable[[], object]) -> float:
    """How long something takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
