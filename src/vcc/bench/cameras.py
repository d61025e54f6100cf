"""Cameras to begin with on a bench, for the scene of the demo: published ones, as tables of camera files."""

from __future__ import annotations

from typing import Any

from vcc.base.progress import Progress
from vcc.base.units import mm
from vcc.bench.document import Document
from vcc.bench.offered import Field
from vcc.light_field import LightField
from vcc.showcase.scene import MIDDLE, demo_scene

SCENE = "leaves, chart and town"
"""What the demo's scene is called on a bench."""
VIEWS, PIXELS = 9, 320
"""A side of the demo's light field."""
APERTURE = 20 * mm
WIDE = 25 * mm
"""Of a view, at `IMAGE`: a little wider than the sensor, so that moving it never looks past the views."""
IMAGE = 52 * mm
PITCH = "75 um"

Json = dict[str, Any]

_LENS: Json = {"kind": "lens", "name": "main", "z": "0 mm", "focal_length": "50 mm", "diameter": "18 mm"}
_SENSOR: Json = {"z": "52 mm", "shape": [PIXELS, PIXELS], "pitch": PITCH}

_CAMERAS: dict[str, list[Json]] = {
    "A lens": [_LENS],
    "A coded aperture (MURA) half-way": [
        _LENS,
        {
            "kind": "mask",
            "name": "code",
            "z": "26 mm",
            "pattern": {"name": "mura", "prime": 13},
            "width": "21 mm",
        },
    ],
    "A cosine mask before the sensor, as in heterodyne cameras": [
        _LENS,
        {"kind": "mask", "name": "cosine", "z": "50 mm", "pattern": {"name": "cosine_sum", "period": "1.6 mm"}},
    ],
    "Wavefront coding: a cubic plate at the lens": [
        _LENS,
        {
            "kind": "phase_plate",
            "name": "cubic",
            "z": "0 mm",
            "surface": {"name": "cubic", "strength": 25.0},
            "diameter": "18 mm",
        },
    ],
    "A diffuser at the lens": [
        _LENS,
        {"kind": "diffuser", "name": "ground glass", "z": "0 mm", "kernel": {"name": "gaussian", "sigma": 0.004}},
    ],
    "Two pictures through a biprism": [
        _LENS,
        {"kind": "biprism", "name": "biprism", "z": "0 mm", "deflection": 0.04},
    ],
    "Lenslets before the sensor: a plenoptic camera": [
        _LENS,
        {"kind": "lens_array", "name": "lenslets", "z": "52 mm", "pitch": "0.6 mm", "focal_length": "1.3 mm"},
    ],
}


def cameras(light_field: str) -> dict[str, Document]:
    """The cameras, as what a bench shows, by their titles.

    Args:
        light_field: the name of the one before them.
    """
    found = {}
    for title, elements in _CAMERAS.items():
        behind = any(element["kind"] == "lens_array" for element in elements)
        sensor = _SENSOR | ({"z": "53.3 mm"} if behind else {})
        found[title] = Document({"elements": elements, "sensor": sensor}, light_field)
    return found


def scene() -> Field:
    """The demo's scene before a lens of 50 mm, made when it is first looked at."""
    source = (
        "from vcc.showcase.scene import demo_scene\n\n"
        f"light_field = demo_scene().light_field(\n    ({VIEWS}, {VIEWS}),\n    ({PIXELS}, {PIXELS}),\n"
        f"    spacing={APERTURE / VIEWS!r},\n    slope_per_pixel={WIDE / PIXELS / IMAGE!r},\n"
        f"    focus_distance={MIDDLE!r},\n)"
    )
    return Field(_made, source)


def _made(progress: Progress | None) -> LightField:
    return demo_scene().light_field(
        (VIEWS, VIEWS),
        (PIXELS, PIXELS),
        spacing=APERTURE / VIEWS,
        slope_per_pixel=WIDE / PIXELS / IMAGE,
        focus_distance=MIDDLE,
        progress=progress,
    )
