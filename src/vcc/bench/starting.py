"""Six cameras to begin with, each with a sentence and a thumbnail; `tools/docs/bench_presets.py` makes these."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources

from vcc.bench.cameras import PLENOPTIC
from vcc.bench.document import Document
from vcc.bench.published import title_of

PRESETS: Mapping[str, tuple[str, str, str]] = {
    "A lens": ("lens", "Thin lens", "Move the sensor: another distance becomes sharp."),
    "A coded aperture": ("coded", "Coded aperture", "Points out of focus have the shape of the code."),
    PLENOPTIC: ("plenoptic", "Plenoptic camera", "Each lenslet images the lens: refocus it under Decoded."),
    "Wavefront coding: a cubic plate at the lens": (
        "wavefront",
        "Wavefront coding",
        "Almost the same blur at all distances.",
    ),
    "A diffuser at the lens": ("diffuser", "Diffuser", "Ground glass in the aperture spreads each point."),
    title_of("integral-lens-prism"): (
        "integral",
        "Integral camera",
        "Lenses and prisms make several images of the scene.",
    ),
}
"""The name of a thumbnail, a short title and a sentence, by the title of a camera."""


def presets(cameras: Mapping[str, Document]) -> dict[str, tuple[str, str, bytes]]:
    """The short title, the sentence and the thumbnail, WebP, of each preset among these cameras, by title."""
    folder = resources.files("vcc.bench") / "presets"
    return {
        title: (label, words, (folder / f"{name}.webp").read_bytes())
        for title, (name, label, words) in PRESETS.items()
        if title in cameras
    }
