"""Point spread functions by waves: Airy's pattern, the transfer function of a disc, and the angular spectrum."""

import math
import re

import numpy as np
import pytest
from scipy.special import j0, j1

import vcc
from tests.physics.test_diffraction import by_waves, camera_of, in_pixels
from vcc.analysis import mtf, psf
from vcc.units import mm, nm, um

GREEN, F, DIAMETER = 550 * nm, 50 * mm, 6.25 * mm
SPREAD = GREEN * F / DIAMETER
"""λN, metres."""


def camera(*elements, d=F, pitch=1 * um):
    return vcc.Camera(elements, vcc.Sensor(z=d, shape=(41, 41), pitch=pitch))


LENS = vcc.Lens(F, diameter=DIAMETER)


def test_a_point_in_focus_is_airys_pattern():
    """Encircled energy 1 − J0² − J1² at its zeros; a circle's edge cuts less than 10⁻³ of the light there."""
    found, size = psf(camera(LENS), math.inf, shape=(161, 161), wavelength=GREEN), 161
    places = (np.arange(8 * size) + 0.5) / 8 - size / 2
    for zero in (1.2197, 2.2331, 3.2383):
        inside = places**2 + places[:, None] ** 2 <= (zero * SPREAD / um) ** 2
        energy = (found.values * inside.reshape(size, 8, size, 8).mean(axis=(1, 3))).sum()
        v = math.pi * zero
        assert energy == pytest.approx(1 - j0(v) ** 2 - j1(v) ** 2, abs=1e-3)
    # The light beyond r tends to 2·λN/(π²·r), and 0.9 of it beyond a square of this half side. A quarter of what
    # falls beyond twice the square comes in again.
    beyond = 0.9 * 2 * SPREAD / math.pi**2 / (80.5 * um)
    assert found.outside == pytest.approx(beyond * (1 - 1 / 8), rel=0.03)


def test_the_transfer_function_of_coarse_pixels_is_not_aliased():
    """2/π·(arccos f − f·√(1 − f²)) times the pixel's sinc, on and off the axis; pixels are 2.3 λN."""
    coarse = camera(LENS, pitch=10 * um)
    for field in ((0.0, 0.0), (0.02, -0.01)):
        found = psf(coarse, math.inf, field, wavelength=GREEN)
        f, contrast = mtf(found).along("x")
        cut = np.minimum(np.abs(f) * SPREAD, 1)
        truth = 2 / math.pi * (np.arccos(cut) - cut * np.sqrt(1 - cut**2)) * np.abs(np.sinc(f * 10 * um))
        assert np.abs(contrast - truth).max() < found.outside + 1e-3


@pytest.mark.parametrize(("kind", "waves"), [("disc", 0.5), ("code", 2.0)])
def test_out_of_focus_it_is_the_angular_spectrum(kind, waves):
    """The sensor beside the focus of a lens of f/16: as in tests/physics/test_diffraction.py."""
    near, pixel, size = 6.4 * mm, 5, 101
    distance = 1 / (1 / near - 8 * GREEN * waves / (0.4 * mm) ** 2)
    truth = in_pixels(by_waves(kind, distance), pixel, size)
    small = camera_of(kind, distance, pixel * um)
    found = psf(small, math.inf, shape=(size, size), wavelength=GREEN)
    # The oracle's window and ours each fold in a part of what falls beyond.
    assert np.abs(found.values - truth).sum() / 2 < found.outside + 0.004
    by_rays = psf(small, math.inf, shape=(size, size)).values
    assert np.abs(by_rays - truth).sum() / 2 > 0.2


@pytest.mark.parametrize("distance", [math.inf, 10.0])
def test_it_lies_where_rays_land_with_a_stop_beside_the_axis(distance):
    """The mean place of light is that of rays (Ehrenfest); symmetric here, so that cut tails do not move it."""
    beside = camera(vcc.Lens(F), vcc.Mask(vcc.patterns.Circle(DIAMETER), decentre=(2 * mm, -1 * mm)))
    waves, rays = (psf(beside, distance, (0.01, 0.0), wavelength=each) for each in (GREEN, None))
    assert waves.centroid == pytest.approx(rays.centroid, abs=0.01 * um)
    assert waves.collecting_area == rays.collecting_area


def test_a_lens_of_glass_is_taken_at_the_wavelength():
    glass = camera(vcc.Lens(F, diameter=3 * mm, glass="N-BK7"))
    found = psf(glass, math.inf, wavelength=480 * nm, shape=(81, 81)).values
    alone = psf(glass.at_wavelength(480 * nm), math.inf, wavelength=480 * nm, shape=(81, 81)).values
    assert np.array_equal(found, alone)
    assert found.max() < 0.8 * psf(glass, math.inf, wavelength=587.6 * nm, shape=(81, 81)).values.max()


@pytest.mark.parametrize(
    ("elements", "options", "words"),
    [
        ([LENS], {"aperture": (1 * mm, 1 * mm)}, "waves need the camera's stops"),
        ([LENS], {"distance": 0.06, "pitch": 20 * um}, "60 waves of defocus"),
        ([LENS], {"pitch": 200 * um, "shape": (201, 201)}, r"2048 a side are the most: pass shape=\(\d"),
        ([LENS], {"pitch": 4 * mm, "shape": (3, 3)}, "2048 a side are the most: pass pitch=0.00"),
        ([LENS, vcc.Diffuser(vcc.kernels.Gaussian(0.01))], {}, "scatter rays, not waves"),
        ([LENS], {"wavelength": -1.0}, "wavelength"),
    ],
)
def test_what_waves_cannot_do_is_refused(elements, options, words):
    settings = {"distance": math.inf, "wavelength": GREEN} | options
    with pytest.raises(vcc.InputError, match=words):
        psf(camera(*elements), settings.pop("distance"), **settings)


def test_the_shape_that_an_error_names_can_be_had():
    coded = camera(LENS, vcc.Mask(np.eye(5), width=6 * mm, z=20 * mm), d=51 * mm)
    with pytest.raises(vcc.InputError, match="are the most") as refused:
        psf(coded, 10.0, wavelength=GREEN, pitch=20 * um, shape=(150, 20))
    found = re.search(r"shape=\((\d+), (\d+)\)", str(refused.value))
    rows, columns = int(found[1]), int(found[2])
    assert (rows < 150, columns) == (True, 20)
    assert psf(coded, 10.0, wavelength=GREEN, pitch=20 * um, shape=(rows, columns)).shape == (rows, columns)


def test_pixels_that_are_not_square_hold_the_light_of_the_square_ones_in_them():
    high = vcc.Camera([LENS], vcc.Sensor(z=F, shape=(9, 41), pitch=(7 * um, 1 * um)))
    found = psf(high, math.inf, wavelength=GREEN, shape=(9, 41)).values
    fine = psf(camera(LENS), math.inf, wavelength=GREEN, shape=(63, 41)).values
    np.testing.assert_allclose(found, fine.reshape(9, 7, 41).sum(axis=1), atol=1e-4 * found.max())
