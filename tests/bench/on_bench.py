"""A small bench for tests: a light field of random noise before a lens, and a client that waits for answers."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np

import vcc
from vcc.bench.document import Document
from vcc.bench.offered import Field, Offered
from vcc.bench.session import Session
from vcc.files.camera_reading import Beside
from vcc.units import mm

PIXELS = 24
CAMERA = {
    "elements": [
        {"kind": "lens", "name": "main", "z": "0 mm", "focal_length": "50 mm", "diameter": "18 mm"},
        {"kind": "mask", "z": "26 mm", "pattern": {"name": "circle", "diameter": "12 mm"}},
    ],
    "sensor": {"z": "52 mm", "shape": [PIXELS, PIXELS], "pitch": "1 mm"},
}
START = Document(CAMERA, "noise")
NOWHERE = Beside(Path("nowhere"), frozenset())


def noise(views: int = 3, pixels: int = PIXELS) -> vcc.LightField:
    """Views that converge at 1.3 m of a plane of noise that is nearer: of one pixel per view of parallax."""
    random = np.random.default_rng(5)
    shown = random.uniform(0.1, 1, (pixels + views, pixels + views, 3)).astype(np.float32)
    values = np.stack([[shown[j : j + pixels, i : i + pixels] for i in range(views)] for j in range(views)])
    return vcc.LightField.from_views(
        values, 20 * mm / views, 25 * mm / pixels / (52 * mm), focus_distance=1.3, disparity_range=(-1.0, 1.0)
    )


def offered(**changes: object) -> Offered:
    """What the small bench offers."""
    source = "from tests.bench.on_bench import noise\n\nlight_field = noise()"
    given = {"fields": {"noise": Field(noise(), source)}, "start": START, "beside": NOWHERE} | changes
    return Offered(**given)  # type: ignore[arg-type]


class Client:
    """A client of a session in this process.

    Args:
        there: what the bench offers.
    """

    def __init__(self, there: Offered | None = None) -> None:
        self.told: list[tuple[dict, list[bytes]]] = []
        self._changed = threading.Condition()
        self.session = Session(there or offered(), self._take)

    def _take(self, message: dict, buffers: list[bytes]) -> None:
        with self._changed:
            self.told.append((message, list(buffers)))
            self._changed.notify_all()

    def do(self, doing: str, **more: object) -> None:
        """Say something."""
        self.session.receive({"do": doing, **more})

    def until(self, *kinds: str, seconds: float = 300) -> tuple[dict, list[bytes]]:
        """What is told next of these kinds; what comes before is taken away."""

        def found() -> int | None:
            return next((n for n, (message, _) in enumerate(self.told) if message["is"] in kinds), None)

        with self._changed:
            assert self._changed.wait_for(lambda: found() is not None, seconds), [m for m, _ in self.told]
            place = found()
            assert place is not None
            answer = self.told[place]
            del self.told[: place + 1]
            return answer

    def at_rest(self) -> dict:
        """The message of the next whole picture at rest."""
        while True:
            message, _ = self.until("picture", "no picture", "refused", "failed")
            remark = message["is"] == "refused" and message.get("done", False)
            if not remark and (message["is"] != "picture" or not (message["coarse"] or message["moving"])):
                return message

    def close(self) -> None:
        """Go."""
        self.session.close()
        assert self.session.join(300)
