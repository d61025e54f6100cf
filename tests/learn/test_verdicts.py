"""What may be learned is said beforehand, with the reason; the page's table says the same."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

import vcc
from tests.learn.cameras import ELEMENTS
from vcc.learn.verdicts import verdict

TOOLS = Path(__file__).parents[2] / "tools" / "docs"


@pytest.fixture(scope="module")
def page():
    return runpy.run_path(str(TOOLS / "learning_table.py"))


@pytest.mark.parametrize(
    ("kind", "name", "method", "found", "why"),
    [
        ("lens", "main.diameter", "footprints", "exact", ""),
        ("polygon", "code.pattern.rotation", "footprints", "exact", ""),
        ("polygon", "code.pattern.rotation", "rays", "smoothed", "its edges are those of a texture"),
        ("mask of cells", "code.width", "rays", "refused", "across a border between cells of mask"),
        ("mask of cells", "code.pattern", "rays", "exact", ""),
        ("biprism", "pair.rotation", "rays", "refused", "across a border between facets"),
        ("biprism", "pair.rotation", "footprints", "refused", "bends rays by a function of position"),
    ],
)
def test_verdicts_have_reasons(page, kind, name, method, found, why):
    how = vcc.How(method=method, samples=16 if method == "rays" else None)
    said = verdict(page["camera_of"](ELEMENTS[kind]), page["FIELD"].grid, name, how)
    assert said.kind == found
    assert why in said.why
    assert bool(said.why) == (found != "exact")


def test_electronics_are_smoothed(page):
    sensor = vcc.Sensor(0.05, (6, 8), 1e-4, electronics=vcc.Electronics())
    said = verdict(vcc.Camera([], sensor), page["FIELD"].grid, "sensor.electronics.gain")
    assert said.kind == "smoothed"


@pytest.mark.parametrize("kind", ["lens", "mask of cells", "axicon"])
def test_the_table_says_so_too(page, kind):
    text = (TOOLS.parents[1] / "docs" / "learning.md").read_text(encoding="utf-8")
    written = [line for line in text.splitlines() if line.startswith(f"| {kind} |")]
    assert written == page["rows"](kind), "run: python tools/docs/learning_table.py"
