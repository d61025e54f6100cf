"""The notebooks of examples/ run as they stand, and what their cells find is true; their pages are theirs."""

from __future__ import annotations

import functools
import json
import re
import runpy
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vcc

ROOT = Path(__file__).parents[1]
NAMES = ("first_camera", "plenoptic", "learn_a_mask")


@functools.cache
def pages() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "tools" / "docs" / "notebook_pages.py"))


def shown(value: Any) -> Any:
    """A cell's last value, shown if that is fast; drawings are tested elsewhere."""
    if isinstance(value, vcc.Image | vcc.Recording | vcc.LightField | vcc.store.StoredLightField):
        value._repr_mimebundle_()
    return value


def ran(name: str) -> dict[str, Any]:
    """What the cells of a notebook define."""
    names: dict[str, Any] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        names["ran"] = list(pages()["run"](name, names, shown))
    return names


def test_all_notebooks_are_listed_and_hold_no_outputs():
    assert sorted(path.stem for path in (ROOT / "examples").glob("*.ipynb")) == sorted(NAMES)
    assert pages()["NOTEBOOKS"] == NAMES
    for name in NAMES:
        book = json.loads((ROOT / "examples" / f"{name}.ipynb").read_text(encoding="utf-8"))
        assert book["nbformat"] == 4
        assert len({cell["id"] for cell in book["cells"]}) == len(book["cells"])
        for cell in book["cells"]:
            assert cell.get("outputs", []) == []
            assert cell.get("execution_count") is None
            assert cell["source"], f"{name} has an empty cell"


@pytest.mark.parametrize("name", NAMES)
def test_a_notebooks_page_has_its_words_and_code(name):
    page = (ROOT / "docs" / "notebooks" / f"{name}.md").read_text(encoding="utf-8")
    place = 0
    for kind, source in pages()["cells"](name):
        wanted = f"```python\n{source}\n```" if kind == "code" else source.replace(".ipynb)", ".md)")
        assert wanted in page[place:], f"run: python tools/docs/notebook_pages.py; the page lacks: {source}"
        place = page.index(wanted, place)
    for picture in re.findall(r'src="\.\./(images/[^"]+)"', page):
        assert (ROOT / "docs" / picture).exists()


def test_the_first_camera_blurs_stops_down_and_counts_as_formulas_have_it():
    found = ran("first_camera")
    for traced, formula in found["blur"].values():
        # counted in pixels of 5 µm, which add 5²/12 µm² to a variance of more than 470²/16 µm²
        assert traced == pytest.approx(formula, rel=1e-3)
    # The open shares of cells sum to the areas of the discs; views differ a little in what they see.
    assert found["light"] == pytest.approx(16, rel=0.01)
    # Differences of 24000 pixels, of which the brighter count for more: 1.1 % is one standard deviation.
    assert found["measured"] == pytest.approx(found["expected"], rel=0.04)
    assert found["file"].getvalue().startswith(b"\x89PNG")
    assert found["camera"].sensor.z == pytest.approx(1 / (1 / 0.05 - 1 / 0.9))


def test_the_plenoptic_camera_keeps_all_light_and_focuses_afterwards():
    found = ran("plenoptic")
    # Patches' borders lie between pixels, and what crosses them goes to the neighbour.
    assert found["difference"] < 0.02
    stack, field = found["stack"], found["field"]
    assert field.shape[:4] == (9, 9, 48, 72)
    # Where views converge is where the lenslets see the scene sharp.
    assert field.disparity_of(0.9) == pytest.approx(0, abs=1e-9)
    # Each sharp where it is looked for: the chart, which stands at 90 cm, and the lights before the window.
    chart, lights = np.s_[28:40, 62:71], np.s_[5:12, 29:48]
    for place, distance in ((chart, 0.9), (lights, 2.5)):
        contrast = [np.square(np.diff(picture[place], axis=1)).sum() for picture in stack.pictures]
        assert stack.distances[int(np.argmax(contrast))] == distance


def test_the_mask_that_is_learned_is_the_one_that_was_there():
    found = ran("learn_a_mask")
    # central differences of float32 pictures
    assert found["slope"][found["cell"]].item() == pytest.approx(found["by_hand"], rel=1e-2)
    np.testing.assert_array_equal(np.round(found["found"]), found["heart"])
    assert found["misfits"][-1] < 1e-4 * found["misfits"][0]
    mask = found["learned"].elements[1]
    assert np.abs(mask.pattern.values - found["heart"]).max() < 0.1
