"""Write the table of learnable parameters into docs/learning.md: python tools/docs/learning_table.py."""

from __future__ import annotations

import re
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

import vcc
from tests.learn.cameras import ELEMENTS
from vcc.learn.parameters import names
from vcc.learn.verdicts import Verdict, verdict
from vcc.units import mm

PAGE = Path(__file__).parents[2] / "docs" / "learning.md"
BEGIN, END = "<!-- table: python tools/docs/learning_table.py -->\n", "<!-- end of the table -->"
FIELD = vcc.LightField.from_views(np.ones((9, 9, 16, 16), np.float32), 1 * mm, 8e-3, 1.0, (-0.3, 0.3))
ALIKE = (
    "mask of cells with a height",
    "mask of cosines on a sheet",
    "gaussian diffuser of two widths",
    "lens array of two",
)
"""What has the lines of another."""
BY_RAYS = "bends rays by a function of position|scatters by a kernel that varies"


def camera_of(element: vcc.Element) -> vcc.Camera:
    """Where an element of its kind mostly stands: plates at a lens, arrays near the sensor, others between."""
    lens = [] if element.name == "main" else [vcc.Lens(60 * mm, 4 * mm, z=2 * mm, name="main")]
    at_lens = element.name == "main" or isinstance(element, vcc.PhasePlate | vcc.CodedDiffuser)
    at = 58 * mm if isinstance(element, vcc.LensArray) else 2 * mm if at_lens else 10 * mm
    return vcc.Camera([*lens, replace(element, z=at)], vcc.Sensor(60 * mm, (6, 8), 0.1 * mm))


def in_words(found: Verdict) -> str:
    """A verdict for the table."""
    if found.kind == "exact":
        return "exact"
    if re.search(BY_RAYS, found.why):
        return "by rays only"
    edges = re.search(r"moves rays across (.*), a hard edge that", found.why)
    if edges:
        if "which kernel" in edges[1]:
            return "refused: which kernel is picked jumps"
        return f"refused: edges of {next((kind for kind in ('cells', 'facets') if kind in edges[1]), 'a rim')}"
    return f"{found.kind}: {found.why}" if found.kind == "smoothed" else f"refused: {reason(found.why)}"


def reason(why: str) -> str:
    """A refusal in few words."""
    return "a decision hangs on it" if "not what it was when the plan was made" in why else why


def rows(kind: str) -> list[str]:
    """Lines of the table for an element: parameters of the same verdicts together."""
    camera = camera_of(ELEMENTS[kind])
    own = [name for name in names(camera) if name.split(".")[0] == ELEMENTS[kind].name]
    alike: dict[tuple[str, str], list[str]] = {}
    for name in own:
        said = tuple(
            in_words(verdict(camera, FIELD.grid, name, vcc.How(method=method, samples=samples)))
            for method, samples in (("footprints", None), ("rays", 16))
        )
        alike.setdefault(said, []).append(f"`{name.partition('.')[2]}`")
    return [f"| {kind} | {', '.join(each)} | {said[0]} | {said[1]} |" for said, each in alike.items()]


def table() -> str:
    """The whole table."""
    head = ["| element | parameters | footprints | rays |", "|---|---|---|---|"]
    return "\n".join([*head, *(row for kind in ELEMENTS if kind not in ALIKE for row in rows(kind))]) + "\n"


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    text = PAGE.read_text(encoding="utf-8")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    PAGE.write_text(f"{before}{BEGIN}\n{table()}\n{END}{after}", encoding="utf-8")
