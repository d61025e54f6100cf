"""Opening a folder of 9×9 PNGs of 512×512 pixels, against decoding the same files with the same library.

    python benchmarks/reading.py                 # pictures of its own, a minute; prints Markdown
    python benchmarks/reading.py FOLDER          # any folder of PNGs that open_light_field knows

The peer decodes on two threads and keeps the pictures. Opening also checks by parallax that the views are in
order and looks for disparities that its cameras could not see; "as linear light" also undoes the sRGB curve into
float32, four times the memory. All take turns, and the fastest of each counts: other programs on the machine only
ever add. The processor time of all threads is given too.
"""

from __future__ import annotations

import argparse
import platform
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import imagecodecs
import numpy as np

import vcc
import vcc.errors
import vcc.formats

THREADS = 2


def write_views(folder: Path, views: int = 9, pixels: int = 512) -> None:
    """Views of a plane with texture and a little noise, as an HCI folder without its camera file."""
    from scipy import ndimage

    rng = np.random.default_rng(1)
    margin = 2 * views
    texture = np.zeros((pixels + 2 * margin, pixels + 2 * margin, 3))
    for size in (2, 6, 20):
        texture += ndimage.gaussian_filter(rng.standard_normal(texture.shape), (size, size, 0)) * size
    texture = 20 + 180 * (texture - texture.min()) / np.ptp(texture)
    for row in range(views):
        for column in range(views):
            top, left = margin + 2 * (row - views // 2), margin + 2 * (column - views // 2)
            picture = texture[top : top + pixels, left : left + pixels] + rng.normal(0, 1, (pixels, pixels, 3))
            data = imagecodecs.png_encode(np.clip(np.rint(picture), 0, 255).astype(np.uint8))
            (folder / f"input_Cam{row * views + column:03d}.png").write_bytes(data)


def decode_all(files: list[Path]) -> list[object]:
    """What the peer does: the library, two threads, the pictures kept."""
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(lambda file: imagecodecs.png_decode(file.read_bytes()), files))


def fastest(steps: dict[str, Callable[[], object]], runs: int) -> dict[str, tuple[float, float]]:
    """(wall, processor) seconds of each step: the fastest of several turns."""
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in steps}
    for _ in range(runs + 1):
        for name, step in steps.items():
            wall, processor = time.perf_counter(), time.process_time()
            step()
            times[name].append((time.perf_counter() - wall, time.process_time() - processor))
    return {name: (min(t[0] for t in found[1:]), min(t[1] for t in found[1:])) for name, found in times.items()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, help="a folder of PNGs")
    parser.add_argument("--runs", type=int, default=7)
    given = parser.parse_args()
    warnings.simplefilter("ignore", vcc.errors.ResultWarning)
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or Path(temporary)
        if given.folder is None:
            write_views(folder)
        files = [file for row in vcc.formats.read_geometry(folder).files for file in row if file is not None]
        steps: dict[str, Callable[[], object]] = {
            "decode the PNGs, two threads": lambda: decode_all(files),
            "open, samples as stored": lambda: vcc.open_light_field(folder, transfer="linear"),
            "open, as linear light": lambda: vcc.open_light_field(folder),
        }
        found = fastest(steps, given.runs)
    peer = found["decode the PNGs, two threads"]
    print(f"{platform.machine()}, Python {sys.version.split()[0]}, {len(files)} pictures; the target is 1.2.\n")
    print("| | wall | ratio | processor | ratio |\n|---|---|---|---|---|")
    for name, (wall, processor) in found.items():
        print(f"| {name} | {wall:.3f} s | {wall / peer[0]:.2f} | {processor:.3f} s | {processor / peer[1]:.2f} |")


if __name__ == "__main__":
    main()
