"""What plans are linear in is learned by transposes, which agree with differences of the plans' numbers.

Oracle: the chain's own central differences, cell by cell, of which nothing is shared with the transposes. Numbers
are linear in cells and heights, so that differences are exact but for rounding; only where light meets masks
behind a part of a tap's cell, its middle is a quotient.
"""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.learn.chain import Chain
from vcc.learn.parameters import put, read
from vcc.plan.how import How
from vcc.units import mm, nm, um

GENERATOR = np.random.default_rng(7)
CODE = GENERATOR.uniform(0.2, 0.8, (2, 3))
D = 1 / (1 / 50e-3 - 1)


def field(sample="mean"):
    samples = np.random.default_rng(0).random((3, 4, 9, 8)).astype(np.float32)
    return vcc.LightField.from_views(samples, 2 * mm, 2e-3, 1.0, disparity_range=(-0.2, 0.2), sample=sample)


def sensor(z=D, pitch=0.93):
    return vcc.Sensor(z, (9, 10), D * 2e-3 * pitch)


def code(z, width=9 * mm, **more):
    return vcc.Mask(pattern=CODE, width=width, z=z, name="code", **more)


LENS = vcc.Lens(focal_length=50 * mm, diameter=7 * mm)
NARROW = vcc.Lens(focal_length=50 * mm, diameter=3 * mm)
OTHER = vcc.Mask(pattern=GENERATOR.uniform(0.1, 0.9, (7, 6)), width=8 * mm, z=30 * mm)
PLATE = vcc.PhasePlate(vcc.surfaces.HeightMap(GENERATOR.uniform(0, 2e-6, (4, 5)), 10 * mm), name="plate")
ABERRATED = vcc.PhasePlate(
    vcc.surfaces.Zernike((0.0, 0.0, 0.0, 200 * nm, 0.0, 100 * nm, 1 * um, 0.0, 0.0), 14 * mm), name="plate"
)
CODED = vcc.CodedDiffuser(
    vcc.kernels.Gaussian(1.0), 9 * mm, widths=GENERATOR.uniform(1e-3, 3e-3, (2, 2)), name="ground"
)
CAMERAS = {
    "at the views": ([vcc.Lens(focal_length=50 * mm), code(0.0)], "code.pattern", {}),
    "at the views, with the lens's stop": ([LENS, code(0.0, decentre=(0.3 * mm, 0.1 * mm))], "code.pattern", {}),
    "at the views, before another mask": ([vcc.Lens(focal_length=50 * mm), code(0.0), OTHER], "code.pattern", {}),
    "at the views, with the stop, before another mask": ([LENS, code(0.0), OTHER], "code.pattern", {}),
    "in mid-path": ([LENS, code(20 * mm)], "code.pattern", {}),
    "in mid-path, with a round sheet": (
        [LENS, code(20 * mm), vcc.Mask(pattern=vcc.patterns.Circle(6 * mm), z=20 * mm)],
        "code.pattern",
        {},
    ),
    "before another mask in mid-path": ([LENS, code(20 * mm), OTHER], "code.pattern", {}),
    "finer than samples": ([LENS, code(47 * mm, 1.5 * mm)], "code.pattern", {"refine": 2}),
    "against the sensor": ([LENS, code(D, 1 * mm)], "code.pattern", {}),
    "against the sensor, with another": (
        [LENS, code(D, 1 * mm), vcc.Mask(pattern=GENERATOR.uniform(0.1, 0.9, (3, 3)), width=1.1 * mm, z=D)],
        "code.pattern",
        {},
    ),
    "met by rays": ([NARROW, code(20 * mm)], "code.pattern", {"method": "rays", "samples": 8}),
    "a height map": ([NARROW, PLATE], "plate.surface.heights", {"samples": 8}),
    "Zernike coefficients": ([NARROW, ABERRATED], "plate.surface.coefficients", {"samples": 8}),
    "a map of widths": ([NARROW, CODED], "ground.widths", {"samples": 8}),
}


POINTS = ("at the views, before another mask", "in mid-path")
"""Cameras before samples that are points, too."""


@pytest.mark.parametrize(
    ("name", "sample"), [*((name, "mean") for name in CAMERAS), *((name, "point") for name in POINTS)]
)
def test_transposes_agree_with_differences(name, sample, monkeypatch):
    elements, parameter, options = CAMERAS[name]
    camera = vcc.Camera(elements, sensor())
    chain = Chain(camera, field(sample).grid, How(**options), [parameter])
    here = {parameter: read(camera, parameter) * 1.01}
    weights = {
        number: np.random.default_rng(3).standard_normal(value.shape)
        for number, value in chain.plan(here).parameters().items()
    }
    assert chain._at(here).linear(parameter)
    followed = chain.followed(here)[parameter]
    pulled = chain.pull(here, weights)[parameter]
    made = type(chain._at(here))
    monkeypatch.setattr(made, "linear", lambda self, name: [])
    # What reaches around an element, and how far, follows heights and widths too; no picture depends on it.
    found = {number: weights[number] for number in followed}
    differences = chain.pull(here, found)[parameter]
    np.testing.assert_allclose(pulled, differences, rtol=1e-5, atol=1e-6 * np.abs(differences).max())


def test_a_mask_of_a_million_cells_is_learned_at_once():
    cells = np.random.default_rng(1).uniform(0.2, 0.8, (1000, 1000))
    camera = vcc.Camera([LENS, vcc.Mask(pattern=cells, width=9 * mm, z=20 * mm, name="code")], sensor())
    chain = Chain(camera, field().grid, None, ["code.pattern"])
    texture = chain.plan().parameters()["core.masks[0].texture"]
    weights = {"core.masks[0].texture": np.ones(texture.shape)}
    change = np.random.default_rng(2).uniform(-0.1, 0.1, cells.shape)
    other = Chain(put(camera, {"code.pattern": cells + change}), field().grid, None, [])
    other.choices = chain.choices
    found = other.plan().parameters()["core.masks[0].texture"] - texture
    assert np.sum(chain.pull({}, weights)["code.pattern"] * change) == pytest.approx(found.sum(), rel=1e-9)
