"""Gradients of cameras that depend on the wavelength: numbers of glasses, masks of channels, filters, responses.

Oracle: differences of images in double precision, by the reference.
"""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.func import functional_call

import vcc
from vcc.learn.verdicts import verdict
from vcc.torch import CameraModule
from vcc.units import mm, nm, um

BANDS = (450 * nm, 530 * nm, 640 * nm)
FIELD = vcc.LightField.from_views(
    np.random.default_rng(0).random((3, 3, 5, 4, 3)),
    1.6 * mm,
    12e-3,
    1.0,
    disparity_range=(-0.3, 0.4),
    sample="point",
).with_wavelengths(BANDS)
CAUCHY = vcc.glasses.Cauchy(1.5046, 0.0042 * um**2)
ABBE = vcc.glasses.Abbe(1.62, 36.4)
LENS = vcc.Lens(57 * mm, 3.7 * mm, z=2.1 * mm, decentre=(0.13 * mm, 0.07 * mm), glass=ABBE, name="main")
PRISM = vcc.Prism((0.012, -0.004), z=9 * mm, glass=CAUCHY, name="wedge")
CODE = vcc.Mask(np.random.default_rng(1).uniform(0.2, 0.8, (2, 3, 3)), 7 * mm, z=20 * mm, name="code")
FILTER = vcc.Mask(
    vcc.patterns.Open(), spectrum=vcc.Spectrum((400 * nm, 500 * nm, 700 * nm), (0.2, 0.6, 0.3)), name="filter"
)
ORDERS = vcc.DiffractiveLens(57 * mm, 3.7 * mm, 532 * nm, (1, 0), z=2.1 * mm, name="main")
SENSOR = {"z": 60 * mm, "shape": (3, 4), "pitch": (0.41 * mm, 0.37 * mm), "decentre": (0.11 * mm, -0.07 * mm)}
MATRIX = ((0.2, 0.5, 0.1), (0.7, 0.1, 0.4))
CURVES = tuple(vcc.Spectrum((400 * nm, 560 * nm, 700 * nm), v) for v in ((0.1, 0.5, 0.9), (0.8, 0.2, 0.1)))
CASES = {
    "glass": (
        [LENS, PRISM],
        "mono",
        [
            "main.focal_length",
            "main.glass.V",
            "wedge.deflection",
            "wedge.glass.B",
            "wedge.design_wavelength",
            "sensor.z",
        ],
    ),
    "mask of channels": (
        [LENS, CODE],
        MATRIX,
        ["code.pattern.patterns[0]", "code.pattern.patterns[2]", "main.focal_length", "sensor.response"],
    ),
    "equal masks of channels part": (
        [vcc.Lens(57 * mm, 3.7 * mm), vcc.Mask(np.full((2, 3, 3), 0.5), 7 * mm, z=20 * mm, name="code")],
        None,
        ["code.pattern.patterns[1]", "code.pattern.patterns[2]"],
    ),
    "filter and curves": (
        [LENS, FILTER],
        CURVES,
        ["filter.spectrum", "sensor.response[0]", "sensor.response[1]", "main.glass.V"],
    ),
    "orders": ([ORDERS], MATRIX, ["main.focal_length", "main.design_wavelength"]),
}


def camera_of(name: str) -> vcc.Camera:
    elements, response, _ = CASES[name]
    elements = [
        vcc.Prism((0.012, -0.004), z=9 * mm, glass=CAUCHY, design_wavelength=550 * nm, name="wedge")
        if each is PRISM
        else each
        for each in elements
    ]
    return vcc.Camera(elements, vcc.Sensor(**SENSOR, response=response))


