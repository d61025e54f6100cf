"""Draw the pictures of docs/your-scene.md: python tools/docs/splat_images.py. Run webp.py after it."""

from __future__ import annotations

from pathlib import Path

import desk_scene
import numpy as np
import panels

import vcc
from vcc.base.measures import decibels
from vcc.files.transfer import from_linear
from vcc.sources import synthesize
from vcc.sources.splats import SplatScene
from vcc.units import mm, um

HERE = panels.DOCS / "images" / "your-scene"


def main(folder: Path = HERE) -> None:
    """Draw the desk as splats, and one camera through them and through the rendered views."""
    folder.mkdir(parents=True, exist_ok=True)
    cameras = desk_scene.cameras()
    scene = SplatScene(panels.DOCS / "data" / "desk.spz")
    splats = synthesize(scene, cameras)
    desk = panels.desk()
    camera = vcc.Camera.focused(
        [vcc.Lens(focal_length=50 * mm, diameter=16 * mm)], vcc.Sensor(0, (320, 480), 54 * um), desk_scene.FOCUS
    )
    images = [camera.capture(field, between_views="depth").upright().to_numpy() for field in (splats, desk)]
    images[1] *= desk.provenance["full_scale"]
    lens = np.pi * 0.25 * (16e-3) ** 2 / camera.sensor.z**2  # of radiance 1
    shown = [np.clip(from_linear(image / lens), 0, 1) for image in images]
    print(f"lens: {decibels(float(np.mean((shown[0] - shown[1]) ** 2))):.1f} dB of full scale, sRGB")
    depth = scene.disparity_maps(cameras).values[0]
    figure = panels.new_figure(9.6, 6.9)
    places = figure.subplots(2, 2)
    view = np.clip(from_linear(np.asarray(splats.values[4, 4], np.float32)), 0, 1)
    panels.picture(places[0, 0], view, "a view of the splats")
    panels.picture(places[0, 1], depth, "its disparity", cmap="viridis")
    panels.picture(places[1, 0], shown[0], "a lens of 16 mm in front of the splats")
    panels.picture(places[1, 1], shown[1], "the same lens in front of the rendered views")
    figure.savefig(folder / "splats.png")


if __name__ == "__main__":
    main()
