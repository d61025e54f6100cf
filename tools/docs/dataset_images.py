"""Draw the picture of docs/dataset.md: python tools/docs/dataset_images.py."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

import vcc
from vcc.dataset import make_dataset
from vcc.store import open_store
from vcc.units import mm, ms, um

ROOT = Path(__file__).parents[2]
HERE = ROOT / "docs" / "images" / "dataset"
COUNT = 5


def main(folder: Path = HERE) -> None:
    """Draw it into a folder."""
    warnings.simplefilter("ignore", vcc.ResultWarning)
    folder.mkdir(parents=True, exist_ok=True)
    sensor = vcc.Sensor(0, (320, 480), 52 * um, electronics=vcc.Electronics())
    elements = [vcc.Lens(50 * mm, name="main"), vcc.Mask(vcc.patterns.mura(11), width=16 * mm, name="code")]
    camera = vcc.Camera.focused(elements, sensor, 0.9)
    with tempfile.TemporaryDirectory() as made:
        pairs = make_dataset(
            Path(made) / "pairs",
            camera,
            open_store(ROOT / "docs" / "data" / "desk.zarr"),
            {"code.pattern": "mura, circle"},
            count=COUNT,
            crop=(128, 128),
            flips=True,
            truth=("sharp", "depth"),
            exposure=(1 * ms, 8 * ms),
            radiance=0.005,
            seed=11,
        )
        draw(list(pairs), pairs.card["cameras"], folder / "pairs.png")


def draw(pairs: list[dict], cameras: list[str], path: Path) -> None:
    """Recordings above, ground truth below."""
    figure = Figure(figsize=(2.1 * COUNT, 6.6), layout="constrained")
    axes = figure.subplots(3, COUNT)
    rows = ("recording", "sharp", "depth")
    for column, pair in enumerate(pairs):
        numbers, white = pair["numbers"], np.quantile(pair["sharp"], 0.995)
        said = f"{cameras[numbers['camera']].split()[-1]}, {numbers['exposure_seconds'] * 1e3:.1f} ms"
        axes[0, column].set_title(
            said + (", flipped" if numbers["flip_x"] or numbers["flip_y"] else ""), fontsize=9
        )
        for row, name in enumerate(rows):
            # Upright for people: recordings are upside down as on the sensor.
            shown = np.rot90(pair[name], 2)
            if name == "depth":
                axes[row, column].imshow(shown, cmap="viridis_r", norm=LogNorm(0.4, 4))
            else:
                axes[row, column].imshow(np.clip(shown / white, 0, 1) ** (1 / 2.2))
            axes[row, column].set(xticks=[], yticks=[])
    for row, name in enumerate(("recording", "sharp", "depth, 0.4 m to 4 m")):
        axes[row, 0].set_ylabel(name)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
