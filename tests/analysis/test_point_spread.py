"""Pictures of points against closed forms, and against pictures that the engines make.

A lens of focal length f images distance Z at d' = 1/(1/f − 1/Z); a ray through u of the lens meets a sensor at d
at x = u·(1 − d/d') − d·X/Z for a point at X.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import fftconvolve
from scipy.special import j1

import vcc
from vcc.analysis import expected_deblurring_error, mtf, natural_image_power, otf, psf
from vcc.base.units import mm, um
from vcc.gallery.diffuser_depth_of_field import RandomRings
from vcc.shapes.kernels import Gaussian, TopHat
from vcc.shapes.patterns import Circle
from vcc.shapes.surfaces import Cubic

F, DIAMETER, PITCH, Z = 50 * mm, 10 * mm, 10 * um, 1.0
IMAGE = 1 / (1 / F - 1 / Z)
"""Where a point at Z is sharp."""
LENS = vcc.Lens(focal_length=F, diameter=DIAMETER)
SQUARE = vcc.Mask(np.ones((1, 1)), width=DIAMETER)
CODE = np.array([[1, 0, 1, 1, 0], [0, 1, 1, 0, 1], [1, 1, 0, 1, 0], [0, 0, 0, 1, 1], [1, 0, 0, 0, 1]], float)


def camera(*elements, d=IMAGE, shape=(101, 101)):
    return vcc.Camera(elements, vcc.Sensor(z=d, shape=shape, pitch=PITCH))


def covered(inside, shape, points=64):
    """The share of each pixel for which inside(x, y) holds, pixels as units from the middle; then summing to 1."""
    rows, columns = shape
    y = (np.arange(rows * points) + 0.5) / points - rows / 2
    x = (np.arange(columns * points) + 0.5) / points - columns / 2
    share = inside(x[None, :], y[:, None]).reshape(rows, points, columns, points).mean(axis=(1, 3))
    return share / share.sum()


@pytest.mark.parametrize("blur", [7.3, -16.9])
def test_defocus_is_a_disc(blur):
    """Of diameter D·|1 − d/d'|, pixels cut by its border by their share."""
    found = psf(camera(LENS, d=IMAGE * (1 - blur * PITCH / DIAMETER)), Z)
    truth = covered(lambda x, y: x * x + y * y <= (blur / 2) ** 2, found.shape)
    # Cells cut by the rim are lit from their middle: 16 cells a pixel, wrong by a quarter of a cell along the rim
    # at most, 1/64 of a pixel's light; the oracle's own is smaller.
    assert np.abs(found.values - truth).max() <= truth.max() / 64
    assert found.values.sum() == pytest.approx(1, abs=1e-9)
    assert found.collecting_area == pytest.approx(np.pi * DIAMETER**2 / 4, rel=1e-9)
    assert found.outside == 0
    assert found.sampling_error == 0


def test_focus_is_a_point_wherever_it_stands():
    for field in ((0.0, 0.0), (0.02, -0.03)):
        found = psf(camera(LENS), Z, field)
        assert found.shape == (1, 1)
        # A real image is inverted: a point to the right lands to the left.
        np.testing.assert_allclose(found.centroid, np.array(field) * -IMAGE, atol=1e-12)
    parallel = psf(camera(LENS, d=F), np.inf, (0.02, 0.0))
    np.testing.assert_allclose(parallel.centroid, [-0.02 * F, 0], atol=1e-12)
    assert parallel.shape == (1, 1)


def test_the_sensors_own_pixels():
    field = (3.3 * PITCH / IMAGE, -1.2 * PITCH / IMAGE)
    found = psf(camera(LENS), Z, field, on_pixels=True, shape=(5, 5))
    assert found.values[2, 2] == pytest.approx(1, abs=1e-6)
    np.testing.assert_allclose(found.frame([2, 2]), [-3 * PITCH, 1 * PITCH], atol=1e-12)
    cut = psf(camera(LENS, d=1.02 * IMAGE), Z, shape=(5, 5))
    assert cut.values.sum() == pytest.approx(1 - cut.outside, abs=1e-12)
    # A disc of 20 pixels of which 25 are shown.
    assert cut.outside == pytest.approx(1 - 25 / (np.pi * 100), abs=1e-4)


