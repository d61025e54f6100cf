"""The optical bench: from a move of the hand to the picture on the canvas.

    pip install ".[bench,test]"                # and Chromium, from the distribution's packages
    python benchmarks/bench.py                 # about two minutes; prints Markdown
    python benchmarks/bench.py --host          # without a browser: from a message to the picture's message
    python benchmarks/bench.py --jupyterlab    # the widget in JupyterLab (pip install jupyterlab anywidget)

``vcc bench`` runs in a process of its own, as users start it, and headless Chromium drags parts with its mouse, to
60 places a second, with snapping. Times are taken in the page: from when the browser had the input until the
first task after the frame in which the canvas was drawn with a picture of that place or a later one. Nothing is
warmed up but the picture that the page shows when it opens. The mouse is moved through the browser's debugging
port, without waiting for the page, as a hand does: Playwright's own moves take 4 ms of a core each, and wait.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import math
import os
import platform
import secrets
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from websockets.sync.client import connect

import vcc
from vcc.bench.carried import packed
from vcc.bench.document import Document
from vcc.bench.offered import Field, Offered
from vcc.bench.session import Session
from vcc.files.camera_reading import Beside, read_tables
from vcc.formats.writing import save_light_field
from vcc.showcase.scene import demo_scene
from vcc.units import mm, um

MOVES, EVERY = 240, 1 / 60
"""Of the mouse in a drag, and seconds between them."""
HELD = 100.0
"""Milliseconds without a new value after which a part is held where something is sharp."""
STILL = 1.0
"""Seconds for which the hand holds still before it lets go."""
BEHIND_LENSLETS = 1.2 * mm
"""To both sides: further on, the sensor would stand before the lenslets."""
TURNS = 100
"""Of the host alone."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome")

WATCH = """
(() => {
  const bench = () => document.querySelector("vcc-bench")?.bench;
  const seen = (window.seen = { opened: performance.timeOrigin, inputs: [], drawn: [], ended: 0 });
  let shown = null;
  for (const moves of ["pointerrawupdate", "pointermove"]) window.addEventListener(moves, (event) => {
    const now = bench();
    if (!now || now.document === shown) return;  // a hand that rests asks for the whole picture of the same place
    shown = now.document;
    seen.inputs.push([performance.timeOrigin + event.timeStamp, now.turn + (now.next ? 1 : 0)]);
  });
  window.addEventListener("pointerup", (event) => { seen.ended = performance.timeOrigin + event.timeStamp; });
  const draw = CanvasRenderingContext2D.prototype.drawImage;
  CanvasRenderingContext2D.prototype.drawImage = function (image, ...rest) {
    draw.call(this, image, ...rest);
    const about = bench()?.picture?.about;
    if (!about || about === seen.about || !(image instanceof ImageBitmap)) return;
    seen.about = about;
    requestAnimationFrame(() => {
      const { port1, port2 } = new MessageChannel();
      port1.onmessage = () => {
        const now = performance.timeOrigin + performance.now();
        seen.drawn.push([now, about.turn, about.coarse, about.took, about.moving, about.shape[0]]);
      };
      port2.postMessage(0);
    });
  };
})();
"""


@dataclass(frozen=True)
class Case:
    """Something that is dragged.

    Args:
        name: in the table.
        views: a side of the light field.
        pixels: (rows, columns) of each view, and of the sensor.
        camera: the optics and the sensor.
        part: what is dragged: an element's number, or "sensor".
        least: pictures a second that are aimed at.
        late: 95th percentile from input to picture that is aimed at, ms.
        coarsest: pixels of the sensor, along a side, in one of the coarsest picture that is aimed at.
        swing: of the part to both sides, metres.
    """

    name: str
    views: int
    pixels: tuple[int, int]
    camera: vcc.Camera
    part: int | str
    least: int
    late: int
    coarsest: int
    swing: float = 6 * mm

    @property
    def where(self) -> list[Any]:
        """The place of the part in a document."""
        return ["sensor", "z"] if self.part == "sensor" else ["elements", self.part, "z"]

    @property
    def z(self) -> float:
        """Of the part, metres."""
        return self.camera.sensor.z if self.part == "sensor" else self.camera.elements[int(self.part)].z


