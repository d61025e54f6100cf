"""The bench in real notebooks, driven in headless Chromium: python -m tests.bench.hosts [jupyterlab] [marimo] …

No test of the suite: JupyterLab and marimo are no dependencies. Each that is installed is started on a
folder of its own and told what to run; what was seen is printed line by line, and the first thing that is not so
ends it.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PATIENCE = 120_000
SETUP = """import threading, vcc
from vcc.units import mm
from vcc.showcase.scene import demo_scene
scene = dict(spacing=3.6 * mm, slope_per_pixel=0.1 / 52, focus_distance=1.3)
light_field = demo_scene().light_field((5, 5), (150, 200), **scene)
lens = vcc.Lens(50 * mm, diameter=18 * mm, name="main")
camera = vcc.Camera([lens], vcc.Sensor(z=52.94 * mm, shape=(150, 200), pitch=0.1 * mm))"""
BENCH = "bench = camera.bench(light_field)\nbench"
WHERE = 'print("sensor", round(bench.camera.sensor.z * 1e3, 3))'
THREADS = 'print("threads", sum(each.name == "vcc bench" for each in threading.enumerate()))'


def main() -> None:
    """Drive those that are named, or all."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.hosts", description=__doc__)
    parser.add_argument(
        "names", nargs="*", choices=[*HOSTS, []], help="all that are installed, unless some are named"
    )
    parser.add_argument("--pictures", type=Path, help="a folder for screenshots")
    given = parser.parse_args()
    found = next(filter(None, map(shutil.which, BROWSERS)))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found)
        for name in given.names or HOSTS:
            if find_spec(name) is None:
                print(f"{name} is not installed: pip install {name}")
                continue
            print(f"\n{name} {version(name)}, anywidget {version('anywidget')}, Chromium {browser.version}")
            HOSTS[name](browser, given.pictures)
        browser.close()


def seen(words: str) -> None:
    """Something is so."""
    print(f"  {words}", flush=True)


class Bench:
    """A bench in a cell."""

    def __init__(self, frame: Locator) -> None:
        self.frame = frame
        self.page = frame.page

    def ready(self) -> None:
        """Wait for the picture of what was asked last, which is more than one colour."""
        self.frame.locator('section.picture[aria-busy="false"]').wait_for(timeout=PATIENCE)
        self.page.wait_for_timeout(300)
        assert len(set(self.picture())) > 100, "nothing is drawn"

    def picture(self) -> bytes:
        """The canvas as it looks, PNG."""
        return self.frame.locator("canvas").screenshot()

    @property
    def sensor(self) -> Locator:
        """On the drawing."""
        return self.frame.locator('[data-part="sensor"]')

    def place(self) -> float:
        """Of the sensor, millimetres."""
        words = self.sensor.get_attribute("aria-valuetext")
        assert words is not None
        return float(words.removesuffix(" mm"))

    def drag(self, by: float) -> None:
        """The sensor, so many pixels, and wait for the whole picture."""
        strip = self.frame.locator('[data-part="sensor"] .strip')
        strip.scroll_into_view_if_needed()
        box = strip.bounding_box()
        assert box is not None
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 3
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(x + by, y, steps=6)
        self.page.mouse.up()
        self.ready()

    def colour(self) -> str:
        """Of its ground, as the browser says it."""
        return str(self.frame.evaluate("f => getComputedStyle(f.shadowRoot.firstElementChild).backgroundColor"))


# --- JupyterLab ---


