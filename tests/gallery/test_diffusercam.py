"""The diffuser camera: its decoder and point spread functions by other means, and the entry as a whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import convolve2d

from vcc.base.units import mm
from vcc.gallery import diffusercam
from vcc.gallery.entry import bench_for, silent
from vcc.gallery.total_variation import CroppedBlur
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])


def test_the_model_is_a_convolution_cut_off_by_the_sensor():
    random = np.random.default_rng(0)
    kernel, target = random.random((5, 7)), random.random((12, 10))
    blur = CroppedBlur(kernel, (12, 10))
    np.testing.assert_allclose(blur(target), convolve2d(target, kernel, mode="same"), atol=1e-12)


def test_the_decoder_minimises_its_objective():
    """Against L-BFGS-B on the objective with |x| replaced by √(x² + ε²), and sums written out."""
    random = np.random.default_rng(1)
    kernel = random.random((3, 3))
    kernel /= kernel.sum()
    blur, weight = CroppedBlur(kernel, (6, 6)), 3e-3
    recording = convolve2d(random.random((6, 6)), kernel, mode="same")
    (top, left), (rows, columns) = (each.start for each in blur.inside), blur.wide

    def objective(flat: np.ndarray, rounded: float = 1e-5) -> float:
        scene = flat.reshape(rows, columns)
        seen = convolve2d(scene, kernel, mode="same", boundary="wrap")[top : top + 6, left : left + 6]
        steps = np.concatenate([(np.roll(scene, -1, axis) - scene).ravel() for axis in (0, 1)])
        return float(((seen - recording) ** 2).sum() / 2 + weight * np.sqrt(steps**2 + rounded**2).sum())

    found = minimize(
        objective, np.full(rows * columns, 0.5), method="L-BFGS-B", bounds=[(0, None)] * (rows * columns)
    )
    ours = np.zeros(blur.wide)
    ours[blur.inside] = blur.recovered(recording, weight, 3000)
    # Around the sensor, `recovered` returns nothing: the best surroundings for what it returned
    free = np.ones(blur.wide, bool)
    free[blur.inside] = False
    bounds = [
        (0, None) if open_ else (value, value) for open_, value in zip(free.ravel(), ours.ravel(), strict=True)
    ]
    start = np.where(free, found.x.reshape(blur.wide), ours).ravel()
    completed = minimize(objective, start, method="L-BFGS-B", bounds=bounds)
    assert completed.fun <= found.fun * 1.002


def test_point_spread_functions_of_the_controls_are_closed_forms():
    devices = diffusercam.devices()
    lens = devices["lens"].kernel(60)
    middle = lens.shape[0] // 2
    # A tent, seen by pixels: 1/8, 3/4, 1/8; PARTS of a pixel err by 1/PARTS² at most.
    across = lens.sum(axis=0)[middle - 1 : middle + 2]
    np.testing.assert_allclose(across, [1 / 8, 3 / 4, 1 / 8], atol=1 / diffusercam.PARTS**2)
    opening = devices["open"].kernel(400).sum(axis=0)
    places = np.arange(len(opening)) - len(opening) // 2
    shadow = diffusercam.OPENING / diffusercam.PITCH * (1 + diffusercam.TO_SENSOR / diffusercam.DISTANCE)
    # Variances add: the opening's shadow, the tent, and the pixel
    assert opening @ places == pytest.approx(0, abs=1e-6)
    assert opening @ places**2 == pytest.approx(shadow**2 / 12 + 1 / 6 + 1 / 12, rel=1e-3)


def test_the_camera_runs_on_a_light_field_of_one_s_own():
    field = SCENE.light_field((3, 3), (64, 64), spacing=4 * mm, slope_per_pixel=0.003, focus_distance=1.2)
    result = diffusercam.Run(side=48, samples=256, rays=200, steps=30)(bench_for(field), silent)
    assert len(result.numbers) == 9
    assert all(math.isfinite(number.value) for number in result.numbers)
    assert result.numbers[0].reached  # the recording is the model's convolution
    assert [picture.name for row in result.pictures for picture in row] == ["recordings", "dense", "sparse"]
