"""Strong defocus: views far apart on the sensor show no ghosts, and objects in focus stay sharp.

Oracles: the blur disc of a point is a uniform disc of known height, and the transfer of a cosine through a disc
is 2·J₁(x)/x. With ``between_views="none"`` the same scenes show ghosts: the tests can fail.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.special import j1

import vcc
from tests.physics.brute_force import Layer, Scene, Texture, cosines, psnr, views
from vcc.base.units import m, mm

FOCAL_LENGTH, SPACING, SLOPE, FOCUS = 50 * mm, 1 * mm, 1e-3, 1 * m
VIEWS, PIXELS = 16, 96
DIAMETER = 13 * mm
ENGINES = ["numba", "reference", "array_api"]


def sensor_with_gap(gap: float, disparity: float, shape: tuple[int, int]) -> vcc.Sensor:
    """A sensor on which neighbouring views' pictures of a plane lie ``gap`` samples apart.

    By hand: views of a point lie du·|1 − d/d'| apart there, 1/d' = 1/f − 1/Z, and a sample is d·ps wide:
    du/ps·|1/d − 1/d'| = gap.
    """
    vergence = disparity * SLOPE / SPACING + 1 / FOCUS
    inverse = 1 / FOCAL_LENGTH - vergence + gap * SLOPE / SPACING
    return vcc.Sensor(z=1 / inverse, shape=shape, pitch=SLOPE / inverse)


def light_field(scene: Scene, disparities: tuple[float, float], pixels: int = PIXELS) -> vcc.LightField:
    samples = views(scene, (VIEWS, VIEWS, pixels, pixels), SPACING, SLOPE, FOCUS)
    return vcc.LightField.from_views(
        samples.astype(np.float32),
        SPACING,
        SLOPE,
        FOCUS,
        disparity_range=disparities,
        sample="point",
    )


def distance_with(disparity: float) -> float:
    return 1 / (disparity * SLOPE / SPACING + 1 / FOCUS)


LENS = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=DIAMETER)


def spot(sigma: float, disparity: float) -> Scene:
    """A bright spot on black, ``sigma`` samples wide."""
    width = sigma * SLOPE * distance_with(disparity)
    return Scene([Layer(distance_with(disparity), lambda x, y: np.exp(-(x**2 + y**2) / (2 * width**2)))])


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")  # the sensor is wider than the views' pictures
@pytest.mark.parametrize("gap", [3.3, 5.0])
def test_a_bright_point_far_out_of_focus_is_an_even_disc(gap):
    sigma = 1.0
    lf = light_field(spot(sigma, 0.2), (0.2, 0.2), 40)
    sensor = sensor_with_gap(gap, 0.2, (101, 101))
    camera = vcc.Camera([LENS], sensor)
    plan = camera.compile(lf)
    assert max(plan.smear) > 1  # gaps are filled, by this and by dividing the cells of views
    radius = DIAMETER / SPACING * gap / 2  # pixels
    # Light of a spot of 2πσ² samples over a disc of radius R pixels (a pixel is a sample wide).
    height = 2 * np.pi * sigma**2 * np.pi * DIAMETER**2 / 4 / sensor.z**2 / (np.pi * radius**2)
    r = np.hypot(*np.meshgrid(np.arange(101) - 50, np.arange(101) - 50))
    plateau = r < radius - 1.5 * gap  # the rim rises over the tent's ±1 gap and the spot
    # A tent as wide as the gap leaves sinc²(1) = 0 of the grid's frequency, whatever the spot. Discs of
    # views are weighted evenly inside. The tent's width is a measured one: within 3 %.
    auto = camera.capture(lf).values
    none = camera.capture(lf, between_views="none").values
    ripple = auto[plateau].std() / auto[plateau].mean()
    ghosts = none[plateau].std() / none[plateau].mean()
    print(f"gap {gap}: ripple {ripple:.2%}, without interpolation {ghosts:.0%}")
    assert auto[plateau].mean() == pytest.approx(height, rel=0.01)
    assert ripple < 0.03
    assert ghosts > 0.15
    assert ghosts > 20 * ripple
    # No strips or copies outside the disc either.
    assert auto[r > radius + 1.5 * gap + 4 * sigma].max() < 1e-3 * height


@pytest.mark.parametrize("disparity", [0.0, 0.5])
@pytest.mark.parametrize("gap", [3.2, -4.0])
def test_a_textured_plane_far_out_of_focus_shows_no_strips(gap, disparity):
    # The texture has a coarse part, which defocus leaves some of, and a part whose period is the gap: all
    # views' copies of it fall onto each other, a strong strip pattern that is not there in truth.
    distance = distance_with(disparity)
    sample = SLOPE * distance
    waves = (*cosines(1, np.array([60.0, 90.0]) * sample).waves, (0.15, 1 / (abs(gap) * sample), 0.0, 0.3))
    lf = light_field(Scene([Layer(distance, Texture(0.5, waves))]), (disparity, disparity), 128)
    sensor = sensor_with_gap(gap, disparity, (48, 48))
    camera = vcc.Camera([LENS], sensor)

    # Closed form: a cosine of the plane, seen through the middle of the lens, times the transfer of a
    # uniform disc, 2·J₁(πνB)/(πνB), and of a pixel.
    scale, blur = sensor.z / distance, DIAMETER / SPACING * abs(gap)  # B in pixels
    places = -(np.arange(48) - 23.5) * sensor.pitch / scale  # in the plane, upside down
    expected = np.full((48, 48), 0.5)
    for amplitude, fx, fy, phase in waves:
        nu_x, nu_y = fx * sensor.pitch / scale, fy * sensor.pitch / scale  # cycles a pixel
        x = np.pi * np.hypot(nu_x, nu_y) * blur
        transfer = 2 * j1(x) / x * np.sinc(nu_x) * np.sinc(nu_y)
        carrier = 2 * np.pi * (fx * places[None, :] + fy * places[:, None]) + phase
        expected += amplitude * transfer * np.cos(carrier)
    expected *= np.pi * DIAMETER**2 / 4 / sensor.z**2
    auto = psnr(camera.capture(lf).values, expected)
    none = psnr(camera.capture(lf, between_views="none").values, expected)
    print(f"gap {gap}, disparity {disparity}: auto {auto:.1f} dB, none {none:.1f} dB")
    # What a tent as wide as the gap takes from the coarse part, (π·4/60)²/3 = 1.5 %, of the third of 0.1 that
    # defocus leaves: an RMS of 5e-4 · 0.7 against a peak of 0.5: 63 dB, less for the second wave.
    assert auto >= 58
    assert none < auto - 30


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_in_focus_is_not_blurred(engine):
    # A scene from in focus to 4 pixels a view: the plane in focus must come out as without interpolation.
    # All views see it alike: 48 pixels hold what the sensor's 40 see.
    scene = Scene([Layer(FOCUS, cosines(2, np.array([8.0, 11.0, 30.0]) * SLOPE * FOCUS))])
    lf = light_field(scene, (0.0, 4.0), 48)
    sensor = vcc.Sensor(z=1 / (1 / FOCAL_LENGTH - 1 / FOCUS), shape=(40, 40), pitch=SLOPE / 19)
    camera = vcc.Camera([LENS], sensor)
    assert not any(camera.compile(lf).smear)
    with pytest.warns(
        vcc.errors.ResultWarning, match="ghosting: views' images of some depths stay 4 pixels apart"
    ):
        auto = camera.capture(lf, engine=engine).values
    none = camera.capture(lf, between_views="none", engine=engine).values
    np.testing.assert_array_equal(auto, none)
    assert auto.std() > 0.1 * auto.mean()


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")  # black around the spot, beyond the pictures
@pytest.mark.parametrize("engine", ENGINES)
def test_defocus_of_a_known_distance_is_filled_along_its_parallax(engine):
    scene = spot(1.0, 0.5)
    lf = light_field(scene, (-3.0, 3.0), 24)
    sensor = sensor_with_gap(4.0, 0.5, (20, 20))
    camera = vcc.Camera([LENS], sensor)
    image = camera.capture(lf, scene_distance=distance_with(0.5), engine=engine).values
    assert image.std() / image.mean() < 0.03  # all of it lies inside the disc of 52 pixels
    assert any(camera.compile(lf, scene_distance=distance_with(0.5)).smear)


def test_explain_says_what_is_filled_and_what_is_left():
    lf = light_field(spot(1.0, 0.5), (0.0, 3.0), 24)
    in_focus = vcc.Camera([LENS], vcc.Sensor(1 / 19, (16, 16), SLOPE / 19))
    assert "ghost copies" in str(in_focus.compile(lf))
    far = vcc.Camera([LENS], sensor_with_gap(6.0, 3.0, (16, 16)))
    assert "spread over" in str(far.compile(lf))


@pytest.mark.parametrize("views", [(5, 5), (4, 3)])
def test_a_rim_beyond_the_middles_of_the_last_views_lets_all_its_light_through(views):
    # Gaps of 10 pixels are filled between views; beyond the last view nothing is to be interpolated with. An even
    # field: L·A/d², in single precision.
    field = vcc.LightField.from_views(np.ones((*views, 80, 80), np.float32), 2 * mm, 2e-3, 1.0, (0.0, 0.0))
    diameter, distance = (2 * min(views) - 1) * mm, 80 * mm
    camera = vcc.Camera([vcc.Lens(50 * mm, diameter)], vcc.Sensor(distance, (24, 24), 0.1 * mm))
    plan = camera.compile(field)
    assert plan.core.taps_used > 4 * views[0] * views[1]  # spread between views, in parts
    expected = np.pi / 4 * (diameter / distance) ** 2
    whole = camera.capture(field, plan=plan).values
    np.testing.assert_allclose(whole, expected, rtol=2e-6)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.errors.ResultWarning)  # a piece lacks what the others have
        pieces = [camera.capture(field[rows, columns]).values for rows in HALVES for columns in HALVES]
    np.testing.assert_allclose(sum(pieces), whole, rtol=2e-6)


HALVES = slice(None, 2), slice(2, None)
