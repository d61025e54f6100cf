"""Draw the pictures of docs/real-lenses.md: python tools/docs/real_lens_images.py."""

from __future__ import annotations

from pathlib import Path

from panels import DOCS, new_figure

import vcc
from vcc import analysis
from vcc.units import mm, um

HERE = DOCS / "images" / "real-lenses"


def main(folder: Path = HERE) -> None:
    """Draw all of them into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    lens = vcc.load_lens("double-gauss-50mm", model="real", z=5 * mm)
    sensor = vcc.Sensor(z=0, shape=(400, 600), pitch=60 * um)
    camera = vcc.Camera.focused([lens], sensor, 2.0).focused_at(2.0, by="spot")
    camera.plot(object_distances=[2.0, 0.3]).figure.savefig(folder / "camera.png")
    analysis.spots(camera, 2.0).plot().savefig(folder / "spots.png")
    figure = new_figure(10.5, 3.6)
    left, right = figure.subplots(1, 2)
    analysis.mtf_over_field(camera, 2.0).plot(left)
    analysis.relative_illumination(camera).plot(right)
    figure.savefig(folder / "curves.png")


if __name__ == "__main__":
    main()
