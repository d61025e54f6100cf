"""Diffusers for depth of field: the plates against their gradients and closed forms, and the entry as a whole."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.gallery import diffuser_depth_of_field as diffuser
from vcc.gallery import extended_depth
from vcc.gallery.entry import bench_for, silent
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])


@pytest.fixture(scope="module")
def fine() -> vcc.LightField:
    return SCENE.light_field(
        (5, 5), (160, 160), spacing=4 * mm, slope_per_pixel=0.00125, focus_distance=1.2, dtype="float32"
    )


@pytest.mark.parametrize("power", [0, 1])
def test_slopes_are_the_gradient_of_the_path(power):
    rings = diffuser.RandomRings(5 * mm, 0.002, power)
    x, y = np.random.default_rng(1).uniform(-3.5 * mm, 3.5 * mm, (2, 500))
    # Away from the kinks between rings
    place = (np.hypot(x, y) / (5 * mm)) ** 2 * rings.rings
    x, y = (axis[np.abs(place - np.rint(place)) > 0.01] for axis in (x, y))
    h = 1e-8
    s, t = rings.slopes(x, y)
    # Central differences: rounding 1e-16·1e-5 m/h = 1e-13, and h²/6 times a third derivative of some 0.002/r²
    np.testing.assert_allclose((rings.path(x + h, y) - rings.path(x - h, y)) / (2 * h), s, atol=1e-9)
    np.testing.assert_allclose((rings.path(x, y + h) - rings.path(x, y - h)) / (2 * h), t, atol=1e-9)
    assert np.hypot(s, t).max() <= 0.002


@pytest.mark.parametrize("power", [0, 1])
def test_the_path_is_continuous_between_rings(power):
    rings = diffuser.RandomRings(5 * mm, 0.002, power)
    edges = 5 * mm * np.sqrt(np.arange(1, rings.rings) / rings.rings)
    step = rings.path(edges * (1 + 1e-9), 0) - rings.path(edges * (1 - 1e-9), 0)
    assert np.abs(step).max() < 0.002 * 5 * mm * 1e-8


def test_rays_land_where_each_ring_s_own_focal_length_says(fine):
    """A ring of the deflection −c·r is a lens 1/c: a point at Z then spreads to d·r·|1/Z − 1/F − c| at most."""
    kinds = diffuser.designed(bench_for(fine), extended_depth.Sizes(depths=3, rays=200))
    comparison, surface = kinds.comparison, kinds.random[1].surface
    spreads = comparison.spreads(kinds.random)
    radius, d = extended_depth.PUPIL / 2, comparison.sensor((1, 1)).z
    outer = radius * np.sqrt(np.arange(1, surface.rings + 1) / surface.rings)
    for spread, depth in zip(spreads, comparison.depths, strict=True):
        assert spread.sum() == pytest.approx(1)
        defocus = 1 / depth - 1 / comparison.focus
        widest = (outer * np.abs(defocus + surface.amounts * kinds.strongest / radius)).max() * d
        lit = np.flatnonzero(spread.sum(axis=0) > 0)
        pixels = widest / (comparison.slope * d)
        assert (lit[-1] - lit[0]) / 2 == pytest.approx(pixels, abs=1)  # whole pixels


def test_contrast_of_a_box_is_its_closed_form():
    spread = np.zeros((9, 9))
    spread[2:7, 3:6] = 1 / 15
    f = np.array([0.0, 0.1, 0.25, 0.4])
    with np.errstate(invalid="ignore"):
        expected = np.where(f == 0, 1, np.abs(np.sin(3 * np.pi * f) / (3 * np.sin(np.pi * f))))
    np.testing.assert_allclose(diffuser.contrast(spread, f), expected, atol=1e-14)


def test_it_runs_on_a_light_field_of_one_s_own(fine):
    run = diffuser.Run(extended_depth.Sizes(depths=3, target=80, rays=200, samples=32))
    result = run(bench_for(fine), silent)
    without, random = result.numbers[:2]
    assert random.value > 0.85 > without.value
    assert all(math.isfinite(number.value) for number in result.numbers)
    radial = next(number for number in result.numbers if number.what.startswith("PSF") and "radial" in number.what)
    assert radial.value > without.value


def test_a_scene_without_depth_is_refused(fine):
    with pytest.raises(vcc.InputError, match="nothing is out of focus"):
        diffuser.designed(replace(bench_for(fine), near=1.0, far=1.01))