class Notebook:
    """A page of JupyterLab with one notebook."""

    def __init__(self, page: Page, address: str) -> None:
        self.page = page
        self.errors: list[str] = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.address = address
        self.open()

    def open(self) -> None:
        """Go there, and wait until the kernel is."""
        self.page.goto(self.address)
        self.page.locator(".jp-Notebook .jp-CodeCell").first.wait_for(timeout=PATIENCE)
        self.page.locator('.jp-Notebook-ExecutionIndicator[data-status="idle"]').first.wait_for(timeout=PATIENCE)
        self.page.wait_for_timeout(2000)  # it goes on arranging itself, and forgets what it is told meanwhile

    def cell(self, number: int) -> Locator:
        """By its place."""
        return self.page.locator(".jp-Notebook .jp-Cell").nth(number)

    def run(self, number: int) -> str:
        """Run a cell; the text that it printed."""
        cell = self.cell(number)
        before = cell.locator(".jp-InputPrompt").inner_text()
        digits = "" if "*" in before else "".join(re.findall(r"\d+", before))
        cell.locator(".cm-content").click()
        expect(cell.locator(".cm-editor.cm-focused")).to_have_count(1)
        for _ in range(3):  # a page that arranges itself may forget what it is told
            self.page.keyboard.press("Control+Enter")
            self.page.wait_for_timeout(1500)
            if cell.locator(".jp-InputPrompt").inner_text() != before:
                break
        other = re.compile(rf"\[(?!{digits or 'none'}\])\d+\]")
        expect(cell.locator(".jp-InputPrompt")).to_have_text(other, timeout=PATIENCE)
        self.page.wait_for_timeout(200)
        wrong = cell.locator(
            '[data-mime-type="application/vnd.jupyter.error"], [data-mime-type="application/vnd.jupyter.stderr"]'
        )
        assert not wrong.count(), wrong.first.inner_text()
        texts = cell.locator(".jp-OutputArea-output pre").all_text_contents()
        return "".join(texts).strip()

    def bench(self, number: int) -> Bench:
        """In the output of a cell."""
        return Bench(self.cell(number).locator("vcc-bench"))

    def menu(self, *words: str) -> None:
        """Choose from the menus."""
        self.page.get_by_role("menuitem", name=words[0], exact=True).click()
        for each in words[1:]:
            self.page.locator(".lm-Menu-itemLabel", has_text=re.compile(f"^{re.escape(each)}$")).last.click()

    def cells(self) -> int:
        """How many there are."""
        return self.page.locator(".jp-Notebook .jp-Cell").count()


def in_jupyter(browser: Browser, pictures: Path | None, module: str, path: str) -> None:
    """All that is tried there."""
    cells = [SETUP, BENCH, WHERE, "bench", THREADS, "import time; time.sleep(8)"]
    with served_jupyter(module, {"bench.ipynb": cells}) as (address, folder):
        context = browser.new_context(viewport={"width": 1280, "height": 1400})
        book = Notebook(context.new_page(), f"{address}/{path}/bench.ipynb")
        with shown_where_it_ended(book.page, pictures, module):
            drawn_and_dragged(book)
            shared_by_two_cells(book)
            keys_stay(book, folder)
            looks_as_around_it(book, pictures, module)
            busy_and_gone(book)
            kept_without_kernel(book, folder, pictures, module)
            assert book.errors == [], book.errors
        context.close()


def drawn_and_dragged(book: Notebook) -> None:
    """A picture; another after a drag; the camera in the next cell is that of the bench."""
    book.run(0)
    book.run(1)
    bench = book.bench(1)
    bench.ready()
    before = bench.picture()
    assert book.run(2) == "sensor 52.94"
    bench.drag(-25)
    assert bench.picture() != before
    z = bench.place()
    assert z < 52
    assert float(book.run(2).removeprefix("sensor ")) == z
    seen(f"drawn; dragged to {z} mm, and the next cell's bench.camera stands there")


def shared_by_two_cells(book: Notebook) -> None:
    """Another cell that shows the widget shows the same; a cell that is run again has a new one; threads end."""
    book.run(3)
    one, two = book.bench(1), book.bench(3)
    two.ready()
    assert two.place() == one.place()
    two.drag(30)
    expect(one.sensor).to_have_attribute("aria-valuetext", two.sensor.get_attribute("aria-valuetext") or "")
    one.ready()
    one.drag(-10)
    expect(two.sensor).to_have_attribute("aria-valuetext", one.sensor.get_attribute("aria-valuetext") or "")
    two.frame.get_by_role("button", name="Undo").click()
    two.ready()
    assert one.place() == two.place()
    seen("two cells with one widget show one bench; moved and undone in either")
    for _ in range(3):
        book.run(1)
        book.bench(1).ready()
    book.page.wait_for_timeout(2500)
    assert book.run(4) == "threads 0"
    seen("run again three times, and at rest: no thread is left")
    assert book.run(2) == "sensor 52.94"


