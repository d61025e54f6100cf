"""A bench of this test's own in headless Chromium: a server in a thread, pages, and what is read off them."""

import contextlib
import shutil
import threading
import time
from pathlib import Path

import pytest
import uvicorn

from vcc.bench.document import Document
from vcc.bench.offered import Field, Offered
from vcc.bench.server import LOOPBACK, Door, application, listening, static_files
from vcc.files.camera_reading import Beside
from vcc.showcase.scene import demo_scene
from vcc.units import mm

AXE = Path(__file__).parents[2] / "bench" / "front" / "node_modules" / "axe-core" / "axe.min.js"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PATIENCE = 60_000
"""Milliseconds: what is awaited comes within some hundred, or later where kernels are to be compiled first."""

DRAWN = """
    const { bench } = document.querySelector("vcc-bench")
    const frame = () => new Promise(requestAnimationFrame)
    await frame()
    while (bench.together) await bench.together
    await frame()
"""
"""JavaScript: wait until the views, which await a picture that is under way, are drawn."""

CAMERA = {
    "elements": [
        {"kind": "lens", "name": "main", "z": "0 mm", "focal_length": "50 mm", "diameter": "18 mm"},
        {"kind": "mask", "name": "code", "z": "26 mm", "pattern": [[1, 0], [0, 1]], "width": "20 mm"},
    ],
    "sensor": {"z": "52 mm", "shape": [60, 80], "pitch": "0.25 mm"},
}

LENSLETS = {
    "elements": [
        CAMERA["elements"][0],
        {"kind": "lens_array", "name": "array", "z": "52 mm", "pitch": "0.59 mm", "focal_length": "1.73 mm"},
    ],
    "sensor": {"z": "53.73 mm", "shape": [60, 80], "pitch": "0.2 mm"},
}
"""3×3 views."""


def light_field():
    """The demo's scene, small."""
    return demo_scene().light_field(
        (3, 3), (60, 80), spacing=6 * mm, slope_per_pixel=0.25 / 52, focus_distance=1.3
    )


class Served:
    """A server that can go and come back at the same address."""

    def __init__(self) -> None:
        self.offered = Offered(
            {
                "scene": Field(
                    light_field(), "from tests.bench.browser import light_field\n\nlight_field = light_field()"
                )
            },
            Document(CAMERA, "scene"),
            Beside(Path(), frozenset()),
            {"lenslets": Document(LENSLETS, "scene")},
        )
        self.port = 0
        self.door = Door(LOOPBACK, "a-token-of-tests")

    def start(self) -> None:
        """Listen, at the port of before if there was one."""
        self._socket = listening(LOOPBACK, self.port)
        self.port = self._socket.getsockname()[1]
        config = uvicorn.Config(
            application(self.offered, self.door, static_files()),
            log_level="critical",
            ws="websockets-sansio",
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._socket]}, daemon=True)
        self._thread.start()
        while not self._server.started:
            time.sleep(0.01)

    def break_off(self) -> None:
        """Break all connections; the server stays."""
        loop = self._server.servers[0].get_loop()
        for each in list(self._server.server_state.connections):
            loop.call_soon_threadsafe(each.transport.abort)

    def stop(self) -> None:
        """End, with all connections."""
        self._server.should_exit = True
        self._thread.join(300)
        self._socket.close()

    @property
    def address(self) -> str:
        """Of its page."""
        return f"http://{LOOPBACK}:{self.port}/?token={self.door.token}"


@contextlib.contextmanager
def chromium():
    """A headless browser; the test is skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"there is no browser: none of {', '.join(BROWSERS)} (Debian's package is chromium)")
    with playwright.sync_playwright() as running:
        browser = running.chromium.launch(executable_path=found)
        yield browser
        browser.close()


class Page:
    """A page with the bench, and what it shows."""

    def __init__(self, browser, address, width=1280, height=800, **options):
        self.context = browser.new_context(viewport={"width": width, "height": height}, **options)
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.errors = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.open(address)

    def open(self, address):
        """Go to an address, and wait for its picture."""
        self.page.goto(address)
        self.settle()

    def settle(self):
        """Wait until the picture of what was asked last is there, and all views are drawn."""
        self.page.wait_for_selector('section.picture[aria-busy="false"]')
        self.drawn()

    def until(self, read, wanted):
        """Read again and again, each time at one instant, until it is the value, or fulfils the condition."""
        for _ in range(PATIENCE // 25):
            found = read()
            if wanted(found) if callable(wanted) else found == wanted:
                return found
            self.page.wait_for_timeout(25)
        raise AssertionError(f"after {PATIENCE / 1000:g} s it is still {found!r}")

    def drawn(self):
        """Wait until what the hand did last is drawn."""
        self.page.evaluate(f"async () => {{ {DRAWN} }}")

    def after(self, milliseconds):
        """Wait in the page: timers that were set there before, and for less, have come whatever delays them."""
        self.page.evaluate("pause => new Promise((later) => setTimeout(later, pause))", milliseconds)

    def part(self, name):
        """An element or the sensor on the bench, by its number or its name."""
        return self.page.locator(f'[data-part="{name}"]')

    def place(self, name):
        """Where it stands, in words."""
        return self.part(name).get_attribute("aria-valuetext")

    def wait_for_place(self, name, words):
        """Until it stands there."""
        self.page.wait_for_selector(f'[data-part="{name}"][aria-valuetext="{words}"]')

    def pulled(self, name):
        """Where it stands and what pulled it there, in words, once what the hand did last is drawn."""
        place, words = self.part(name).evaluate(
            "async part => {"
            + DRAWN
            + """
                const words = part.getRootNode().querySelector(".snap.held text")?.textContent ?? null
                return [part.getAttribute("aria-valuetext"), words]
            }"""
        )
        return place, words

    def middle(self, name):
        """Of its drawing, pixels of the page."""
        box = self.part(name).locator(".strip").bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 3

    def button(self, name):
        """A button by its label."""
        return self.page.get_by_role("button", name=name, exact=True)

    def picture(self):
        """The canvas as it looks, PNG."""
        return self.page.locator("canvas").screenshot()

    def close(self):
        """Close it; no error has come up on it."""
        self.context.close()
        assert self.errors == []
