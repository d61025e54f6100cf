"""When a diffuser is computed as a blur of the image, as a blur of each view, or by rays."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.plan.footprints.diffusers import Blurs, diffusers_as_blurs
from vcc.plan.operators import Blur, BlurViews
from vcc.shapes import kernels, surfaces
from vcc.shapes.patterns import CosineSum, Open

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")  # any camera may be requested here

D = 1 / (1 / 50e-3 - 1)
SENSOR = vcc.Sensor(D, (12, 14), D * 4e-3)
KERNEL = kernels.Gaussian(0.006)
LENS = vcc.Lens(focal_length=50 * mm)
STOPPED = vcc.Lens(focal_length=50 * mm, diameter=6 * mm)


def mask(z: float) -> vcc.Mask:
    return vcc.Mask(CosineSum(9 * mm), z=z)


def diffuser(z: float, kernel: kernels.Kernel = KERNEL) -> vcc.Diffuser:
    return vcc.Diffuser(kernel, z=z)


def coded(z: float) -> vcc.CodedDiffuser:
    return vcc.CodedDiffuser(kernels.Gaussian(1.0), 40 * mm, widths=np.array([[0.01, 0.0], [0.002, 0.005]]), z=z)


def field() -> vcc.LightField:
    values = np.random.default_rng(0).random((4, 5, 16, 18)).astype(np.float32)
    return vcc.LightField.from_views(values, 1 * mm, 4e-3, 1.0, disparity_range=(-0.1, 0.1))


def rule(*elements: vcc.Element) -> Blurs | str:
    return diffusers_as_blurs(vcc.Camera(elements, SENSOR), field())


@pytest.mark.parametrize(
    "elements",
    [
        (STOPPED, diffuser(0.0)),  # in the rim's plane: they commute, in either order
        (diffuser(0.0), STOPPED),
        (LENS, diffuser(20 * mm)),
        (STOPPED, mask(10 * mm), diffuser(20 * mm), vcc.Lens(focal_length=0.3, z=30 * mm)),
        (LENS, diffuser(10 * mm), diffuser(20 * mm)),
        (LENS, mask(20 * mm), diffuser(20 * mm)),
    ],
)
def test_a_blur_of_the_picture(elements):
    blurs = rule(*elements)
    assert isinstance(blurs, Blurs)
    assert blurs.picture is not None
    assert blurs.views is None
    assert blurs.picture.sum() == pytest.approx(1, abs=1e-9)


def test_the_blur_is_the_kernel_times_the_distance():
    far, near = (rule(LENS, diffuser(z)).picture for z in (0.0, D / 2))

    def spread(weights):
        place = np.arange(weights.shape[1]) - weights.shape[1] // 2
        return float((weights.sum(axis=0) * place**2).sum())

    # σ·distance in pixels; its square is the variance, and the tent by which weights are shared out, 1/6 pixel²,
    # is taken out again. The kernel is cut at 4 σ, which takes 0.1 % of the variance.
    pixels = 0.006 / 4e-3
    assert spread(far) == pytest.approx(pixels**2, rel=2e-3)
    assert spread(near) == pytest.approx((pixels / 2) ** 2, rel=2e-3)


def test_at_the_sensor_it_does_nothing():
    blurs = rule(STOPPED, mask(20 * mm), diffuser(D))
    assert blurs.picture.tolist() == [[1.0]]


@pytest.mark.parametrize(
    "elements",
    [
        (STOPPED, diffuser(0.0), mask(20 * mm)),
        (diffuser(0.0), vcc.Lens(focal_length=50 * mm, diameter=6 * mm, z=1 * mm)),
    ],
)
def test_a_blur_of_each_view(elements):
    blurs = rule(*elements)
    assert isinstance(blurs, Blurs)
    assert blurs.picture is None
    assert blurs.views is not None


@pytest.mark.parametrize(
    ("elements", "reason"),
    [
        ((STOPPED, diffuser(10 * mm), mask(20 * mm)), "mask at z = 20 mm absorbs behind it"),
        ((STOPPED, mask(5 * mm), diffuser(10 * mm), mask(20 * mm)), "absorbs"),
        ((STOPPED, coded(0.0)), "varies over its surface"),
        # the coded diffuser's sheet is wider than all light that reaches it
        (
            (STOPPED, diffuser(5 * mm), coded(9 * mm)),
            "coded diffuser at z = 9 mm scatters by a kernel that varies",
        ),
    ],
)
def test_neither(elements, reason):
    blurs = rule(*elements)
    assert isinstance(blurs, str)
    assert reason in blurs
    plan = vcc.Camera(elements, SENSOR).compile(field())
    assert plan.by_rays
    assert any(reason in note for note in plan.notes)


def test_a_plate_behind_the_diffuser_forbids_the_blur():
    camera = vcc.Camera(
        [STOPPED, diffuser(0.0), vcc.PhasePlate(surfaces.Cubic(20.0), diameter=20 * mm, z=9 * mm)], SENSOR
    )
    assert camera.compile(field()).by_rays


def test_a_view_that_meets_the_diffuser_in_many_places_is_not_blurred_by_itself():
    # Behind free flight each view is spread over the diffuser: then only rays know where a mask behind is met.
    assert isinstance(rule(LENS, diffuser(2 * mm), mask(20 * mm)), str)


def test_footprints_are_refused_by_name_where_rays_are_needed():
    camera = vcc.Camera([STOPPED, diffuser(10 * mm), mask(20 * mm)], SENSOR)
    with pytest.raises(vcc.InputError, match="mask at z = 20 mm absorbs behind it"):
        camera.capture(field(), method="footprints")


@pytest.mark.parametrize("shape", [(4, 5, 16, 18), (4, 5, 16, 18, 3)])
@pytest.mark.parametrize("dtype", ["float32", "uint8"])
@pytest.mark.parametrize("z_mask", [None, 20 * mm])
def test_engines_agree_on_blurs(shape, dtype, z_mask):
    import torch

    values = np.random.default_rng(0).random(shape)
    values = (values * 255).astype(dtype) if dtype == "uint8" else values.astype(dtype)
    lf = vcc.LightField.from_views(values, 1 * mm, 4e-3, 1.0, disparity_range=(-0.1, 0.1))
    lopsided = kernels.Samples(np.random.default_rng(1).random((4, 3)), 5e-3, normalise=True)
    elements = [STOPPED, diffuser(0.0, lopsided), *([] if z_mask is None else [mask(z_mask)])]
    camera = vcc.Camera(elements, SENSOR)
    plan = camera.compile(lf)
    assert not plan.by_rays
    assert any(isinstance(one, Blur) and one.scatters for one in plan.after) == (z_mask is None)
    assert any(isinstance(one, BlurViews) for one in plan.before) == (z_mask is not None)
    truth = camera.capture(lf, engine="reference").values.astype(float)
    for engine in ("numba", "array_api"):
        assert np.abs(camera.capture(lf, engine=engine).values - truth).max() < 1e-5 * truth.max()
    other = lf.replaced(torch.asarray(values))
    assert np.abs(camera.capture(other).values.numpy() - truth).max() < 1e-5 * truth.max()
    # and the light goes where rays take it: 65536 rays a pixel
    rays = camera.capture(lf, method="rays", samples=4096)
    assert np.sqrt(np.mean((rays.values - truth) ** 2)) < 0.05 * truth.std() + 3 * rays.sampling_error


@pytest.mark.parametrize("extra", [[], [vcc.Mask(Open(), z=20 * mm)]])
def test_a_lopsided_kernel_moves_light_its_way(extra):
    # All light is bent by about +δ along s, (cell of) 8e-3: it lands δ·D further, 2 pixels, whichever rule holds.
    # Convolution adds the kernel's mean to that of the picture exactly; float32 leaves 1e-5 of its width.
    values = np.zeros((3, 5))
    values[1, 4] = 1.0
    blob = np.zeros((4, 5, 16, 18), np.float32)
    blob[:, :, 6:10, 7:11] = np.random.default_rng(0).random((4, 5, 4, 4))
    lf = vcc.LightField.from_views(blob, 1 * mm, 4e-3, 1.0, disparity_range=(-0.1, 0.1))
    sensor = vcc.Sensor(D, (24, 26), D * 4e-3)
    plain = vcc.Camera([STOPPED, *extra], sensor).capture(lf).values.astype(float)
    bent = vcc.Diffuser(kernels.Samples(values, 4e-3))
    found = vcc.Camera([STOPPED, bent, *extra], sensor).capture(lf).values
    columns = np.arange(sensor.shape[1])
    middle = [(picture.sum(axis=0) * columns).sum() / picture.sum() for picture in (plain, found.astype(float))]
    assert middle[1] - middle[0] == pytest.approx(2.0, abs=1e-4)
    assert found.sum() == pytest.approx(plain.sum(), rel=1e-5)