def cases() -> list[Case]:
    """What is dragged."""
    lens = vcc.Lens(focal_length=50 * mm, diameter=18 * mm, name="main")
    code = vcc.Mask(vcc.patterns.mura(13), width=21 * mm, z=26 * mm, name="code")
    lenslets = vcc.LensArray(pitch=0.6 * mm, focal_length=1.3 * mm, z=52 * mm, name="lenslets")
    small, large = (320, 480), (500, 500)
    at_52, wide, behind = (
        vcc.Sensor(z, shape, 48 * um) for z, shape in ((52 * mm, small), (52 * mm, large), (53.3 * mm, large))
    )
    alone, masked = vcc.Camera([lens], at_52), vcc.Camera([lens, code], at_52)
    further = vcc.Camera([replace(lens, z=10 * mm)], vcc.Sensor(62 * mm, small, 48 * um))
    plenoptic = vcc.Camera([lens, lenslets], behind)
    return [
        Case("lens; the sensor", 9, small, alone, "sensor", 30, 60, 2),
        Case("lens; the lens", 9, small, further, 0, 30, 60, 2),
        Case("coded mask in mid-path; the mask", 9, small, masked, 1, 30, 60, 2),
        Case("lens; the sensor", 20, large, vcc.Camera([lens], wide), "sensor", 20, 100, 4),
        Case("coded mask in mid-path; the mask", 20, large, vcc.Camera([lens, code], wide), 1, 20, 100, 4),
        Case("plenoptic, by rays; the sensor", 9, large, plenoptic, "sensor", 20, 100, 4, swing=BEHIND_LENSLETS),
    ]


def light_field(views: int, pixels: tuple[int, int]) -> vcc.LightField:
    """The demo's scene, before a lens of 18 mm."""
    return demo_scene().light_field(
        (views, views),
        pixels,
        spacing=20 * mm / views,
        slope_per_pixel=25 / 52 / pixels[1],
        focus_distance=1.3,
    )


def written(folder: Path, case: Case) -> tuple[Path, Path]:
    """A case's camera file and light field, written once."""
    views = folder / f"views_{case.views}_{case.pixels[0]}.npz"
    if not views.exists():
        save_light_field(light_field(case.views, case.pixels), views)
    camera = folder / f"camera_{len(list(folder.glob('*.toml')))}.toml"
    case.camera.save(camera)
    return camera, views


# --- the host alone ---


class Waiting:
    """A client that waits for each picture."""

    def __init__(self, offered: Offered) -> None:
        self.pictures: list[dict[str, Any]] = []
        self.sent = 0
        self._came = threading.Condition()
        self.session = Session(offered, self._told)

    def _told(self, message: dict[str, Any], buffers: Any) -> None:
        self.sent += len(packed(message, buffers))
        if message["is"] in ("refused", "failed", "no picture"):
            print(f"the bench says: {message['words']}", file=sys.stderr)
        if message["is"] == "picture":
            with self._came:
                self.pictures.append(message)
                self._came.notify()

    def until(self, turn: int, whole: bool = False) -> None:
        """Wait for a picture of a turn."""
        with self._came:
            if not self._came.wait_for(lambda: any(self._is(each, turn, whole) for each in self.pictures), 60):
                raise SystemExit("no picture came in a minute")

    @staticmethod
    def _is(picture: dict[str, Any], turn: int, whole: bool) -> bool:
        return picture["turn"] >= turn and not (whole and picture["coarse"])


