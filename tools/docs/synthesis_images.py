"""The pictures of docs/synthesis.md: our scenes, and refocused light fields beside Mitsuba's own thin lens.

python tools/docs/synthesis_images.py

Rendering takes some ten minutes on two cores with LLVM 16 or newer, and four times as long without.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from panels import DOCS, new_figure, picture

import vcc
from vcc.base.measures import psnr
from vcc.files.transfer import encode
from vcc.sources import CameraArray
from vcc.sources.mitsuba import SCENES, DemoScene, MitsubaRenderer, demo_scene
from vcc.sources.synthesis import synthesize

HERE = DOCS / "images" / "synthesis"
VIEWS, PIXELS, FINER, SAMPLES, LENS_SAMPLES = 16, (200, 300), 2, 4, 2048
"""Views a side, pixels of the pictures, how many of a view's pixels lie across one of theirs, paths per pixel."""
DISTANCES = (0.85, 1.3, 1.9)
"""Of sharp focus, metres: the bead, the gold ball, the globe."""

Picture = NDArray[np.float32]


def main(folder: Path = HERE) -> None:
    """Draw all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    draw_scenes(folder / "scenes.png")
    draw_comparison(folder / "thin-lens.png")


def refocused(
    light_field: vcc.LightField, cameras: CameraArray, diameter: float, distance: float, finer: int
) -> Picture:
    """The mean radiance over a round lens focused at a distance; ``finer`` pixels of a view lie across one."""
    focal_length = 50e-3
    z = 1 / (1 / focal_length - 1 / distance)
    camera = vcc.Camera(
        [vcc.Lens(focal_length=focal_length, diameter=diameter)],
        vcc.Sensor(
            z=z,
            shape=(cameras.pixels[0] // finer, cameras.pixels[1] // finer),
            pitch=z * cameras.slopes_per_pixel[1] * finer,
        ),
    )
    # A lens of area A seen from z gives L·A/z²: undone, the picture is a mean of radiance, as a renderer's is.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # some views miss the border, which is left out below
        image = camera.capture(light_field)
    return image.upright().values / (math.pi * diameter**2 / 4 / z**2)


def by_thin_lens(
    renderer: MitsubaRenderer, cameras: CameraArray, diameter: float, distance: float, samples: int
) -> Picture:
    """The mean radiance over the same lens by Mitsuba's own camera with a thin lens, pixels as the cameras'."""
    import mitsuba

    middle = CameraArray((1, 1), cameras.pixels, cameras.spacing, cameras.slope_per_pixel).camera(0, 0)
    mitsuba.set_variant(renderer.variant)
    given: dict[str, Any] = renderer.sensor_for(middle)
    for name in ("principal_point_offset_x", "principal_point_offset_y"):
        del given[name]  # 0 in the middle; a thinlens knows none
    given.update(type="thinlens", aperture_radius=diameter / 2, focus_distance=distance)
    parts, total = math.ceil(samples / 256), 0.0
    for part in range(parts):
        sensor = mitsuba.load_dict(given)
        total = total + np.array(mitsuba.render(renderer._scene, sensor=sensor, spp=256, seed=900 + part))
    return np.asarray(total, dtype=np.float32) / parts


def margin_of(cameras: CameraArray, distance: float) -> int:
    """Pixels at the border of a refocused picture that some views do not see."""
    return math.ceil(abs(cameras.disparity(distance)) * cameras.views[1] / 2) + 1


def draw_scenes(path: Path) -> None:
    """One view of each of our scenes."""
    figure = new_figure(9.6, 2.35, dpi=150)
    for axes, name in zip(figure.subplots(1, len(SCENES)), SCENES, strict=True):
        scene: DemoScene = demo_scene(name)
        cameras = scene.cameras((1, 1), (320, 480))
        renderer = MitsubaRenderer(scene.scene, samples=400)
        show(axes, renderer.render(cameras.camera(0, 0)), name)
    figure.savefig(path)


def draw_comparison(path: Path) -> None:
    """Refocused at three distances, Mitsuba's thin lens, and ten times the difference."""
    scene = demo_scene("still-life")
    renderer = MitsubaRenderer(scene.scene, samples=SAMPLES)
    pictures = scene.cameras((VIEWS, VIEWS), PIXELS)
    cameras = scene.cameras((VIEWS, VIEWS), (PIXELS[0] * FINER, PIXELS[1] * FINER))
    light_field = synthesize(renderer, cameras, dtype="float32")
    assert isinstance(light_field, vcc.LightField)
    figure = new_figure(9.6, 6.6, dpi=150)
    for row, distance in zip(figure.subplots(len(DISTANCES), 3), DISTANCES, strict=True):
        ours = refocused(light_field, cameras, scene.aperture, distance, FINER)
        theirs = by_thin_lens(renderer, pictures, scene.aperture, distance, LENS_SAMPLES)
        edge = margin_of(pictures, distance)
        within = slice(edge, -edge)
        ours, theirs = ours[within, within], theirs[within, within]
        decibels = psnr(ours.astype(float), theirs, peak=1.0)
        print(f"focus at {distance} m: {decibels:.1f} dB, margin of {edge} pixels")
        show(row[0], ours, f"light field, focused at {distance} m")
        show(row[1], theirs, "Mitsuba's thin lens")
        show(row[2], 0.214 + 10 * (ours - theirs), f"10 × the difference: {decibels:.1f} dB")
    figure.savefig(path)


def show(axes: Axes, radiance: Picture, title: str) -> None:
    """A linear picture as people see it."""
    picture(axes, encode(radiance, 8), title, 8, interpolation="nearest")


if __name__ == "__main__":
    main()
