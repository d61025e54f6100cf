"""Depth by dual pixels: lines, point spread functions and disparities against closed forms of half discs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.analysis import psf
from vcc.base.units import mm, um
from vcc.image import PhotodiodeImage
from vcc.recording import PhotodiodeRecording, expose_image
from vcc.recover import PhotodiodeDisparity, depth_by_photodiodes
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

RADIUS, FOCAL, FOCUS, PITCH = 4 * mm, 50 * mm, 1.0, 10 * um
BEHIND = 1 / (1 / FOCAL - 1 / FOCUS)
SENSOR = vcc.Sensor(BEHIND, (64, 200), PITCH, photodiodes=(1, 2), microlens=vcc.Microlens(f_number=1.2))
CAMERA = vcc.Camera([vcc.Lens(FOCAL, 2 * RADIUS)], SENSOR)
NEAR, FAR = 0.85, 1.3

# Blocks on borders of depth, and on the left and right of the image.
pytestmark = pytest.mark.filterwarnings("ignore:.*% of the blocks match best at an end:vcc.ResultWarning")


def disparity(distance: float) -> float:
    """Of centroids of half discs, which lie 2·4R/(3π) apart at the lens, metres; column 0 has the right half."""
    return 8 * RADIUS / (3 * math.pi) * (1 - BEHIND * (1 / FOCAL - 1 / distance))


def field(*planes: TexturedPlane) -> vcc.LightField:
    """Views over the opening, less than 0.6 pixels of parallax apart."""
    seen = PlanesScene(planes).light_field(
        (20, 20),
        (100, 236),
        spacing=RADIUS / 9,
        slope_per_pixel=PITCH / BEHIND,
        focus_distance=FOCUS,
        dtype="float32",
    )
    return seen.replaced(seen.values[..., :1])


@pytest.fixture(scope="module")
def image() -> PhotodiodeImage:
    """A board in front of the focus before a wall behind it, the finest periods 24 pixels wide."""
    near, far = (Waves(24 * PITCH / BEHIND * z, waves=6, seed=n) for n, z in enumerate((NEAR, FAR)))
    edge = 0.5 * 200 * PITCH / BEHIND * NEAR
    return CAMERA.capture(
        field(TexturedPlane(near, NEAR, width=2 * edge, middle=(edge, 0)), TexturedPlane(far, FAR))
    )


# -- the line


@pytest.mark.parametrize(("grid", "place"), [((1, 2), 0.0), ((2, 1), 20 * mm), ((2, 2), 0.0), ((1, 4), 20 * mm)])
def test_disparity_is_a_line_over_the_inverse_distance_to_the_lens(grid, place):
    sensor = replace(SENSOR, z=place + BEHIND, photodiodes=grid)
    line = PhotodiodeDisparity.of(vcc.Camera([vcc.Lens(FOCAL, 2 * RADIUS, z=place)], sensor))
    assert line.axis == (1 if grid[1] > 1 else 0)
    assert line.pupil == pytest.approx(place, abs=1e-9)
    for distance in (0.3, 0.7, 2.0, math.inf):
        # A cell of the opening at the rim, 1/256 of it, counts by its share: right to 2e-5 of the radius.
        assert line.disparity_of(distance) == pytest.approx(disparity(distance + place), rel=3e-5)
        assert line.distance_of(line.disparity_of(distance)) == pytest.approx(distance)
    assert line.distance_of(line.at_infinity - 1 * um) == math.inf
    assert line.disparity_of(FOCUS - place) == pytest.approx(0, abs=1e-9)


def test_a_pupil_for_which_microlenses_are_not_shifted_changes_nothing_on_the_axis():
    """With sharp edges: the chief ray of the middle pixel is the axis whatever the distance of the pupil."""
    line = PhotodiodeDisparity.of(CAMERA)
    other = replace(SENSOR, microlens=vcc.Microlens(f_number=1.2, pupil_distance=math.inf))
    found = PhotodiodeDisparity.of(vcc.Camera(CAMERA.elements, other))
    assert found.factor == pytest.approx(line.factor, rel=1e-6)


def test_crosstalk_takes_from_the_disparity_what_both_photodiodes_share():
    """Left minus right weigh the opening by a ramp of −1 to 1 over ±a: moments of the disc, ∫ x·ramp / (πR²/2)."""
    for share in (0.3, 1.0):
        reach = share * RADIUS  # in the lens: q = −h·u/d, and the ramp is crosstalk wide
        lens = vcc.Microlens(height=12 * um, crosstalk=2 * 12 * um * reach / BEHIND)
        found = PhotodiodeDisparity.of(vcc.Camera(CAMERA.elements, replace(SENSOR, microlens=lens)))
        u = (np.arange(20000) + 0.5) / 10000 * RADIUS - RADIUS
        chord = 2 * np.sqrt(RADIUS**2 - u**2)
        moment = (u * np.clip(u / reach, -1, 1) * chord).sum() * RADIUS / 10000
        expected = 2 * moment / (math.pi * RADIUS**2) * BEHIND
        assert found.factor == pytest.approx(expected, rel=1e-3)


# -- point spread functions


@pytest.mark.parametrize("diameter", [2 * RADIUS, None])
def test_the_left_one_behind_the_focus_is_the_right_one_in_front(diameter):
    """Equally far from the focus in 1/Z; of openings that are no mirror images of themselves, turned by 180°."""
    code = np.random.default_rng(1).random((7, 7))
    elements = [vcc.Lens(FOCAL, diameter)]
    if diameter is None:
        elements.append(vcc.Mask(code, width=2 * RADIUS))
    camera = vcc.Camera(elements, SENSOR)
    front, behind = (
        [psf(camera.photodiode(0, n), 1 / (1 / FOCUS + sign * 0.4), pitch=6 * um, shape=(41, 41)) for n in (0, 1)]
        for sign in (1, -1)
    )
    for n in (0, 1):
        peak = front[n].values.max()
        np.testing.assert_allclose(behind[n].values, front[n].values[::-1, ::-1], atol=1e-6 * peak)
        if diameter is not None:
            np.testing.assert_allclose(behind[n].values, front[1 - n].values, atol=1e-6 * peak)
            np.testing.assert_allclose(front[n].values[:, ::-1], front[1 - n].values, atol=1e-6 * peak)
    if diameter is not None:
        # In front of the focus the left photodiode, which has the right half of the lens, has light on the right.
        # Counted in pixels, the borders of a half disc of 35 of them are right to a hundredth of one.
        expected = disparity(1 / (1 / FOCUS + 0.4)) / 2
        assert front[0].centroid[0] == pytest.approx(expected, abs=0.02 * 6 * um)
        assert front[1].centroid[0] == pytest.approx(-expected, abs=0.02 * 6 * um)


# -- depth


@pytest.mark.parametrize(("distance", "period"), [(NEAR, 10), (FAR, 20)])
def test_the_disparity_of_a_wave_is_the_phase_between_half_discs(distance, period):
    """Of one wave along x: 2·arg K/ω of the transform of half a disc, 1 to 3 % less than that of the centroids."""
    wide = period * PITCH / BEHIND * distance
    wave = TexturedPlane(lambda x, y: 0.5 + 0.4 * np.cos(2 * np.pi * x / wide) + 0 * y, distance)
    captured = CAMERA.capture(field(wave))
    # A wave repeats: the search is within half a period.
    reach = 0.4 * period * PITCH / PhotodiodeDisparity.of(CAMERA).factor
    middle = max(1 / distance, 0.1)
    span = (1 / (middle + reach), 1 / max(middle - reach, 1e-3))
    found = depth_by_photodiodes(captured, CAMERA, span, block=41)
    x = (np.arange(20000) + 0.5) / 20000
    share = np.sqrt(1 - x**2) / np.sqrt(1 - x**2).sum()
    omega = 2 * np.pi / (period * PITCH)
    blur = BEHIND * (1 / distance - 1 / FOCUS) * RADIUS
    expected = 2 * np.angle((share * np.exp(1j * omega * blur * x)).sum()) / omega / PITCH
    inside = found.columns[(found.columns > 40) & (found.columns < 160)]
    here = found.disparity[:, np.isin(found.columns, inside)]
    # All light of a cell of views, h = R/9 wide, counts as if at its middle: the moment of half a disc, 2R³/3, is
    # larger by h²/12·2R, which is 0.3 %.
    np.testing.assert_allclose(here, expected, rtol=4e-3)
    assert abs(expected) < abs(disparity(distance) / PITCH)


@pytest.mark.parametrize("electronics", [None, vcc.Electronics(full_well=30_000)])
def test_two_planes_are_where_they_are(image, electronics):
    """Blocks that show one plane alone, with its blur, noise-free and recorded."""
    seen = image
    if electronics is not None:
        seen = expose_image(image, replace(SENSOR, electronics=electronics), seed=4)
        assert isinstance(seen, PhotodiodeRecording)
    found = depth_by_photodiodes(seen, CAMERA, (0.7, 2.0))
    if electronics is not None:
        again = depth_by_photodiodes(seen.image(), CAMERA, (0.7, 2.0))
        np.testing.assert_array_equal(found.distance, again.distance)
    # Upright the board is on the right: as light lands, on the left. Half a block, disparity and blur: 20 pixels.
    for distance, columns in ((NEAR, found.columns < 78), (FAR, found.columns > 122)):
        there = found.confidence[:, columns] > 0.8
        assert there.mean() > 0.8
        off = found.disparity[:, columns][there] - disparity(distance) / PITCH
        # Waves of 24 pixels and more in blurs of up to 10 have disparities up to 0.3 % smaller than that of
        # centroids, and up to 3 % larger if they run across: a third of that, and 0.3 % by the cells of views, are
        # 0.05. Noise is 1.4 % of a pixel's mean light, and gradients are 1 % a pixel, over 441 pixels of both
        # images: 0.014/0.01·√2/21 = 0.09 root mean square, less by smoothing.
        assert np.quantile(np.abs(off), 0.95) < (0.05 if electronics is None else 0.2)
        assert abs(np.median(off)) < 0.05
        # dZ/Z = Z·dΔ/factor: 0.2 % and 0.4 % for a hundredth of a pixel at NEAR and FAR.
        ratio = found.distance[:, columns][there] / distance - 1
        assert abs(np.median(ratio)) < (0.005 if electronics is None else 0.01)


def test_top_and_bottom_are_left_and_right_on_their_side(image):
    turned = [replace(each, values=each.values.transpose(1, 0, 2)) for each in image.photodiodes[0]]
    sensor = replace(SENSOR, shape=SENSOR.shape[::-1], photodiodes=(2, 1))
    frame = sensor.frame
    turned = PhotodiodeImage.of([[replace(each, frame=frame)] for each in turned], None)
    camera = vcc.Camera(CAMERA.elements, sensor)
    one = depth_by_photodiodes(image, CAMERA, (0.7, 2.0), step=14)
    other = depth_by_photodiodes(turned, camera, (0.7, 2.0), step=14)
    np.testing.assert_allclose(other.disparity.T, one.disparity, atol=1e-9)
    np.testing.assert_allclose(other.distance.T, one.distance, rtol=1e-6)
    np.testing.assert_array_equal(other.rows, one.columns)
    np.testing.assert_array_equal(other.columns, one.rows)


def test_quad_pixels_are_summed_to_halves(image):
    left, right = image.photodiodes[0]
    quad = PhotodiodeImage.of([[left * 0.3, right * 0.6], [left * 0.7, right * 0.4]], None)
    camera = vcc.Camera(CAMERA.elements, replace(SENSOR, photodiodes=(2, 2)))
    one = depth_by_photodiodes(image, CAMERA, (0.7, 2.0), step=14)
    other = depth_by_photodiodes(quad, camera, (0.7, 2.0), step=14)
    np.testing.assert_allclose(other.disparity, one.disparity, atol=1e-4)  # float32


def test_pieces_of_images_have_the_depth_of_the_whole(image):
    whole = depth_by_photodiodes(image, CAMERA, (0.7, 2.0), step=10)
    piece = depth_by_photodiodes(image[10:, 20:], CAMERA, (0.7, 2.0), step=10)
    # Blocks at the border of the piece have fewer partners, and see less beyond it when they are smoothed.
    np.testing.assert_allclose(piece.disparity[:, 1:-1], whole.disparity[1:, 3:-1], atol=5e-3)


# -- bad input


def plain(values: float = 1.0, shape: tuple[int, int] = SENSOR.shape) -> PhotodiodeImage:
    one = vcc.Image(np.full(shape, values, np.float32), SENSOR.frame)
    return PhotodiodeImage.of([[one, one]], None)


@pytest.mark.parametrize(
    ("given", "options", "message"),
    [
        (plain().sum(), {}, r"each photodiode, not Image.*not their sum"),
        (plain().upright(), {}, "upright: give it as the camera captured it"),
        (plain(), {"distance_range": (2, 1)}, "nearest, farthest"),
        (plain(), {"distance_range": (0, 1)}, "nearest, farthest"),
        (plain(), {"block": 8}, "block is an odd number"),
        (plain(), {"block": 65}, "too small for a block of 65.*smaller block"),
        (plain(np.nan), {}, "not finite"),
        (PhotodiodeImage.of([[plain().sum()], [plain().sum()]], None), {}, "2×1 photodiodes.*sensor 1×2"),
        (plain()[:, ::2], {}, "give what this camera captured"),
    ],
)
def test_bad_images_raise(given, options, message):
    with pytest.raises(vcc.InputError, match=message):
        depth_by_photodiodes(given, CAMERA, **{"distance_range": (0.7, 2), **options})


@pytest.mark.parametrize(
    ("elements", "changes", "message"),
    [
        (CAMERA.elements, {"photodiodes": (1, 1), "microlens": None}, r"one photodiode.*photodiodes=\(1, 2\)"),
        ([vcc.Lens(FOCAL)], {}, "give the lens a diameter"),
        ([*CAMERA.elements, vcc.LensArray(1 * mm, 5 * mm, z=40 * mm)], {}, "lens array.*distance alone"),
        ([*CAMERA.elements, vcc.Diffuser(vcc.kernels.Gaussian(0.01))], {}, "diffuser.*distance alone"),
    ],
)
def test_bad_cameras_raise(elements, changes, message):
    with pytest.raises(vcc.InputError, match=message):
        PhotodiodeDisparity.of(vcc.Camera(elements, replace(SENSOR, **changes)))


def test_rotations_turn_both_images_and_rotated_cylinders_raise():
    cosine, sine = math.cos(0.3), math.sin(0.3)
    turn = np.kron(np.eye(2), [[cosine, -sine], [sine, cosine]])
    rotated = vcc.Camera([*CAMERA.elements, vcc.FirstOrder(turn, z=20 * mm)], SENSOR)
    # Half of a round opening is the half along the sensor's own x, whatever rotates on the way.
    assert PhotodiodeDisparity.of(rotated).factor == pytest.approx(disparity(0.5) - disparity(1.0), rel=3e-5)
    cylinder = np.eye(4)
    cylinder[2:, :2] = -np.full((2, 2), 0.5) / 0.3
    with pytest.raises(vcc.InputError, match=r"not point along x alone"):
        PhotodiodeDisparity.of(vcc.Camera([*CAMERA.elements, vcc.FirstOrder(cylinder, z=20 * mm)], SENSOR))


def test_recordings_through_a_colour_filter_raise():
    electronics = vcc.Electronics(color_filter="RGGB")
    light = PhotodiodeImage.of(
        [[vcc.Image(np.ones((*SENSOR.shape, 3), np.float32), SENSOR.frame) for _ in range(2)]], None
    )
    recording = expose_image(light, replace(SENSOR, electronics=electronics))
    with pytest.raises(vcc.InputError, match=r"colour filter.*demosaiced"):
        depth_by_photodiodes(recording, CAMERA, (0.7, 2))
