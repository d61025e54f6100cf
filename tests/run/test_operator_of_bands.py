"""The linear map of cameras that depend on the wavelength: several plans, and the sensor's response."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch

import vcc
from tests import torchvision_declared
from tests.run.dots import dot_error
from vcc.base.units import mm, nm, um

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

BANDS = (450 * nm, 520 * nm, 610 * nm)
GLASS = vcc.glasses.Cauchy(1.5046, 0.0042 * um**2)
LENS = vcc.Lens(50 * mm, 6 * mm, glass=GLASS)
CODE = vcc.Mask(np.random.default_rng(2).random((5, 6, 3)), 9 * mm, z=25 * mm)
FILTER = vcc.Mask(vcc.patterns.Open(), spectrum=vcc.Spectrum((400 * nm, 700 * nm), (0.2, 0.8)), z=10 * mm)
ORDERS = vcc.DiffractiveLens(50 * mm, 6 * mm, 532 * nm, (1, 0))
MATRIX = np.random.default_rng(3).random((2, 3))
CASES = {
    "glass": ([LENS, vcc.Prism((0.01, 0.0), glass=GLASS)], None, {}),
    "glass, grey sensor": ([LENS], "mono", {}),
    "a mask of channels and a filter, matrix": ([vcc.Lens(50 * mm, 6 * mm), CODE, FILTER], MATRIX, {}),
    "several orders": ([ORDERS], MATRIX, {"method": "footprints"}),
    "by rays": ([LENS, vcc.LensArray(1 * mm, 3 * mm, z=49 * mm, glass=GLASS)], MATRIX, {"samples": 16}),
}


def light_field() -> vcc.LightField:
    values = np.random.default_rng(0).random((4, 3, 12, 14, 3), np.float32)
    made = vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))
    return made.with_wavelengths(BANDS)


def camera(elements, response) -> vcc.Camera:
    return vcc.Camera(elements, vcc.Sensor(52.6 * mm, (9, 10), 0.15 * mm, response=response))


@pytest.mark.parametrize("name", CASES)
def test_the_map_makes_the_image_and_has_an_adjoint(name):
    elements, response, options = CASES[name]
    field = light_field()
    op = camera(elements, response).operator(field, **options)
    image = camera(elements, response).capture(field, **options).values
    np.testing.assert_allclose(op(), image, rtol=1e-6, atol=1e-6 * image.max())
    assert op.shape == (image.size, field.values.size)
    assert dot_error(op) < 1e-6


def test_a_matrix_of_all_columns_is_the_map():
    """The reference, column by column: A is what images of single samples say."""
    values = np.random.default_rng(0).random((2, 1, 3, 2, 2))
    field = vcc.LightField.from_views(values, 2 * mm, 8e-3, 1.0, disparity_range=(0, 0)).with_wavelengths(
        BANDS[:2]
    )
    op = camera([LENS], [[0.3, 0.8]]).operator(field, engine="reference")
    columns = np.stack([op(one.reshape(op.samples_shape)).ravel() for one in np.eye(values.size)], axis=1)
    picture = np.random.default_rng(1).standard_normal(op.picture_shape)
    np.testing.assert_allclose(op.T(picture).ravel(), columns.T @ picture.ravel(), atol=1e-12 * columns.max())
    assert op.as_scipy().rmatvec(picture.ravel()).shape == (values.size,)


@pytest.mark.parametrize("name", ["several orders", "a mask of channels and a filter, matrix"])
def test_stored_samples_executors_and_arrays_to_write_to(name, tmp_path):
    elements, response, options = CASES[name]
    field = light_field()
    vcc.store.save_store(field, tmp_path / "bands.zarr")
    op = camera(elements, response).operator(field, **options)
    stored = camera(elements, response).operator(vcc.store.open_store(tmp_path / "bands.zarr"), **options)
    np.testing.assert_allclose(stored(), op(), rtol=2e-6)
    picture = np.random.default_rng(1).standard_normal(op.picture_shape).astype(np.float32)
    back = op.T(picture)
    out = np.full(op.samples_shape, np.nan, np.float32)
    with ThreadPoolExecutor(2) as executor:
        assert stored.T(picture, out=out, executor=executor) is out
    np.testing.assert_allclose(out, back, rtol=0, atol=1e-6 * np.abs(back).max())
    with pytest.raises(vcc.InputError, match="pieces of the samples have all channels"):
        op.T.pieces(picture)


@pytest.mark.skipif(torchvision_declared.MISSING, reason='needs the extra "deepinv"')
def test_deepinv_has_channels_of_the_sensor():
    torchvision_declared.declare()
    op = camera([LENS], MATRIX).operator(light_field())
    physics = op.as_deepinv(scale=2.0)
    x = torch.rand((2, 3, 4, 3, 12, 14))
    image = physics(x)
    assert image.shape == (2, 2, 9, 10)
    expected = 2 * op(np.moveaxis(x.numpy(), 1, -1))
    np.testing.assert_allclose(np.moveaxis(image.numpy(), 1, -1), expected, rtol=1e-5)
    y = torch.rand_like(image)
    assert torch.dot(image.ravel(), y.ravel()).item() == pytest.approx(
        torch.dot(x.ravel(), physics.A_adjoint(y).ravel()).item(), rel=1e-5
    )
    grey = camera([LENS], "mono").operator(light_field()).as_deepinv()
    assert grey(x).shape == (2, 1, 9, 10)
    assert grey.A_adjoint(grey(x)).shape == x.shape


def test_plans_of_bands_serve_other_light_fields():
    field, glass = light_field(), camera([LENS], MATRIX)
    plans = glass.compile(field)
    other = field.replaced(field.values[::-1].copy())
    np.testing.assert_array_equal(glass.capture(other, plan=plans).values, glass.capture(other).values)
    np.testing.assert_array_equal(glass.operator(field, plan=plans)(), glass.operator(field)())
    assert "3 plans for bands" in repr(plans)
    shifted = glass.replace(sensor=vcc.Sensor(53 * mm, (9, 10), 0.15 * mm))
    for refused in (lambda: shifted.capture(field, plan=plans), lambda: glass.capture(field[..., :2], plan=plans)):
        with pytest.raises(vcc.InputError):
            refused()
    with pytest.raises(vcc.InputError, match="fixed when a plan is made"):
        glass.capture(field, plan=plans, samples=8)
    with pytest.raises(vcc.InputError, match="for each group of bands"):
        glass.capture(field, plan=glass.at_wavelength(500 * nm).compile(field))
    with pytest.raises(vcc.InputError, match="for another camera"):
        camera([vcc.Lens(50 * mm)], None).capture(field, plan=plans)


def test_a_camera_that_lets_nothing_pass_has_no_map():
    dark = vcc.Mask(vcc.patterns.Open(), spectrum=lambda wavelength: 0.0)
    with pytest.raises(vcc.InputError, match="nothing passes this camera"):
        camera([dark], None).operator(light_field())
