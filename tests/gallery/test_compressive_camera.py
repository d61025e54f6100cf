"""Compressive light fields: weights and decoders by other means, and the entry as a whole."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import vcc
from vcc.base.units import mm
from vcc.gallery import compressive_light_field as compressive
from vcc.gallery import light_field_atoms
from vcc.gallery.entry import bench_for, silent
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])


def seen(views: int) -> vcc.LightField:
    return SCENE.light_field(
        (views, views), (48, 48), spacing=20 * mm / views, slope_per_pixel=0.0045, focus_distance=1.2
    )


def test_weights_are_means_of_the_mask_where_rays_cross_it():
    scene = compressive.scene_of(bench_for(seen(5)), 40)
    cells = compressive.codes(scene.lens.sensor.shape)["random"]
    camera = scene.masked(cells, 0.5)
    weights = scene.weights(camera)
    mask, sensor = camera.elements[-1], camera.sensor
    side = mask.width / cells.shape[1]
    points = (np.arange(60) + 0.5) / 60 - 0.5
    for row, column, y, x in ((0, 0, 11, 20), (4, 1, 30, 7), (2, 2, 19, 19), (1, 4, 25, 33)):
        # Samples are upright, and the sensor inverted; each stands for a square of the lens and for its pixel.
        axes = []
        for view, pixel in ((row, y), (column, x)):
            u = ((view - 2) + points) * scene.spacing
            landed = ((39 - pixel) - 19.5 + points) * sensor.pitches[0]
            crossed = landed[:, None] + (u - landed[:, None]) * (sensor.z - mask.z) / sensor.z
            axes.append(np.floor(crossed.ravel() / side + cells.shape[0] / 2).astype(int))
        down, right = (np.bincount(each, minlength=cells.shape[0]) / each.size for each in axes)
        # A share of light on the wrong side of an edge: at most 1/60 of a square for each of some 4 edges crossed.
        assert weights[row, column, y, x] * 25 == pytest.approx(down @ cells @ right, abs=4 / 60)


def test_what_is_tuned_on_has_the_disparities_of_the_scene():
    like = replace(compressive.scene_of(bench_for(seen(5)), 40), disparities=(0.0, 1.0))
    found = compressive.training_scene(like, 60).field.measured_disparity_range()
    # Rounding to 1/4 pixel; a measured range is a little wider than the scene.
    assert found == pytest.approx((0.0, 1.0), abs=0.35)


def test_the_estimate_is_the_conditional_mean(monkeypatch):
    monkeypatch.setattr(light_field_atoms, "CONTRASTS", (1.0,))
    random = np.random.default_rng(0)
    weights, basis, noise = random.random((6, 4)), random.standard_normal((6, 4, 3)), 0.1
    # Unknowns: all samples and the mean; recorded are six sums. Everything is jointly Gaussian.
    flat = basis.reshape(24, 3)
    prior = flat @ flat.T + light_field_atoms.MEAN_VARIANCE
    sums = np.zeros((6, 24))
    for pixel in range(6):
        sums[pixel, 4 * pixel : 4 * pixel + 4] = weights[pixel]
    covariance, expected = sums @ prior @ sums.T + noise**2 * np.eye(6), light_field_atoms.MEAN * sums.sum(axis=1)
    evidence, means = [], []
    for seen_there in random.random((2, 6)):
        found, coefficients, mean = light_field_atoms.estimate(weights, seen_there, basis, noise)
        truth = light_field_atoms.MEAN + prior @ sums.T @ np.linalg.solve(covariance, seen_there - expected)
        np.testing.assert_allclose(flat @ coefficients + mean, truth, atol=1e-9)
        evidence.append(found)
        means.append(multivariate_normal.logpdf(seen_there, expected, covariance))
    assert evidence[0] - evidence[1] == pytest.approx(means[0] - means[1])


def test_sparse_coefficients_are_optimal():
    """By the conditions of a minimum: Aᵀ(i − A a) is the penalty times the sign, or less where a is 0."""
    random = np.random.default_rng(1)
    matrix, wanted, penalty = random.standard_normal((20, 40)), random.standard_normal(20), 2.0
    found = light_field_atoms._lasso(matrix.astype(np.float32), wanted.astype(np.float32), penalty, 5000)
    slopes = matrix.T @ (wanted - matrix @ found)
    assert slopes[0] == pytest.approx(0, abs=1e-3)  # the constant has no penalty
    chosen = np.abs(found[1:]) > 1e-4
    assert 3 < chosen.sum() < 20
    np.testing.assert_allclose(slopes[1:][chosen], penalty * np.sign(found[1:][chosen]), atol=1e-2)
    assert np.abs(slopes[1:]).max() < penalty + 1e-2


def test_fewer_pixels_keep_what_is_smooth():
    ramp = np.broadcast_to(np.linspace(0, 1, 45)[:, None], (5, 5, 45, 45))
    np.testing.assert_allclose(compressive.fewer_pixels(ramp)[..., 14:-14, :], ramp[..., 14:-14, :], atol=5e-3)


def test_the_camera_runs_on_a_light_field_of_one_s_own():
    run = compressive.Run(side=44, training=40, rank=16, learned_from=200, picture=200, rays=64)
    result = run(bench_for(seen(7)), silent)
    assert len(result.numbers) == 8
    assert all(math.isfinite(number.value) for number in result.numbers)
    assert result.numbers[0].reached  # the model is what rays record
    assert [picture.name for row in result.pictures for picture in row] == ["recordings", "views", "slices"]


def test_too_few_views_are_refused():
    with pytest.raises(vcc.InputError, match="5×5 views"):
        compressive.Run()(bench_for(seen(3)), silent)
