"""The learned aperture: its point spread functions and gradients by other means, and the entry as a whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import convolve2d

import vcc
from vcc.base.units import mm
from vcc.gallery import learned_aperture as learned
from vcc.gallery.entry import bench_for, silent
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

torch = pytest.importorskip("torch")
training = pytest.importorskip("vcc.gallery.torch_aperture")
SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])
SHOWN = (0, 5)
"""Of the distances."""


def seen(pixels: int) -> vcc.LightField:
    return SCENE.light_field((3, 3), (pixels, pixels), spacing=4 * mm, slope_per_pixel=0.003, focus_distance=1.2)


@pytest.fixture(scope="module")
def spreads():
    points = [learned.flat(learned.point(), learned.distance_of(learned.BLURS[n])) for n in SHOWN]
    return training.PointSpreads(learned.camera_of(np.ones((7, 7)), 2 * learned.MARGIN + 1), points)


@pytest.mark.parametrize(("row", "column"), [(3, 3), (0, 5), (6, 1)])
def test_light_of_a_cell_lands_where_its_ray_does(spreads, row, column):
    code = torch.zeros(7, 7, dtype=torch.float64)
    code[row, column] = 1
    kernels = spreads(code).numpy()
    places = np.arange(kernels.shape[1]) - learned.MARGIN
    for number, kernel in zip(SHOWN, kernels, strict=True):
        # From the near point through u, a ray reaches the sensor at u·z·(1/Z − 1/F); upright, at its opposite.
        blur = learned.BLURS[number] / 7
        assert kernel.sum() == pytest.approx(1 / 49, rel=1e-5)
        assert places @ kernel.sum(axis=1) / kernel.sum() == pytest.approx(-(row - 3) * blur, abs=1e-4)
        assert places @ kernel.sum(axis=0) / kernel.sum() == pytest.approx(-(column - 3) * blur, abs=1e-4)


def test_recordings_are_convolutions_with_the_kernels(spreads):
    code, target = learned.random_code(1, 0.5), np.random.default_rng(0).random((40, 44))
    for number, kernel in zip(SHOWN, spreads(torch.as_tensor(code)).numpy(), strict=True):
        camera = learned.camera_of(code, 24)
        image = camera.capture(
            learned.flat(target, learned.distance_of(learned.BLURS[number])), between_views="none"
        )
        # Radiance 1 through the whole opening is an irradiance of (A / z)².
        shares = image.upright().to_numpy() * (camera.sensor.z / learned.OPENING) ** 2
        made = convolve2d(target, kernel, mode="same")[8:-8, 10:-10]
        # All distances show the target at one scale, so that only float32 rounding is left.
        np.testing.assert_allclose(shares, made, atol=1e-6)


def test_gradients_are_differences_of_images(spreads):
    """Images are linear in the cells: a difference of any size is the derivative."""
    random = torch.Generator().manual_seed(0)
    code = (torch.rand(7, 7, generator=random, dtype=torch.float64) / 2).requires_grad_(True)
    wanted = torch.rand(2, 17, 17, generator=random, dtype=torch.float64)
    (spreads(code) * wanted).sum().backward()
    for row, column in ((0, 0), (2, 5)):
        other = code.detach().clone()
        other[row, column] += 0.5
        difference = ((spreads(other) - spreads(code)) * wanted).sum().item() / 0.5
        # Images are float32: 1e-7 of a sum of 1, divided by a half, for derivatives near 0.01.
        assert code.grad[row, column].item() == pytest.approx(difference, rel=1e-3)


def test_codes_have_the_light_that_they_should_have(spreads):
    assert learned.random_code(1, 0.5).sum() == 24
    assert learned.round_stop(0.5).mean() == pytest.approx(0.5, abs=2e-3)  # 280 points across a circle
    crops = learned.Crops([learned.drawn("dense", 80, 1)], seed=0)
    code, estimated = training.trained(
        spreads, np.full((7, 7), 0.5), crops, (9000.0, 2.5), share=0.5, steps=7, batch=4
    )
    assert set(np.unique(code)) <= {0, 1}
    assert code.sum() in {24, 25}
    found = estimated(crops(3)[:, :32, :32])
    np.testing.assert_allclose(np.exp(found).sum(axis=1), 1, rtol=1e-5)


def test_distances_follow_from_blurs():
    # By hand: A·(1/Z − 1/F) is an angle, and a pixel is one of 20 µm / z.
    z = 1 / (1 / 0.05 - 1 / 2.0)
    assert 0.014 * (1 / learned.distance_of(4.0) - 1 / 2.0) * z / 20e-6 == pytest.approx(4.0)


def test_the_camera_runs_on_a_light_field_of_one_s_own():
    result = learned.Run(steps=6, batch=8, picture=80, target=80)(bench_for(seen(64)), silent)
    assert len(result.numbers) == 10
    assert all(math.isfinite(number.value) for number in result.numbers)
    assert [picture.name for row in result.pictures for picture in row] == ["codes"]


def test_views_that_are_too_small_are_refused():
    with pytest.raises(vcc.InputError, match="too small"):
        learned.Run()(bench_for(seen(40)), silent)