def keys_stay(book: Notebook, folder: Path) -> None:
    """Keys on the bench do nothing to the notebook, but its own commands get there."""
    bench = book.bench(1)
    count = book.cells()
    bench.sensor.focus()
    for key in (
        "a",
        "b",
        "d",
        "d",
        "x",
        "z",
        "m",
        "c",
        "v",
        "Delete",
        "Backspace",
        "ArrowUp",
        "ArrowDown",
        "j",
        "0",
        "0",
    ):
        book.page.keyboard.press(key)
    bench.ready()
    assert book.cells() == count
    place = bench.place()
    book.page.keyboard.press("ArrowRight")
    bench.ready()
    assert bench.place() > place
    book.page.wait_for_timeout(600)
    book.page.keyboard.press("Control+z")
    expect(bench.sensor).not_to_have_attribute("aria-valuetext", f"{place + 0.1:g} mm")
    field = bench.frame.locator("#sensor-z")
    field.fill("53 mm")
    field.press("Enter")
    expect(bench.sensor).to_have_attribute("aria-valuetext", "53 mm")
    field.press("Control+a")
    field.press("Backspace")
    field.press("Escape")
    assert book.cells() == count
    assert bench.frame.evaluate("f => f.getRootNode().activeElement === f")
    seen("letters, Delete, arrows and Ctrl+Z on the bench do nothing to the cells; a length is typed")
    before = (folder / "bench.ipynb").stat().st_mtime_ns
    book.page.keyboard.press("Control+s")
    book.page.wait_for_timeout(1500)
    assert (folder / "bench.ipynb").stat().st_mtime_ns > before
    seen("Ctrl+S from the bench saves the notebook")


def looks_as_around_it(book: Notebook, pictures: Path | None, module: str) -> None:
    """Light and dark as the notebook is, and the page's own styles are as they were."""
    book.run(2)
    bench = book.bench(1)
    light = bench.colour()
    shot(book.page, pictures, f"{module}-light")
    book.menu("Settings", "Theme", "JupyterLab Dark")
    book.page.wait_for_timeout(3000)
    dark = bench.colour()
    shot(book.page, pictures, f"{module}-dark")
    assert (light, dark) == ("rgb(251, 251, 249)", "rgb(23, 25, 27)")
    seen("light and dark as the notebook, at once when that is changed")
    book.menu("Settings", "Theme", "JupyterLab Light")
    book.page.keyboard.press("Control+b")  # away with the list of files
    book.page.set_viewport_size({"width": 600, "height": 1400})
    book.page.wait_for_timeout(600)
    shot(book.page, pictures, f"{module}-narrow")
    wide = bench.frame.evaluate("f => f.scrollWidth <= f.clientWidth")
    assert wide, "it is wider than its cell"
    book.page.set_viewport_size({"width": 1280, "height": 1400})
    book.page.wait_for_timeout(600)


def busy_and_gone(book: Notebook) -> None:
    """While a cell runs; after a restart, when nobody answers, and then the cell makes it again."""
    bench = book.bench(1)
    book.cell(5).locator(".cm-content").click()
    book.page.keyboard.press("Control+Enter")
    book.page.wait_for_timeout(300)
    bench.sensor.focus()
    book.page.keyboard.press("ArrowRight")
    says = bench.frame.get_by_text("Python does not answer")
    book.page.wait_for_timeout(5000)
    seen("while a cell runs " + ("it says so" if says.count() else "it goes on"))
    says.wait_for(state="detached", timeout=PATIENCE)
    bench.ready()
    book.menu("Kernel", "Restart Kernel…")
    book.page.locator(".jp-Dialog .jp-mod-accept").click()
    book.page.wait_for_timeout(4000)
    if bench.frame.count():
        bench.sensor.focus()
        book.page.keyboard.press("ArrowRight")
        bench.frame.get_by_text("Python does not answer").wait_for(timeout=7000)
        seen("after a restart of the kernel it says that nobody answers")
    book.page.locator(".jp-Notebook").click(position={"x": 5, "y": 5})
    book.menu("Edit", "Clear Outputs of All Cells")
    book.run(0)
    book.run(1)
    book.bench(1).ready()
    seen("and the cell, run again, has it again")