@pytest.mark.parametrize("side", [1, -1])
def test_a_coded_aperture_is_copied(side):
    """Upright where the sensor is too near, turned where it is too far; 3 pixels a cell here."""
    mask = vcc.Mask(CODE, width=DIAMETER)
    found = psf(camera(vcc.Lens(focal_length=F), mask, d=IMAGE * (1 - side * 15 * PITCH / DIAMETER)), Z, cells=500)
    copy = np.kron(CODE, np.ones((3, 3)))[::side, ::side]
    assert found.shape == (15, 15)
    # The opening's cells lie in cells of the code and of pixels: exact.
    np.testing.assert_allclose(found.values, copy / copy.sum(), atol=1e-9)
    assert found.collecting_area == pytest.approx(CODE.mean() * DIAMETER**2, rel=1e-9)


def test_a_mask_in_mid_path_is_shifted_by_the_field():
    """At w it cuts u at u·(1 − w/d') − w·X/Z: a hole there moves over the aperture with the point."""
    d, w, field = 0.97 * IMAGE, 25 * mm, (0.06, 0.0)
    hole = vcc.Mask(Circle(4 * mm), z=w)
    found = psf(camera(LENS, hole, d=d), Z, field)
    grown, cut = 1 - d / IMAGE, 1 - w / IMAGE
    middle = found.frame([found.shape[1] // 2, found.shape[0] // 2]) + d * np.array(field)

    def lit(x, y):
        u, v = (middle[0] + x * PITCH) / grown, (middle[1] + y * PITCH) / grown
        through = (u * cut - w * field[0]) ** 2 + (v * cut) ** 2 <= (2 * mm) ** 2
        return through & (u**2 + v**2 <= (DIAMETER / 2) ** 2)

    truth = covered(lit, found.shape)
    assert np.abs(found.values - truth).max() <= truth.max() / 64
    assert 0.3 < found.collecting_area / (np.pi * DIAMETER**2 / 4) < 0.8


def test_a_biprism_makes_two_points():
    prism = vcc.Biprism(deflection=2e-3)
    found = psf(camera(LENS, prism, SQUARE), Z, pitch=10 * um)
    rows, columns = np.nonzero(found.values > 1e-3)
    x = found.frame(np.stack([columns, rows], axis=-1))[:, 0]
    share = found.values[rows, columns]
    for side in (1, -1):
        mean = (share * x)[x * side > 0].sum() / share[x * side > 0].sum()
        # Light is shared between the pixels that it touches by place: its mean is known to half a pixel.
        assert abs(mean) == pytest.approx(2e-3 * IMAGE, abs=0.5 * PITCH)
        assert share[x * side > 0].sum() == pytest.approx(0.5, abs=1e-3)


def test_a_cubic_plate_folds_the_aperture():
    """In focus x = d·3a·u²: the share left of x is √(x/d·3a)/(D/2), on either axis alike."""
    bend = 3 * 30 * PITCH / (DIAMETER / 2) ** 2 / 3 / IMAGE  # the edge of the aperture lands 90 pixels off
    plate = vcc.PhasePlate(Cubic(bend))
    found = psf(camera(vcc.Lens(focal_length=F), SQUARE, plate), Z)
    edges = found.frame(np.stack([np.arange(found.shape[1] + 1) - 0.5] * 2, axis=-1))[:, 0]
    left = np.clip(np.sqrt(np.maximum(edges, 0) / (3 * bend * IMAGE)) / (DIAMETER / 2), 0, 1)
    expected = np.diff(left)
    # Boxes of cells instead of curved ones: second order.
    np.testing.assert_allclose(found.values.sum(axis=0), expected, atol=1e-4)
    np.testing.assert_allclose(found.values.sum(axis=1), expected[: found.shape[0]], atol=1e-4)


def test_a_gaussian_diffuser_has_a_gaussian_mtf():
    """exp(−2π²σ²w²q²), w the way from the diffuser to the sensor."""
    sigma, w = 3e-3, 20 * mm
    found = psf(camera(LENS, vcc.Diffuser(kernel=Gaussian(sigma), z=IMAGE - w)), Z)
    q, values = mtf(found, shape=(241, 241), pixel=False).along("x")
    expected = np.exp(-2 * np.pi**2 * (sigma * w * q) ** 2)
    kept = expected > 0.01
    # Of N even points' error a frequency gets no more than 1/√N, 2e-3; the cut at 4 σ takes 5e-4.
    np.testing.assert_allclose(values[kept], expected[kept], atol=2.5e-3)
    assert kept.sum() > 10
    assert 0 < found.sampling_error < 0.03 * found.values.max()
    assert (
        psf(camera(LENS, vcc.Diffuser(kernel=Gaussian(sigma), z=IMAGE - w)), Z).values.sum() == found.values.sum()
    )


def test_the_mtf_of_defocus():
    blur = 12.5 * PITCH
    found = psf(camera(LENS, d=IMAGE * (1 - blur / DIAMETER)), Z)
    q, values = otf(found, shape=(65, 65), pixel=False).along("y")
    x = np.pi * blur * q[1:]
    np.testing.assert_allclose(values[1:], 2 * j1(x) / x, atol=1e-3)
    assert values[0] == pytest.approx(1)
    with_pixels = otf(found, shape=(65, 65)).along("y")[1]
    np.testing.assert_allclose(with_pixels, values * np.sinc(q * PITCH), atol=1e-12)
    np.testing.assert_allclose(mtf(found, shape=(65, 65)).along("y")[1], np.abs(with_pixels))


@pytest.mark.parametrize("blur", [0.0, 1.3, 5.0])
@pytest.mark.parametrize("shape", [None, (200, 240)])
def test_large_pixels_do_not_alias_an_mtf(blur, shape):
    """A disc of few pixels: 2·J₁(x)/x times the pixels' sinc², at all frequencies that the pixels have."""
    found = psf(camera(LENS, d=IMAGE * (1 - blur * PITCH / DIAMETER)), Z, (0.02, -0.01), shape=shape)
    got = mtf(found, shape=shape or (33, 36))
    fx, fy = got.frequencies("x"), got.frequencies("y")[:, None]
    x = np.maximum(np.pi * blur * PITCH * np.hypot(fx, fy), 1e-9)
    expected = np.abs(2 * j1(x) / x * np.sinc(fx * PITCH) * np.sinc(fy * PITCH))
    # The light was counted in 32 parts of a pixel a side, each a sinc at ½/32 and less: (π/64)²/6 along each axis.
    np.testing.assert_allclose(got.values, expected, atol=2 * (np.pi / 64) ** 2 / 6)


SPOT = 4.0
"""σ of a bright spot, in samples of a view, which are pixels of the sensor."""
CASES = {
    "cubic plate": ([vcc.PhasePlate(Cubic(4 * PITCH / (DIAMETER / 2) ** 2 / IMAGE))], "rays"),
    "mask in mid-path": ([vcc.Mask(CODE, width=8 * mm, z=IMAGE / 2)], "auto"),
    "diffuser": ([vcc.Diffuser(kernel=TopHat(2e-3), z=IMAGE / 2)], "auto"),
}


@pytest.mark.parametrize("case", CASES)
def test_the_engines_see_the_scene_convolved_with_it(case):
    elements, method = CASES[case]
    stand = camera(vcc.Lens(focal_length=F), SQUARE, *elements, d=0.992 * IMAGE, shape=(51, 51))
    views, slope = 20, PITCH / stand.sensor.z
    # The views converge at the spot's distance: it stands in the middle of each of them.
    grid = np.arange(-40, 41)
    spot = np.exp(-(grid**2) / (2 * SPOT**2))
    scene = np.outer(spot, spot)
    samples = np.broadcast_to(scene, (views, views, 81, 81))
    field = vcc.LightField.from_views(samples, DIAMETER / views, slope, Z, disparity_range=(0, 0), sample="point")
    more = {"samples": 256} if method == "rays" else {}
    image = stand.capture(field, method=method, **more)
    spread = psf(stand, Z)
    # Onto one lattice: the picture of the point lies where its frame says, whole pixels from the sensor's middle.
    offset = stand.sensor.frame.inverse()(spread.frame([spread.shape[1] // 2, spread.shape[0] // 2])) - 25
    assert np.abs(offset - np.round(offset)).max() < 1e-6
    blurred = fftconvolve(scene, spread.values, mode="same")
    rows, columns = (15 - round(float(n)) for n in offset[::-1])
    expected = blurred[rows : rows + 51, columns : columns + 51]
    radiated = spread.collecting_area / stand.sensor.z**2
    # Linear interpolation of samples adds 1/6 sample² to a variance of 16: 1 % at the top; rays' error besides.
    assert (
        np.abs(image.values - expected * radiated).max() <= 0.015 * image.values.max() + 4 * image.sampling_error
    )
    assert image.values.sum() == pytest.approx(expected.sum() * radiated, rel=5e-3)


# -- expected deblurring error


def test_the_expected_error_is_that_of_wiener_filters_on_random_pictures():
    """Pictures drawn with the assumed power, blurred, noisy, filtered: their mean squared error is R/n."""
    shape, sigma = (32, 40), 0.05
    power = natural_image_power(shape)
    kernel = np.kron(CODE, np.ones((2, 2))) / 100
    transfer = np.fft.fft2(kernel, s=shape)
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(400):
        white = np.fft.fft2(rng.normal(size=shape), norm="ortho")
        scene = white * np.sqrt(power)
        recorded = scene * transfer + sigma * np.fft.fft2(rng.normal(size=shape), norm="ortho")
        wiener = np.conj(transfer) * power / (np.abs(transfer) ** 2 * power + sigma**2)
        errors.append(np.mean(np.abs(wiener * recorded - scene) ** 2))
    expected = expected_deblurring_error(kernel, sigma, power) / (32 * 40)
    # Four standard deviations of the mean of 400.
    assert np.mean(errors) == pytest.approx(expected, abs=4 * np.std(errors) / 20)
    assert 4 * np.std(errors) / 20 < 0.05 * expected


def test_limits_of_the_expected_error():
    power = natural_image_power((16, 16), standard_deviation=0.2, mean=0.5)
    assert power[0, 0] == pytest.approx(0.25 * 256)
    assert power.sum() - power[0, 0] == pytest.approx(0.04 * 256)
    assert power[0, 2] == pytest.approx(power[0, 1] / 4)
    # All is lost in noise; without blur and with little noise, the noise is all that is left.
    assert expected_deblurring_error([[1.0]], 1e6, power) == pytest.approx(power.sum(), rel=1e-6)
    assert expected_deblurring_error([[1.0]], 1e-5, power) == pytest.approx(256e-10, rel=1e-4)
    # A hole in the transfer function loses its power, and only that.
    gap = expected_deblurring_error([[0.5, 0.5]], 1e-9, power)
    assert gap == pytest.approx(power[:, 8].sum(), rel=1e-6)


# -- what is refused


def refused(words):
    return pytest.raises(vcc.InputError, match=re.escape(words))


@pytest.mark.parametrize("power", [0, 1])
def test_a_plate_whose_slopes_jump_is_that_of_random_rays(power):
    """Rings with random slopes, and a tip in the middle: x = u + d·(u/Z − u/f − slope) of 10⁶ rays of its own."""
    surface = RandomRings(8 * mm, 0.01, power, rings=40)
    lens = [vcc.Lens(50 * mm), vcc.PhasePlate(surface, diameter=16 * mm)]
    camera = vcc.Camera(lens, vcc.Sensor(52 * mm, (9, 9), 0.1 * mm))
    found = psf(camera, 1.0, shape=(25, 25))
    places = (np.random.default_rng(1).random((2, 2 * 10**6)) - 0.5) * 16 * mm
    places = places[:, np.hypot(*places) < 8 * mm]
    landed = places + 52 * mm * (places / 1.0 - places / (50 * mm) + np.stack(surface.slopes(*places)))
    edges = (np.arange(26) - 12.5) * 0.1 * mm
    truth = np.histogram2d(*landed[::-1], bins=[edges, edges])[0] / places.shape[1]
    noise = np.sqrt(truth / places.shape[1]).sum() / 2
    # Cells at the edges of rings go to one side of a jump, evenly to both.
    assert np.abs(found.values - truth).sum() / 2 < noise + 0.01


def test_what_is_refused():
    stand = camera(LENS)
    for distance in (0, -1.0, np.nan):
        with refused("distance of a point"):
            psf(stand, distance)
    with refused("pair of finite slopes"):
        psf(stand, Z, (np.nan, 0))
    with refused("leave out pitch"):
        psf(stand, Z, pitch=1 * um, on_pixels=True)
    with refused("pitch must be greater"):
        psf(stand, Z, pitch=0)
    with refused("cells is"):
        psf(stand, Z, cells=1)
    with refused("rays is"):
        psf(stand, Z, rays=0)
    with refused("a vcc.Camera"):
        psf(LENS, Z)
    with refused("shape is (rows, columns)"):
        psf(stand, Z, shape=(0, 3))
    with refused("pass aperture=(width, height)"):
        psf(camera(vcc.Lens(focal_length=F)), Z)
    with refused("aperture is (width, height)"):
        psf(stand, Z, aperture=(0, 1))
    with refused("outside the field of view"):
        psf(camera(LENS, vcc.Mask(Circle(1 * mm), z=40 * mm)), Z, (0.5, 0))
    with refused("stops block it all"):
        psf(camera(LENS, vcc.Mask(Circle(1 * mm), decentre=(4.9 * mm, 4.9 * mm))), Z)
    with refused("count its light in larger pixels"):
        psf(camera(LENS, d=80 * mm), Z, pitch=0.5 * um)
    found = psf(stand, Z, shape=(3, 3))
    assert repr(found) == "PointSpread(3×3, pixel 10 um, point at 1 m)"
    with refused("does not hold"):
        otf(found, shape=(2, 3))
    with refused("without light"):
        otf(replace(found, values=np.zeros((3, 3)), finer=None))
    with refused("the light in finer differs from values"):
        replace(found, values=np.roll(found.values, 1))
    power = natural_image_power((8, 8))
    for arguments, words in [
        ((np.ones((9, 1)), 0.1, power), "larger than the picture"),
        ((np.zeros((2, 2)), 0.1, power), "not all 0"),
        (([[np.nan]], 0.1, power), "finite numbers"),
        (([[1.0]], 0.0, power), "greater than 0"),
        (([[1.0]], 0.1, -power), "one for each frequency"),
    ]:
        with refused(words):
            expected_deblurring_error(*arguments)
    with refused("shape is"):
        natural_image_power((1, 1))
    with refused("mean must be"):
        natural_image_power((4, 4), mean=0)


def test_an_aperture_of_ones_own():
    found = psf(camera(vcc.Lens(focal_length=F), d=IMAGE * 0.99), Z, aperture=(DIAMETER, DIAMETER / 2), cells=500)
    assert found.shape == (5, 11)
    np.testing.assert_allclose(found.values[2, 1:-1], 1 / 50, atol=1e-9)
