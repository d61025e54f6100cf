"""The pictures of docs/bench.md, taken of the bench in headless Chromium: python tools/docs/bench_images.py"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import panels
import uvicorn
from PIL import Image as Pillow  # comes with Matplotlib
from playwright.sync_api import Browser, sync_playwright
from playwright.sync_api import Page as Shown

from vcc.bench.document import Document
from vcc.bench.offered import Field, Offered
from vcc.bench.server import LOOPBACK, Door, application, listening, static_files
from vcc.files.camera_reading import Beside

HERE = panels.DOCS / "images" / "bench"
WIDE, HIGH = 1280, 800
NARROW = 390
FILMED = 960, 600
PATIENCE = 180_000
"""Milliseconds: on a busy machine a whole picture, and the first of a kind, take longer than Playwright waits."""
FRAMES, FRAME_MS = 24, 90
"""Of the film, there and back."""

LENS = {"kind": "lens", "name": "main", "z": "0 mm", "focal_length": "50 mm", "diameter": "18 mm"}
SENSOR = {"z": "52.94 mm", "shape": [320, 480], "pitch": "55 um"}  # the desk, and sharp what is 0.9 m away
CODE = {
    "kind": "mask",
    "name": "code",
    "z": "0 mm",
    "pattern": [[0, 1, 0, 0, 1], [1, 1, 1, 0, 0], [0, 0, 1, 1, 0], [0, 1, 0, 1, 1], [1, 0, 0, 1, 0]],
    "width": "18 mm",
}
LENSLETS = {"kind": "lens_array", "name": "lenslets", "z": "52.94 mm", "pitch": "0.5 mm", "focal_length": "1.4 mm"}
DECODED = {
    "kind": "lens_array",
    "name": "lenslets",
    "z": "52.94 mm",
    "pitch": "0.213 mm",
    "focal_length": "0.633 mm",
    "offset": ["0.1065 mm", "0.1065 mm"],
}
SQUARE = {"kind": "mask", "name": "square stop", "z": "0 mm", "pattern": [[1]], "width": "18 mm"}
FINE = {"z": "53.573 mm", "shape": [400, 600], "pitch": "43.1 um"}
PLATE = {
    "kind": "phase_plate",
    "name": "cubic",
    "z": "0 mm",
    "surface": {"name": "cubic", "strength": 20.0},
    "diameter": "18 mm",
}


def camera(*elements: dict[str, Any], **sensor: Any) -> dict[str, Any]:
    """The tables of a camera with the lens, other elements and the sensor."""
    return {"elements": [LENS, *elements], "sensor": SENSOR | sensor}


class Bench:
    """A page with the bench."""

    def __init__(self, page: Shown, address: str, tables: dict[str, Any]) -> None:
        self.page = page
        page.set_default_timeout(PATIENCE)
        document = Document(tables, "desk").as_json()
        page.goto(f"{address}#d={packed(document)}")
        self.settle()

    def settle(self) -> None:
        """Wait for the whole picture and its notes. Its time is that of this machine, and not shown."""
        self.page.wait_for_selector('section.picture[aria-busy="false"]')
        self.page.wait_for_timeout(700)
        self.page.locator("vcc-bench-picture .line > span:last-child").evaluate("it => it.style.opacity = 0")

    def drag(self, to: str) -> None:
        """Take hold of the sensor and move it to where something is sharp, without letting go."""
        box = self.page.locator('[data-part="sensor"] .strip').bounding_box()
        assert box is not None
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 3
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        for step in range(1, 80):
            self.page.mouse.move(x - step, y)
            held = self.page.locator(".snap.held text")
            if held.count() and to in (held.text_content() or ""):
                self.page.wait_for_timeout(600)
                return
        raise RuntimeError(f"nothing {to} is met")

    def tab(self, name: str) -> None:
        """Open a tab."""
        self.page.get_by_role("tab", name=name).click()
        self.page.wait_for_selector('#pane:not([aria-busy="true"])')
        self.settle()


def packed(document: dict[str, Any]) -> str:
    """A document as the bench's address has it."""
    deflate = zlib.compressobj(9, zlib.DEFLATED, -15)
    data = deflate.compress(json.dumps(document).encode()) + deflate.flush()
    return base64.urlsafe_b64encode(data).decode().rstrip("=")


# --- the states ---


def start(bench: Bench) -> None:
    """A lens before the desk."""


def dragged(bench: Bench) -> None:
    """The sensor is held where the town behind the window is sharp."""
    bench.drag("farthest")


def coded(bench: Bench) -> None:
    """A mask of drawn cells in the lens, out of focus."""
    bench.tab("code")


def lenslets(bench: Bench) -> None:
    """A plenoptic camera, at its pixels."""
    box = bench.page.locator("canvas").bounding_box()
    assert box is not None
    place = box["x"] + 0.72 * box["width"], box["y"] + 0.66 * box["height"]
    bench.page.mouse.move(*place)
    for _ in range(4):
        bench.page.mouse.wheel(0, -300)
    bench.page.mouse.move(place[0] - 12, place[1] - 10)
    bench.settle()


def decoded(bench: Bench) -> None:
    """The views of a plenoptic camera, refocused on what is farthest."""
    bench.tab("Decoded")
    bench.page.get_by_role("slider", name="Refocused").press("End")
    bench.page.wait_for_timeout(700)