def host_alone(case: Case, files: tuple[Path, Path], field: Field) -> str:
    """A line: how long the host takes from a message to its answers."""
    tables = read_tables(files[0])
    client = Waiting(Offered({"views": field}, Document(tables, "views"), Beside(files[0].parent, frozenset())))
    client.session.receive({"do": "hello", "turn": 0})
    client.until(0, whole=True)
    whole = client.pictures[-1]["took"]

    def move(turn: int) -> float:
        z = f"{1e3 * (case.z + case.swing / 4 * math.sin(turn / 10)):.4f} mm"
        began = time.perf_counter()
        client.session.receive({"do": "set", "where": case.where, "value": z, "moving": True, "turn": turn})
        client.until(turn)
        return time.perf_counter() - began

    for turn in range(1, 21):
        move(turn)
    client.pictures, client.sent, used = [], 0, time.process_time()
    seconds = [1e3 * move(turn) for turn in range(21, 21 + TURNS)]
    used = 1e3 * (time.process_time() - used) / TURNS
    took = [picture["took"] for picture in client.pictures]
    shapes = Counter("×".join(map(str, picture["shape"])) for picture in client.pictures)
    client.session.close()
    client.session.join()
    return row(
        size_of(case),
        case.name,
        f"{np.median(seconds):.1f}",
        f"{np.percentile(seconds, 95):.1f}",
        f"{np.median(took):.1f}",
        f"{used:.1f}",
        f"{client.sent / TURNS / 1000:.0f}",
        ", ".join(f"{shape} ({count} %)" for shape, count in shapes.most_common()),
        f"{whole:.0f}",
    )


# --- in a browser ---


@contextlib.contextmanager
def hand(port: int, page: Any) -> Iterator[Callable[[float, float], None]]:
    """Moves Chromium's mouse, with its left button pressed, and does not wait for the page.

    Args:
        port: of Chromium's debugging.
        page: on which the mouse is.
    """
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list") as listed:
        targets = json.load(listed)
    address = next(each["webSocketDebuggerUrl"] for each in targets if each["url"] == page.url)
    numbers = itertools.count()
    with connect(address) as chromium:

        def move(x: float, y: float) -> None:
            where = {"type": "mouseMoved", "x": x, "y": y, "button": "left", "buttons": 1}
            asked = {"id": next(numbers), "method": "Input.dispatchMouseEvent", "params": where}
            chromium.send(json.dumps(asked))

        yield move
        last = next(numbers) - 1
        while json.loads(chromium.recv(timeout=10)).get("id") != last:  # until the page has taken all moves
            pass


def free_port() -> int:
    """A port on which nobody listens."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@contextlib.contextmanager
def process(*command: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A process of ours, and its end."""
    options: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, "cwd": folder}
    with subprocess.Popen(command, **options) as running:
        try:
            yield running
        finally:
            running.terminate()
            try:
                running.wait(timeout=10)
            except subprocess.TimeoutExpired:
                running.kill()


@contextlib.contextmanager
def served(case: Case, files: tuple[Path, Path]) -> Iterator[str]:
    """The address of a bench with a case's camera and light field."""
    camera, views = map(str, files)
    with process(
        sys.executable, "-m", "vcc", "bench", camera, views, "--no-browser", folder=files[0].parent
    ) as bench:
        assert bench.stdout is not None
        words = ""
        while "http" not in words:
            words = bench.stdout.readline()
            if not words:
                raise SystemExit("vcc bench has ended")
        yield next(word for word in words.split() if word.startswith("http"))


