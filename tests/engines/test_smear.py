"""The blur that interpolates between views: it conserves light, and its two implementations agree."""

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.plan.operators import AlongAxes, tent


@pytest.mark.parametrize("half_width", [1.0, 1.3, 2.0, 7.77, 40.0, 200.5])
def test_a_tent_has_the_moments_of_a_tent(half_width):
    weights = tent(half_width)
    place = np.arange(len(weights)) - len(weights) // 2
    assert weights.sum() == pytest.approx(1, abs=1e-12)
    assert weights @ place == pytest.approx(0, abs=1e-12)
    # A tent's variance is w²/6; averaging over pixels adds the pixel's 1/12. In whole pixels, that is exact for
    # whole w; else Poisson's sum adds, over the harmonics f of the pixels, the slope of sinc²(wf) at f times the
    # slope 1/f of the pixel's sinc: below (2/π³w)·Σ f⁻³ < 0.08/w.
    rest = 1e-9 if half_width == round(half_width) else 0.08 / half_width
    assert weights @ place**2 == pytest.approx(half_width**2 / 6 + 1 / 12, abs=rest)


@pytest.mark.parametrize("half_width", [3.0, 50.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_blurring_is_the_product_with_the_tents_matrix(half_width, axis):
    raster = np.random.default_rng(0).random((150, 160, 2))
    weights, reach = tent(half_width), len(tent(half_width)) // 2
    # Weight w of pixel q comes from pixel q − (w − reach), if that exists.
    truth = np.zeros_like(raster)
    there, here = np.moveaxis(raster, axis, 0), np.moveaxis(truth, axis, 0)
    for w, weight in enumerate(weights):
        for q in range(len(here)):
            if 0 <= q - (w - reach) < len(here):
                here[q] += weight * there[q - (w - reach)]
    along = AlongAxes.tents(*((half_width, 0.0) if axis == 0 else (0.0, half_width)))
    assert np.allclose(along.apply(raster), truth, atol=1e-12)


def test_a_margin_beyond_all_bounds_is_refused():
    field = vcc.LightField.from_views(np.ones((2, 2, 4, 4), np.float32), 10 * mm, 1e-3, disparity_range=(0, 0))
    camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(z=10.0, shape=(8, 8), pitch=50 * um))
    with pytest.raises(vcc.InputError, match="pixels apart on the sensor"):
        camera.compile(field)
    assert camera.compile(field, between_views="none").smear == (0.0, 0.0)
