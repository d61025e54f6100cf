"""Run docs/tutorial.md and arrange what it makes into its pictures: python tools/docs/tutorial_images.py."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import panels
from matplotlib.patches import Circle

import vcc
from vcc.files.pictures import read_picture
from vcc.plot import style
from vcc.units import mm

PAGE = panels.DOCS / "tutorial.md"
HERE = panels.DOCS / "images" / "tutorial"


def main(folder: Path = HERE) -> None:
    """Draw all of them into a folder."""
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    names: dict[str, Any] = {}
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as made:
        os.chdir(made)
        try:
            for block in re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S):
                exec(compile(block, PAGE.name, "exec"), names)
            draw(folder, names)
        finally:
            os.chdir(before)


def draw(folder: Path, names: dict[str, Any]) -> None:
    """The page's pictures from the files and the names that its code has left."""
    corners = [("view (0, 0), top left", shown("view-top-left"))]
    corners += [("view (8, 8), bottom right", shown("view-bottom-right"))]
    row(folder / "light-field.png", corners)
    focused = [(f"focused on the {name}", shown(f"focused-{name}")) for name in ("leaves", "chart", "town")]
    row(folder / "focus.png", focused)
    (folder / "camera.png").write_bytes(Path("camera.png").read_bytes())
    lamps_and_mask(folder / "mask.png", names["mask"], names["lens"])
    raw = shown("raw")
    row(
        folder / "plenoptic.png",
        [
            ("raw recording", raw),
            ("a part of it, 84×84 pixels", raw[60:144, 100:184]),
            ("decoded, focused on the leaves", shown("decoded-leaves")),
            ("decoded, focused on the town", shown("decoded-town")),
        ],
    )
    contrast_curves(folder / "mtf.png", names["curves"])


def shown(name: str) -> np.ndarray:
    """A picture that the page's code has written."""
    return np.asarray(read_picture(Path(f"{name}.png"))[0])


def row(path: Path, pictures: list[tuple[str, np.ndarray]]) -> None:
    """Pictures side by side, as high as each other."""
    widths = [picture.shape[1] / picture.shape[0] for _, picture in pictures]
    height = min(11 / sum(widths), 3.6)
    figure = panels.new_figure(height * sum(widths), height + 0.3)
    places = figure.subplots(1, len(pictures), width_ratios=widths, squeeze=False)[0]
    for axes, (title, picture) in zip(places, pictures, strict=True):
        panels.picture(axes, picture, title, style.TITLE, style.INK, cmap="gray")
    figure.savefig(path)


def lamps_and_mask(path: Path, mask: vcc.Mask, lens: vcc.Lens) -> None:
    """The same lamps out of focus without and with the mask, and the mask within the lens's rim."""
    lamps = np.s_[24:72, 0:66]
    figure = panels.new_figure(11, 3.6)
    without, behind, cells = figure.subplots(1, 3, width_ratios=(66 / 48, 66 / 48, 1))
    panels.framed(without, shown("focused-leaves")[lamps], "lamps behind the focus, open lens")
    panels.framed(behind, shown("coded")[lamps], "with the mask")
    half = mask.width / 2 / mm
    cells.imshow(mask.faces().pattern.values, cmap="gray", vmin=0, vmax=1, extent=(-half, half, half, -half))
    cells.add_patch(Circle((0, 0), lens.diameter / 2 / mm, fill=False, ec=style.ORANGE, lw=1.5))
    rim = lens.diameter / 2 / mm * 1.05
    cells.set(xlim=(-rim, rim), ylim=(rim, -rim), facecolor=style.NOTHING)
    cells.set_title("the mask; orange: the lens's rim", fontsize=style.SMALL, color=style.INK)
    style.tidy(cells, "x [mm]", "y [mm]")
    figure.savefig(path)


def contrast_curves(path: Path, curves: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
    """The MTF of each camera; the sensor itself shows 6 line pairs per millimetre."""
    figure = panels.new_figure(6.4, 3)
    axes = figure.subplots()
    for (name, (frequency, contrast)), colour in zip(curves.items(), (style.BLUE, style.ORANGE), strict=True):
        axes.plot(frequency, contrast, color=colour, lw=1.3, label=name)
    axes.set_yscale("log")
    axes.set_ylim(1e-3, 1.2)
    axes.set_xlim(0, 15)
    axes.legend(fontsize=style.SMALL, frameon=False)
    style.tidy(axes, "line pairs per millimetre on the sensor", "contrast")
    axes.set_title("the town, 3 m away, focused at 0.8 m", fontsize=style.TITLE, color=style.INK)
    figure.savefig(path)


if __name__ == "__main__":
    main()
