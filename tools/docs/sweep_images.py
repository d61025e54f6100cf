"""Draw the pictures of docs/sweeps.md: python tools/docs/sweep_images.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import vcc
from vcc.showcase.scene import demo_scene
from vcc.sweeps import contact_sheet
from vcc.units import mm

HERE = Path(__file__).parents[2] / "docs" / "images" / "sweeps"


def main(folder: Path = HERE) -> None:
    """Draw all of them into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    field = demo_scene().light_field(
        (17, 17), (96, 128), spacing=1.2 * mm, slope_per_pixel=0.0045, focus_distance=1.3, dtype=np.float32
    )
    camera = vcc.Camera(
        [vcc.Lens(50 * mm, name="main"), vcc.Mask(vcc.patterns.mura(11), width=18 * mm, name="code")],
        vcc.Sensor(z=52 * mm, shape=(96, 128), pitch=0.23 * mm),
    )
    swept = vcc.sweep(camera, field, {"code.pattern": "mura, circle", "sensor.z": "51.2mm:53.6mm:5"})
    contact_sheet(swept).savefig(folder / "sheet.png")


if __name__ == "__main__":
    main()