def drag(page: Any, case: Case, port: int) -> dict[str, Any]:
    """What the page saw of a part that is dragged, held still, and let go."""
    page.wait_for_selector('section.picture[aria-busy="false"]', timeout=60_000)
    page.wait_for_timeout(500)
    boxes = {
        part: page.locator(f'[data-part="{part}"] .strip').bounding_box() for part in (0, "sensor", case.part)
    }
    middle = {part: box["x"] + box["width"] / 2 for part, box in boxes.items()}
    scale = (middle["sensor"] - middle[0]) / (case.camera.sensor.z - case.camera.elements[0].z)
    x, y = middle[case.part], boxes[case.part]["y"] + boxes[case.part]["height"] / 3
    page.mouse.move(x, y)
    page.mouse.down()
    with hand(port, page) as move:
        began = time.perf_counter()
        for number in range(MOVES):
            time.sleep(max(began + number * EVERY - time.perf_counter(), 0))
            move(x + scale * case.swing * math.sin(2 * math.pi * (number + 1) / 120.5), y)
    page.wait_for_timeout(1000 * STILL)
    page.mouse.up()
    page.wait_for_timeout(50)
    page.wait_for_selector('section.picture[aria-busy="false"]', timeout=60_000)
    page.wait_for_timeout(100)
    return dict(page.evaluate("window.seen"))


def told(case: Case, seen: dict[str, Any]) -> str:
    """A line of the table: what was seen, with what is aimed at.

    Snapping is on: while the part is held where something is sharp, nothing changes and no picture is made. That
    time does not count for the rate.
    """
    inputs, drawn = np.array(seen["inputs"]), sorted(seen["drawn"])
    turns, times = np.array([one[1] for one in drawn]), np.array([one[0] for one in drawn])
    shown = np.array([times[turns >= turn].min(initial=math.inf) for turn in inputs[:, 1]])
    late = shown - inputs[:, 0]
    during = [one for one in drawn if inputs[0, 0] <= one[0] <= inputs[-1, 0]]
    gaps = np.diff(inputs[:, 0])
    rate = len(during) / gaps[gaps < HELD].sum() * 1e3
    rested = [each for each in drawn if each[1] >= inputs[-1, 1]]
    full = [one[0] - inputs[-1, 0] for one in rested if one[5] == case.camera.sensor.shape[0]]
    whole = [one[0] - inputs[-1, 0] for one in rested if not one[2]]
    coarser = Counter(round(case.camera.sensor.shape[0] / one[5]) for one in during)
    return row(
        size_of(case),
        case.name,
        f"{rate:.1f} ({case.least})",
        f"{np.median(late):.0f}",
        f"{np.percentile(late, 95):.0f} ({case.late})",
        f"{late.max():.0f}",
        f"{max(coarser, default=0)} ({case.coarsest})",
        ", ".join(
            f"{1 if step == 1 else f'1/{step}'}: {count / len(during):.0%}"
            for step, count in sorted(coarser.items())
        ),
        f"{full[0]:.0f} (100), {whole[0]:.0f}" if whole else "none",
        f"{np.median([one[3] for one in during]):.0f}" if during else "none",
        f"{1e-3 * (drawn[0][0] - seen['opened']):.1f} (2)",
    )


