"""Example cameras for the scene of the demo: published designs, as tables of camera files."""

from __future__ import annotations

from typing import Any

import numpy as np

from vcc.base.progress import Progress
from vcc.base.units import mm
from vcc.bench.document import Document
from vcc.bench.offered import Field
from vcc.light_field import LightField
from vcc.showcase.scene import MIDDLE, demo_scene

SCENE = "leaves, chart and town"
"""Name of the demo's scene on a bench."""
SOFT = "leaves, chart and town, without fine detail"
"""The scene after `without_detail`: a heterodyne camera cannot resolve detail finer than its tiles."""
DETAIL = 1.4
"""Sigma of the Gaussian blur, pixels of a view: 0.6 pixels of the views that the heterodyne camera decodes."""
VIEWS, PIXELS = 9, 320
"""Views and pixels along a side of the demo's light field."""
APERTURE = 20 * mm
WIDE = 25 * mm
"""Width of a view at `IMAGE`: a little more than the sensor, so that a moved sensor stays within the views."""
IMAGE = 52 * mm
PITCH = "75 um"

Json = dict[str, Any]

_LENS: Json = {"kind": "lens", "name": "main", "z": "0 mm", "focal_length": "50 mm", "diameter": "18 mm"}
_WIDE_LENS: Json = _LENS | {"diameter": "28 mm"}
_SQUARE_STOP: Json = {"kind": "mask", "name": "square stop", "z": "0 mm", "pattern": [[1]]}
_SENSOR: Json = {"z": "52 mm", "shape": [PIXELS, PIXELS], "pitch": PITCH}

HETERODYNE = "A cosine mask before the sensor: a heterodyne camera, 5×5 views of 117×117 pixels"
PLENOPTIC = "Lenslets before the sensor: a plenoptic camera, 5×5 views of 100×100 pixels"

_CAMERAS: dict[str, list[Json]] = {
    "A lens": [_LENS],
    "A coded aperture": [
        _LENS,
        {
            "kind": "mask",
            "name": "code",
            "z": "0 mm",
            "pattern": {"name": "mura", "prime": 7},
            "width": "18 mm",
        },
    ],
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
    HETERODYNE: [
        _WIDE_LENS,
        _SQUARE_STOP | {"width": "19.5 mm"},
        {
            "kind": "mask",
            "name": "cosines",
            "z": "51.52 mm",
            "pattern": {"name": "cosine_sum", "period": "0.18 mm", "harmonics": 2},
        },
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
    PLENOPTIC: [
        _WIDE_LENS,
        _SQUARE_STOP | {"width": "19.44 mm"},
        {
            "kind": "lens_array",
            "name": "lenslets",
            "z": "52 mm",
            "pitch": "0.24 mm",
            "focal_length": "0.65 mm",
            "offset": ["0.12 mm", "0.12 mm"],
        },
    ],
}

_SENSORS: dict[str, Json] = {
    HETERODYNE: {"z": "52 mm", "shape": [660, 660], "pitch": "36.3 um"},
    PLENOPTIC: {"z": "52.65 mm", "shape": [500, 500], "pitch": "48.6 um"},
}
"""Sensors of the cameras that do not use `_SENSOR`.

Lenslets of pitch p, b before the sensor and d behind the lens, have micro-images p·(1 + b/d) = 0.243 mm
apart, five pixels; a stop of 0.243 mm·d/b = 19.44 mm fills them. With a mask of period P, g before the
sensor, the tiles in the spectrum of the recording are (1 − g/d)/P apart, a fifth of the bandwidth of pixels
of 36.3 µm. The mask resolves P·d/g = 19.5 mm of the lens, the stop.
"""


def cameras(light_field: str) -> dict[str, Document]:
    """The cameras as documents, by their titles.

    Args:
        light_field: the name of the light field before them; the heterodyne camera gets `SOFT`.
    """
    found = {}
    for title, elements in _CAMERAS.items():
        tables = {"elements": elements, "sensor": _SENSORS.get(title, _SENSOR)}
        found[title] = Document(tables, SOFT if title == HETERODYNE else light_field)
    return found


def scenes() -> dict[str, Field]:
    """The demo's scene before a lens of 50 mm, as it is and `SOFT`, each computed at first use."""
    source = (
        "from vcc.showcase.scene import demo_scene\n\n"
        f"light_field = demo_scene().light_field(\n    ({VIEWS}, {VIEWS}),\n    ({PIXELS}, {PIXELS}),\n"
        f"    spacing={APERTURE / VIEWS!r},\n    slope_per_pixel={WIDE / PIXELS / IMAGE!r},\n"
        f"    focus_distance={MIDDLE!r},\n)"
    )
    softer = "\n\nfrom vcc.bench.cameras import without_detail\n\nlight_field = without_detail(light_field)"
    soft = Field(lambda progress: without_detail(_made(progress)), source + softer)
    return {SCENE: Field(_made, source), SOFT: soft}


def without_detail(light_field: LightField) -> LightField:
    """A uint8 light field whose views are blurred by a Gaussian of `DETAIL` pixels."""
    from scipy.ndimage import gaussian_filter

    values = np.empty_like(light_field.values)
    for j, i in np.ndindex(values.shape[:2]):  # one view at a time, so that the float copy is small
        view = light_field.values[j, i].astype(np.float32)
        values[j, i] = np.rint(gaussian_filter(view, (DETAIL, DETAIL, 0), mode="nearest"))
    return light_field.replaced(values)


def _made(progress: Progress | None) -> LightField:
    return demo_scene().light_field(
        (VIEWS, VIEWS),
        (PIXELS, PIXELS),
        spacing=APERTURE / VIEWS,
        slope_per_pixel=WIDE / PIXELS / IMAGE,
        focus_distance=MIDDLE,
        progress=progress,
    )
