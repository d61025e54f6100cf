"""Parameters in words: units that read well, and nothing longer than a line."""

import importlib
import inspect
import math
import pkgutil
import re
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np
import pytest

import vcc
from vcc.base.describe import in_brief, parameters_in_words
from vcc.base.units import deg, mm, um
from vcc.recover import focal_stack


@dataclass(frozen=True)
class Thing:
    length: Any = field(default=None, metadata={"unit": "length"})
    turn: Any = field(default=None, metadata={"unit": "angle"})
    time: Any = field(default=None, metadata={"unit": "time"})
    value: Any = None
    flag: bool = False
    on: bool = True
    table: Any = field(default_factory=lambda: np.zeros(3))


def swirl(x, y):
    return x, y


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({}, ""),
        ({"length": 59.45621789 * mm}, "length 59.4562 mm"),
        ({"length": (1 * mm, -40 * um)}, "length (1 mm, -40 um)"),
        ({"length": math.inf}, "length infinite"),
        ({"turn": 1 * deg}, "turn 1°"),
        ({"turn": -22.5 * deg}, "turn -22.5°"),
        ({"turn": math.pi / 3}, "turn 60°"),
        ({"turn": 0.002}, "turn 2 mrad"),
        ({"turn": 0.2}, "turn 0.2 rad"),
        ({"turn": (0.0, 45 * deg)}, "turn (0 rad, 45°)"),
        ({"time": 0.01}, "time 10 ms"),
        ({"value": 1 / 3}, "value 0.333333"),
        ({"value": np.float32(0.5)}, "value 0.5"),
        ({"value": 3}, "value 3"),
        ({"value": "hexagonal"}, "value hexagonal"),
        ({"flag": True, "on": False}, "flag, not on"),
        ({"value": np.linspace(-1, 2, 12).reshape(3, 4)}, "value 3×4 numbers from -1 to 2"),
        ({"length": np.full(50, 2 * mm)}, "length 50 numbers, all 2 mm"),
        ({"value": np.zeros((0, 2))}, "value 0×2 numbers"),
        ({"value": tuple(range(9))}, "value 9 numbers from 0 to 8"),
        ({"value": ((1.0, 0.0, 0.5, 3.0), (0.0, 1.0, 2.0, 4.0))}, "value 2×4 numbers from 0 to 4"),
        ({"value": ((1.0, 0.0), (0.0, 1.0))}, "value ((1, 0), (0, 1))"),
        ({"value": ((1,), (2, 3))}, "value ((1), (2, 3))"),
        ({"value": list("abcdefgh")}, "value (8 values)"),
        ({"value": swirl}, "value swirl"),
        ({"value": vcc.kernels.Gaussian(0.03)}, "value gaussian (sigma 0.03)"),
        ({"value": Thing(length=2 * mm)}, "value Thing (length 2 mm)"),
        ({"value": Thing()}, "value Thing"),
        ({"value": object()}, "value object"),
        ({"table": np.array([0.0, 0.0, 1.0])}, "table 3 numbers from 0 to 1"),
    ],
)
def test_words(parameters, words):
    assert parameters_in_words(Thing(**parameters)) == words


def test_fields_can_be_left_out():
    assert parameters_in_words(Thing(value=3, flag=True), leave_out=("value",)) == "flag"


def test_every_element_fits_a_line_of_a_wide_terminal():
    wide = np.random.default_rng(0).random((2, 50, 50))
    kernels = tuple(vcc.kernels.Gaussian(sigma) for sigma in (0.0123456, 0.02))
    elements = [
        vcc.LensArray(
            pitch=125 * um, focal_length=tuple(np.linspace(1, 2, 9) * mm), rotation=1 * deg, width=9 * mm
        ),
        vcc.CodedDiffuser(kernels, width=9 * mm, weights=wide, normalise=True),
        vcc.PrismArray(wide.T - 0.5, pitch=1 * mm, rotation=30 * deg),
        vcc.PhasePlate(vcc.surfaces.HeightMap(wide[0] * um, width=9 * mm)),
        vcc.PhasePlate(swirl, diameter=3 * mm),
        vcc.FirstOrder(np.eye(4), 10 * mm),
        vcc.Biprism(0.1234567, rotation=12.3456789 * deg, diameter=2 * mm),
        vcc.Mask(wide[0].round(), width=9 * mm),
    ]
    for element in elements:
        assert 0 < len(element.described()) < 110, element.described()
    assert "rotation 1°" in elements[0].described()
    assert "9 numbers from 1 mm to 2 mm" in elements[0].described()
    assert "rotation 12.3457°" in elements[6].described()


NEEDS_DEEPINV = ("vcc.run.torch_physics", "vcc.zoo.torch_denoiser")
"""A class of deepinv's, which does not load beside every build of PyTorch (see tests/run/test_deepinv.py)."""
NEEDS_GPU = "vcc.engines.cuda"
"""It is refused where there is none, and holds functions alone."""


def dataclasses_with_arrays():
    """Each dataclass of the package whose fields name arrays in their types."""
    for module in pkgutil.walk_packages(vcc.__path__, "vcc."):
        others = ("vcc.cli", "vcc.gallery", "vcc.demo", *NEEDS_DEEPINV)
        if module.name == NEEDS_GPU or module.name.endswith("__main__") or module.name.startswith(others):
            continue
        for each in vars(importlib.import_module(module.name)).values():
            here = inspect.isclass(each) and each.__module__ == module.name and is_dataclass(each)
            types = " ".join(str(part.type) for part in fields(each) if part.repr) if here else ""
            if re.search(r"NDArray|\bArrays?\b", types) and "Callable" not in types and each.__name__[0] != "_":
                yield each


def test_nothing_that_holds_arrays_prints_them():
    """What `dataclass` writes by itself prints every array in full."""
    walls = [each.__qualname__ for each in dataclasses_with_arrays() if hasattr(each.__repr__, "__wrapped__")]
    assert walls == []


def test_long_values_are_told_in_brief():
    stack = focal_stack(
        vcc.LightField.from_views(
            np.random.default_rng(3).random((3, 3, 24, 28, 3), np.float32), spacing=2e-3, slope_per_pixel=0.01
        ),
        [1.0, 2.0],
    )
    assert repr(stack).startswith("FocalStack(pictures=<2×24×28×3 float32 from ")
    assert repr(stack).endswith("distances=(1.0, 2.0), frame=<Affine>)")
    assert len(repr(stack)) < 300
    assert len(repr(stack.all_in_focus())) < 400
    assert in_brief(np.arange(3)) == "<3 int64 from 0 to 2>"
    assert in_brief(np.float64(2)) == "np.float64(2.0)"
    assert in_brief((1, np.zeros((0, 2)))) == "(1, <0×2 float64>)"
    assert in_brief(list(range(7))) == "<7 of int>"
    assert in_brief({"a": [1, "b"]}) == "{'a': [1, 'b']}"
    assert in_brief((5,)) == "(5,)"