@pytest.mark.parametrize("name", CASES)
def test_gradients_are_those_of_differences(name):
    """A change of 1 moves light by some pixels: see test_torch_gradients for the step and the tolerances."""
    camera, learn = camera_of(name), CASES[name][2]
    for each in learn:
        assert verdict(camera, FIELD.grid, each, vcc.How(method="footprints", refine=1)).kind == "exact"
    model = CameraModule(camera, FIELD, learn, engine="reference", method="footprints", refine=1)
    keys, numbers = zip(*((key, number.detach()) for key, number in model.named_parameters()), strict=True)
    image = model().detach()
    np.testing.assert_allclose(
        image.numpy(),
        camera.capture(FIELD, engine="reference", method="footprints", refine=1).values,
        rtol=1e-6,
        atol=1e-6 * float(image.max()),
    )
    weights = torch.randn(*image.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(1))

    def weighted(*moved):
        made = functional_call(model, dict(zip(keys, moved, strict=True)), ())
        return (made * weights).sum() / image.abs().mean()

    given = tuple(number.clone().requires_grad_() for number in numbers)
    assert torch.autograd.gradcheck(weighted, given, eps=1e-5, atol=1e-5, rtol=1e-3, check_undefined_grad=False)
    for found in torch.autograd.grad(weighted(*given), given):
        assert found.abs().max() > 1e-4  # none is lost


def test_gradients_to_samples_are_the_adjoint_and_jax_agrees():
    jax = pytest.importorskip("jax")
    from vcc.jax import CameraFunction

    camera, learn = camera_of("mask of channels"), ["main.focal_length", "sensor.response"]
    options = {"method": "footprints", "refine": 1}
    model = CameraModule(camera, FIELD, learn, **options)
    samples = torch.rand((2, *FIELD.shape), requires_grad=True)
    responses = torch.rand((3, 2, 3), dtype=torch.float64, requires_grad=True)
    images = model(samples, values={"sensor.response": responses})
    assert images.shape == (3, 2, 3, 4, 2)
    weights = torch.randn_like(images)
    to_samples, to_responses = torch.autograd.grad((images * weights).sum(), (samples, responses))
    for n in range(3):
        sensor = vcc.Sensor(**SENSOR, response=responses[n].detach().numpy())
        op = camera.replace(sensor=sensor).operator(FIELD, **options)
        np.testing.assert_allclose(images[n].detach(), op(samples.detach().numpy()), rtol=2e-5)
    back = sum(
        camera.replace(sensor=vcc.Sensor(**SENSOR, response=responses[n].detach().numpy()))
        .operator(FIELD, **options)
        .T(weights[n].numpy())
        for n in range(3)
    )
    np.testing.assert_allclose(to_samples, back, rtol=0, atol=2e-6 * np.abs(back).max())
    assert to_responses.shape == (3, 2, 3)

    function = CameraFunction(camera, FIELD, learn, **options)
    values = function.values
    np.testing.assert_allclose(function(values), model().detach(), rtol=1e-6)
    found = jax.grad(lambda given: (function(given) * weights[0, 0].numpy()).sum())(values)
    (model() * weights[0, 0]).sum().backward()
    for name, number in model.named_parameters():
        np.testing.assert_allclose(found[name], number.grad, rtol=1e-4)
    assert "one of 3 plans" in model.explain()


def test_a_filter_that_is_closed_at_first_raises_an_error_that_names_the_way_out():
    closed = vcc.Mask(
        vcc.patterns.Open(), spectrum=vcc.Spectrum((400 * nm, 500 * nm, 700 * nm), (0, 0, 1)), name="filter"
    )
    half = vcc.Mask(vcc.patterns.Open(), spectrum=lambda wavelength: 0.0 if wavelength < 500 * nm else 1.0)
    with pytest.raises(vcc.InputError, match="begin with transmissions above 0"):
        CameraModule(vcc.Camera([LENS, closed], vcc.Sensor(**SENSOR)), FIELD, ["filter.spectrum"])
    image = CameraModule(vcc.Camera([LENS, half], vcc.Sensor(**SENSOR)), FIELD, ["main.focal_length"])()
    assert not image[..., 0].any()
    assert image[..., 1].any()
