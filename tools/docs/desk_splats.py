"""Convert the desk (docs/data/desk.zarr) to Gaussian splats, docs/data/desk.spz: python tools/docs/desk_splats.py.

Each pixel of the middle view becomes a ball of its colour at its distance, 0.45 pixels in standard deviation. From
the views at the corners come the pixels that the middle view does not show: those that are behind its objects, and
those beyond its borders. Distances are those of render_desk.py (Mitsuba), of glass those of its surface. The
colours of the middle view's balls are then corrected ten times by what its image lacks, since balls overlap.

Colours are the radiance as rendered, in sRGB codes up to 1.4. The file is .spz version 3 (README of
nianticlabs/spz): y up, z backwards, in metres. The array of desk.zarr stands at the origin. The program prints the
difference from views of desk.zarr that were not used.
"""

from __future__ import annotations

import gzip
import struct
import tempfile
from pathlib import Path
from typing import Any

import desk_scene
import numpy as np
import render_desk
from numpy.typing import NDArray

from vcc.base.measures import decibels
from vcc.files.transfer import from_linear, to_linear
from vcc.sources import ViewCamera
from vcc.sources.mitsuba import MitsubaRenderer
from vcc.sources.splats import Splats, SplatScene
from vcc.sources.splats.cloud import DEGREE_0
from vcc.store import StoredLightField, open_store

KEPT = Path(__file__).parents[2] / "docs" / "data" / "desk.spz"
FRACTION = 13
"""Bits of fractions of a metre: 0.12 mm, a seventh of a pixel at 0.8 m."""
WIDTH = 0.45
"""Standard deviation of a ball, pixels."""
BRIGHTEST = 1.4
"""Largest sRGB code that the format stores."""
MIDDLE, CORNERS = (4, 4), ((0, 0), (0, 8), (8, 0), (8, 8))
OTHERS = ((4, 2), (2, 6), (8, 4))

Array = NDArray[Any]


def radiance(desk: StoredLightField, place: tuple[int, int]) -> Array:
    """A view as it was rendered, but no brighter than the format stores, with its colour."""
    (row, column), full_scale = place, desk.provenance["full_scale"]
    rendered = desk[row : row + 1, column : column + 1].values[0, 0] * full_scale
    return np.asarray(
        rendered * np.minimum(to_linear(BRIGHTEST) / np.maximum(rendered.max(axis=-1, keepdims=True), 1e-9), 1)
    )


def points(camera: ViewCamera, depth: Array) -> Array:
    """Places of a view's pixels, (rows, columns, 3): x right, y down, distance from the entrance plane."""
    rows, columns = depth.shape
    across = camera.left + (np.arange(columns) + 0.5) / columns * (camera.right - camera.left)
    down = camera.top + (np.arange(rows) + 0.5) / rows * (camera.bottom - camera.top)
    x, y = np.meshgrid(across, down)
    return np.stack([camera.x + x * depth, camera.y + y * depth, depth], axis=-1)


def hidden(places: Array, camera: ViewCamera, depth: Array) -> Array:
    """Which places a view does not show: behind what it shows, by more than 2 %, or beyond its borders."""
    rows, columns = depth.shape
    x = ((places[..., 0] - camera.x) / places[..., 2] - camera.left) / (camera.right - camera.left) * columns - 0.5
    y = ((places[..., 1] - camera.y) / places[..., 2] - camera.top) / (camera.bottom - camera.top) * rows - 0.5
    column, row = np.rint(x).astype(int), np.rint(y).astype(int)
    beyond = (column < 0) | (column >= columns) | (row < 0) | (row >= rows)
    there = depth[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
    return beyond | (places[..., 2] > 1.02 * there)


def splats(places: Array, codes: Array, widths: Array) -> Splats:
    """Balls of display-referred colours, in axes with y up and z backwards."""
    count = len(places)
    return Splats(
        (places * [1, -1, -1]).astype(np.float32),
        np.repeat(widths[:, None], 3, axis=1).astype(np.float32),
        np.repeat(np.array([[1, 0, 0, 0]], np.float32), count, axis=0),
        np.full(count, 0.95, np.float32),
        ((codes[:, None] - 0.5) / DEGREE_0).astype(np.float32),
        up=(0.0, 1.0, 0.0),
    )


def packed(cloud: Splats) -> bytes:
    """The file, .spz version 3, degree 0."""
    fixed = np.rint(cloud.positions.astype(np.float64) * 2**FRACTION).astype("<i4")
    places = fixed.view(np.uint8).reshape(-1, 3, 4)[..., :3]
    colours = np.clip(np.rint((cloud.harmonics[:, 0] * 0.15 + 0.5) * 255), 0, 255).astype(np.uint8)
    sizes = np.clip(np.rint((np.log(cloud.sizes) + 10) * 16), 0, 255).astype(np.uint8)
    alphas = np.rint(cloud.opacities * 255).astype(np.uint8)
    turns = np.full(len(places), 3 << 30, "<u4")  # w is the largest
    head = struct.pack("<4sIIBBBB", b"NGSP", 3, len(places), 0, FRACTION, 0, 0)
    parts = (places, alphas, colours, sizes, turns)
    return gzip.compress(head + b"".join(part.tobytes() for part in parts), 9, mtime=0)


def main() -> None:
    """Convert, print how it goes, keep."""
    desk = open_store(Path(__file__).parents[2] / "docs" / "data" / "desk.zarr")
    cameras = desk_scene.cameras()
    with tempfile.TemporaryDirectory() as folder:
        renderer = MitsubaRenderer(desk_scene.scene(Path(folder)), samples=1, variant="scalar_rgb")
        depths = {place: render_desk.distances(renderer, cameras.camera(*place)) for place in (MIDDLE, *CORNERS)}
    views = {place: radiance(desk, place) for place in depths}
    slope = cameras.slopes_per_pixel[1]
    middle = cameras.camera(*MIDDLE)
    places = [points(middle, depths[MIDDLE]).reshape(-1, 3)]
    codes = [from_linear(views[MIDDLE]).reshape(-1, 3)]
    shown = [MIDDLE]
    for corner in CORNERS:
        there = points(cameras.camera(*corner), depths[corner])
        new = np.all([hidden(there, cameras.camera(*place), depths[place]) for place in shown], axis=0)
        places.append(there[new])
        codes.append(from_linear(views[corner])[new])
        shown.append(corner)
        print(f"{corner}: {new.sum()} pixels that no view before it shows")
    at, colour = np.concatenate(places), np.concatenate(codes)
    widths = WIDTH * slope * at[:, 2]
    wanted, own = codes[0].copy(), len(codes[0])
    for _ in range(10):
        scene = SplatScene(splats(at, colour, widths), transfer="linear")
        lacks = wanted - scene.render(middle).reshape(-1, 3)
        print(f"middle view: {decibels(float(np.mean(lacks**2)), 1):.1f} dB of full scale, sRGB")
        colour[:own] = np.clip(colour[:own] + 0.5 * lacks, 0, BRIGHTEST)
    data = packed(splats(at, colour, widths))
    KEPT.write_bytes(data)
    print(f"{KEPT}: {len(at)} splats, {len(data) / 1e6:.2f} MB")
    scene = SplatScene(KEPT, transfer="linear")
    for place in (MIDDLE, *OTHERS):
        off = np.minimum(scene.render(cameras.camera(*place)), 1) - np.minimum(
            from_linear(radiance(desk, place)), 1
        )
        print(f"view {place}: {decibels(float(np.mean(off**2)), 1):.1f} dB")


if __name__ == "__main__":
    main()
