"""A light field from one snapshot: the example's quick version finds more by its mask than the picture holds."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from vcc.recover import ideal_camera
from vcc.units import mm

EXAMPLE = Path(__file__).parents[2] / "examples" / "compressive_light_field.py"


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(EXAMPLE))


def coded(example, light_field, seed=0):
    lens = ideal_camera(light_field, 3.0)
    cells = np.random.default_rng(seed).permuted(example["masks"](lens.sensor.shape)["random mask"])
    return example["mask_before"](lens, cells, 2.2 * mm)


def test_a_random_mask_beats_the_picture_itself(example):
    """Over 8 masks the gain was 5.3 to 5.9 dB."""
    light_field, effort = example["drawn_scene"](54, 72), example["QUICK"]
    bases = example["atoms"](example["desk_picture"](), effort)
    found = example["experiment"](light_field, coded(example, light_field), bases, effort, example["NOISE"])
    lens = ideal_camera(light_field, 3.0).operator(light_field, **example["OPTIONS"])
    picture = (lens() / lens(np.ones(lens.samples_shape)).max())[::-1, ::-1]
    everywhere = np.broadcast_to(picture, light_field.shape)
    gains = [example["psnrs"](views, light_field.values).mean() for views in (everywhere, found.views)]
    assert gains[1] > gains[0] + 4


def test_the_shadow_of_the_mask_moves_by_a_pixel_from_view_to_view(example):
    """Shadows are blurred alike in all views, so that a view further the same code is seen a pixel further."""
    light_field = example["drawn_scene"](30, 40)
    op = coded(example, light_field).operator(light_field, **example["OPTIONS"])
    weights = op.T(np.ones(op.picture_shape)).reshape(5, 5, 30, 40)
    inside = np.s_[5:-5, 5:-5]
    here = weights[2, 2][inside]
    there = [np.roll(weights[2, 3], n, axis=1)[inside] for n in (-1, 0, 1)]
    alike = [np.corrcoef(here.ravel(), other.ravel())[0, 1] for other in there]
    assert max(alike) == pytest.approx(1, abs=0.01)
    assert np.argmax(alike) != 1