def compared(bench: Bench) -> None:
    """A plate of wavefront coding against the lens alone, by a wipe."""
    bench.page.get_by_role("button", name="Pin", exact=True).click()
    bench.page.get_by_text("now · the same").wait_for()
    bench.page.get_by_label("Add an element").select_option("phase_plate")
    bench.settle()
    bench.page.locator("#elements-1-z").fill("0 mm")
    bench.page.keyboard.press("Enter")
    bench.settle()


def phase_space(bench: Bench) -> None:
    """Phase space, plane by plane."""
    bench.tab("Phase space")


def notes(bench: Bench) -> None:
    """What is to be watched."""
    bench.tab("Notes")


STATES: dict[str, tuple[dict[str, Any], Callable[[Bench], None], int, str]] = {
    "lens": (camera(), start, WIDE, "light"),
    "dragged": (camera(), dragged, WIDE, "light"),
    "coded": (camera(CODE, z="56 mm"), coded, WIDE, "light"),
    "lenslets": (camera(LENSLETS, z="54.34 mm"), lenslets, WIDE, "dark"),
    "decoded": (
        {"elements": [LENS | {"diameter": "26 mm"}, SQUARE, DECODED], "sensor": FINE},
        decoded,
        WIDE,
        "light",
    ),
    "compared": (camera(), compared, WIDE, "light"),
    "phase-space": (camera(CODE | {"z": "26 mm"}), phase_space, WIDE, "dark"),
    "notes": (camera(PLATE, z="55.5 mm"), notes, WIDE, "light"),
    "narrow": (camera(CODE | {"z": "20 mm"}), start, NARROW, "dark"),
}
"""The camera that each begins with, what is done then, the page's width, and light or dark."""


def main(folder: Path = HERE) -> None:
    """Take all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    with served() as address, sync_playwright() as playwright:
        found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
        browser = playwright.chromium.launch(executable_path=found)
        for name, state in STATES.items():
            save(taken(browser, address, *state), folder / f"{name}.webp")
            print(name)
        save_film(filmed(browser, address), folder / "film.webp")
        print("film")
        browser.close()
    in_jupyterlab(folder)


def in_jupyterlab(folder: Path) -> None:
    """The bench in a notebook, where there is JupyterLab."""
    if find_spec("jupyterlab") is None:
        print("jupyterlab.webp is left as it is: JupyterLab is not installed")
        return
    with tempfile.TemporaryDirectory() as name:
        command = [sys.executable, "-m", "tests.bench.hosts", "jupyterlab", "--pictures", name]
        subprocess.run(command, cwd=HERE.parents[2], check=True)
        save_notebook(Path(name) / "jupyterlab-light.png", folder)


def save_notebook(shot: Path, folder: Path) -> None:
    """Its menus, the cells that make a bench, and the one that asks it for its camera."""
    cut = io.BytesIO()
    Pillow.open(shot).crop((0, 0, WIDE, 890)).save(cut, "PNG")
    save(cut.getvalue(), folder / "jupyterlab.webp")


def taken(
    browser: Browser, address: str, tables: dict[str, Any], do: Callable[[Bench], None], width: int, scheme: Any
) -> bytes:
    """A picture of the bench in a state, PNG."""
    context = browser.new_context(viewport={"width": width, "height": HIGH}, color_scheme=scheme)
    bench = Bench(context.new_page(), address, tables)
    do(bench)
    data = bench.page.screenshot()
    context.close()
    return data


def filmed(browser: Browser, address: str) -> list[bytes]:
    """The sensor steps from where the nearest is sharp to where the farthest is: pictures of the page, PNG."""
    context = browser.new_context(viewport={"width": WIDE, "height": HIGH}, color_scheme="light")
    bench = Bench(context.new_page(), address, camera(z="57 mm"))
    bench.page.locator('[data-part="sensor"]').focus()
    shots = []
    for _ in range(FRAMES):
        shots.append(bench.page.screenshot())
        for _ in range(3):
            bench.page.keyboard.press("ArrowLeft")
        bench.settle()
    context.close()
    return shots


def save_film(shots: list[bytes], path: Path) -> None:
    """Write them as a WebP that moves, there and back."""
    size = FILMED
    there = [
        Pillow.open(io.BytesIO(each)).convert("RGB").resize(size, Pillow.Resampling.LANCZOS) for each in shots
    ]
    first, *others = there + there[-2:0:-1]
    first.save(path, save_all=True, append_images=others, duration=FRAME_MS, loop=0, quality=70, method=6)


def save(data: bytes, path: Path) -> None:
    """Write it as WebP: a fifth of the size, and thin coloured lines keep their colours."""
    Pillow.open(io.BytesIO(data)).convert("RGB").save(path, quality=90, method=6)


@contextlib.contextmanager
def served() -> Iterator[str]:
    """The address of a bench before the desk."""
    desk = Field(lambda progress: panels.desk().read())
    offered = Offered({"desk": desk}, Document(camera(), "desk"), Beside(Path(), frozenset()))
    with listening(LOOPBACK, 0) as socket:
        door = Door.of()
        app = application(offered, door, static_files())
        config = uvicorn.Config(app, log_level="critical", ws="websockets-sansio", timeout_graceful_shutdown=1)
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [socket]}, daemon=True)
        thread.start()
        while not server.started:
            time.sleep(0.01)
        yield f"http://{LOOPBACK}:{socket.getsockname()[1]}/?token={door.token}"
        server.should_exit = True
        thread.join(10)


if __name__ == "__main__":
    main()