def kept_without_kernel(book: Notebook, folder: Path, pictures: Path | None, module: str) -> None:
    """What is shown of a saved notebook whose kernel is gone, and what is in the file."""
    book.page.keyboard.press("Escape")
    book.menu("File", "Save Notebook")
    book.page.wait_for_timeout(1000)
    kept = json.loads((folder / "bench.ipynb").read_text())
    data = kept["cells"][1]["outputs"][0]["data"]
    seen(f"saved as {', '.join(data)}; in words: {''.join(data['text/plain'])}")
    book.page.reload()
    book.page.locator(".jp-Notebook .jp-CodeCell").first.wait_for(timeout=PATIENCE)
    bench = book.bench(1)
    bench.frame.wait_for(timeout=PATIENCE)
    bench.ready()
    seen("the page loaded again, the kernel still there: the bench is back")
    book.menu("Kernel", "Shut Down Kernel")
    book.page.wait_for_timeout(1500)
    book.page.reload()
    book.page.locator(".jp-Notebook .jp-CodeCell").first.wait_for(timeout=PATIENCE)
    book.page.wait_for_timeout(6000)
    shot(book.page, pictures, f"{module}-without-kernel")
    seen(f"without kernel: {book.cell(1).locator('.jp-OutputArea-output').first.inner_text()!r}")


def shot(page: Page, pictures: Path | None, name: str) -> None:
    """A screenshot, where a folder was given for it."""
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=pictures / f"{name}.png")


@contextlib.contextmanager
def shown_where_it_ended(page: Page, pictures: Path | None, name: str) -> Iterator[None]:
    """A screenshot of what something was seen on that is not so."""
    try:
        yield
    except BaseException:
        shot(page, pictures, f"{name}-failed")
        raise


@contextlib.contextmanager
def served_jupyter(module: str, notebooks: dict[str, list[str]]) -> Iterator[tuple[str, Path]]:
    """A server on a folder of its own, with settings of its own; its address, and where its notebooks are."""
    with tempfile.TemporaryDirectory() as name:
        folder, port = Path(name), free_port()
        for title, cells in notebooks.items():
            (folder / title).write_text(json.dumps(notebook_of(cells)))
        own = {f"JUPYTER_{each}_DIR": str(folder / ".jupyter" / each) for each in ("CONFIG", "DATA", "RUNTIME")}
        options = ["--no-browser", f"--port={port}", "--ServerApp.token=", "--ServerApp.password=", "--allow-root"]
        settings = folder / ".jupyter" / "CONFIG" / "lab" / "user-settings" / "@jupyterlab" / "apputils-extension"
        settings.mkdir(parents=True)
        (settings / "notification.jupyterlab-settings").write_text('{"fetchNews": "false"}')
        command = [sys.executable, "-m", module, *options, f"--ServerApp.root_dir={folder}"]
        with running(command, os.environ | own, f"http://127.0.0.1:{port}/api"):
            yield f"http://127.0.0.1:{port}", folder


