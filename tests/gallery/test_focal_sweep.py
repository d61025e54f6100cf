"""The focal sweep against the closed form of its point-spread function."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.gallery import focal_sweep
from vcc.gallery.entry import bench_for
from vcc.gallery.extended_depth import PUPIL, Sizes
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])


@pytest.fixture(scope="module")
def bench():
    field = SCENE.light_field(
        (5, 5), (160, 160), spacing=4 * mm, slope_per_pixel=0.00125, focus_distance=1.2, dtype="float32"
    )
    return bench_for(field)


def test_a_sweep_spreads_a_point_as_the_integral_over_discs(bench):
    """Light within r of the middle: each side of focus gives 4·f/(a·Δp)·(r − r²/b) of it, b the disc at its end.

    The integral over r of 2f/(π·a·Δp)·(1/r − 2/b): Kuthirummal et al. 2011, where cones are a/f wide everywhere.
    """
    still, swept = focal_sweep.designed(bench, Sizes(depths=3, rays=150))
    spreads = swept.spreads(swept.elements)
    f, pitch, half = bench.focal_length, still.sensor((1, 1)).pitches[0], swept.travel / 2
    middle = spreads.shape[1] // 2
    places = np.arange(-middle, middle + 1)
    for spread, depth in zip(spreads, swept.depths, strict=True):
        offset = still.image_at(depth) - still.image_at(still.focus)
        truth = 0.0
        for side in (half - offset, half + offset):
            b = PUPIL / f * side
            r = min(2.5 * pitch, b / 2)  # in a square of 5 pixels, by a disc that is as large
            truth += 4 * f / (PUPIL * swept.travel) * (r - r * r / b)
        inside = (np.abs(places)[:, None] <= 2) & (np.abs(places)[None, :] <= 2)
        assert spread.sum() == pytest.approx(1)
        # The disc of radius 2.5 leaves out the square's corners, 21 % of its area, where light is thinner.
        assert truth - 0.01 < spread[inside].sum() < truth + 0.1


def test_a_sweep_keeps_all_light_and_the_size_of_pictures(bench):
    _, swept = focal_sweep.designed(bench, Sizes(depths=3, target=80, samples=32))
    white = vcc.LightField.from_views(np.ones((2, 2, 80, 80), np.float32), 20 * mm, swept.slope, 1.2, (0.0, 0.0))
    picture, _ = swept.photographed(swept.elements, white, (8, 8), noise=0)
    np.testing.assert_allclose(picture, 1, rtol=1e-5)