def in_a_browser(browser: Any, debugging: int, case: Case, files: tuple[Path, Path]) -> str:
    """A line of the table, from the bench of `vcc bench`."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.add_init_script(WATCH)
    page = context.new_page()
    with served(case, files) as address:
        page.goto(address)
        found = told(case, drag(page, case, debugging))
        context.close()
    return found


def in_jupyterlab(browser: Any, debugging: int, case: Case, files: tuple[Path, Path]) -> str:
    """A line of the table, from a notebook in JupyterLab."""
    folder, token = files[0].parent, secrets.token_hex(8)
    source = f"import vcc\nvcc.load_camera({files[0].name!r}).bench(vcc.open_light_field({files[1].name!r}))"
    cell = {
        "cell_type": "code",
        "id": "one",
        "metadata": {},
        "source": source,
        "outputs": [],
        "execution_count": None,
    }
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    notebook = {"cells": [cell], "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    (folder / "bench.ipynb").write_text(json.dumps(notebook))
    port = free_port()
    options = [
        f"--port={port}",
        "--no-browser",
        f"--IdentityProvider.token={token}",
        f"--ServerApp.root_dir={folder}",
    ]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        options.append("--allow-root")
    with process(sys.executable, "-m", "jupyterlab", *options, folder=folder) as lab:
        assert lab.stdout is not None
        threading.Thread(target=lab.stdout.read, daemon=True).start()
        context = browser.new_context(viewport={"width": 1280, "height": 900})
        context.add_init_script(WATCH)
        page = context.new_page()
        wait_for(port)
        page.goto(f"http://127.0.0.1:{port}/lab/tree/bench.ipynb?token={token}", wait_until="domcontentloaded")
        page.locator(".jp-CodeCell .cm-content").first.click(timeout=60_000)
        page.locator('.jp-Notebook-ExecutionIndicator[data-status="idle"]').first.wait_for(timeout=60_000)
        page.keyboard.press("Control+Enter")
        found = told(case, drag(page, case, debugging))
        context.close()
    return found


def wait_for(port: int) -> None:
    """Until somebody listens there."""
    for _ in range(300):
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
            return
        time.sleep(0.1)
    raise SystemExit("JupyterLab does not answer")


# --- words ---


def row(*cells: str) -> str:
    """Of a table."""
    return "| " + " | ".join(cells) + " |"


def size_of(case: Case) -> str:
    """Of its light field."""
    return f"{case.views}×{case.views} of {case.pixels[0]}×{case.pixels[1]}"


def heading(*cells: str) -> None:
    """Of a table."""
    print(row(*cells))
    print(row(*["---"] * len(cells)), flush=True)


OF_HOST = (
    "views", "camera; what is moved", "message to picture, median, ms", "95th percentile", "picture made in",
    "processor", "kB sent", "pixels", "whole picture made in",
)  # fmt: skip
OF_LOOP = (
    "views", "camera; what is dragged", "pictures/s (at least)", "input to picture, median, ms",
    "95th percentile (at most)", "longest", "coarsest, pixels in one along a side (at most)", "shares by size",
    "all pixels after the hand rests, ms (at most), and exact", "made in, while dragging",
    "first picture, from the start of loading the page, s (at most)",
)  # fmt: skip


def main() -> None:
    """Measure, and print Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--host", action="store_true", help="without a browser")
    parser.add_argument("--jupyterlab", action="store_true", help="the widget in JupyterLab, and nothing else")
    parser.add_argument("--only", default="", metavar="WORDS", help="cases whose line of the table holds this")
    arguments = parser.parse_args()
    wanted = [case for case in cases() if arguments.only in row(size_of(case), case.name)]
    if arguments.jupyterlab:
        wanted = [replace(case, least=20, late=100) for case in wanted if case.coarsest == 2]
    load, version = os.getloadavg()[0], platform.python_version()
    print(f"{platform.node()}: {os.cpu_count()} cores, load {load:.1f} at the start, Python {version}\n")
    with tempfile.TemporaryDirectory() as made:
        files = [written(Path(made), case) for case in wanted]
        if arguments.host:
            measure_host(wanted, files)
        else:
            measure_in_chromium(wanted, files, in_jupyterlab if arguments.jupyterlab else in_a_browser)


def measure_host(wanted: list[Case], files: list[tuple[Path, Path]]) -> None:
    """A line for each case, of the host alone."""
    heading(*OF_HOST)
    fields: dict[Path, Field] = {}
    for case, each in zip(wanted, files, strict=True):
        field = fields.setdefault(each[1], Field(vcc.open_light_field(each[1])))
        print(host_alone(case, each, field), flush=True)


def measure_in_chromium(wanted: list[Case], files: list[tuple[Path, Path]], measure: Callable[..., str]) -> None:
    """A line for each case, of the closed loop."""
    from playwright.sync_api import sync_playwright

    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise SystemExit(f"there is no browser: none of {', '.join(BROWSERS)}")
    heading(*OF_LOOP)
    with sync_playwright() as running:
        port = free_port()
        browser = running.chromium.launch(executable_path=found, args=[f"--remote-debugging-port={port}"])
        for case, each in zip(wanted, files, strict=True):
            print(measure(browser, port, case, each), flush=True)
        browser.close()


if __name__ == "__main__":
    main()
