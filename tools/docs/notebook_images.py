"""The picture of docs/notebooks.md: what cells end with, as a browser shows it on a light and on a dark page.

    python tools/docs/notebook_images.py [chromium]

It takes a Chromium (``apt install chromium``), and runs it without a window.
"""

from __future__ import annotations

import html
import os
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import vcc
from vcc import patterns
from vcc.recover import focal_stack
from vcc.units import m, mm, um

HERE = Path(__file__).parents[2] / "docs"
WIDTH, HEIGHT = 1480, 3000
"""Pixels of the window; what is empty below is cut off."""
THEMES = (("#ffffff", "#1f1f1f", "#f3f3f3"), ("#111111", "#e6e6e6", "#222222"))
"""Of page, of words, of code."""


def cells() -> list[tuple[str, Any]]:
    """What is typed, and what the cell ends with."""
    desk = vcc.store.open_store(HERE / "data" / "desk.zarr")
    lens = vcc.Lens(50 * mm, diameter=16 * mm, name="main")
    mask = vcc.Mask(patterns.mura(11), width=22 * mm, z=40 * mm, name="code")
    camera = vcc.Camera.focused([lens, mask], vcc.Sensor(z=0, shape=(320, 480), pitch=50 * um), 0.7 * m)
    stack = focal_stack(desk[:, :, ::2, ::2], [0.43 * m, 0.6 * m, 0.9 * m, 2.5 * m])
    return [
        ('desk = vcc.store.open_store("desk.zarr")\ndesk[2:7, 2:7]', desk[2:7, 2:7]),
        ("camera", camera),
        ("camera.elements[1]", mask),
        ("camera.capture(desk)", camera.capture(desk)),
        ("stack = focal_stack(desk, [0.43 * m, 0.6 * m, 0.9 * m, 2.5 * m])\nstack", stack),
        ("stack.all_in_focus()", stack.all_in_focus()),
    ]


def page() -> str:
    """Both themes side by side."""
    shown = [(source, value._repr_html_()) for source, value in cells()]
    columns = []
    for paper, ink, code in THEMES:
        parts = "".join(
            f'<pre style="background:{code};padding:6px 10px;margin:0 0 6px;font-size:12px">'
            f"{html.escape(source)}</pre>"
            f'<div style="margin:0 0 14px">{made}</div>'
            for source, made in shown
        )
        looks = f"width:{WIDTH // 2 - 40}px;padding:16px 20px;background:{paper};color:{ink}"
        columns.append(f'<div style="{looks};font:13px/1.5 system-ui,sans-serif">{parts}</div>')
    return f'<!doctype html><meta charset="utf-8"><body style="margin:0;display:flex">{"".join(columns)}</body>'


def main(browser: str) -> None:
    """Write the page, take its picture, and keep it small."""
    from PIL import Image, ImageChops  # comes with Matplotlib

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "page.html").write_text(page(), encoding="utf-8")
        picture = Path(folder) / "picture.png"
        options = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            f"--user-data-dir={folder}/data",
        ]
        size = f"--window-size={WIDTH},{HEIGHT}"
        subprocess.run(
            [browser, *options, size, f"--screenshot={picture}", (Path(folder) / "page.html").as_uri()],
            check=True,
            capture_output=True,
        )
        taken = Image.open(picture).convert("RGB")
    left = taken.crop((0, 0, WIDTH // 2, HEIGHT))
    last = ImageChops.difference(left, Image.new("RGB", left.size, "white")).getbbox()[3] + 16
    small = taken.crop((0, 0, WIDTH, last))
    small.save(HERE / "images" / "notebooks" / "shown.png")


if __name__ == "__main__":
    os.environ.setdefault("MPLBACKEND", "Agg")
    warnings.simplefilter("ignore", vcc.ResultWarning)
    main(sys.argv[1] if len(sys.argv) > 1 else "chromium")
