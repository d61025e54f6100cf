"""The tensor display: its layers against rays and light fields of known rank, and the entry as a whole."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.gallery import tensor_display
from vcc.gallery.entry import bench_for, silent
from vcc.gallery.tensor_display import VIEWS, Display
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])


def seen(views: int) -> vcc.LightField:
    return SCENE.light_field(
        (views, views), (48, 48), spacing=20 * mm / views, slope_per_pixel=0.003, focus_distance=1.2
    )


def random_layers(frames: int, layers: int) -> np.ndarray:
    side = 20 + 2 * tensor_display.margin(layers)
    return np.random.default_rng(0).uniform(0.2, 1, (frames, layers, side, side + 3)).astype(np.float32)


def test_products_of_layers_written_out():
    layers = random_layers(2, 3)
    shown = Display(layers).views()
    for row, column, y, x in ((0, 0, 3, 5), (4, 1, 0, 0), (2, 3, 19, 22)):
        down, right = row - 2, column - 2
        products = [
            frame[0, y + 2 - down, x + 2 - right] * frame[1, y + 2, x + 2] * frame[2, y + 2 + down, x + 2 + right]
            for frame in layers
        ]
        assert shown[row, column, y, x] == pytest.approx(np.mean(products), rel=1e-6)


@pytest.mark.parametrize(("row", "column"), [(0, 3), (4, 1)])
def test_rays_through_masks_see_the_products(row, column):
    layers = random_layers(1, 3)
    found = tensor_display.traced(layers[0], row, column)
    # One of 8 × 8 rays of a cell on the wrong side of an edge is 1/64 of a difference of at most 0.8.
    np.testing.assert_allclose(found, Display(layers).through(row, column)[0], atol=2 / 64)


def test_errors_fall_and_a_light_field_of_rank_one_is_found():
    target = Display(random_layers(1, 2)).views()
    errors = [
        float(np.square(tensor_display.factorised(target, 2, 1, steps).views() - target).mean())
        for steps in (1, 5, 25, 150)
    ]
    assert errors == sorted(errors, reverse=True)
    assert math.sqrt(errors[-1]) < 0.01 * target.std()


def test_a_barrier_shows_means_of_blocks():
    target = np.random.default_rng(0).random((VIEWS, VIEWS, 10, 15)).astype(np.float32)
    shown = tensor_display.barrier(target)
    np.testing.assert_allclose(shown[1, 2, 5:, 10:], target[1, 2, 5:, 10:].mean(), rtol=1e-6)


def test_the_display_runs_on_a_light_field_of_one_s_own():
    result = tensor_display.Run(side=48, steps=8)(bench_for(seen(7)), silent)
    assert len(result.numbers) == 7
    assert all(math.isfinite(number.value) for number in result.numbers)
    assert [picture.name for row in result.pictures for picture in row] == ["views", "layers"]


def test_too_few_views_are_refused():
    with pytest.raises(vcc.InputError, match="5×5 views"):
        tensor_display.Run()(bench_for(seen(3)), silent)
