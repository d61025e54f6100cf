"""The coded aperture in a real lens: its kernels by hand, and the entry on a small target."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.gallery import coded_aperture_real_lens as coded
from vcc.gallery.entry import bench_for, silent
from vcc.gallery.published_codes import ZHOU_NAYAR
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves


def field(pixels: int) -> vcc.LightField:
    scene = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])
    return scene.light_field(
        (3, 3), (pixels, pixels), spacing=7 * mm, slope_per_pixel=0.4 / pixels, focus_distance=1.2, dtype="float32"
    )


def test_the_thin_lens_paints_the_code_upside_down_behind_the_focus():
    lens = coded.Apertures(4.0)
    cells = vcc.analysis.psf(
        lens.thin("code"), coded.DISTANCE, pitch=lens.pitch * coded.BLUR / 13, shape=(13, 13)
    ).values
    # 16 rays stand along a cell: its edges are met to half of one, on both sides.
    np.testing.assert_allclose(cells, ZHOU_NAYAR[::-1, ::-1] / ZHOU_NAYAR.sum(), atol=1 / 16 / ZHOU_NAYAR.sum())
    # x = d·u·(1/Z − 1/F): 20 pixels are the code's width in the entrance pupil, times d/3.
    scale, distance = lens._pupil
    assert 20 * lens.pitch == pytest.approx(scale * lens.width * distance / 3)


def test_the_code_touches_the_round_stop_and_the_round_opening_has_its_area():
    lens = coded.Apertures(2.0)
    stop, cell = vcc.load_lens(coded.LENS, f_number=2).stop_diameter, lens.width / 13
    places = np.arange(-6, 7) * cell
    inside = [
        np.hypot(*(np.abs(each) + cell / 2 for each in np.meshgrid(places, places)))[ZHOU_NAYAR > 0] / (stop / 2)
    ]
    assert np.max(inside) == pytest.approx(1.0)
    assert math.pi / 4 * lens.pattern("round").size[0] ** 2 == pytest.approx(cell**2 * ZHOU_NAYAR.sum())


def test_the_entry_runs_on_a_light_field_of_one_s_own():
    result = coded.Run(most=coded.LEAST, rays=256, f_numbers=(2.0,))(bench_for(field(96)), silent)
    assert len(result.numbers) == 8
    assert all(math.isfinite(number.value) for number in result.numbers)
    assert next(number for number in result.numbers if "light through the code" in number.what).reached
    # A kernel that is wrong costs more than it gains.
    right, thin = (
        next(number.value for number in result.numbers if number.what.startswith(f"f/2, corner: {words}"))
        for words in ("deblurred", "the same with")
    )
    assert right > thin + 3
    with pytest.raises(vcc.InputError, match="88×88 are the fewest"):
        coded.Run()(bench_for(field(80)), silent)
