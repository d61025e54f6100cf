"""Derivatives to parameters that are called exact pass `torch.autograd.gradcheck`, by the reference in float64."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.func import functional_call

import vcc
from tests.learn.cameras import ELEMENTS
from vcc.learn.parameters import names
from vcc.learn.verdicts import verdict
from vcc.torch import CameraModule
from vcc.units import mm

FIELD = vcc.LightField.from_views(
    np.random.default_rng(0).random((4, 3, 5, 4)),
    1.6 * mm,
    12e-3,
    1.0,
    disparity_range=(-0.3, 0.4),
    sample="point",
)
SENSOR = vcc.Sensor(60 * mm, (3, 4), (0.41 * mm, 0.37 * mm), decentre=(0.11 * mm, -0.07 * mm), fill_factor=0.8)
LENS = vcc.Lens(57 * mm, 3.7 * mm, z=2.1 * mm, decentre=(0.13 * mm, 0.07 * mm), name="main")

BY_FOOTPRINTS = [
    "mask of cells",
    "mask of cosines",
    "circle",
    "gaussian diffuser",
    "quadratic plate",
    "first order",
]
BY_RAYS = ["gaussian diffuser", "cubic plate", "lens array of two", "real lens"]


def camera_with(kind):
    element = ELEMENTS[kind]
    lens = [] if element.name in ("relay", "objective") else [LENS]
    at_lens = kind == "cubic plate"
    z = 58 * mm if isinstance(element, vcc.LensArray) else 2.1 * mm if at_lens else 10.3 * mm
    return vcc.Camera([*lens, replace(element, z=z, decentre=(0.05 * mm, -0.08 * mm))], SENSOR)


def check(camera, learn, **options):
    """All parameters' derivatives of a weighted picture against differences of it.

    A change of 1 moves light by some pixels. A step of 1e-5 leaves 1e-16/1e-5 = 1e-11 of the picture as rounding,
    and where a slope has a corner (pieces of polynomials in the pixels, textures of rays) half a step: 1e-5 of it.
    """
    model = CameraModule(camera, FIELD, learn, engine="reference", **options)
    keys, numbers = zip(*((name, number.detach()) for name, number in model.named_parameters()), strict=True)
    weights = torch.randn(*SENSOR.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    unit = 1 / model().detach().abs().mean()

    def weighted(*moved):
        return (functional_call(model, dict(zip(keys, moved, strict=True)), ()) * weights).sum() * unit

    given = tuple(number.clone().requires_grad_() for number in numbers)
    assert torch.autograd.gradcheck(weighted, given, eps=1e-5, atol=1e-5, rtol=1e-3, check_undefined_grad=False)


@pytest.mark.parametrize("kind", BY_FOOTPRINTS)
def test_by_footprints(kind):
    camera, how = camera_with(kind), vcc.How(refine=1)
    own = [name for name in names(camera) if name.split(".")[0] == ELEMENTS[kind].name]
    check(camera, [name for name in own if verdict(camera, FIELD.grid, name, how).kind == "exact"], how=how)


def test_by_rays_through_a_function_of_place_and_slope():
    seeing = vcc.RayFilter(lambda x, y, s, t: 0.5 + 0.4 * np.sin(3e4 * x * s + 900 * y), z=40 * mm, name="filter")
    camera = vcc.Camera([LENS, seeing], SENSOR)
    check(camera, ["main.focal_length", "filter.z", "filter.decentre"], samples=16)


def test_by_footprints_lens_and_sensor():
    camera = camera_with("prism")
    check(camera, [name for name in names(camera) if name.split(".")[0] in ("main", "sensor")], refine=1)


def test_the_pitch_where_differences_of_captures_need_small_steps():
    """Cells against the sensor cross the edges of sensitive areas: a step of 1e-3 contains some crossings.

    Between them, the image is smooth in the pitch. Detail of two pixels moves by 10 pixels per pitch at the ends:
    a central difference over h errs by (π·10·h)²/6, 7e-6 of the largest slope for h = 2e-4; the sum is flatter.
    """
    random = np.random.default_rng(13)
    field = vcc.LightField.from_views(
        random.random((3, 3, 20, 20)), 1 * mm, 2e-3, disparity_range=(0, 1), sample="point"
    )
    pitch, z = 0.05 * mm, 56 * mm
    cells = vcc.Mask(random.random((30, 30)), width=21 * pitch, z=z)
    sensor = vcc.Sensor(z, (21, 22), pitch, fill_factor=0.373)
    camera = vcc.Camera([vcc.Lens(50 * mm, diameter=3 * mm), cells], sensor)
    weights = random.standard_normal(sensor.shape)
    model = CameraModule(camera, field, ["sensor.pitch"], engine="reference")
    number = torch.tensor(pitch, dtype=torch.float64, requires_grad=True)
    picture = model(values={"sensor.pitch": number}).reshape(sensor.shape)
    (slope,) = torch.autograd.grad((picture * torch.as_tensor(weights)).sum(), number)

    def difference(step):
        ends = (
            vcc.Camera(camera.elements, replace(sensor, pitch=pitch * (1 + each)))
            .capture(field, engine="reference")
            .values.astype(float)
            for each in (step, -step)
        )
        return sum(sign * (each * weights).sum() for sign, each in zip((1, -1), ends, strict=True)) / (
            2 * step * pitch
        )

    found = [difference(step) / float(slope) - 1 for step in (1e-3, 2e-4)]
    assert abs(found[0]) > 1e-2
    assert abs(found[1]) < 1e-4


@pytest.mark.parametrize("kind", BY_RAYS)
def test_by_rays(kind):
    camera, how = camera_with(kind), vcc.How(method="rays", samples=8)
    own = [name for name in names(camera) if name.split(".")[0] in (ELEMENTS[kind].name, "sensor")]
    # Of a real lens all 30 are exact, as the check below finds: a verdict on each takes a quarter of a second.
    asked = own[::6] if kind == "real lens" else own
    exact = [name for name in asked if verdict(camera, FIELD.grid, name, how).kind == "exact"]
    assert len(exact) >= 5
    if kind == "real lens":
        assert exact == asked
        exact = own
    check(camera, exact, how=how)
