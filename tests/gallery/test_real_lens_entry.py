"""The real double Gauss of the gallery: its formulas against others, and the entry on a small scene."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.gallery import real_lens
from vcc.gallery.entry import bench_for, silent
from vcc.optics.prescription import Prescription, Surface
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])


def lens(*rows: tuple[float, float, float, float, bool]) -> vcc.RealLens:
    """A lens with its first surface on z = 0, of rows (radius, thickness, index behind, diameter, stop)."""
    surfaces = [
        Surface(radius=radius, thickness=thickness, index=index, diameter=diameter, stop=stop)
        for radius, thickness, index, diameter, stop in rows
    ]
    return vcc.RealLens(Prescription(tuple(surfaces)))


def test_meridional_rays_meet_the_aplanatic_points_of_a_sphere():
    """Rays towards a point n·r behind a sphere's middle leave it towards r/n (Born and Wolf, section 4.2.3)."""
    radius, index = 20 * mm, 1.5
    sharp = radius + radius / index
    # The second surface has its middle in the image: rays pass straight on.
    sphere = lens((radius, 1 * mm, index, 30 * mm, True), (sharp - 1 * mm, 0.0, 1.0, 30 * mm, False))
    for height in (1 * mm, 6 * mm, 12 * mm):
        virtual = -(radius + index * radius)  # behind the lens, so the distance before it is negative
        crossing, angle = real_lens.meridional(sphere, height, virtual)
        assert crossing == pytest.approx(sharp - 1 * mm, rel=1e-12)
        assert math.sin(angle) == pytest.approx(index * math.sin(math.atan(height / virtual)), rel=1e-12)


def test_two_discs_overlap_as_circles_do():
    r, R, d = 3.0, 4.0, 2.5
    # Two circular segments (Weisstein, Circle-Circle Intersection).
    area = (
        r**2 * math.acos((d**2 + r**2 - R**2) / (2 * d * r))
        + R**2 * math.acos((d**2 + R**2 - r**2) / (2 * d * R))
        - math.sqrt((-d + r + R) * (d + r - R) * (d - r + R) * (d + r + R)) / 2
    )
    assert real_lens.overlap(np.array([0.0, d]), np.array([r, R])) == pytest.approx(area, rel=1e-4)


def test_rims_behind_a_thin_lens_appear_where_it_images_them():
    """A hole d behind a lens of focal length f appears at d' = d/(1 − d/f), magnified by d'/d."""
    f, gap = 50 * mm, 10 * mm
    plano = lens(
        (f / 2, 0.0, 1.5, 10 * mm, False), (math.inf, gap, 1.0, 10 * mm, False), (math.inf, 0.0, 1.0, 4 * mm, True)
    )
    power = 1 / (2 * f / 2)  # (n − 1)/r
    centres, radii = real_lens.discs(plano, 0.2, math.inf)
    apparent = gap / (1 - gap * power)
    assert centres[-1] == pytest.approx(-0.2 * apparent, rel=1e-9)
    assert radii[-1] == pytest.approx(2 * mm * apparent / gap, rel=1e-9)


def test_petzval_s_sum_of_a_thin_lens_is_its_power_over_its_index():
    thin = lens((80 * mm, 0.0, 1.6, 10 * mm, True), (-40 * mm, 0.0, 1.0, 10 * mm, False))
    assert real_lens.petzval_sum(thin.prescription) == pytest.approx(0.6 * (1 / 0.08 + 1 / 0.04) / 1.6)


def test_the_entry_runs_on_a_light_field_of_one_s_own():
    field = SCENE.light_field(
        (9, 9), (64, 64), spacing=20 * mm / 9, slope_per_pixel=0.4 / 64, focus_distance=1.2, dtype="float32"
    )
    result = real_lens.Run(rays=32, point_rays=256, detail=21)(bench_for(field), silent)
    assert all(number.reached is not False for number in result.numbers), result.numbers
    assert len(result.numbers) == 8
    assert [len(row) for row in result.pictures] == [3, 1, 1, 1]