def notebook_of(cells: list[str]) -> dict[str, object]:
    """A notebook of cells of code."""
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    made = [
        {
            "cell_type": "code",
            "id": f"c{n}",
            "source": each,
            "metadata": {},
            "outputs": [],
            "execution_count": None,
        }
        for n, each in enumerate(cells)
    ]
    return {"cells": made, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


# --- marimo ---

MARIMO = """import marimo

app = marimo.App()


@app.cell
def _():
    import marimo as mo
{setup}
    return camera, light_field, mo, threading


@app.cell
def _(camera, light_field):
    bare = camera.bench(light_field)
    bare
    return (bare,)


@app.cell
def _(camera, light_field, mo):
    wrapped = mo.ui.anywidget(camera.bench(light_field))
    wrapped
    return (wrapped,)


@app.cell
def _(mo):
    look = mo.ui.run_button(label="Look")
    look
    return (look,)


@app.cell
def _(bare, look, mo, threading, wrapped):
    look.value
    places = [round(each.camera.sensor.z * 1e3, 3) for each in (bare, wrapped)]
    mo.md(f"places {{places}}, threads {{sum(each.name == 'vcc bench' for each in threading.enumerate())}}")
    return


if __name__ == "__main__":
    app.run()
"""


def in_marimo(browser: Browser, pictures: Path | None) -> None:
    """As an app and as a notebook, bare and wrapped."""
    setup = "\n".join(f"    {line}" for line in SETUP.splitlines())
    for mode in ("run", "edit"):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "bench.py").write_text(MARIMO.format(setup=setup))
            (Path(folder) / "pyproject.toml").write_text('[tool.marimo.display]\ntheme = "system"\n')
            port = free_port()
            options = ["--headless", "--no-token", f"--port={port}", "bench.py"]
            command = [sys.executable, "-m", "marimo", mode, *options]
            with running(command, os.environ | {"HOME": folder}, f"http://127.0.0.1:{port}/", folder):
                for scheme in ("light", "dark"):
                    context = browser.new_context(viewport={"width": 1280, "height": 1700}, color_scheme=scheme)
                    page = context.new_page()
                    with shown_where_it_ended(page, pictures, f"marimo-{mode}"):
                        page.goto(f"http://127.0.0.1:{port}/")
                        moved_in_marimo(page, mode)
                        ground = {"light": "rgb(251, 251, 249)", "dark": "rgb(23, 25, 27)"}[scheme]
                        assert Bench(page.locator("vcc-bench").first).colour() == ground
                        shot(page, pictures, f"marimo-{mode}-{scheme}")
                    context.close()


def moved_in_marimo(page: Page, mode: str) -> None:
    """Both are dragged, and a cell that is run then knows it."""
    if mode == "edit":
        page.locator(".cm-editor").first.wait_for(timeout=PATIENCE)
        page.wait_for_timeout(1000)
        page.keyboard.press("Control+Shift+r")  # run what has not been run
    benches = [Bench(page.locator("vcc-bench").nth(number)) for number in (0, 1)]
    for bench, by in zip(benches, (-20, 25), strict=True):
        bench.ready()
        before = bench.picture()
        bench.drag(by)
        assert bench.picture() != before
    benches[0].sensor.focus()
    for key in ("a", "d", "d", "Delete", "ArrowDown", "j"):
        page.keyboard.press(key)
    benches[0].ready()
    assert page.locator("vcc-bench").count() == 2
    page.wait_for_timeout(3000)
    places = [bench.place() for bench in benches]
    page.get_by_role("button", name="Look").click()
    page.get_by_text(f"places {places}, threads 0").wait_for(timeout=PATIENCE)
    seen(f"{mode}: drawn and dragged, bare and wrapped; a cell finds them at {places} mm, and no thread left")


# --- what both need ---


def free_port() -> int:
    """One that nobody listens at."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@contextlib.contextmanager
def running(
    command: list[str], environment: dict[str, str], address: str, folder: str | None = None
) -> Iterator[None]:
    """A server, from when it answers."""
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(command, env=environment, cwd=folder, stdout=log, stderr=log)
        try:
            for _ in range(300):
                with contextlib.suppress(OSError), urllib.request.urlopen(address, timeout=5):
                    break
                time.sleep(0.2)
            else:
                log.seek(0)
                raise RuntimeError(log.read().decode())
            yield
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:  # JupyterLab may wait for a kernel that has been told to end
                process.kill()


def in_jupyterlab(browser: Browser, pictures: Path | None) -> None:
    """JupyterLab."""
    in_jupyter(browser, pictures, "jupyterlab", "lab/tree")


HOSTS = {"jupyterlab": in_jupyterlab, "marimo": in_marimo}

if __name__ == "__main__":
    main()
