"""Make the pictures that README and docs show, from the demo's own output: python docs/make_images.py."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import matplotlib.image
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from vcc.demo import run_demo

HERE = Path(__file__).parent / "images"
PICTURES = [
    ("light-field-middle-view", "one of 20×20 views"),
    ("example-1-focused-near", "lens, focused near"),
    ("example-1-focused-far", "lens, focused far"),
    ("example-2-cosine", "cosine mask before the sensor"),
    ("example-2-coded", "coded mask half-way"),
    ("check-cubic", "pinhole at the lens"),
]


def main() -> None:
    """Run the demo into a temporary folder and keep what the pages need."""
    HERE.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        demo = Path(folder)
        run_demo(demo)
        figure = Figure(figsize=(10.8, 7.5), dpi=100, layout="constrained")
        FigureCanvasAgg(figure)
        for axes, (name, title) in zip(figure.subplots(2, 3).flat, PICTURES, strict=True):
            axes.imshow(matplotlib.image.imread(demo / f"{name}.png"))
            axes.set_title(title, fontsize=11)
            axes.set_axis_off()
        figure.savefig(HERE / "demo.png")
        for name in ("example-1-phase-space-points", "example-2-coded-camera", "check-close-ups"):
            shutil.copyfile(demo / f"{name}.png", HERE / f"{name}.png")


if __name__ == "__main__":
    main()
