"""Draw one camera in front of one scene by each way to a light field: python tools/docs/scene_ways_images.py.

The reference are the rendered views of the desk. All other light fields have the same grid of 9×9 views. The
program prints how far each image is from that of the reference, and the processor time of its light field. Run
webp.py after it.
"""

from __future__ import annotations

import json
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import desk_scene
import imagecodecs
import numpy as np
import panels
from missing_views_images import star_of

import vcc
from vcc.base.errors import ResultWarning
from vcc.base.measures import decibels
from vcc.files.transfer import encode, from_linear
from vcc.formats import SparseViews, open_unstructured
from vcc.sources import DepthMapScene, synthesize
from vcc.sources.splats import SplatScene
from vcc.units import mm, um

HERE = panels.DOCS / "images" / "your-scene"
NEAREST, FARTHEST = 0.4, 60.0
PHOTOGRAPHS = 30
PART = np.s_[20:180, 20:260]
"""The part that is shown enlarged: leaves out of focus, in front of a town out of focus."""


def photographs(desk: vcc.LightField, folder: Path) -> vcc.LightField:
    """Some views of the desk, at random places, as photographs with poses, resampled onto the grid of all."""
    cameras = desk_scene.cameras()
    rows, columns = cameras.pixels
    corners = [(0, 0), (0, 8), (8, 0), (8, 8)]
    others = np.random.default_rng(0).permutation(81)[: PHOTOGRAPHS - len(corners)]
    frames = []
    for row, column in sorted({*corners, *(divmod(int(n), 9) for n in others)}):
        camera, name = cameras.camera(row, column), f"{row}_{column}.png"
        codes = encode(np.asarray(desk.values[row, column], np.float32), 16)
        (folder / name).write_bytes(imagecodecs.png_encode(codes))
        focal = columns / (camera.right - camera.left)
        frames.append(
            {
                "file_path": name,
                "transform_matrix": [[1, 0, 0, camera.x], [0, 1, 0, -camera.y], [0, 0, 1, 0], [0, 0, 0, 1]],
                "cx": -camera.left * focal,
                "cy": -camera.top * focal,
            }
        )
    said = {"fl_x": focal, "w": columns, "h": rows, "frames": frames}
    (folder / "transforms.json").write_text(json.dumps(said))
    views = open_unstructured(folder, metres_per_unit=1.0)
    return views.on_grid(
        (9, 9), cameras.spacing, distances=(NEAREST, FARTHEST), focus_distance=cameras.focus_distance
    )


def main(folder: Path = HERE) -> None:
    """Draw the same camera through each light field."""
    folder.mkdir(parents=True, exist_ok=True)
    stored, cameras = panels.desk(), desk_scene.cameras()
    full, desk = panels.white(stored), stored.read()
    star = star_of(9)
    places = tuple((int(row), int(column)) for row, column in np.argwhere(star))
    disparity = stored.disparity.maps()

    def of_depth() -> vcc.LightField:
        view = np.asarray(desk.values[4, 4], np.float32)
        return synthesize(DepthMapScene.from_disparity(view, disparity.values[0], cameras), cameras)

    def of_splats() -> vcc.LightField:
        return synthesize(SplatScene(panels.DOCS / "data" / "desk.spz"), cameras)

    def of_photographs() -> vcc.LightField:
        with tempfile.TemporaryDirectory() as place:
            return photographs(desk, Path(place))

    ways: dict[str, tuple[float, Callable[[], vcc.LightField]]] = {
        "rendered by Mitsuba": (full, lambda: desk),
        "Gaussian splats": (1.0, of_splats),
        f"{PHOTOGRAPHS} photographs with poses": (full, of_photographs),
        "33 of 81 views, filled": (
            full,
            lambda: SparseViews(desk.values[star], places, star.shape, desk.frame).light_field(),
        ),
        "one picture and its depth": (full, of_depth),
    }
    camera = vcc.Camera.focused(
        [vcc.Lens(focal_length=50 * mm, diameter=16 * mm)], vcc.Sensor(0, (320, 480), 54 * um), desk_scene.FOCUS
    )
    lens = np.pi * 0.25 * (16e-3) ** 2 / camera.sensor.z**2  # of radiance 1
    shown = {}
    for name, (white, make) in ways.items():
        began = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResultWarning)
            light_field = make()
            took = time.process_time() - began
            image = camera.capture(light_field, between_views="depth").upright().to_numpy()
        shown[name] = np.clip(from_linear(image * white / lens), 0, 1)
        off = np.mean((shown[name] - shown["rendered by Mitsuba"]) ** 2)
        print(f"{name}: {decibels(float(off)):.1f} dB, {took:.1f} s of processor time")
    figure = panels.new_figure(15, 4.6)
    axes = figure.subplots(2, len(ways))
    for place, (name, image) in zip(axes.T, shown.items(), strict=True):
        panels.picture(place[0], image, name)
        panels.picture(place[1], image[PART], "", interpolation="nearest")
    figure.savefig(folder / "ways.png")


if __name__ == "__main__":
    main()
